// SPDX-License-Identifier: Apache-2.0
#include "planner_client/explore/explore_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <limits>
#include <mutex>
#include <thread>

#include "absl/strings/escaping.h"
#include "tests/planner_client/explore/explore_fixture.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

class ExploreSessionTest : public ::testing::Test {
 protected:
  void Open() {
    auto opened = ExploreSession::Open(std::move(task_));
    ASSERT_TRUE(opened.ok()) << opened.status();
    session_ = *std::move(opened);
  }
  int64_t Revision() const { return session_->State()["revision"]; }
  absl::StatusOr<Json> Change(const std::string& action, Json more = Json::object()) {
    more["action"] = action;
    more["revision"] = Revision();
    return session_->ChangePlan(more);
  }
  absl::StatusOr<Json> Add(double offset_y_m) {
    return Change("add", {{"measurement", LineMeasurement(offset_y_m)}});
  }

  FunctionGainModel gain_model_ = LineGainModel();
  ExploreTask task_ = LineTask(&gain_model_);
  std::unique_ptr<ExploreSession> session_;
};

TEST_F(ExploreSessionTest, SaysWhatMayBeSet) {
  task_.inspection.domain.parameters[0] = {.ranges = {{0.2, 0.3}}, .values = {}};
  task_.inspection.domain.parameters[2] = {.ranges = {}, .values = {0}};
  Open();
  const Json setup = session_->Setup();
  EXPECT_EQ(setup["parameters"][0]["ranges"], Json({{0.2, 0.3}}));
  EXPECT_EQ(setup["parameters"][1]["ranges"], Json({{-80.0, -10.0}, {10.0, 80.0}}));
  EXPECT_EQ(setup["parameters"][2]["values"], Json({0.0}));
  EXPECT_EQ(setup["settings"][0]["min"], 0.5);
  EXPECT_EQ(setup["measurable"], 101);
  EXPECT_EQ(setup["part"], "plate.stl");
  EXPECT_FALSE(setup["pictures"]);
  EXPECT_THAT(std::string(setup["no_pictures"]), HasSubstr("materials"));
  // The first position is one that may be.
  const double distance_m = session_->State()["position"]["measurement"]["camera_distance_m"];
  EXPECT_GE(distance_m, 0.2);
  EXPECT_LE(distance_m, 0.3);
}

TEST_F(ExploreSessionTest, GainIsWhatThePlanDoesNotCover) {
  Open();
  const Json alone = *session_->Evaluate({{"measurement", LineMeasurement(0)}, {"exact", true}});
  EXPECT_TRUE(alone["exact"]);
  EXPECT_EQ(alone["feasibility"], "feasible");
  EXPECT_EQ(alone["covered"], 21);
  EXPECT_EQ(alone["new_targets"], 21);
  ASSERT_TRUE(Add(0).ok());
  const Json next = *session_->Evaluate({{"measurement", LineMeasurement(0.1)}, {"exact", true}});
  EXPECT_EQ(next["covered"], 21);
  EXPECT_EQ(next["new_targets"], 10);
  EXPECT_EQ(next["plan_covered"], 21);
  EXPECT_NEAR(next["coverage_with"], 31 / 101.0, 1e-12);
  // In place of the plan's scan all of them are new.
  const Json instead = *session_->Evaluate(
      {{"measurement", LineMeasurement(0.1)}, {"exact", true}, {"instead_of", 0}});
  EXPECT_EQ(instead["new_targets"], 21);
  EXPECT_EQ(instead["plan_covered"], 0);
}

TEST_F(ExploreSessionTest, EstimatesAreMarkedAsSuch) {
  gain_model_.set_exact([](const Measurement&, size_t t) { return t < 5; });
  Open();
  const Json fast = *session_->Evaluate({{"measurement", LineMeasurement(0)}, {"exact", false}});
  EXPECT_FALSE(fast["exact"]);
  EXPECT_EQ(fast["covered"], 21);
  const Json exact = *session_->Evaluate({{"measurement", LineMeasurement(0)}, {"exact", true}});
  EXPECT_TRUE(exact["exact"]);
  EXPECT_EQ(exact["covered"], 5);
  // The same scan is not evaluated twice.
  const int64_t before = gain_model_.exact_evaluations();
  ASSERT_TRUE(session_->Evaluate({{"measurement", LineMeasurement(0)}, {"exact", true}}).ok());
  EXPECT_EQ(gain_model_.exact_evaluations(), before);
}

