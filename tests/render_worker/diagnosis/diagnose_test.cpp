// SPDX-License-Identifier: Apache-2.0
// Inputs that a diagnosis refuses, and effects that the raw numbers show by themselves.
#include "render_worker/diagnosis/diagnose.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "render_worker/diagnosis/selection/hypothesis.h"
#include "render_worker/diagnosis/selection/next_recording.h"
#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

TEST(Diagnose, TooFewPlatePositionsAreRefused) {
  RecordingSet description = SmallSetDescription();
  description.recordings.resize(3);
  const auto diagnosis = Diagnose(MakeRecordedSet(description, {}), {}, nullptr);
  EXPECT_EQ(diagnosis.status().code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_NE(std::string(diagnosis.status().message()).find("plate_position_id"), std::string::npos);
}

TEST(Diagnose, UnknownExcludedEffectIsRefused) {
  DiagnosisSettings settings;
  settings.excluded_effects = {"optics.magic"};
  const auto diagnosis = Diagnose(MakeRecordedSet(SmallSetDescription(), {}), settings, nullptr);
  EXPECT_EQ(diagnosis.status().code(), absl::StatusCode::kInvalidArgument);
}

// Two stuck bits change the noise of every recording. Beside a ghost line they are found at once,
// and the ghost line is found under the covariance that they leave.
TEST(Diagnose, MissingBitsAreFoundBesideAnotherEffect) {
  const ActiveEffect bits{FindEffect("sensor.adc_missing_bits"), {2}};
  ActiveEffect ghost{FindEffect("illumination.ghost_line"), {}};
  for (const EffectParameter& parameter : ghost.effect->description().parameters) {
    ghost.parameters.push_back(parameter.null_value);
  }
  ghost.parameters[0] = 0.1;
  const RecordedSet set = RenderSmallSet({}, {ghost, bits}, 5);
  const auto diagnosis = Diagnose(set, {}, nullptr);
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  const v1::Explanation& answer = diagnosis->ranked(0);
  EXPECT_EQ(answer.effect(), "illumination.ghost_line") << diagnosis->finding();
  ASSERT_EQ(answer.effects_size(), 2);
  EXPECT_EQ(answer.effects(1).effect(), "sensor.adc_missing_bits");
  EXPECT_EQ(answer.effects(1).parameters(0).value(), 2);
  EXPECT_NEAR(answer.effects(0).parameters(0).value(), 0.1, 0.02);
  EXPECT_LT(diagnosis->held_out_improvement().with_effect(),
            0.5 * diagnosis->held_out_improvement().null());
  EXPECT_TRUE(std::any_of(
      diagnosis->calibrated_effects().begin(), diagnosis->calibrated_effects().end(),
      [](const v1::Effect& effect) { return effect.effect() == "sensor.adc_missing_bits"; }));
}

// A dark frame tells dark current from nothing. It has no place on the plate, and says none.
TEST(NextRecordings, DarkFramesHaveNoPlatePosition) {
  const RecordedSet set = MakeRecordedSet(SmallSetDescription(), {});
  const Effect* dark_current = FindEffect("sensor.dark_current");
  Hypothesis none = MakeHypothesis({}), warm = MakeHypothesis({{dark_current, {2000}}});
  none.probability = warm.probability = 0.5;
  warm.fit.parameters.effects = warm.effects;
  int dark_frames = 0;
  for (const v1::NextRecording& next : NextRecordings(set, none, warm, 100)) {
    EXPECT_EQ(next.recording().has_plate_position_id(), next.recording().kind() != "dark");
    dark_frames += next.recording().kind() == "dark";
  }
  EXPECT_GT(dark_frames, 0);
}

}  // namespace
}  // namespace sightline
