// SPDX-License-Identifier: Apache-2.0
// How exact is what a search hands over: recordings with truth are searched again and again, as if
// nothing were ever tracked, and each pose that is carried to now is compared with the truth of its
// frame. Prints a Markdown table by object: observations, which share of them is about right (60
// mm, 40 deg), and the errors of those (up to the symmetry of the shape) in the median and of nine
// in ten.
//   carried_poses [--search-cost FACTOR] RECORDING ...
#include <fmt/format.h>

#include <charconv>
#include <string_view>
#include <vector>

#include "claims/truth_recording.hpp"
#include "figures.hpp"
#include "sightline/pipeline/timed_search.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using bench::quantile;

constexpr double kAboutMm = 60, kAboutDeg = 40;

struct Figures {
  int seen = 0;
  std::vector<double> mm, deg;  ///< of those about right
};

class Searching {
 public:
  static Result<std::unique_ptr<Searching>> create(const std::filesystem::path& path,
                                                   double cost_factor) {
    std::unique_ptr<Searching> run(new Searching());
    SL_ASSIGN(run->in_, bench::open_truth_recording(path));
    SL_ASSIGN(run->search_, ObjectSearch::create(run->in_.installation, run->in_.rig));
    if (!run->search_) {
      return make_error(ErrorCode::kInvalidInput, path.string(), "nothing to search for");
    }
    run->timed_ = std::make_unique<TimedSearch>(*run->search_, run->in_.installation.cameras.size(),
                                                cost_factor);
    run->figures_.resize(run->in_.rig.objects.size());
    return run;
  }

  Status play() {
    SL_ASSIGN(auto replay,
              VirtualReplay::open(in_.recording, {}, time_offsets(*in_.recording, in_.installation),
                                  axis_histories(*in_.recording, in_.installation)));
    for (;;) {
      SL_ASSIGN(const auto frames, replay->next());
      if (!frames) return {};
      for (const Observation& found : timed_->advance(frames->front()->info().capture, {})) {
        judge(found);
      }
      std::vector<CameraFrame> seen;
      for (const FramePtr& frame : *frames) seen.push_back({frame->info().camera, frame});
      timed_->take(seen, {});
    }
  }

  void print(std::vector<double>& mm, std::vector<double>& deg) const {
    for (size_t i = 0; i < figures_.size(); ++i) {
      const Figures& f = figures_[i];
      fmt::print("| {}: {} | {} | {:.0f} % | {:.1f}, {:.1f} | {:.1f}, {:.1f} |\n",
                 in_.recording->name, in_.rig.objects[i].named.name, f.seen,
                 100.0 * static_cast<double>(f.mm.size()) / std::max(1, f.seen),
                 quantile(f.mm, 0.5), quantile(f.mm, 0.9), quantile(f.deg, 0.5),
                 quantile(f.deg, 0.9));
      mm.insert(mm.end(), f.mm.begin(), f.mm.end());
      deg.insert(deg.end(), f.deg.begin(), f.deg.end());
    }
  }

 private:
  Searching() = default;

  void judge(const Observation& found) {
    Figures& f = figures_.at(found.object.index());
    const auto truth = truth_at(in_.truth[found.object.index()], found.capture, Duration::max());
    if (!truth || found.hypotheses.empty()) return;
    const Rigid3& pose = found.hypotheses.front().world_from_object;
    const double mm = 1e3 * translation_distance(pose, *truth);
    const ViewpointModel& model = *in_.rig.objects[found.object.index()].views;
    const double deg = 57.2958 * model.angle_up_to_symmetry(pose, *truth);
    ++f.seen;
    if (mm > kAboutMm || deg > kAboutDeg) return;
    f.mm.push_back(mm);
    f.deg.push_back(deg);
  }

  bench::TruthRecording in_;
  std::unique_ptr<ObjectSearch> search_;
  std::unique_ptr<TimedSearch> timed_;
  std::vector<Figures> figures_;  // by object
};

int usage(std::string_view problem) {
  fmt::print(stderr,
             "carried_poses: {}\nusage: carried_poses [--search-cost FACTOR] RECORDING ...\n",
             problem);
  return 2;
}

int run(std::vector<std::string_view> arguments) {
  double factor = 1;
  if (arguments.size() >= 2 && arguments[0] == "--search-cost") {
    const std::string_view text = arguments[1];
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), factor);
    if (problem != std::errc() || end != text.data() + text.size() || !(factor > 0)) {
      return usage(fmt::format("'{}' is no factor above 0", text));
    }
    arguments.erase(arguments.begin(), arguments.begin() + 2);
  }
  if (arguments.empty()) return usage("no recording");
  fmt::print(
      "| recording: object | observations | about right | mm: median, 90 % | deg |\n"
      "| --- | --- | --- | --- | --- |\n");
  std::vector<double> mm, deg;
  for (const std::string_view path : arguments) {
    auto searching = Searching::create(path, factor);
    const Status played = searching ? (*searching)->play() : Status(searching.error());
    if (!played) {
      fmt::print(stderr, "{}\n", played.error().message());
      return 2;
    }
    (*searching)->print(mm, deg);
  }
  fmt::print("| all | | | {:.1f}, {:.1f} | {:.1f}, {:.1f} |\n", quantile(mm, 0.5),
             quantile(mm, 0.9), quantile(deg, 0.5), quantile(deg, 0.9));
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  return sightline::run(std::vector<std::string_view>(argv + 1, argv + argc));
}
