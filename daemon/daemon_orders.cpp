// SPDX-License-Identifier: Apache-2.0
// What an operator may order over HTTP beside a reload.
#include <exception>
#include <nlohmann/json.hpp>

#include "calibration/capture_targets.hpp"
#include "daemon.hpp"
#include "sightline/base/log.hpp"
#include "sightline/pipeline/calibration_proposal.hpp"
#include "sightline/pipeline/last_poses.hpp"
#include "web/calibration_json.hpp"
#include "web/capture_json.hpp"
#include "web/scene_json.hpp"

namespace sightline {

void Daemon::add_orders() {
  HttpContent& http = context_.http;
  http.overlay_json = [this] { return overlays_.json(system_.read()->installation); };
  http.set_overlay = [this](const OverlayRequest& request) {
    return orders_.take([this, request] {
      return restyle([&](Installation& next) { return overlays_.change(request, next); });
    });
  };
  http.reset_overlay = [this] {
    return orders_.take([this] {
      return restyle([&](Installation& next) -> Status {
        overlays_.reset(next);
        return {};
      });
    });
  };
  // A large scene is simplified first.
  http.scene_mesh = [this] { return orders_.take([this] { return scene_mesh(); }); };
  http.calibration_report = [this] {
    return orders_.take([this] {
      return report_reply(calibration_report_file(system_.read()->installation),
                          "there is no report.html beside the calibration in force");
    });
  };
  add_capture_orders();
  http.accept_calibration = [this](const std::vector<std::string>& cameras) {
    return orders_.take([this, cameras] { return accept_calibration(cameras); });
  };
}

void Daemon::add_capture_orders() {
  HttpContent& http = context_.http;
  http.start_capture = [this](const CaptureOrder& order) {
    return orders_.take([this, order] { return start_capture(order); });
  };
  http.capture_targets = [this] {
    return orders_.take([this] {
      return HttpReply::json(capture_targets_json(find_targets(system_.read()->installation)));
    });
  };
  http.capture_report = [this] {
    return orders_.take([this] {
      const auto shown = captures_->shown();
      constexpr const char* kNone = "there is no capture with a report";
      if (shown->phase != CapturePhase::kDone) return HttpReply::error(404, kNone);
      return report_reply(shown->folder / "report.html", kNone);
    });
  };
}

HttpReply Daemon::start_capture(const CaptureOrder& order) {
  if (captures_->busy()) return HttpReply::error(409, "one is under way: stop it first");
  const auto folder = captures_->start(order, system_.read()->installation);
  if (!folder) return HttpReply::error(folder.error());
  HttpReply reply =
      HttpReply::json(nlohmann::ordered_json{{"folder", folder->string()}}.dump(2) + "\n");
  reply.status = 202;
  return reply;
}

void Daemon::do_orders(std::stop_token stop) {
  orders_stop_ = std::move(stop);
  orders_.work();
}

HttpReply Daemon::scene_mesh() {
  const auto system = system_.read();
  if (!system->rig || scene_mesh_of_.lock() != system->rig) {
    scene_mesh_ = scene_mesh_reply(*system);
    scene_mesh_of_ = system->rig;
  }
  return scene_mesh_;
}

HttpReply Daemon::restyle(const std::function<Status(Installation&)>& change) {
  Installation next = system_.read()->installation;
  if (const Status changed = change(next); !changed) return HttpReply::error(changed.error());
  const InstallationChanges changes = compare(system_.read()->installation, next);
  if (!changes.none()) {
    if (const Status done = replace(std::move(next), orders_stop_); !done) {
      return HttpReply::error(done.error());
    }
    log::info("by order: {}", changes.summary());
  }
  return HttpReply::json(overlays_.json(system_.read()->installation));
}

HttpReply Daemon::accept_calibration(const std::vector<std::string>& cameras) {
  const auto system = system_.read();
  const auto proposal = system->calibration && system->calibration->has_proposed()
                            ? system->calibration->proposal()
                            : std::filesystem::path();
  std::error_code error;
  if (proposal.empty() || !std::filesystem::exists(proposal, error)) {
    return HttpReply::error(404, "no camera is known to have moved: nothing is proposed");
  }
  // A correction that is in the file already would be applied once more.
  if (proposal != proposal_file(system->installation.calibration, state_folder())) {
    return HttpReply::error(409, "the calibration has changed since it was loaded: reload first");
  }
  const auto accepted = accept_proposal(system->installation.calibration, proposal, cameras);
  if (!accepted) return HttpReply::error(accepted.error());
  nlohmann::ordered_json json{{"kept", accepted->kept.string()},
                              {"cameras", nlohmann::ordered_json::array()}};
  for (const AcceptedCamera& camera : accepted->cameras) {
    log::warning("camera {}: new place taken over by order, turned {:.3f} deg, shifted {:.2f} mm",
                 camera.name, camera.turned_deg, camera.shifted_mm);
    json["cameras"].push_back({{"name", camera.name},
                               {"turned_deg", camera.turned_deg},
                               {"shifted_mm", camera.shifted_mm}});
  }
  std::filesystem::remove(proposal, error);
  if (options_.request_reload) options_.request_reload();
  HttpReply reply = HttpReply::json(json.dump(2) + "\n");
  reply.status = 202;
  return reply;
}

}  // namespace sightline
