// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/selection/stages/screen.h"

#include <Eigen/Core>
#include <algorithm>
#include <utility>

#include "render_worker/diagnosis/fit/linear_fit.h"
#include "render_worker/diagnosis/selection/thresholds.h"

namespace sightline {
namespace {

// `active` with its standardised parameters multiplied; discrete ones are kept.
ActiveEffect Scaled(ActiveEffect active, double amplitude) {
  const auto& parameters = active.effect->description().parameters;
  for (size_t k = 0; k < parameters.size(); ++k) {
    if (!parameters[k].discrete_values.empty()) continue;
    const double z = StandardisedParameter(parameters[k], active.parameters[k]);
    active.parameters[k] = ParameterFromStandardised(parameters[k], z * amplitude);
  }
  return active;
}

}  // namespace

ScreeningResult ScreenExpected(const Context& context, const Screening& about_null) {
  ScreeningResult result;
  const auto count = static_cast<double>(context.expected.size());
  for (size_t i = 0; i < context.expected.size(); ++i) {
    if (!context.proceed(0.5 * static_cast<double>(i) / count)) {
      result.stopped = true;
      break;
    }
    result.effects.push_back(about_null.Screen(*context.expected[i]));
  }
  return result;
}

ScreeningResult ScreenNamed(const Context& context, const Screening& screening, double fraction) {
  ScreeningResult result;
  for (const Effect* effect : context.expected) {
    if (IsFreeForm(*effect)) continue;
    if (!context.proceed(fraction)) {
      result.stopped = true;
      break;
    }
    result.effects.push_back(screening.Screen(*effect));
  }
  return result;
}

ScreeningResult ScreenShapes(const Context& context, const Hypothesis& base) {
  ScreeningResult result;
  const Screening screening(context.model, base.fit);
  for (const Effect* effect : context.expected) {
    const std::vector<EffectParameter>& parameters = effect->description().parameters;
    const bool shaped = parameters.size() > 1 || !parameters[0].discrete_values.empty();
    if (IsFreeForm(*effect) || !shaped) continue;
    if (!context.proceed(0.75)) {
      result.stopped = true;
      break;
    }
    if (!Has(base, effect)) result.effects.push_back(screening.Screen(*effect));
  }
  return result;
}

std::vector<JointEffect> JointGains(const Context& context, const Hypothesis& base,
                                    const std::vector<ScreenedEffect>& about_base) {
  std::vector<JointEffect> joints;
  // A parameter may be at its bound because the hypothesis lacks the effect.
  const LinearFit linear(base.fit, {}, LinearFit::ActiveBounds::kReleased);
  const Eigen::VectorXd residual = linear.ResidualAtBest();
  for (const ScreenedEffect& by_itself : context.screened) {
    const Effect* effect = by_itself.strongest.effect;
    if (IsFreeForm(*effect) || Has(base, effect)) continue;
    const auto again =
        std::find_if(about_base.begin(), about_base.end(),
                     [&](const auto& screened) { return screened.strongest.effect == effect; });
    const ScreenedEffect& screened = again != about_base.end() ? *again : by_itself;
    if (screened.change.size() == 0) continue;
    const double length = linear.Inner(screened.change, screened.change);
    if (length < thresholds::kAbsorbed) continue;
    const double slope = residual.dot(screened.change);
    // If the set-up's parameters do nearly the same, the linear prediction is far too large.
    const double amplitude =
        std::clamp(slope / length, -thresholds::kMostAmplitude, thresholds::kMostAmplitude);
    joints.push_back({&base, Scaled(screened.strongest, amplitude),
                      amplitude * (slope - 0.5 * amplitude * length)});
  }
  return joints;
}

std::vector<JointEffect> SortedByTotal(std::vector<JointEffect> joints) {
  const auto total = [](const JointEffect& joint) { return joint.base->log_evidence + joint.gain; };
  std::stable_sort(joints.begin(), joints.end(),
                   [&](const JointEffect& a, const JointEffect& b) { return total(a) > total(b); });
  return joints;
}

}  // namespace sightline
