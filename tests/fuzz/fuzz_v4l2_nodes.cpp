// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "capture/v4l2/v4l2_nodes.hpp"

namespace {

namespace fs = std::filesystem;

/// A /sys and /dev with one webcam, whose files are written anew for each input.
struct Tree {
  Tree() : root(fs::temp_directory_path() / ("fuzz-nodes-" + std::to_string(::getpid()))) {
    fs::create_directories(root / "sys/class/video4linux/video0");
    fs::create_directories(root / "sys/devices/usb1/1-2/1-2:1.0");
    fs::create_directory_symlink(root / "sys/devices/usb1/1-2/1-2:1.0",
                                 root / "sys/class/video4linux/video0/device");
  }
  ~Tree() { fs::remove_all(root); }

  fs::path root;
};

void put(const fs::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

bool has_control(const std::string& text) {
  return std::any_of(text.begin(), text.end(),
                     [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
}

}  // namespace

/// What a camera says of itself (USB descriptors, as the kernel shows them) can be anything: the
/// node is listed without control characters, and is found again by the name it was listed under.
/// The input: six texts with zeros between, the last one the installation's `device`.
extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const Tree tree;
  std::array<std::string, 6> texts;
  size_t which = 0;
  for (size_t i = 0; i < size; ++i) {
    if (data[i] == 0 && which + 1 < texts.size()) {
      ++which;
    } else {
      texts[which] += static_cast<char>(data[i]);
    }
  }
  const fs::path node = tree.root / "sys/class/video4linux/video0";
  const fs::path usb = tree.root / "sys/devices/usb1/1-2";
  put(node / "name", texts[0]);
  put(node / "index", texts[1]);
  put(usb / "idVendor", "1d6b");
  put(usb / "serial", texts[2]);
  put(usb / "manufacturer", texts[3]);
  put(usb / "product", texts[4]);
  const auto nodes = sightline::capture::find_v4l2_nodes(
      {(tree.root / "sys/class/video4linux").string(), (tree.root / "dev").string()});
  if (nodes.size() != 1) std::abort();
  const sightline::capture::V4l2Node& found = nodes.front();
  for (const std::string* text : {&found.card, &found.serial, &found.model, &found.usb_port}) {
    if (has_control(*text)) std::abort();
  }
  const auto again = sightline::capture::choose_v4l2_node(sightline::capture::stable_v4l2_id(found),
                                                          nodes, "camera");
  if (!again || again->path != found.path) std::abort();
  const auto chosen = sightline::capture::choose_v4l2_node(texts[5], nodes, "camera");
  if (!chosen && chosen.error().text.empty()) std::abort();
  return 0;
}
