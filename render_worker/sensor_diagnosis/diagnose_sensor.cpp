// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/diagnose_sensor.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "core/recordings/raw_numbers.h"
#include "core/sensor/emva1288_data.h"
#include "core/sensor/sensor.h"
#include "render_worker/sensor/emva1288_measurement.h"
#include "render_worker/sensor_diagnosis/fixed_pattern.h"
#include "render_worker/sensor_diagnosis/flat_field_statistics.h"
#include "render_worker/sensor_diagnosis/frame_departures.h"
#include "render_worker/sensor_diagnosis/photon_transfer_fit.h"
#include "render_worker/sensor_diagnosis/square.h"

namespace sightline {
namespace {

// Averages of fewer frames leave more temporal noise than pattern.
constexpr int kFewestFramesOfPattern = 8;
// Probability, times the number of tests, below which a departure is found.
constexpr double kSignificance = 1e-3;
// Held-out log score that a further term must bring [nats], as in the diagnosis of plates.
constexpr double kClearGain_nats = 3;
// Exposure times that differ less than this do not tell dark current from black level.
constexpr double kTimesDiffer = 1.5;
constexpr double kNormal95 = 1.959964;
// A response that deviates less is as good as linear for a laser line.
constexpr double kMaterialResponse = 1e-3;
constexpr double kMaterialVarianceDeficit = 0.01;

// What all frames of a set come down to.
struct SetStatistics {
  std::vector<FlatFieldStatistics> steps;
  std::vector<int64_t> counts = std::vector<int64_t>(65536, 0);
};

bool IsCancelled(const SensorDiagnosisHooks& hooks) {
  return hooks.cancelled != nullptr && hooks.cancelled->load();
}

absl::StatusOr<SetStatistics> ReadFrames(const v1::SensorSet& set,
                                         const SensorDiagnosisHooks& hooks) {
  SetStatistics result;
  const int largest = (1 << set.bit_depth_bit()) - 1;
  int64_t images = 0, read = 0;
  for (const v1::FlatFieldStep& step : set.steps()) images += step.files_size();
  for (const v1::FlatFieldStep& step : set.steps()) {
    FlatFieldAccumulator frames(largest, step.files_size() >= kFewestFramesOfPattern);
    for (const std::string& file : step.files()) {
      if (IsCancelled(hooks)) return absl::CancelledError("cancelled");
      const auto image = hooks.read_image(file);
      if (!image.ok()) return image.status();
      if (image->columns_px != set.columns_px() || image->rows_px != set.rows_px()) {
        return absl::InvalidArgumentError(
            absl::StrFormat("%s: has %d x %d pixels, the set's description says %d x %d", file,
                            image->columns_px, image->rows_px, set.columns_px(), set.rows_px()));
      }
      for (const uint16_t value : image->values) {
        if (value > largest) {
          return absl::InvalidArgumentError(absl::StrFormat(
              "%s: has the value %d, which %d bits cannot hold (at most %d); numbers must not be "
              "shifted to the upper bits",
              file, value, set.bit_depth_bit(), largest));
        }
        ++result.counts[value];
      }
      frames.Add(*image);
      ++read;
      if (hooks.on_progress) {
        hooks.on_progress(0.8 * static_cast<double>(read) / static_cast<double>(images),
                          "reading frames");
      }
    }
    FlatFieldStatistics statistics = frames.Finish();
    statistics.dark = step.dark();
    statistics.exposure_time_s = step.exposure_time_s();
    if (step.has_photons() && !step.dark()) statistics.photons = step.photons();
    result.steps.push_back(std::move(statistics));
  }
  // A camera may clip below 2^bits - 1.
  const int limit = UpperLimit(result.counts, largest);
  for (FlatFieldStatistics& step : result.steps) {
    if (limit < largest && step.largest_seen_dn == limit) {
      step.share_at_largest = step.share_at_largest_seen;
    }
  }
  return result;
}

class SensorDiagnosis {
 public:
  SensorDiagnosis(const v1::SensorSet& set, const SetStatistics& statistics)
      : set_(set), steps_(statistics.steps), counts_(statistics.counts) {
    for (const FlatFieldStatistics& step : steps_) {
      (step.dark ? dark_ : bright_).push_back(&step);
    }
    answer_.set_set(set.name());
  }

