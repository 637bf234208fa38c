// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "sightline/base/result.hpp"

namespace sightline {

/// A certificate (X.509) and its private key (P-256), both as PEM.
struct PemPair {
  std::string certificate, key;
};

/// Who holds a certificate, and what it is good for.
struct CertificateSubject {
  std::string name;  ///< common name, 1 to 64 bytes of UTF-8
  /// Under which it is reached, names and addresses; empty: it is a client's, and no server's.
  std::vector<std::string> addresses{};
  int days = 3650;
};

/// An authority of its own: signs itself, and nothing but hosts. kUnavailable where this program
/// was built without OpenSSL.
Result<PemPair> make_authority(const CertificateSubject& subject);

/// A certificate that `authority` has signed, with a new key.
Result<PemPair> make_certificate(const CertificateSubject& subject, const PemPair& authority);

/// The certificates (PEM) that `authority` takes back, signed by it, as PEM: who asks for it takes
/// these no more. It holds for `days`; without one that holds nobody is let in.
Result<std::string> make_revocation_list(const std::vector<std::string>& revoked,
                                         const PemPair& authority, int days);

}  // namespace sightline
