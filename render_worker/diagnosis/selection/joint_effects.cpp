// SPDX-License-Identifier: Apache-2.0
// Effects besides effects: what is expected of them together.
#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/selection/candidate.h"
#include "render_worker/diagnosis/selection/competing.h"
#include "render_worker/diagnosis/selection/screening.h"

namespace sightline {
namespace {

constexpr size_t kPairs = 4;          // that are fitted; as many of three
constexpr double kMostAmplitude = 3;  // of an added effect, over that at which it was looked at

}  // namespace

bool Competing::Has(const Candidate& candidate, const Effect* effect) {
  return std::any_of(candidate.effects.begin(), candidate.effects.end(),
                     [&](const ActiveEffect& active) { return active.effect == effect; });
}

std::vector<ScreenedEffect> Competing::ScreenShapesBesides(const Candidate& base) {
  std::vector<ScreenedEffect> found;
  const Screening screening(model_, base.fit);
  for (const Effect* effect : expected_) {
    const std::vector<EffectParameter>& parameters = effect->description().parameters;
    const bool shaped = parameters.size() > 1 || !WholeNumbers(parameters[0]).empty();
    if (IsFreeForm(*effect) || !shaped) continue;
    if (!Report(0.75)) break;
    if (!Has(base, effect)) found.push_back(screening.Screen(*effect));
  }
  return found;
}

void Competing::AddJoints(const Candidate& base, const std::vector<ScreenedEffect>& besides,
                          std::vector<Joint>& joints) const {
  // What is held at a bound may be so for want of the effect.
  const LinearFit linear(base.fit, {}, LinearFit::Held::kFree);
  const Eigen::VectorXd residual = linear.ResidualAtBest();
  for (const ScreenedEffect& by_itself : competition_.screened) {
    const Effect* effect = by_itself.strongest.effect;
    if (IsFreeForm(*effect) || Has(base, effect)) continue;
    const auto again = std::find_if(besides.begin(), besides.end(), [&](const auto& screened) {
      return screened.strongest.effect == effect;
    });
    const ScreenedEffect& screened = again != besides.end() ? *again : by_itself;
    if (screened.change.size() == 0) continue;
    const double length = linear.Inner(screened.change, screened.change);
    if (length < 1e-6) continue;
    const double slope = residual.dot(screened.change);
    // Where the known parameters do nearly the same, a straight line leads far astray.
    const double amplitude = std::clamp(slope / length, -kMostAmplitude, kMostAmplitude);
    joints.push_back({&base, Scaled(screened.strongest, amplitude),
                      amplitude * (slope - 0.5 * amplitude * length)});
  }
}

void Competing::SortByTotal(std::vector<Joint>& joints) {
  const auto total = [](const Joint& joint) { return joint.base->log_evidence + joint.gain; };
  std::stable_sort(joints.begin(), joints.end(),
                   [&](const Joint& a, const Joint& b) { return total(a) > total(b); });
}

bool Competing::SameEffects(const Candidate& a, const Candidate& b) {
  return a.effects.size() == b.effects.size() &&
         std::all_of(a.effects.begin(), a.effects.end(),
                     [&](const ActiveEffect& active) { return Has(b, active.effect); });
}

ActiveEffect Competing::Scaled(ActiveEffect active, double amplitude) {
  const auto& parameters = active.effect->description().parameters;
  for (size_t k = 0; k < parameters.size(); ++k) {
    if (!WholeNumbers(parameters[k]).empty()) continue;
    const double z = StandardisedParameter(parameters[k], active.parameters[k]);
    active.parameters[k] = ParameterFromStandardised(parameters[k], z * amplitude);
  }
  return active;
}

void Competing::FitPairs() {
  size_t first = 0;
  for (int count = 2; count <= settings_.max_effects; ++count) {
    std::vector<Joint> joints;
    const size_t end = candidates_.size();
    size_t bases = 0;
    for (size_t c = first; c < end && bases < 4; ++c) {
      const Candidate& base = candidates_[c];
      if (IsFreeForm(base) || base.effects.size() + 1 != static_cast<size_t>(count)) continue;
      const bool best = count == 2 && bases == 0 && base.log_evidence > kPromising;
      ++bases;
      AddJoints(base, best ? ScreenShapesBesides(base) : std::vector<ScreenedEffect>(), joints);
    }
    SortByTotal(joints);
    std::vector<Candidate> made;
    for (const Joint& joint : joints) {
      if (made.size() == kPairs) break;
      if (joint.gain < kPairGain) continue;
      if (!Report(0.77 + 0.02 * static_cast<double>(made.size()))) return;
      std::vector<ActiveEffect> effects = joint.base->effects;
      effects.push_back(joint.added);
      Candidate candidate = MakeCandidate(std::move(effects));
      // Once, however they were put together.
      if (std::any_of(made.begin(), made.end(),
                      [&](const Candidate& other) { return SameEffects(other, candidate); })) {
        continue;
      }
      candidate.fit.parameters = joint.base->fit.parameters;
      candidate.fit.mean = joint.base->fit.mean;
      Fit(candidate, competition_.null, false, 4);
      // No base of further effects, if it leaves no light.
      if (std::isfinite(candidate.log_evidence)) made.push_back(std::move(candidate));
    }
    first = end;
    if (made.empty()) break;
    for (Candidate& candidate : made) candidates_.push_back(std::move(candidate));
  }
  SortByEvidence();
}

}  // namespace sightline
