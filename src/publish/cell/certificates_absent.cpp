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

}  // namespace sightline
