// SPDX-License-Identifier: Apache-2.0
// The room as a witness: recordings played over and over, with the images of one camera turned,
// zoomed, exchanged or covered from some moment on. No object is tracked in any of it.
#include "sightline/calibrate/scene_watch.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <functional>
#include <map>
#include <numbers>

#include "../support/matchers.hpp"
#include "scene_footage.hpp"
#include "sightline/calibrate/calibration_file.hpp"
#include "sightline/calibrate/calibration_watch.hpp"
#include "sightline/record/replay.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;
using test::FailsWith;
using test::IsOk;

constexpr double kDegree = std::numbers::pi / 180;
const std::filesystem::path kRecordings =
    std::filesystem::path(SIGHTLINE_SOURCE_DIR) / "../shared/recordings";

std::optional<Footage> load(const std::string& name) {
  if (!std::filesystem::exists(kRecordings / name)) return std::nullopt;
  auto recording = open_recording(kRecordings / name);
  const auto cameras = read_calibration(kRecordings / name / "calibration.toml");
  if (!recording || !cameras) return std::nullopt;
  const auto shared = std::make_shared<const Recording>(*std::move(recording));
  auto replay = VirtualReplay::open(shared);
  if (!replay) return std::nullopt;
  Footage footage;
  for (const RecordedCamera& camera : shared->cameras) {
    footage.cameras.push_back(*find_camera(*cameras, camera.name));
  }
  footage.images.resize(footage.cameras.size());
  while (true) {
    const auto set = (*replay)->next();
    if (!set || !*set) return footage;
    for (const FramePtr& frame : **set) {
      footage.images[frame->info().camera.index()].push_back(copy_of(frame->gray()));
    }
  }
}

/// A rig that plays footage in a loop, looked at once a second.
class Rig {
 public:
  explicit Rig(const Footage& footage,
               std::shared_ptr<SceneReferences> references = std::make_shared<SceneReferences>())
      : footage_(footage), references_(std::move(references)) {
    std::vector<std::optional<Rigid3>> places;
    for (size_t i = 0; i < footage.cameras.size(); ++i) {
      places.emplace_back(footage.cameras[i].world_from_camera);
      scenes_.emplace_back(footage.cameras[i], CameraId(static_cast<uint32_t>(i)), references_);
    }
    watch_.emplace(places, std::vector<ShapeSymmetry>(1));
  }

  using Change = std::function<Gray(const Gray& full, size_t camera, double seconds)>;
  /// Goes on for so long; the images of the cameras go through `change`.
  void run(double seconds, const Change& change = {}, const std::function<bool()>& until = {}) {
    for (double end = now_ + seconds; now_ < end; now_ += 1) {
      for (size_t i = 0; i < footage_.cameras.size(); ++i) {
        const auto& images = footage_.images[source_.empty() ? i : source_[i]];
        // 30 Hz and not a divisor of a second: another phase of the loop each time.
        const Gray& full = images[static_cast<size_t>(now_ * 37) % images.size()];
        const Gray half = halved(change ? change(full, i, now_) : full);
        const auto start = std::chrono::steady_clock::now();
        const auto look = scenes_[i].look(half.view(), at(now_), {});
        spent_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
        ++looks_;
        if (look) watch_->add(*look);
        const CalibrationState state = camera(i).state;
        if (state != CalibrationState::kUnknown && state != CalibrationState::kInOrder) ++alarms_;
      }
      if (until && until()) return;
    }
  }
  void exchange(size_t a, size_t b) {
    for (size_t i = source_.size(); i < footage_.cameras.size(); ++i) source_.push_back(i);
    std::swap(source_[a], source_[b]);
  }

  const CameraWatch& camera(size_t i) const { return watch_->cameras()[i]; }
  double now() const { return now_; }
  static Time at(double seconds) { return Time(from_seconds(1 + seconds)); }
  int alarms() const { return alarms_; }
  double look_ms() const { return 1e3 * spent_ / std::max(1, looks_); }

