// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/correction/rendered_correction.h"

#include <Eigen/Cholesky>
#include <cassert>
#include <map>
#include <utility>

#include "absl/status/status.h"
#include "core/random/counter_random.h"
#include "core/status/status_macros.h"
#include "render_worker/diagnosis/fit/model_error.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/recordings/plate_frames.h"

namespace sightline {
namespace {

// Recording `index` at the fitted deviations, with random values by `seed`.
FrameSetup FrameAt(const RecordedSet& set, int index, const SetParameters& parameters,
                   uint64_t seed) {
  SetupDeviation deviations = parameters.deviations;
  const auto shift = parameters.line_shift_px.find(set.frames[index].plate_position_id);
  if (shift != parameters.line_shift_px.end()) deviations.line_position_each_px = shift->second;
  FrameSetup frame = DeviatedFrame(set, index, deviations);
  frame.seeds = PlateFrame(set.description, index, {.deviation = {}, .seed = seed}).seeds;
  return frame;
}

absl::StatusOr<RecordedSet> RenderSet(const SetModel& model, const SetParameters& parameters,
                                      uint64_t seed, const std::function<bool()>& proceed) {
  RecordedSet rendered = model.set();
  Image<double> previous;
  for (size_t f = 0; f < rendered.frames.size(); ++f) {
    if (!proceed()) return absl::CancelledError("rendering cancelled");
    const FrameSetup frame = FrameAt(model.set(), static_cast<int>(f), parameters, seed);
    SIGHTLINE_ASSIGN_OR_RETURN(
        FormedImage image,
        RenderPlateFrame(frame, model.EffectsOf(parameters),
                         frame.burst_frame_index > 0 ? &previous : nullptr, model.threads()));
    rendered.frames[f].raw_dn = std::move(image.raw_dn);
    previous = std::move(image.mean_photo_electrons);
  }
  return rendered;
}

BlockVectors MeanOver(const std::vector<BlockVectors>& rendered) {
  BlockVectors mean = rendered.front();
  for (size_t k = 1; k < rendered.size(); ++k) {
    for (size_t e = 0; e < mean.size(); ++e) mean[e] += rendered[k][e];
  }
  for (Eigen::VectorXd& block : mean) block /= static_cast<double>(rendered.size());
  return mean;
}

// Variance among renderings over that of the model, by statistic.
std::map<StatisticKind, double> VarianceRatios(const SetModel& model,
                                               const std::vector<Eigen::MatrixXd>& covariance,
                                               const std::vector<BlockVectors>& rendered,
                                               const BlockVectors& mean) {
  std::map<StatisticKind, std::pair<double, double>> sums;  // squares, degrees of freedom
  for (int e = 0; e < model.blocks(); ++e) {
    auto& [squares, degrees] = sums[model.StatisticOf(e).kind()];
    const Eigen::LLT<Eigen::MatrixXd> factor(covariance[e]);
    for (const BlockVectors& one : rendered) {
      squares += factor.matrixL().solve(one[e] - mean[e]).squaredNorm();
    }
    degrees += static_cast<double>(mean[e].size()) * static_cast<double>(rendered.size() - 1);
  }
  std::map<StatisticKind, double> ratios;
  for (const auto& [kind, sum] : sums) ratios[kind] = sum.second > 0 ? sum.first / sum.second : 0;
  return ratios;
}

}  // namespace

absl::StatusOr<std::vector<BlockVectors>> RenderStatistics(const SetModel& model,
                                                           const SetParameters& parameters,
                                                           const RenderingSettings& settings,
                                                           const std::function<bool()>& proceed) {
  assert(settings.renderings >= 2);
  std::vector<BlockVectors> statistics;
  for (int k = 0; k < settings.renderings; ++k) {
    const uint64_t seed = DeriveSeed(settings.seed, "rendering", static_cast<uint64_t>(k));
    SIGHTLINE_ASSIGN_OR_RETURN(const RecordedSet rendered,
                               RenderSet(model, parameters, seed, proceed));
    statistics.push_back(model.StatisticsOf(rendered));
  }
  return statistics;
}

ExpectationCorrection CorrectionOf(const SetModel& model, const FitResult& fit,
                                   const FitResult& null,
                                   const std::vector<BlockVectors>& rendered) {
  SetParameters exact = fit.parameters;
  exact.model_error = {};
  const SetModel::Expectation fast = model.Expect(exact, true);
  const BlockVectors mean = MeanOver(rendered);
  const std::map<StatisticKind, double> ratios =
      VarianceRatios(model, fast.covariance, rendered, mean);
  const auto n = static_cast<double>(rendered.size());
  ExpectationCorrection correction;
  for (int e = 0; e < model.blocks(); ++e) {
    const Eigen::VectorXd change = kEffectError * (fit.mean[e] - null.mean[e]);
    correction.mean.push_back(mean[e] - fast.mean[e]);
    correction.covariance.push_back(ratios.at(model.StatisticOf(e).kind()) / n *
                                        fast.covariance[e] +
                                    change * change.transpose());
  }
  return correction;
}

}  // namespace sightline
