// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cell/cell_files.hpp"
#include "sightline/base/result.hpp"

namespace sightline::cli {

/// A file of a cell's folder.
struct NewFile {
  std::filesystem::path path;  ///< relative to the folder
  std::string content;
  bool secret = false;
};

/// Hosts of a folder that the cell has no more.
Result<std::vector<std::string>> hosts_that_left(const std::filesystem::path& folder,
                                                 const CellSetup& setup);

/// Certificates and keys of the cell: those that `folder` has stay as they are, the others are
/// added to `files`, with the list of those that are taken back: of `left` and of hosts that left
/// before.
Status add_certificates(const std::filesystem::path& folder, int days, const CellSetup& setup,
                        const std::vector<std::string>& left, std::vector<NewFile>& files);

/// Puts what a host had where `sightline cell init --update` looks for what is taken back.
Status set_aside(const std::filesystem::path& folder, const std::string& host);

}  // namespace sightline::cli
