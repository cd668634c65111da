// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optical_planning/plan_optics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "proto/status/rpc_status.h"
#include "render_worker/optical_planning/choose_setting.h"
#include "render_worker/optical_planning/line_evaluation.h"
#include "tests/render_worker/optical_planning/step_scene.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

StepOptions With(const std::string& optics, const std::string& more = "") {
  StepOptions options;
  options.more = absl::StrCat(R"(, "optics": {)", optics, "}", more);
  return options;
}

absl::StatusOr<v1::OpticsPlan> Plan(PartScene& scene, int threads = 2, int scans = 1,
                                    int frames = 1, bool per_scan = false,
                                    double part_gamma_rad = 0) {
  OpticsTask task;
  for (int s = 1; s <= scans; ++s) {
    for (int f = 0; f < frames; ++f) {
      PartFrameRequest request = StepFrame(0.001 * f + 0.002 * s);
      request.measurement.part_gamma_rad = part_gamma_rad;
      task.frames.push_back({request, s, f});
    }
  }
  task.per_scan = per_scan;
  OpticsHooks hooks;
  hooks.limits = TwoThreads();
  hooks.limits.threads = threads;
  return PlanOptics(scene, {}, task, hooks);
}

// One frame: every f-number with its best exposure, the best of them, and intervals around the
// values.
TEST(PlanOptics, CurveHoldsTheBestOfEveryFNumber) {
  const auto scene = StepScene(With(R"("f_numbers": [2.8, 8, 22], "realisations": 2)"));
  const auto plan = Plan(*scene);
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->curve_size(), 3);
  const v1::OpticsPoint& best = plan->best();
  for (const v1::OpticsPoint& point : plan->curve()) {
    EXPECT_GE(point.cost(), best.cost());
    for (const auto& exposure : point.exposures()) EXPECT_GE(exposure.cost(), point.cost());
    EXPECT_LE(point.u_px_interval().lower(), point.u_px());
    EXPECT_GE(point.u_px_interval().upper(), point.u_px());
    EXPECT_LE(point.exposure_time_s_interval().lower(), point.exposure_time_s());
    EXPECT_GE(point.exposure_time_s_interval().upper(), point.exposure_time_s());
    // Thesis eq. 6.5.
    EXPECT_NEAR(point.cost(),
                point.profile_coverage() * point.u_px() + (1 - point.profile_coverage()) * 3, 1e-9);
    EXPECT_NEAR(point.constant_exposure_time_s(),
                plan->curve(0).exposure_time_s() * std::pow(point.f_number() / 2.8, 2), 1e-12);
  }
  EXPECT_EQ(std::count_if(plan->curve().begin(), plan->curve().end(),
                          [&](const v1::OpticsPoint& p) { return p.cost() == best.cost(); }),
            1);
  // Speckle grows with the f-number: f/22 is no match for an open lens on plates in focus.
  EXPECT_LT(best.f_number(), 22);
  EXPECT_FALSE(plan->curve(2).as_good_as_best());
  ASSERT_EQ(plan->common().frames_size(), 1);
  EXPECT_NEAR(plan->common().frames(0).u_px(), best.u_px(), 1e-9);
  EXPECT_EQ(plan->common().frames(0).picture_png().substr(1, 3), "PNG");
  EXPECT_THAT(plan->common().statement(), HasSubstr("has the least cost"));
}

TEST(PlanOptics, SameBytesForAnyNumberOfThreads) {
  const auto scene = StepScene(With(R"("f_numbers": [4, 11], "realisations": 2)"));
  const auto one = Plan(*scene, 1), three = Plan(*scene, 3);
  ASSERT_TRUE(one.ok() && three.ok());
  EXPECT_EQ(one->SerializeAsString(), three->SerializeAsString());
}

// The search finds what the full grid of exposures finds.
TEST(PlanOptics, SearchIsAsGoodAsTheFullGrid) {
  const std::string optics = R"("f_numbers": [2.8, 5.6, 16], "realisations": 2, "exposures": 120)";
  const auto search = Plan(*StepScene(With(optics)));
  const auto grid = Plan(*StepScene(With(optics + R"(, "every_exposure": true)")));
  ASSERT_TRUE(search.ok() && grid.ok());
  for (int n = 0; n < 3; ++n) {
    EXPECT_LT(search->curve(n).exposures_size(), 30);
    EXPECT_EQ(grid->curve(n).exposures_size(), 120);
    // Within the chance of the numbers, and within 2 %.
    EXPECT_LE(search->curve(n).cost() - grid->curve(n).cost(),
              std::max(0.02 * grid->curve(n).cost(), grid->curve(n).cost_standard_error()))
        << search->curve(n).f_number();
  }
  EXPECT_EQ(search->best().f_number(), grid->best().f_number());
}

