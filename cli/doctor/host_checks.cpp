// SPDX-License-Identifier: Apache-2.0
#include "doctor/host_checks.hpp"

#include <fmt/format.h>
#include <grp.h>
#include <sys/stat.h>
#include <sys/timex.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <map>
#include <optional>
#include <set>

#include "sightline/stream/encoder.hpp"

namespace sightline::cli {
namespace {

namespace fs = std::filesystem;

// Of one frame of a large GigE Vision camera, and of the frames of a USB3 Vision camera that are
// under way (docs/cameras.md).
constexpr int64_t kSocketBuffer = 32 << 20;
constexpr int64_t kUsbMemoryMb = 200;
constexpr int64_t kJumboFrame = 9000;
constexpr int64_t kUsb2Mbps = 480;

std::string read_word(const fs::path& file) {
  std::ifstream stream(file);
  std::string word;
  stream >> word;
  return word;
}

std::optional<int64_t> read_number(const fs::path& file) {
  const std::string word = read_word(file);
  int64_t number = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), number);
  if (word.empty() || error != std::errc() || end != word.data() + word.size()) return {};
  return number;
}

// In the order of their names.
std::vector<fs::path> entries(const fs::path& folder, std::string_view prefix = "") {
  std::vector<fs::path> found;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    if (at->path().filename().string().starts_with(prefix)) found.push_back(at->path());
  }
  std::sort(found.begin(), found.end());
  return found;
}

std::string group_of(const fs::path& file) {
  struct stat status {};
  if (stat(file.c_str(), &status) != 0) return "";
  group entry{};
  group* found = nullptr;
  char names[4096];
  if (getgrgid_r(status.st_gid, &entry, names, sizeof(names), &found) == 0 && found != nullptr) {
    return entry.gr_name;
  }
  return fmt::format("{}", status.st_gid);
}

void check_access(const fs::path& root, const fs::path& file, const char* what, HostState refused,
                  std::vector<HostFinding>& findings) {
  const std::string name = fmt::format("/{}", fs::relative(file, root).string());
  if (access(file.c_str(), R_OK | W_OK) == 0) {
    findings.push_back({"devices", HostState::kGood, fmt::format("{} may be used", name)});
  } else if (errno == EACCES) {
    findings.push_back(
        {"devices", refused,
         fmt::format("{} ({}) may not be opened by this user; it belongs to the group {}: "
                     "usermod --append --groups {} USER, then log in again",
                     name, what, group_of(file), group_of(file))});
  } else {
    findings.push_back({"devices", refused, fmt::format("{}: {}", name, std::strerror(errno))});
  }
}

// The device of an interface, 1-2:1.0 being one of 1-2.
fs::path device_of(const fs::path& interface) {
  const std::string name = interface.filename().string();
  return interface.parent_path() / name.substr(0, name.find(':'));
}

void check_usb_memory(const fs::path& root, std::vector<HostFinding>& findings) {
  const auto memory = read_number(root / "sys/module/usbcore/parameters/usbfs_memory_mb");
  if (!memory) return;
  const bool enough = *memory == 0 || *memory >= kUsbMemoryMb;  // 0: no bound
  findings.push_back(
      {"usb", enough ? HostState::kGood : HostState::kWrong,
       enough ? std::string("memory for USB3 Vision cameras is enough")
              : fmt::format("a USB3 Vision camera is plugged in, and the kernel gives {} MB for "
                            "frames that are under way: echo 1000 > "
                            "/sys/module/usbcore/parameters/usbfs_memory_mb, and for good "
                            "usbcore.usbfs_memory_mb=1000 on the kernel's command line",
                            *memory)});
}

bool is_physical(const fs::path& interface) {
  std::error_code error;
  return fs::exists(interface / "device", error);
}

// The lowest temperature at which the kernel acts, in thousandths of a degree.
std::optional<int64_t> lowest_trip(const fs::path& zone) {
  std::optional<int64_t> lowest;
  for (const fs::path& file : entries(zone, "trip_point_")) {
    const std::string name = file.filename().string();
    if (!name.ends_with("_type")) continue;
    const std::string type = read_word(file);
    if (type != "passive" && type != "hot" && type != "critical") continue;
    const auto at = read_number(zone / (name.substr(0, name.size() - 4) + "temp"));
    if (at && *at > 0) lowest = lowest ? std::min(*lowest, *at) : *at;
  }
  return lowest;
}

}  // namespace

void check_devices(const fs::path& root, std::vector<HostFinding>& findings) {
  const auto cameras = entries(root / "dev", "video");
  for (const fs::path& file : cameras) {
    check_access(root, file, "camera", HostState::kWrong, findings);
  }
  if (cameras.empty()) {
    findings.push_back({"devices", HostState::kAdvice,
                        "the kernel shows no camera (/dev/video*); network cameras need none"});
  }
  for (const fs::path& file : entries(root / "dev/dri", "render")) {
    check_access(root, file, "GPU", HostState::kAdvice, findings);
  }
}

