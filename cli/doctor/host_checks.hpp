// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace sightline::cli {

enum class HostState {
  kGood,
  kAdvice,  ///< works, and would work better, or matters for some kinds of cameras only
  kWrong,   ///< something that was asked for will not work
};

/// One thing about the host, in words for who runs it.
struct HostFinding {
  std::string subject;
  HostState state = HostState::kGood;
  std::string text;
};

/// Each looks at what the kernel shows in files below `root` ("/" for this host) and adds what it
/// finds. What is not there to be read is left out.
void check_devices(const std::filesystem::path& root, std::vector<HostFinding>& findings);
void check_usb(const std::filesystem::path& root, std::vector<HostFinding>& findings);
void check_network(const std::filesystem::path& root, std::vector<HostFinding>& findings);
void check_temperature(const std::filesystem::path& root, std::vector<HostFinding>& findings);

/// Whether the kernel's clock is steered by something.
void check_clock(std::vector<HostFinding>& findings);

/// Tries the H.264 encoders until one works; takes seconds.
void check_encoder(std::vector<HostFinding>& findings);

}  // namespace sightline::cli
