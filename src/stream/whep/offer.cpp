// SPDX-License-Identifier: Apache-2.0
#include "stream/whep/offer.hpp"

#include <gst/sdp/sdp.h>

#include <algorithm>
#include <cstdlib>
#include <memory>
#include <optional>
#include <string_view>

#include "stream/gst_ptr.hpp"

namespace sightline::stream {
namespace {

constexpr size_t kLargest = 64 * 1024;  // [bytes]
constexpr unsigned kMostMedia = 8;

struct FreeSdp {
  void operator()(GstSDPMessage* message) const { gst_sdp_message_free(message); }
};
using SdpPtr = std::unique_ptr<GstSDPMessage, FreeSdp>;

Error refusal(std::string_view text) {
  return make_error(ErrorCode::kInvalidInput, "whep", "{}", text);
}

bool has(const GstSDPMessage& message, const GstSDPMedia& media, const char* name) {
  return gst_sdp_media_get_attribute_val(&media, name) != nullptr ||
         gst_sdp_message_get_attribute_val(&message, name) != nullptr;
}

/// Parameters of a format as "a=fmtp" has them: "NUMBER key=value;key=value".
std::string parameter(const GstSDPMedia& media, const std::string& format, std::string_view key) {
  for (guint i = 0;; ++i) {
    const char* const value = gst_sdp_media_get_attribute_val_n(&media, "fmtp", i);
    if (value == nullptr) return "";
    std::string_view text(value);
    if (!text.starts_with(format + " ")) continue;
    text.remove_prefix(format.size() + 1);
    while (!text.empty()) {
      const std::string_view one = text.substr(0, text.find(';'));
      text.remove_prefix(std::min(text.size(), one.size() + 1));
      const size_t from = std::min(one.find_first_not_of(' '), one.size());
      const size_t equals = one.find('=');
      if (equals == std::string_view::npos || equals < from) continue;
      if (one.substr(from, equals - from) == key) return std::string(one.substr(equals + 1));
    }
  }
}

bool is_h264(const GstSDPMedia& media, const std::string& format) {
  for (guint i = 0;; ++i) {
    const char* const value = gst_sdp_media_get_attribute_val_n(&media, "rtpmap", i);
    if (value == nullptr) return false;
    const std::string_view text(value);
    if (text == format + " H264/90000" || text == format + " h264/90000") return true;
  }
}

/// How well a format suits constrained baseline in fragmented packets; nothing: not at all.
std::optional<int> suits(const GstSDPMedia& media, const std::string& format) {
  if (!is_h264(media, format) || parameter(media, format, "packetization-mode") != "1") {
    return std::nullopt;
  }
  std::string profile = parameter(media, format, "profile-level-id").substr(0, 4);
  std::ranges::transform(profile, profile.begin(), [](unsigned char c) { return tolower(c); });
  if (profile == "42e0") return 0;
  if (profile == "4200" || profile.empty()) return 1;
  return 2;  // what decodes main or high profile decodes ours
}

struct Format {
  int rank, type;
  std::string profile;
};

std::optional<Format> best_format(const GstSDPMedia& media) {
  std::optional<Format> best;
  for (guint i = 0; i < gst_sdp_media_formats_len(&media); ++i) {
    const std::string format = gst_sdp_media_get_format(&media, i);
    const auto rank = suits(media, format);
    const int type = std::atoi(format.c_str());
    if (!rank || type < 1 || type > 127 || (best && best->rank <= *rank)) continue;
    best = Format{*rank, type, parameter(media, format, "profile-level-id")};
  }
  return best;
}

void remove_candidates(GstSDPMedia& media) {
  for (guint i = gst_sdp_media_attributes_len(&media); i-- > 0;) {
    const std::string_view key = gst_sdp_media_get_attribute(&media, i)->key;
    if (key == "candidate" || key == "end-of-candidates" || key == "remote-candidates") {
      gst_sdp_media_remove_attribute(&media, i);
    }
  }
}

/// What the ICE agent and DTLS cannot do without; webrtcbin does not look at all of it.
Status check_transport(const GstSDPMessage& message, const GstSDPMedia& media) {
  for (const char* name : {"ice-ufrag", "ice-pwd", "fingerprint", "setup"}) {
    if (!has(message, media, name)) return refusal(fmt::format("the offer has no a={}", name));
  }
  if (gst_sdp_media_get_attribute_val(&media, "mid") == nullptr) {
    return refusal("the offer has a medium without a=mid");
  }
  if (gst_sdp_media_get_attribute_val(&media, "rtcp-mux") == nullptr) {
    return refusal("the offer has a medium without a=rtcp-mux");
  }
  return {};
}

SdpPtr parse(const char* text) {
  GstSDPMessage* raw = nullptr;
  const bool good = gst_sdp_message_new_from_text(text, &raw) == GST_SDP_OK;
  SdpPtr message(raw);
  if (!good) return nullptr;
  // The parser takes the last of several lines v=.
  const char* const version = gst_sdp_message_get_version(message.get());
  return version != nullptr && std::string_view(version) == "0" ? std::move(message) : nullptr;
}

// Takes candidates out on the way.
Result<ViewerOffer> judge(GstSDPMessage& message) {
  const guint count = gst_sdp_message_medias_len(&message);
  if (count == 0 || count > kMostMedia) return refusal("the offer has no media, or too many");
  ViewerOffer offer;
  bool found = false;
  for (guint i = 0; i < count; ++i) {
    auto& media = const_cast<GstSDPMedia&>(*gst_sdp_message_get_media(&message, i));
    SL_RETURN_IF_ERROR(check_transport(message, media));
    remove_candidates(media);
    if (found || std::string_view(gst_sdp_media_get_media(&media)) != "video" ||
        gst_sdp_media_get_attribute_val(&media, "sendonly") != nullptr ||
        gst_sdp_media_get_attribute_val(&media, "inactive") != nullptr) {
      continue;
    }
    auto format = best_format(media);
    if (!format) continue;
    found = true;
    offer.media_line = i;
    offer.payload_type = format->type;
    offer.profile = std::move(format->profile);
  }
  if (found) return offer;
  return refusal("the offer does not want to receive H.264 with packetization-mode=1");
}

}  // namespace

Result<ViewerOffer> read_offer(const std::string& sdp) {
  if (sdp.size() > kLargest || sdp.find('\0') != std::string::npos || !sdp.starts_with("v=0")) {
    return refusal("that is no SDP offer");
  }
  const SdpPtr message = parse(sdp.c_str());
  if (!message) return refusal("that is no SDP offer");
  SL_ASSIGN(ViewerOffer offer, judge(*message));
  const GStringPtr text(gst_sdp_message_as_text(message.get()));
  offer.sdp = text.get();
  // What is handed on is read once more: it has to say what was judged.
  const SdpPtr again = parse(text.get());
  const auto same = again ? judge(*again) : Result<ViewerOffer>(refusal(""));
  if (!same || same->media_line != offer.media_line || same->payload_type != offer.payload_type) {
    return refusal("that is no SDP offer");
  }
  return offer;
}

}  // namespace sightline::stream
