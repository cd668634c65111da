// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/photon_transfer/transfer_terms.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"
#include "render_worker/sensor_diagnosis/departure_names.h"
#include "render_worker/sensor_diagnosis/frames/frame_means.h"
#include "render_worker/sensor_diagnosis/photon_transfer/material_response.h"
#include "render_worker/sensor_diagnosis/photon_transfer/reciprocity.h"

namespace sightline {
namespace {

// Gain of the log score over left-out steps that a further term must bring [nats], as in the
// diagnosis of plates: odds of twenty.
constexpr double kClearGain_nats = 3;
// Exposure times that differ by a smaller factor do not separate dark current from black level.
// Chosen; docs/diagnosis.md asks users for it.
constexpr double kTimesDiffer = 1.5;
// A smaller variance deficit at saturation does not matter [1]: photon noise of a saturated pixel
// is wrong by half of it. Chosen.
constexpr double kMaterialVarianceDeficit = 0.01;

// Smallest and largest of some positive numbers.
struct PositiveRange {
  double least = 1e300, most = 0;

  void Add(double value) {
    least = std::min(least, value);
    most = std::max(most, value);
  }
  bool Differs() const { return most > kTimesDiffer * least; }
};

std::vector<TransferTerm> PossibleTerms(const FlatFieldSteps& steps) {
  std::vector<TransferTerm> terms = {TransferTerm::kQuadraticResponse, TransferTerm::kCubicResponse,
                                     TransferTerm::kBrighterFatter};
  PositiveRange time_s, rate;
  for (const FlatFieldStatistics* step : steps.bright) {
    time_s.Add(step->exposure_time_s);
    if (step->exposure_time_s <= 0) continue;
    rate.Add(step->photons.value_or(step->exposure_time_s) / step->exposure_time_s);
  }
  // An error of a single exposure time is a scale of the light. If the light is proportional to the
  // time, an offset of the time and constant light have the same effect.
  if (time_s.Differs()) terms.push_back(TransferTerm::kExposureTimeOffset);
  if (!time_s.Differs() || rate.Differs()) terms.push_back(TransferTerm::kStrayLight);
  return terms;
}

TransferData DataOf(const FlatFieldSteps& steps, const Saturation& saturation) {
  TransferData data;
  data.steps = steps.all;
  data.saturation_signal_dn = saturation.signal_dn;
  data.black_level_deviation_dn = DeviationOfFrameMeans(steps.dark);
  data.has_photons = !steps.bright.empty() && steps.bright.front()->photons.has_value();
  PositiveRange time_s;
  for (const FlatFieldStatistics& step : steps.all) time_s.Add(step.exposure_time_s);
  data.fit_dark_current = time_s.Differs();
  return data;
}

// The term whose addition predicts left-out steps best.
struct NextTerm {
  TransferTerm term;
  TransferPrediction prediction;
};

std::set<TransferTerm> With(std::set<TransferTerm> terms, TransferTerm term) {
  terms.insert(term);
  return terms;
}

std::optional<NextTerm> BestNextTerm(const TransferData& data,
                                     const std::vector<TransferTerm>& possible,
                                     const std::set<TransferTerm>& selected) {
  std::optional<NextTerm> next;
  for (const TransferTerm term : possible) {
    if (selected.contains(term)) continue;
    const auto prediction = PredictTransfer(data, With(selected, term));
    if (prediction.ok() && (!next || prediction->log_score > next->prediction.log_score)) {
      next.emplace(NextTerm{term, *prediction});
    }
  }
  return next;
}

// Extends `analysis`, which has the linear model; the selected terms.
std::set<TransferTerm> SelectTerms(const TransferData& data,
                                   const std::vector<TransferTerm>& possible,
                                   TransferAnalysis* analysis) {
  std::set<TransferTerm> selected;
  while (analysis->model_prediction && selected.size() < possible.size()) {
    const auto next = BestNextTerm(data, possible, selected);
    if (!next ||
        next->prediction.log_score < analysis->model_prediction->log_score + kClearGain_nats) {
      break;
    }
    std::set<TransferTerm> terms = With(selected, next->term);
    auto fit = FitTransfer(data, terms);
    if (!fit.ok()) break;
    selected = std::move(terms);
    analysis->model = *std::move(fit);
    analysis->model_prediction = next->prediction;
  }
  return selected;
}

struct TermNames {
  std::string parameter, effect, stage;
};

TermNames NamesOf(TransferTerm term, bool has_photons) {
  switch (term) {
    case TransferTerm::kQuadraticResponse:
      return {"quadratic_response", NamesInVocabulary().quadratic_response, "sensor"};
    case TransferTerm::kCubicResponse:
      // The effect of the vocabulary is quadratic.
      return {"cubic_response", NamesInVocabulary().quadratic_response + std::string(kCubicSuffix),
              "sensor"};
    case TransferTerm::kBrighterFatter:
      return {"variance_deficit_at_saturation", std::string(kVarianceDeficit), "sensor"};
    case TransferTerm::kExposureTimeOffset:
      return {"exposure_time_offset_s", std::string(kExposureTimeOffsetId), "time"};
    case TransferTerm::kStrayLight:
      return {has_photons ? "stray_photons" : "stray_light_of_longest_exposure",
              NamesInVocabulary().stray_light, "illumination"};
  }
  return {};
}

std::string DescriptionOf(TransferTerm term, double value) {
  switch (term) {
    case TransferTerm::kQuadraticResponse:
    case TransferTerm::kCubicResponse:
      return absl::StrFormat(
          "the response is not proportional to the light: %.3g %% at saturation by a term of "
          "degree %d",
          100 * value, term == TransferTerm::kQuadraticResponse ? 2 : 3);
    case TransferTerm::kBrighterFatter:
      return absl::StrFormat(
          "temporal variance is %.3g %% below that of independent photo-electrons at "
          "saturation",
          100 * value);
    case TransferTerm::kExposureTimeOffset:
      return absl::StrFormat(
          "exposure times are longer than stated by %.4g us (light that is there for every "
          "exposure looks the same)",
          1e6 * value);
    case TransferTerm::kStrayLight:
      return absl::StrFormat("%.4g photons more than stated reach every pixel", value);
  }
  return "";
}

bool MattersAt(TransferTerm term, double value) {
  switch (term) {
    case TransferTerm::kQuadraticResponse:
    case TransferTerm::kCubicResponse:
      return std::abs(value) > kMaterialResponse;
    case TransferTerm::kBrighterFatter:
      return std::abs(value) > kMaterialVarianceDeficit;
    case TransferTerm::kExposureTimeOffset:
    case TransferTerm::kStrayLight:
      return true;
  }
  return true;
}

// The likelihood-ratio test of a term, given the other selected terms.
Departure DepartureOfTerm(const TransferData& data, const std::set<TransferTerm>& selected,
                          TransferTerm term) {
  const TermNames names = NamesOf(term, data.has_photons);
  std::set<TransferTerm> others = selected;
  others.erase(term);
  const auto without = FitTransfer(data, others), with = FitTransfer(data, With(others, term));
  Departure departure{.effect = names.effect, .stage = names.stage};
  if (!without.ok() || !with.ok()) {
    departure.testable = false;
    departure.description = "the steps do not determine it beside the other parameters";
    return departure;
  }
  const TransferParameter& parameter = *with->Find(names.parameter);
  // Wilks: twice the gain in log-likelihood is chi squared with one degree of freedom.
  const double gain = std::max(0.0, with->log_likelihood - without->log_likelihood);
  departure.p_value = ChiSquaredTailP(2 * gain, 1);
  departure.description = DescriptionOf(term, parameter.value);
  departure.material = selected.contains(term) && MattersAt(term, parameter.value);
  departure.parameters.push_back(
      {parameter.name, parameter.unit, parameter.value, parameter.standard_error});
  return departure;
}

}  // namespace

absl::StatusOr<TransferAnalysis> AnalyseTransfer(const FlatFieldSteps& steps,
                                                 const Saturation& saturation) {
  const TransferData data = DataOf(steps, saturation);
  TransferAnalysis analysis;
  auto linear = FitTransfer(data, {});
  if (!linear.ok()) {
    if (!absl::IsFailedPrecondition(linear.status())) return linear.status();
    analysis.undetermined = std::string(linear.status().message());
    return analysis;
  }
  analysis.linear = *std::move(linear);
  analysis.model = analysis.linear;
  const auto prediction = PredictTransfer(data, {});
  if (prediction.ok()) analysis.linear_prediction = *prediction;
  analysis.model_prediction = analysis.linear_prediction;
  const std::vector<TransferTerm> possible = PossibleTerms(steps);
  const std::set<TransferTerm> selected = SelectTerms(data, possible, &analysis);
  for (const TransferTerm term : possible) {
    analysis.departures.push_back(DepartureOfTerm(data, selected, term));
  }
  analysis.departures.push_back(ReciprocityFailure(steps.all, *analysis.model));
  return analysis;
}

}  // namespace sightline
