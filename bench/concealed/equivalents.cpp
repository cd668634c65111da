#include "bench/concealed/equivalents.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

namespace sightline::bench {
namespace {

// Gain [nats] at which changes are linear in the strength.
constexpr double kWeakGain = 1;
// Linear share from which a closer look is worth it.
constexpr double kNear = 0.7;

constexpr std::array<std::string_view, 4> kAmplitude = {
    "illumination.power_error", "surface.albedo_error", "optics.transmission_error",
    "sensor.qe_error"};

}  // namespace

std::vector<std::string> PhysicallyEquivalent(const ActiveEffect& effect, const Sensor& camera) {
  const std::string_view id = effect.effect->description().id;
  std::vector<std::string> ids;
  const auto add = [&](std::string_view other) {
    if (other != id) ids.emplace_back(other);
  };
  const bool product = std::find(kAmplitude.begin(), kAmplitude.end(), id) != kAmplitude.end();
  // A Bayer sensor's efficiencies may differ: then no common factor stands for them.
  if (product && (id != "sensor.qe_error" || camera.colour_filter == ColourFilter::kMono)) {
    for (const std::string_view other : kAmplitude) add(other);
  }
  if (id == "sensor.response_nonlinearity") add("sensor.adc_inl");
  if (id == "surface.depolarisation") add("illumination.partial_coherence");
  // Up to two equally strong patterns are also what partly polarised light makes.
  if (id == "illumination.partial_coherence" && effect.parameters[0] <= 2) {
    add("surface.depolarisation");
  }
  return ids;
}

Alternatives::Alternatives(ChangeModel model, const Sensor& camera)
    : model_(std::move(model)), camera_(camera) {}

double Alternatives::Gain(const Eigen::VectorXd& change) const {
  return 0.5 * change.dot(model_.project(change));
}

Alternatives::Direction Alternatives::Weak(const EffectFamily& family) const {
  Direction direction;
  direction.family = family;
  if (family.geometric) {
    // Nothing happens until the rim or the well comes into play.
    const ExpectedGain gain = [this](const std::vector<ActiveEffect>& effects) {
      return Gain(model_.change(effects));
    };
    direction.scale = ScaleToGain(family, gain, kWeakGain).scale;
  } else {
    direction.scale = std::min(0.1, family.largest_scale);
  }
  for (int i = 0; i < 3; ++i) {
    direction.change = model_.change({family.At(direction.scale)});
    const double gain = Gain(direction.change);
    if ((gain > 0.2 * kWeakGain && gain < 5 * kWeakGain) || !(gain > 1e-6) || family.geometric) {
      break;
    }
    direction.scale = std::min(family.largest_scale, direction.scale * std::sqrt(kWeakGain / gain));
  }
  direction.projected = model_.project(direction.change);
  return direction;
}

const std::vector<std::vector<Alternatives::Direction>>& Alternatives::DirectionsOf(
    const Effect& effect) {
  const auto [known, fresh] = directions_.try_emplace(&effect);
  if (!fresh) return known->second;
  constexpr int kShapes = 3;
  for (const std::vector<EffectFamily>& families : SpanningFamilies(effect, camera_, kShapes)) {
    std::vector<Direction> directions;
    for (const EffectFamily& family : families) {
      Direction direction = Weak(family);
      if (0.5 * direction.change.dot(direction.projected) > 0.01 * kWeakGain) {
        directions.push_back(std::move(direction));
      }
    }
    if (!directions.empty()) known->second.push_back(std::move(directions));
  }
  return known->second;
}

double Alternatives::Explained(const ActiveEffect& truth, const Effect& other) {
  const Eigen::VectorXd change = model_.change({truth});
  const double square = 2 * Gain(change);
  double best = 0;
  if (!(square > 1e-6)) return best;
  for (const std::vector<Direction>& directions : DirectionsOf(other)) {
    const auto n = static_cast<Eigen::Index>(directions.size());
    Eigen::VectorXd inner(n);
    Eigen::MatrixXd gram(n, n);
    for (Eigen::Index i = 0; i < n; ++i) {
      inner[i] = change.dot(directions[i].projected);
      for (Eigen::Index j = 0; j < n; ++j) {
        gram(i, j) = directions[i].change.dot(directions[j].projected);
      }
    }
    const Eigen::VectorXd coefficient = gram.completeOrthogonalDecomposition().solve(inner);
    const double share = inner.dot(coefficient) / square;
    ActiveEffect start = directions.front().family.At(0);
    for (Eigen::Index i = 0; i < n; ++i) {
      const EffectFamily& family = directions[i].family;
      const double scale = coefficient[i] * directions[i].scale;
      if (family.geometric) {
        start = family.At(std::max(0.0, directions[i].scale));
        continue;
      }
      for (size_t k = 0; k < family.direction.size(); ++k) {
        const EffectParameter& parameter = other.description().parameters[k];
        start.parameters[k] = std::clamp(start.parameters[k] + scale * family.direction[k],
                                         parameter.lower, parameter.upper);
      }
    }
    best = std::max(best, share < kNear ? share : Refined(start, change, square));
  }
  return best;
}

// Best share over all parameters of the alternative.
double Alternatives::Refined(ActiveEffect start, const Eigen::VectorXd& truth,
                             double square) const {
  constexpr int kIterations = 4;
  const std::vector<EffectParameter>& parameters = start.effect->description().parameters;
  const auto n = static_cast<Eigen::Index>(parameters.size());
  const auto left = [&](const Eigen::VectorXd& change) {
    const Eigen::VectorXd residual = truth - change;
    return residual.dot(model_.project(residual));
  };
  Eigen::VectorXd change = model_.change({start});
  double least = left(change);
  double damping = 1e-3;
  for (int iteration = 0; iteration < kIterations && least > 1e-3 * square; ++iteration) {
    Eigen::MatrixXd jacobian(truth.size(), n), projected(truth.size(), n);
    Eigen::VectorXd step(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      const EffectParameter& parameter = parameters[k];
      step[k] = 0.05 * std::min(parameter.prior_scale,
                                std::max(0.1 * parameter.prior_scale,
                                         std::abs(start.parameters[k] - parameter.null_value)));
      if (start.parameters[k] + step[k] > parameter.upper) step[k] = -step[k];
      ActiveEffect moved = start;
      moved.parameters[k] += step[k];
      jacobian.col(k) = model_.change({moved}) - change;
      projected.col(k) = model_.project(jacobian.col(k));
    }
    Eigen::MatrixXd information = jacobian.transpose() * projected;
    information.diagonal() *= 1 + damping;
    information.diagonal().array() += 1e-12 * square;
    const Eigen::VectorXd move =
        information.ldlt().solve(projected.transpose() * (truth - change)).cwiseProduct(step);
    bool better = false;
    for (double length = 1; length > 0.2 && !better; length /= 2) {
      ActiveEffect next = start;
      for (Eigen::Index k = 0; k < n; ++k) {
        next.parameters[k] = std::clamp(start.parameters[k] + length * move[k], parameters[k].lower,
                                        parameters[k].upper);
      }
      const Eigen::VectorXd next_change = model_.change({next});
      const double now = left(next_change);
      if (now >= least) continue;
      better = true;
      start = next;
      change = next_change;
      least = now;
    }
    if (!better) break;
  }
  return std::clamp(1 - least / square, 0.0, 1.0);
}

}  // namespace sightline::bench