  absl::StatusOr<v1::SensorDiagnosis> Run() {
    for (const std::string& remark : SensorSetRemarks(set_)) Warn(remark);
    FindSaturation();
    MeasureByStandard();
    if (absl::Status status = FitPhotonTransfer(); !status.ok()) return status;
    LookAtPatterns();
    LookAtFrames();
    WriteCamera();
    WriteDepartures();
    return std::move(answer_);
  }

 private:
  struct Quantity {
    std::string name, unit, clause;
    std::optional<Estimate> fitted, emva;
    std::string note = {};
  };

  double DarkMean(double exposure_time_s) const {
    // Of the nearest exposure time.
    const FlatFieldStatistics* nearest = nullptr;
    for (const FlatFieldStatistics* step : dark_) {
      if (!nearest || std::abs(step->exposure_time_s - exposure_time_s) <
                          std::abs(nearest->exposure_time_s - exposure_time_s)) {
        nearest = step;
      }
    }
    return nearest ? nearest->MeanDn() : 0;
  }

  double SignalOf(const FlatFieldStatistics& step) const {
    return step.dark ? 0 : step.MeanDn() - DarkMean(step.exposure_time_s);
  }

  void Warn(const std::string& text) { answer_.add_warnings(text); }

  // The series of EMVA 1288, clause 6.5: pairs with light, in the order of the light, each with a
  // pair in the dark.
  std::vector<ExposureStep> Series() const {
    std::vector<ExposureStep> series;
    for (const FlatFieldStatistics* bright : bright_) {
      const FlatFieldStatistics* dark = nullptr;
      for (const FlatFieldStatistics* step : dark_) {
        if (!dark || std::abs(step->exposure_time_s - bright->exposure_time_s) <
                         std::abs(dark->exposure_time_s - bright->exposure_time_s)) {
          dark = step;
        }
      }
      if (!dark) continue;
      series.push_back({bright->photons.value_or(bright->exposure_time_s), bright->exposure_time_s,
                        bright->pair, dark->pair});
    }
    std::sort(series.begin(), series.end(),
              [](const ExposureStep& a, const ExposureStep& b) { return a.photons < b.photons; });
    series.erase(std::unique(series.begin(), series.end(),
                             [](const ExposureStep& a, const ExposureStep& b) {
                               return a.photons == b.photons;
                             }),
                 series.end());
    return series;
  }

  void FindSaturation() {
    double largest_signal = 0, largest_variance = 0;
    const FlatFieldStatistics* loudest = nullptr;
    for (const FlatFieldStatistics* step : bright_) {
      largest_signal = std::max(largest_signal, SignalOf(*step));
      if (step->pair.temporal_variance_dn2 > largest_variance) {
        largest_variance = step->pair.temporal_variance_dn2;
        loudest = step;
      }
    }
    // Saturation by the largest variance (clause 6.6), if there are brighter steps that are less
    // noisy; else nothing saturates.
    saturated_ = loudest && SignalOf(*loudest) < 0.999 * largest_signal;
    for (const FlatFieldStatistics* step : bright_) saturated_ |= step->share_at_largest > 0.5;
    saturation_signal_dn_ = saturated_ && loudest ? SignalOf(*loudest) : 1.12 * largest_signal;
  }

  void MeasureByStandard() {
    if (auto transfer = MeasurePhotonTransfer(Series()); transfer.ok()) {
      emva_ = *std::move(transfer);
    } else {
      Warn(
          absl::StrCat("no values by the definitions of EMVA 1288: ", transfer.status().message()));
    }
    std::vector<DarkStep> steps;
    for (const FlatFieldStatistics* step : dark_) {
      steps.push_back({step->exposure_time_s, step->pair});
    }
    if (!emva_) return;
    if (auto dark = MeasureDarkCurrent(steps, emva_->gain_dn_per_electron); dark.ok()) {
      emva_dark_ = *std::move(dark);
    }
  }

