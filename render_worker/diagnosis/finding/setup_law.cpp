// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/setup_law.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/random/counter_random.h"

namespace sightline {
namespace {

constexpr int kLeastAmplitudes = 6;
constexpr int kPermutations = 199;
constexpr int kExtendedPairs = 8;  // that a third quantity is tried with
// Descriptions longer by less than this are as good: odds of 20.
constexpr double kAsGood = 6;

struct Quantity {
  const char* name;
  double SetupAmplitude::*value;
  bool may_be_negative_power;  // not of what has no scale of its own: times and counts
};
constexpr std::array<Quantity, 11> kQuantities = {
    {{"exposure_time_s", &SetupAmplitude::exposure_time_s, true},
     {"f_number", &SetupAmplitude::f_number, true},
     {"camera_distance_m", &SetupAmplitude::camera_distance_m, true},
     {"focus_distance_m", &SetupAmplitude::focus_distance_m, true},
     {"defocus_px", &SetupAmplitude::defocus_px, false},
     {"laser_distance_m", &SetupAmplitude::laser_distance_m, true},
     {"timestamp_s", &SetupAmplitude::timestamp_s, false},
     {"signal_level", &SetupAmplitude::signal_level, true},
     {"burst_frame_index", &SetupAmplitude::burst_frame_index, false},
     {"field_position", &SetupAmplitude::field_position_m, false},
     {"row", &SetupAmplitude::row, false}}};

// Values of one quantity over a typical one.
struct Scaled {
  const Quantity* quantity = nullptr;
  double typical = 1;
  Eigen::ArrayXd values;
  std::vector<double> exponents, exponents_of_products;
};

struct Power {
  int quantity = 0;  // index of Scaled
  double exponent = 1;
};

enum class Kind { kConstant, kPowers, kExponential, kStep };

struct Form {
  Kind kind = Kind::kConstant;
  std::vector<Power> powers;
  double time_s = 0;  // of an exponential or step
  bool offset = false;
  double choice = 0;  // 2 ln(number of forms alike)
  Eigen::ArrayXd g;
};

// Amplitudes over standard errors, 1 over standard errors.
struct Standardised {
  Eigen::ArrayXd amplitude, weight;
};

struct Fit {
  double factor = 0, offset = 0;
  double scale = 1;
  double description = std::numeric_limits<double>::infinity();
  Eigen::ArrayXd residual;  // standardised
};

// Student's likelihood by reweighting. A scale of 0.79 is what normal residuals of unit variance
// have at four degrees of freedom.
constexpr double kFreedom = 4;
constexpr double kLeastScale = 0.79;

constexpr int kIterations = 8;
constexpr int kFewIterations = 3;  // to choose among many

Fit FitForm(const Standardised& data, const Form& form, int iterations = kIterations) {
  const auto n = static_cast<double>(data.amplitude.size());
  const Eigen::ArrayXd g = form.g * data.weight;
  Fit fit;
  Eigen::ArrayXd robust = Eigen::ArrayXd::Ones(data.amplitude.size());
  for (int iteration = 0; iteration < iterations; ++iteration) {
    const double gg = (robust * g * g).sum(), ga = (robust * g * data.amplitude).sum();
    if (form.offset) {
      const double ww = (robust * data.weight * data.weight).sum();
      const double gw = (robust * g * data.weight).sum();
      const double wa = (robust * data.weight * data.amplitude).sum();
      const double determinant = gg * ww - gw * gw;
      if (!(determinant > 1e-10 * gg * ww)) return fit;
      fit.factor = (ga * ww - wa * gw) / determinant;
      fit.offset = (wa * gg - ga * gw) / determinant;
    } else {
      if (!(gg > 0)) return fit;
      fit.factor = ga / gg;
    }
    fit.residual = data.amplitude - fit.factor * g - fit.offset * data.weight;
    const Eigen::ArrayXd square = fit.residual.square();
    if (iteration == 0) {
      Eigen::ArrayXd sorted = square;
      std::nth_element(sorted.data(), sorted.data() + sorted.size() / 2,
                       sorted.data() + sorted.size());
      fit.scale = std::max(kLeastScale, 1.5 * std::sqrt(sorted[sorted.size() / 2]));
    }
    robust = (kFreedom + 1) / (kFreedom + square / (fit.scale * fit.scale));
    fit.scale = std::max(kLeastScale, std::sqrt((robust * square).sum() / n));
  }
  const double numbers = form.offset ? 2 : 1;
  fit.description =
      (kFreedom + 1) *
          (1 + fit.residual.square() / (kFreedom * fit.scale * fit.scale)).log().sum() +
      2 * n * std::log(fit.scale) + numbers * std::log(n) + form.choice;
  return fit;
}

Eigen::ArrayXd Product(const std::vector<Scaled>& quantities, const std::vector<Power>& powers,
                       Eigen::Index size) {
  Eigen::ArrayXd g = Eigen::ArrayXd::Ones(size);
  for (const Power& power : powers) g *= quantities[power.quantity].values.pow(power.exponent);
  return g;
}

std::vector<Scaled> UsableQuantities(std::span<const SetupAmplitude> amplitudes) {
  std::vector<Scaled> usable;
  for (const Quantity& quantity : kQuantities) {
    Scaled scaled{
        &quantity, 1, Eigen::ArrayXd(static_cast<Eigen::Index>(amplitudes.size())), {}, {}};
    for (size_t i = 0; i < amplitudes.size(); ++i) {
      scaled.values[static_cast<Eigen::Index>(i)] = amplitudes[i].*quantity.value;
    }
    if (!scaled.values.allFinite()) continue;
    const double least = scaled.values.minCoeff(), most = scaled.values.maxCoeff();
    const double size = std::max(std::abs(least), std::abs(most));
    if (!(most - least > 0.02 * size)) continue;
    std::vector<double> distinct(scaled.values.begin(), scaled.values.end());
    std::sort(distinct.begin(), distinct.end());
    distinct.erase(std::unique(distinct.begin(), distinct.end(),
                               [size](double a, double b) { return b - a < 1e-3 * size; }),
                   distinct.end());
    if (least < 0) {
      scaled.typical = size;
      scaled.exponents = {1};
      if (distinct.size() > 2) scaled.exponents.push_back(2);
    } else {
      double log_sum = 0;
      int positive = 0;
      for (const double value : scaled.values) {
        if (!(value > 0)) continue;
        log_sum += std::log(value);
        ++positive;
      }
      scaled.typical = std::exp(log_sum / positive);
      if (distinct.size() == 2) {
        scaled.exponents = {1};
      } else if (least > 0 && quantity.may_be_negative_power) {
        scaled.exponents = {-4, -3, -2, -1.5, -1, -0.5, 0.5, 1, 1.5, 2, 3, 4};
        scaled.exponents_of_products = {-4, -2, -1, -0.5, 0.5, 1, 2, 4};
      } else {
        scaled.exponents = {0.5, 1, 1.5, 2, 3};
        scaled.exponents_of_products = {0.5, 1, 2};
      }
    }
    scaled.values /= scaled.typical;
    usable.push_back(std::move(scaled));
  }
  return usable;
}

class LawSearch {
 public:
  LawSearch(std::span<const SetupAmplitude> amplitudes, double significance)
      : further_quantity_(2 * std::log(1 / significance)),
        size_(static_cast<Eigen::Index>(amplitudes.size())),
        quantities_(UsableQuantities(amplitudes)) {
    constant_.g = Eigen::ArrayXd::Ones(size_);
    AddSingles();
    AddTimes(amplitudes);
    AddPairs();
  }

