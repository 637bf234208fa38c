// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "capture/axes/udp_socket.hpp"
#include "sightline/capture/axes/axis_source.hpp"

namespace sightline::capture {

Result<std::unique_ptr<AxisSource>> open_freed(const AxisSourceOptions& options,
                                               const std::string& name);
Result<std::unique_ptr<AxisSource>> open_visca(const AxisSourceOptions& options,
                                               const std::string& name);

Result<std::unique_ptr<AxisSource>> open_visca_serial(const AxisSourceOptions& options,
                                                      const std::string& name);
Result<std::unique_ptr<AxisSource>> open_v4l2_head(const AxisSourceOptions& options,
                                                   const std::string& name);
Result<std::unique_ptr<AxisSource>> open_opentrackio(const AxisSourceOptions& options,
                                                     const std::string& name);
Result<std::unique_ptr<AxisSource>> open_onvif(const AxisSourceOptions& options,
                                               const std::string& name);

}  // namespace sightline::capture
