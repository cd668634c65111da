// SPDX-License-Identifier: Apache-2.0
#include "core/laser_line/profile_centre.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "core/statistics/order_statistics.h"

namespace sightline {
namespace {

// First and last sample whose centre lies in [lower, upper].
int FirstSample(double lower) { return std::max(0, static_cast<int>(std::ceil(lower))); }
int LastSample(double upper, size_t size) {
  return std::min(static_cast<int>(size) - 1, static_cast<int>(std::floor(upper)));
}

// Moments about `centre` over [centre - w, centre + w] of the profile, linear between its samples
// (constant beyond the first and the last): with windows that end on a bright flank, steps at the
// samples would show as a bias that repeats with the pixels.
struct ProfileMoments {
  double sum = 0, first = 0, second = 0;
  double end_values = 0;  // at both ends
};

ProfileMoments MomentsAbout(std::span<const double> profile, double centre, double w,
                            double background) {
  const int last_sample = static_cast<int>(profile.size()) - 1;
  const auto value_at = [&](double place) {
    const double inside = std::clamp(place, 0.0, static_cast<double>(last_sample));
    const int k = std::min(static_cast<int>(inside), std::max(last_sample - 1, 0));
    const double share = inside - k;
    return (1 - share) * profile[k] + share * profile[std::min(k + 1, last_sample)] - background;
  };
  ProfileMoments m;
  // Simpson's rule is exact for the cubics between two samples.
  const auto add = [&](double place, double weight) {
    const double x = place - centre, value = weight * value_at(place);
    m.sum += value;
    m.first += value * x;
    m.second += value * x * x;
  };
  const double lower = centre - w, upper = centre + w;
  for (double a = lower; a < upper;) {
    const double b = std::min(std::floor(a) + 1, upper);
    add(a, (b - a) / 6);
    add((a + b) / 2, (b - a) * 4 / 6);
    add(b, (b - a) / 6);
    a = b;
  }
  m.end_values = value_at(lower) + value_at(upper);
  return m;
}

// ln(amplitude), centre, ln(standard deviation), background: the fit of a clipped line walks along
// a valley of growing amplitude and shrinking width, straight in the logarithms.
using Parameters = Eigen::Vector4d;

struct Sample {
  double place, value;
  bool saturated;
};

// Sum of squared residuals, and their normal equations if asked for.
double SquaredResiduals(const std::vector<Sample>& samples, const Parameters& p,
                        Eigen::Matrix4d* hessian, Parameters* gradient) {
  double sum = 0;
  if (hessian != nullptr) {
    hessian->setZero();
    gradient->setZero();
  }
  const double amplitude = std::exp(p[0]), width = std::exp(p[2]);
  for (const Sample& sample : samples) {
    const double t = (sample.place - p[1]) / width;
    const double shape = std::exp(-t * t / 2);
    const double line = amplitude * shape;
    const double residual = line + p[3] - sample.value;
    if (sample.saturated && residual >= 0) continue;
    sum += residual * residual;
    if (hessian == nullptr) continue;
    const Parameters j(line, line * t / width, line * t * t, 1);
    *hessian += j * j.transpose();
    *gradient += j * residual;
  }
  return sum;
}

// ln(value - background) = c0 + c1 x + c2 x^2 with weights (value - background)^2.
std::optional<Parameters> LogParabola(const std::vector<Sample>& samples, double background,
                                      double peak) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  const double origin = samples[samples.size() / 2].place;
  int count = 0;
  for (const Sample& sample : samples) {
    const double height = sample.value - background;
    if (sample.saturated || height < 0.1 * peak) continue;
    const double x = sample.place - origin;
    const Eigen::Vector3d powers(1, x, x * x);
    normal += height * height * powers * powers.transpose();
    right += height * height * std::log(height) * powers;
    ++count;
  }
  if (count < 3) return std::nullopt;
  const Eigen::FullPivLU<Eigen::Matrix3d> lu(normal);
  if (!lu.isInvertible()) return std::nullopt;
  const Eigen::Vector3d c = lu.solve(right);
  if (!(c[2] < 0)) return std::nullopt;
  const double centre = -c[1] / (2 * c[2]);
  const Parameters start(c[0] - c[1] * c[1] / (4 * c[2]), centre + origin,
                         0.5 * std::log(-0.5 / c[2]), background);
  if (!start.allFinite() || start[0] > std::log(1e6 * peak)) return std::nullopt;
  return start;
}

}  // namespace

