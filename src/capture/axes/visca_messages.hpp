// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "sightline/capture/axes/axis_source.hpp"
#include "sightline/geometry/head_drive.hpp"

namespace sightline::capture {

constexpr int kViscaPanSpeeds = 24, kViscaTiltSpeeds = 20;
/// Of camera 1; inquiries of pan and tilt, and of the zoom.
constexpr std::array<uint8_t, 5> kViscaAskPosition = {0x81, 0x09, 0x06, 0x12, 0xFF};
constexpr std::array<uint8_t, 5> kViscaAskZoom = {0x81, 0x09, 0x04, 0x47, 0xFF};
/// Of so many inquiries one is of the zoom.
constexpr int kViscaZoomEvery = 8;

/// An order for camera 1, whose positions count in steps of `count` [rad] and which turns at
/// `fastest` [rad/s] at its fastest step. Speeds are equal steps of that, and never faster than
/// what is ordered but for the slowest one.
std::array<uint8_t, 15> format_visca_order(const HeadOrder& order, double count, double fastest);

/// Of parse_visca_position(), in steps of `count` [rad].
AxisReading visca_reading(const std::pair<int, int>& position, double count, double zoom,
                          Time stamp);

}  // namespace sightline::capture
