// SPDX-License-Identifier: Apache-2.0
#include "record/recording_folder.hpp"

#include "sightline/base/waiting.hpp"

namespace sightline::record {

namespace fs = std::filesystem;

Status make_recording_folder(const fs::path& folder) {
  const Waiting wait("the disk");
  std::error_code fault;
  fs::create_directory(folder, fault);
  if (fault) {
    return make_error(ErrorCode::kIo, folder.string(), "cannot make this folder: {}",
                      fault.message());
  }
  if (fs::is_empty(folder, fault) && !fault) return {};
  return make_error(ErrorCode::kInvalidInput, folder.string(),
                    "is not empty; recordings are never overwritten, give another folder");
}

}  // namespace sightline::record
