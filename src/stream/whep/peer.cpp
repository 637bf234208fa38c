// SPDX-License-Identifier: Apache-2.0
#include "stream/whep/peer.hpp"

#define GST_USE_UNSTABLE_API
#include <gst/sdp/sdp.h>
#include <gst/video/video.h>
#include <gst/webrtc/webrtc.h>

#include "sightline/base/log.hpp"
#include "sightline/base/thread.hpp"
#include "stream/handover.hpp"
#include "stream/whep/promise.hpp"

namespace sightline::stream {
namespace {

struct FreeDescription {
  void operator()(GstWebRTCSessionDescription* it) const {
    gst_webrtc_session_description_free(it);
  }
};
using DescriptionPtr = std::unique_ptr<GstWebRTCSessionDescription, FreeDescription>;

Error not_built(std::string_view what) {
  return make_error(ErrorCode::kUnavailable, "whep", "a viewer's pipeline cannot be made: {}",
                    what);
}

// With the source's number in the caps, or the answer would not name it, and a browser would not
// know whose packets come. 1200 bytes: what WebRTC stacks send, so that no tunnel on the way splits
// packets.
std::string launch_line(int payload_type) {
  const guint32 ssrc = std::max<guint32>(1, g_random_int());
  return fmt::format(
      "appsrc name=src is-live=true do-timestamp=false format=time min-latency=0 max-bytes=0 "
      "max-buffers=0 max-time=0 caps=\"video/x-h264,stream-format=byte-stream,alignment=au\" ! "
      "h264parse ! rtph264pay name=pay pt={} ssrc={} mtu=1200 config-interval=-1 "
      "aggregate-mode=zero-latency ! "
      "application/x-rtp,media=video,encoding-name=H264,clock-rate=90000,payload={},"
      "ssrc=(uint){} ! "
      "webrtcbin name=peer bundle-policy=max-bundle latency=0",
      payload_type, ssrc, payload_type, ssrc);
}

Result<DescriptionPtr> description_of(const std::string& sdp) {
  GstSDPMessage* message = nullptr;
  if (gst_sdp_message_new_from_text(sdp.c_str(), &message) != GST_SDP_OK) {
    return make_error(ErrorCode::kInvalidInput, "whep", "that is no SDP offer");
  }
  return DescriptionPtr(
      gst_webrtc_session_description_new(GST_WEBRTC_SDP_TYPE_OFFER, message));  // takes it
}

/// webrtcbin leaves the profile out of what it answers: without it, it would mean another one.
void add_profile(GstSDPMessage& answer, const ViewerOffer& offer) {
  if (offer.profile.empty() || offer.media_line >= gst_sdp_message_medias_len(&answer)) return;
  auto& media = const_cast<GstSDPMedia&>(*gst_sdp_message_get_media(&answer, offer.media_line));
  const std::string format = fmt::format("{} ", offer.payload_type);
  for (guint i = 0; i < gst_sdp_media_attributes_len(&media); ++i) {
    const GstSDPAttribute& attribute = *gst_sdp_media_get_attribute(&media, i);
    if (attribute.key == nullptr || std::string_view(attribute.key) != "fmtp") continue;
    const std::string value = attribute.value != nullptr ? attribute.value : "";
    if (!value.starts_with(format) || value.find("profile-level-id") != std::string::npos) continue;
    GstSDPAttribute with{};
    gst_sdp_attribute_set(&with, "fmtp", (value + ";profile-level-id=" + offer.profile).c_str());
    gst_sdp_media_replace_attribute(&media, i, &with);
    return;
  }
}

template <typename T>
T property(GstElement* element, const char* name) {
  T value{};
  g_object_get(element, name, &value, nullptr);
  return value;
}

}  // namespace

Peer::Peer(std::string id, std::shared_ptr<FanOut> stream)
    : id_(std::move(id)), stream_(std::move(stream)) {
  notes_->stream = stream_;
}

Result<std::unique_ptr<Peer>> Peer::create(std::string id, std::shared_ptr<FanOut> stream,
                                           const ViewerOffer& offer, const std::string& address) {
  std::unique_ptr<Peer> peer(new Peer(std::move(id), std::move(stream)));
  SL_RETURN_IF_ERROR(peer->build(offer, address));
  SL_RETURN_IF_ERROR(peer->negotiate(offer));
  return peer;
}

Peer::~Peer() {
  stream_->remove(id_);
  if (!pipeline_) return;
  gst_element_set_state(pipeline_.get(), GST_STATE_NULL);
  const GstObjectPtr<GstBus> bus(gst_element_get_bus(pipeline_.get()));
  gst_bus_set_sync_handler(bus.get(), nullptr, nullptr, nullptr);
}

Status Peer::build(const ViewerOffer& offer, const std::string& address) {
  GError* raw = nullptr;
  GstElement* const launched = gst_parse_launch_full(launch_line(offer.payload_type).c_str(),
                                                     nullptr, GST_PARSE_FLAG_FATAL_ERRORS, &raw);
  const GErrorPtr error(raw);
  if (launched == nullptr) return not_built(text_of(error));
  pipeline_.reset(GST_ELEMENT(gst_object_ref_sink(launched)));
  source_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "src"));
  webrtc_.reset(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "peer"));
  if (!source_ || !webrtc_) return not_built("elements are missing");
  const GstObjectPtr<GstElement> payloader(gst_bin_get_by_name(GST_BIN(pipeline_.get()), "pay"));
  report_sent(payloader.get(), stream_->sent());
  SL_RETURN_IF_ERROR(reach_at(address));
  GstWebRTCRTPTransceiver* transceiver = nullptr;
  g_signal_emit_by_name(webrtc_.get(), "get-transceiver", 0, &transceiver);
  if (transceiver == nullptr) return not_built("webrtcbin took no video");
  g_object_set(transceiver, "direction", GST_WEBRTC_RTP_TRANSCEIVER_DIRECTION_SENDONLY, "do-nack",
               TRUE, nullptr);
  gst_object_unref(transceiver);
  listen();
  if (gst_element_set_state(pipeline_.get(), GST_STATE_PLAYING) == GST_STATE_CHANGE_FAILURE) {
    return not_built("it does not start");
  }
  return {};
}