 private:
  const Footage& footage_;
  std::shared_ptr<SceneReferences> references_;
  std::vector<SceneWatch> scenes_;
  std::optional<CalibrationWatch> watch_;
  std::vector<size_t> source_;
  double now_ = 0;
  int alarms_ = 0, looks_ = 0;
  double spent_ = 0;
};

// Changes one camera's images, each once.
Rig::Change turned(const Footage& footage, size_t camera, const Eigen::Vector3d& turn,
                   double zoom = 1) {
  auto made = std::make_shared<std::map<const Gray*, Gray>>();
  return [&footage, camera, turn, zoom, made](const Gray& full, size_t i, double) {
    if (i != camera) return full;
    auto [entry, fresh] = made->try_emplace(&full);
    if (fresh) entry->second = seen_turned(full, footage.cameras[i].model, turn, zoom);
    return entry->second;
  };
}

class SceneWatchKnock : public testing::TestWithParam<std::tuple<std::string, double>> {};

TEST_P(SceneWatchKnock, IsFlaggedWithinAMinuteWithoutAnObject) {
  const auto& [name, degrees] = GetParam();
  const auto footage = load(name);
  if (!footage) GTEST_SKIP() << "no recordings";
  const Eigen::Vector3d axis = Eigen::Vector3d(0.3, 0.9, 0.3).normalized();
  for (size_t knocked = 0; knocked < std::min<size_t>(2, footage->cameras.size()); ++knocked) {
    Rig rig(*footage);
    rig.run(60);
    EXPECT_EQ(rig.alarms(), 0);
    const Eigen::Vector3d turn = degrees * kDegree * axis;
    rig.run(60, turned(*footage, knocked, turn),
            [&] { return is_wrong(rig.camera(knocked).state); });
    const CameraWatch& verdict = rig.camera(knocked);
    std::printf(
        "%s, camera %zu, %.1f deg: %s after %.0f s, turn wrong by %.4f deg, %d patches, "
        "%.2f ms a look\n",
        name.c_str(), knocked, degrees, std::string(to_string(verdict.state)).c_str(),
        rig.now() - 60, (verdict.correction.head<3>() - turn).norm() / kDegree, verdict.patches,
        rig.look_ms());
    EXPECT_EQ(verdict.state, CalibrationState::kKnocked);
    EXPECT_TRUE(verdict.by_scene);
    EXPECT_NEAR(to_seconds(verdict.since - Rig::at(60)), 0, 10);
    EXPECT_LT((verdict.correction.head<3>() - turn).norm(), 0.02 * kDegree + 0.02 * turn.norm());
    EXPECT_LT(verdict.vote, 0.95);
    for (size_t i = 0; i < footage->cameras.size(); ++i) {
      if (i != knocked) {
        EXPECT_FALSE(is_wrong(rig.camera(i).state)) << i;
      }
    }
    // Put back, it has its vote again.
    rig.run(60, {}, [&] { return rig.camera(knocked).state == CalibrationState::kInOrder; });
    EXPECT_EQ(rig.camera(knocked).state, CalibrationState::kInOrder);
  }
}

INSTANTIATE_TEST_SUITE_P(Recordings, SceneWatchKnock,
                         testing::Combine(testing::Values("bench", "toy", "sprayer", "board"),
                                          testing::Values(0.1, 0.3, 1.0, 3.0)));

