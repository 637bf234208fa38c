// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "capture/v4l2/v4l2_nodes.hpp"

namespace sightline::test {

/// A made-up /sys and /dev in a folder of its own, removed at the end.
class DeviceTree {
 public:
  DeviceTree() {
    static int count = 0;
    root_ = std::filesystem::path(SIGHTLINE_BINARY_DIR) /
            ("devices-" + std::to_string(::getpid()) + "-" + std::to_string(count++));
    std::filesystem::create_directories(root_ / "sys/class/video4linux");
    std::filesystem::create_directories(root_ / "dev/v4l/by-id");
    std::filesystem::create_directories(root_ / "dev/v4l/by-path");
  }
  DeviceTree(const DeviceTree&) = delete;
  DeviceTree& operator=(const DeviceTree&) = delete;
  ~DeviceTree() { std::filesystem::remove_all(root_); }

  capture::V4l2Places places() const {
    return {(root_ / "sys/class/video4linux").string(), dev("")};
  }
  std::string dev(const std::string& name) const { return (root_ / "dev" / name).string(); }

  /// A node of a USB camera; a port of "" makes one that hangs on nothing.
  void add(int number, const std::string& card, const std::string& port = "",
           const std::string& serial = "", int index = 0) {
    namespace fs = std::filesystem;
    const std::string name = "video" + std::to_string(number);
    const fs::path node = root_ / "sys/class/video4linux" / name;
    fs::create_directories(node);
    write(node / "name", card);
    write(node / "index", std::to_string(index));
    write(root_ / "dev" / name, "");
    if (port.empty()) return;
    const fs::path usb = root_ / "sys/devices/pci0000:00/usb1" / port;
    const fs::path interface = usb / (port + ":1.0");
    fs::create_directories(interface);
    write(usb / "idVendor", "1d6b");
    write(usb / "product", "Webcam");
    write(usb / "manufacturer", "Maker");
    if (!serial.empty()) write(usb / "serial", serial);
    fs::create_directory_symlink(interface, node / "device");
    const std::string suffix = "-video-index" + std::to_string(index);
    link("by-path/pci-0000:00:01.0-usb-" + port + suffix, name);
    if (!serial.empty()) link("by-id/usb-Maker_Webcam_" + serial + suffix, name);
  }
  void remove(int number) {
    const std::string name = "video" + std::to_string(number);
    std::filesystem::remove_all(root_ / "sys/class/video4linux" / name);
    std::filesystem::remove(root_ / "dev" / name);
  }

 private:
  static void write(const std::filesystem::path& file, const std::string& text) {
    std::ofstream(file) << text << "\n";
  }
  void link(const std::string& name, const std::string& node) {
    std::error_code taken;  // equal serial numbers: the first keeps the link
    std::filesystem::create_symlink("../../" + node, root_ / "dev/v4l" / name, taken);
  }

  std::filesystem::path root_;
};

}  // namespace sightline::test
