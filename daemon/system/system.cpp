// SPDX-License-Identifier: Apache-2.0
#include "system/system.hpp"

#include <algorithm>

namespace sightline {

using namespace std::chrono_literals;

namespace {

// How long after the stop began what waits for a device or a disk may go on. Both are within the
// patience of the program with its stop.
constexpr Duration kForDevices = 300ms;
constexpr Duration kForRecording = 1300ms;

constexpr Duration kHintLasts = 10s;

Result<ObjectId> find_object(const Installation& installation, const std::string& name) {
  for (size_t i = 0; i < installation.objects.size(); ++i) {
    if (installation.objects[i].description.name == name) {
      return ObjectId(static_cast<uint32_t>(i));
    }
  }
  return make_error(ErrorCode::kInvalidInput, name, "there is no such object");
}

}  // namespace

Status System::hint(const std::string& object, const SearchHint& hint) const {
  SL_ASSIGN(const ObjectId id, find_object(installation, object));
  if (const auto* place = std::get_if<ImageHint>(&hint)) {
    const size_t camera = place->camera.index();
    if (camera >= installation.cameras.size() || !observes(installation.cameras[camera].role)) {
      return make_error(ErrorCode::kInvalidInput, object,
                        "the camera of the hint does not observe");
    }
  }
  if (search && search->hint(id, hint, MonotonicClock::now() + kHintLasts)) return {};
  return make_error(ErrorCode::kInvalidInput, object,
                    "is not searched for: it has markers, or [detect] is off");
}

Status System::forget(const std::string& object) const {
  SL_ASSIGN(const ObjectId id, find_object(installation, object));
  if (!fuses(installation.cell.role) && !installation.cell.local &&
      (!cell || cell->status().fusion.empty())) {
    return make_error(ErrorCode::kUnavailable, object,
                      "another host keeps the estimates, and none is there now");
  }
  if (search) search->forget(id);
  if (fusion && (fuses(installation.cell.role) || installation.cell.local)) fusion->forget(id);
  return {};
}

Status System::stop(StopLeft& left) const {
  const Time begin = MonotonicClock::now();
  const auto rest = [begin](Duration all) {
    return std::max<Duration>(begin + all - MonotonicClock::now(), 0ns);
  };
  for (const auto& camera : cameras) camera->request_stop();
  for (const auto& view : views) view->stop();
  if (actions) actions->stop();
  for (const auto& camera : cameras) {
    if (camera->stop_unless_waiting(rest(kForDevices))) continue;
    left.what.push_back("camera " + camera->name());
  }
  if (search) search->stop();
  if (points) points->stop();
  if (fusion) fusion->stop();
  if (recorder) recorder->request_stop();  // it writes the rest while the streams end
  for (const auto& camera : cameras) {
    if (camera->output()) camera->output()->close();
  }
  for (const auto& view : views) view->output()->close();
  if (last_poses && !last_poses->stop_unless_waiting(rest(kForRecording))) {
    left.what.emplace_back("the last poses");
  }
  if (mqtt && !mqtt->stop_unless_waiting(rest(kForDevices))) left.what.emplace_back("MQTT");
  if (cell && !cell->stop_unless_waiting(rest(kForDevices))) left.what.emplace_back("the cell");
  if (calibration && !calibration->stop_unless_waiting(rest(kForRecording))) {
    left.what.emplace_back("the proposed calibration");
  }
  if (http) http->stop();
  if (rtsp) rtsp->stop();
  if (!recorder) return {};
  if (recorder->stop_unless_waiting(rest(kForRecording))) return recorder->stop();
  left.what.emplace_back("the recording");
  left.recording = true;
  return {};
}

}  // namespace sightline
