// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/term_selection.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <bit>
#include <cmath>
#include <numbers>
#include <random>

namespace sightline {
namespace {

TEST(TermSelection, PriorsOfAllSelectionsSumToOne) {
  for (int all = 1; all <= 6; ++all) {
    double sum = 0;
    for (unsigned chosen = 1; chosen < 1U << all; ++chosen) {
      sum += std::exp(LogSelectionPrior(std::popcount(chosen), all));
    }
    EXPECT_NEAR(sum, 1, 1e-12) << all;
  }
}

TEST(TermSelection, PriorOfAParameterIsADensity) {
  const EffectParameter both{"both", 0, -10, 10, 1}, one{"one", 0, 0, 10, 1};
  constexpr double kStep = 0.01;
  double sum_both = 0, sum_one = 0;
  for (double z = 0.5 * kStep; z < 1000; z += kStep) {
    sum_both += 2 * kStep * std::exp(LogParameterPrior(both, z, 0.1));
    sum_one += kStep * std::exp(LogParameterPrior(one, z, 0.1));
  }
  const double normal_at_0 = 1 / std::sqrt(2 * std::numbers::pi);
  EXPECT_NEAR(normal_at_0 * sum_both, 1, 2e-3);
  EXPECT_NEAR(normal_at_0 * sum_one, 1, 2e-3);
}

// Radiances from 1e-6 of the scale to all of it: as much belief in every decade.
TEST(TermSelection, PriorOfSeveralDecadesIsADensity) {
  const EffectParameter both{"both", 0, -1e9, 1e9, 1, {}, 6}, one{"one", 0, 0, 1e9, 1, {}, 6};
  const double normal_at_0 = 1 / std::sqrt(2 * std::numbers::pi);
  constexpr double kStep = 1e-3;
  double all = 0;
  std::vector<double> of_decades(12);
  for (double log_z = std::log(1e-9); log_z < std::log(1e5); log_z += kStep) {
    const double z = std::exp(log_z);
    const double mass = normal_at_0 * kStep * z * std::exp(LogParameterPrior(one, z, 0));
    EXPECT_NEAR(LogParameterPrior(both, z, 0), LogParameterPrior(one, z, 0) - std::log(2), 1e-12);
    all += mass;
    const int decade = static_cast<int>(std::floor(std::log10(z))) + 9;
    if (decade < 12) of_decades[decade] += mass;
  }
  EXPECT_NEAR(all, 1, 2e-3);
  for (int decade = 5; decade < 9; ++decade) EXPECT_NEAR(of_decades[decade], 1 / 6.5, 0.01);
  // A value not distinguishable from 0 is no better than its error allows.
  EXPECT_LT(LogParameterPrior(one, 0, 1e-3), LogParameterPrior(one, 9e-4, 1e-5));
}

// A linear model y = X z + noise, in which Laplace's approximation needs no step: every choice is
// fitted by itself.
class LinearModel {
 public:
  LinearModel(int parameters, const Eigen::VectorXd& truth, unsigned seed)
      : design_(60, parameters), data_(60) {
    std::mt19937 random(seed);
    std::normal_distribution<double> normal;
    for (double& x : design_.reshaped()) x = normal(random);
    // Alike, but for a third.
    design_.col(parameters - 1) += 2 * design_.col(parameters - 2);
    data_ = design_ * truth;
    for (double& y : data_) y += normal(random);
  }

  Eigen::MatrixXd Information(const std::vector<int>& used) const {
    const Eigen::MatrixXd design = design_(Eigen::all, used);
    return design.transpose() * design + Eigen::MatrixXd::Identity(design.cols(), design.cols());
  }
  Eigen::VectorXd Best(const std::vector<int>& used) const {
    const Eigen::MatrixXd design = design_(Eigen::all, used);
    return Information(used).llt().solve(design.transpose() * data_);
  }
  // With `first` parameters that are always there, whose prior is normal.
  double LogEvidence(const std::vector<int>& used, int first,
                     std::span<const EffectParameter> coefficients) const {
    const Eigen::VectorXd z = Best(used);
    double sum = -0.5 * (data_ - design_(Eigen::all, used) * z).squaredNorm() -
                 0.5 * std::log(Information(used).determinant());
    for (size_t i = 0; i < used.size(); ++i) {
      const auto index = static_cast<Eigen::Index>(i);
      sum += used[i] < first ? -0.5 * z[index] * z[index]
                             : LogParameterPrior(coefficients[used[i] - first], z[index], 0);
    }
    return sum + LogSelectionPrior(static_cast<int>(used.size()) - first,
                                   static_cast<int>(coefficients.size()));
  }

 private:
  Eigen::MatrixXd design_;
  Eigen::VectorXd data_;
};

TEST(TermSelection, FindsTheChoiceOfLargestEvidence) {
  constexpr int kFirst = 2, kCoefficients = 4;
  const std::vector<EffectParameter> coefficients(kCoefficients, {"c", 0, -10, 10, 1});
  Eigen::VectorXd truth(kFirst + kCoefficients);
  truth << 0.5, -0.3, 1.5, 0, 0, 0;
  int fewer = 0;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const LinearModel model(kFirst + kCoefficients, truth, seed);
    const std::vector<int> all = {0, 1, 2, 3, 4, 5};
    const std::vector<int> at = {2, 3, 4, 5};
    const TermSelection selection =
        SelectCoefficients(model.Best(all), model.Information(all).inverse(),
                           Eigen::VectorXd::Ones(kFirst + kCoefficients), at, coefficients);
    double largest = -1e300;
    std::vector<int> best;
    for (unsigned chosen = 1; chosen < 1U << kCoefficients; ++chosen) {
      std::vector<int> used = {0, 1};
      for (int k = 0; k < kCoefficients; ++k) {
        if ((chosen >> k & 1U) != 0) used.push_back(kFirst + k);
      }
      const double evidence = model.LogEvidence(used, kFirst, coefficients);
      if (evidence > largest) {
        largest = evidence;
        best = used;
      }
    }
    std::vector<int> found = {0, 1};
    for (int k = 0; k < kCoefficients; ++k) {
      if (selection.needed[k]) found.push_back(kFirst + k);
    }
    EXPECT_EQ(found, best) << seed;
    EXPECT_NEAR(selection.log_evidence_gain, largest - model.LogEvidence(all, kFirst, coefficients),
                1e-8)
        << seed;
    const Eigen::VectorXd expected = model.Best(best);
    for (size_t i = 0; i < best.size(); ++i) {
      EXPECT_NEAR(selection.standardised[best[i]], expected[static_cast<Eigen::Index>(i)], 1e-9);
    }
    fewer += found.size() < all.size() ? 1 : 0;
    EXPECT_TRUE(selection.needed[0]) << seed;
  }
  EXPECT_GE(fewer, 18);
}

}  // namespace
}  // namespace sightline