  std::vector<TransferTerm> PossibleTerms() const {
    std::vector<TransferTerm> terms = {TransferTerm::kQuadraticResponse,
                                       TransferTerm::kCubicResponse, TransferTerm::kBrighterFatter};
    double least_s = 1e300, most_s = 0, least_rate = 1e300, most_rate = 0;
    for (const FlatFieldStatistics* step : bright_) {
      least_s = std::min(least_s, step->exposure_time_s);
      most_s = std::max(most_s, step->exposure_time_s);
      if (step->exposure_time_s <= 0) continue;
      const double rate = step->photons.value_or(step->exposure_time_s) / step->exposure_time_s;
      least_rate = std::min(least_rate, rate);
      most_rate = std::max(most_rate, rate);
    }
    // Of light proportional to the time, an offset of the time and light that is always there
    // are the same; of one time only, an offset is the light's scale.
    const bool times_differ = most_s > kTimesDiffer * least_s;
    if (times_differ) terms.push_back(TransferTerm::kExposureTimeOffset);
    if (!times_differ || most_rate > kTimesDiffer * least_rate) {
      terms.push_back(TransferTerm::kStrayLight);
    }
    return terms;
  }

  absl::Status FitPhotonTransfer() {
    TransferData data;
    data.steps = steps_;
    data.saturation_signal_dn = saturation_signal_dn_;
    data.black_level_scatter_dn = ScatterOfFrameMeans(dark_);
    data.has_photons = !bright_.empty() && bright_.front()->photons.has_value();
    double least_s = 1e300, most_s = 0;
    for (const FlatFieldStatistics& step : steps_) {
      least_s = std::min(least_s, step.exposure_time_s);
      most_s = std::max(most_s, step.exposure_time_s);
    }
    data.fit_dark_current = most_s > kTimesDiffer * least_s;
    auto linear = FitTransfer(data, {});
    if (!linear.ok()) {
      if (!absl::IsFailedPrecondition(linear.status())) return linear.status();
      transfer_note_ = std::string(linear.status().message());
      Warn(absl::StrCat("gain and what follows from it are not determined: ", transfer_note_));
      return absl::OkStatus();
    }
    linear_ = *std::move(linear);
    model_ = linear_;
    const auto linear_prediction = PredictTransfer(data, {});
    std::optional<TransferPrediction> best;
    if (linear_prediction.ok()) best = *linear_prediction;
    // The term that predicts best is taken, as long as one clearly helps.
    std::set<TransferTerm> taken;
    const std::vector<TransferTerm> possible = PossibleTerms();
    while (best && taken.size() < possible.size()) {
      std::optional<std::pair<TransferTerm, TransferPrediction>> next;
      for (const TransferTerm term : possible) {
        if (taken.contains(term)) continue;
        std::set<TransferTerm> terms = taken;
        terms.insert(term);
        const auto prediction = PredictTransfer(data, terms);
        if (prediction.ok() && (!next || prediction->log_score > next->second.log_score)) {
          next.emplace(term, *prediction);
        }
      }
      if (!next || next->second.log_score < best->log_score + kClearGain_nats) break;
      std::set<TransferTerm> terms = taken;
      terms.insert(next->first);
      auto fit = FitTransfer(data, terms);
      if (!fit.ok()) break;
      taken = terms;
      model_ = *std::move(fit);
      best = next->second;
    }
    WriteFit(*linear_, linear_prediction.ok() ? &*linear_prediction : nullptr,
             linear_prediction.ok() ? &*linear_prediction : nullptr, answer_.mutable_linear_fit());
    WriteFit(*model_, best ? &*best : nullptr,
             linear_prediction.ok() ? &*linear_prediction : nullptr, answer_.mutable_model_fit());
    WriteTransferPoints();
    for (const TransferTerm term : possible) AddTransferDeparture(data, taken, term);
    LookAtReciprocity();
    return absl::OkStatus();
  }

  void WriteFit(const TransferFit& fit, const TransferPrediction* prediction,
                const TransferPrediction* reference, v1::SensorFit* message) {
    message->set_chi_squared(fit.chi_squared);
    message->set_degrees_of_freedom(fit.degrees_of_freedom);
    if (prediction && reference) {
      message->set_held_out_chi_squared(prediction->chi_squared);
      message->set_held_out_numbers(prediction->numbers);
      message->set_held_out_log_score_gain(prediction->log_score - reference->log_score);
    }
    for (const TransferParameter& p : fit.parameters) {
      v1::SensorParameter* parameter = message->add_parameters();
      parameter->set_name(p.name);
      parameter->set_unit(p.unit);
      parameter->set_value(p.value);
      parameter->set_standard_error(p.standard_error);
    }
  }

