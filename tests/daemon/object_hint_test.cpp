// SPDX-License-Identifier: Apache-2.0
// What a running system is told of an object: where it is, and that its track is wrong.
#include <gtest/gtest.h>

#include "sightline/image/convert.hpp"
#include "sightline/record/evaluate.hpp"
#include "sightline/record/replay.hpp"
#include "system/system.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

const std::filesystem::path kBench =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";

// The parts of a system that search and fuse, fed with the first images of `bench` again and again,
// as if they were taken now.
class ObjectHint : public testing::Test {
 protected:
  ObjectHint() {
    system_.installation = recording_installation(kBench).value();
    system_.installation.objects.front().description.modalities.fiducial = false;
    RigOptions options;
    options.cache.clear();
    system_.rig = std::make_shared<const Rig>(load_rig(system_.installation, options).value());
    system_.board = std::make_shared<TrackBoard>(1);
    system_.fusion = FusionWorker::start(system_.installation.estimator, system_.rig->names(), {},
                                         {}, system_.board, nullptr, registry_, beats_, {})
                         .value();
    system_.search = SearchWorker::start(
        ObjectSearch::create(system_.installation, *system_.rig).value(), 3, system_.board,
        [fusion = system_.fusion](Observation found) { fusion->push(std::move(found)); },
        [fusion = system_.fusion](ObjectId object, bool doubted) {
          fusion->set_doubted(object, doubted);
        },
        registry_, beats_);
    const auto recording = std::make_shared<const Recording>(open_recording(kBench).value());
    const auto frames = *VirtualReplay::open(recording).value()->next().value();
    for (const FramePtr& frame : frames) {
      auto image = std::make_shared<Image>(frame->info().width, frame->info().height);
      copy_i420(frame->i420(), image->mutable_view());
      images_.push_back(std::move(image));
      infos_.push_back(frame->info());
    }
    truth_ = read_truth(kBench / "truth.csv").value().front().world_from_object;
  }
  ~ObjectHint() override {
    system_.search->stop();
    system_.fusion->stop();
  }

  // Feeds frames until the condition holds; false: it does not within a minute (with sanitizers a
  // search takes seconds).
  template <typename Condition>
  bool feed_until(const Condition& condition) {
    for (const Time begin = MonotonicClock::now(); MonotonicClock::now() - begin < 60s;) {
      if (condition()) return true;
      const Time now = MonotonicClock::now();
      for (size_t camera = 0; camera < images_.size(); ++camera) {
        FrameInfo info = infos_[camera];
        info.capture = now;
        system_.search->push(Frame::decoded(info, images_[camera]));
      }
      std::this_thread::sleep_for(10ms);
    }
    return condition();
  }
  PoseTrackPtr track() {
    std::vector<PoseTrackPtr> tracks;
    system_.board->read(tracks);
    return tracks.front();
  }
  bool known() {
    const PoseTrackPtr now = track();
    return now && !now->empty() && has_pose(now->newest().state);
  }

  // On a busy machine this thread may pause between two cameras; one alone may show it elsewhere,
  // `degraded`, until a check of all of them.
  bool found_there() {
    return known() && translation_distance(track()->newest().world_from_object, truth_) < 0.02;
  }

  Registry registry_;
  HeartbeatBoard beats_;
  System system_;
  std::vector<std::shared_ptr<Image>> images_;  // of the first frames, by camera
  std::vector<FrameInfo> infos_;
  Rigid3 truth_;
};

TEST_F(ObjectHint, IsFoundWhereItIsToldAndForgottenWhenTold) {
  EXPECT_TRUE(system_.hint("carton", truth_));
  ASSERT_TRUE(feed_until([&] { return found_there(); }));
  EXPECT_TRUE(system_.forget("carton"));
  bool gone = false;
  for (int i = 0; i < 1000 && !gone; ++i) {
    gone = !known();
    std::this_thread::sleep_for(5ms);
  }
  EXPECT_TRUE(gone);
  EXPECT_TRUE(system_.hint("carton", truth_));
  ASSERT_TRUE(feed_until([&] { return found_there(); })) << "looked for anew";
}

TEST_F(ObjectHint, WhatCannotBeIsRefused) {
  EXPECT_FALSE(system_.hint("cup", truth_));
  EXPECT_FALSE(system_.forget("cup"));
  ImageHint place;
  place.camera = CameraId(9);
  EXPECT_FALSE(system_.hint("carton", place));
  const System nothing;
  EXPECT_FALSE(nothing.hint("carton", truth_));
}

}  // namespace
}  // namespace sightline
