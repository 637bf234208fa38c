// SPDX-License-Identifier: Apache-2.0
#include "render/gpu/egl_device.hpp"

namespace sightline {

Result<std::shared_ptr<EglDevice>> EglDevice::open() {
  return make_error(ErrorCode::kUnavailable, "egl",
                    "this build has no EGL: install libegl-dev and libgles-dev and build again");
}

}  // namespace sightline
