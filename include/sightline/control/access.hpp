// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// What somebody may do. A viewer reads and watches; an operator also changes: hints, reload.
enum class Role : uint8_t { kNone, kViewer, kOperator };

/// One line of a token file.
struct AccessToken {
  std::string name;  ///< who it was given to; shown in the log, and the user name of RTSP
  Role role = Role::kNone;
  std::string secret;

  bool operator==(const AccessToken&) const = default;
};

/// "credential:NAME" as a path below $CREDENTIALS_DIRECTORY (systemd's LoadCredential=); other
/// texts unchanged. kNotFound where the service manager has given none.
Result<std::filesystem::path> token_file_path(const std::filesystem::path& setting);

/// Tokens from a text of lines "NAME ROLE TOKEN", with "viewer" or "operator" as ROLE and a TOKEN
/// of 16 to 256 printable characters without spaces; "#" begins a comment. Errors say `where`:LINE
/// and never repeat what could be a secret.
Result<std::vector<AccessToken>> parse_tokens(std::string_view text, const std::string& where);

/// The same from a file of at most 64 KiB that not everybody on this machine may read.
Result<std::vector<AccessToken>> read_tokens(const std::filesystem::path& setting);

/// Certificate (with its chain) and private key in PEM; each setting a path or "credential:NAME".
struct TlsFiles {
  std::filesystem::path certificate, key;
  uint64_t content = 0;  ///< hash of both, so that a new certificate is a difference

  bool any() const { return !certificate.empty(); }
  bool operator==(const TlsFiles&) const = default;
};
struct TlsTexts {
  std::string certificate, key;
};
/// Both as texts, each at most 64 KiB; the key must not be readable by everybody on this machine.
Result<TlsTexts> read_tls(const TlsFiles& files);

}  // namespace sightline
