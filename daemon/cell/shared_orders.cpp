// SPDX-License-Identifier: Apache-2.0
#include "cell/shared_orders.hpp"

#include <algorithm>

#include "sightline/base/log.hpp"

namespace sightline {
namespace {

using CellOf = std::function<std::shared_ptr<CellWorker>()>;
using Kind = CellOrder::Kind;

// Here first, since it says what is wrong with the order; an error that others need not have is
// kept to the log.
Status share(const std::shared_ptr<CellWorker>& cell, CellOrder order, const Status& here,
             bool elsewhere) {
  if (!cell || (!here && !elsewhere)) return here;
  if (!here) log::info("cell: {}: not here: {}", to_string(order.kind), here.error().message());
  return cell->order(std::move(order));
}

CellOrder hint_order(const std::string& object, const HintRequest& request) {
  CellOrder order;
  order.object = object;
  if (const auto* pose = std::get_if<Rigid3>(&request.where)) {
    order.kind = Kind::kHintPose;
    order.world_from_object = *pose;
    return order;
  }
  const auto& place = std::get<HintRequest::Place>(request.where);
  order.kind = Kind::kHintImage;
  order.camera = place.camera;
  order.pixel = place.pixel;
  order.radius_px = place.radius_px;
  return order;
}

HintRequest hint_request(const CellOrder& order) {
  if (order.kind == Kind::kHintPose) return {order.world_from_object};
  return {HintRequest::Place{order.camera, order.pixel, order.radius_px}};
}

// Cameras of other hosts are theirs to look in, and a fusion host without cameras looks nowhere.
bool is_for_others(const CellOrder& order, const Status& here, const CellOptions& options) {
  if (here) return false;
  if (order.kind == Kind::kHintPose) {
    return options.role == CellRole::kFusion && here.error().code == ErrorCode::kInvalidInput;
  }
  return here.error().where == order.camera &&
         std::ranges::find(options.cameras, order.camera, &RemoteCamera::name) !=
             options.cameras.end();
}

bool is_away(const Status& here) { return !here && here.error().code == ErrorCode::kUnavailable; }

void share_recordings(HttpContent& content, const CellOf& cell) {
  const auto shared = [cell](std::function<Status(const RecordingOrder&)> local, Kind kind) {
    return [cell, local = std::move(local), kind](const RecordingOrder& wanted) {
      CellOrder order;
      order.kind = kind;
      order.recordings = wanted.kinds;
      order.seconds = wanted.seconds;
      const Status here = local(wanted);
      return share(cell(), std::move(order), here, is_away(here));
    };
  };
  content.start_recording = shared(std::move(content.start_recording), Kind::kRecord);
  content.stop_recording = shared(std::move(content.stop_recording), Kind::kStopRecording);
  content.mark_recording = [cell,
                            local = std::move(content.mark_recording)](const std::string& text) {
    CellOrder order;
    order.kind = Kind::kMark;
    order.text = text;
    const Status here = local(text);
    return share(cell(), std::move(order), here, is_away(here));
  };
}

Status done(const CellOrder& order, const HttpContent& content) {
  switch (order.kind) {
    case Kind::kHintImage:
    case Kind::kHintPose:
      return content.hint(order.object, hint_request(order));
    case Kind::kForget:
      return content.forget(order.object);
    case Kind::kReload:
      return content.reload ? content.reload() : Status();
    case Kind::kRecord:
      return content.start_recording({order.recordings, order.seconds});
    case Kind::kStopRecording:
      return content.stop_recording({order.recordings, {}});
    case Kind::kMark:
      return content.mark_recording(order.text);
  }
  return {};
}

}  // namespace

void share_orders(HttpContent& content, CellOf cell) {
  content.hint = [cell, local = std::move(content.hint)](const std::string& object,
                                                         const HintRequest& request) {
    CellOrder order = hint_order(object, request);
    const Status here = local(object, request);
    const auto worker = cell();
    const bool others = worker && is_for_others(order, here, worker->options());
    return share(worker, std::move(order), here, others);
  };
  content.forget = [cell, local = std::move(content.forget)](const std::string& object) {
    CellOrder order;
    order.kind = Kind::kForget;
    order.object = object;
    return share(cell(), std::move(order), local(object), false);
  };
  if (content.reload) {
    content.reload = [cell, local = std::move(content.reload)] {
      // The others first: the reload may exchange what passes it on.
      const auto worker = cell();
      const Status told = worker ? worker->order(CellOrder()) : Status();
      const Status here = local();
      return here ? told : here;
    };
  }
  share_recordings(content, cell);
}

void obey(const CellOrder& order, const HttpContent& content) {
  const Status status = done(order, content);
  if (status) {
    log::info("cell: {} by order of host {}", to_string(order.kind), order.host);
  } else {
    log::info("cell: {} by order of host {}: not here: {}", to_string(order.kind), order.host,
              status.error().message());
  }
}

}  // namespace sightline
