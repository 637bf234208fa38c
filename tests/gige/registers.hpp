// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace sightline::gige {

/// Where things are in the camera's memory. Below 0xA000: as GigE Vision 2.0 lays them out; from
/// 0x10000 on: this camera's own, told to the host by its XML.
namespace reg {
inline constexpr uint32_t kVersion = 0x0000, kDeviceMode = 0x0004, kMacHigh = 0x0008,
                          kMacLow = 0x000C, kIpSupported = 0x0010, kIpCurrent = 0x0014,
                          kAddress = 0x0024, kMask = 0x0034, kVendor = 0x0048, kModel = 0x0068,
                          kDeviceVersion = 0x0088, kInfo = 0x00A8, kSerial = 0x00D8,
                          kUserName = 0x00E8, kXmlUrl = 0x0200, kInterfaces = 0x0600,
                          kMessageChannels = 0x0900, kStreamChannels = 0x0904,
                          kActionSignals = 0x0908, kActionDeviceKey = 0x090C,
                          kStreamCapability = 0x092C, kCapability = 0x0934, kHeartbeat = 0x0938,
                          kTickHigh = 0x093C, kTickLow = 0x0940, kTimestampControl = 0x0944,
                          kLatchedHigh = 0x0948, kLatchedLow = 0x094C, kPrivilege = 0x0A00,
                          kStreamPort = 0x0D00, kPacketSize = 0x0D04, kPacketDelay = 0x0D08,
                          kStreamAddress = 0x0D18, kStreamSource = 0x0D1C, kGroupKey = 0x9800,
                          kGroupMask = 0x9804;
inline constexpr uint32_t kOwn = 0x10000;
inline constexpr uint32_t kWidth = kOwn + 0x00, kHeight = kOwn + 0x04, kOffsetX = kOwn + 0x08,
                          kOffsetY = kOwn + 0x0C, kPixelFormat = kOwn + 0x10,
                          kSensorWidth = kOwn + 0x14, kSensorHeight = kOwn + 0x18,
                          kPayloadSize = kOwn + 0x1C, kAcquisitionMode = kOwn + 0x20,
                          kAcquisition = kOwn + 0x24, kFrameRate = kOwn + 0x28,
                          kExposureTime = kOwn + 0x30, kGain = kOwn + 0x38,
                          kExposureAuto = kOwn + 0x40, kGainAuto = kOwn + 0x44,
                          kFrameRateEnable = kOwn + 0x48, kTriggerMode = kOwn + 0x4C,
                          kTriggerSource = kOwn + 0x50, kTriggerActivation = kOwn + 0x54,
                          kTriggerSoftware = kOwn + 0x58, kFrameCount = kOwn + 0x5C,
                          kTriggerDelay = kOwn + 0x60, kChunkMode = kOwn + 0x68,
                          kChunkSelector = kOwn + 0x6C, kChunkEnable = kOwn + 0x70,  // 4 of them
    kPtpEnable = kOwn + 0x80, kPtpStatus = kOwn + 0x84, kPtpLatch = kOwn + 0x88,
                          kPtpOffset = kOwn + 0x90, kLineSelector = kOwn + 0x98,
                          kLineMode = kOwn + 0x9C,  // 2 of them
    kLineSource = kOwn + 0xA4,                      // 2 of them
    kExtendedIds = kOwn + 0xAC, kTriggerSelector = kOwn + 0xB0, kActionSelector = kOwn + 0xB4,
                          kBinning = kOwn + 0xB8, kLocked = kOwn + 0xBC;
inline constexpr uint32_t kXml = 0x20000;
}  // namespace reg

/// Chunk ids, which the XML gives as well.
enum class Chunk : uint32_t { kImage = 1, kTimestamp = 2, kExposureTime = 3, kFrameId = 4 };

/// The camera's memory, big-endian throughout. Knows what may be written, not what it does.
class Registers {
 public:
  explicit Registers(std::string_view xml);

  uint32_t u32(uint32_t address) const;
  void set_u32(uint32_t address, uint32_t value);
  uint64_t u64(uint32_t address) const;
  void set_u64(uint32_t address, uint64_t value);
  double f64(uint32_t address) const;
  void set_f64(uint32_t address, double value);
  void set_text(uint32_t address, size_t size, std::string_view text);

  /// Empty where there is no memory.
  std::span<const uint8_t> read(uint32_t address, size_t size) const;
  bool contains(uint32_t address, size_t size) const;
  static bool writable(uint32_t address);
  void write(uint32_t address, std::span<const uint8_t> bytes);

 private:
  std::vector<uint8_t> bytes_;
};

/// The XML that describes the camera to a GenICam client. `without_latch`: no time-stamp latch.
std::string camera_xml(int sensor_width, int sensor_height, bool without_latch);

}  // namespace sightline::gige
