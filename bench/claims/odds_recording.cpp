// SPDX-License-Identifier: Apache-2.0
// Whether the odds between poses that look nearly alike are worth what they say. Each recording is
// followed from its true start and from starts that are turned to other members of the family; ten
// times a second the odds of the pose in force against the best of the others are noted, and
// whether it is the right one. Prints a reliability table as Markdown.
//   odds_recording RECORDING...
#include <fmt/format.h>

#include <array>
#include <cmath>
#include <vector>

#include "fuse/bank/hypothesis_bank.hpp"
#include "sightline/pipeline/replay_library.hpp"
#include "sightline/pipeline/tracking_chain.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

constexpr double kOther = 0.35;  // [rad] a pose of its own, and a wrong one, begin here
constexpr size_t kMostStarts = 12;
constexpr Duration kEvery = std::chrono::milliseconds(100);

struct Look {
  double log_odds = 0;     // of the pose in force against the best other one, natural
  double probability = 0;  // of the pose in force
  bool right = false;
  bool tracking = false;
};

class Family {
 public:
  static Result<std::unique_ptr<Family>> load(const std::filesystem::path& path) {
    std::unique_ptr<Family> out(new Family());
    SL_ASSIGN(Recording opened, open_recording(path));
    out->recording_ = std::make_shared<const Recording>(std::move(opened));
    if (!out->recording_->truth) {
      return make_error(ErrorCode::kInvalidInput, path.string(), "has no truth.csv");
    }
    SL_ASSIGN(out->truth_, read_truth(*out->recording_->truth));
    SL_ASSIGN(out->installation_, recording_installation(path));
    out->installation_.objects.resize(1);
    for (ObjectConfig& object : out->installation_.objects) {
      object.description.modalities = {false, true, true, true};
    }
    SL_ASSIGN(out->rig_, load_rig(out->installation_));
    out->symmetry_ = out->rig_.shape_symmetry()[0];
    std::erase_if(out->truth_, [&](const TruthRow& row) {
      return row.object != out->rig_.objects[0].named.name;
    });
    return out;
  }

  Status play(std::vector<Look>& looks) {
    const fuse::SymmetricHypotheses members(symmetry_);
    std::vector<Rigid3> starts;
    for (size_t k = 0; k < members.size(); ++k) {
      starts.push_back(members.symmetric_pose(Rigid3(), k));
    }
    if (starts.size() < 2) return {};
    const size_t step = (starts.size() + kMostStarts - 1) / kMostStarts;
    for (size_t k = 0; k < starts.size(); k += step) {
      SL_RETURN_IF_ERROR(play_from(starts[k], members, looks));
    }
    return {};
  }

 private:
  Family() = default;

  Status play_from(const Rigid3& turn, const fuse::SymmetricHypotheses& members,
                   std::vector<Look>& looks) {
    std::vector<CameraId> cameras;
    for (uint32_t i = 0; i < installation_.cameras.size(); ++i) cameras.emplace_back(i);
    SL_ASSIGN(auto chain, TrackingChain::create(installation_, rig_, cameras, nullptr));
    SL_ASSIGN(auto replay,
              VirtualReplay::open(recording_, {}, time_offsets(*recording_, installation_),
                                  axis_histories(*recording_, installation_)));
    // The estimator again, beside the chain's, for what it does not publish.
    fuse::HypothesisBank bank(installation_.estimator, ObjectId(0), symmetry_);
    fuse::BankState before = bank.nothing_known(), after;
    Time next = Time::min();
    for (bool started = false;;) {
      SL_ASSIGN(const auto frames, replay->next());
      if (!frames) return {};
      const Time now = frames->front()->info().capture;
      const auto truth = truth_at(truth_, now, Duration::max());
      chain->begin(now);
      for (const FramePtr& frame : *frames) {
        chain->observe({frame->info().camera, frame});
        const bool known = has_pose(chain->fusion().estimator(ObjectId(0)).state());
        if (started || known || !truth) continue;
        chain->set().back() = propose(*chain, *frame, *truth * turn);
      }
      if (chain->set().empty()) continue;
      bank.step(before, now, chain->set(), after);
      std::swap(before, after);
      chain->fuse();
      started |= before.count > 0;
      if (before.count == 0 || !truth || now < next || !has_pose(before.published.state)) continue;
      next = now + kEvery;
      looks.push_back(look(before, *truth, members));
    }
  }

  Observation propose(TrackingChain& chain, const Frame& frame, const Rigid3& pose) const {
    Matrix6 covariance = Matrix6::Identity() * 0.02 * 0.02;
    covariance.diagonal().tail<3>().setConstant(0.004 * 0.004);
    return chain.observer(frame.info().camera)
        ->tracker()
        .propose(frame, ObjectId(0), pose, covariance);
  }

  static Look look(const fuse::BankState& state, const Rigid3& truth,
                   const fuse::SymmetricHypotheses& members) {
    const fuse::Hypothesis& main = state.hypotheses[0];
    const Rigid3& pose = state.published.world_from_object;
    Look out;
    out.tracking = state.published.state == TrackState::kTracking;
    out.right = rotation_angle(pose, truth) < kOther;
    double others = 0, best = 1e9;
    for (size_t k = 1; k < members.size(); ++k) {
      if (rotation_angle(pose, members.symmetric_pose(pose, k)) < kOther) continue;
      const double margin = main.symmetry_costs[k] - main.symmetry_costs[0];
      others += std::exp(-margin);
      best = std::min(best, margin);
    }
    out.log_odds = best;
    out.probability = 1 / (1 + others);
    return out;
  }

  std::shared_ptr<const Recording> recording_;
  std::vector<TruthRow> truth_;
  Installation installation_;
  Rig rig_;
  ShapeSymmetry symmetry_;
};

void print(const std::vector<Look>& looks) {
  constexpr std::array<double, 7> kFrom = {0, 3, 10, 30, 100, 1000, 1e6};
  fmt::print("| stated odds against the best other | looks | stated | right | wrong, tracking |\n");
  fmt::print("| --- | --- | --- | --- | --- |\n");
  for (size_t i = 0; i < kFrom.size(); ++i) {
    int count = 0, right = 0, wrong_claims = 0;
    double stated = 0;
    for (const Look& look : looks) {
      const double odds = std::exp(std::min(look.log_odds, 700.0));
      if (odds < kFrom[i] || (i + 1 < kFrom.size() && odds >= kFrom[i + 1])) continue;
      ++count;
      right += look.right ? 1 : 0;
      wrong_claims += look.tracking && !look.right ? 1 : 0;
      stated += look.probability;
    }
    const double n = std::max(1, count);
    fmt::print("| from {:g} | {} | {:.3f} | {:.3f} | {} |\n", kFrom[i], count, stated / n,
               right / n, wrong_claims);
  }
}

int run(int argc, char** argv) {
  if (argc < 2) {
    fmt::print(stderr, "usage: odds_recording RECORDING...\n");
    return 2;
  }
  std::vector<Look> looks;
  for (int i = 1; i < argc; ++i) {
    const size_t had = looks.size();
    auto family = Family::load(argv[i]);
    const Status done = family ? (*family)->play(looks)
                               : Status(make_error(family.error().code, family.error().where, "{}",
                                                   family.error().text));
    if (!done) {
      fmt::print(stderr, "{}\n", done.error().message());
      return 1;
    }
    fmt::print(stderr, "{}: {} looks\n", argv[i], looks.size() - had);
  }
  print(looks);
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) { return sightline::run(argc, argv); }
