// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/linearised_set.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <utility>

#include "render_worker/effects/described_effect.h"

namespace sightline {

namespace {

// Steps of the finite differences: small against what is nonlinear, large against rounding.
constexpr double kShiftStep_px = 0.1, kBlurStep_px2 = 0.1, kLightStep = 0.02;

// A texture of given strength, whose only action is the variance of light along segments that the
// expectation of the frame gives it.
class ProbingTexture final : public DescribedEffect {
 public:
  static constexpr RandomLaw kLaw = RandomLaw::kGaussianReflectance;
  ProbingTexture()
      : DescribedEffect({.id = "probing_texture",
                         .stage = Stage::kSurface,
                         .kind = EffectKind::kRandomPerPlace,
                         .random_law = kLaw,
                         .summary = "texture with a Gaussian autocorrelation",
                         .reference = "",
                         .parameters = {}}) {}
};

// Values of the recordings with laser light.
Eigen::VectorXd AtLit(const LinearisationBasis& basis, const std::vector<double>& values) {
  Eigen::VectorXd lit_values(basis.recordings());
  for (int i = 0; i < basis.recordings(); ++i) lit_values[i] = values[basis.lit.frames()[i]];
  return lit_values;
}

SetParameters With(const SetParameters& parameters, const RealisedEffect& realised) {
  SetParameters all = parameters;
  all.effects.push_back({&realised, {}});
  return all;
}

// The expectation at a linearisation point, from which finite differences start.
struct Origin {
  ExpectedSet strips;
  BlockVectors mean;
};

// Whitened change of all components per unit of what `values` holds for each recording with laser
// light. `origin`: the expectation at `at`. Recordings of different plate positions are moved
// together, since they show in different blocks; those that do not move keep their frames.
Eigen::MatrixXd Derivative(const LinearisationBasis& basis, const Realisation& at,
                           std::vector<double> Realisation::*values, double step,
                           const Origin& origin, bool middle_only = true) {
  const LitRecordings& lit = basis.lit;
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(basis.components(), basis.recordings());
  for (int slot = 0; slot < lit.slots(); ++slot) {
    Realisation moved = at;
    std::vector<bool> changed(basis.model.set().frames.size(), false);
    for (int i = 0; i < basis.recordings(); ++i) {
      if (lit.SlotOf(i) != slot) continue;
      (moved.*values)[lit.frames()[i]] += step;
      changed[lit.frames()[i]] = true;
    }
    const std::vector<int> recordings = lit.RecordingsOfEntries(slot);
    std::vector<bool> use;
    for (const int recording : recordings) use.push_back(recording >= 0);
    const RealisedEffect realised(moved);
    const SetModel::ChangedRecordings only{origin.strips, std::move(changed)};
    const BlockVectors mean = basis.model.MeanOf(
        basis.model.ExpectStrips(With(basis.fit.parameters, realised), middle_only, &only), use);
    for (int e = 0; e < basis.model.blocks(); ++e) {
      if (!use[e]) continue;
      change.col(recordings[e]).segment(basis.offset[e], mean[e].size()) =
          (*basis.fit.whitening)(e, (mean[e] - origin.mean[e]) / step);
    }
  }
  return change;
}

// Reflectances of the segments at all plate positions, relative to the expected ones, minus 1.
Eigen::VectorXd ReflectanceOf(const LinearisationBasis& basis, const Realisation& at) {
  const int segments = basis.model.blocks_along_line();
  const std::vector<int>& ids = basis.model.position_ids();
  Eigen::VectorXd reflectance =
      Eigen::VectorXd::Zero(segments * static_cast<Eigen::Index>(ids.size()));
  if (at.blocks.empty()) return reflectance;
  for (const int f : basis.lit.frames()) {
    const Eigen::Index position =
        PositionIndex(basis.model, basis.model.set().frames[f].plate_position_id);
    for (int s = 0; s < segments; ++s) {
      reflectance[position * segments + s] =
          (1 + at.light_relative[f]) * (1 + at.blocks[f].light_relative[s]) - 1;
    }
  }
  return reflectance;
}

// Change per unit of the reflectance of every segment, from `light`, the change per unit of every
// recording's light.
Eigen::MatrixXd ReflectanceChange(const LinearisationBasis& basis, const Realisation& at,
                                  const Eigen::MatrixXd& light) {
  const int segments = basis.model.blocks_along_line();
  const std::vector<int>& ids = basis.model.position_ids();
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(basis.components(), segments * ids.size());
  for (int e = 0; e < basis.model.blocks(); ++e) {
    if (basis.position[e] < 0) continue;
    const Eigen::Index position = PositionIndex(basis.model, basis.position[e]);
    const int of_one = basis.segment[e];
    Eigen::VectorXd sum = light.middleRows(basis.offset[e], basis.size(e)).rowwise().sum();
    for (int s = 0; s < segments; ++s) {
      if (of_one >= 0 && s != of_one) continue;
      if (of_one >= 0 && !at.blocks.empty()) {
        sum /= 1 + at.blocks[basis.model.FramesOf(e).front()].light_relative[s];
      }
      change.col(position * segments + s).segment(basis.offset[e], basis.size(e)) =
          of_one >= 0 ? sum : Eigen::VectorXd(sum / segments);
    }
  }
  return change;
}

// Change per unit of the relative variance of light within the segments of every recording with
// laser light; only the variance of that recording's speckle contains it. `mean`: the expectation
// at `at`.
Eigen::MatrixXd VarianceWithinChange(const LinearisationBasis& basis, const Realisation& at,
                                     const BlockVectors& mean) {
  constexpr double kVariance = 1e-2, kCorrelation_m = 1e-3;
  const ProbingTexture texture;
  const std::vector<double> parameters = {std::sqrt(kVariance), kCorrelation_m};
  SetParameters varied = basis.fit.parameters;
  varied.effects.push_back({&texture, parameters});
  const BlockVectors changed = ExpectAt(basis.model, varied, at, false).mean;
  const Eigen::VectorXd variance =
      MakeRandomEffect(ProbingTexture::kLaw, basis.model)->VarianceWithin(parameters, {});
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(basis.components(), basis.recordings());
  for (int e = 0; e < basis.model.blocks(); ++e) {
    if (basis.model.StatisticOf(e).kind() != StatisticKind::kTexture) continue;
    const std::vector<int>& frames = basis.lit.frames();
    const auto i =
        std::find(frames.begin(), frames.end(), basis.model.FramesOf(e).front()) - frames.begin();
    change.col(i).segment(basis.offset[e], changed[e].size()) =
        (*basis.fit.whitening)(e, (changed[e] - mean[e]) / variance[i]);
  }
  return change;
}

// Columns of the recordings, summed over those of each plate position.
Eigen::MatrixXd SumAtPositions(const LinearisationBasis& basis,
                               const Eigen::MatrixXd& of_recordings) {
  const std::vector<int>& ids = basis.model.position_ids();
  Eigen::MatrixXd sums =
      Eigen::MatrixXd::Zero(basis.components(), static_cast<Eigen::Index>(ids.size()));
  for (int i = 0; i < basis.recordings(); ++i) {
    const int id = basis.model.set().frames[basis.lit.frames()[i]].plate_position_id;
    sums.col(PositionIndex(basis.model, id)) += of_recordings.col(i);
  }
  return sums;
}

// Movement changes how alike the speckle of two recordings is. The expected change is uncertain,
// which the fit's covariance does not contain: the blocks that compare speckle get a larger one,
// and everything is whitened by it.
void RenewCovariance(const LinearisationBasis& basis, const Realisation& at,
                     LinearisedSet& linear) {
  const SetModel& model = basis.model;
  const std::vector<Eigen::MatrixXd> covariance =
      ExpectAt(model, basis.fit.parameters, at, true, true).covariance;
  const std::vector<Eigen::MatrixXd> before =
      ExpectAt(model, basis.fit.parameters, basis.fitted_at, true, true).covariance;
  for (int e = 0; e < model.blocks(); ++e) {
    if (basis.position[e] < 0 || !model.StatisticOf(e).compares_speckle()) continue;
    const int n = basis.size(e);
    const Eigen::MatrixXd fitted = CovarianceOfBlock(basis, e);
    Eigen::MatrixXd renewed = fitted;
    renewed.diagonal() += (covariance[e] - before[e]).diagonal().cwiseMax(0);
    const Eigen::LLT<Eigen::MatrixXd> old_factor(fitted), new_factor(renewed);
    const Eigen::MatrixXd old_lower = old_factor.matrixL();
    const auto whiten_again = [&](auto block) {
      const Eigen::MatrixXd raw = old_lower * block;
      block = new_factor.matrixL().solve(raw);
    };
    whiten_again(linear.model.residual.segment(basis.offset[e], n));
    whiten_again(linear.model.nuisance.middleRows(basis.offset[e], n));
    whiten_again(linear.model.change.middleRows(basis.offset[e], n));
    whiten_again(linear.model.offset_change.middleRows(basis.offset[e], n));
    linear.covariance[e] = renewed;
    linear.model.log_determinant += 2 * (new_factor.matrixLLT().diagonal().array().log().sum() -
                                         old_factor.matrixLLT().diagonal().array().log().sum());
  }
}

void LineariseReflectance(const LinearisationBasis& basis, const Realisation& at,
                          const BlockVectors& mean, const Origin& middle, LinearisedSet& linear) {
  const Eigen::MatrixXd light =
      Derivative(basis, at, &Realisation::light_relative, kLightStep, middle, at.blocks.empty());
  const Eigen::MatrixXd reflectance = ReflectanceChange(basis, at, light);
  linear.model.offset_change = VarianceWithinChange(basis, at, mean);
  linear.variance_within = Eigen::VectorXd::Zero(basis.recordings());
  const Eigen::MatrixXd varied = SumAtPositions(basis, linear.model.offset_change);
  linear.model.change.resize(basis.components(), reflectance.cols() + varied.cols());
  linear.model.change << reflectance, varied;
  linear.amplitudes.resize(linear.model.change.cols());
  linear.amplitudes << ReflectanceOf(basis, at), Eigen::VectorXd::Zero(varied.cols());
}

}  // namespace

SetModel::Expectation ExpectAt(const SetModel& model, const SetParameters& parameters,
                               const Realisation& realisation, bool with_covariance,
                               bool middle_only) {
  const RealisedEffect realised(realisation);
  return model.Expect(With(parameters, realised), with_covariance, middle_only);
}

Eigen::MatrixXd CovarianceOfBlock(const LinearisationBasis& basis, int block) {
  const Eigen::Index n = basis.size(block);
  Eigen::MatrixXd inverse(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    inverse.col(i) = (*basis.fit.whitening)(block, Eigen::VectorXd::Unit(n, i));
  }
  const Eigen::MatrixXd factor =
      inverse.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(n, n));
  return factor * factor.transpose();
}