  void WriteTransferPoints() {
    const double black = model_->Value("black_level_dn");
    const double quiet = Square(model_->Value("gain_dn_per_electron")) *
                         model_->Value("dark_noise_variance_electrons2");
    for (size_t i = 0; i < model_->points.size(); ++i) {
      const TransferPoint &point = model_->points[i], &linear = linear_->points[i];
      const FlatFieldStatistics& step = steps_[point.step];
      if (step.dark) continue;
      v1::PhotonTransferPoint* message = answer_.add_photon_transfer();
      message->set_exposure_time_s(step.exposure_time_s);
      if (step.photons) message->set_photons(*step.photons);
      message->set_mean_dn(point.mean_dn - black);
      message->set_mean_standard_error_dn(point.mean_standard_error_dn);
      message->set_variance_dn2(point.variance_dn2 - quiet);
      message->set_variance_standard_error_dn2(point.variance_standard_error_dn2);
      message->set_model_mean_dn(point.expected_mean_dn - black);
      message->set_model_variance_dn2(point.expected_variance_dn2 - quiet);
      message->set_linear_mean_dn(linear.expected_mean_dn - black);
      message->set_linear_variance_dn2(linear.expected_variance_dn2 - quiet);
    }
    for (const FlatFieldStatistics* step : bright_) {
      if (IsBelowSaturation(*step, DarkMean(step->exposure_time_s), saturation_signal_dn_)) {
        continue;
      }
      v1::PhotonTransferPoint* message = answer_.add_photon_transfer();
      message->set_exposure_time_s(step->exposure_time_s);
      if (step->photons) message->set_photons(*step->photons);
      message->set_mean_dn(step->MeanDn() - black);
      message->set_variance_dn2(step->pair.temporal_variance_dn2 - quiet);
      message->set_saturated(true);
    }
  }

  struct TermText {
    const char *parameter, *effect, *stage;
  };
  static TermText TextOf(TransferTerm term, bool has_photons) {
    switch (term) {
      case TransferTerm::kQuadraticResponse:
        return {"quadratic_response", "sensor.response_nonlinearity", "sensor"};
      case TransferTerm::kCubicResponse:
        return {"cubic_response", "sensor.response_nonlinearity_cubic", "sensor"};
      case TransferTerm::kBrighterFatter:
        return {"variance_deficit_at_saturation", "variance_deficit", "sensor"};
      case TransferTerm::kExposureTimeOffset:
        return {"exposure_time_offset_s", "time.exposure_time_offset", "time"};
      case TransferTerm::kStrayLight:
        return {has_photons ? "stray_photons" : "stray_light_of_longest_exposure",
                "illumination.ambient_light", "illumination"};
    }
    return {"", "", ""};
  }

  void AddTransferDeparture(const TransferData& data, const std::set<TransferTerm>& taken,
                            TransferTerm term) {
    const TermText text = TextOf(term, data.has_photons);
    // Against the model without it, all else as taken.
    std::set<TransferTerm> without = taken, with = taken;
    without.erase(term);
    with.insert(term);
    const auto smaller = FitTransfer(data, without), larger = FitTransfer(data, with);
    Departure departure{.effect = text.effect, .stage = text.stage};
    if (!smaller.ok() || !larger.ok()) {
      departure.testable = false;
      departure.description = "the steps do not determine it beside the other parameters";
      departures_.push_back(std::move(departure));
      return;
    }
    const TransferParameter& parameter = *larger->Find(text.parameter);
    // Wilks: twice the gain in log-likelihood is chi squared of one.
    const double gain = std::max(0.0, larger->log_likelihood - smaller->log_likelihood);
    departure.p_value = ChiSquaredTailP(2 * gain, 1);
    const bool predicts = taken.contains(term);
    const double value = parameter.value;
    switch (term) {
      case TransferTerm::kQuadraticResponse:
      case TransferTerm::kCubicResponse:
        departure.description = absl::StrFormat(
            "the response is not proportional to the light: %.3g %% at saturation by a term of "
            "degree %d",
            100 * value, term == TransferTerm::kQuadraticResponse ? 2 : 3);
        departure.material = predicts && std::abs(value) > kMaterialResponse;
        break;
      case TransferTerm::kBrighterFatter:
        departure.description = absl::StrFormat(
            "temporal variance is %.3g %% below that of independent photo-electrons at "
            "saturation",
            100 * value);
        departure.material = predicts && std::abs(value) > kMaterialVarianceDeficit;
        break;
      case TransferTerm::kExposureTimeOffset:
        departure.description = absl::StrFormat(
            "exposure times are longer than stated by %.4g us (light that is there for every "
            "exposure looks the same)",
            1e6 * value);
        departure.material = predicts;
        break;
      case TransferTerm::kStrayLight:
        departure.description =
            absl::StrFormat("%.4g photons more than stated reach every pixel", value);
        departure.material = predicts;
        break;
    }
    departure.parameters.push_back(
        {parameter.name, parameter.unit, value, parameter.standard_error});
    departures_.push_back(std::move(departure));
  }

