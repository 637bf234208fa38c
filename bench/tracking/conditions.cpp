// SPDX-License-Identifier: Apache-2.0
#include "conditions.hpp"

#include <numbers>

#include "support/scene_shapes.hpp"

namespace sightline::bench {
namespace {

using std::chrono::milliseconds;
using test::Paint;
using test::SceneRigOptions;

constexpr double kDegree = std::numbers::pi / 180;

std::shared_ptr<const test::RayMesh> creature() {
  static const auto shape = std::make_shared<const test::RayMesh>(test::make_creature(15'000));
  return shape;
}

std::vector<double> spread(int cameras, double degrees) {
  std::vector<double> azimuths;
  for (int i = 0; i < cameras; ++i) azimuths.push_back(degrees * (i - 0.5 * (cameras - 1)));
  return azimuths;
}

class Maker {
 public:
  explicit Maker(Duration duration) : duration_(duration) {}

  Condition& add(const std::string& name, const std::string& what, int cameras, double degrees) {
    Condition condition;
    condition.name = name;
    condition.what = what;
    SceneRigOptions& rig = condition.rig;
    rig.azimuths_deg = spread(cameras, degrees);
    rig.name = "creature";
    rig.shape = creature();
    rig.sensor.read_noise = 5;
    rig.sensor.shot_noise = 0;
    rig.duration = duration_;
    condition.steps.step = 0.0078;
    condition.steps.turn = 3.65 * kDegree;
    all.push_back(std::move(condition));
    return all.back();
  }

  void moving(double mm, double degrees, int cameras, bool erratic, std::optional<double> success) {
    Condition& c = add(fmt::format("step-{:.0f}mm-{}cam{}", mm, cameras, erratic ? "-erratic" : ""),
                       fmt::format("{:.0f} mm + {:.0f} deg per frame, {}, {} camera{}", mm, degrees,
                                   erratic ? "every step in a new direction" : "smooth", cameras,
                                   cameras > 1 ? "s" : ""),
                       cameras, 60);
    c.steps.step = 1e-3 * mm;
    c.steps.turn = degrees * kDegree;
    c.erratic = erratic;
    c.settle = 1;  // failures may be as frequent as that
    c.targets.success = success;
  }

  std::vector<Condition> all;

 private:
  Duration duration_;
};

void add_cameras(Maker& maker) {
  Condition& one = maker.add("one", "one camera", 1, 60);
  one.targets.depth_mm = 2.5;
  one.targets.rotation_deg = 1.0;
  maker.add("two-8deg", "two cameras 8 degrees apart", 2, 8);
  Condition& two = maker.add("two", "two cameras 60 degrees apart", 2, 60);
  two.targets.position_mm = 0.4;
  two.targets.rotation_deg = 0.6;
  maker.add("three", "three cameras 60 degrees apart", 3, 60);
  maker.add("four", "four cameras 45 degrees apart", 4, 45);
  Condition& noisy = maker.add("two-noise15", "two cameras, noise 15/255, blur 1.2 px", 2, 60);
  noisy.rig.sensor.read_noise = 15;
  noisy.rig.blur_px = 1.2;
  noisy.targets.position_mm = 0.5;
  noisy.targets.rotation_deg = 0.8;
  Condition& noisy_one = maker.add("one-noise15", "one camera, noise 15/255, blur 1.2 px", 1, 60);
  noisy_one.rig.sensor.read_noise = 15;
  noisy_one.rig.blur_px = 1.2;
}

void add_times(Maker& maker) {
  Condition& known = maker.add("skew-known", "second camera 8 ms later, stamps right", 2, 60);
  known.rig.phases = {0, 0.24};
  Condition& unknown = maker.add("skew-unknown", "second camera's stamps 8 ms off", 2, 60);
  unknown.rig.phases = {0, 0.24};
  unknown.rig.skews = {Duration(0), -milliseconds(8)};
  Condition& free = maker.add("four-free", "four cameras, free-running", 4, 45);
  free.rig.phases = {0, 0.27, 0.51, 0.78};
  Condition& blurred =
      maker.add("two-shutter", "two cameras, 10 ms shutter, 31 mm + 15 deg", 2, 60);
  blurred.rig.sensor.shutter = 0.010;
  blurred.steps.step = 0.031;
  blurred.steps.turn = 15 * kDegree;
}

void add_motion(Maker& maker) {
  for (const bool erratic : {false, true}) {
    maker.moving(16, 7, 2, erratic, std::nullopt);
    maker.moving(31, 15, 2, erratic, 1.0);
    maker.moving(47, 22, 2, erratic, std::nullopt);
    maker.moving(62, 29, 2, erratic, 0.9);
  }
  for (const int cameras : {1, 3}) {
    maker.moving(31, 15, cameras, true, std::nullopt);
    maker.moving(62, 29, cameras, true, std::nullopt);
  }
}

void add_objects(Maker& maker) {
  Condition& alike = maker.add("similar", "room in the object's color, 31 mm + 15 deg", 2, 60);
  alike.rig.backdrop.similarity = 0.9f;
  alike.rig.backdrop.like = alike.rig.paint.color;
  alike.steps.step = 0.031;
  alike.steps.turn = 14.6 * kDegree;
  Condition& carton = maker.add("carton", "printed carton", 2, 60);
  carton.rig.name = "carton";
  carton.rig.shape = std::make_shared<const test::RayMesh>(test::make_carton());
  carton.rig.paint.kind = Paint::Kind::kPrinted;
  Condition& unsure = maker.add("carton-unsure", "printed carton, not told how it lies", 2, 60);
  unsure.rig = carton.rig;
  unsure.told = false;
  Condition& plain = maker.add("carton-plain", "plain carton: edges alone tell how it lies", 2, 60);
  plain.rig.name = "carton";
  plain.rig.shape = carton.rig.shape;
  Condition& bracket = maker.add("bracket", "plain bracket", 2, 60);
  bracket.rig.name = "bracket";
  bracket.rig.shape = std::make_shared<const test::RayMesh>(test::make_bracket());
  bracket.rig.paint.color = {0.25f, 0.26f, 0.28f};
  Condition& truck = maker.add("truck", "truck of four colors", 2, 60);
  truck.rig.name = "truck";
  truck.rig.shape = std::make_shared<const test::RayMesh>(test::make_truck());
  truck.rig.paint.kind = Paint::Kind::kFaces;
  Condition& bottle = maker.add("bottle", "bottle, declared symmetric about its axis", 2, 60);
  bottle.rig.name = "bottle";
  bottle.rig.shape = std::make_shared<const test::RayMesh>(test::make_bottle(6000));
  bottle.rig.paint.color = {0.10f, 0.32f, 0.12f};
  bottle.symmetry = Symmetry::kAxis;
  Condition& light = maker.add("light", "exposure swings by a factor of two each second", 2, 60);
  light.rig.exposure = [](int camera, Time time) {
    const double t = to_seconds(time.time_since_epoch());
    return std::exp2(0.5 * std::sin(2 * std::numbers::pi * (t + 0.3 * camera)));
  };
}

void add_sizes(Maker& maker) {
  for (const size_t faces : {size_t{1000}, size_t{100'000}}) {
    Condition& c = maker.add(fmt::format("faces-{}k", faces / 1000),
                             fmt::format("two cameras, mesh of {}k faces", faces / 1000), 2, 60);
    c.rig.shape = std::make_shared<const test::RayMesh>(test::make_creature(faces));
  }
}

void add_hiding(Maker& maker, Duration duration) {
  const Duration from = duration / 4, to = duration / 2;
  Condition& one =
      maker.add("hidden-one", "one of two cameras covered for a quarter of the time", 2, 60);
  one.rig.cards = {{1, from, to}};
  Condition& all = maker.add("hidden-all", "all cameras covered for a quarter of the time", 2, 60);
  all.rig.cards = {{-1, from, to}};
  all.start = Start::kCold;
  Condition& cold = maker.add("cold", "found from nothing", 2, 60);
  cold.start = Start::kCold;
  Condition& still =
      maker.add("cold-still", "found from nothing, never moves, four cameras", 4, 45);
  still.start = Start::kCold;
  still.steps.step = still.steps.turn = 0;
  Condition& carton = maker.add("cold-carton", "printed carton found from nothing", 2, 60);
  carton.rig.name = "carton";
  carton.rig.shape = std::make_shared<const test::RayMesh>(test::make_carton());
  carton.rig.paint.kind = Paint::Kind::kPrinted;
  carton.start = Start::kCold;
}

// What the silhouettes of a known background are for: the room is seen for 0.8 s before the object
// comes in.
void add_entering(Maker& maker) {
  const auto enter = [&](const std::string& name, const std::string& what,
                         int cameras) -> Condition& {
    Condition& c = maker.add("enter-" + name, "comes in: " + what, cameras, 60);
    c.start = Start::kCold;
    c.enters = milliseconds(800);
    return c;
  };
  enter("usual", "two cameras", 2);
  // The same room through wider lenses.
  for (const double focal : {280.0, 180.0}) {
    Condition& c = enter(fmt::format("{:.0f}px", 0.103 / 0.7 * focal),
                         fmt::format("{:.0f} px large, two cameras", 0.103 / 0.7 * focal), 2);
    c.rig.lens.fx = c.rig.lens.fy = focal;
    c.rig.lens.distortion = {-0.02, 0.001, 0.0002, -0.0001, 0.0};
  }
  const auto alike = [](Condition& c, float similarity) {
    c.rig.backdrop.similarity = similarity;
    c.rig.backdrop.like = c.rig.paint.color;
  };
  alike(enter("similar-8", "room 0.8 in the object's color", 2), 0.8f);
  alike(enter("similar-9", "room 0.9 in the object's color", 2), 0.9f);
  Condition& noisy = enter("similar-noise15", "room 0.8 in its color, noise 15/255", 2);
  alike(noisy, 0.8f);
  noisy.rig.sensor.read_noise = 15;
  Condition& light = enter("light", "the light changes by a half at the same time", 2);
  light.rig.exposure = [](int, Time time) {
    return to_seconds(time.time_since_epoch()) > 1.8 ? 1.5 : 1.0;
  };
  Condition& fast = enter("fast", "31 mm + 15 deg per frame, free-running, three cameras", 3);
  fast.steps.step = 0.031;
  fast.steps.turn = 15 * kDegree;
  fast.rig.phases = {0, 0.3, 0.7};
}

}  // namespace

std::vector<Condition> tracking_conditions(Duration duration) {
  Maker maker(duration);
  add_cameras(maker);
  add_times(maker);
  add_motion(maker);
  add_objects(maker);
  add_hiding(maker, duration);
  add_entering(maker);
  add_sizes(maker);
  return std::move(maker.all);
}

test::SceneRigOptions rig_of(const Condition& condition, uint64_t seed) {
  test::SceneRigOptions rig = condition.rig;
  rig.seed = seed;
  rig.backdrop.seed = static_cast<uint32_t>(seed);
  test::SceneSteps steps = condition.steps;
  steps.seed = 31 * seed + 7;
  if (steps.step == 0 && steps.turn == 0) {
    const test::ScenePath any = test::erratic_path(steps, rig.duration);
    rig.path = test::resting(any(Time{}));
  } else {
    rig.path = condition.erratic ? test::erratic_path(steps, rig.duration)
                                 : test::smooth_path(steps, rig.duration);
  }
  if (condition.enters > Duration(0)) {
    const Time since = Time{} + condition.enters;  // the path starts at zero
    rig.path = [inner = rig.path, since](Time time) {
      if (time >= since) return inner(time);
      return Rigid3(Eigen::Quaterniond::Identity(), {0, 0, -9});  // below the floor
    };
  }
  return rig;
}

}  // namespace sightline::bench
