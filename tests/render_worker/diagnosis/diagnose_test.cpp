// SPDX-License-Identifier: Apache-2.0
// Inputs that a diagnosis refuses.
#include "render_worker/diagnosis/diagnose.h"

#include <gtest/gtest.h>

#include <string>

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

}  // namespace
}  // namespace sightline
