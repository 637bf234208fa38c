// SPDX-License-Identifier: Apache-2.0
#include "stream/rtsp_access.hpp"

#include <memory>

#include "stream/gst_ptr.hpp"

namespace sightline::stream {
namespace {

constexpr const char* kWatcher = "watcher";

struct UnrefToken {
  void operator()(GstRTSPToken* token) const { gst_rtsp_token_unref(token); }
};

}  // namespace

void ask_for_passwords(GstRTSPServer* server, std::span<const RtspUser> users) {
  if (users.empty()) return;
  const GObjectPtr<GstRTSPAuth> auth(gst_rtsp_auth_new());
  gst_rtsp_auth_set_supported_methods(auth.get(), GST_RTSP_AUTH_DIGEST);
  gst_rtsp_auth_set_realm(auth.get(), "Sightline");
  for (const RtspUser& user : users) {
    const std::unique_ptr<GstRTSPToken, UnrefToken> token(
        gst_rtsp_token_new(GST_RTSP_TOKEN_MEDIA_FACTORY_ROLE, G_TYPE_STRING, kWatcher, nullptr));
    gst_rtsp_auth_add_digest(auth.get(), user.name.c_str(), user.secret.c_str(), token.get());
  }
  gst_rtsp_server_set_auth(server, auth.get());
}

Result<GObjectPtr<GTlsCertificate>> make_certificate(const std::string& certificate,
                                                     const std::string& key) {
  const std::string both = certificate + "\n" + key;
  GError* raw = nullptr;
  GObjectPtr<GTlsCertificate> pair(
      g_tls_certificate_new_from_pem(both.c_str(), static_cast<gssize>(both.size()), &raw));
  const GErrorPtr error(raw);
  if (pair) return pair;
  return make_error(ErrorCode::kInvalidInput, "rtsp",
                    "certificate and key under [access] cannot be used: {} (the Debian package "
                    "glib-networking has to be there)",
                    text_of(error));
}

GObjectPtr<GIOStream> speak_tls(GstRTSPConnection* connection, GTlsCertificate* certificate) {
  GTlsConnection* const tls = gst_rtsp_connection_get_tls(connection, nullptr);
  if (tls == nullptr) return nullptr;
  g_tls_connection_set_certificate(tls, certificate);
  return GObjectPtr<GIOStream>(G_IO_STREAM(g_object_ref(tls)));
}

void let_users_watch(GstRTSPMediaFactory* factory) {
  gst_rtsp_media_factory_add_role(factory, kWatcher, GST_RTSP_PERM_MEDIA_FACTORY_ACCESS,
                                  G_TYPE_BOOLEAN, TRUE, GST_RTSP_PERM_MEDIA_FACTORY_CONSTRUCT,
                                  G_TYPE_BOOLEAN, TRUE, nullptr);
}

bool refuses_password(const GstRTSPContext* context, GstRTSPMessage* answer) {
  if (context == nullptr || context->request == nullptr ||
      gst_rtsp_message_get_type(answer) != GST_RTSP_MESSAGE_RESPONSE) {
    return false;
  }
  GstRTSPStatusCode status = GST_RTSP_STS_OK;
  gst_rtsp_message_parse_response(answer, &status, nullptr, nullptr);
  gchar* password = nullptr;
  return status == GST_RTSP_STS_UNAUTHORIZED &&
         gst_rtsp_message_get_header(context->request, GST_RTSP_HDR_AUTHORIZATION, &password, 0) ==
             GST_RTSP_OK;
}

}  // namespace sightline::stream
