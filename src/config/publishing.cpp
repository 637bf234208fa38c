// SPDX-License-Identifier: Apache-2.0
#include "config/publishing.hpp"

#include <unistd.h>

#include <array>

#include "config/names.hpp"
#include "config/section_reader.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline::config {
namespace {

constexpr std::string_view kTopicWanted =
    "a topic without +, # and a / in front, as in \"site/sightline\"";

bool is_topic(const std::string& topic) {
  return !topic.empty() && topic.find_first_of("+#") == std::string::npos && topic[0] != '/';
}

std::string machine_name() {
  std::array<char, 256> name{};
  if (gethostname(name.data(), name.size() - 1) != 0) return {};
  return name.data();
}

}  // namespace

void read_publish(TomlTable& root, const std::filesystem::path& path,
                  const InstallationFiles& files, Installation& installation) {
  auto publish = root.table("publish");
  if (!publish) return;
  if (auto mqtt = publish->table("mqtt")) {
    SectionReader reader(*mqtt, path, files);
    visit(reader, installation.mqtt);
    if (!is_topic(installation.mqtt.topic)) mqtt->problem("topic", kTopicWanted);
    if (!mqtt_available() && !installation.mqtt.host.empty()) {
      mqtt->problem("host", "this program was built without MQTT (libmosquitto)",
                    ErrorCode::kUnavailable);
    }
    mqtt->finish();
  }
  publish->finish();
}

void read_cell(TomlTable& root, const std::filesystem::path& path, const InstallationFiles& files,
               Installation& installation) {
  auto table = root.table("cell");
  if (!table) return;
  CellOptions& cell = installation.cell;
  SectionReader reader(*table, path, files);
  visit(reader, cell);
  if (!is_topic(cell.name)) table->problem("name", kTopicWanted);
  if (cell.enabled()) {
    if (cell.host.empty()) cell.host = machine_name();
    if (const auto fault = camera_name_fault(cell.host); !fault.empty()) {
      table->problem("host", "of this machine, as a camera's name: letters, digits, '-', '_', '.'");
    }
    if (!cell_available()) {
      table->problem("broker", "this program was built without MQTT (libmosquitto, protobuf)",
                     ErrorCode::kUnavailable);
    }
  } else if (cell.role != CellRole::kBoth) {
    table->problem("role",
                   "works with other hosts only: say where their broker is, as in broker = "
                   "\"192.168.1.10\", or leave role out");
  }
  if (cell.broker.certificate.empty() != cell.broker.key.empty()) {
    table->problem(cell.broker.key.empty() ? "certificate" : "key",
                   "certificate and key, or neither");
  } else if (!cell.broker.key.empty() && cell.broker.ca_file.empty()) {
    table->problem("certificate", "needs ca_file, which makes the connection TLS");
  }
  table->finish();
}

bool is_remote(TomlTable& camera, const Installation& installation, std::string& host) {
  const auto named = camera.text("host");
  if (!named) return false;
  host = named->text;
  if (!camera_name_fault(host).empty()) {
    camera.problem("host", "the name of a host of the cell, as in \"hall-2\"");
    return false;
  }
  if (!installation.cell.enabled()) {
    camera.problem("host", "has a meaning with [cell] broker only");
    return false;
  }
  return host != installation.cell.host;
}

void check_cell(TomlTable& root, Installation& installation) {
  CellOptions& cell = installation.cell;
  if (!cell.enabled()) return;
  if (cell.role == CellRole::kFusion && !installation.cameras.empty()) {
    root.table("cell")->problem(
        "role", fmt::format("\"fusion\" takes no frames, but camera \"{}\" is this host's: give it "
                            "a host, or say role = \"both\"",
                            installation.cameras.front().name));
  } else if (cell.role != CellRole::kFusion && installation.cameras.empty()) {
    root.table("cell")->problem("host", fmt::format("no camera is this host's (\"{}\")", cell.host),
                                ErrorCode::kNotFound);
  }
  // Places are judged where the estimates are.
  if (!fuses(cell.role)) installation.watch.enabled = false;
}

}  // namespace sightline::config
