// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <limits>

#include "sightline/publish/cell/cell_bid.hpp"
#include "sightline/publish/cell/cell_messages.hpp"

namespace sightline {
namespace {

using namespace std::chrono_literals;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

Matrix6 spread(double scale) {
  Matrix6 a;
  for (int i = 0; i < 36; ++i) a(i / 6, i % 6) = std::cos(2.3 * i);
  const Matrix6 product = scale * (a * a.transpose());
  return 0.5 * (product + product.transpose());
}

LinearizedTerm term() {
  LinearizedTerm t;
  t.information = spread(1e4);
  t.gradient << 1, -2, 3, -4, 5, -6;
  t.cost = 12.5;
  t.residuals = 48;
  t.quality = 0.75;
  return t;
}

CellObservation observation() {
  CellObservation o;
  o.object = "carton / large";
  o.camera = "left";
  o.host = "hall-2";
  o.boot = 0xFEDCBA9876543210;
  o.calibration = 0x123456789ABCDEF0;
  o.sequence = 77;
  o.capture_utc_ns = 1'700'000'000'123'456'789;
  o.capture_error = 250us;
  o.stream_epoch = 3;
  o.frame = 991;
  const Rigid3 pose(Eigen::Quaterniond(0.5, -0.5, 0.1, 0.7), {1, -2, 0.25});
  o.at = {{pose, {{FrozenKind::kOutline, term()}, {FrozenKind::kFiducial, term()}}},
          {Rigid3(), {{FrozenKind::kTexture, term()}}}};
  o.hypotheses = {{pose, 3.5}, {Rigid3(), -1}};
  o.symmetric_hypotheses = {{pose, 2}};
  o.picture = PictureAgreement{0.25F, 0.5F};
  o.print = PrintSeen::kSolid;
  o.refutes = o.doubted = true;
  o.calibration_covariance = spread(1e-6);
  return o;
}

CellTrack track() {
  CellTrack t;
  t.object = "carton";
  t.host = "hall-1";
  t.boot = 9;
  t.sequence = 4;
  t.time_utc_ns = 1'700'000'000'000'000'000;
  t.last_measured_utc_ns = t.time_utc_ns - 1000;
  t.estimate.state = TrackState::kDegraded;
  t.estimate.degraded_reasons = kOneCamera | kAmbiguous;
  t.estimate.world_from_object.translation = {1, 2, 3};
  t.estimate.twist << 1, 2, 3, 4, 5, 6;
  t.estimate.covariance.topLeftCorner<6, 6>() = spread(1e-6);
  t.estimate.covariance.bottomRightCorner<6, 6>() = spread(1e-3);
  t.estimate.alternatives = spread(1e-5);
  t.cameras = {"left", "right"};
  t.term = 1'700'000'000'500'000'000;
  return t;
}

CellBid bid() {
  CellBid b;
  b.object = "carton";
  b.host = "hall-1";
  b.boot = 9;
  b.sequence = 4;
  b.time_utc_ns = 1'700'000'000'000'000'000;
  b.state = TrackState::kTracking;
  b.sigma = 0.002;
  b.holds = true;
  b.term = 1'600'000'000'000'000'000;
  b.from_utc_ns = b.time_utc_ns - 5;
  b.next = "site/b";
  b.until_utc_ns = b.time_utc_ns + 5;
  return b;
}

TEST(CellWire, ObservationsComeBackExactly) {
  const CellObservation o = observation();
  const std::string bytes = encode(o);
  const auto again = decode_observation(bytes);
  ASSERT_TRUE(again) << again.error().message();
  EXPECT_EQ(encode(*again), bytes);
  EXPECT_EQ(again->object, o.object);
  EXPECT_EQ(again->boot, o.boot);
  EXPECT_EQ(again->capture_utc_ns, o.capture_utc_ns);
  EXPECT_EQ(again->capture_error, o.capture_error);
  EXPECT_EQ(again->at[0].reference, o.at[0].reference);
  EXPECT_EQ(again->at[0].parts[1].term.information, term().information);
  EXPECT_EQ(again->at[0].parts[1].term.gradient, term().gradient);
  EXPECT_EQ(again->hypotheses.size(), 2U);
  EXPECT_EQ(again->picture->missing, 0.5F);
  EXPECT_EQ(again->print, PrintSeen::kSolid);
  EXPECT_TRUE(again->refutes && again->doubted);
  EXPECT_EQ(again->at[0].parts[1].kind, FrozenKind::kFiducial);
  EXPECT_EQ(again->calibration_covariance, o.calibration_covariance);
}

TEST(CellWire, TracksComeBackExactly) {
  const CellTrack t = track();
  const auto again = decode_track(encode(t));
  ASSERT_TRUE(again) << again.error().message();
  EXPECT_EQ(encode(*again), encode(t));
  EXPECT_EQ(again->estimate.covariance, t.estimate.covariance);
  EXPECT_EQ(again->estimate.alternatives, t.estimate.alternatives);
  EXPECT_EQ(again->estimate.twist, t.estimate.twist);
  EXPECT_EQ(again->estimate.degraded_reasons, t.estimate.degraded_reasons);
  EXPECT_EQ(again->cameras, t.cameras);
  EXPECT_EQ(again->term, t.term);
}

TEST(CellWire, BidsComeBackExactly) {
  const CellBid b = bid();
  const auto again = decode_bid(encode(b));
  ASSERT_TRUE(again) << again.error().message();
  EXPECT_EQ(encode(*again), encode(b));
  EXPECT_EQ(again->sigma, b.sigma);
  EXPECT_EQ(again->next, b.next);
  EXPECT_EQ(again->until_utc_ns, b.until_utc_ns);
  EXPECT_LT(encode(b).size(), 120U);
}

TEST(CellWire, RefusesBidsThatAreNone) {
  const std::pair<const char*, void (*)(CellBid&)> faults[] = {
      {"no name", [](CellBid& b) { b.object.clear(); }},
      {"a host that is none", [](CellBid& b) { b.host = "a b"; }},
      {"no time", [](CellBid& b) { b.time_utc_ns = 0; }},
      {"a time before all others", [](CellBid& b) { b.from_utc_ns = -1; }},
      {"a term that never ends", [](CellBid& b) { b.term = ~uint64_t{0}; }},
      {"no such state", [](CellBid& b) { b.state = static_cast<TrackState>(9); }},
      {"a sigma that is none", [](CellBid& b) { b.sigma = kNan; }},
      {"a sigma below zero", [](CellBid& b) { b.sigma = -1; }},
      {"a cell that is a pattern", [](CellBid& b) { b.next = "site/#"; }},
      {"a cell of two lines", [](CellBid& b) { b.next = "site\nb"; }}};
  for (const auto& [what, change] : faults) {
    CellBid b = bid();
    change(b);
    EXPECT_FALSE(decode_bid(encode(b))) << what;
  }
  EXPECT_FALSE(decode_bid(encode(track())));
  EXPECT_FALSE(decode_bid(encode(observation())));
  EXPECT_FALSE(decode_track(encode(bid())));
  EXPECT_FALSE(decode_observation(encode(bid())));
  EXPECT_FALSE(decode_host_state(encode(bid())));
}

// The estimator's own sums leave as much where there are none.
TEST(CellWire, RoundingIsNoAlternative) {
  CellTrack t = track();
  t.estimate.alternatives.setZero();
  t.estimate.alternatives(3, 3) = -4e-21;
  t.estimate.alternatives(1, 1) = 4e-21;
  t.estimate.alternatives(0, 1) = t.estimate.alternatives(1, 0) = 3e-21;
  const auto again = decode_track(encode(t));
  ASSERT_TRUE(again) << again.error().message();
  EXPECT_TRUE(again->estimate.alternatives.isZero(0));
}

TEST(CellWire, ALostObjectHasNoPose) {
  CellTrack t = track();
  t.estimate.state = TrackState::kLost;
  const auto again = decode_track(encode(t));
  ASSERT_TRUE(again);
  EXPECT_EQ(again->estimate.state, TrackState::kLost);
}

TEST(CellWire, StatesComeBack) {
  const CellHostState s{"hall-2",
                        5,
                        true,
                        CellRole::kCameras,
                        1'700'000'000'000'000'000,
                        {{"left", 8, true}},
                        1ms,
                        true,
                        "chrony",
                        "https://hall-2:9754/",
                        7,
                        {9, 1}};
  const auto again = decode_host_state(encode(s));
  ASSERT_TRUE(again);
  EXPECT_EQ(encode(*again), encode(s));
  EXPECT_EQ(again->role, CellRole::kCameras);
  EXPECT_EQ(again->cameras, s.cameras);
  EXPECT_EQ(again->page, s.page);
  EXPECT_EQ(again->beat, 7U);
  EXPECT_EQ(again->observations, s.observations);
}

// Other hosts show it as a link.
TEST(CellWire, RefusesPagesThatAreNone) {
  CellHostState s;
  s.host = std::string("hall-2");
  s.since_utc_ns = 1'700'000'000'000'000'000;
  for (const char* page : {"", "http://[::1]:9754/", "https://hall-2.example/x?y=1"}) {
    s.page = page;
    EXPECT_TRUE(decode_host_state(encode(s))) << page;
  }
  for (const std::string& page :
       {std::string("javascript:alert(1)"), std::string("https://"), std::string("http://a b/"),
        std::string("http://a\"onclick=1"), "http://" + std::string(300, 'a')}) {
    s.page = page;
    EXPECT_FALSE(decode_host_state(encode(s))) << page;
  }
}

// One host's odd text must not cost the others their own state.
TEST(CellWire, StatesAreOfUtf8) {
  CellHostState s;
  s.host = "hall-2";
  s.since_utc_ns = 1'700'000'000'000'000'000;
  for (const std::string clock : {"\xff\xfe", "Uhr: \xc3\xa4"}) {
    s.clock = clock;
    EXPECT_TRUE(decode_host_state(encode(s))) << "what it sends itself is good";
  }
  s.clock.assign(255, 'a');
  s.clock += "\xc3\xa4";  // cut in the middle of a character
  EXPECT_TRUE(decode_host_state(encode(s)));
  std::string bytes = encode(s);
  bytes[bytes.find("aaaa")] = '\xff';
  EXPECT_FALSE(decode_host_state(bytes));
  s.host = "hall 2";
  EXPECT_FALSE(decode_host_state(encode(s)));
}

TEST(CellWire, RefusesObservationsThatAreNone) {
  const std::pair<const char*, void (*)(CellObservation&)> faults[] = {
      {"no name", [](CellObservation& o) { o.camera.clear(); }},
      {"a long name", [](CellObservation& o) { o.object.assign(65, 'a'); }},
      {"a control character", [](CellObservation& o) { o.host = "a\nb"; }},
      {"no time", [](CellObservation& o) { o.capture_utc_ns = 0; }},
      {"a negative error", [](CellObservation& o) { o.capture_error = -1ns; }},
      {"a number that is none",
       [](CellObservation& o) { o.at[0].parts[0].term.gradient[2] = kNan; }},
      {"a cost below zero", [](CellObservation& o) { o.at[0].parts[0].term.cost = -1; }},
      {"no residuals", [](CellObservation& o) { o.at[0].parts[0].term.residuals = 0; }},
      {"too good", [](CellObservation& o) { o.at[0].parts[0].term.quality = 1.5; }},
      {"not positive", [](CellObservation& o) { o.at[0].parts[0].term.information(1, 1) = -1; }},
      {"not semidefinite",
       [](CellObservation& o) {
         auto& m = o.at[0].parts[0].term.information;
         m(0, 1) = m(1, 0) = 2 * std::sqrt(m(0, 0) * m(1, 1));
       }},
      {"far away", [](CellObservation& o) { o.at[0].reference.translation.x() = 1e9; }},
      {"no rotation", [](CellObservation& o) { o.at[0].reference.rotation.coeffs() *= 2; }},
      {"the same kind twice",
       [](CellObservation& o) { o.at[0].parts[1].kind = FrozenKind::kOutline; }},
      {"no such kind",
       [](CellObservation& o) { o.at[0].parts[1].kind = static_cast<FrozenKind>(4); }},
      {"a name that no camera has", [](CellObservation& o) { o.camera = "left/obs"; }},
      {"a name that is not UTF-8", [](CellObservation& o) { o.object = "cup \xff"; }},
      {"half a character", [](CellObservation& o) { o.object = "cup \xc3"; }},
      {"a surrogate", [](CellObservation& o) { o.object = "\xed\xa0\x80"; }},
      {"a covariance that is none",
       [](CellObservation& o) { (*o.calibration_covariance)(2, 2) = -1; }},
      {"a covariance of nothing",
       [](CellObservation& o) { (*o.calibration_covariance)(0, 1) = kNan; }},
      {"too many", [](CellObservation& o) { o.at.resize(17, o.at[0]); }},
      {"too many hypotheses", [](CellObservation& o) { o.hypotheses.resize(65, o.hypotheses[0]); }},
      {"too long", [](CellObservation& o) { o.host.assign(kMostCellBytes, 'a'); }},
      {"a print that is none", [](CellObservation& o) { o.print = static_cast<PrintSeen>(3); }},
      {"a strange picture", [](CellObservation& o) { o.picture->missing = -1; }}};
  for (const auto& [what, change] : faults) {
    CellObservation o = observation();
    change(o);
    EXPECT_FALSE(decode_observation(encode(o))) << what;
  }
}

TEST(CellWire, RefusesWhatIsCutShortOrOfAnotherKind) {
  const std::string bytes = encode(observation());
  EXPECT_FALSE(decode_observation(""));
  EXPECT_FALSE(decode_observation("hello, world"));
  for (size_t size = 1; size < bytes.size(); size += 7) {
    const auto cut = decode_observation(std::string_view(bytes).substr(0, size));
    // Whole fields may be missing at the end.
    if (cut) {
      EXPECT_LE(cut->hypotheses.size(), 2U);
    }
  }
  EXPECT_FALSE(decode_track(bytes));
  EXPECT_FALSE(decode_host_state(bytes));
  CellTrack t = track();
  t.estimate.covariance(0, 0) = kNan;
  EXPECT_FALSE(decode_track(encode(t)));
}

TEST(CellWire, SmallEnoughForADatagram) {
  CellObservation o = observation();
  o.at.resize(1);
  o.at[0].parts.resize(1);
  o.hypotheses.clear();
  o.symmetric_hypotheses.clear();
  o.calibration_covariance.reset();
  EXPECT_LT(encode(o).size(), 450U);
  EXPECT_LT(encode(track()).size(), 1300U);
}

}  // namespace
}  // namespace sightline