// Intervals promised for a new image hold for images of the renderer that the choice has not seen.
TEST(PlanOptics, FreshImagesLieInTheIntervals) {
  StepOptions step = With(R"("f_numbers": [5.6], "realisations": 4)");
  const auto scene = StepScene(step);
  const auto plan = Plan(*scene);
  ASSERT_TRUE(plan.ok()) << plan.status();
  const v1::OpticsPoint& best = plan->best();

  FrameLightOptions light_options;
  light_options.limits = TwoThreads();
  PartFrameRequest request = StepFrame(0.002);
  auto light = TraceFrameLight(*scene, request, {}, light_options);
  ASSERT_TRUE(light.ok());
  int in_u = 0, in_coverage = 0;
  double sum = 0;
  constexpr int kFresh = 20;
  for (int seed = 0; seed < kFresh; ++seed) {
    StepOptions fresh = step;
    const auto validation_scene = StepScene(fresh);
    // Another piece of the same surface: its own speckle and noise.
    request = StepFrame(0.002 + 1e-7 * (seed + 1));
    request.setting = CameraSetting{
        best.f_number(), best.exposure_time_s(), best.focus_distance_m(), 0.005, 0, 0};
    auto rendered = RenderPartFrame(*validation_scene, request, {}, false, TwoThreads());
    ASSERT_TRUE(rendered.ok()) << rendered.status();
    FrameSetup frame = PartFrameSetup(scene->inspection(), request);
    frame.plate.camera_distance_m = light->median_line_depth_m;
    const DetectionPlan detection = PlanDetection(frame, {});
    auto detected = DetectLine(rendered->image.raw_dn, detection);
    ASSERT_TRUE(detected.ok());
    LineSums total;
    for (const LineSums& s : JudgeLine(*detected, detection, light->line, 192, 9)) total += s;
    const LineQuality quality = QualityOf(total, {});
    sum += quality.u_px;
    in_u += quality.u_px >= best.u_px_interval().lower() &&
            quality.u_px <= best.u_px_interval().upper();
    in_coverage += quality.profile_coverage >= best.profile_coverage_interval().lower() &&
                   quality.profile_coverage <= best.profile_coverage_interval().upper();
  }
  EXPECT_NEAR(sum / kFresh / best.u_px(), 1, 0.1);
  EXPECT_GE(in_u, 17);  // 95 % of 20, less two standard deviations
  EXPECT_GE(in_coverage, 17);
}

// A bright and a dark plate in one line: one exposure clips or misses, two do neither.
TEST(PlanOptics, TwoExposuresServeBrightAndDark) {
  StepOptions step = With(R"("f_numbers": [8], "realisations": 2, "two_exposures": true)");
  step.albedo = 0.9;
  step.upper_albedo = 0.002;
  const auto plan = Plan(*StepScene(step));
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->common().alternatives_size(), 2);
  const v1::OpticsPoint& one = plan->common().alternatives(0).point();
  const v1::OpticsPoint& two = plan->common().alternatives(1).point();
  EXPECT_EQ(plan->common().alternatives(0).name(), "one exposure");
  EXPECT_LT(two.cost(), 0.9 * one.cost());
  EXPECT_GT(two.setting().exposure_time_s(), 1.5 * two.setting().second_exposure_time_s());
  EXPECT_EQ(plan->best().setting().second_exposure_time_s(),
            two.setting().second_exposure_time_s());
}

// Focus is found where the line is, and its interval says how much that matters.
TEST(PlanOptics, FocusIsFound) {
  StepOptions step = With(
      R"("f_numbers": [2], "realisations": 2,
         "focus_distance_m": {"ranges": [{"min": 0.25, "max": 0.4}]})");
  const auto plan = Plan(*StepScene(step));
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_NEAR(plan->best().focus_distance_m(), 0.298, 0.012);
  EXPECT_LE(plan->best().focus_distance_m_interval().lower(), plan->best().focus_distance_m());
  EXPECT_GT(plan->best().focus_distance_m_interval().lower(), 0.25);
}

// A stronger laser and a shorter exposure are the same light of the line, with less of the room's.
TEST(PlanOptics, PowerIsChosenWithinItsBounds) {
  StepOptions step = With(R"("f_numbers": [8], "realisations": 2,
      "laser_power_w": {"values": [0.0005, 0.005]}, "exposure_time_s": {"min": 1e-4, "max": 1e-2})");
  step.ambient_w_m2_sr = 3;
  const auto plan = Plan(*StepScene(step));
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_EQ(plan->best().setting().laser_power_w(), 0.005);
}

