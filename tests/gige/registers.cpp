// SPDX-License-Identifier: Apache-2.0
#include "registers.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace sightline::gige {
namespace {

constexpr std::array kReadOnly = {reg::kAddress,     reg::kMask,         reg::kTickHigh,
                                  reg::kTickLow,     reg::kLatchedHigh,  reg::kLatchedLow,
                                  reg::kPayloadSize, reg::kSensorWidth,  reg::kSensorHeight,
                                  reg::kPtpStatus,   reg::kStreamSource, reg::kPtpOffset};

}  // namespace

Registers::Registers(std::string_view xml) : bytes_(reg::kXml + (xml.size() + 3) / 4 * 4) {
  std::memcpy(bytes_.data() + reg::kXml, xml.data(), xml.size());
}

uint32_t Registers::u32(uint32_t address) const {
  uint32_t value = 0;
  for (size_t i = 0; i < 4; ++i) value = value << 8 | bytes_[address + i];
  return value;
}

void Registers::set_u32(uint32_t address, uint32_t value) {
  for (size_t i = 0; i < 4; ++i) bytes_[address + i] = static_cast<uint8_t>(value >> (24 - 8 * i));
}

uint64_t Registers::u64(uint32_t address) const {
  return uint64_t{u32(address)} << 32 | u32(address + 4);
}

void Registers::set_u64(uint32_t address, uint64_t value) {
  set_u32(address, static_cast<uint32_t>(value >> 32));
  set_u32(address + 4, static_cast<uint32_t>(value));
}

double Registers::f64(uint32_t address) const { return std::bit_cast<double>(u64(address)); }

void Registers::set_f64(uint32_t address, double value) {
  set_u64(address, std::bit_cast<uint64_t>(value));
}

void Registers::set_text(uint32_t address, size_t size, std::string_view text) {
  std::fill_n(bytes_.begin() + address, size, uint8_t{0});
  std::memcpy(bytes_.data() + address, text.data(), std::min(text.size(), size - 1));
}

bool Registers::contains(uint32_t address, size_t size) const {
  return address <= bytes_.size() && size <= bytes_.size() - address;
}

std::span<const uint8_t> Registers::read(uint32_t address, size_t size) const {
  if (!contains(address, size)) return {};
  return {bytes_.data() + address, size};
}

bool Registers::writable(uint32_t address) {
  if (address < reg::kUserName || address >= reg::kXml) return false;
  return std::find(kReadOnly.begin(), kReadOnly.end(), address & ~uint32_t{3}) == kReadOnly.end();
}

void Registers::write(uint32_t address, std::span<const uint8_t> bytes) {
  std::copy(bytes.begin(), bytes.end(), bytes_.begin() + address);
}

}  // namespace sightline::gige
