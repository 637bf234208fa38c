// SPDX-License-Identifier: Apache-2.0
#include "cameras/device_listing.hpp"

#include <nlohmann/json.hpp>

#include "sightline/capture/aravis/aravis_source.hpp"
#include "sightline/capture/libcamera/libcamera_source.hpp"
#include "sightline/capture/v4l2/v4l2_source.hpp"

namespace sightline::cli {
namespace {

using Json = nlohmann::ordered_json;

void add(DeviceListing& listing, const char* kind, Result<std::vector<DeviceInfo>> found) {
  if (!found) {
    listing.notes.push_back(fmt::format("{}: {}", kind, found.error().message()));
    return;
  }
  for (DeviceInfo& device : *found) listing.devices.push_back(std::move(device));
}

FormatInfo format_from(const Json& json) {
  FormatInfo format;
  format.pixel_format = json.at("format").get<std::string>();
  format.width = json.at("width").get<int>();
  format.height = json.at("height").get<int>();
  format.rates_hz = json.at("rates_hz").get<std::vector<double>>();
  return format;
}

DeviceInfo device_from(const Json& json) {
  DeviceInfo device;
  const auto source = json.at("source").get<std::string>();
  const size_t colon = source.find(':');
  device.scheme = source.substr(0, colon);
  device.id = colon == std::string::npos ? "" : source.substr(colon + 1);
  device.model = json.at("model").get<std::string>();
  device.serial = json.at("serial").get<std::string>();
  device.where = json.at("where").get<std::string>();
  device.note = json.at("note").get<std::string>();
  for (const Json& format : json.at("formats")) device.formats.push_back(format_from(format));
  return device;
}

}  // namespace

DeviceListing list_devices() {
  DeviceListing listing;
  add(listing, "v4l2", list_v4l2());
  add(listing, "aravis", list_aravis(true));
  add(listing, "libcamera", list_libcamera());
  return listing;
}

std::string source_of(const DeviceInfo& device) { return device.scheme + ":" + device.id; }

Json json_of(const DeviceListing& listing) {
  Json json{{"cameras", Json::array()}, {"notes", listing.notes}};
  for (const DeviceInfo& device : listing.devices) {
    Json formats = Json::array();
    for (const FormatInfo& format : device.formats) {
      formats.push_back({{"format", format.pixel_format},
                         {"width", format.width},
                         {"height", format.height},
                         {"rates_hz", format.rates_hz}});
    }
    json["cameras"].push_back({{"source", source_of(device)},
                               {"model", device.model},
                               {"serial", device.serial},
                               {"where", device.where},
                               {"formats", std::move(formats)},
                               {"note", device.note}});
  }
  return json;
}

Result<DeviceListing> parse_device_listing(const std::string& text, const std::string& where) {
  try {
    const Json json = Json::parse(text);
    DeviceListing listing;
    for (const Json& camera : json.at("cameras")) listing.devices.push_back(device_from(camera));
    listing.notes = json.at("notes").get<std::vector<std::string>>();
    return listing;
  } catch (const Json::exception& error) {
    return make_error(ErrorCode::kInvalidInput, where,
                      "this is not what `sightline cameras --json` prints: {}", error.what());
  }
}

}  // namespace sightline::cli