TEST(PlanOptics, ExposuresFitTheFrameTime) {
  const std::string costs = R"(, "costs": {"frame_rate_hz": 2000, "stage_speed_m_per_s": 0.2})";
  const auto plan =
      Plan(*StepScene(With(R"("f_numbers": [4, 22], "realisations": 2)", costs)), 2, 1, 5);
  ASSERT_TRUE(plan.ok()) << plan.status();
  EXPECT_GT(plan->common().longest_exposure_time_s(), 0);
  EXPECT_LE(plan->common().longest_exposure_time_s(), 1.0 / 2000);
  for (const v1::OpticsPoint& point : plan->curve()) {
    EXPECT_LE(point.exposure_time_s(), plan->common().longest_exposure_time_s());
  }
  // 4 mm at 0.2 m/s.
  EXPECT_NEAR(plan->best().scan_time_s(), 0.02, 1e-9);
  const auto too_long = Plan(*StepScene(
      With(R"("f_numbers": [4, 22], "exposure_time_s": {"min": 0.1, "max": 0.2})", costs)));
  ASSERT_FALSE(too_long.ok());
  EXPECT_EQ(ErrorReason(too_long.status()), "EXPOSURE_TOO_LONG");
  EXPECT_THAT(std::string(too_long.status().message()), HasSubstr("optics.exposure_time_s"));
}

// Scans with settings of their own, and the one for all.
TEST(PlanOptics, EveryScanHasItsOwn) {
  const auto scene =
      StepScene(With(R"("f_numbers": [4, 11], "realisations": 2, "frames_per_scan": 2)"));
  // Turned, so that the step wanders along the line.
  const auto plan = Plan(*scene, 2, 2, 6, /*per_scan=*/true, /*part_gamma_rad=*/0.6);
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_EQ(plan->scans_size(), 2);
  EXPECT_EQ(plan->scans(0).scan(), 1);
  EXPECT_EQ(plan->scans(1).scan(), 2);
  EXPECT_EQ(plan->common().scan(), 0);
  EXPECT_EQ(plan->common().frames_size(), 4);
  for (const v1::OpticsChoice& scan : plan->scans()) {
    double weight = 0;
    for (const v1::RepresentativeFrame& frame : scan.frames()) weight += frame.weight();
    EXPECT_NEAR(weight, 1, 1e-9);
    EXPECT_GT(scan.best().profile_coverage(), 0.5);
    // Six frames, two of them chosen: one of the others is looked at, too.
    ASSERT_TRUE(scan.has_check());
    EXPECT_GT(scan.check().u_px(), 0);
    for (const v1::RepresentativeFrame& frame : scan.frames()) {
      EXPECT_NE(frame.frame(), scan.check().frame());
    }
  }
}

// Few f-numbers take long: progress moves within each, so that the time left can be estimated.
TEST(PlanOptics, ProgressMovesWithinAnFNumber) {
  StepOptions step = With(
      R"("f_numbers": [4], "realisations": 2, "two_exposures": true,
         "focus_distance_m": {"ranges": [{"min": 0.25, "max": 0.4}]})");
  const auto scene = StepScene(step);
  OpticsTask task;
  task.frames = {{StepFrame(0.002), 1, 0}};
  OpticsHooks hooks;
  hooks.limits = TwoThreads();
  std::vector<double> fractions;
  hooks.on_progress = [&](double fraction, const std::string&) { fractions.push_back(fraction); };
  const auto plan = PlanOptics(*scene, {}, task, hooks);
  ASSERT_TRUE(plan.ok()) << plan.status();
  ASSERT_FALSE(fractions.empty());
  double largest_step = 1 - fractions.back();
  for (size_t i = 1; i < fractions.size(); ++i) {
    EXPECT_GE(fractions[i], fractions[i - 1]) << i;
    largest_step = std::max(largest_step, fractions[i] - fractions[i - 1]);
  }
  // The largest step as a fraction of the whole; the f-number is three quarters of it.
  EXPECT_LT(largest_step, 0.2);

  // An observer changes nothing.
  const auto unwatched = Plan(*scene);
  ASSERT_TRUE(unwatched.ok());
  EXPECT_EQ(unwatched->SerializeAsString(), plan->SerializeAsString());
}

TEST(PlanOptics, SaysWhenThereIsNoLine) {
  const auto scene = StepScene(With(R"("f_numbers": [4], "realisations": 2)"));
  OpticsTask task;
  task.frames = {{StepFrame(0.5), 1, 0}};
  const auto plan = PlanOptics(*scene, {}, task, {});
  ASSERT_FALSE(plan.ok());
  EXPECT_EQ(ErrorReason(plan.status()), "NO_LINE");
  // With others it is left out, and said.
  task.frames.push_back({StepFrame(0), 2, 0});
  OpticsHooks hooks;
  hooks.limits = TwoThreads();
  const auto rest = PlanOptics(*scene, {}, task, hooks);
  ASSERT_TRUE(rest.ok()) << rest.status();
  ASSERT_GE(rest->warnings_size(), 1);
  EXPECT_THAT(rest->warnings(0), HasSubstr("scan 1"));
}

}  // namespace
}  // namespace sightline