  // The same light in a shorter or longer time gives the same signal.
  void LookAtReciprocity() {
    Departure departure{.effect = "reciprocity_failure", .stage = "time"};
    double n = 0, x = 0, r = 0, xx = 0, xr = 0, light = 0, x_light = 0, light2 = 0;
    for (const TransferPoint& point : model_->points) {
      const FlatFieldStatistics& step = steps_[point.step];
      if (step.dark || !step.photons || *step.photons <= 0 || step.exposure_time_s <= 0) continue;
      const double log_time = std::log(step.exposure_time_s), log_light = std::log(*step.photons);
      const double residual =
          (point.mean_dn - point.expected_mean_dn) /
          std::max(point.expected_mean_dn - model_->Value("black_level_dn"), 1e-9);
      ++n;
      x += log_time;
      r += residual;
      xx += log_time * log_time;
      xr += log_time * residual;
      light += log_light;
      light2 += log_light * log_light;
      x_light += log_time * log_light;
    }
    const double variance = n > 2 ? xx / n - Square(x / n) : 0;
    const double light_variance = n > 2 ? light2 / n - Square(light / n) : 0;
    const double covariance = n > 2 ? x_light / n - x * light / n / n : 0;
    if (variance < 1e-3 || Square(covariance) > 0.98 * variance * light_variance) {
      departure.testable = false;
      departure.description =
          "needs the same number of photons at exposure times that differ ten-fold (weaker light "
          "for longer)";
      departures_.push_back(std::move(departure));
      return;
    }
    const double slope = (xr / n - x * r / n / n) / variance;
    double rest = 0;
    for (const TransferPoint& point : model_->points) {
      const FlatFieldStatistics& step = steps_[point.step];
      if (step.dark || !step.photons || *step.photons <= 0 || step.exposure_time_s <= 0) continue;
      const double residual =
          (point.mean_dn - point.expected_mean_dn) /
          std::max(point.expected_mean_dn - model_->Value("black_level_dn"), 1e-9);
      rest += Square(residual - r / n - slope * (std::log(step.exposure_time_s) - x / n));
    }
    const double error = std::sqrt(rest / (n - 2) / (n * variance));
    departure.description = absl::StrFormat(
        "signal of the same light grows with the exposure time to the power of %.3g", slope);
    departure.p_value = TwoSidedP(slope / error);
    departure.material = std::abs(slope) > kMaterialResponse;
    departure.parameters.push_back({"exponent", "", slope, error});
    departures_.push_back(std::move(departure));
  }

  // The step with most frames; nullptr if none has enough.
  const FlatFieldStatistics* Averaged(const std::vector<const FlatFieldStatistics*>& steps) const {
    const FlatFieldStatistics* most = nullptr;
    for (const FlatFieldStatistics* step : steps) {
      if (step->mean_dn.empty() || step->share_at_largest > 0.01) continue;
      if (!most || step->frames() > most->frames()) most = step;
    }
    return most;
  }