  const std::vector<Scaled>& quantities() const { return quantities_; }
  const Form& constant() const { return constant_; }

  struct Found {
    Form form;
    Fit fit;
  };
  // Shortest descriptions first, one for every set of quantities.
  std::vector<Found> Search(const Standardised& data) const {
    std::vector<Found> found;
    std::vector<std::pair<double, int>> pairs;
    for (const Form& form : forms_) Try(data, form, found);
    for (size_t i = 0; i < pairs_.size(); ++i) {
      const Fit fit = FitForm(data, pairs_[i], kFewIterations);
      pairs.emplace_back(fit.description, static_cast<int>(i));
    }
    const auto extended = std::min<size_t>(kExtendedPairs, pairs.size());
    std::partial_sort(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(extended),
                      pairs.end());
    for (size_t k = 0; k < extended; ++k) {
      Form form = pairs_[pairs[k].second];
      Try(data, form, found);
      form.offset = true;
      form.choice += 2 * std::log(2.0);
      Try(data, form, found);
      AddThird(data, pairs_[pairs[k].second], found);
    }
    std::sort(found.begin(), found.end(),
              [](const Found& a, const Found& b) { return a.fit.description < b.fit.description; });
    return found;
  }

 private:
  static bool SameQuantities(const Form& a, const Form& b) {
    std::vector<int> qa, qb;
    for (const Power& power : a.powers) qa.push_back(power.quantity);
    for (const Power& power : b.powers) qb.push_back(power.quantity);
    std::sort(qa.begin(), qa.end());
    std::sort(qb.begin(), qb.end());
    return qa == qb;
  }

