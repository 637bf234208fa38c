// SPDX-License-Identifier: Apache-2.0
// What the cameras learn to hide an object, against a recording with known visibility
// (visibility.csv): the recording is replayed without its scene mesh, and the share of the object's
// pixels that count as hidden is compared image by image.
//   learned_occlusion RECORDING [--camera NAME] [--modalities LIST] [--frames]
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <map>
#include <sstream>

#include "figures.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/pipeline/mesh_depth_renderer.hpp"
#include "sightline/pipeline/replay_pipeline.hpp"

namespace sightline {
namespace {

using bench::quantile;

struct Arguments {
  std::filesystem::path recording;
  std::string camera;  // empty: all
  std::vector<std::string> modalities;
  bool frames = false;
};

// visibility.csv: camera,index,object,visible_fraction,xmin,ymin,xmax,ymax,inimage_pixels
using Visibility = std::map<std::pair<std::string, uint64_t>, double>;

Visibility read_visibility(const std::filesystem::path& file) {
  Visibility known;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    std::string camera, object;
    uint64_t index = 0;
    double visible = 0, x0 = 0, y0 = 0, x1 = 0, y1 = 0, pixels = 0;
    words >> camera >> index >> object >> visible >> x0 >> y0 >> x1 >> y1 >> pixels;
    if (words && pixels > 0) known[{camera, index}] = visible;
  }
  return known;
}

struct Figures {
  std::vector<double> off;  // hidden share against the truth, in percentage points, signed
  double false_pixels = 0, clear_pixels = 0;  // where nothing hides
  size_t false_frames = 0, clear_frames = 0, not_tracked = 0;
};

class Judge {
 public:
  Judge(const Installation& installation, const Rig& rig) : installation_(installation), rig_(rig) {
    for (const CameraConfig& camera : installation.cameras) {
      outline_.push_back(
          mesh_depth_renderer_factory(rig.objects[0].mesh)(camera.calibration.model));
    }
  }

  // Share of the object's pixels that are drawn as hidden, by the renderer's own rule; and how many
  // pixels there are.
  std::pair<double, double> occluded_share(size_t camera, const PoseEstimate& estimate,
                                           const OcclusionDepth* hidden) {
    const Rigid3 camera_from_object =
        installation_.cameras[camera].calibration.world_from_camera.inverse() *
        estimate.world_from_object;
    const DepthTile tile = outline_[camera]->render(camera_from_object);
    const double depth = (camera_from_object * rig_.objects[0].mesh->center.cast<double>()).z();
    const RenderOptions& options = installation_.render;
    const double factor =
        1 + options.depth_tolerance +
        options.depth_tolerance_sigmas * estimate.sigma_translation() / std::max(depth, 1e-3);
    double all = 0, behind = 0;
    for (int y = 0; y < tile.height; ++y) {
      for (int x = 0; x < tile.width; ++x) {
        const double own = static_cast<double>(tile.row(y)[x]);
        if (own <= 0) continue;
        ++all;
        if (hidden == nullptr) continue;
        behind += static_cast<double>(hidden->at(tile.x + x, tile.y + y)) > factor * own ? 1 : 0;
      }
    }
    return {all > 0 ? behind / all : 0, all};
  }