TEST_F(ExploreSessionTest, SaysWhyAScanCannotBeMade) {
  Open();
  const Json near =
      *session_->Evaluate({{"measurement", LineMeasurement(0, 0.12)}, {"exact", true}});
  EXPECT_EQ(near["feasibility"], "collision");
  EXPECT_THAT(std::string(near["obstacle"]), HasSubstr("collision"));
  EXPECT_EQ(near["new_targets"], 0);
  const auto added = Change("add", {{"measurement", LineMeasurement(0, 0.12)}});
  EXPECT_EQ(ErrorReason(added.status()), "SCAN_INFEASIBLE");
  EXPECT_TRUE(session_->State()["scans"].empty());

  gain_model_.set_feasibility([](const Measurement&) { return ScanFeasibility::kTravel; });
  const Json far = *session_->Evaluate({{"measurement", LineMeasurement(0.3)}, {"exact", true}});
  EXPECT_EQ(far["feasibility"], "travel");
  EXPECT_THAT(std::string(far["obstacle"]), HasSubstr("1000 mm"));
}

TEST_F(ExploreSessionTest, ThePlanIsEditedAndCountsAreThoseOfItsOrder) {
  Open();
  ASSERT_TRUE(Add(-0.3).ok());
  ASSERT_TRUE(Add(0).ok());
  ASSERT_TRUE(Add(0.05).ok());
  Json state = session_->State();
  EXPECT_EQ(state["scans"][2]["new_targets"], 5);
  EXPECT_EQ(state["covered"], 47);
  EXPECT_TRUE(state["unsaved"]);
  state = *Change("move", {{"index", 2}, {"to", 0}});
  EXPECT_EQ(state["scans"][0]["measurement"]["offset_y_m"], 0.05);
  EXPECT_EQ(state["scans"][2]["new_targets"], 5);
  state = *Change("replace", {{"index", 0}, {"measurement", LineMeasurement(0.4)}});
  EXPECT_EQ(state["covered"], 63);
  state = *Change("remove", {{"index", 1}});
  EXPECT_EQ(state["scans"].size(), 2);
  EXPECT_EQ(state["scans"][1]["measurement"]["offset_y_m"], 0.0);
  state = *Change("load", {{"index", 0}});
  EXPECT_EQ(state["position"]["measurement"]["offset_y_m"], 0.4);
}

TEST_F(ExploreSessionTest, TheStateIsKeptForAPageThatIsLoadedAgain) {
  Open();
  ASSERT_TRUE(
      session_
          ->Evaluate({{"measurement", LineMeasurement(0.2)},
                      {"setting",
                       {{"f_number", 4}, {"exposure_time_s", 0.002}, {"focus_distance_m", 0.3}}}})
          .ok());
  ASSERT_TRUE(Add(0.2).ok());
  const Json state = session_->State();
  EXPECT_EQ(state["position"]["measurement"], LineMeasurement(0.2));
  EXPECT_EQ(state["position"]["setting"]["f_number"], 4);
  // The setting goes with the scan.
  EXPECT_EQ(session_->Scans()[0].setting->exposure_time_s(), 0.002);
}

TEST_F(ExploreSessionTest, ChangesToAPlanThatIsNoMoreAreRefused) {
  Open();
  const int64_t revision = Revision();
  ASSERT_TRUE(Add(0).ok());
  const auto stale =
      session_->ChangePlan({{"action", "remove"}, {"index", 0}, {"revision", revision}});
  EXPECT_EQ(ErrorReason(stale.status()), "STATE_CHANGED");
  EXPECT_EQ(session_->State()["scans"].size(), 1);
}