// SIGHTLINE_WATCH_MINUTES=60 for an hour of each.
TEST(SceneWatch, SaysNothingOfARoomAtRest) {
  const char* asked = std::getenv("SIGHTLINE_WATCH_MINUTES");
  const double minutes = asked != nullptr ? std::atof(asked) : 4;
  int watched = 0;
  for (const char* name : {"bench", "toy", "two", "kettle", "crate", "sprayer", "board"}) {
    const auto footage = load(name);
    if (!footage) continue;
    ++watched;
    Rig rig(*footage);
    rig.run(60 * minutes);
    std::printf("%s: %.0f minutes, %d alarms, %.2f ms a look\n", name, minutes, rig.alarms(),
                rig.look_ms());
    EXPECT_EQ(rig.alarms(), 0) << name;
    EXPECT_EQ(rig.camera(0).state, CalibrationState::kInOrder) << name;
  }
  if (watched == 0) GTEST_SKIP() << "no recordings";
}

// The share of a turn in a pixel grows with the focal length.
TEST(SceneWatch, WatchesACameraWithALongLens) {
  const Footage footage = synthetic(8000, 1280, 960);
  Rig rig(footage);
  rig.run(30);
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kInOrder);
  const Eigen::Vector3d turn(0.03 * kDegree, 0.1 * kDegree, 0);
  rig.run(40, turned(footage, 1, turn), [&] { return is_wrong(rig.camera(1).state); });
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kKnocked);
  EXPECT_LT((rig.camera(1).correction.head<3>() - turn).norm(), 0.05 * turn.norm());
  EXPECT_EQ(rig.camera(0).state, CalibrationState::kInOrder);
}

TEST(SceneWatch, AKnockedCameraThatIsMostlyCoveredIsNoOtherRoom) {
  const Footage footage = synthetic();
  Rig rig(footage);
  rig.run(30);
  const auto knocked = turned(footage, 1, Eigen::Vector3d(0, 1 * kDegree, 0));
  rig.run(40, knocked, [&] { return is_wrong(rig.camera(1).state); });
  ASSERT_EQ(rig.camera(1).state, CalibrationState::kKnocked);
  rig.run(60, [&](const Gray& full, size_t i, double seconds) {
    Gray out = knocked(full, i, seconds);
    const Gray& cover = footage.images[2][0];
    for (int y = 0; i == 1 && y < out.height; ++y) {
      const auto row = cover.bytes.begin() + ptrdiff_t{y} * out.width;
      std::copy_n(row, out.width * 3 / 4, out.bytes.begin() + ptrdiff_t{y} * out.width);
    }
    return out;
  });
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kKnocked);
}

TEST(SceneWatch, NamesTwoCamerasThatWereExchanged) {
  const auto footage = load("bench");
  if (!footage) GTEST_SKIP() << "no recordings";
  Rig rig(*footage);
  rig.run(20);
  rig.exchange(0, 1);
  const auto named = [&] {
    return !rig.camera(0).looks_like.empty() && !rig.camera(1).looks_like.empty();
  };
  rig.run(60, {}, named);
  std::printf("exchanged: named after %.0f s\n", rig.now() - 20);
  EXPECT_EQ(rig.camera(0).state, CalibrationState::kUnfit);
  EXPECT_EQ(rig.camera(0).looks_like, footage->cameras[1].name);
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kUnfit);
  EXPECT_EQ(rig.camera(1).looks_like, footage->cameras[0].name);
  EXPECT_EQ(rig.camera(0).vote, 0);
  EXPECT_EQ(rig.camera(2).state, CalibrationState::kInOrder);
  rig.exchange(0, 1);  // back
  rig.run(40);
  for (size_t i : {0, 1}) {
    EXPECT_EQ(rig.camera(i).state, CalibrationState::kInOrder);
    EXPECT_EQ(rig.camera(i).looks_like, "");
  }
}

