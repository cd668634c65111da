// SPDX-License-Identifier: Apache-2.0
// Base class and shared helpers of the model-discrepancy terms.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/independent_patterns.h"

namespace sightline {

// Unit [m] of places in the image, as distances from the optical axis, in the polynomials of terms.
inline constexpr double kImageHeight_m = 5e-3;

class FreeFormEffect : public DescribedEffect {
 public:
  // Axes of the coefficients' curve; units stand in the names.
  struct Axes {
    std::string abscissa, ordinate;
    std::vector<double> abscissa_values;
  };
  // Kind of term, as in v1::FreeFormTerm.
  std::string_view term() const { return term_; }
  // The coefficients themselves, unless a term has a curve in one variable.
  virtual Axes CurveAxes() const {
    Axes axes{"coefficient", "value", {}};
    for (size_t k = 0; k < description().parameters.size(); ++k) {
      absl::StrAppend(&axes.abscissa, k == 0 ? ": " : ", ",
                      std::string(description().parameters[k].name));
      axes.abscissa_values.push_back(static_cast<double>(k));
    }
    return axes;
  }
  virtual double CurveAt(double abscissa, Parameters p) const {
    return p[static_cast<size_t>(abscissa)];
  }

 protected:
  FreeFormEffect(std::string_view term, EffectDescription description)
      : DescribedEffect(std::move(description)), term_(term) {}

  static bool IsNull(Parameters p) {
    return std::all_of(p.begin(), p.end(), [](double c) { return c == 0; });
  }

 private:
  std::string_view term_;
};

// A coefficient that may have either sign.
inline EffectParameter Coefficient(std::string_view name, double limit, double prior_scale,
                                   double decades = 0) {
  return {name, 0, -limit, limit, prior_scale, {}, decades};
}

// `count` values from `first` to `last`, evenly spaced.
inline std::vector<double> EvenlySpaced(double first, double last, int count) {
  std::vector<double> values(count);
  for (int i = 0; i < count; ++i) values[i] = first + (last - first) * i / (count - 1);
  return values;
}

// Piecewise linear through the values at ascending knots, constant beyond them.
template <typename Knots>
double LinearThroughKnots(const Knots& knots, Effect::Parameters values, double x) {
  if (x <= knots.front()) return values.front();
  for (size_t k = 1; k < knots.size(); ++k) {
    if (x >= knots[k]) continue;
    const double t = (x - knots[k - 1]) / (knots[k] - knots[k - 1]);
    return (1 - t) * values[k - 1] + t * values[k];
  }
  return values.back();
}

// Coefficients of a Fourier series from harmonic `first` to `last`, 1 <= first <= last <= 16:
// cosine and sine of each.
inline std::vector<EffectParameter> Harmonics(int first, int last, double prior_scale) {
  static constexpr std::string_view kNames[] = {
      "cosine_1",  "sine_1",    "cosine_2",  "sine_2",    "cosine_3",  "sine_3",    "cosine_4",
      "sine_4",    "cosine_5",  "sine_5",    "cosine_6",  "sine_6",    "cosine_7",  "sine_7",
      "cosine_8",  "sine_8",    "cosine_9",  "sine_9",    "cosine_10", "sine_10",   "cosine_11",
      "sine_11",   "cosine_12", "sine_12",   "cosine_13", "sine_13",   "cosine_14", "sine_14",
      "cosine_15", "sine_15",   "cosine_16", "sine_16"};
  std::vector<EffectParameter> parameters;
  for (int i = 2 * (first - 1); i < 2 * last; ++i) {
    parameters.push_back(Coefficient(kNames[i], 0.5, prior_scale));
  }
  return parameters;
}

// Sum over k of c_2k cos(2 pi (n + k) x) + c_2k+1 sin(2 pi (n + k) x), n the first harmonic.
inline double FourierSeries(double x, int first_harmonic, Effect::Parameters coefficients) {
  double sum = 0;
  for (size_t i = 0; i + 1 < coefficients.size(); i += 2) {
    const int harmonic = first_harmonic + static_cast<int>(i / 2);
    const double phase = 2 * std::numbers::pi * harmonic * x;
    sum += coefficients[i] * std::cos(phase) + coefficients[i + 1] * std::sin(phase);
  }
  return sum;
}

// Splits each pattern into `modes` independent ones of equal mean; 1 to 64.
inline void SplitIntoModes(SpeckleModel& speckle, double modes) {
  speckle.pattern_weights =
      SplitPatterns(speckle.pattern_weights, EqualModes(std::min(modes, 64.0)));
}

// The terms of each stage, in the order in which they act.
std::vector<const FreeFormEffect*> IlluminationTerms();
std::vector<const FreeFormEffect*> SurfaceTerms();
std::vector<const FreeFormEffect*> OpticsTerms();
std::vector<const FreeFormEffect*> GeometryTerms();
std::vector<const FreeFormEffect*> SensorTerms();
std::vector<const FreeFormEffect*> ReadoutTerms();
std::vector<const FreeFormEffect*> TimeTerms();

}  // namespace sightline
