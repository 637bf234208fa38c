// SPDX-License-Identifier: Apache-2.0
#include "capture/aravis/aravis_close.hpp"

#include "sightline/base/thread.hpp"

namespace sightline::capture {
namespace {

void unref_in_background(gpointer first, gpointer second) {
  start_thread("aravis-close", [first, second](std::stop_token) {
    if (first != nullptr) g_object_unref(first);
    if (second != nullptr) g_object_unref(second);
  }).detach();
}

}  // namespace

void close_in_background(ObjectRef<ArvStream> stream, ObjectRef<ArvCamera> camera) {
  unref_in_background(stream.release(), camera.release());
}

void close_in_background(ObjectRef<ArvDevice> device) {
  unref_in_background(device.release(), nullptr);
}

}  // namespace sightline::capture