  void LookAtPatterns() {
    const FlatFieldStatistics *dark = Averaged(dark_), *bright = Averaged(bright_);
    if (dark) {
      dark_pattern_ =
          DarkPattern(dark->mean_dn, dark->noise.variance_1_apart_dn2->value, dark->frames());
      Add(PatternDepartures(*dark_pattern_, true));
      AddCurve("Offsets of the columns", "column_px", "offset_dn", ColumnMeans(*dark_pattern_));
      AddCurve("Offsets of the rows", "row_px", "offset_dn", RowMeans(*dark_pattern_));
    } else {
      departures_.push_back({.effect = "dark_pattern",
                             .stage = "readout",
                             .description = absl::StrFormat(
                                 "needs at least %d frames in the dark under the same conditions",
                                 kFewestFramesOfPattern),
                             .testable = false});
    }
    if (bright && dark) {
      bright_pattern_ =
          BrightPattern(bright->mean_dn, dark->mean_dn, bright->noise.variance_1_apart_dn2->value,
                        dark->noise.variance_1_apart_dn2->value, bright->frames(), dark->frames());
      Add(PatternDepartures(*bright_pattern_, false));
      departures_.push_back(LightFallOff(*bright_pattern_));
      AddCurve("Sensitivity of the columns", "column_px", "deviation_relative",
               ColumnMeans(*bright_pattern_));
      AddCurve("Sensitivity of the rows", "row_px", "deviation_relative",
               RowMeans(*bright_pattern_));
      if (emva_) {
        const double gain = emva_->gain_dn_per_electron.value;
        Estimate dsnu = dark_pattern_->Strength();
        dsnu.value /= gain;
        dsnu.standard_error /= gain;
        dsnu_ = dsnu;
      }
      prnu_ = bright_pattern_->Strength();
    } else {
      departures_.push_back({.effect = "bright_pattern",
                             .stage = "sensor",
                             .description = absl::StrFormat(
                                 "needs at least %d frames under the same light, and as many dark",
                                 kFewestFramesOfPattern),
                             .testable = false});
    }
  }

  void LookAtFrames() {
    std::vector<const FlatFieldStatistics*> unsaturated;
    for (const FlatFieldStatistics* step : bright_) {
      if (IsBelowSaturation(*step, DarkMean(step->exposure_time_s), saturation_signal_dn_)) {
        unsaturated.push_back(step);
      }
    }
    Add(FrameMeanDepartures(unsaturated, false));
    Add(FrameMeanDepartures(dark_, true));
    departures_.push_back(FrameCorrelation(unsaturated));
    departures_.push_back(FirstFrameDeficit(unsaturated));
    Add(LineNoiseDepartures(dark_));
    std::vector<const FlatFieldStatistics*> all = unsaturated;
    all.insert(all.end(), dark_.begin(), dark_.end());
    std::vector<double> signal;
    for (const FlatFieldStatistics* step : all) signal.push_back(SignalOf(*step));
    Add(NeighbourDepartures(all, signal));
    double at_zero = 0;
    for (const FlatFieldStatistics* step : dark_) {
      at_zero = std::max(at_zero, step->share_at_zero);
    }
    Add(ConverterDepartures(counts_, set_.bit_depth_bit(), at_zero));
  }

  void Add(std::vector<Departure> departures) {
    for (Departure& departure : departures) departures_.push_back(std::move(departure));
  }

  void AddCurve(const std::string& title, const std::string& abscissa, const std::string& ordinate,
                const std::vector<double>& values) {
    v1::SensorCurve* curve = answer_.add_curves();
    curve->set_title(title);
    curve->set_abscissa(abscissa);
    curve->set_ordinate(ordinate);
    for (size_t i = 0; i < values.size(); ++i) {
      curve->add_abscissa_values(static_cast<double>(i));
      curve->add_values(values[i]);
    }
  }

  void AddQuantity(const Quantity& quantity) {
    v1::SensorQuantity* message = answer_.add_quantities();
    message->set_name(quantity.name);
    message->set_unit(quantity.unit);
    message->set_clause(quantity.clause);
    message->set_note(quantity.note);
    if (quantity.fitted) {
      message->set_value(quantity.fitted->value);
      message->set_lower(quantity.fitted->Lower95());
      message->set_upper(quantity.fitted->Upper95());
    }
    if (quantity.emva) {
      message->set_emva_value(quantity.emva->value);
      message->set_emva_lower(quantity.emva->Lower95());
      message->set_emva_upper(quantity.emva->Upper95());
    }
  }

  std::optional<Estimate> Fitted(const char* name) const {
    if (!model_) return std::nullopt;
    const TransferParameter* parameter = model_->Find(name);
    if (!parameter) return std::nullopt;
    return Estimate{parameter->value, parameter->standard_error};
  }

  template <typename Member>
  std::optional<Estimate> ByStandard(Member member) const {
    if (!emva_) return std::nullopt;
    return (*emva_).*member;
  }

