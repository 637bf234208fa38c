// SPDX-License-Identifier: Apache-2.0
#include "sightline/stream/whep.hpp"

namespace sightline {

Result<std::shared_ptr<WhepServer>> WhepServer::create(const WhepOptions&) {
  return make_error(ErrorCode::kUnavailable, "whep",
                    "no WebRTC: this build was made without the Debian package "
                    "libgstreamer-plugins-bad1.0-dev");
}

}  // namespace sightline
