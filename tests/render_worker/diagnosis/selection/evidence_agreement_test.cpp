// SPDX-License-Identifier: Apache-2.0
// Laplace's approximation of the evidence against nested sampling, on models so small that nested
// sampling is exact but for its statistical error.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/parameter_prior.h"
#include "render_worker/diagnosis/selection/hypothesis.h"
#include "render_worker/effects/effect.h"

namespace sightline {
namespace {

constexpr int kNuisance = 2;  // their priors are standard normal
constexpr double kNoise = 0.05;

// Expectation of the data for standardised parameters z: nuisance parameters first.
using Expectation = std::function<Eigen::VectorXd(const Eigen::VectorXd& z)>;

struct SmallModel {
  Expectation expectation;
  std::vector<ActiveEffect> effects;  // each with one parameter
};

const EffectParameter& ParameterOf(const ActiveEffect& active) {
  return active.effect->description().parameters.front();
}

bool IsOneSided(const EffectParameter& parameter) {
  return parameter.lower == parameter.null_value;
}

double LogLikelihood(const SmallModel& model, const Eigen::VectorXd& y, const Eigen::VectorXd& z) {
  return -0.5 * ((y - model.expectation(z)) / kNoise).squaredNorm();
}

// Logarithm of the prior density but for a constant.
double LogPriorDensity(const SmallModel& model, const Eigen::VectorXd& z) {
  double sum = -0.5 * z.head(kNuisance).squaredNorm();
  for (size_t e = 0; e < model.effects.size(); ++e) {
    const double value = z[kNuisance + static_cast<Eigen::Index>(e)];
    if (IsOneSided(ParameterOf(model.effects[e])) && value < 0) {
      return -std::numeric_limits<double>::infinity();
    }
    sum -= std::log1p(value * value);
  }
  return sum;
}

Eigen::VectorXd DrawFromPrior(const SmallModel& model, std::mt19937_64& random) {
  Eigen::VectorXd z(kNuisance + static_cast<Eigen::Index>(model.effects.size()));
  std::normal_distribution<double> normal;
  std::cauchy_distribution<double> cauchy;
  for (int i = 0; i < kNuisance; ++i) z[i] = normal(random);
  for (size_t e = 0; e < model.effects.size(); ++e) {
    const double value = cauchy(random);
    z[kNuisance + static_cast<Eigen::Index>(e)] =
        IsOneSided(ParameterOf(model.effects[e])) ? std::abs(value) : value;
  }
  return z;
}

// Logarithm of the marginal likelihood by nested sampling (Skilling, Bayesian Analysis 1 (2006)
// 833). New points are found by a random walk with steps between live points (ter Braak, Stat.
// Comput. 16 (2006) 239). The standard error is the square root of the information in nats over the
// number of live points: 0.1 nats for some 10 nats.
double NestedSampling(const SmallModel& model, const Eigen::VectorXd& y, uint64_t seed) {
  constexpr int kLive = 1000, kSteps = 40;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform;
  std::uniform_int_distribution<int> pick(0, kLive - 1);
  std::vector<Eigen::VectorXd> points;
  std::vector<double> likelihoods;
  for (int i = 0; i < kLive; ++i) {
    points.push_back(DrawFromPrior(model, random));
    likelihoods.push_back(LogLikelihood(model, y, points.back()));
  }
  double log_sum = -std::numeric_limits<double>::infinity();
  const auto add = [&](double term) {
    const double larger = std::max(log_sum, term);
    log_sum = larger + std::log(std::exp(log_sum - larger) + std::exp(term - larger));
  };
  double log_mass = 0;  // of the prior within the present contour
  for (int iteration = 0; iteration < 60 * kLive; ++iteration) {
    const auto worst = std::min_element(likelihoods.begin(), likelihoods.end());
    const double least = *worst;
    const double best = *std::max_element(likelihoods.begin(), likelihoods.end());
    if (best + log_mass < log_sum - 6) break;  // the rest adds less than 0.3 %
    const double next_mass = log_mass - 1.0 / kLive;
    add(least + log_mass + std::log(1 - std::exp(next_mass - log_mass)));
    log_mass = next_mass;
    int from = pick(random);
    while (likelihoods[from] <= least) from = pick(random);
    Eigen::VectorXd z = points[from];
    double likelihood = likelihoods[from], prior = LogPriorDensity(model, z);
    for (int step = 0; step < kSteps; ++step) {
      const double length = 2.4 / std::sqrt(2.0 * static_cast<double>(z.size())) * uniform(random);
      const Eigen::VectorXd moved = z + length * (points[pick(random)] - points[pick(random)]);
      const double moved_prior = LogPriorDensity(model, moved);
      if (std::log(uniform(random)) > moved_prior - prior) continue;
      const double moved_likelihood = LogLikelihood(model, y, moved);
      if (moved_likelihood <= least) continue;
      z = moved;
      likelihood = moved_likelihood;
      prior = moved_prior;
    }
    points[worst - likelihoods.begin()] = z;
    *worst = likelihood;
  }
  for (const double likelihood : likelihoods) add(likelihood + log_mass - std::log(kLive));
  return log_sum;
}

Eigen::MatrixXd WhitenedJacobian(const SmallModel& model, const Eigen::VectorXd& z) {
  constexpr double kStep = 1e-5;
  Eigen::MatrixXd jacobian(model.expectation(z).size(), z.size());
  for (Eigen::Index i = 0; i < z.size(); ++i) {
    Eigen::VectorXd lower = z, upper = z;
    lower[i] -= kStep;
    upper[i] += kStep;
    jacobian.col(i) = (model.expectation(upper) - model.expectation(lower)) / (2 * kStep * kNoise);
  }
  return jacobian;
}

// The fit as FitSet makes it: maximum of the posterior under FitPenalty, by Gauss and Newton.
FitResult FitOf(const SmallModel& model, const Eigen::VectorXd& y, Eigen::VectorXd z) {
  Eigen::MatrixXd jacobian, information;
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(z.size()), residual;
  for (int iteration = 0; iteration < 200; ++iteration) {
    jacobian = WhitenedJacobian(model, z);
    residual = (y - model.expectation(z)) / kNoise;
    for (Eigen::Index i = kNuisance; i < z.size(); ++i) weight[i] = FitPriorWeight(z[i]);
    information = jacobian.transpose() * jacobian;
    information.diagonal() += weight;
    z += 0.5 * information.ldlt().solve(jacobian.transpose() * residual - weight.cwiseProduct(z));
  }
  FitResult fit;
  fit.jacobian = {jacobian};
  fit.standardised = z;
  fit.prior_weight = weight;
  fit.chi_squared = residual.squaredNorm();
  fit.prior = z.head(kNuisance).squaredNorm();
  fit.data_count = static_cast<int>(y.size());
  fit.log_determinant = std::log(information.determinant());
  fit.covariance = information.inverse();
  return fit;
}

double LaplaceOver(const SmallModel& model, const SmallModel& null, const Eigen::VectorXd& y,
                   const Eigen::VectorXd& start) {
  Hypothesis hypothesis = MakeHypothesis(model.effects);
  hypothesis.fit = FitOf(model, y, start);
  for (size_t f = 0; f < hypothesis.free.size(); ++f) {
    const auto at = kNuisance + static_cast<Eigen::Index>(f);
    ActiveEffect& active = hypothesis.effects[f];
    active.parameters[0] =
        ParameterFromStandardised(ParameterOf(active), hypothesis.fit.standardised[at]);
    hypothesis.fit.effect_standard_errors.push_back(std::sqrt(hypothesis.fit.covariance(at, at)) *
                                                    ParameterOf(active).prior_scale);
  }
  const FitResult of_null = FitOf(null, y, Eigen::VectorXd::Zero(kNuisance));
  return EvidenceOver(hypothesis, of_null).LogMarginalLikelihood();
}

// Data of `truth` with noise; both evidences of `model` over the model without its effects.
void ExpectAgreement(const SmallModel& model, const Eigen::VectorXd& truth, double tolerance_nats) {
  const auto effects = static_cast<Eigen::Index>(model.effects.size());
  const SmallModel null = {[&](const Eigen::VectorXd& z) {
                             Eigen::VectorXd all = Eigen::VectorXd::Zero(kNuisance + effects);
                             all.head(kNuisance) = z;
                             return model.expectation(all);
                           },
                           {}};
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  Eigen::VectorXd y = model.expectation(truth);
  for (double& value : y) value += kNoise * normal(random);
  const double laplace = LaplaceOver(model, null, y, truth);
  const double nested = NestedSampling(model, y, 5) - NestedSampling(null, y, 6);
  EXPECT_GT(std::abs(nested), 3) << "the case tells nothing";
  EXPECT_NEAR(laplace, nested, tolerance_nats);
}

Eigen::ArrayXd Places() { return Eigen::ArrayXd::LinSpaced(40, 0, 1); }

ActiveEffect SomeEffect(bool one_sided, const Effect* but = nullptr) {
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    if (effect == but || description.parameters.size() != 1) continue;
    const EffectParameter& parameter = description.parameters[0];
    const bool fits = parameter.null_value == 0 && parameter.decades == 0 &&
                      parameter.discrete_values.empty() &&
                      (one_sided ? parameter.lower == 0 : parameter.lower < 0);
    if (fits) return {effect, {0}};
  }
  return {};
}

// Nested sampling scatters by 0.15 nats.
TEST(LogEvidence, AgreesWithNestedSamplingOnALinearModel) {
  const SmallModel line = {[](const Eigen::VectorXd& z) -> Eigen::VectorXd {
                             const Eigen::ArrayXd x = Places();
                             return (0.2 * z[0] + 0.2 * z[1] * x + 0.1 * z[2] * x.square());
                           },
                           {SomeEffect(false)}};
  ExpectAgreement(line, Eigen::Vector3d(0.5, -1, 3), 0.45);
}

TEST(LogEvidence, AgreesWithNestedSamplingOnASaturatingResponse) {
  const SmallModel response = {[](const Eigen::VectorXd& z) -> Eigen::VectorXd {
                                 const Eigen::ArrayXd light = std::exp(0.1 * z[0]) * Places();
                                 return light / (1 + 0.2 * z[2] * light) + 0.05 * z[1];
                               },
                               {SomeEffect(true)}};
  ExpectAgreement(response, Eigen::Vector3d(0.5, -1, 2), 0.45);
}

// Two effects of similar shape, each of which is bounded by its null value. `amplitude`: change by
// one standardised unit.
SmallModel CorrelatedPair(double amplitude) {
  const ActiveEffect first = SomeEffect(true);
  return {[amplitude](const Eigen::VectorXd& z) -> Eigen::VectorXd {
            const Eigen::ArrayXd x = Places();
            return 0.2 * z[0] + 0.2 * z[1] * x + amplitude * z[2] * x.square() +
                   amplitude * z[3] * x.square() * (0.5 + x);
          },
          {first, SomeEffect(true, first.effect)}};
}

// Laplace's approximation does not see the bounds and takes the prior as constant over the
// posterior's width. Its error stays below a third of the gain that counts as clear.
TEST(LogEvidence, IsWithinANatOfNestedSamplingForTwoCorrelatedEffects) {
  ExpectAgreement(CorrelatedPair(0.6), Eigen::Vector4d(0.5, -1, 1, 0.8), 1);
  ExpectAgreement(CorrelatedPair(0.2), Eigen::Vector4d(0.5, -1, 3, 2.5), 1);
}

}  // namespace
}  // namespace sightline
