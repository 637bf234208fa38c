// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace sightline::cli {

/// A cell that is being set up.
struct CellSetup {
  struct Host {
    std::string name;
    std::vector<std::string> cameras;
  };
  std::string name;    ///< topics begin with it
  std::string broker;  ///< name or address
  uint16_t port = 8883;
  std::string fusion;       ///< the host that keeps the estimates
  std::vector<Host> hosts;  ///< the fusion host among them
  struct Neighbor {
    std::string name;    ///< of the other cell
    std::string broker;  ///< its broker's name or address
    uint16_t port = 8883;
    std::vector<std::string> cameras;  ///< at the border: what this cell takes of theirs
  };
  std::vector<Neighbor> neighbors{};
  std::filesystem::path broker_folder;  ///< where the broker's files will lie
};

/// The section [cell] of one host's installation file, with the broker's certificates beside it.
/// `kept`: further lines of it.
std::string cell_section(const CellSetup& setup, const CellSetup::Host& host,
                         const std::string& kept);
/// Who may write and read what, as mosquitto's acl_file has it.
std::string access_list(const CellSetup& setup);
std::string broker_configuration(const CellSetup& setup);
/// A cell's name as that of a file, and as the user that its broker is at a neighbor's.
std::string neighbor_file(const std::string& cell);
std::string neighbor_user(const std::string& cell);
/// mosquitto's bridge that fetches what this cell's hosts take of a neighbor's.
std::string bridge_configuration(const CellSetup& setup, const CellSetup::Neighbor& neighbor);
/// For /etc/chrony/conf.d.
std::string chrony_hints(const CellSetup& setup, const CellSetup::Host& host);
/// For systemd: the key, which root alone may read, is handed to the service as a credential.
std::string service_drop_in();
/// What goes where, for a person.
std::string setup_notes(const CellSetup& setup, bool installations);

}  // namespace sightline::cli
