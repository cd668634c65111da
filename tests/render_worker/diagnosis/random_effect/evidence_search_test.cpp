// SPDX-License-Identifier: Apache-2.0
// Peaks of known place, width and integral.
#include "render_worker/diagnosis/random_effect/evidence_search.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>

namespace sightline {
namespace {

constexpr double kScale = 0.1, kHeight = 8, kPlace = 0.7;  // of log(strength / scale)

EffectParameter Strength() { return {"strength", 0, 0, 10, kScale}; }
EffectParameter Shape() { return {"shape", 0, -10, 10, 1}; }

double GaussianPeak(double strength, double width) {
  const double away = (std::log(strength / kScale) - kPlace) / width;
  return kHeight - 0.5 * away * away;
}

// Integral of the likelihood over the half Cauchy prior of the strength over its scale.
double LogEvidenceByIntegration(double width) {
  constexpr double kStep = 1e-3;
  double sum = 0;
  for (double u = -6; u <= 4; u += kStep) {
    const double z = std::exp(u);
    sum += kStep * 2 * z / (std::numbers::pi * (1 + z * z)) *
           std::exp(GaussianPeak(kScale * z, width));
  }
  return std::log(sum);
}

TEST(EvidenceSearch, FindsPlaceWidthAndIntegralOfAPeak) {
  const std::array<EffectParameter, 1> description = {Strength()};
  for (const double width : {0.05, 0.2, 0.5}) {
    SCOPED_TRACE(width);
    const EvidencePeak peak = SearchEvidence(
        description,
        [&](const std::vector<double>& parameters) { return GaussianPeak(parameters[0], width); },
        {});
    ASSERT_EQ(peak.parameters.size(), 1u);
    const double strength = kScale * std::exp(kPlace);
    EXPECT_NEAR(peak.parameters[0], strength, 0.1 * width * strength);
    EXPECT_NEAR(peak.gain, kHeight, 0.01);
    EXPECT_NEAR(peak.standard_errors[0], width * strength, 0.2 * width * strength);
    EXPECT_NEAR(peak.log_evidence, LogEvidenceByIntegration(width), 0.1);
  }
}

// A parameter that changes nothing leaves likelihood and evidence as they are.
TEST(EvidenceSearch, AnUninformedShapeCostsNoEvidence) {
  const auto gain = [](const std::vector<double>& parameters) {
    return GaussianPeak(parameters[0], 0.2);
  };
  const EvidencePeak alone = SearchEvidence(std::array{Strength()}, gain, {});
  const EvidencePeak with_shape = SearchEvidence(std::array{Strength(), Shape()}, gain, {});
  ASSERT_EQ(with_shape.parameters.size(), 2u);
  EXPECT_NEAR(with_shape.gain, alone.gain, 0.01);
  // The grid ends at six prior scales, beyond which the Cauchy prior has a tenth of its mass.
  EXPECT_NEAR(with_shape.log_evidence, alone.log_evidence, 0.2);
}

TEST(EvidenceSearch, APeakBetweenCoarseShapesIsFoundWhereManyAreExpected) {
  const auto gain = [](const std::vector<double>& parameters) {
    const double away = (parameters[1] - 0.25) / 0.01;
    return GaussianPeak(parameters[0], 0.2) - 5 + 10 * std::exp(-0.5 * away * away);
  };
  const EvidencePeak coarse = SearchEvidence(std::array{Strength(), Shape()}, gain, {});
  const EvidencePeak fine =
      SearchEvidence(std::array{Strength(), Shape()}, gain, {.many_shapes = true});
  EXPECT_GT(fine.gain, coarse.gain + 5);
  EXPECT_NEAR(fine.gain, kHeight + 5, 0.1);
}

}  // namespace
}  // namespace sightline