  // Standard error by the first derivative.
  static std::optional<Estimate> Root(const std::optional<Estimate>& square) {
    if (!square || square->value <= 0) return std::nullopt;
    const double root = std::sqrt(square->value);
    return Estimate{root, square->standard_error / (2 * root)};
  }

  void WriteCamera() {
    Sensor sensor;
    sensor.name = set_.name();
    sensor.columns_px = set_.columns_px();
    sensor.rows_px = set_.rows_px();
    sensor.bit_depth_bit = set_.bit_depth_bit();
    const auto gain = Fitted("gain_dn_per_electron");
    const auto efficiency = Fitted("quantum_efficiency");
    const auto dark_noise = Root(Fitted("dark_noise_variance_electrons2"));
    const auto black = Fitted("black_level_dn");
    const auto dark_current = Fitted("dark_current_electrons_per_s");
    AddQuantity({"gain_dn_per_electron", "DN/e-", "6.6", gain,
                 ByStandard(&PhotonTransfer::gain_dn_per_electron), transfer_note_});
    AddQuantity({"quantum_efficiency", "", "6.6", efficiency,
                 efficiency ? ByStandard(&PhotonTransfer::quantum_efficiency) : std::nullopt,
                 efficiency ? "" : "the data file gives no photons"});
    AddQuantity(
        {"dark_noise_electrons", "e-", "6.6", dark_noise,
         ByStandard(&PhotonTransfer::dark_noise_electrons),
         emva_ && emva_->dark_noise_is_upper_bound ? "quantisation hides it: upper bound" : ""});
    AddQuantity({"black_level_dn", "DN", "7.1", black, std::nullopt,
                 "mean without light at exposure time 0"});
    AddQuantity({"dark_current_electrons_per_s", "e-/s", "7.1", dark_current,
                 emva_dark_ ? std::optional(emva_dark_->from_mean_electrons_per_s) : std::nullopt,
                 dark_current ? "" : "all exposure times are nearly the same"});
    std::optional<Estimate> capacity;
    if (gain && saturated_) {
      capacity = Estimate{saturation_signal_dn_ / gain->value,
                          saturation_signal_dn_ / Square(gain->value) * gain->standard_error};
    }
    AddQuantity(
        {"saturation_capacity_electrons", "e-", "6.6", capacity,
         saturated_ ? ByStandard(&PhotonTransfer::saturation_capacity_electrons) : std::nullopt,
         saturated_ ? "by the largest variance" : "no step saturates"});
    if (emva_) {
      AddQuantity({"sensitivity_threshold_photons", "photons", "6.8", std::nullopt,
                   ByStandard(&PhotonTransfer::sensitivity_threshold_photons)});
      AddQuantity({"dynamic_range", "", "6.8", std::nullopt, Estimate{emva_->dynamic_range, 0}});
      AddQuantity({"largest_snr", "", "6.8", std::nullopt, Estimate{emva_->largest_snr, 0}});
      AddQuantity(
          {"linearity_error_relative", "", "6.9", std::nullopt,
           Estimate{emva_->linearity_error_relative, 0},
           absl::StrFormat("temporal noise alone gives %.2g", emva_->linearity_noise_relative)});
    }
    std::optional<Estimate> dsnu, prnu = prnu_;
    if (dark_pattern_ && gain) {
      const Estimate strength = dark_pattern_->Strength();
      dsnu = Estimate{strength.value / gain->value, strength.standard_error / gain->value};
    }
    const char* pattern_note =
        "the smooth course and pixels more than six standard deviations out are taken off";
    AddQuantity({"dsnu_electrons", "e-", "8.2", dsnu, dsnu_, dsnu ? pattern_note : ""});
    AddQuantity({"prnu_relative", "", "8.2", prnu, prnu_, prnu ? pattern_note : ""});

    if (gain) sensor.gain_dn_per_electron = gain->value;
    const double eta = efficiency ? std::clamp(efficiency->value, 0.0, 1.0) : kUnknownEfficiency;
    sensor.quantum_efficiency[0] = {{550e-9}, {eta}};
    if (efficiency && efficiency->value > 1) {
      Warn(
          absl::StrFormat("the quantum efficiency comes out as %.3g, above 1: the photons of the "
                          "data file are too few",
                          efficiency->value));
    }
    if (dark_noise) sensor.dark_noise_electrons = dark_noise->value;
    sensor.black_level_dn = black ? std::max(0.0, black->value) : std::max(0.0, DarkMean(0));
    if (dark_current) sensor.dark_current_electrons_per_s = std::max(0.0, dark_current->value);
    if (capacity) {
      sensor.saturation_capacity_electrons = capacity->value;
    } else if (gain) {
      sensor.saturation_capacity_electrons =
          (sensor.largest_dn() - sensor.black_level_dn) / gain->value;
    }
    if (dsnu) sensor.dsnu_electrons = dsnu->value;
    if (prnu) sensor.prnu_relative = prnu->value;
    *answer_.mutable_camera() = SensorToProto(sensor);
    answer_.mutable_camera()->set_source("measured from flat-field and dark frames");
    Warn("the pixel pitch is not measured; camera.json has the default of 5.3 um");
    if (!efficiency) {
      Warn(absl::StrFormat("the quantum efficiency is not measured; camera.json has %.2g",
                           kUnknownEfficiency));
    }
  }