LinearisationBasis MakeBasis(const SetModel& model, const FitResult& fit,
                             const Realisation& fitted_at, const FitResult& null) {
  LinearisationBasis basis{.model = model,
                           .fit = fit,
                           .fitted_at = fitted_at,
                           .jacobian = fit.jacobian,
                           .offset = {0},
                           .position = {},
                           .segment = BlocksOfEntries(model),
                           .lit = LitRecordings(model)};
  for (const Eigen::VectorXd& mean : null.mean) {
    basis.offset.push_back(basis.offset.back() + static_cast<int>(mean.size()));
  }
  for (int e = 0; e < model.blocks(); ++e) basis.position.push_back(PlatePositionOf(model, e));
  for (size_t i = 0; i < fit.at_bound.size(); ++i) {
    if (!fit.at_bound[i]) continue;
    for (Eigen::MatrixXd& block : basis.jacobian) block.col(static_cast<Eigen::Index>(i)).setZero();
  }
  // A fit may stop short of its minimum, so the reference is the minimum of the linearised model.
  Eigen::MatrixXd information = null.prior_weight.asDiagonal();
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(null.standardised.size());
  for (int e = 0; e < model.blocks(); ++e) {
    const Eigen::MatrixXd& jacobian = basis.jacobian[e];
    const Eigen::VectorXd residual = null.residual[e] + jacobian * null.standardised;
    information.noalias() += jacobian.transpose() * jacobian;
    gradient.noalias() += jacobian.transpose() * residual;
    basis.reference += residual.squaredNorm() + null.whitening->LogDeterminant(e) -
                       fit.whitening->LogDeterminant(e);
  }
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  basis.reference -= gradient.dot(solver.solve(gradient));
  basis.reference += 2 * solver.matrixLLT().diagonal().array().log().sum();
  return basis;
}

