// SPDX-License-Identifier: Apache-2.0
#include "init/rig_draft.hpp"

#include <algorithm>
#include <cmath>

#include "cameras/camera_probe.hpp"
#include "cameras/device_listing.hpp"
#include "report.hpp"
#include "sightline/base/files.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/capture/network/network_source.hpp"

namespace sightline::cli {
namespace {

constexpr std::string_view kReplay = "replay:";

std::optional<ImageSize> wanted_size(const CameraWishes& wishes, const std::string& name) {
  for (const std::string& key : {name, std::string()}) {
    const auto found = wishes.sizes.find(key);
    if (found != wishes.sizes.end()) return found->second;
  }
  return std::nullopt;
}

DraftCamera draft_recorded(const CameraConfig& recorded, const std::string& source) {
  DraftCamera camera;
  camera.name = recorded.name;
  camera.source = source;
  camera.calibration = recorded.calibration;
  camera.width = recorded.calibration.model.width();
  camera.height = recorded.calibration.model.height();
  camera.remarks = {
      fmt::format("Recorded: {}x{}, played again and again.", camera.width, camera.height)};
  return camera;
}

Result<DraftCamera> draft_device(const DeviceInfo& device, const std::string& name,
                                 std::optional<ImageSize> wanted) {
  SL_ASSIGN(const CameraChoice choice, choose_format(device, wanted));
  DraftCamera camera;
  camera.name = name;
  camera.source = source_of(device);
  camera.format = choice.format;
  camera.width = choice.width;
  camera.height = choice.height;
  camera.rate_hz = choice.rate_hz;
  camera.remarks = {
      fmt::format("{}{}{}, at {}", device.model, device.serial.empty() ? "" : ", serial ",
                  device.serial, device.where),
      choice.why};
  return camera;
}

// By its first image: an address says nothing about size.
Result<DraftCamera> draft_probed(const std::string& name, const std::string& source,
                                 std::optional<ImageSize> wanted) {
  DraftCamera camera;
  camera.name = name;
  camera.source = source;
  SL_ASSIGN(const Opener opener, bare_opener(source));
  const auto probed = run_probe(opener, 1);
  if (!probed && !wanted) {
    Error error = probed.error();
    error.where = fmt::format("camera {} ({})", name, shown_source(source));
    error.text +=
        fmt::format("; where it is not there yet, say its size: --size {}=1280x720", name);
    return error;
  }
  const ImageSize seen = probed ? ImageSize{probed->report.width, probed->report.height} : *wanted;
  if (wanted && (seen.width != wanted->width || seen.height != wanted->height)) {
    return make_error(ErrorCode::kInvalidInput, fmt::format("camera {}", name),
                      "it sends {}x{} and not {}x{}: set it up so, or leave --size out", seen.width,
                      seen.height, wanted->width, wanted->height);
  }
  camera.width = seen.width;
  camera.height = seen.height;
  if (probed && probed->report.rate_hz > 0) {
    camera.rate_hz = std::max(1.0, std::round(probed->report.rate_hz));
  }
  camera.remarks = {
      probed ? fmt::format("It sent {}x{} at about {:.0f} Hz when this was written.", seen.width,
                           seen.height, probed->report.rate_hz)
             : fmt::format("It did not answer when this was written; its size was told: {}x{}.",
                           seen.width, seen.height)};
  return camera;
}

class Drafter {
 public:
  explicit Drafter(const CameraWishes& wishes) : wishes_(wishes) {}

  Result<RigDraft> draft() {
    if (!wishes_.recording.empty()) SL_RETURN_IF_ERROR(take_recording());
    for (const std::string& wish : wishes_.cameras) SL_RETURN_IF_ERROR(take_named(wish));
    if (wishes_.recording.empty() && wishes_.cameras.empty()) SL_RETURN_IF_ERROR(take_found());
    if (draft_.cameras.empty()) return nothing_found();
    SL_RETURN_IF_ERROR(calibrate());
    return std::move(draft_);
  }

 private:
  Status take_recording() {
    SL_ASSIGN(const Installation recorded, recording_installation(wishes_.recording));
    const std::string folder = std::filesystem::absolute(wishes_.recording).string();
    for (const CameraConfig& camera : recorded.cameras) {
      draft_.cameras.push_back(draft_recorded(camera, std::string(kReplay) + folder));
    }
    for (const ObjectConfig& object : recorded.objects) {
      draft_.objects.push_back(object.description.file);
    }
    draft_.scene = recorded.scene.meshes;
    draft_.source = recorded.calibration;
    return {};
  }

  Status take_named(const std::string& wish) {
    const size_t at = wish.find('=');
    if (at == std::string::npos || at == 0 || at + 1 == wish.size()) {
      return make_error(ErrorCode::kInvalidInput, "--camera",
                        "a camera is given as NAME=SOURCE, as in left=rtsp://10.0.0.7/live");
    }
    const std::string name = wish.substr(0, at), source = wish.substr(at + 1);
    const auto wanted = wanted_size(wishes_, name);
    if (source.starts_with(kReplay)) return take_recorded(name, source.substr(kReplay.size()));
    if (!check_network_url(source)) {
      SL_ASSIGN(const DeviceListing* listing, devices());
      const auto& devices = listing->devices;
      const auto found = std::find_if(devices.begin(), devices.end(), [&](const DeviceInfo& d) {
        return source_of(d) == source && !d.formats.empty();
      });
      if (found != devices.end()) {
        SL_ASSIGN(DraftCamera camera, draft_device(*found, name, wanted));
        draft_.cameras.push_back(std::move(camera));
        return {};
      }
    }
    SL_ASSIGN(DraftCamera camera, draft_probed(name, source, wanted));
    draft_.cameras.push_back(std::move(camera));
    return {};
  }