  void WriteDepartures() {
    int tests = 0;
    for (const Departure& departure : departures_) tests += departure.testable;
    std::vector<v1::SensorDeparture> messages;
    std::vector<std::string> found;
    for (const Departure& departure : departures_) {
      v1::SensorDeparture message;
      message.set_effect(departure.effect);
      message.set_stage(departure.stage);
      message.set_description(departure.description);
      message.set_testable(departure.testable);
      const double p = std::min(1.0, departure.p_value * tests);
      message.set_p_value(departure.testable ? p : 1);
      message.set_found(departure.testable && departure.material && p < kSignificance);
      for (const DepartureParameter& parameter : departure.parameters) {
        v1::SensorParameter* out = message.add_parameters();
        out->set_name(parameter.name);
        out->set_unit(parameter.unit);
        out->set_value(parameter.value);
        out->set_standard_error(parameter.standard_error);
      }
      if (message.found()) found.push_back(departure.description);
      messages.push_back(std::move(message));
    }
    // What is found comes first; in the order of the tests, which is that of the signal: transfer,
    // patterns, frames, converter.
    std::stable_partition(messages.begin(), messages.end(),
                          [](const v1::SensorDeparture& message) { return message.found(); });
    for (v1::SensorDeparture& message : messages) *answer_.add_departures() = std::move(message);
    answer_.set_verdict(found.empty() ? "none" : "effect");
    answer_.set_finding(FindingText(found));
  }

  static std::string FindingText(std::vector<std::string> found) {
    if (found.empty()) {
      return "The linear model of EMVA 1288 describes these frames; nothing that was looked for "
             "departs from it by an amount that matters.";
    }
    const size_t others = found.size() - std::min(found.size(), kNamedInFinding);
    found.resize(found.size() - others);
    return absl::StrCat("The linear model of EMVA 1288 leaves out: ", absl::StrJoin(found, "; "),
                        others > 0 ? absl::StrFormat("; and %d more", others) : "", ".");
  }

  // Where no photons are given: a camera file must have one.
  static constexpr double kUnknownEfficiency = 0.5;
  static constexpr size_t kNamedInFinding = 2;

  const v1::SensorSet& set_;
  const std::vector<FlatFieldStatistics>& steps_;
  const std::vector<int64_t>& counts_;
  std::vector<const FlatFieldStatistics*> dark_, bright_;
  double saturation_signal_dn_ = 0;
  bool saturated_ = false;
  std::optional<PhotonTransfer> emva_;
  std::optional<DarkCurrent> emva_dark_;
  std::optional<TransferFit> linear_, model_;
  std::string transfer_note_;
  std::optional<FixedPattern> dark_pattern_, bright_pattern_;
  std::optional<Estimate> dsnu_, prnu_;
  std::vector<Departure> departures_;
  v1::SensorDiagnosis answer_;
};

}  // namespace

absl::StatusOr<v1::SensorDiagnosis> DiagnoseSensor(const v1::SensorSet& set,
                                                   const SensorDiagnosisHooks& hooks) {
  const auto statistics = ReadFrames(set, hooks);
  if (!statistics.ok()) return statistics.status();
  if (hooks.on_progress) hooks.on_progress(0.8, "fitting the photon transfer");
  auto answer = SensorDiagnosis(set, *statistics).Run();
  if (hooks.on_progress) hooks.on_progress(1, "done");
  return answer;
}

}  // namespace sightline
