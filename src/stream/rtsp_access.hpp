// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gst/rtsp-server/rtsp-server.h>

#include <span>

#include "sightline/stream/rtsp_server.hpp"
#include "stream/gst_ptr.hpp"

namespace sightline::stream {

/// Every request of a stream takes one of these names and passwords, by digest authentication; the
/// password itself never travels. Nothing changes without users.
void ask_for_passwords(GstRTSPServer* server, std::span<const RtspUser> users);

/// Certificate and private key in PEM. kInvalidInput for a bad pair.
Result<GObjectPtr<GTlsCertificate>> make_certificate(const std::string& certificate,
                                                     const std::string& key);
/// This connection, of which nothing was read yet, begins with TLS. Null if the library cannot.
GObjectPtr<GIOStream> speak_tls(GstRTSPConnection* connection, GTlsCertificate* certificate);

/// A stream that whoever has a password may watch; without passwords everybody.
void let_users_watch(GstRTSPMediaFactory* factory);

/// `answer` refuses the password that a request brought. (The first answer to everybody, who has
/// brought none yet, is no refusal.)
bool refuses_password(const GstRTSPContext* context, GstRTSPMessage* answer);

}  // namespace sightline::stream
