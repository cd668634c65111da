// SPDX-License-Identifier: Apache-2.0
// Diagnoses of rendered plates in poses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "render_worker/diagnosis/diagnose.h"
#include "tests/render_worker/diagnosis/posed/posed_set.h"

namespace sightline {
namespace {

// Enough to tell the effects below, few enough for half a minute each.
constexpr int kPoses = 3;

v1::Diagnosis DiagnosisOf(const RecordingSet& set, const std::vector<ActiveEffect>& effects) {
  const RecordedSet recorded = ReducedPosedSet(set, effects, 3);
  DiagnosisSettings settings;
  settings.threads = 2;
  settings.max_effects = 1;
  const auto diagnosis = Diagnose(recorded, settings, {});
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return *diagnosis;
}

TEST(PosedDiagnosis, NamesNothingWhereNothingIsHidden) {
  const v1::Diagnosis diagnosis = DiagnosisOf(PosedSet({.poses = kPoses}), {});
  EXPECT_EQ(diagnosis.verdict(), "none") << diagnosis.finding();
  EXPECT_EQ(diagnosis.calibrated().format_version(), 3);
}

TEST(PosedDiagnosis, NamesHaloAndAmbientLight) {
  for (const auto& [id, name, value] :
       {std::tuple("optics.veiling_glare", "glare_fraction", 0.12),
        std::tuple("illumination.ambient_light", "ambient_radiance_w_m2_sr", 0.0)}) {
    std::vector<NamedValue> values = {{name, value}};
    if (value == 0) values[0].value = 0.5;
    const auto effect = MakeActiveEffect(id, values);
    ASSERT_TRUE(effect.ok()) << effect.status();
    const v1::Diagnosis diagnosis = DiagnosisOf(PosedSet({.poses = kPoses}), {*effect});
    ASSERT_GT(diagnosis.ranked_size(), 0);
    // Any of the effects that change these recordings alike may be the first.
    EXPECT_THAT(diagnosis.finding(), testing::HasSubstr(id));
  }
}

}  // namespace
}  // namespace sightline