TEST_F(ExploreSessionTest, WrongRequestsNameFieldValueAndRange) {
  Open();
  const auto message = [&](const Json& request) {
    const auto answer = session_->Evaluate(request);
    EXPECT_TRUE(absl::IsInvalidArgument(answer.status())) << request;
    return std::string(answer.status().message());
  };
  Json measurement = LineMeasurement(0);
  measurement["camera_polar_deg"] = 95;
  EXPECT_THAT(message({{"measurement", measurement}}),
              HasSubstr("measurement.camera_polar_deg: is 95, must be in [0, 90] deg"));
  measurement["camera_polar_deg"] = "NaN";
  EXPECT_THAT(message({{"measurement", measurement}}),
              HasSubstr("measurement.camera_polar_deg: is \"NaN\", must be a number"));
  measurement["camera_polar_deg"] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message({{"measurement", measurement}}), HasSubstr("must be a number"));
  measurement.erase("camera_polar_deg");
  EXPECT_THAT(message({{"measurement", measurement}}), HasSubstr("is missing"));
  measurement = LineMeasurement(0);
  measurement["triangulation_angle_deg"] = 0;
  EXPECT_THAT(message({{"measurement", measurement}}),
              HasSubstr("must be in [-80, -10] or [10, 80] deg"));
  measurement = LineMeasurement(0);
  measurement["tilt"] = 1;
  EXPECT_THAT(message({{"measurement", measurement}}), HasSubstr("measurement.tilt: is not known"));
  EXPECT_THAT(message(Json::object()), HasSubstr("measurement"));
  EXPECT_THAT(message({{"measurement", LineMeasurement(0)}, {"instead_of", 0}}),
              HasSubstr("instead_of"));
  EXPECT_THAT(
      message(
          {{"measurement", LineMeasurement(0)},
           {"setting", {{"f_number", 0.1}, {"exposure_time_s", 0.01}, {"focus_distance_m", 0.3}}}}),
      HasSubstr("setting.f_number: is 0.1, must be a number in [0.5, 128]"));
  EXPECT_FALSE(ParseRequestBody("{\"exact\": NaN}").ok());
  EXPECT_FALSE(ParseRequestBody("{\"exact\": 1e999}").ok());
  EXPECT_FALSE(ParseRequestBody("[]").ok());
  // Deep ones, of the size that a request may have, would be shown by recursion.
  const std::string deep =
      "{\"exact\": " + std::string(32'000, '[') + std::string(32'000, ']') + "}";
  const auto refused = ParseRequestBody(deep);
  ASSERT_FALSE(refused.ok());
  EXPECT_THAT(std::string(refused.status().message()), HasSubstr("nested deeper than 16 levels"));
}

TEST_F(ExploreSessionTest, UnknownScansAndActionsAreRefused) {
  Open();
  ASSERT_TRUE(Add(0).ok());
  for (const Json& index : {Json(1), Json(-1), Json(0.5), Json("0"), Json(uint64_t{1} << 63)}) {
    const auto removed = Change("remove", {{"index", index}});
    EXPECT_THAT(std::string(removed.status().message()), HasSubstr("index: is")) << index;
  }
  EXPECT_FALSE(Change("move", {{"index", 0}, {"to", 1}}).ok());
  EXPECT_THAT(std::string(Change("destroy").status().message()), HasSubstr("must be one of"));
  EXPECT_EQ(session_->State()["scans"].size(), 1);
}

TEST_F(ExploreSessionTest, AngleThatWrapsAroundMayBeAFullTurn) {
  Open();
  Json measurement = LineMeasurement(0);
  measurement["camera_azimuth_deg"] = 360;
  const auto answer = session_->Evaluate({{"measurement", measurement}});
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_NEAR((*answer)["measurement"]["camera_azimuth_deg"], 0, 1e-9);
}

TEST_F(ExploreSessionTest, OnlyRestingOrientationsOfTheInspection) {
  task_.inspection.domain.resting_orientations = {{0, 0}, {Radians(180), 0}};
  Open();
  Json measurement = LineMeasurement(0);
  measurement["part_alpha_deg"] = 180;
  EXPECT_TRUE(session_->Evaluate({{"measurement", measurement}}).ok());
  measurement["part_alpha_deg"] = 90;
  EXPECT_THAT(std::string(session_->Evaluate({{"measurement", measurement}}).status().message()),
              HasSubstr("resting"));
}

