// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "control/api_requests.hpp"
#include "sightline/control/http_content.hpp"

namespace sightline::control {

/// The newest messages of this process as JSON (docs/api.md); "after": only those since.
HttpReply log_reply(const Query& query);

}  // namespace sightline::control
