// SPDX-License-Identifier: Apache-2.0
#include "sightline/render/overlay/label.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <iterator>

namespace sightline {
namespace {

/// Longest prefix of at most `limit` bytes that does not cut a UTF-8 character.
size_t utf8_prefix(std::string_view text, size_t limit) {
  if (text.size() <= limit) return text.size();
  size_t size = limit;
  while (size > 0 && (static_cast<uint8_t>(text[size]) & 0xC0u) == 0x80u) --size;
  return size;
}

/// fmt into a label by way of the stack.
template <typename... Args>
void append_format(LabelText& label, fmt::format_string<Args...> format, Args&&... args) {
  std::array<char, 96> buffer;
  const auto end =
      fmt::format_to_n(buffer.data(), buffer.size(), format, std::forward<Args>(args)...);
  label.append({buffer.data(), std::min(end.size, buffer.size())});
}

/// Numbers keep three digits or so, and their unit, whatever their size.
void append_range(LabelText& label, double range) {
  if (range < 10) {
    append_format(label, "{:.2f} m", range);
  } else if (range < 1000) {
    append_format(label, "{:.1f} m", range);
  } else {
    append_format(label, "{:.0f} m", range);
  }
}

void append_sigma(LabelText& label, double sigma) {
  const double mm = sigma * 1e3;
  if (!(mm < 9999.5)) {
    label.append("σ > 10 m");
  } else if (mm < 10) {
    append_format(label, "σ {:.1f} mm", mm);
  } else {
    append_format(label, "σ {:.0f} mm", mm);
  }
}

/// A name may not crowd out the numbers.
constexpr size_t kMaxNameBytes = 48;

void append_name(LabelText& label, std::string_view name) {
  const size_t size = utf8_prefix(name, kMaxNameBytes);
  for (const char c : name.substr(0, size)) {
    const char shown = c == '\n' || c == '\r' || c == '\t' ? ' ' : c;
    label.append({&shown, 1});
  }
  if (size < name.size()) label.append("…");
}

void append_notice(LabelText& label, std::string_view notice) {
  if (notice.empty()) return;
  label.append(" · ");
  label.append(notice);
}

}  // namespace

void LabelText::append(std::string_view utf8) {
  const size_t size = utf8_prefix(utf8, bytes_.size() - size_);
  std::memcpy(bytes_.data() + size_, utf8.data(), size);
  size_ += size;
}

LabelText label_text(std::string_view name, const PoseEstimate& estimate,
                     const Rigid3& world_from_camera, Time capture, std::string_view notice) {
  LabelText label;
  append_name(label, name);
  label.append(" · ");
  label.append(to_string(estimate.state));
  append_notice(label, notice);
  label.append("\n");
  append_range(label, translation_distance(world_from_camera, estimate.world_from_object));
  label.append("  ");
  append_sigma(label, estimate.sigma_translation());
  const Duration age = std::max(capture - estimate.last_measured, Duration(0));
  append_format(label, "  {:.0f} ms", to_seconds(age) * 1e3);
  return label;
}

LabelText status_text(std::string_view name, TrackState state, std::string_view notice) {
  LabelText label;
  append_name(label, name);
  label.append(": ");
  label.append(to_string(state));
  append_notice(label, notice);
  return label;
}

LabelText offscreen_text(std::string_view name, double range) {
  LabelText label;
  append_name(label, name);
  label.append(" ");
  append_range(label, range);
  return label;
}

LabelText last_seen_text(std::string_view name, Duration age) {
  LabelText label;
  append_name(label, name);
  append_format(label, " last seen {:.1f} s ago", std::max(to_seconds(age), 0.0));
  return label;
}

TrackState state_without_pose(const PoseTrack* track) {
  if (track == nullptr || track->empty()) return TrackState::kSearching;
  return track->newest().state == TrackState::kSearching ? TrackState::kSearching
                                                         : TrackState::kLost;
}

}  // namespace sightline
