#include "render_worker/diagnosis/fit_quality.h"

#include <algorithm>
#include <boost/math/special_functions/gamma.hpp>
#include <cmath>
#include <map>
#include <numbers>
#include <string>
#include <string_view>

#include "core/random/counter_random.h"
#include "render_worker/diagnosis/linear_fit.h"
#include "render_worker/sensor/expose.h"

namespace sightline {

namespace {

// Mean signal of a recording's profiles over what the fit expects; 0: no laser light.
double IntensityRatio(const SetModel& model, const FitResult& fit, int frame) {
  const Sensor& sensor = model.set().frames[frame].nominal.sensor;
  const double black_dn = DarkMeanDn(sensor);
  double observed = 0, expected = 0;
  for (int e = 0; e < model.entries(); ++e) {
    if (model.StatisticOf(e).name() != "profile") continue;
    for (int row = 0; row < static_cast<int>(fit.mean[e].size()); ++row) {
      if (model.FrameOfRow(e, row) != frame) continue;
      observed += model.observed()[e][row] - black_dn;
      expected += fit.mean[e][row] - black_dn;
    }
  }
  return expected > 0 ? observed / expected : 0;
}

}  // namespace

std::vector<bool> HeldOutRecordings(const RecordedSet& set, uint64_t seed, int fold) {
  std::vector<bool> held_out(set.frames.size(), false);
  const auto drawn = [&](const char* what, int id) {
    return CounterRandom(DeriveSeed(seed, what), static_cast<uint64_t>(id)).Uniform();
  };
  // In blocks of four, so that a quarter is held out whatever is drawn.
  std::map<int, int> order;  // of plate positions
  for (const RecordedFrame& frame : set.frames) {
    if (frame.plate_position_id >= 0) order.emplace(frame.plate_position_id, 0);
  }
  int position = 0;
  for (auto& [id, index] : order) index = position++;
  const auto chosen = [&](const char* what, int index) {
    const int first = static_cast<int>(kFolds * drawn(what, index / kFolds));
    return index % kFolds == (first + fold) % kFolds;
  };
  int dark = 0;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    const int id = set.frames[f].plate_position_id;
    held_out[f] =
        id >= 0 ? chosen("held-out positions", order[id]) : chosen("held-out dark", dark++);
  }
  return held_out;
}

double ChiSquaredPValue(double chi_squared, int degrees_of_freedom) {
  if (degrees_of_freedom <= 0) return 1;
  return boost::math::gamma_q(0.5 * degrees_of_freedom, 0.5 * std::max(0.0, chi_squared));
}

EntrySplit SplitEntries(const SetModel& model, const std::vector<bool>& held_out_recording) {
  EntrySplit split;
  for (int e = 0; e < model.entries(); ++e) {
    const std::vector<int>& frames = model.FramesOf(e);
    const auto out = [&](int f) { return static_cast<bool>(held_out_recording[f]); };
    split.used.push_back(std::none_of(frames.begin(), frames.end(), out));
    split.held_out.push_back(std::all_of(frames.begin(), frames.end(), out));
  }
  return split;
}

PredictedFit PredictEntries(const FitResult& fit, const std::vector<bool>& use_entry,
                            const std::vector<bool>& predict_entry) {
  const LinearFit used(fit, use_entry);
  const Eigen::VectorXd step = used.Step();
  // Parameters the used entries do not determine (the line's place on another plate position) count
  // as far as they are uncertain: chi squared of r under I + J C J', C their covariance.
  Eigen::MatrixXd information = used.information();
  Eigen::VectorXd gradient = Eigen::VectorXd::Zero(step.size());
  PredictedFit predicted;
  for (size_t e = 0; e < fit.residual.size(); ++e) {
    if (!predict_entry[e]) continue;
    Eigen::MatrixXd jacobian = fit.jacobian[e];
    for (size_t i = 0; i < fit.held.size(); ++i) {
      if (fit.held[i]) jacobian.col(static_cast<Eigen::Index>(i)).setZero();
    }
    const Eigen::VectorXd residual = fit.residual[e] - jacobian * step;
    predicted.chi_squared += residual.squaredNorm();
    predicted.degrees_of_freedom += static_cast<int>(residual.size());
    information.noalias() += jacobian.transpose() * jacobian;
    gradient.noalias() += jacobian.transpose() * residual;
  }
  predicted.chi_squared -= gradient.dot(information.llt().solve(gradient));
  return predicted;
}