double LocalBackground(std::span<const double> profile, const ProfileWindow& window) {
  std::vector<double> ring;
  const int first = FirstSample(std::max(window.lower, window.start - 2 * window.half_width));
  const int last =
      LastSample(std::min(window.upper, window.start + 2 * window.half_width), profile.size());
  for (int k = first; k <= last; ++k) {
    if (std::abs(k - window.start) > window.half_width) ring.push_back(profile[k]);
  }
  if (ring.size() < 4) {
    double least = profile[std::clamp<int>(first, 0, static_cast<int>(profile.size()) - 1)];
    for (int k = first; k <= last; ++k) least = std::min(least, profile[k]);
    return least;
  }
  return UpperMedian(std::move(ring));
}

std::optional<ProfileCentre> CentreOfGravity(std::span<const double> profile,
                                             const ProfileWindow& window, double background) {
  double centre = window.start;
  ProfileMoments m;
  double w = 0;
  for (int iteration = 0; iteration < 100; ++iteration) {
    w = std::min({window.half_width, centre - window.lower, window.upper - centre});
    if (!(w >= 1)) return std::nullopt;
    m = MomentsAbout(profile, centre, w, background);
    if (!(m.sum > 0)) return std::nullopt;
    // Newton's step for a vanishing first moment; bounded where the window's ends are bright.
    const double slope = std::max(m.sum - w * m.end_values, 0.2 * m.sum);
    const double step = std::clamp(m.first / slope, -w / 2, w / 2);
    centre += step;
    if (std::abs(centre - window.start) > window.half_width) return std::nullopt;
    if (std::abs(step) < 1e-7) break;
  }
  ProfileCentre result;
  result.place = centre;
  // 1/6: variance that linear interpolation adds.
  result.width = std::sqrt(std::max(m.second / m.sum - 1.0 / 6, 0.0));
  for (int k = FirstSample(centre - w); k <= LastSample(centre + w, profile.size()); ++k) {
    result.peak = std::max(result.peak, profile[k] - background);
  }
  return result;
}

std::optional<ProfileCentre> FitGaussian(std::span<const double> profile,
                                         const ProfileWindow& window, double saturation) {
  std::vector<Sample> samples;
  const double lower = std::max(window.lower, window.start - window.half_width);
  const double upper = std::min(window.upper, window.start + window.half_width);
  for (int k = FirstSample(lower); k <= LastSample(upper, profile.size()); ++k) {
    samples.push_back(
        {static_cast<double>(k), profile[k], saturation > 0 && profile[k] >= saturation});
  }
  if (samples.size() < 5) return std::nullopt;
  double least = samples[0].value, most = least, saturated = 0;
  for (const Sample& sample : samples) {
    least = std::min(least, sample.value);
    most = std::max(most, sample.value);
    saturated += sample.saturated;
  }
  if (!(most > least) || saturated + 3 > samples.size()) return std::nullopt;

  Parameters p(std::log(most - least), window.start,
               std::log(std::max({window.half_width / 4, saturated / 3, 0.5})), least);
  if (const auto parabola = LogParabola(samples, least, most - least)) {
    if ((*parabola)[1] > lower && (*parabola)[1] < upper) p = *parabola;
  }
  const double largest_amplitude = std::log(1e6 * (most - least));
  Eigen::Matrix4d hessian;
  Parameters gradient;
  double sum = SquaredResiduals(samples, p, &hessian, &gradient);
  double damping = 1e-3;
  bool converged = false;
  for (int iteration = 0; iteration < 100 && !converged; ++iteration) {
    Eigen::Matrix4d damped = hessian;
    damped.diagonal() *= 1 + damping;
    damped.diagonal().array() += 1e-12 * hessian.trace();
    const Parameters step = damped.ldlt().solve(-gradient);
    const Parameters next = p + step;
    // A standard deviation beyond these is no line in this window.
    const bool sane = step.allFinite() && std::abs(step[1]) < window.half_width &&
                      next[0] < largest_amplitude && next[2] > std::log(0.1) &&
                      next[2] < std::log(4 * window.half_width);
    const double next_sum = sane ? SquaredResiduals(samples, next, nullptr, nullptr) : sum + 1;
    if (sane && next_sum <= sum) {
      converged = std::abs(step[1]) < 1e-7 && std::abs(step[2]) < 1e-6;
      p = next;
      damping = std::max(damping / 10, 1e-9);
      sum = SquaredResiduals(samples, p, &hessian, &gradient);
    } else {
      if (damping > 1e10) break;
      // At the resolution of the sum no step gets any lower.
      converged = sane && std::abs(step[1]) < 1e-7 && std::abs(step[2]) < 1e-6;
      damping *= 10;
    }
  }
  if (!converged || p[1] < lower || p[1] > upper) return std::nullopt;
  return ProfileCentre{p[1], std::exp(p[0]), std::exp(p[2])};
}

}  // namespace sightline