/// One address, no gateways asked (UPnP alone takes 200 ms), no TCP.
Status Peer::reach_at(const std::string& address) {
  const GstObjectPtr<GObject> ice(property<GObject*>(webrtc_.get(), "ice-agent"));
  if (!ice) return not_built("libnice is missing");
  GObject* nice = nullptr;
  g_object_get(ice.get(), "agent", &nice, nullptr);
  const GObjectPtr<GObject> agent(nice);
  if (!agent) return not_built("libnice is missing");
  g_object_set(agent.get(), "upnp", FALSE, "ice-tcp", FALSE, nullptr);
  gboolean added = FALSE;
  g_signal_emit_by_name(ice.get(), "add-local-ip-address", address.c_str(), &added);
  if (added == FALSE) return not_built(fmt::format("no candidate at {}", address));
  return {};
}

void Peer::listen() {
  using NotesData = UserData<std::shared_ptr<Notes>>;
  const auto on = [this](const char* signal, GCallback callback) {
    g_signal_connect_data(webrtc_.get(), signal, callback, NotesData::make(notes_),
                          NotesData::destroy_closure, static_cast<GConnectFlags>(0));
  };
  on("notify::ice-gathering-state", G_CALLBACK(+[](GstElement* webrtc, GParamSpec*, gpointer data) {
       const LibraryCall call(data);
       Notes& notes = *NotesData::in(data);
       const auto state = property<GstWebRTCICEGatheringState>(webrtc, "ice-gathering-state");
       if (state != GST_WEBRTC_ICE_GATHERING_STATE_COMPLETE) return;
       std::lock_guard lock(notes.mutex);
       notes.gathered = true;
       notes.changed.notify_all();
     }));
  on("notify::connection-state", G_CALLBACK(+[](GstElement* webrtc, GParamSpec*, gpointer data) {
       const LibraryCall call(data);
       Notes& notes = *NotesData::in(data);
       const auto state = property<GstWebRTCPeerConnectionState>(webrtc, "connection-state");
       if (state == GST_WEBRTC_PEER_CONNECTION_STATE_CONNECTED) {
         notes.heard = MonotonicClock::now();
         notes.connected = true;
       } else if (state == GST_WEBRTC_PEER_CONNECTION_STATE_FAILED ||
                  state == GST_WEBRTC_PEER_CONNECTION_STATE_CLOSED) {
         notes.ended = true;
       }
     }));
  // Nobody reads the bus.
  const GstObjectPtr<GstBus> bus(gst_element_get_bus(pipeline_.get()));
  gst_bus_set_sync_handler(
      bus.get(),
      [](GstBus*, GstMessage* message, gpointer data) {
        const LibraryCall call(data);
        if (GST_MESSAGE_TYPE(message) == GST_MESSAGE_ERROR) {
          log::debug("whep: a viewer's pipeline ended: {}", text_of_error_message(message));
          NotesData::in(data)->ended = true;
        }
        gst_message_unref(message);
        return GST_BUS_DROP;
      },
      NotesData::make(notes_), NotesData::destroy);
  // What the browser asks by PLI or FIR comes up to here.
  const GstObjectPtr<GstPad> pad(gst_element_get_static_pad(source_.get(), "src"));
  gst_pad_add_probe(
      pad.get(), GST_PAD_PROBE_TYPE_EVENT_UPSTREAM,
      [](GstPad*, GstPadProbeInfo* info, gpointer data) {
        const LibraryCall call(data);
        if (gst_video_event_is_force_key_unit(GST_PAD_PROBE_INFO_EVENT(info)) != FALSE) {
          if (const auto stream = NotesData::in(data)->stream.lock()) stream->ask_for_keyframe();
        }
        return GST_PAD_PROBE_OK;
      },
      NotesData::make(notes_), NotesData::destroy);
}

