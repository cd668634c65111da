// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/finding/setup_law/search.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace sightline::setup_law {
namespace {

constexpr int kExtendedPairs = 8;  // that a third quantity is tried with

bool SameQuantities(const Form& a, const Form& b) {
  std::vector<int> qa, qb;
  for (const Power& power : a.powers) qa.push_back(power.quantity);
  for (const Power& power : b.powers) qb.push_back(power.quantity);
  std::sort(qa.begin(), qa.end());
  std::sort(qb.begin(), qb.end());
  return qa == qb;
}

void Try(const Standardised& data, const Form& form, std::vector<LawSearch::Found>& found) {
  Fit fit = FitForm(data, form);
  for (LawSearch::Found& known : found) {
    if (!SameQuantities(known.form, form)) continue;
    if (fit.description < known.fit.description) known = {form, std::move(fit)};
    return;
  }
  found.push_back({form, std::move(fit)});
}

}  // namespace

LawSearch::LawSearch(std::span<const SetupAmplitude> amplitudes, double significance)
    : further_quantity_(2 * std::log(1 / significance)),
      size_(static_cast<Eigen::Index>(amplitudes.size())),
      quantities_(UsableQuantities(amplitudes)) {
  constant_.g = Eigen::ArrayXd::Ones(size_);
  AddSingles();
  AddTimes(amplitudes);
  AddPairs();
}

std::vector<LawSearch::Found> LawSearch::Search(const Standardised& data) const {
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

void LawSearch::AddSingles() {
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

void LawSearch::AddTimes(std::span<const SetupAmplitude> amplitudes) {
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

void LawSearch::AddPairs() {
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

void LawSearch::AddThird(const Standardised& data, const Form& pair,
                         std::vector<Found>& found) const {
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

}  // namespace sightline::setup_law
