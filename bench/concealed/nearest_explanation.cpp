// SPDX-License-Identifier: Apache-2.0
#include "bench/concealed/nearest_explanation.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "render_worker/diagnosis/fit/fit.h"
#include "render_worker/diagnosis/fit/power.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"

namespace sightline::bench {
namespace {

Eigen::VectorXd Stacked(const std::vector<Eigen::VectorXd>& blocks) {
  Eigen::Index size = 0;
  for (const Eigen::VectorXd& block : blocks) size += block.size();
  Eigen::VectorXd all(size);
  Eigen::Index at = 0;
  for (const Eigen::VectorXd& block : blocks) {
    all.segment(at, block.size()) = block;
    at += block.size();
  }
  return all;
}

// Changes of the expectation that are left after the set-up's parameters have been refitted, in the
// linearised model: d - J (J'J + W)^-1 J' d.
class LinearChanges {
 public:
  LinearChanges(const SetModel& model, const SetParameters& at)
      : model_(model), null_(LineariseSet(model, at)) {
    Eigen::Index rows = 0;
    for (const Eigen::MatrixXd& block : null_.jacobian) rows += block.rows();
    jacobian_.resize(rows, null_.prior_weight.size());
    Eigen::Index row = 0;
    for (const Eigen::MatrixXd& block : null_.jacobian) {
      if (block.rows() == 0) continue;
      jacobian_.middleRows(row, block.rows()) = block;
      row += block.rows();
    }
    Eigen::MatrixXd information = jacobian_.transpose() * jacobian_;
    information.diagonal() += null_.prior_weight;
    information_.compute(information);
  }

  // nullopt: the effects are beyond sense (a closed pupil).
  std::optional<Eigen::VectorXd> Left(const std::vector<ActiveEffect>& effects) const {
    SetParameters with = null_.parameters;
    with.effects = effects;
    const BlockVectors mean = model_.Expect(with, false).mean;
    BlockVectors change(mean.size());
    for (size_t e = 0; e < mean.size(); ++e) {
      change[e] = (*null_.whitening)(static_cast<int>(e), mean[e] - null_.mean[e]);
    }
    Eigen::VectorXd d = Stacked(change);
    if (!d.allFinite()) return std::nullopt;
    d -= jacobian_ * information_.solve(jacobian_.transpose() * d);
    return d;
  }

 private:
  const SetModel& model_;
  FitResult null_;
  Eigen::MatrixXd jacobian_;
  Eigen::LLT<Eigen::MatrixXd> information_;
};

// Parameter vectors from which an effect is tried: shapes one at a time, each with several
// strengths of either sign.
std::vector<std::vector<double>> Starts(const EffectDescription& effect) {
  constexpr size_t kMostShapes = 16;
  std::vector<double> typical;
  for (const EffectParameter& parameter : effect.parameters)
    typical.push_back(parameter.null_value);
  std::vector<std::vector<double>> shapes = {typical};
  for (size_t k = 1; k < typical.size(); ++k) {
    for (const double start : effect.parameters[k].starts) {
      if (shapes.size() == kMostShapes) break;
      shapes.push_back(typical);
      shapes.back()[k] = start;
    }
  }
  std::vector<std::vector<double>> starts;
  for (size_t strength = 0; strength < typical.size(); ++strength) {
    const EffectParameter& parameter = effect.parameters[strength];
    std::vector<double> values = parameter.discrete_values;
    if (values.empty()) {
      for (const double scales : {-3., -1., -0.2, 0.2, 1., 3.}) {
        values.push_back(parameter.null_value + scales * parameter.prior_scale);
      }
    }
    for (const std::vector<double>& shape : shapes) {
      for (const double value : values) {
        if (value < parameter.lower || value > parameter.upper) continue;
        starts.push_back(shape);
        starts.back()[strength] = value;
      }
      if (strength > 0) break;  // shapes are varied with the first strength only
    }
  }
  return starts;
}

struct Candidate {
  ActiveEffect start;
  double explained_nats = 0;  // of the linearised model
};

// The start from which an effect explains most of `change` if its strength may be scaled.
Candidate BestStart(const Effect& effect, const LinearChanges& changes,
                    const Eigen::VectorXd& change) {
  Candidate best;
  for (std::vector<double>& start : Starts(effect.description())) {
    const auto d = changes.Left({{&effect, start}});
    if (!d || d->squaredNorm() < 1e-12) continue;
    const double scale = std::min(3.0, d->dot(change) / d->squaredNorm());
    const double explained = scale * d->dot(change) - 0.5 * scale * scale * d->squaredNorm();
    if (scale > 0 && explained > best.explained_nats) {
      best = {{&effect, std::move(start)}, explained};
    }
  }
  return best;
}

}  // namespace

Distinguishability NearestExplanation(const RecordedSet& set,
                                      const std::vector<ActiveEffect>& truth,
                                      const SetParameters& at,
                                      const std::vector<std::string>& not_these,
                                      const NearestSettings& settings) {
  SetModelSettings model_settings;
  model_settings.threads = settings.threads;
  const SetModel model(set, model_settings);
  const LinearChanges changes(model, at);
  const auto change = changes.Left(truth);

  std::vector<Candidate> candidates;
  for (const Effect* effect : AllEffects()) {
    const EffectDescription& description = effect->description();
    const bool is_truth =
        std::find(not_these.begin(), not_these.end(), description.id) != not_these.end();
    if (is_truth || !change || HasRandomLaw(*effect) || !description.plates_can_show_it) continue;
    Candidate candidate = BestStart(*effect, changes, *change);
    if (candidate.start.effect != nullptr) candidates.push_back(std::move(candidate));
  }
  std::stable_sort(candidates.begin(), candidates.end(), [](const auto& a, const auto& b) {
    return a.explained_nats > b.explained_nats;
  });

  const NullInformation information(set, model_settings, at);
  const double none = information.ExpectedGain({});  // deviations moved towards the nominal ones
  Distinguishability result;
  result.gain_nats = std::max(0.0, information.ExpectedGain(truth) - none);
  result.others.push_back({nullptr, result.gain_nats});
  const size_t refits = std::min(candidates.size(), static_cast<size_t>(settings.refits));
  for (size_t i = 0; i < refits; ++i) {
    const double left = information.GainLeft(truth, {candidates[i].start}) - none;
    result.others.push_back({candidates[i].start.effect, std::max(0.0, left)});
  }
  std::stable_sort(result.others.begin(), result.others.end(),
                   [](const auto& a, const auto& b) { return a.left_nats < b.left_nats; });
  return result;
}

std::string_view BinOfNats(double nats) { return nats < 3 ? "< 3" : nats <= 10 ? "3-10" : "> 10"; }

}  // namespace sightline::bench
