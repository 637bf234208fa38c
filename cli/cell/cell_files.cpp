// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_files.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "init/installation_text.hpp"
#include "sightline/publish/cell/cell_order.hpp"

namespace sightline::cli {
namespace {

constexpr const char* kWritten = "# Written by `sightline cell init` (docs/cell.md).\n";

}  // namespace

std::string cell_section(const CellSetup& setup, const CellSetup::Host& host,
                         const std::string& kept) {
  const char* const role = host.name != setup.fusion ? "cameras"
                           : host.cameras.empty()    ? "fusion"
                                                     : "both";
  std::string neighbors;
  for (const CellSetup::Neighbor& neighbor : setup.neighbors) {
    neighbors += (neighbors.empty() ? "" : ", ") + toml_text(neighbor.name);
  }
  if (!neighbors.empty()) neighbors = fmt::format("neighbors = [{}]\n", neighbors);
  return fmt::format(
      "[cell]                                # written by `sightline cell init`\n"
      "role = \"{}\"\nname = {}\nhost = \"{}\"\nbroker = {}\nport = {}\n"
      "ca_file = \"cell/ca.pem\"\ncertificate = \"cell/host.pem\"\nkey = \"cell/host.key\"\n{}{}",
      role, toml_text(setup.name), host.name, toml_text(setup.broker), setup.port, neighbors, kept);
}

// The name in a host's certificate is the user here.
std::string access_list(const CellSetup& setup) {
  const CellTopics topics(setup.name);
  std::string text = std::string(kWritten) + "# user: the name in the certificate\n";
  for (const CellSetup::Host& host : setup.hosts) {
    text += fmt::format("\nuser {}\ntopic read {}/#\ntopic write {}\ntopic write {}\n", host.name,
                        setup.name, topics.host(host.name), order_topic(topics, host.name));
    for (const CellSetup::Neighbor& neighbor : setup.neighbors) {
      text += fmt::format("topic read {}/#\n", neighbor.name);
    }
    if (host.name == setup.fusion) {
      text += fmt::format(
          "topic write {0}/fusion\ntopic write {0}/track/#\ntopic write {0}/last/#\n", setup.name);
      if (!setup.neighbors.empty()) text += fmt::format("topic write {}/bid/#\n", setup.name);
    }
    for (const std::string& camera : host.cameras) {
      text += fmt::format("topic write {}/cam/{}/obs/#\n", setup.name, topic_level(camera));
    }
  }
  for (const CellSetup::Neighbor& neighbor : setup.neighbors) {
    text += fmt::format(
        "\nuser {0}\ntopic read {1}/fusion\ntopic read {1}/track/#\ntopic read {1}/bid/#\n"
        "topic read {1}/cam/#\n",
        neighbor_user(neighbor.name), setup.name);
  }
  return text;
}

std::string neighbor_file(const std::string& cell) {
  std::string name = topic_level(cell);
  std::ranges::replace(name, ' ', '_');
  return name;
}
std::string neighbor_user(const std::string& cell) { return "neighbor_" + neighbor_file(cell); }

std::string bridge_configuration(const CellSetup& setup, const CellSetup::Neighbor& neighbor) {
  const std::string name = neighbor_file(neighbor.name);
  const auto file = [&](const char* of) { return (setup.broker_folder / name / of).string(); };
  std::string text = fmt::format(
      "{}# For /etc/mosquitto/conf.d/sightline_{}.conf of {}, once {} holds what {} has made for\n"
      "# this cell. The bridge only fetches: nothing is written there.\n"
      "connection {}\naddress {}:{}\n"
      "bridge_cafile {}\nbridge_certfile {}\nbridge_keyfile {}\n"
      "bridge_protocol_version mqttv311\ncleansession true\nnotifications false\n"
      "restart_timeout 1 5\nkeepalive_interval 5\n",
      kWritten, name, setup.fusion, (setup.broker_folder / name).string(), neighbor.name, name,
      neighbor.broker, neighbor.port, file("ca.pem"), file("bridge.pem"), file("bridge.key"));
  const CellTopics topics(neighbor.name);
  text += fmt::format("topic {} in 1\ntopic {} in 0\ntopic {} in 0\n", topics.fusion(),
                      topics.tracks(), topics.bids());
  for (const std::string& camera : neighbor.cameras) {
    text += fmt::format("topic {} in 0\n", topics.observations_of(camera));
  }
  return text;
}

std::string broker_configuration(const CellSetup& setup) {
  const auto file = [&setup](const char* name) { return (setup.broker_folder / name).string(); };
  return fmt::format(
      "{}# For /etc/mosquitto/conf.d/sightline.conf of the host that is {}.\n"
      "listener {}\n"
      "allow_anonymous false\n"
      "cafile {}\ncertfile {}\nkeyfile {}\n"
      "# Certificates that are taken back; read when mosquitto starts.\n"
      "crlfile {}\n"
      "require_certificate true\n"
      "use_identity_as_username true\n"
      "acl_file {}\n"
      "set_tcp_nodelay true\n"
      "message_size_limit 65536\n",
      kWritten, setup.broker, setup.port, file("ca.pem"), file("broker.pem"), file("broker.key"),
      file("revoked.pem"), file("access"));
}

std::string chrony_hints(const CellSetup& setup, const CellSetup::Host& host) {
  std::string text =
      fmt::format("{}# For /etc/chrony/conf.d/sightline.conf of {}.\n", kWritten, host.name);
  if (host.name == setup.fusion) {
    return text +
           "# The other hosts go by this one's clock, also while it is in step with nobody.\n"
           "# allow 192.168.1.0/24 lets only that network ask.\n"
           "allow\nlocal stratum 10\n";
  }
  return text + fmt::format(
                    "# The fusion host's clock; remove other servers and pools.\n"
                    "server {} iburst minpoll 2 maxpoll 4 prefer\nmakestep 0.1 3\n",
                    setup.broker);
}

std::string service_drop_in() {
  return std::string(kWritten) +
         "# For /etc/systemd/system/sightlined.service.d/cell.conf: the service runs as a user of\n"
         "# its own, to whom this shows the key.\n"
         "[Service]\nLoadCredential=cell.key:/etc/sightline/cell/host.key\n";
}

std::string setup_notes(const CellSetup& setup, bool installations) {
  const std::string broker = setup.broker_folder.string();
  std::string text = fmt::format(
      "Written by `sightline cell init` for the cell {}.\n\n"
      "On {}, the fusion host, with mosquitto installed:\n"
      "  broker/mosquitto.conf -> /etc/mosquitto/conf.d/sightline.conf\n"
      "  the rest of broker/   -> {}, owned by mosquitto, then: systemctl restart mosquitto\n"
      "On each host, with chrony installed:\n",
      setup.name, setup.fusion, broker);
  for (const CellSetup::Host& host : setup.hosts) {
    text += fmt::format("  hosts/{0}/ -> /etc/sightline/ of {0}\n", host.name);
  }
  text +=
      "  in it chrony.conf    -> /etc/chrony/conf.d/sightline.conf\n"
      "  in it sightlined.conf -> /etc/systemd/system/sightlined.service.d/cell.conf\n";
  for (const CellSetup::Neighbor& neighbor : setup.neighbors) {
    text += fmt::format(
        "Between {0} and {1}:\n"
        "  neighbors/{2}/ -> {3}/{4}/ of {1}'s broker, owned by mosquitto\n"
        "  what `sightline cell init` made for this cell there -> {3}/{2}/ here, then\n"
        "  broker/neighbor_{2}.conf -> /etc/mosquitto/conf.d/\n",
        setup.name, neighbor.name, neighbor_file(neighbor.name), broker, neighbor_file(setup.name));
  }
  if (!installations) {
    text += "cell.toml is the section [cell]: put it into each host's installation file.\n";
  }
  return text +
         "Keys are their host's alone. authority/ca.key stays where it is safe: who has it can "
         "make further hosts.\nTake this folder away when all is copied.\n";
}

}  // namespace sightline::cli
