// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/setup_law/setup_law.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/random/counter_random.h"
#include "render_worker/diagnosis/finding/setup_law/exponents.h"
#include "render_worker/diagnosis/finding/setup_law/form.h"
#include "render_worker/diagnosis/finding/setup_law/search.h"

namespace sightline {
namespace setup_law {
namespace {

constexpr int kLeastAmplitudes = 6;
constexpr int kPermutations = 199;
// Descriptions longer by less than this are as good: odds of 20.
constexpr double kAsGood = 6;

// Gain of the best law over the constant [description length].
double Gain(const LawSearch& search, const Standardised& data) {
  const std::vector<LawSearch::Found> found = search.Search(data);
  if (found.empty()) return 0;
  return FitForm(data, search.constant()).description - found.front().fit.description;
}

// True if the gain exceeds those of permuted residuals about the constant significantly. Stops as
// soon as enough permutations have reached it.
bool IsSignificant(const LawSearch& search, const Standardised& data, double gain,
                   const SetupLawSettings& settings) {
  if (!(gain > 0)) return false;
  const Fit constant = FitForm(data, search.constant());
  const Eigen::ArrayXd base = constant.factor * data.weight;
  const auto n = static_cast<int>(data.amplitude.size());
  const int allowed = static_cast<int>(settings.significance * (kPermutations + 1)) - 1;
  int reached = 0;
  for (int k = 0; k < kPermutations; ++k) {
    CounterRandom random(DeriveSeed(settings.seed, "permutation of amplitudes"),
                         static_cast<uint64_t>(k));
    std::vector<int> order(n);
    std::iota(order.begin(), order.end(), 0);
    for (int i = n - 1; i > 0; --i) {
      std::swap(order[i], order[static_cast<int>(random.Uniform() * (i + 1))]);
    }
    Standardised permuted = data;
    for (int i = 0; i < n; ++i) permuted.amplitude[i] = base[i] + constant.residual[order[i]];
    if (Gain(search, permuted) >= gain && ++reached > allowed) return false;
  }
  return true;
}

// Sum of squares about a form with the weights of the law, so that outliers count little in all.
double WeightedSquares(const Standardised& data, const Form& form, const Eigen::ArrayXd& robust) {
  const Eigen::Index columns = form.offset ? 2 : 1;
  Eigen::MatrixXd design(data.amplitude.size(), columns);
  design.col(0) = robust.sqrt() * form.g * data.weight;
  if (form.offset) design.col(1) = robust.sqrt() * data.weight;
  const Eigen::VectorXd seen = robust.sqrt() * data.amplitude;
  return (seen - design * design.completeOrthogonalDecomposition().solve(seen)).squaredNorm();
}

std::string Number(double value) { return absl::StrCat(std::round(value * 1e12) / 1e12); }

std::string LawText(const LawSearch& search, const LawSearch::Found& found) {
  const Form& form = found.form;
  if (form.kind == Kind::kExponential) {
    return absl::StrCat("constant + part that decays with timestamp_s, time constant ",
                        absl::SixDigits(form.time_s), " s");
  }
  if (form.kind == Kind::kStep) {
    return absl::StrCat("step at timestamp_s ", absl::SixDigits(form.time_s));
  }
  std::string text = form.offset ? "constant + proportional to" : "proportional to";
  std::string typical;
  for (const Power& power : form.powers) {
    const Scaled& scaled = search.quantities()[power.quantity];
    absl::StrAppend(&text, " ", scaled.quantity->name, "^", Number(power.exponent));
    absl::StrAppend(&typical, typical.empty() ? "" : ", ", scaled.quantity->name, " ",
                    absl::SixDigits(scaled.typical));
  }
  return absl::StrCat(text, " (", absl::SixDigits(found.fit.factor), " at ", typical, ")");
}

std::vector<v1::SetupLaw> Describe(const LawSearch& search, const Standardised& data,
                                   const LawSearch::Found& found, const std::string& prefix) {
  const Form& form = found.form;
  const Eigen::ArrayXd robust =
      (kFreedom + 1) /
      (kFreedom + found.fit.residual.square() / (found.fit.scale * found.fit.scale));
  const double about_constant = WeightedSquares(data, search.constant(), robust);
  const double about_law = WeightedSquares(data, form, robust);
  Exponents exponents;
  if (form.kind == Kind::kPowers) exponents = FitExponents(search, data, found);
  std::vector<v1::SetupLaw> laws;
  for (size_t k = 0; k < form.powers.size(); ++k) {
    Form without = form;
    if (form.powers.size() == 1) {
      without = search.constant();
    } else {
      without.powers.erase(without.powers.begin() + static_cast<std::ptrdiff_t>(k));
      without.g = Product(search.quantities(), without.powers, form.g.size());
    }
    v1::SetupLaw law;
    law.set_quantity(search.quantities()[form.powers[k].quantity].quantity->name);
    law.set_law(absl::StrCat(prefix, LawText(search, found)));
    if (form.kind == Kind::kPowers) {
      law.set_exponent(exponents.values[k]);
      law.set_exponent_standard_error(exponents.standard_errors[k]);
    }
    const double lost = WeightedSquares(data, without, robust) - about_law;
    law.set_explained(std::clamp(lost / std::max(about_constant, 1e-300), 0.0, 1.0));
    laws.push_back(std::move(law));
  }
  std::stable_sort(laws.begin(), laws.end(), [](const v1::SetupLaw& a, const v1::SetupLaw& b) {
    return a.explained() > b.explained();
  });
  return laws;
}

std::vector<v1::SetupLaw> NoLaw(const char* text) {
  v1::SetupLaw none;
  none.set_quantity("none");
  none.set_law(text);
  return {none};
}

}  // namespace
}  // namespace setup_law

SetupAmplitude SetupOf(const FrameSetup& frame) {
  SetupAmplitude setup;
  setup.exposure_time_s = frame.exposure_time_s;
  setup.f_number = frame.lens.f_number;
  setup.camera_distance_m = frame.plate.camera_distance_m;
  setup.focus_distance_m = frame.lens.focus_distance_m.value();
  const double image_of_plate =
      1 / (1 / frame.lens.focal_length_m - 1 / frame.plate.camera_distance_m);
  setup.defocus_px = frame.PupilDiameter() * std::abs(frame.ImageDistance() / image_of_plate - 1) /
                     frame.sensor.pixel_pitch_m;
  setup.laser_distance_m = frame.plate.laser_distance_m;
  setup.timestamp_s = frame.timestamp_s;
  setup.signal_level = std::numeric_limits<double>::quiet_NaN();
  setup.burst_frame_index = frame.burst_frame_index;
  const double pitch = frame.sensor.pixel_pitch_m;
  const double u = (frame.roi.column_px + 0.5 * (frame.roi.columns_px - 1)) * pitch;
  const double v = (frame.roi.row_px + 0.5 * (frame.roi.rows_px - 1)) * pitch;
  setup.field_position_m = std::hypot(u, v);
  setup.row =
      frame.plate.line_offset_m * frame.ImageDistance() / (frame.plate.camera_distance_m * pitch);
  return setup;
}

std::vector<v1::SetupLaw> FindSetupLaws(std::span<const SetupAmplitude> amplitudes,
                                        const SetupLawSettings& settings) {
  using namespace setup_law;
  constexpr size_t kAlternatives = 2;
  if (amplitudes.size() < kLeastAmplitudes) {
    return NoLaw("too few amplitudes to look for a dependence");
  }
  Standardised data;
  data.amplitude.resize(static_cast<Eigen::Index>(amplitudes.size()));
  data.weight.resize(data.amplitude.size());
  for (size_t i = 0; i < amplitudes.size(); ++i) {
    const auto k = static_cast<Eigen::Index>(i);
    data.weight[k] = 1 / amplitudes[i].standard_error;
    data.amplitude[k] = amplitudes[i].amplitude * data.weight[k];
  }
  const LawSearch search(amplitudes, settings.significance);
  const std::vector<LawSearch::Found> found = search.Search(data);
  const Fit constant = FitForm(data, search.constant());
  if (found.empty() ||
      !IsSignificant(search, data, constant.description - found.front().fit.description,
                     settings)) {
    return NoLaw("no dependence found");
  }
  std::vector<v1::SetupLaw> laws = Describe(search, data, found.front(), "");
  for (size_t k = 1; k < found.size() && k <= kAlternatives; ++k) {
    if (found[k].fit.description > found.front().fit.description + kAsGood) break;
    for (v1::SetupLaw& law : Describe(search, data, found[k], "or "))
      laws.push_back(std::move(law));
  }
  return laws;
}

}  // namespace sightline
