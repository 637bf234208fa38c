// SPDX-License-Identifier: Apache-2.0
#include "config/zones.hpp"

namespace sightline::config {
namespace {

constexpr size_t kMostZones = 64;

void read_objects(TomlTable& table, const Installation& installation, ZoneConfig& zone) {
  const auto names = table.texts("objects");
  if (!names) return;
  std::vector<std::string> known;
  for (const ObjectConfig& object : installation.objects) known.push_back(object.description.name);
  for (const PlacedText& name : *names) {
    if (std::ranges::find(known, name.text) == known.end()) {
      table.problem("objects", fmt::format("there is no object \"{}\"{}", name.text,
                                           suggestion(name.text, known)));
    }
    zone.objects.push_back(name.text);
  }
}

void read_name(TomlTable& table, const Installation& installation, ZoneConfig& zone) {
  if (!table.require("name", "what the zone is called, as in \"conveyor\"")) return;
  const auto name = table.text("name");
  if (!name) return;
  zone.name = name->text;
  if (!object_name_fault(zone.name).empty()) {
    table.problem("name", "has 1 to 64 bytes, no commas, quotes or control characters");
  }
  if (std::ranges::find(installation.zones, zone.name, &ZoneConfig::name) !=
      installation.zones.end()) {
    table.problem("name", fmt::format("there is a zone \"{}\" already", zone.name));
  }
}

}  // namespace

void read_zones(TomlTable& root, const std::filesystem::path& path, const InstallationFiles& files,
                Installation& installation) {
  auto tables = root.tables("zone");
  if (tables.size() > kMostZones) {
    root.problem("zone", fmt::format("{} zones; at most {}", tables.size(), kMostZones));
    return;
  }
  for (TomlTable& table : tables) {
    ZoneConfig zone;
    read_name(table, installation, zone);
    read_objects(table, installation, zone);
    SectionReader(table, path, files).choices("record", zone.record, kRecordingKindNames);
    if (!zone.record.empty() && installation.record.directory.empty()) {
      table.problem("record",
                    "[record] directory has to name the folder that takes the recordings");
    }
    if (const auto box = read_box(table)) zone.box = *box;  // last: it looks for unknown keys
    installation.zones.push_back(std::move(zone));
  }
}

}  // namespace sightline::config