TEST_F(ExploreSessionTest, SuggestsWhatThePlanLacks) {
  Open();
  ASSERT_TRUE(Add(0).ok());
  const Json anywhere =
      *session_->Suggest({{"from", "anywhere"}, {"measurement", LineMeasurement(0)}});
  EXPECT_EQ(anywhere["new_targets"], 21);
  const Json here = *session_->Suggest({{"from", "here"}, {"measurement", LineMeasurement(0.05)}});
  EXPECT_GE(here["new_targets"], 18);
  EXPECT_GE(std::abs(here["measurement"]["offset_y_m"].get<double>()), 0.15);
  // It is in the sliders now, and people can read it.
  EXPECT_EQ(session_->State()["position"]["measurement"], here["measurement"]);
  EXPECT_FALSE(session_->SuggestionProgress()["running"]);
  EXPECT_EQ(ErrorReason(session_->Suggest({{"from", "there"}}).status()), "INVALID_FIELD");
}

// Targets are known admissibly once two scans see them.
class TwiceGainModel : public FunctionGainModel {
 public:
  TwiceGainModel() : FunctionGainModel(LineGainModel()) {}
  bool ScoresPlans() const override { return true; }
  absl::StatusOr<std::vector<ScanCoverage>> FastCoverage(
      std::span<const Measurement> measurements) override {
    auto scans = FunctionGainModel::FastCoverage(measurements);
    for (ScanCoverage& scan : *scans) {
      for (size_t t = 0; t < kLineTargets; ++t) {
        if (!scan.covered.Test(t)) continue;
        scan.shares.targets.push_back(static_cast<uint32_t>(t));
        scan.shares.share.push_back(0.5f);
      }
    }
    return scans;
  }
  absl::StatusOr<std::vector<ScanGain>> Gains(std::span<const Measurement> measurements,
                                              std::span<const float> known) override {
    auto gains = FunctionGainModel::Gains(measurements, known);
    const auto scans = FunctionGainModel::FastCoverage(measurements);
    for (size_t i = 0; i < measurements.size(); ++i) {
      (*gains)[i].gain = 0;
      for (size_t t = 0; t < kLineTargets; ++t) {
        if ((*scans)[i].covered.Test(t)) (*gains)[i].gain += known[t] == 0.5f ? 1 : 0.1;
      }
    }
    return gains;
  }
  absl::StatusOr<PlanScore> ScorePlan(std::span<const Measurement> plan, bool) override {
    ++scored;
    PlanScore score;
    const auto scans = FunctionGainModel::ExactCoverage(plan);
    for (size_t t = 0; t < kLineTargets; ++t) {
      int times = 0;
      for (const ScanCoverage& scan : *scans) times += scan.covered.Test(t);
      score.satisfied += times >= 2;
    }
    score.measurable = kLineTargets;
    return score;
  }
  int scored = 0;
};

TEST_F(ExploreSessionTest, WhereTheGoalIsUncertaintyPlansAreJudgedByWhatTheyMakeKnown) {
  TwiceGainModel judge;
  task_.judge = &judge;
  Open();
  ASSERT_TRUE(Add(0).ok());
  const Json elsewhere = *session_->Admissible({{"measurement", LineMeasurement(0.3)}});
  EXPECT_EQ(elsewhere, Json({{"judged", 101}, {"before", 0}, {"with", 0}}));
  EXPECT_EQ((*session_->Admissible({{"measurement", LineMeasurement(0.05)}}))["with"], 16);
  // The plan without the scan was scored already.
  EXPECT_EQ(judge.scored, 3);
  EXPECT_EQ((*session_->Admissible({{"measurement", LineMeasurement(0, 0.12)}}))["with"], 0);
  EXPECT_EQ(
      (*session_->Admissible({{"measurement", LineMeasurement(0.05)}, {"instead_of", 0}}))["with"],
      0);
  // Best is to see the same targets again, where nothing is new.
  const Json next = *session_->Suggest({{"from", "anywhere"}, {"measurement", LineMeasurement(0)}});
  EXPECT_EQ(next["new_targets"], 0);
  EXPECT_EQ((*session_->Admissible({{"measurement", next["measurement"]}}))["with"], 21);
  EXPECT_FALSE(session_->Admissible({{"measurement", Json::object()}}).ok());
}

