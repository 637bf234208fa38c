// SPDX-License-Identifier: Apache-2.0
// What a search of the images costs, by the work that it counts: one row of CSV for each search of
// a recording (and for each step that follows what it has found into the next frames), with its CPU
// and what search_cost() says. The constants of that are fitted to these rows.
//   measure_search_cost RECORDING [--every N] [--object FILE] [--features FILE] [--no-silhouettes]
#include <fmt/format.h>

#include <string>

#include "figures.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/search_cost.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

struct Arguments {
  std::filesystem::path recording, object, features;
  size_t every = 1;
  bool silhouettes = true;
};

Result<Installation> installation_of(const Arguments& arguments) {
  SL_ASSIGN(Installation installation, recording_installation(arguments.recording));
  installation.detect.interval = Duration(0);
  installation.detect.silhouettes = arguments.silhouettes;
  for (ObjectConfig& object : installation.objects) {
    if (!arguments.object.empty()) {
      SL_ASSIGN(object.description, read_object_file(arguments.object));
    }
    object.description.modalities = {false, true, true, true};
    if (!arguments.features.empty()) object.description.features = arguments.features;
  }
  return installation;
}

template <typename Call>
void measure(const char* what, ObjectSearch& search, const Call& call) {
  const SearchWork before = search.work();
  const double start = process_cpu_ms();
  const bool found = !call().empty();
  const double cpu = process_cpu_ms() - start;
  SearchWork w = search.work();
  w -= before;
  fmt::print("{},{},{},{},{},{},{},{},{},{},{},{},{:.2f},{:.2f}\n", what, found ? 1 : 0, w.images,
             w.places, w.checked, w.scored, w.masks, w.overlaps, w.looked_at, w.fits, w.textures,
             w.near_poses, cpu, 1e3 * to_seconds(search_cost(w)));
}

Status run(const Arguments& arguments) {
  SL_ASSIGN(Recording opened, open_recording(arguments.recording));
  const auto recording = std::make_shared<const Recording>(std::move(opened));
  SL_ASSIGN(const Installation installation, installation_of(arguments));
  SL_ASSIGN(const Rig rig, load_rig(installation));
  SL_ASSIGN(const auto search, ObjectSearch::create(installation, rig));
  SL_ASSIGN(auto replay, VirtualReplay::open(recording));
  if (!search) return make_error(ErrorCode::kInvalidInput, "", "there is nothing to search for");
  fmt::print(
      "what,found,images,places,checked,scored,masks,overlaps,looked_at,fits,textures,near_poses,"
      "cpu_ms,model_ms\n");
  for (size_t set = 0;; ++set) {
    SL_ASSIGN(const auto frames, replay->next());
    if (!frames) return {};
    const bool follows = set % arguments.every == 1;
    if (!follows) {
      for (const FramePtr& frame : *frames) search->add_frame(frame->info().camera, *frame, {});
    }
    const Time now = frames->front()->info().capture;
    if (set % arguments.every == 0) {
      measure("search", *search, [&] { return search->search(now, {}); });
    } else if (follows) {
      measure("follow", *search, [&] { return search->follow(*frames, {}); });
    }
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (argument == "--no-silhouettes") {
      arguments.silhouettes = false;
    } else if (argument == "--every") {
      arguments.every = static_cast<size_t>(std::max(1, std::atoi(value))), ++i;
    } else if (argument == "--object") {
      arguments.object = value, ++i;
    } else if (argument == "--features") {
      arguments.features = value, ++i;
    } else {
      arguments.recording = argument;
    }
  }
  if (arguments.recording.empty()) {
    fmt::print(stderr,
               "usage: measure_search_cost RECORDING [--every N] [--object FILE] [--features FILE] "
               "[--no-silhouettes]\n");
    return 2;
  }
  const sightline::Status done = sightline::run(arguments);
  if (done) return 0;
  fmt::print(stderr, "measure_search_cost: {}\n", done.error().message());
  return exit_code(done.error());
}
