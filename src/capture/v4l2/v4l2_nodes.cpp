// SPDX-License-Identifier: Apache-2.0
#include "capture/v4l2/v4l2_nodes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <map>
#include <string_view>

#include "capture/v4l2/v4l2_device.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"

namespace sightline::capture {
namespace {

namespace fs = std::filesystem;

std::string line_of(const fs::path& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  while (!line.empty() && (line.back() == ' ' || line.back() == '\n')) line.pop_back();
  // The device's own words, which end up on terminals.
  std::replace_if(
      line.begin(), line.end(),
      [](char c) { return static_cast<unsigned char>(c) < ' ' || c == 0x7f; }, '?');
  return line;
}

int number_of(std::string_view text) {
  int number = 0;
  std::from_chars(text.data(), text.data() + text.size(), number);
  return number;
}

// From the file name of a node ("video0") to the link that udev made for it.
std::map<std::string, std::string> links_in(const fs::path& folder) {
  std::map<std::string, std::string> links;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(folder, error)) {
    const auto target = fs::read_symlink(entry.path(), error);
    if (error) continue;
    // Several links may name one node; the first by name is the same every time.
    std::string& link = links[target.filename().string()];
    if (link.empty() || entry.path().string() < link) link = entry.path().string();
  }
  return links;
}

// Climbs from the node's sysfs folder to the USB device it hangs on.
void read_usb(const fs::path& sys, V4l2Node& node) {
  std::error_code error;
  fs::path folder = fs::canonical(sys / "device", error);
  if (error) return;
  for (int depth = 0; depth < 8 && folder.has_relative_path(); ++depth) {
    if (fs::exists(folder / "idVendor", error)) {
      node.usb_port = folder.filename().string();
      node.serial = line_of(folder / "serial");
      const std::string maker = line_of(folder / "manufacturer");
      const std::string product = line_of(folder / "product");
      node.model = maker.empty() || product.empty() ? maker + product : maker + " " + product;
      return;
    }
    folder = folder.parent_path();
  }
}

std::string described(const V4l2Node& node) {
  std::string text = fmt::format("{} ({}", node.path, node.card);
  if (!node.serial.empty()) text += fmt::format(", serial:{}", node.serial);
  if (!node.usb_port.empty()) text += fmt::format(", usb:{}", node.usb_port);
  return text + ")";
}

// Webcams bring a metadata node beside the one that captures; it has a higher index.
bool is_main(const V4l2Node& node) { return node.index == 0; }

std::string list_of(const std::vector<V4l2Node>& nodes) {
  std::string text;
  for (const V4l2Node& node : nodes) {
    if (is_main(node)) text += (text.empty() ? "" : ", ") + described(node);
  }
  return text.empty() ? "no camera" : text;
}

struct Part {
  enum class Kind { kPath, kSerial, kUsb, kCard } kind;
  std::string value;

  bool is_place() const { return kind == Kind::kPath || kind == Kind::kUsb; }
};

Result<std::vector<Part>> parts_of(const std::string& device, const std::string& where) {
  std::vector<Part> parts;
  for (size_t begin = 0; begin <= device.size();) {
    const size_t end = std::min(device.find(',', begin), device.size());
    const std::string word = device.substr(begin, end - begin);
    begin = end + 1;
    if (word.starts_with("/")) {
      parts.push_back({Part::Kind::kPath, word});
    } else if (word.starts_with("serial:") && word.size() > 7) {
      parts.push_back({Part::Kind::kSerial, word.substr(7)});
    } else if (word.starts_with("usb:") && word.size() > 4) {
      parts.push_back({Part::Kind::kUsb, word.substr(4)});
    } else if (word.starts_with("card:") && word.size() > 5) {
      parts.push_back({Part::Kind::kCard, word.substr(5)});
    } else {
      return make_error(ErrorCode::kInvalidInput, where,
                        "'{}' names no V4L2 camera: give a path, serial:TEXT, usb:PORT or "
                        "card:NAME, as `sightline cameras` lists them",
                        word);
    }
  }
  return parts;
}

bool holds(const Part& part, const V4l2Node& node) {
  switch (part.kind) {
    case Part::Kind::kPath:
      if (part.value == node.path || part.value == node.by_id || part.value == node.by_path) {
        return true;
      } else {
        std::error_code error;
        const fs::path target = fs::canonical(part.value, error);
        return !error && target.filename() == fs::path(node.path).filename();
      }
    case Part::Kind::kSerial:
      return is_main(node) && part.value == node.serial;
    case Part::Kind::kUsb:
      return is_main(node) && part.value == node.usb_port;
    case Part::Kind::kCard:
      return is_main(node) && part.value == node.card;
  }
  return false;
}

DeviceInfo info_of(const V4l2Node& node) {
  DeviceInfo info;
  info.scheme = "v4l2";
  info.id = stable_v4l2_id(node);
  info.model = node.model.empty() ? node.card : node.model;
  info.serial = node.serial;
  info.where =
      node.usb_port.empty() ? node.path : fmt::format("{}, usb:{}", node.path, node.usb_port);
  return info;
}

}  // namespace