  static void Try(const Standardised& data, const Form& form, std::vector<Found>& found) {
    Fit fit = FitForm(data, form);
    for (Found& known : found) {
      if (!SameQuantities(known.form, form)) continue;
      if (fit.description < known.fit.description) known = {form, std::move(fit)};
      return;
    }
    found.push_back({form, std::move(fit)});
  }

  void AddSingles() {
    std::vector<Form> singles;
    for (int q = 0; q < static_cast<int>(quantities_.size()); ++q) {
      for (const double exponent : quantities_[q].exponents) {
        for (const bool offset : {false, true}) {
          // Quantities that change sign or take two values only have no power law without a
          // constant.
          if (!offset && quantities_[q].exponents_of_products.empty()) continue;
          Form form{Kind::kPowers, {{q, exponent}}, 0, offset, 0, {}};
          form.g = Product(quantities_, form.powers, size_);
          singles.push_back(std::move(form));
        }
      }
    }
    for (Form& form : singles) form.choice = 2 * std::log(static_cast<double>(singles.size()));
    forms_.insert(forms_.end(), singles.begin(), singles.end());
  }

  void AddTimes(std::span<const SetupAmplitude> amplitudes) {
    constexpr int kTimes = 12;
    int time = -1;
    for (int q = 0; q < static_cast<int>(quantities_.size()); ++q) {
      if (quantities_[q].quantity->value == &SetupAmplitude::timestamp_s) time = q;
    }
    if (time < 0 || quantities_[time].exponents_of_products.empty()) return;
    Eigen::ArrayXd t(size_);
    for (Eigen::Index i = 0; i < size_; ++i) t[i] = amplitudes[static_cast<size_t>(i)].timestamp_s;
    std::vector<double> sorted(t.begin(), t.end());
    std::sort(sorted.begin(), sorted.end());
    const double span = sorted.back() - sorted.front();
    std::vector<Form> times;
    for (int k = 0; k < kTimes; ++k) {
      const double decay_s = span * std::pow(30, -k / (kTimes - 1.0));
      times.push_back({Kind::kExponential,
                       {{time, 0}},
                       decay_s,
                       true,
                       0,
                       (-(t - sorted.front()) / decay_s).exp()});
      // Between two recordings, at least two on either side.
      const size_t last = static_cast<size_t>(2 + (sorted.size() - 4) * (k + 0.5) / kTimes);
      const double at_s = 0.5 * (sorted[last - 1] + sorted[last]);
      if (sorted[last] > sorted[last - 1]) {
        times.push_back({Kind::kStep, {{time, 0}}, at_s, true, 0, (t > at_s).cast<double>()});
      }
    }
    for (Form& form : times) form.choice = 2 * std::log(static_cast<double>(times.size()));
    forms_.insert(forms_.end(), times.begin(), times.end());
  }

  void AddPairs() {
    const int count = static_cast<int>(quantities_.size());
    for (int a = 0; a < count; ++a) {
      for (int b = a + 1; b < count; ++b) {
        for (const double ea : quantities_[a].exponents_of_products) {
          for (const double eb : quantities_[b].exponents_of_products) {
            Form form{Kind::kPowers, {{a, ea}, {b, eb}}, 0, false, 0, {}};
            form.g = Product(quantities_, form.powers, size_);
            pairs_.push_back(std::move(form));
          }
        }
      }
    }
    for (Form& form : pairs_) {
      form.choice = 2 * std::log(static_cast<double>(pairs_.size())) + further_quantity_;
    }
  }

  void AddThird(const Standardised& data, const Form& pair, std::vector<Found>& found) const {
    std::vector<Form> triples;
    for (int q = 0; q < static_cast<int>(quantities_.size()); ++q) {
      if (q == pair.powers[0].quantity || q == pair.powers[1].quantity) continue;
      for (const double exponent : quantities_[q].exponents_of_products) {
        Form form = pair;
        form.powers.push_back({q, exponent});
        form.g *= quantities_[q].values.pow(exponent);
        triples.push_back(std::move(form));
      }
    }
    for (Form& form : triples) {
      form.choice += 2 * std::log(static_cast<double>(triples.size())) + further_quantity_;
      Try(data, form, found);
    }
  }

