// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/certificates.hpp"

namespace sightline {
namespace {

Error absent() {
  return make_error(ErrorCode::kUnavailable, "certificates",
                    "this program was built without OpenSSL (libcrypto)");
}

}  // namespace

Result<PemPair> make_authority(const CertificateSubject&) { return absent(); }
Result<PemPair> make_certificate(const CertificateSubject&, const PemPair&) { return absent(); }
Result<std::string> make_revocation_list(const std::vector<std::string>&, const PemPair&, int) {
  return absent();
}

}  // namespace sightline
