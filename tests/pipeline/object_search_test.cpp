// SPDX-License-Identifier: Apache-2.0
// When is searched: not before the cameras are there, and what is not found only at a bounded cost.
#include <gtest/gtest.h>

#include "sightline/image/image.hpp"
#include "sightline/pipeline/object_search.hpp"
#include "sightline/pipeline/search_cost.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

const std::filesystem::path kBench =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "recordings" / "bench";

FramePtr gray_frame(const CameraConfig& camera, CameraId id, Time capture) {
  FrameInfo info;
  info.camera = id;
  info.capture = capture;
  info.width = camera.calibration.model.width();
  info.height = camera.calibration.model.height();
  auto image = std::make_shared<Image>(info.width, info.height);
  const MutableI420View view = image->mutable_view();
  for (const MutablePlaneView& plane : {view.y, view.u, view.v}) {
    for (int y = 0; y < plane.height; ++y) std::fill_n(plane.row(y), plane.width, uint8_t{128});
  }
  return Frame::decoded(info, image);
}

/// Bench's carton, without its markers.
Installation unmarked_bench() {
  Installation installation = recording_installation(kBench).value();
  installation.objects.front().description.modalities.fiducial = false;
  installation.detect.silhouettes = false;
  return installation;
}

std::unique_ptr<ObjectSearch> search_in(const Installation& installation) {
  RigOptions options;
  options.cache.clear();
  return ObjectSearch::create(installation, load_rig(installation, options).value()).value();
}

TEST(ObjectSearch, WaitsForTheOtherCamerasAtTheStartButNotForThoseThatAreDown) {
  const Installation installation = unmarked_bench();
  ASSERT_EQ(installation.cameras.size(), 3u);
  const auto search = search_in(installation);
  const auto deliver = [&](uint32_t camera, Time capture) {
    search->add_frame(CameraId(camera),
                      *gray_frame(installation.cameras[camera], CameraId(camera), capture), {});
  };
  const Time start(10s);
  deliver(0, start);
  EXPECT_FALSE(search->complete(start));
  EXPECT_FALSE(search->complete(start + 999ms)) << "one camera alone is believed too easily";
  EXPECT_TRUE(search->complete(start + 1s)) << "the others are down";
  deliver(1, start + 50ms);
  EXPECT_FALSE(search->complete(start + 99ms));
  EXPECT_TRUE(search->complete(start + 100ms)) << "two are enough to begin";
  deliver(2, start + 60ms);
  EXPECT_TRUE(search->complete(start + 60ms)) << "all are there";
}

TEST(ObjectSearch, WhatIsNotFoundForLongIsLookedForLess) {
  Installation installation = unmarked_bench();
  installation.detect.max_load = 0.02;
  const auto search = search_in(installation);
  std::vector<Time> searches;
  Duration cost{0};
  for (Time now = Time(1s); now < Time(1s) + 40s; now += 250ms) {
    if (!search->due(now, {})) continue;
    for (size_t i = 0; i < installation.cameras.size(); ++i) {
      const CameraId id(static_cast<uint32_t>(i));
      search->add_frame(id, *gray_frame(installation.cameras[i], id, now), {});
    }
    const SearchWork before = search->work();
    ASSERT_TRUE(search->search(now, {}).empty());
    SearchWork work = search->work();
    work -= before;
    cost = search_cost(work);
    searches.push_back(now);
  }
  const auto late = std::count_if(searches.begin(), searches.end(),
                                  [](Time time) { return time >= Time(1s) + 20s; });
  const auto early = std::count_if(searches.begin(), searches.end(),
                                   [](Time time) { return time < Time(1s) + 10s; });
  EXPECT_EQ(early, 40) << "each time: it may come back at any moment";
  EXPECT_GE(late, 1);
  EXPECT_LE(static_cast<double>(late - 1) * to_seconds(cost), 0.02 * 20);
  // Who knows better is heard at once.
  ASSERT_TRUE(search->hint(ObjectId(0), Rigid3(), Time::max()));
  EXPECT_TRUE(search->due(searches.back() + 250ms, {}));
}

}  // namespace
}  // namespace sightline