  double further_quantity_;  // description of one: it must be as sure as the law itself
  Eigen::Index size_;
  std::vector<Scaled> quantities_;
  Form constant_;
  std::vector<Form> forms_;  // of one quantity
  std::vector<Form> pairs_;
};

// Gain of the best law over the constant [description length].
double Gain(const LawSearch& search, const Standardised& data) {
  const std::vector<LawSearch::Found> found = search.Search(data);
  if (found.empty()) return 0;
  return FitForm(data, search.constant()).description - found.front().fit.description;
}

// Whether the gain stands out from those of permuted residuals about the constant. Stops as soon as
// enough of them reached it.
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

struct Exponents {
  std::vector<double> values, standard_errors;
};

// Gauss and Newton on amplitude, constant and exponents, with the weights of the robust fit.
Exponents FitExponents(const LawSearch& search, const Standardised& data,
                       const LawSearch::Found& found) {
  constexpr int kSteps = 20;
  const auto powers = static_cast<Eigen::Index>(found.form.powers.size());
  const Eigen::Index first = found.form.offset ? 2 : 1;
  const Eigen::ArrayXd robust =
      ((kFreedom + 1) /
       (kFreedom + found.fit.residual.square() / (found.fit.scale * found.fit.scale)))
          .sqrt();
  Eigen::VectorXd x(first + powers);
  x[0] = found.fit.factor;
  if (found.form.offset) x[1] = found.fit.offset;
  for (Eigen::Index k = 0; k < powers; ++k) {
    x[first + k] = found.form.powers[static_cast<size_t>(k)].exponent;
  }
  Eigen::MatrixXd jacobian(data.amplitude.size(), x.size());
  const auto evaluate = [&](const Eigen::VectorXd& at, bool with_jacobian) {
    std::vector<Power> fitted = found.form.powers;
    for (Eigen::Index k = 0; k < powers; ++k) {
      fitted[static_cast<size_t>(k)].exponent = at[first + k];
    }
    const Eigen::ArrayXd g =
        Product(search.quantities(), fitted, data.amplitude.size()) * data.weight;
    if (with_jacobian) {
      jacobian.col(0) = robust * g;
      if (found.form.offset) jacobian.col(1) = robust * data.weight;
      for (Eigen::Index k = 0; k < powers; ++k) {
        const Eigen::ArrayXd& q =
            search.quantities()[found.form.powers[static_cast<size_t>(k)].quantity].values;
        jacobian.col(first + k) = robust * at[0] * g * (q > 0).select(q.max(1e-300).log(), 0.0);
      }
    }
    const double offset = found.form.offset ? at[1] : 0;
    return Eigen::VectorXd(robust * (data.amplitude - at[0] * g - offset * data.weight));
  };
  for (int iteration = 0; iteration < kSteps; ++iteration) {
    const Eigen::VectorXd residual = evaluate(x, true);
    Eigen::VectorXd step = jacobian.completeOrthogonalDecomposition().solve(residual);
    // Exponents move by one at most.
    const double largest = step.tail(powers).cwiseAbs().maxCoeff();
    if (largest > 1) step /= largest;
    bool better = false;
    for (int half = 0; half < 10 && !better; ++half, step /= 2) {
      const Eigen::VectorXd moved = x + step;
      if (evaluate(moved, false).squaredNorm() <= residual.squaredNorm()) {
        x = moved;
        better = true;
      }
    }
    if (!better || step.norm() < 1e-8 * x.norm()) break;
  }
  const double square = evaluate(x, true).squaredNorm();
  const double freedom = std::max<double>(1, static_cast<double>(data.amplitude.size() - x.size()));
  const double variance = std::max(1.0, square / freedom);
  const Eigen::MatrixXd covariance =
      variance *
      (jacobian.transpose() * jacobian).completeOrthogonalDecomposition().pseudoInverse();
  Exponents result;
  for (Eigen::Index k = 0; k < powers; ++k) {
    result.values.push_back(x[first + k]);
    result.standard_errors.push_back(std::sqrt(std::max(0.0, covariance(first + k, first + k))));
  }
  return result;
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