void check_usb(const fs::path& root, std::vector<HostFinding>& findings) {
  bool vision = false;
  std::map<int64_t, std::set<fs::path>> slow;  // cameras at USB 2 speed, by bus
  for (const fs::path& interface : entries(root / "sys/bus/usb/devices")) {
    const std::string kind = read_word(interface / "bInterfaceClass");
    vision |= kind == "ef" && read_word(interface / "bInterfaceSubClass") == "05";
    if (kind != "0e") continue;
    const fs::path device = device_of(interface);
    const auto bus = read_number(device / "busnum"), speed = read_number(device / "speed");
    if (bus && speed && *speed <= kUsb2Mbps) slow[*bus].insert(device);
  }
  for (const auto& [bus, devices] : slow) {
    if (devices.size() < 2) continue;
    findings.push_back(
        {"usb", HostState::kAdvice,
         fmt::format(
             "{} cameras share the {} Mbit/s of USB bus {}: where one says that there is no "
             "bandwidth left, use MJPEG, a lower rate or another controller",
             devices.size(), kUsb2Mbps, bus)});
  }
  if (vision) check_usb_memory(root, findings);
}

void check_network(const fs::path& root, std::vector<HostFinding>& findings) {
  if (const auto buffer = read_number(root / "proc/sys/net/core/rmem_max")) {
    const bool enough = *buffer >= kSocketBuffer;
    findings.push_back(
        {"network", enough ? HostState::kGood : HostState::kAdvice,
         enough ? std::string("socket buffers are large enough for GigE Vision")
                : fmt::format("socket buffers are at most {} KiB; GigE Vision cameras lose packets "
                              "with less than a frame: sysctl net.core.rmem_max={}",
                              *buffer >> 10, kSocketBuffer)});
  }
  for (const fs::path& interface : entries(root / "sys/class/net")) {
    const auto mtu = read_number(interface / "mtu");
    if (!mtu || !is_physical(interface)) continue;
    const std::string name = interface.filename().string();
    const bool jumbo = *mtu >= kJumboFrame;
    findings.push_back(
        {"network", jumbo ? HostState::kGood : HostState::kAdvice,
         jumbo ? fmt::format("{} takes jumbo frames", name)
               : fmt::format("{} has an MTU of {}; GigE Vision cameras on it want jumbo frames: ip "
                             "link set {} mtu {}, on every switch, too",
                             name, *mtu, name, kJumboFrame)});
  }
}

void check_temperature(const fs::path& root, std::vector<HostFinding>& findings) {
  for (const fs::path& zone : entries(root / "sys/class/thermal", "thermal_zone")) {
    const auto now = read_number(zone / "temp"), trip = lowest_trip(zone);
    if (!now || !trip) continue;
    const bool hot = *now >= *trip;
    findings.push_back(
        {"temperature", hot ? HostState::kWrong : HostState::kGood,
         fmt::format("{} is at {} degrees; from {} on the host {}", read_word(zone / "type"),
                     *now / 1000, *trip / 1000,
                     hot ? "slows down: clean its fans, give it air" : "would slow down")});
  }
  int64_t throttled = 0;
  for (const fs::path& cpu : entries(root / "sys/devices/system/cpu", "cpu")) {
    const auto count = read_number(cpu / "thermal_throttle/core_throttle_count");
    throttled = std::max(throttled, count.value_or(0));
  }
  if (throttled > 0) {
    findings.push_back({"temperature", HostState::kAdvice,
                        fmt::format("a core was slowed down {} times since the host started, since "
                                    "it was too hot: clean its fans, give it air",
                                    throttled)});
  }
}

void check_clock(std::vector<HostFinding>& findings) {
  timex state{};
  const bool known = adjtimex(&state) >= 0;
  if (!known) return;
  const bool steered = (state.status & STA_UNSYNC) == 0;
  findings.push_back(
      {"clock", steered ? HostState::kGood : HostState::kAdvice,
       steered ? std::string("the clock is synchronized")
               : std::string("the clock is not synchronized: times of poses and recordings cannot "
                             "be compared with other hosts; install chrony")});
}

void check_encoder(std::vector<HostFinding>& findings) {
  for (const std::string& element : known_h264_encoders()) {
    if (!h264_encoder_works(element)) continue;
    findings.push_back({"encoder", HostState::kGood, fmt::format("{} encodes H.264", element)});
    return;
  }
  findings.push_back({"encoder", HostState::kWrong,
                      "nothing encodes H.264: install gstreamer1.0-plugins-ugly (x264enc)"});
}

}  // namespace sightline::cli
