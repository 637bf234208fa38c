// SPDX-License-Identifier: Apache-2.0
#include "config/publishing.hpp"

#include <unistd.h>

#include <algorithm>
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

constexpr size_t kMostNeighbors = 16;

// Topics begin with the names: none may begin another one's.
bool share_topics(const std::string& one, const std::string& other) {
  return (one + "/").starts_with(other + "/") || (other + "/").starts_with(one + "/");
}

void read_neighbors(TomlTable& table, CellOptions& cell) {
  const auto list = table.texts("neighbors");
  if (!list) return;
  if (!cell.enabled() && !list->empty()) {
    table.problem("neighbors",
                  "work together over brokers: say where the broker is, as in broker = "
                  "\"192.168.1.10\"");
  }
  if (list->size() > kMostNeighbors) {
    table.problem("neighbors", fmt::format("{} cells; at most {}", list->size(), kMostNeighbors));
  }
  std::vector<std::string> known{cell.name};
  for (const PlacedText& neighbor : *list) {
    const auto shares = [&](const std::string& other) {
      return share_topics(neighbor.text, other);
    };
    if (!is_topic(neighbor.text)) {
      table.problem("neighbors", "names of other cells, each " + std::string(kTopicWanted));
    } else if (std::ranges::any_of(known, shares)) {
      table.problem("neighbors",
                    fmt::format("\"{}\" is this cell, comes twice, or shares topics with \"{}\"",
                                neighbor.text, *std::ranges::find_if(known, shares)));
    } else {
      known.push_back(neighbor.text);
      cell.neighbors.push_back(neighbor.text);
    }
  }
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
  read_neighbors(*table, cell);
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
  if (!cell.page.empty() && !is_page_address(cell.page)) {
    table->problem("page", "address of this host's page, as in \"https://hall-2.example:9754/\"");
  }
  table->finish();
}

void name_page(Installation& installation) {
  const HttpConfig& http = installation.http;
  CellOptions& cell = installation.cell;
  const std::string& address = http.server.address;
  if (!cell.enabled() || !cell.page.empty() || !http.enabled || http.server.port == 0 ||
      is_loopback_address(address)) {
    return;
  }
  const bool any = address == "0.0.0.0" || address == "::";
  const bool v6 = address.find(':') != std::string::npos;
  std::string host = any ? machine_name() : v6 ? "[" + address + "]" : address;
  if (!http.server.names.empty()) host = http.server.names.front();
  const std::string page =
      fmt::format("{}://{}:{}/", http.server.tls.any() ? "https" : "http", host, http.server.port);
  if (is_page_address(page)) cell.page = page;
}

bool is_remote(TomlTable& camera, const Installation& installation, RemoteCamera& remote) {
  const auto cell = camera.text("cell");
  const auto named = camera.text("host");
  if (!named) {
    if (cell) camera.problem("cell", "has a meaning with host only: which one of that cell?");
    return false;
  }
  const std::string& host = remote.host = named->text;
  if (!camera_name_fault(host).empty()) {
    camera.problem("host", "the name of a host of the cell, as in \"hall-2\"");
    return false;
  }
  if (!installation.cell.enabled()) {
    camera.problem("host", "has a meaning with [cell] broker only");
    return false;
  }
  if (cell && cell->text != installation.cell.name) {
    const auto& neighbors = installation.cell.neighbors;
    if (std::ranges::find(neighbors, cell->text) == neighbors.end()) {
      camera.problem("cell", fmt::format("\"{}\" is not among the neighbors of [cell]{}",
                                         cell->text, suggestion(cell->text, neighbors)));
      return true;  // the rest is not for here, whoever has it
    }
    remote.cell = cell->text;
    return true;
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
  if (cell.local && fuses(cell.role)) {
    root.table("cell")->problem("local",
                                "is for hosts with role = \"cameras\": the others keep the "
                                "estimates anyway");
  }
  // Places are judged where the estimates are.
  if (!fuses(cell.role)) installation.watch.enabled = false;
}

}  // namespace sightline::config