LinearisedSet Linearise(const LinearisationBasis& basis, Amplitude amplitude,
                        const Realisation& at) {
  const SetModel& model = basis.model;
  const RealisedEffect realised(at);
  const SetParameters parameters = With(basis.fit.parameters, realised);
  // Segments that differ cannot be replaced by the middle one.
  Origin middle{.strips = model.ExpectStrips(parameters, false), .mean = {}};
  const BlockVectors mean = model.MeanOf(middle.strips, {});
  if (at.blocks.empty()) middle.strips = model.ExpectStrips(parameters, true);
  middle.mean = at.blocks.empty() ? model.MeanOf(middle.strips, {}) : mean;
  LinearisedSet linear;
  linear.model.nuisance_weight = basis.fit.prior_weight;
  linear.model.residual.resize(basis.components());
  linear.model.nuisance.resize(basis.components(), basis.fit.standardised.size());
  for (int e = 0; e < model.blocks(); ++e) {
    linear.model.residual.segment(basis.offset[e], basis.size(e)) =
        (*basis.fit.whitening)(e, model.observed()[e] - mean[e]);
    linear.model.nuisance.middleRows(basis.offset[e], basis.size(e)) = basis.jacobian[e];
  }
  switch (amplitude) {
    case Amplitude::kShift:
      linear.model.change = Derivative(basis, at, &Realisation::shift_px, kShiftStep_px, middle);
      linear.model.offset_change =
          Derivative(basis, at, &Realisation::blur_px2, kBlurStep_px2, middle);
      linear.amplitudes = AtLit(basis, at.shift_px);
      linear.variance_within = AtLit(basis, at.blur_px2);
      RenewCovariance(basis, at, linear);
      break;
    case Amplitude::kLight:
      linear.model.change = Derivative(basis, at, &Realisation::light_relative, kLightStep, middle);
      linear.amplitudes = AtLit(basis, at.light_relative);
      break;
    case Amplitude::kReflectance:
      LineariseReflectance(basis, at, mean, middle, linear);
      break;
  }
  linear.model.residual +=
      linear.model.nuisance * basis.fit.standardised + linear.model.change * linear.amplitudes;
  linear.projected = ProjectOutNuisance(linear.model);
  return linear;
}

}  // namespace sightline
