// SPDX-License-Identifier: Apache-2.0
// Search among dependences on one, two and three quantities.
#pragma once

#include <span>
#include <vector>

#include "render_worker/diagnosis/finding/setup_law/form.h"

namespace sightline::setup_law {

class LawSearch {
 public:
  // `significance`: as SetupLawSettings.
  LawSearch(std::span<const SetupAmplitude> amplitudes, double significance);

  const std::vector<Scaled>& quantities() const { return quantities_; }
  const Form& constant() const { return constant_; }

  struct Found {
    Form form;
    Fit fit;
  };
  // Shortest descriptions first, one for every set of quantities.
  std::vector<Found> Search(const Standardised& data) const;

 private:
  void AddSingles();
  void AddTimes(std::span<const SetupAmplitude> amplitudes);
  void AddPairs();
  void AddThird(const Standardised& data, const Form& pair, std::vector<Found>& found) const;

  double further_quantity_;  // description length of one; it must be as significant as the
                             // dependence itself
  Eigen::Index size_;
  std::vector<Scaled> quantities_;
  Form constant_;
  std::vector<Form> forms_;  // of one quantity
  std::vector<Form> pairs_;
};

}  // namespace sightline::setup_law
