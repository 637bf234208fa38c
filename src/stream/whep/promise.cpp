// SPDX-License-Identifier: Apache-2.0
#include "stream/whep/promise.hpp"

#include <condition_variable>
#include <mutex>

#include "stream/handover.hpp"

namespace sightline::stream {
namespace {

/// Shared with the promise, which may be answered after nobody waits any more.
struct Reply {
  std::mutex mutex;
  std::condition_variable changed;
  bool there = false;
  GstPromiseResult result = GST_PROMISE_RESULT_PENDING;
  StructurePtr structure;
};
using ReplyData = UserData<std::shared_ptr<Reply>>;

void take_reply(GstPromise* promise, gpointer data) {
  const LibraryCall call(data);
  Reply& reply = *ReplyData::in(data);
  const GstPromiseResult result = gst_promise_wait(promise);  // it has changed: no wait
  if (result == GST_PROMISE_RESULT_PENDING) return;
  const GstStructure* said =
      result == GST_PROMISE_RESULT_REPLIED ? gst_promise_get_reply(promise) : nullptr;
  std::lock_guard lock(reply.mutex);
  reply.result = result;
  reply.structure.reset(said != nullptr ? gst_structure_copy(said) : nullptr);
  reply.there = true;
  reply.changed.notify_all();
}

}  // namespace

Result<StructurePtr> ask_webrtc(GstElement* webrtc, const char* signal, gpointer argument,
                                Duration patience) {
  const auto reply = std::make_shared<Reply>();
  GstPromise* const promise =
      gst_promise_new_with_change_func(take_reply, ReplyData::make(reply), ReplyData::destroy);
  g_signal_emit_by_name(webrtc, signal, argument, promise);
  std::unique_lock lock(reply->mutex);
  if (!reply->changed.wait_for(lock, patience, [&] { return reply->there; })) {
    lock.unlock();
    gst_promise_interrupt(promise);
    gst_promise_unref(promise);
    return make_error(ErrorCode::kTimeout, "whep", "{}: no reply", signal);
  }
  StructurePtr structure = std::move(reply->structure);
  lock.unlock();
  gst_promise_unref(promise);
  if (structure && gst_structure_has_field(structure.get(), "error")) {
    GError* raw = nullptr;
    gst_structure_get(structure.get(), "error", G_TYPE_ERROR, &raw, nullptr);
    const GErrorPtr error(raw);
    return make_error(ErrorCode::kInvalidInput, "whep", "the offer is not accepted: {}",
                      text_of(error));
  }
  if (reply->result != GST_PROMISE_RESULT_REPLIED) {
    return make_error(ErrorCode::kUnavailable, "whep", "{}: given up", signal);
  }
  return structure;
}

}  // namespace sightline::stream
