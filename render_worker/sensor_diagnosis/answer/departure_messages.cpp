// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/answer/departure_messages.h"

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "render_worker/evidence/model_prior.h"
#include "render_worker/evidence/significance.h"

namespace sightline {
namespace {

// Level of significance of all tests together. Chosen: one false alarm in a thousand sets.
constexpr double kSignificance = 1e-3;
// Departures that the finding describes; the others are counted.
constexpr size_t kDescribedInFinding = 2;

// Largest probability of a departure after its test, the prior of all shared out among the tests.
double MostProbable(double p_value, int tests) {
  const double prior = (1 - kPriorOfNoEffect) / tests;
  const double odds = prior / (1 - prior) * BayesFactorBound(p_value);
  return odds / (1 + odds);
}

v1::SensorDeparture DepartureMessage(const Departure& departure, int tests) {
  v1::SensorDeparture message;
  message.set_effect(departure.effect);
  message.set_stage(departure.stage);
  message.set_description(departure.description);
  message.set_testable(departure.testable);
  const double p = std::min(1.0, departure.p_value * tests);
  message.set_p_value(departure.testable ? p : 1);
  if (departure.testable) message.set_probability(MostProbable(departure.p_value, tests));
  message.set_found(departure.testable && departure.material && p < kSignificance);
  for (const DepartureParameter& parameter : departure.parameters) {
    v1::SensorParameter* out = message.add_parameters();
    out->set_name(parameter.name);
    out->set_unit(parameter.unit);
    out->set_value(parameter.value);
    out->set_standard_error(parameter.standard_error);
  }
  return message;
}

std::string FindingText(std::vector<std::string> found) {
  if (found.empty()) {
    return "The linear model of EMVA 1288 describes these frames; nothing that was looked for "
           "departs from it by an amount that matters.";
  }
  const size_t others = found.size() - std::min(found.size(), kDescribedInFinding);
  found.resize(found.size() - others);
  return absl::StrCat("The linear model of EMVA 1288 leaves out: ", absl::StrJoin(found, "; "),
                      others > 0 ? absl::StrFormat("; and %d more", others) : "", ".");
}

}  // namespace

void AddDepartures(const std::vector<Departure>& departures, v1::SensorDiagnosis* answer) {
  int tests = 0;
  for (const Departure& departure : departures) tests += departure.testable;
  std::vector<v1::SensorDeparture> messages;
  std::vector<std::string> found;
  for (const Departure& departure : departures) {
    messages.push_back(DepartureMessage(departure, tests));
    if (messages.back().found()) found.push_back(departure.description);
  }
  std::stable_partition(messages.begin(), messages.end(),
                        [](const v1::SensorDeparture& message) { return message.found(); });
  for (v1::SensorDeparture& message : messages) *answer->add_departures() = std::move(message);
  answer->set_verdict(found.empty() ? "none" : "effect");
  answer->set_finding(FindingText(found));
}

}  // namespace sightline
