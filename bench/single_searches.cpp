// SPDX-License-Identifier: Apache-2.0
// What one search from nothing finds: every N-th set of frames of a recording is searched by
// itself, without background or memory, and compared with truth.csv or keyframes.csv.
//   single_searches RECORDING... [--every N] [--object FILE]
// One row per recording and object: searches, right (30 mm and 15 deg, up to the symmetries of the
// shape), right among several hypotheses, wrong, nothing; CPU and time of a search. --object: look
// for another object, which is not there: everything found is wrong.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <string>
#include <vector>

#include "figures.hpp"
#include "sightline/config/object_file.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using bench::cpu_ms;
using bench::quantile;

constexpr double kRightDistance = 0.03, kRightAngle = 0.26;

struct Arguments {
  std::vector<std::filesystem::path> recordings;
  std::filesystem::path object;
  size_t every = 10;
};

struct Totals {
  size_t searches = 0, right = 0, among = 0, wrong = 0;
  std::vector<double> cpu, wall;  // [ms]
};

class Searches {
 public:
  static Status run(const std::filesystem::path& folder, const Arguments& arguments) {
    Searches searches;
    SL_ASSIGN(Recording opened, open_recording(folder));
    searches.recording_ = std::make_shared<const Recording>(std::move(opened));
    SL_ASSIGN(searches.installation_, recording_installation(folder));
    searches.foreign_ = !arguments.object.empty();
    if (searches.foreign_) {
      searches.installation_.objects.resize(1);
      SL_ASSIGN(searches.installation_.objects.front().description,
                read_object_file(arguments.object));
    }
    searches.installation_.detect.silhouettes = false;
    for (ObjectConfig& object : searches.installation_.objects) {
      object.description.modalities = {false, true, true, true};
    }
    const auto keyframes = folder / "keyframes.csv";
    searches.sparse_ = std::filesystem::exists(keyframes);
    SL_ASSIGN(searches.truth_, read_truth(searches.sparse_ ? keyframes : folder / "truth.csv"));
    for (size_t i = 0; i < searches.installation_.objects.size(); ++i) {
      SL_RETURN_IF_ERROR(searches.search_for(i, arguments.every));
      searches.print(folder.filename().string(), i);
    }
    return {};
  }

 private:
  const Rigid3* truth_near(const std::string& object, Time time) const {
    const Rigid3* best = nullptr;
    Duration nearest = std::chrono::milliseconds(sparse_ ? 2 : 20);
    for (const TruthRow& row : truth_) {
      const Duration off = row.time > time ? row.time - time : time - row.time;
      if (row.object != object || off >= nearest) continue;
      nearest = off;
      best = &row.world_from_object;
    }
    return best;
  }

  static bool right(const RigObject& object, const Rigid3& truth, const Rigid3& pose) {
    const Eigen::Vector3d& center = object.views->center();
    if ((truth * center - pose * center).norm() >= kRightDistance) return false;
    const auto near = [&](const Rigid3& other) {
      return rotation_angle(other, pose) < kRightAngle;
    };
    const auto turns = object.views->symmetry_rotations();
    return near(truth) || std::any_of(turns.begin(), turns.end(),
                                      [&](const Rigid3& turn) { return near(truth * turn); });
  }

  Status search_for(size_t index, size_t every) {
    Installation alone = installation_;
    alone.objects = {installation_.objects[index]};
    SL_ASSIGN(const Rig rig, load_rig(alone));
    const RigObject& object = rig.objects.front();
    SL_ASSIGN(auto replay, VirtualReplay::open(recording_));
    std::vector<FramePtr> newest(alone.cameras.size());
    totals_ = {};
    for (size_t set = 0, judged = 0;; ++set) {
      SL_ASSIGN(const auto frames, replay->next());
      if (!frames) return {};
      for (const FramePtr& frame : *frames) newest[frame->info().camera.index()] = frame;
      const Time now = frames->front()->info().capture;
      const Rigid3* truth = truth_near(object.named.name, now);
      const bool all = std::all_of(newest.begin(), newest.end(), [](const auto& f) { return !!f; });
      if (!all || (!truth && !foreign_) || judged++ % (sparse_ && !foreign_ ? 1 : every) != 0) {
        continue;
      }
      SL_ASSIGN(const auto search, ObjectSearch::create(alone, rig));
      for (const FramePtr& frame : newest) search->add_frame(frame->info().camera, *frame, {});
      judge(object, truth, *search, now);
    }
  }

  void judge(const RigObject& object, const Rigid3* truth, ObjectSearch& search, Time now) {
    const double cpu = cpu_ms();
    const Time start = MonotonicClock::now();
    const std::vector<Observation> found = search.search(now, {});
    totals_.wall.push_back(1e3 * to_seconds(MonotonicClock::now() - start));
    totals_.cpu.push_back(cpu_ms() - cpu);
    ++totals_.searches;
    if (found.empty()) return;
    const auto& poses = found.back().hypotheses;
    const auto is_right = [&](const PoseHypothesis& pose) {
      return truth != nullptr && right(object, *truth, pose.world_from_object);
    };
    if (poses.size() == 1 && is_right(poses.front())) {
      ++totals_.right;
    } else if (std::any_of(poses.begin(), poses.end(), is_right)) {
      ++totals_.among;
    } else {
      ++totals_.wrong;
    }
  }

  void print(const std::string& recording, size_t index) {
    const Totals& t = totals_;
    fmt::print(
        "{:<10} {:<9} {:4} searches: right {:3}, among hypotheses {:3}, wrong {:3}, nothing {:3}; "
        "cpu {:4.0f} ms, {:4.0f} ms median, {:4.0f} ms 95 %\n",
        recording, installation_.objects[index].description.name, t.searches, t.right, t.among,
        t.wrong, t.searches - t.right - t.among - t.wrong, quantile(totals_.cpu, 0.5),
        quantile(totals_.wall, 0.5), quantile(totals_.wall, 0.95));
    std::fflush(stdout);
  }

  std::shared_ptr<const Recording> recording_;
  Installation installation_;
  std::vector<TruthRow> truth_;
  bool sparse_ = false, foreign_ = false;
  Totals totals_;
};

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::Arguments arguments;
  for (int i = 1; i < argc; ++i) {
    const std::string argument = argv[i];
    const char* value = i + 1 < argc ? argv[i + 1] : "";
    if (argument == "--every") {
      arguments.every = static_cast<size_t>(std::max(1, std::atoi(value))), ++i;
    } else if (argument == "--object") {
      arguments.object = value, ++i;
    } else {
      arguments.recordings.emplace_back(argument);
    }
  }
  if (arguments.recordings.empty()) {
    fmt::print(stderr, "usage: single_searches RECORDING... [--every N] [--object FILE]\n");
    return 2;
  }
  for (const auto& recording : arguments.recordings) {
    const sightline::Status done = sightline::Searches::run(recording, arguments);
    if (done) continue;
    fmt::print(stderr, "single_searches: {}\n", done.error().message());
    return exit_code(done.error());
  }
  return 0;
}