TEST_F(ExploreSessionTest, WhereTheGoalIsCoverageNothingIsAdmissible) {
  Open();
  const auto answer = session_->Admissible({{"measurement", LineMeasurement(0)}});
  EXPECT_TRUE(absl::IsFailedPrecondition(answer.status()));
  EXPECT_THAT(std::string(answer.status().message()), HasSubstr("goal.admissible"));
}

TEST_F(ExploreSessionTest, ASearchIsCancelledByTheButtonAndByTheEnd) {
  gain_model_.set_on_query([&] { session_->CancelSuggestion(); });
  Open();
  const Json position = session_->State()["position"];
  const Json request = {{"from", "anywhere"}, {"measurement", LineMeasurement(0)}};
  EXPECT_TRUE((*session_->Suggest(request))["cancelled"]);
  EXPECT_EQ(session_->State()["position"], position);
  gain_model_.set_on_query(nullptr);
  EXPECT_FALSE(session_->Suggest(request)->contains("cancelled"));
  session_->Close();
  EXPECT_TRUE((*session_->Suggest(request))["cancelled"]);
}

TEST_F(ExploreSessionTest, WithoutMaterialsItSaysWhatIsMissing) {
  Open();
  const auto picture = session_->Picture({{"measurement", LineMeasurement(0)}});
  EXPECT_EQ(ErrorReason(picture.status()), "NO_PICTURES");
  EXPECT_THAT(std::string(picture.status().message()), HasSubstr("materials is missing"));
}

TEST_F(ExploreSessionTest, PictureIsOfTheMiddleFrameOrTheChosenOne) {
  std::vector<v1::PartFrame> drawn;
  task_.draw = [&](const v1::PartFrame& frame, const std::atomic<bool>&) {
    drawn.push_back(frame);
    DraftPicture picture;
    picture.png = "png";
    picture.reduction = 4;
    return absl::StatusOr<DraftPicture>(picture);
  };
  Open();
  Json request = {
      {"measurement", LineMeasurement(0)},
      {"setting", {{"f_number", 4}, {"exposure_time_s", 0.002}, {"focus_distance_m", 0.3}}}};
  const Json middle = *session_->Picture(request);
  EXPECT_EQ(middle["frames"], 101);
  EXPECT_EQ(middle["frame"], 50);
  EXPECT_EQ(middle["png"], absl::Base64Escape("png"));
  EXPECT_EQ(drawn[0].setting().f_number(), 4);
  EXPECT_NEAR(drawn[0].stage_position_m(), 0.05, 1e-12);
  request["frame"] = 100;
  EXPECT_EQ((*session_->Picture(request))["frame"], 100);
  request["frame"] = 101;
  EXPECT_THAT(std::string(session_->Picture(request).status().message()),
              HasSubstr("frame: is 101, must be a whole number in [0, 100]"));
}

TEST_F(ExploreSessionTest, ANewPictureTakesThePlaceOfTheOneBefore) {
  std::mutex mutex;
  std::condition_variable begun;
  int started = 0;
  task_.draw = [&](const v1::PartFrame&,
                   const std::atomic<bool>& cancelled) -> absl::StatusOr<DraftPicture> {
    {
      const std::scoped_lock lock(mutex);
      if (++started == 2) return DraftPicture{};
    }
    begun.notify_one();
    while (!cancelled) std::this_thread::yield();
    return absl::CancelledError("cancelled");
  };
  Open();
  Json first;
  std::thread earlier([&] { first = *session_->Picture({{"measurement", LineMeasurement(0)}}); });
  {
    std::unique_lock lock(mutex);
    begun.wait(lock, [&] { return started == 1; });
  }
  const Json second = *session_->Picture({{"measurement", LineMeasurement(0.1)}});
  earlier.join();
  EXPECT_TRUE(first["cancelled"]);
  EXPECT_TRUE(second.contains("png"));
}

