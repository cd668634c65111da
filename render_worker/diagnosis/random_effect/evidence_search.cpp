// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/evidence_search.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>

#include "render_worker/diagnosis/fit/fit.h"

namespace sightline {

namespace {

using std::numbers::pi;

constexpr double kWeakest = -6;             // log of the strength over its scale
constexpr double kStrongestOfCoarse = 4;    // the same, of the coarse grid
constexpr double kShortest = -6;            // standardised shape
constexpr double kLongest = 6;              // the same
constexpr double kWorthRefining = 1;        // log likelihood ratio [nats]
constexpr double kSmallestIncrease = 1e-3;  // of a step of the climb [nats]

// Coordinates of the search: log of the strength over its scale, standardised shape (0 without
// one).
using Coordinates = std::array<double, 2>;

struct Interval {
  double low, high, step;
  int points() const { return static_cast<int>(std::lround((high - low) / step)) + 1; }
};

struct GridPoint {
  std::vector<double> parameters;
  double gain, log_weight;  // logarithm of the prior's mass
};

// Parameters and their likelihood in the coordinates of the search.
class EvidenceSpace {
 public:
  EvidenceSpace(std::span<const EffectParameter> description, const LogLikelihoodRatio& gain,
                double largest_shape)
      : description_(description), gain_(gain) {
    strongest_ = std::log(strength().upper / strength().prior_scale);
    if (!shaped()) return;
    longest_ =
        std::min(kLongest, StandardisedParameter(shape(), std::min(largest_shape, shape().upper)));
  }

  size_t dimensions() const { return description_.size(); }
  bool shaped() const { return description_.size() > 1; }
  double strongest() const { return strongest_; }  // log of the largest strength over its scale
  double longest() const { return longest_; }      // largest standardised shape

  Coordinates At(const std::vector<double>& parameters) const {
    return {std::log(parameters[0] / strength().prior_scale),
            shaped() ? StandardisedParameter(shape(), parameters[1]) : 0};
  }
  std::vector<double> ParametersAt(const Coordinates& x) const {
    std::vector<double> parameters = {
        std::min(strength().upper, strength().prior_scale * std::exp(x[0]))};
    if (shaped()) parameters.push_back(ParameterFromStandardised(shape(), x[1]));
    return parameters;
  }
  double GainAt(const Coordinates& x) const { return gain_(ParametersAt(x)); }

  std::vector<GridPoint> Grid(const Interval& strengths, const Interval& shapes) const {
    std::vector<GridPoint> points;
    for (int j = 0; j < (shaped() ? shapes.points() : 1); ++j) {
      double log_shape = 0, z_shape = 0;
      if (shaped()) {
        z_shape = shapes.low + j * shapes.step;
        log_shape = std::log(shapes.step / (pi * (1 + z_shape * z_shape)));
      }
      for (int i = 0; i < strengths.points(); ++i) {
        const double u = strengths.low + i * strengths.step, z = std::exp(u);
        std::vector<double> parameters = ParametersAt({u, z_shape});
        const double gain = gain_(parameters);
        points.push_back({std::move(parameters), gain,
                          log_shape + std::log(strengths.step * z * 2 / (pi * (1 + z * z)))});
      }
    }
    return points;
  }

 private:
  const EffectParameter& strength() const { return description_[0]; }
  const EffectParameter& shape() const { return description_[1]; }

