// SPDX-License-Identifier: Apache-2.0
// The scale and the prior on which effects' parameters are fitted.
#include "render_worker/diagnosis/fit/parameter_prior.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "render_worker/diagnosis/fit/parameter_vector.h"

namespace sightline {
namespace {

EffectParameter Parameter(double null_value, double lower, double upper, double prior_scale) {
  return {"test", null_value, lower, upper, prior_scale};
}

TEST(StandardisedParameter, IsZeroAtTheNullValueAndOneAScaleAbove) {
  for (const EffectParameter& parameter :
       {Parameter(0, -1, 5, 0.3), Parameter(2, 0, 100, 1), Parameter(1, -3, 9, 0.5)}) {
    EXPECT_DOUBLE_EQ(StandardisedParameter(parameter, parameter.null_value), 0);
    EXPECT_NEAR(StandardisedParameter(parameter, parameter.null_value + parameter.prior_scale), 1,
                1e-12);
  }
}

TEST(StandardisedParameter, RoundTripsWithinTheBoundsAndIsClampedBeyond) {
  for (const EffectParameter& parameter : {Parameter(0, -1, 5, 0.3), Parameter(2, 0.1, 100, 1)}) {
    for (const double value : {0.2, 1.0, 2.5, 4.9}) {
      EXPECT_NEAR(ParameterFromStandardised(parameter, StandardisedParameter(parameter, value)),
                  value, 1e-12);
    }
    EXPECT_EQ(ParameterFromStandardised(parameter, 1e3), parameter.upper);
    EXPECT_EQ(ParameterFromStandardised(parameter, -1e3), parameter.lower);
  }
}

// A logarithmic parameter whose lower bound is 0 has no infinite standardised value.
TEST(StandardisedParameter, IsFiniteAtZero) {
  EXPECT_TRUE(std::isfinite(StandardisedParameter(Parameter(2, 0, 100, 1), 0)));
}

TEST(FitPenalty, IsNormalWithinOneScaleAndGrowsSlowerBeyond) {
  EXPECT_DOUBLE_EQ(FitPenalty(0), 0);
  EXPECT_DOUBLE_EQ(FitPenalty(-0.5), 0.25);
  constexpr double kStep = 1e-7;
  EXPECT_NEAR(FitPenalty(1 + kStep), FitPenalty(1 - kStep), 1e-6);
  double before = FitPenalty(1);
  for (const double z : {2.0, 10.0, 1e3}) {
    EXPECT_GT(FitPenalty(z), before);
    EXPECT_LT(FitPenalty(z), z * z);
    before = FitPenalty(z);
  }
}

TEST(FreeParameters, LeavesOutDiscreteOnes) {
  class TwoParameters : public Effect {
   public:
    TwoParameters() {
      description_.parameters = {Parameter(0, -1, 5, 0.3), Parameter(7, 0, 9, 1)};
      description_.parameters[1].discrete_values = {5, 6};
    }
    const EffectDescription& description() const override { return description_; }

   private:
    EffectDescription description_{};
  };
  const TwoParameters effect;
  const std::vector<FreeEffectParameter> free =
      FreeParameters({{&effect, {0, 7}}, {&effect, {1, 5}}});
  ASSERT_EQ(free.size(), 2U);
  EXPECT_EQ(free[0].effect, 0);
  EXPECT_EQ(free[1].effect, 1);
  EXPECT_EQ(free[0].parameter + free[1].parameter, 0);
}

}  // namespace
}  // namespace sightline
