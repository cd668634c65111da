// SPDX-License-Identifier: Apache-2.0
// What amplitudes change about a realisation, whitened and with the known parameters taken off.
#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <vector>

#include "render_worker/diagnosis/random_effect/realisation.h"
#include "render_worker/diagnosis/random_effect/scatter_evaluation.h"
#include "render_worker/diagnosis/random_effect/scatter_law.h"
#include "render_worker/diagnosis/random_effect/vibration_fit.h"

namespace sightline {

RecordingScatter::RecordingScatter(const SetModel& model, const FitResult& about,
                                   const Realisation& at, const FitResult& null)
    : model_(model), null_(about), at_(at), lit_(model) {
  offset_.push_back(0);
  for (const Eigen::VectorXd& mean : null.mean) {
    offset_.push_back(offset_.back() + static_cast<int>(mean.size()));
  }
  FindAmplitudesOfEntries();
  jacobian_ = null_.jacobian;
  for (size_t i = 0; i < null_.held.size(); ++i) {
    if (!null_.held[i]) continue;
    for (Eigen::MatrixXd& entry : jacobian_) entry.col(static_cast<Eigen::Index>(i)).setZero();
  }
  // At the best known parameters by the linearised model: the fit may stop short of them.
  Eigen::MatrixXd information = null.prior_weight.asDiagonal();
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(null.standardised.size());
  for (int e = 0; e < model.entries(); ++e) {
    const Eigen::MatrixXd& jacobian = jacobian_[e];
    const Eigen::VectorXd residual = null.residual[e] + jacobian * null.standardised;
    information.noalias() += jacobian.transpose() * jacobian;
    gradient.noalias() += jacobian.transpose() * residual;
    null_total_ += residual.squaredNorm() + null.whitening->LogDeterminant(e) -
                   about.whitening->LogDeterminant(e);
  }
  const Eigen::LLT<Eigen::MatrixXd> solver(information);
  null_total_ -= gradient.dot(solver.solve(gradient));
  null_total_ += 2 * solver.matrixLLT().diagonal().array().log().sum();
}

SetParameters RecordingScatter::WithRealisation(const SetParameters& parameters,
                                                const RealisedEffect& realised) {
  SetParameters all = parameters;
  all.effects.push_back({&realised, {}});
  return all;
}

Entries RecordingScatter::MeanOf(const Realisation& realisation, bool middle_only) {
  const RealisedEffect realised(realisation);
  return model_.Expect(WithRealisation(null_.parameters, realised), false, middle_only).mean;
}

void RecordingScatter::FindAmplitudesOfEntries() {
  block_ = BlocksOfEntries(model_);
  for (int e = 0; e < model_.entries(); ++e) position_.push_back(model_.PlatePositionOf(e));
}

Eigen::MatrixXd RecordingScatter::Derivative(const Realisation& at,
                                             std::vector<double> Realisation::*values, double step,
                                             const Entries& origin, bool middle_only) {
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(rows(), lit());
  for (int slot = 0; slot < lit_.slots(); ++slot) {
    Realisation moved = at;
    for (int i = 0; i < lit(); ++i) {
      if (lit_.SlotOf(i) == slot) (moved.*values)[lit_.frames()[i]] += step;
    }
    const Entries mean = MeanOf(moved, middle_only);
    const std::vector<int> recordings = lit_.RecordingsOfEntries(slot);
    for (int e = 0; e < model_.entries(); ++e) {
      if (recordings[e] < 0) continue;
      change.col(recordings[e]).segment(offset_[e], mean[e].size()) =
          (*null_.whitening)(e, (mean[e] - origin[e]) / step);
    }
  }
  return change;
}

Eigen::VectorXd RecordingScatter::ReflectanceOf(const Realisation& at) const {
  const int blocks = model_.blocks_along_line();
  const std::vector<int>& ids = model_.position_ids();
  Eigen::VectorXd reflectance =
      Eigen::VectorXd::Zero(blocks * static_cast<Eigen::Index>(ids.size()));
  if (at.blocks.empty()) return reflectance;
  for (const int f : lit_.frames()) {
    const Eigen::Index position = PositionIndex(model_, model_.set().frames[f].plate_position_id);
    for (int block = 0; block < blocks; ++block) {
      reflectance[position * blocks + block] =
          (1 + at.light_relative[f]) * (1 + at.blocks[f].light_relative[block]) - 1;
    }
  }
  return reflectance;
}

Eigen::MatrixXd RecordingScatter::ReflectanceOfLight(const Realisation& at,
                                                     const Eigen::MatrixXd& light) const {
  const int blocks = model_.blocks_along_line();
  const std::vector<int>& ids = model_.position_ids();
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(rows(), blocks * ids.size());
  for (int e = 0; e < model_.entries(); ++e) {
    if (position_[e] < 0) continue;
    const Eigen::Index position = PositionIndex(model_, position_[e]);
    const int size = offset_[e + 1] - offset_[e];
    Eigen::VectorXd sum = light.middleRows(offset_[e], size).rowwise().sum();
    for (int block = 0; block < blocks; ++block) {
      if (block_[e] >= 0 && block != block_[e]) continue;
      if (block_[e] >= 0 && !at.blocks.empty()) {
        sum /= 1 + at.blocks[model_.FramesOf(e).front()].light_relative[block];
      }
      change.col(position * blocks + block).segment(offset_[e], size) =
          block_[e] >= 0 ? sum : Eigen::VectorXd(sum / blocks);
    }
  }
  return change;
}

Eigen::MatrixXd RecordingScatter::ChangeByLightWithinBlocks(const Realisation& at,
                                                            const Entries& origin) {
  constexpr double kVariance = 1e-2;
  SetParameters varied = null_.parameters;
  const Effect* const texture = FindEffect("surface.albedo_texture");
  varied.effects.push_back({texture, {std::sqrt(kVariance), 1e-3}});
  const RealisedEffect realised(at);
  const Entries mean = model_.Expect(WithRealisation(varied, realised), false).mean;
  const Eigen::VectorXd variance =
      ScatterLawOf(texture->description().id, model_).within(varied.effects.back().parameters, {});
  Eigen::MatrixXd change = Eigen::MatrixXd::Zero(rows(), lit());
  for (int e = 0; e < model_.entries(); ++e) {
    if (model_.StatisticOf(e).name() != "texture") continue;
    const std::vector<int>& frames = lit_.frames();
    const auto i =
        std::find(frames.begin(), frames.end(), model_.FramesOf(e).front()) - frames.begin();
    change.col(i).segment(offset_[e], mean[e].size()) =
        (*null_.whitening)(e, (mean[e] - origin[e]) / variance[i]);
  }
  return change;
}

Eigen::MatrixXd RecordingScatter::SumAtPositions(const Eigen::MatrixXd& of_recordings) const {
  const std::vector<int>& ids = model_.position_ids();
  Eigen::MatrixXd sums = Eigen::MatrixXd::Zero(rows(), static_cast<Eigen::Index>(ids.size()));
  for (int i = 0; i < lit(); ++i) {
    const int id = model_.set().frames[lit_.frames()[i]].plate_position_id;
    sums.col(PositionIndex(model_, id)) += of_recordings.col(i);
  }
  return sums;
}

Eigen::MatrixXd RecordingScatter::NullCovariance(int e) const {
  const Eigen::Index n = offset_[e + 1] - offset_[e];
  Eigen::MatrixXd inverse(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    inverse.col(i) = (*null_.whitening)(e, Eigen::VectorXd::Unit(n, i));
  }
  const Eigen::MatrixXd factor =
      inverse.triangularView<Eigen::Lower>().solve(Eigen::MatrixXd::Identity(n, n));
  return factor * factor.transpose();
}

Linearisation RecordingScatter::Linearise(Amplitude amplitude, const Realisation& at) {
  Linearisation linear;
  const Entries mean = MeanOf(at, false);
  const Entries middle = at.blocks.empty() ? MeanOf(at, true) : mean;
  linear.residual.resize(rows());
  linear.jacobian.resize(rows(), null_.standardised.size());
  for (int e = 0; e < model_.entries(); ++e) {
    const int n = offset_[e + 1] - offset_[e];
    linear.residual.segment(offset_[e], n) = (*null_.whitening)(e, model_.observed()[e] - mean[e]);
    linear.jacobian.middleRows(offset_[e], n) = jacobian_[e];
  }
  if (amplitude == Amplitude::kShift) {
    linear.change = Derivative(at, &Realisation::shift_px, 0.1, middle);
    linear.within = Derivative(at, &Realisation::blur_px2, 0.1, middle);
    linear.origin = AtLit(at.shift_px);
    linear.within_origin = AtLit(at.blur_px2);
    RenewCovariance(at, linear);
  } else if (amplitude == Amplitude::kLight) {
    linear.change = Derivative(at, &Realisation::light_relative, 0.02, middle);
    linear.origin = AtLit(at.light_relative);
  } else {
    const Eigen::MatrixXd light =
        Derivative(at, &Realisation::light_relative, 0.02, middle, at.blocks.empty());
    const Eigen::MatrixXd reflectance = ReflectanceOfLight(at, light);
    linear.within = ChangeByLightWithinBlocks(at, mean);
    linear.within_origin = Eigen::VectorXd::Zero(lit());
    const Eigen::MatrixXd varied = SumAtPositions(linear.within);
    linear.change.resize(rows(), reflectance.cols() + varied.cols());
    linear.change << reflectance, varied;
    linear.origin.resize(linear.change.cols());
    linear.origin << ReflectanceOf(at), Eigen::VectorXd::Zero(varied.cols());
  }
  linear.residual += linear.jacobian * null_.standardised + linear.change * linear.origin;
  Project(linear);
  return linear;
}

Eigen::VectorXd RecordingScatter::AtLit(const std::vector<double>& values) const {
  Eigen::VectorXd lit_values(lit());
  for (int i = 0; i < lit(); ++i) lit_values[i] = values[lit_.frames()[i]];
  return lit_values;
}

void RecordingScatter::RenewCovariance(const Realisation& at, Linearisation& linear) {
  const RealisedEffect realised(at);
  const std::vector<Eigen::MatrixXd> covariance =
      model_.Expect(WithRealisation(null_.parameters, realised), true, true).covariance;
  const RealisedEffect known(at_);
  const std::vector<Eigen::MatrixXd> before =
      model_.Expect(WithRealisation(null_.parameters, known), true, true).covariance;
  for (int e = 0; e < model_.entries(); ++e) {
    if (!ChangesCovariance(e)) continue;
    const int n = offset_[e + 1] - offset_[e];
    const Eigen::MatrixXd null_covariance = NullCovariance(e);
    Eigen::MatrixXd renewed = null_covariance;
    renewed.diagonal() += (covariance[e] - before[e]).diagonal().cwiseMax(0);
    const Eigen::LLT<Eigen::MatrixXd> old_factor(null_covariance), new_factor(renewed);
    const Eigen::MatrixXd old_lower = old_factor.matrixL();
    const auto again = [&](auto block) {
      const Eigen::MatrixXd raw = old_lower * block;
      block = new_factor.matrixL().solve(raw);
    };
    again(linear.residual.segment(offset_[e], n));
    again(linear.jacobian.middleRows(offset_[e], n));
    again(linear.change.middleRows(offset_[e], n));
    again(linear.within.middleRows(offset_[e], n));
    linear.covariance[e] = renewed;
    linear.log_determinant += 2 * (new_factor.matrixLLT().diagonal().array().log().sum() -
                                   old_factor.matrixLLT().diagonal().array().log().sum());
  }
}

void RecordingScatter::Project(Linearisation& linear) const {
  Eigen::MatrixXd information = null_.prior_weight.asDiagonal();
  information.noalias() += linear.jacobian.transpose() * linear.jacobian;
  linear.information.compute(information);
  const auto project = [&](const Eigen::MatrixXd& v) -> Eigen::MatrixXd {
    return v - linear.jacobian * linear.information.solve(linear.jacobian.transpose() * v);
  };
  const Eigen::VectorXd residual = project(linear.residual);
  const Eigen::MatrixXd change = project(linear.change);
  linear.inner.noalias() = linear.change.transpose() * change;
  linear.slope = linear.change.transpose() * residual;
  linear.length = linear.residual.dot(residual);
  if (linear.within.size() == 0) return;
  const Eigen::MatrixXd within = project(linear.within);
  linear.within_inner.noalias() = linear.within.transpose() * within;
  linear.within_cross.noalias() = linear.change.transpose() * within;
  linear.within_slope = linear.within.transpose() * residual;
}

// Strong movement is seen in every recording by itself. What a law that is not the right one says
// of it would keep the next linearisation where that law belongs.
Linearisation RecordingScatter::LineariseAboutFreeMovement(Linearisation linear) {
  constexpr int kTurns = 3;
  constexpr double kLargestStep_px = 0.5, kLargestStep_px2 = 0.5;  // a profile is far from linear
  for (int turn = 0; turn < kTurns; ++turn) {
    const std::vector<RecordedMovement> movements = MovementOf(linear);
    Realisation realisation(model_.set().frames.size());
    for (int i = 0; i < lit(); ++i) {
      realisation.shift_px[lit_.frames()[i]] =
          linear.origin[i] +
          std::clamp(movements[i].shift_px - linear.origin[i], -kLargestStep_px, kLargestStep_px);
      realisation.blur_px2[lit_.frames()[i]] =
          linear.within_origin[i] + std::clamp(movements[i].blur_px2 - linear.within_origin[i],
                                               -kLargestStep_px2, kLargestStep_px2);
    }
    linear = Linearise(Amplitude::kShift, realisation);
  }
  return linear;
}

}  // namespace sightline