  std::span<const EffectParameter> description_;
  const LogLikelihoodRatio& gain_;
  double strongest_ = 0, longest_ = 0;
};

// Best point, evidence, and root mean square distance from the best point.
EvidencePeak Summarise(const std::vector<GridPoint>& points) {
  EvidencePeak peak;
  const GridPoint* best = &points.front();
  double largest = -1e300;
  for (const GridPoint& point : points) {
    largest = std::max(largest, point.gain + point.log_weight);
    if (point.gain > best->gain) best = &point;
  }
  double sum = 0;
  std::vector<double> square(best->parameters.size(), 0);
  for (const GridPoint& point : points) {
    const double weight = std::exp(point.gain + point.log_weight - largest);
    sum += weight;
    for (size_t k = 0; k < square.size(); ++k) {
      square[k] += weight * std::pow(point.parameters[k] - best->parameters[k], 2);
    }
  }
  peak.parameters = best->parameters;
  peak.gain = best->gain;
  peak.log_evidence = largest + std::log(sum);
  for (double s : square) peak.standard_errors.push_back(std::sqrt(s / sum));
  return peak;
}

EvidencePeak SearchCoarseGrid(const EvidenceSpace& space, bool many_shapes) {
  const double strongest = space.strongest(), longest = space.longest();
  EvidencePeak coarse = Summarise(space.Grid(
      {kWeakest, std::min(strongest, kStrongestOfCoarse), 0.4}, {kShortest, longest, 0.5}));
  if (coarse.gain < kWorthRefining || !many_shapes) return coarse;
  const double near = space.At(coarse.parameters)[0];
  EvidencePeak finer =
      Summarise(space.Grid({std::max(kWeakest, near - 0.8), std::min(strongest, near + 0.8), 0.4},
                           {kShortest, longest, 0.05}));
  return finer.gain > coarse.gain ? finer : coarse;
}

// Pattern search (Hooke and Jeeves, J. ACM 8 (1961) 212) along the coordinates, with ever smaller
// steps. Moves `best` and its `gain` to the top.
void Climb(const EvidenceSpace& space, Coordinates& best, double& gain) {
  for (double step = 0.2; step > 2e-3; step /= 2) {
    for (bool moved = true; moved;) {
      moved = false;
      for (size_t k = 0; k < space.dimensions(); ++k) {
        for (const double sign : {-1.0, 1.0}) {
          Coordinates next = best;
          next[k] += sign * step;
          next[0] = std::clamp(next[0], kWeakest, space.strongest());
          next[1] = std::min(next[1], space.longest());
          const double there = space.GainAt(next);
          if (!(there > gain + kSmallestIncrease)) continue;
          gain = there;
          best = next;
          moved = true;
        }
      }
    }
  }
}

// The fine grid about the top: its step, and how far it reaches in every coordinate. A sum over
// points a standard deviation apart integrates a normal peak to 1e-8.
constexpr double kFineStep = 0.1, kFineReach = 0.6;

// Laplace's approximation of the log evidence at the top, one coordinate at a time, and the
// standard deviations of a normal peak of its curvature, at most 1.
struct LaplacePeak {
  double log_evidence = 0;
  double narrowest = 1, widest = 0;
};

// Enlarges standard errors to those of the curvature where it is larger than 1.
LaplacePeak LaplaceEvidence(const EvidenceSpace& space, const Coordinates& best, double gain,
                            std::vector<double>& standard_errors) {
  constexpr double kStep = 0.02;
  LaplacePeak peak;
  double& laplace = peak.log_evidence;
  laplace = gain;
  for (size_t k = 0; k < space.dimensions(); ++k) {
    Coordinates less = best, more = best;
    less[k] -= kStep;
    more[k] += kStep;
    const double curvature = (2 * gain - space.GainAt(less) - space.GainAt(more)) / (kStep * kStep);
    const double slope =
        std::abs(space.ParametersAt(more)[k] - space.ParametersAt(less)[k]) / (2 * kStep);
    const double width = 1 / std::sqrt(std::max(1.0, curvature));
    peak.narrowest = std::min(peak.narrowest, width);
    peak.widest = std::max(peak.widest, width);
    const double z = k == 0 ? std::exp(best[0]) : best[1];
    laplace += std::log((k == 0 ? 2 * z : 1) / (pi * (1 + z * z)) *
                        std::sqrt(2 * pi / std::max(1.0, curvature)));
    if (curvature > 1) {
      standard_errors[k] = std::max(standard_errors[k], slope / std::sqrt(curvature));
    }
  }
  return peak;
}

}  // namespace

EvidencePeak SearchEvidence(std::span<const EffectParameter> description,
                            const LogLikelihoodRatio& gain,
                            const EvidenceSearchSettings& settings) {
  const EvidenceSpace space(description, gain, settings.largest_shape);
  const EvidencePeak coarse = SearchCoarseGrid(space, settings.many_shapes);
  if (coarse.gain < kWorthRefining) return coarse;
  Coordinates best = space.At(coarse.parameters);
  double top = coarse.gain;
  Climb(space, best, top);
  EvidencePeak fine = Summarise(space.Grid(
      {std::max(kWeakest, best[0] - kFineReach), std::min(space.strongest(), best[0] + kFineReach),
       kFineStep},
      {best[1] - kFineReach, std::min(space.longest(), best[1] + kFineReach), kFineStep}));
  fine.parameters = space.ParametersAt(best);
  fine.gain = top;
  // One estimate, chosen by the peak's width and not by its value: the largest of several would be
  // biased upwards. A peak narrower than the fine grid's step falls between its points; one whose
  // 2.5 standard deviations leave the fine grid is covered by the coarse one.
  const LaplacePeak peak = LaplaceEvidence(space, best, top, fine.standard_errors);
  if (peak.narrowest < kFineStep) {
    fine.log_evidence = peak.log_evidence;
  } else if (2.5 * peak.widest > kFineReach) {
    fine.log_evidence = coarse.log_evidence;
  }
  return fine;
}

}  // namespace sightline