  Status take_recorded(const std::string& name, const std::filesystem::path& folder) {
    SL_ASSIGN(const Installation recorded, recording_installation(folder));
    const std::string source = std::string(kReplay) + std::filesystem::absolute(folder).string();
    std::string names;
    for (const CameraConfig& camera : recorded.cameras) {
      if (camera.name == name) {
        draft_.cameras.push_back(draft_recorded(camera, source));
        return {};
      }
      names += (names.empty() ? "" : ", ") + camera.name;
    }
    return make_error(ErrorCode::kNotFound, folder.string(), "it has no camera {}; it has: {}",
                      name, names);
  }

  Status take_found() {
    SL_ASSIGN(const DeviceListing* listing, devices());
    for (const DeviceInfo& device : usable_cameras(listing->devices, draft_.left_out)) {
      const std::string name = fmt::format("cam{}", draft_.cameras.size() + 1);
      const auto wanted = wanted_size(wishes_, name);
      auto camera = draft_device(device, name, wanted);
      if (!camera && wanted) return camera.error();
      // What somebody has not asked for does not stop the others.
      if (!camera) {
        draft_.left_out.push_back(camera.error().message());
        continue;
      }
      draft_.cameras.push_back(std::move(*camera));
    }
    for (const std::string& note : listing->notes) draft_.left_out.push_back(note);
    return {};
  }

  Error nothing_found() const {
    std::string text =
        "no camera was found; plug one in (`sightline doctor` says what is in its way), name one "
        "of the network with --camera NAME=rtsp://ADDRESS, or try --recording FOLDER";
    for (const std::string& line : draft_.left_out) text += "\n  " + line;
    return {ErrorCode::kNotFound, text, ""};
  }

  // Cameras that somebody has calibrated measure; the others are shown.
  Status calibrate() {
    if (wishes_.calibration.empty()) return {};
    SL_ASSIGN(const auto known, read_calibration(wishes_.calibration));
    bool all = true;
    for (DraftCamera& camera : draft_.cameras) {
      const CalibratedCamera* const found = find_camera(known, camera.name);
      if (found == nullptr) {
        all = false;
        continue;
      }
      if (found->model.width() != camera.width || found->model.height() != camera.height) {
        return make_error(ErrorCode::kInvalidInput, wishes_.calibration.string(),
                          "camera {} was calibrated with {}x{} and would send {}x{}; with --size "
                          "{}={}x{} it is asked for that size",
                          camera.name, found->model.width(), found->model.height(), camera.width,
                          camera.height, camera.name, found->model.width(), found->model.height());
      }
      camera.calibration = *found;
    }
    draft_.source = all ? std::optional(wishes_.calibration) : std::nullopt;
    return {};
  }

  Result<const DeviceListing*> devices() {
    if (!listing_) {
      if (wishes_.listing.empty()) {
        listing_ = list_devices();
      } else {
        SL_ASSIGN(const std::string text, read_file(wishes_.listing, size_t{4} << 20));
        SL_ASSIGN(listing_, parse_device_listing(text, wishes_.listing.string()));
      }
    }
    return &*listing_;
  }

  const CameraWishes& wishes_;
  RigDraft draft_;
  std::optional<DeviceListing> listing_;
};

}  // namespace

Result<RigDraft> draft_rig(const CameraWishes& wishes) {
  SL_ASSIGN(RigDraft draft, Drafter(wishes).draft());
  const bool all = std::all_of(draft.cameras.begin(), draft.cameras.end(),
                               [](const DraftCamera& c) { return c.calibration.has_value(); });
  // Recorded cameras beside others, or of several recordings: no file has all of them.
  if (!all || (wishes.calibration.empty() && !wishes.cameras.empty())) draft.source.reset();
  return draft;
}

Result<CalibratedCamera> nominal_calibration(const DraftCamera& camera, size_t place) {
  constexpr double kFocal = 0.9;  // of the width
  CameraModel::Parameters lens;
  lens.width = camera.width;
  lens.height = camera.height;
  lens.fx = lens.fy = kFocal * camera.width;
  lens.cx = 0.5 * (camera.width - 1);
  lens.cy = 0.5 * (camera.height - 1);
  SL_ASSIGN(const CameraModel model, CameraModel::create(lens, camera.name));
  // In a row, 1 m up, looking along the world's y, upright.
  Eigen::Matrix3d axes;
  axes << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  const Eigen::Vector3d at(0.5 * static_cast<double>(place), 0, 1);
  return CalibratedCamera{camera.name, model, Rigid3(Eigen::Quaterniond(axes), at)};
}

}  // namespace sightline::cli