std::vector<V4l2Node> find_v4l2_nodes(const V4l2Places& places) {
  const fs::path dev = places.dev;
  const auto by_id = links_in(dev / "v4l/by-id"), by_path = links_in(dev / "v4l/by-path");
  const auto link = [](const auto& links, const std::string& name) {
    const auto found = links.find(name);
    return found == links.end() ? std::string() : found->second;
  };
  std::vector<V4l2Node> nodes;
  std::error_code error;
  for (const auto& entry : fs::directory_iterator(places.sys, error)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with("video")) continue;
    V4l2Node node;
    node.path = (dev / name).string();
    node.card = line_of(entry.path() / "name");
    node.index = number_of(line_of(entry.path() / "index"));
    node.by_id = link(by_id, name);
    node.by_path = link(by_path, name);
    read_usb(entry.path(), node);
    nodes.push_back(std::move(node));
  }
  std::sort(nodes.begin(), nodes.end(), [](const V4l2Node& a, const V4l2Node& b) {
    return a.path.size() != b.path.size() ? a.path.size() < b.path.size() : a.path < b.path;
  });
  return nodes;
}

Result<V4l2Node> choose_v4l2_node(const std::string& device, const std::vector<V4l2Node>& nodes,
                                  const std::string& where) {
  SL_ASSIGN(const auto parts, parts_of(device, where));
  std::vector<const V4l2Node*> all, at_place;
  for (const V4l2Node& node : nodes) {
    bool fits = true, right_place = true, names_place = false;
    for (const Part& part : parts) {
      const bool held = holds(part, node);
      fits &= held;
      names_place |= part.is_place();
      right_place &= held || !part.is_place();
    }
    if (fits) all.push_back(&node);
    if (names_place && right_place) at_place.push_back(&node);
  }
  if (all.size() == 1) return *all.front();
  if (all.size() > 1) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "'{}' fits both {} and {}; name the port as well: usb:PORT,{}", device,
                      described(*all[0]), described(*all[1]), device);
  }
  if (!at_place.empty()) {
    return make_error(
        ErrorCode::kInvalidInput, where,
        "identity mismatch: '{}' is asked for, but the camera there is {}; were cameras "
        "swapped?",
        device, described(*at_place.front()));
  }
  return make_error(ErrorCode::kUnavailable, where, "no camera '{}' is plugged in; there is: {}",
                    device, list_of(nodes));
}

std::string stable_v4l2_id(const V4l2Node& node) {
  if (!node.by_id.empty()) return node.by_id;
  return node.by_path.empty() ? node.path : node.by_path;
}

Result<std::vector<DeviceInfo>> list_v4l2_in(const V4l2Places& places,
                                             const std::shared_ptr<V4l2System>& system) {
  std::vector<DeviceInfo> list;
  for (const V4l2Node& node : find_v4l2_nodes(places)) {
    DeviceInfo info = info_of(node);
    const auto device = V4l2Device::open(system, node.path, "");
    if (!device) {
      if (!is_main(node)) continue;
      info.note = device.error().text;
    } else {
      for (V4l2Mode& mode : v4l2_modes(*device)) {
        info.formats.push_back(
            {fourcc_name(mode.fourcc), mode.width, mode.height, std::move(mode.rates_hz)});
      }
    }
    list.push_back(std::move(info));
  }
  return list;
}

}  // namespace sightline::capture

namespace sightline {

Result<std::vector<DeviceInfo>> list_v4l2() {
  return capture::list_v4l2_in({}, capture::real_v4l2_system());
}

}  // namespace sightline