 private:
  const Installation& installation_;
  const Rig& rig_;
  std::vector<std::unique_ptr<DepthRenderer>> outline_;
};

void note(Figures& figures, double visible, double hidden, double pixels) {
  figures.off.push_back(100 * (hidden - (1 - visible)));
  if (visible < 0.9995) return;
  ++figures.clear_frames;
  figures.clear_pixels += pixels;
  figures.false_pixels += hidden * pixels;
  figures.false_frames += hidden > 0 ? 1 : 0;
}

void print(const std::string& camera, const Figures& f) {
  std::vector<double> size;
  for (const double off : f.off) size.push_back(std::abs(off));
  const auto within = [&](double points) {
    const auto good =
        std::count_if(size.begin(), size.end(), [&](double s) { return s <= points; });
    return 100.0 * static_cast<double>(good) /
           std::max<double>(1, static_cast<double>(size.size()));
  };
  fmt::print(
      "{}: {} images; hidden share off by {:.1f} points (median), {:.1f} (90 %), {:.1f} (max); "
      "within 5 points {:.0f} %, within 10 {:.0f} %; {} not tracked\n",
      camera, size.size(), quantile(size, 0.5), quantile(size, 0.9), quantile(size, 1.0), within(5),
      within(10), f.not_tracked);
  if (f.clear_frames == 0) return;
  fmt::print("  nothing hides in {} images: {} with a pixel drawn as hidden, {:.3f} % of pixels\n",
             f.clear_frames, f.false_frames, 100 * f.false_pixels / std::max(1.0, f.clear_pixels));
}

Status run(const Arguments& arguments) {
  SL_ASSIGN(Recording opened, open_recording(arguments.recording));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(Installation installation, recording_installation(arguments.recording));
  installation.scene = {};
  installation.scene.learn = true;
  if (!arguments.modalities.empty()) {
    SL_ASSIGN(const Modalities modalities, parse_modalities(arguments.modalities, "--modalities"));
    for (ObjectConfig& object : installation.objects) object.description.modalities = modalities;
  }
  const Visibility known = read_visibility(arguments.recording / "visibility.csv");
  if (known.empty()) {
    return make_error(ErrorCode::kInvalidInput, arguments.recording.string(),
                      "has no visibility.csv");
  }
  SL_ASSIGN(auto pipeline, ReplayPipeline::create(installation, recording, nullptr, {},
                                                  SearchTiming{.instant = true}));
  Judge judge(installation, pipeline->rig());
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
  std::map<std::string, Figures> figures;
  for (;;) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) break;
    SL_RETURN_IF_ERROR(pipeline->step(*frames));
    for (const FramePtr& frame : *frames) {
      const size_t camera = frame->info().camera.index();
      const std::string& name = recording->cameras[camera].name;
      if (!arguments.camera.empty() && name != arguments.camera) continue;
      const auto truth = known.find({name, frame->info().sequence});
      if (truth == known.end()) continue;
      const PoseAt at = pipeline->tracks()[0]->at(frame->info().capture);
      if (at.source == PoseSource::kNone || !has_pose(at.estimate.state)) {
        ++figures[name].not_tracked;
        continue;
      }
      const OcclusionDepthPtr hidden = pipeline->hidden(camera);
      const auto [share, pixels] = judge.occluded_share(camera, at.estimate, hidden.get());
      note(figures[name], truth->second, share, pixels);
      if (arguments.frames) {
        fmt::print("{} {:3} {:<9} hidden {:5.1f} % truth {:5.1f} % off {:+5.1f}\n", name,
                   frame->info().sequence, to_string(at.estimate.state), 100 * share,
                   100 * (1 - truth->second), 100 * (share - 1 + truth->second));
      }
    }
  }
  for (const auto& [camera, f] : figures) print(camera, f);
  const ReplaySummary& summary = pipeline->summary();
  fmt::print("learning: {:.2f} ms CPU per image\n",
             summary.learn_cpu_ms / std::max<double>(1, static_cast<double>(summary.frames)));
  return {};
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    const bool more = i + 1 < argc;
    if (word == "--camera" && more) {
      arguments.camera = argv[++i];
    } else if (word == "--modalities" && more) {
      std::istringstream list(argv[++i]);
      for (std::string modality; std::getline(list, modality, ',');)
        arguments.modalities.push_back(modality);
    } else if (word == "--frames") {
      arguments.frames = true;
    } else if (arguments.recording.empty() && !word.starts_with("-")) {
      arguments.recording = word;
    } else {
      fmt::print(stderr,
                 "learned_occlusion RECORDING [--camera NAME] [--modalities LIST] [--frames]\n");
      return 2;
    }
  }
  const auto done = sightline::run(arguments);
  if (done) return 0;
  fmt::print(stderr, "{}\n", done.error().message());
  return sightline::exit_code(done.error());
}