PredictedFit CrossValidate(const SetModel& model, const FitResult& fit, uint64_t seed) {
  PredictedFit all;
  for (int fold = 0; fold < kFolds; ++fold) {
    const EntrySplit split = SplitEntries(model, HeldOutRecordings(model.set(), seed, fold));
    const PredictedFit predicted = PredictEntries(fit, split.used, split.held_out);
    all.chi_squared += predicted.chi_squared;
    all.degrees_of_freedom += predicted.degrees_of_freedom;
  }
  return all;
}

v1::ModelFit DescribeFit(const SetModel& model, const FitResult& fit) {
  v1::ModelFit description;
  description.set_chi_squared(fit.chi_squared);
  description.set_degrees_of_freedom(fit.data_count);
  description.set_p_value(ChiSquaredPValue(fit.chi_squared, fit.data_count));
  SetupDeviation uncertainty = model.set().description.uncertainty;
  SetupDeviation deviations = fit.parameters.deviations;
  int column = 0;
  for (int i = 0; i < kDeviations; ++i) {
    const double stated = DeviationAt(uncertainty, i);
    if (stated <= 0) continue;
    const double scale =
        std::string_view(kDeviationNames[i]) == "incidence_angle_deg" ? 180 / std::numbers::pi : 1;
    v1::FittedDeviation* deviation = description.add_deviations();
    deviation->set_name(kDeviationNames[i]);
    deviation->set_standard_uncertainty(scale * stated);
    deviation->set_value(scale * DeviationAt(deviations, i));
    deviation->set_standard_error(scale * stated * std::sqrt(fit.covariance(column, column)));
    ++column;
  }
  std::vector<double> chi_squared(model.set().frames.size(), 0);
  std::vector<int> count(chi_squared.size(), 0);
  for (int e = 0; e < model.entries(); ++e) {
    for (int row = 0; row < static_cast<int>(fit.residual[e].size()); ++row) {
      const int frame = model.FrameOfRow(e, row);
      chi_squared[frame] += fit.residual[e][row] * fit.residual[e][row];
      ++count[frame];
    }
  }
  for (size_t f = 0; f < chi_squared.size(); ++f) {
    v1::RecordingFit* recording = description.add_recordings();
    recording->set_recording(static_cast<int>(f));
    recording->set_held_out(true);
    recording->set_chi_squared(chi_squared[f]);
    recording->set_degrees_of_freedom(count[f]);
    if (model.set().frames[f].plate_position_id < 0) continue;
    const double ratio = IntensityRatio(model, fit, static_cast<int>(f));
    if (ratio > 0) recording->set_intensity_ratio(ratio);
  }
  return description;
}

v1::HeldOutImprovement DescribeImprovement(const SetModel& model, const FitResult& null,
                                           const FitResult& best, uint64_t seed) {
  v1::HeldOutImprovement improvement;
  improvement.set_measure(
      "chi^2 per degree of freedom; every recording by a fit to three quarters of the others");
  for (size_t f = 0; f < model.set().frames.size(); ++f) {
    improvement.add_recordings(static_cast<int>(f));
  }
  const PredictedFit before = CrossValidate(model, null, seed);
  const PredictedFit after = CrossValidate(model, best, seed);
  if (before.degrees_of_freedom > 0) {
    improvement.set_null(before.chi_squared / before.degrees_of_freedom);
    improvement.set_with_effect(after.chi_squared / after.degrees_of_freedom);
  }
  std::vector<std::string> names;
  for (int e = 0; e < model.entries(); ++e) {
    const std::string name(model.StatisticOf(e).name());
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  for (const std::string& name : names) {
    std::vector<bool> others, these;
    for (int e = 0; e < model.entries(); ++e) {
      these.push_back(model.StatisticOf(e).name() == name);
      others.push_back(!these.back());
    }
    const PredictedFit null_fit = PredictEntries(null, others, these);
    const PredictedFit best_fit = PredictEntries(best, others, these);
    v1::ObservableFit* observable = improvement.add_observables();
    observable->set_observable(name);
    observable->set_null_chi_squared(null_fit.chi_squared);
    observable->set_model_chi_squared(best_fit.chi_squared);
    observable->set_degrees_of_freedom(null_fit.degrees_of_freedom);
  }
  return improvement;
}

}  // namespace sightline
