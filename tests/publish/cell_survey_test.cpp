// SPDX-License-Identifier: Apache-2.0
#include "sightline/publish/cell/cell_survey.hpp"

#include <gmock/gmock.h>

#include "sightline/publish/cell/cell_bid.hpp"

namespace sightline {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr int64_t kNow = 1'700'000'000'000'000'000;

class Survey : public testing::Test {
 protected:
  static CellHostState state(const std::string& host, uint64_t boot) {
    CellHostState state;
    state.host = host;
    state.boot = boot;
    state.online = true;
    state.role = CellRole::kFusion;
    state.since_utc_ns = kNow;
    state.clock_fit = true;
    return state;
  }
  void host(const CellHostState& state) { host(state, survey_); }
  static void host(const CellHostState& state, CellSurvey& survey) {
    survey.hear("hall/host/" + state.host + "/state", encode(state), kNow);
  }
  void claim(const CellHostState& state, uint64_t beat) { claim("hall", state, beat, survey_); }
  static void claim(const std::string& cell, CellHostState state, uint64_t beat,
                    CellSurvey& survey) {
    state.beat = beat;
    state.observations = {7, 1};
    survey.hear(cell + "/fusion", encode(state), kNow);
  }
  CellSurvey survey_{"hall"};
};

TEST_F(Survey, WhatABrokerHasKeptOfTheDeadIsNotBelieved) {
  host(state("f", 3));
  claim(state("f", 3), 10);
  EXPECT_EQ(survey_.fusion(), "");
  EXPECT_THAT(survey_.faults(), ElementsAre("no host keeps the estimates"));
  claim(state("f", 3), 10);
  EXPECT_EQ(survey_.fusion(), "");
  claim(state("f", 3), 11);
  EXPECT_EQ(survey_.fusion(), "f");
  EXPECT_THAT(survey_.faults(), IsEmpty());
  EXPECT_THAT(survey_.verdicts(), ElementsAre(7, 1));
}

TEST_F(Survey, WhoIsAwayOrHasABadClockIsNamed) {
  host(state("f", 3));
  claim(state("f", 3), 1);
  claim(state("f", 3), 2);
  CellHostState slow = state("a", 4), gone = state("b", 5);
  slow.clock_fit = false;
  slow.clock = std::string("may be 200 ms off");
  gone.online = false;
  host(slow);
  host(gone);
  EXPECT_THAT(survey_.faults(), ElementsAre(HasSubstr("may be 200 ms off"), "host b is away"));
  CellHostState will = state("f", 3);
  will.online = false;
  survey_.hear("hall/fusion", encode(will), kNow);
  EXPECT_THAT(survey_.faults(), testing::Contains("host f is away"));
}

TEST_F(Survey, ObservationsAreCountedByCamera) {
  CellHostState a = state("a", 4);
  a.cameras = {{"left", 1}, {"right", 2}};
  host(a);
  CellObservation o;
  o.object = std::string("carton");
  o.camera = std::string("left");
  o.host = std::string("a");
  o.capture_utc_ns = kNow - 20'000'000;
  survey_.hear("hall/cam/left/obs/carton", encode(o), kNow);
  survey_.hear("hall/cam/left/obs/carton", encode(o), kNow + 5'000'000);
  survey_.hear("hall/cam/right/obs/carton", encode(o), kNow);  // at another one's topic
  survey_.hear("hall/track/carton", "nonsense", kNow);
  ASSERT_EQ(survey_.cameras().size(), 1U);
  EXPECT_EQ(survey_.cameras().at("left").observations, 2U);
  EXPECT_EQ(survey_.cameras().at("left").oldest, std::chrono::milliseconds(25));
  EXPECT_EQ(survey_.malformed(), 2U);
  EXPECT_THAT(survey_.faults(), testing::Contains(HasSubstr("camera right of host a: no observ")));
}

TEST_F(Survey, CamerasWithoutFramesAreNamed) {
  host(state("f", 3));
  claim(state("f", 3), 1);
  claim(state("f", 3), 2);
  CellHostState a = state("a", 4);
  a.role = CellRole::kCameras;
  a.cameras = {{"left", 1, true}};
  host(a);
  EXPECT_THAT(survey_.faults(), ElementsAre("camera left of host a gives no frames"));
}

TEST_F(Survey, NeighborsAreHeard) {
  CellSurvey survey("hall", {"yard"});
  host(state("f", 3), survey);
  claim("hall", state("f", 3), 1, survey);
  claim("hall", state("f", 3), 2, survey);
  claim("yard", state("y", 8), 5, survey);  // kept by the broker, perhaps of one that is dead
  EXPECT_THAT(survey.faults(), ElementsAre(HasSubstr("cell yard next to this one: nobody keeps")));
  claim("yard", state("y", 8), 6, survey);
  EXPECT_EQ(survey.neighbors().at("yard").fusion, "y");
  EXPECT_THAT(survey.faults(), IsEmpty());
  CellBid bid;
  bid.object = std::string("carton");
  bid.host = std::string("y");
  bid.time_utc_ns = bid.from_utc_ns = kNow;
  bid.term = 1;
  bid.holds = true;
  survey.hear("yard/bid/carton", encode(bid), kNow);
  survey.hear("yard/bid/other", encode(bid), kNow);  // at another one's topic
  EXPECT_THAT(survey.neighbors().at("yard").bids, ElementsAre(testing::Pair("carton", true)));
  EXPECT_EQ(survey.malformed(), 1U);
  CellHostState will = state("y", 8);
  will.online = false;
  claim("yard", will, 0, survey);
  EXPECT_EQ(survey.neighbors().at("yard").fusion, "");
}

}  // namespace
}  // namespace sightline
