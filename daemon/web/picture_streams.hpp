// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "sightline/control/http_content.hpp"
#include "web/picture_board.hpp"

namespace sightline {

/// multipart/x-mixed-replace of one camera, as <img> and most players take it.
HttpReply motion_jpeg_reply(std::shared_ptr<PictureSlot> slot, PictureKind kind,
                            double max_rate_hz);
/// multipart/mixed of several: each part says of which camera and when it was captured. The
/// cameras take turns.
HttpReply pictures_reply(const std::vector<std::shared_ptr<PictureSlot>>& slots, PictureKind kind,
                         double max_rate_hz);
/// One picture that is newer than the request; 503 after two seconds without.
HttpReply snapshot_reply(std::shared_ptr<PictureSlot> slot, PictureKind kind);

}  // namespace sightline