TEST_F(ExploreSessionTest, NothingIsOverwrittenWithoutConsent) {
  bool there = false;
  int saved = 0;
  task_.saved_before = [&] { return there; };
  task_.save = [&](const std::vector<ExploredScan>& scans) -> absl::StatusOr<SavedPlan> {
    EXPECT_EQ(scans.size(), 1);
    ++saved;
    there = true;
    return SavedPlan{{"plan.json"}};
  };
  Open();
  EXPECT_EQ(ErrorReason(session_->Save(Json::object()).status()), "PLAN_EMPTY");
  ASSERT_TRUE(Add(0).ok());
  EXPECT_TRUE(session_->HasUnsaved());
  const auto first = session_->Save(Json::object());
  ASSERT_TRUE(first.ok());
  EXPECT_FALSE((*first)["state"]["unsaved"]);
  EXPECT_FALSE(session_->HasUnsaved());
  EXPECT_EQ(ErrorReason(session_->Save(Json::object()).status()), "PLAN_EXISTS");
  EXPECT_EQ(ErrorReason(session_->Save({{"overwrite", false}}).status()), "PLAN_EXISTS");
  EXPECT_FALSE(session_->Save({{"overwrite", "yes"}}).ok());
  EXPECT_EQ(saved, 1);
  EXPECT_TRUE(session_->Save({{"overwrite", true}}).ok());
  EXPECT_EQ(saved, 2);
}

TEST_F(ExploreSessionTest, AFailedSaveLeavesThePlanUnsaved) {
  task_.save = [](const std::vector<ExploredScan>&) -> absl::StatusOr<SavedPlan> {
    return absl::InternalError("disk full");
  };
  Open();
  ASSERT_TRUE(Add(0).ok());
  EXPECT_FALSE(session_->Save(Json::object()).ok());
  EXPECT_TRUE(session_->HasUnsaved());
}

TEST_F(ExploreSessionTest, BeginsWithAPlanAndKeepsItsSettings) {
  ExploredScan scan;
  scan.measurement.offset_y_m = 0.25;
  scan.locked = true;
  scan.setting.emplace();
  scan.setting->set_laser_power_w(0.007);
  scan.setting->set_f_number(5.6);
  task_.scans = {scan};
  Open();
  const Json state = session_->State();
  EXPECT_EQ(state["scans"].size(), 1);
  EXPECT_TRUE(state["scans"][0]["locked"]);
  EXPECT_EQ(state["scans"][0]["covered"], 21);
  EXPECT_FALSE(state["unsaved"]);
  EXPECT_EQ(state["position"]["setting"]["f_number"], 5.6);
  // Parameters without a control on the page stay as they were.
  ASSERT_TRUE(Change("replace",
                     {{"index", 0},
                      {"measurement", LineMeasurement(0.2)},
                      {"setting",
                       {{"f_number", 8}, {"exposure_time_s", 0.001}, {"focus_distance_m", 0.3}}}})
                  .ok());
  EXPECT_EQ(session_->Scans()[0].setting->laser_power_w(), 0.007);
  EXPECT_TRUE(session_->Scans()[0].locked);
}

TEST_F(ExploreSessionTest, ViewFollowsTheStage) {
  Open();
  const Json answer = *session_->Evaluate({{"measurement", LineMeasurement(0)}, {"exact", true}});
  const Json& view = answer["view"];
  EXPECT_NEAR(view["stage_end_m"].get<double>() - view["stage_start_m"].get<double>(), 0.1, 1e-9);
  // Seen from the part that lies as in its file the sensors go along -x.
  EXPECT_NEAR(view["sensor_direction"][0], -1, 1e-12);
  // The camera stands 0.4 m from the origin of the rig.
  const auto& pose = view["camera_pose"];
  const double x = pose[3].get<double>() + view["stage_start_m"].get<double>();
  const double y = pose[7], z = pose[11];
  EXPECT_NEAR(std::hypot(x, y, z), 0.4, 1e-9);
}

}  // namespace
}  // namespace sightline
