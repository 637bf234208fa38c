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
  std::string fusion;                   ///< the host that keeps the estimates
  std::vector<Host> hosts;              ///< the fusion host among them
  std::filesystem::path broker_folder;  ///< where the broker's files will lie
};

/// The section [cell] of one host's installation file, with the broker's certificates beside it.
/// `kept`: further lines of it.
std::string cell_section(const CellSetup& setup, const CellSetup::Host& host,
                         const std::string& kept);
/// Who may write and read what, as mosquitto's acl_file has it.
std::string access_list(const CellSetup& setup);
std::string broker_configuration(const CellSetup& setup);
/// For /etc/chrony/conf.d.
std::string chrony_hints(const CellSetup& setup, const CellSetup::Host& host);
/// For systemd: the key, which root alone may read, is handed to the service as a credential.
std::string service_drop_in();
/// What goes where, for a person.
std::string setup_notes(const CellSetup& setup, bool installations);

}  // namespace sightline::cli
