// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <span>

#include "sightline/stream/rtsp_server.hpp"

namespace sightline::stream {

/// Every request of a stream takes one of these names and passwords, by digest authentication; the
/// password itself never travels. Nothing changes without users.
void ask_for_passwords(GstRTSPServer* server, std::span<const RtspUser> users);

/// A stream that whoever has a password may watch; without passwords everybody.
void let_users_watch(GstRTSPMediaFactory* factory);

/// `answer` refuses the password that a request brought. (The first answer to everybody, who has
/// brought none yet, is no refusal.)
bool refuses_password(const GstRTSPContext* context, GstRTSPMessage* answer);

}  // namespace sightline::stream
