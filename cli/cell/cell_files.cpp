// SPDX-License-Identifier: Apache-2.0
#include "cell/cell_files.hpp"

#include <fmt/format.h>

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
  return fmt::format(
      "[cell]                                # written by `sightline cell init`\n"
      "role = \"{}\"\nname = {}\nhost = \"{}\"\nbroker = {}\nport = {}\n"
      "ca_file = \"cell/ca.pem\"\ncertificate = \"cell/host.pem\"\nkey = \"cell/host.key\"\n{}",
      role, toml_text(setup.name), host.name, toml_text(setup.broker), setup.port, kept);
}

// The name in a host's certificate is the user here.
std::string access_list(const CellSetup& setup) {
  const CellTopics topics(setup.name);
  std::string text = std::string(kWritten) + "# user: the name in the certificate\n";
  for (const CellSetup::Host& host : setup.hosts) {
    text += fmt::format("\nuser {}\ntopic read {}/#\ntopic write {}\ntopic write {}\n", host.name,
                        setup.name, topics.host(host.name), order_topic(topics, host.name));
    if (host.name == setup.fusion) {
      text += fmt::format(
          "topic write {0}/fusion\ntopic write {0}/track/#\ntopic write {0}/last/#\n", setup.name);
    }
    for (const std::string& camera : host.cameras) {
      text += fmt::format("topic write {}/cam/{}/obs/#\n", setup.name, topic_level(camera));
    }
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
      "require_certificate true\n"
      "use_identity_as_username true\n"
      "acl_file {}\n"
      "set_tcp_nodelay true\n"
      "message_size_limit 65536\n",
      kWritten, setup.broker, setup.port, file("ca.pem"), file("broker.pem"), file("broker.key"),
      file("access"));
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
  if (!installations) {
    text += "cell.toml is the section [cell]: put it into each host's installation file.\n";
  }
  return text +
         "Keys are their host's alone. authority/ca.key stays where it is safe: who has it can "
         "make further hosts.\nTake this folder away when all is copied.\n";
}

}  // namespace sightline::cli