TEST(SceneWatch, NoticesAnotherLens) {
  const auto footage = load("bench");
  if (!footage) GTEST_SKIP() << "no recordings";
  for (const double zoom : {0.95, 1.05}) {
    Rig rig(*footage);
    rig.run(20);
    rig.run(60, turned(*footage, 1, Eigen::Vector3d::Zero(), zoom),
            [&] { return rig.camera(1).state == CalibrationState::kUnfit; });
    std::printf("zoomed by %.2f: %s after %.0f s, by %.3f\n", zoom,
                std::string(to_string(rig.camera(1).state)).c_str(), rig.now() - 20,
                rig.camera(1).zoom);
    EXPECT_EQ(rig.camera(1).state, CalibrationState::kUnfit);
    EXPECT_NEAR(rig.camera(1).zoom, zoom, 0.005);
    EXPECT_EQ(rig.camera(1).looks_like, "");
    rig.run(60, {}, [&] { return rig.camera(1).state == CalibrationState::kInOrder; });
    EXPECT_EQ(rig.camera(1).state, CalibrationState::kInOrder);
  }
}

// Nobody knows what it sees: nothing is said, and nothing forgotten.
TEST(SceneWatch, ACoveredCameraAndAPersonBeforeItAreNoOtherRoom) {
  const auto footage = load("bench");
  if (!footage) GTEST_SKIP() << "no recordings";
  Rig rig(*footage);
  rig.run(20);
  rig.run(60, [](const Gray& full, size_t i, double) {
    Gray out = full;
    if (i == 0) std::ranges::fill(out.bytes, 12);
    return out;
  });
  EXPECT_EQ(rig.alarms(), 0);
  // A checkered coat that walks to and fro through seven tenths of the picture.
  rig.run(120, [](const Gray& full, size_t i, double seconds) {
    Gray out = full;
    const int from = static_cast<int>(out.width * 0.15 * (1 + std::sin(seconds)));
    const int to = from + out.width * 7 / 10;
    for (int y = 0; i == 0 && y < out.height; ++y) {
      for (int x = from; x < to; ++x) {
        out.bytes[static_cast<size_t>(y * out.width + x)] =
            ((x - from) / 12 + y / 12) % 2 != 0 ? 200 : 60;
      }
    }
    return out;
  });
  EXPECT_EQ(rig.alarms(), 0);
  rig.run(20);
  EXPECT_EQ(rig.camera(0).state, CalibrationState::kInOrder);
}

// Another picture in all of them at once is no camera's fault; it is the way back that counts, too.
TEST(SceneWatch, AnotherLightBlamesNobody) {
  const Footage footage = synthetic();
  Rig rig(footage);
  rig.run(30);
  const Footage other = synthetic(600, 640, 480, 77);
  const auto lit = [&](const Gray&, size_t i, double) { return other.images[i][0]; };
  rig.run(120, lit);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(rig.camera(i).state, CalibrationState::kUnknown) << i;
    EXPECT_TRUE(rig.camera(i).light_changed) << i;
    EXPECT_EQ(rig.camera(i).vote, 1) << i;
  }
  rig.run(40);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(rig.camera(i).state, CalibrationState::kInOrder) << i;
    EXPECT_FALSE(rig.camera(i).light_changed) << i;
  }
  // One of them is.
  rig.run(40,
          [&](const Gray& full, size_t i, double) { return i == 1 ? other.images[1][0] : full; });
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kUnfit);
  EXPECT_EQ(rig.camera(0).state, CalibrationState::kInOrder);
}

TEST(SceneWatch, TellsADriftFromAKnock) {
  const auto footage = load("toy");
  if (!footage) GTEST_SKIP() << "no recordings";
  Rig rig(*footage);
  rig.run(60);
  const double per_second = 1.2 * kDegree / 3600;
  const auto drift = [&](const Gray& full, size_t i, double seconds) {
    if (i != 1) return full;
    return seen_turned(full, footage->cameras[1].model,
                       Eigen::Vector3d(0, per_second * (seconds - 60), 0), 1);
  };
  rig.run(900, drift, [&] { return is_wrong(rig.camera(1).state); });
  std::printf("drift of 1.2 deg an hour: %s after %.0f s, at %.3f deg\n",
              std::string(to_string(rig.camera(1).state)).c_str(), rig.now() - 60,
              rig.camera(1).correction.norm() / kDegree);
  EXPECT_EQ(rig.camera(1).state, CalibrationState::kDrifting);
  EXPECT_NEAR(rig.camera(1).rate[1], per_second, 0.4 * per_second);
}