/// A browser that receives says so every few seconds at least (RFC 3550, 6.2). (A signal of its own
/// that the library has for that, on-sender-ssrc-active, comes for a peer that has gone, too.)
void Peer::listen_to_reports() {
  const GstObjectPtr<GstElement> rtp(gst_bin_get_by_name(GST_BIN(webrtc_.get()), "rtpbin"));
  GObject* raw = nullptr;
  if (rtp) g_signal_emit_by_name(rtp.get(), "get-internal-session", 0, &raw);
  const GObjectPtr<GObject> session(raw);
  if (!session) return;
  using NotesData = UserData<std::shared_ptr<Notes>>;
  g_signal_connect_data(
      session.get(), "on-receiving-rtcp", G_CALLBACK(+[](GObject*, GstBuffer*, gpointer data) {
        const LibraryCall call(data);
        NotesData::in(data)->heard = MonotonicClock::now();
      }),
      NotesData::make(notes_), NotesData::destroy_closure, static_cast<GConnectFlags>(0));
}

Status Peer::negotiate(const ViewerOffer& offer) {
  SL_ASSIGN(const DescriptionPtr remote, description_of(offer.sdp));
  SL_RETURN_IF_ERROR(ask_webrtc(webrtc_.get(), "set-remote-description", remote.get(), kPatience));
  SL_ASSIGN(const StructurePtr reply,
            ask_webrtc(webrtc_.get(), "create-answer", nullptr, kPatience));
  GstWebRTCSessionDescription* raw = nullptr;
  if (reply) {
    gst_structure_get(reply.get(), "answer", GST_TYPE_WEBRTC_SESSION_DESCRIPTION, &raw, nullptr);
  }
  const DescriptionPtr local(raw);
  if (!local) return make_error(ErrorCode::kInvalidInput, "whep", "the offer cannot be answered");
  add_profile(*local->sdp, offer);
  SL_RETURN_IF_ERROR(ask_webrtc(webrtc_.get(), "set-local-description", local.get(), kPatience));
  SL_RETURN_IF_ERROR(wait_for_candidates());
  const DescriptionPtr whole(
      property<GstWebRTCSessionDescription*>(webrtc_.get(), "local-description"));
  if (!whole) return make_error(ErrorCode::kInternal, "whep", "there is no answer");
  const GStringPtr text(gst_sdp_message_as_text(whole->sdp));
  answer_ = text.get();
  listen_to_reports();
  return {};
}

Status Peer::wait_for_candidates() {
  std::unique_lock lock(notes_->mutex);
  if (notes_->changed.wait_for(lock, kPatience, [this] { return notes_->gathered; })) return {};
  return make_error(ErrorCode::kTimeout, "whep", "no candidates were found in time");
}

void Peer::step(Time) {
  if (sends_ || !notes_->connected) return;
  sends_ = true;
  stream_->add(id_, source_.get());
}

bool Peer::is_over(Time now, Duration connect_timeout, Duration silence_timeout) const {
  if (notes_->ended) return true;
  if (!notes_->connected) return now > since_ + connect_timeout;
  return now > notes_->heard.load() + silence_timeout;
}

}  // namespace sightline::stream
