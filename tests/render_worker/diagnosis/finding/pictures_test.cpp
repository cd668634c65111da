// SPDX-License-Identifier: Apache-2.0
// Pictures of the report.
#include "render_worker/diagnosis/finding/pictures.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/render_worker/diagnosis/rendered_set.h"

namespace sightline {
namespace {

// A bug found: rows' own noise was missing from the deviations that are drawn.
TEST(CompareProfiles, RowsScatterAsDrawn) {
  const std::vector<ActiveEffect> effects = {{FindEffect("sensor.row_noise"), {2}}};
  const RecordedSet set = RenderSmallSet({}, effects, 4);
  const SetModel model(set, {});
  FitResult null, best;
  null.parameters.line_shift_px = EstimateLineShifts(model, {});
  best.parameters = null.parameters;
  best.parameters.effects = effects;
  const v1::ProfileComparison profile = CompareProfiles(model, null, best, 0);
  double square = 0;
  for (int row = 0; row < profile.row_px_size(); ++row) {
    square += std::pow(
        (profile.observed_dn(row) - profile.model_dn(row)) / profile.standard_deviation_dn(row), 2);
  }
  // With 128 rows, most without light: four standard deviations of the mean square.
  EXPECT_NEAR(square / profile.row_px_size(), 1, 0.5);
}

}  // namespace
}  // namespace sightline