TEST(SceneWatch, WhatItHasSeenOutlivesARestart) {
  const std::optional<Footage> footage = synthetic();
  const auto before = std::make_shared<SceneReferences>();
  Rig(*footage, before).run(20);
  const std::string bytes = before->bytes();
  std::printf("%zu bytes for three cameras\n", bytes.size());
  const auto after = std::make_shared<SceneReferences>();
  ASSERT_THAT(after->add(bytes, "rooms.bin"), IsOk());
  EXPECT_EQ(after->bytes(), bytes);
  Rig rig(*footage, after);
  const Eigen::Vector3d turn(0, 0.2 * kDegree, 0);
  rig.run(40, turned(*footage, 2, turn), [&] { return is_wrong(rig.camera(2).state); });
  EXPECT_EQ(rig.camera(2).state, CalibrationState::kKnocked);
  EXPECT_TRUE(rig.camera(2).since_start);
  EXPECT_EQ(rig.camera(0).state, CalibrationState::kInOrder);
  // Of another calibration it says nothing.
  CalibratedCamera moved = footage->cameras[2];
  moved.world_from_camera.translation.x() += 0.01;
  EXPECT_EQ(after->find(moved), nullptr);
  EXPECT_NE(after->find(footage->cameras[2]), nullptr);
  // A camera that the rig no longer has goes, also out of the file.
  const uint64_t version = after->version();
  after->keep_only({"left", "middle", "right"});
  EXPECT_EQ(after->version(), version);
  after->keep_only({"left", "right"});
  EXPECT_GT(after->version(), version);
  EXPECT_EQ(after->find(footage->cameras[1]), nullptr);
  EXPECT_NE(after->find(footage->cameras[2]), nullptr);
  EXPECT_LT(10 * after->bytes().size(), 7 * bytes.size());
}

// As `calibrate accept` writes all cameras anew: the last digits may change.
TEST(SceneReferences, OutliveACalibrationThatIsWrittenAnew) {
  const Footage footage = synthetic();
  const auto references = std::make_shared<SceneReferences>();
  Rig(footage, references).run(10);
  std::vector<CalibratedCamera> cameras = footage.cameras;
  for (int i = 0; i < 20; ++i) {
    auto read = parse_calibration(format_calibration(cameras), "calibration.toml");
    ASSERT_THAT(read, IsOk());
    cameras = *std::move(read);
    for (CalibratedCamera& camera : cameras) {
      EXPECT_NE(references->find(camera), nullptr) << camera.name << " " << i;
      camera.world_from_camera = Rigid3::from_matrix(camera.world_from_camera.matrix(), "").value();
      // As much as an optimizer of a compiler may do.
      camera.world_from_camera.translation.x() += 1e-15;
    }
  }
}

TEST(SceneReferences, DamagedBytesAreRefused) {
  const std::optional<Footage> footage = synthetic();
  const auto references = std::make_shared<SceneReferences>();
  Rig(*footage, references).run(10);
  const std::string good = references->bytes();
  SceneReferences empty;
  for (size_t cut = 0; cut < good.size(); cut += 97) {
    EXPECT_THAT(empty.add(good.substr(0, cut), "rooms.bin"), FailsWith("rooms.bin"));
    std::string flipped = good;
    flipped[cut] = static_cast<char>(flipped[cut] ^ 0x10);
    EXPECT_THAT(empty.add(flipped, "rooms.bin"), FailsWith("damaged"));
  }
  EXPECT_EQ(empty.version(), 0u);
  EXPECT_EQ(empty.find(footage->cameras[0]), nullptr);
}

}  // namespace
}  // namespace sightline
