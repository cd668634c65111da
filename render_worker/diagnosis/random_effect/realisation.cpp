// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/random_effect/realisation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <iterator>
#include <map>
#include <numbers>
#include <utility>

#include "core/statistics/order_statistics.h"
#include "render_worker/diagnosis/statistic/line_displacement.h"

namespace sightline {

namespace {

// Least-squares scales of the expected line to the observed one, one for each of `count` groups of
// components of the profiles, where neither is cut off. NaN: a group has no light.
std::vector<double> ScalesOfLight(const SetModel& model, SetParameters parameters, size_t count,
                                  const std::function<int(int block, int component)>& group_of) {
  // The line must be expected where it is, or its light would seem to be missing.
  parameters.line_shift_px = EstimateLineShifts(model, parameters);
  const BlockVectors expected = model.Expect(parameters, false).mean;
  constexpr double kNotCutOff = 0.8;
  std::vector<double> product(count, 0), square(count, 0);
  for (int e = 0; e < model.blocks(); ++e) {
    if (model.StatisticOf(e).kind() != StatisticKind::kProfile) continue;
    const double background = expected[e].minCoeff();
    for (int row = 0; row < static_cast<int>(expected[e].size()); ++row) {
      const RecordedFrame& frame = model.set().frames[model.FrameOfComponent(e, row)];
      const double top_dn = kNotCutOff * frame.nominal.sensor.largest_dn();
      const double observed = model.observed()[e][row];
      if (expected[e][row] > top_dn || observed > top_dn) continue;
      const int group = group_of(e, row);
      const double signal = expected[e][row] - background;
      product[group] += signal * (observed - background);
      square[group] += signal * signal;
    }
  }
  for (size_t g = 0; g < count; ++g) {
    product[g] = square[g] > 0 ? product[g] / square[g] : std::nan("");
  }
  return product;
}

// Scales minus their median; 0 in place of NaN.
std::vector<double> OverMedian(std::vector<double> scales) {
  std::vector<double> sorted;
  std::copy_if(scales.begin(), scales.end(), std::back_inserter(sorted),
               [](double scale) { return !std::isnan(scale); });
  if (sorted.empty()) return std::vector<double>(scales.size(), 0);
  const double median = UpperMedian(std::move(sorted));
  for (double& scale : scales) scale = std::isnan(scale) ? 0 : scale - median;
  return scales;
}

}  // namespace

RealisedEffect::RealisedEffect(Realisation realisation)
    : DescribedEffect({.id = "realised",
                       .stage = Stage::kTime,
                       .summary = "amount of light, place and blur of every recording",
                       .reference = "",
                       .parameters = {}}),
      realisation_(std::move(realisation)) {}

void RealisedEffect::OnFrame(FrameSetup& frame, Parameters) const {
  frame.laser.power_w *= std::max(0.0, 1 + realisation_.light_relative[frame.recording_index]);
}

void RealisedEffect::OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                                       Parameters) const {
  if (realisation_.blocks.empty()) return;
  const Realisation::Blocks& blocks = realisation_.blocks[frame.recording_index];
  const auto count = static_cast<int>(blocks.light_relative.size());
  if (count == 0) return;
  // The frame is a sample of columns of one segment.
  const int middle_px = light.roi.column_px + light.roi.columns_px / 2 - blocks.first_column_px;
  const int block = std::clamp(middle_px * count / blocks.columns_px, 0, count - 1);
  const auto factor = static_cast<float>(std::max(0.0, 1 + blocks.light_relative[block]));
  for (float& value : light.laser_irradiance_w_m2.values) value *= factor;
}

void RealisedEffect::OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters) const {
  const double pitch_m = frame.sensor.pixel_pitch_m;
  const double shift_m = pitch_m * realisation_.shift_px[frame.recording_index];
  const double blur_m2 = pitch_m * pitch_m * realisation_.blur_px2[frame.recording_index];
  if (shift_m == 0 && blur_m2 == 0) return;
  // Transfer function of a sinusoidal movement over whole periods (Lohmann and Paris, Appl. Opt. 4
  // (1965) 393). For parts of a period the blur has the right width, not the right shape.
  const double amplitude_m = std::sqrt(2 * std::max(0.0, blur_m2));
  optics.transfer.push_back([=](double, double qy) {
    const double turn = 2 * std::numbers::pi * qy;
    return ::j0(turn * amplitude_m) * std::polar(1.0, -turn * shift_m);
  });
}

Realisation LineMovements(const SetModel& model, const SetParameters& parameters) {
  const RecordedSet& set = model.set();
  const ExpectedSet expected = model.ExpectStrips(parameters, false);
  Realisation movements(set.frames.size());
  for (size_t f = 0; f < set.frames.size(); ++f) {
    if (set.frames[f].plate_position_id < 0) continue;
    const LineDisplacement seen = DisplacementOfLine(set, expected, static_cast<int>(f));
    movements.shift_px[f] = seen.shift_px;
    movements.blur_px2[f] = std::max(0.0, seen.broadening_px2);
  }
  return movements;
}

std::vector<double> LightExcesses(const SetModel& model, SetParameters parameters) {
  const size_t frames = model.set().frames.size();
  const std::vector<double> light =
      ScalesOfLight(model, std::move(parameters), frames,
                    [&](int e, int row) { return model.FrameOfComponent(e, row); });
  return OverMedian(light);
}

Eigen::Index PositionIndex(const SetModel& model, int plate_position_id) {
  const std::vector<int>& ids = model.position_ids();
  return std::find(ids.begin(), ids.end(), plate_position_id) - ids.begin();
}

std::vector<int> BlocksOfEntries(const SetModel& model) {
  std::vector<int> block_of_entry(model.blocks(), -1);
  std::map<int, int> next_block;
  for (int e = 0; e < model.blocks(); ++e) {
    const int position = PlatePositionOf(model, e);
    if (position >= 0 && model.StatisticOf(e).kind() == StatisticKind::kProfile) {
      block_of_entry[e] = next_block[position]++;
    }
  }
  return block_of_entry;
}

Realisation RealisedReflectance(const SetModel& model, const Eigen::VectorXd& reflectance) {
  constexpr double kDarkest = -0.9;
  const std::vector<RecordedFrame>& frames = model.set().frames;
  const int blocks = model.blocks_along_line();
  Realisation realisation(frames.size());
  realisation.blocks.resize(frames.size());
  for (size_t f = 0; f < frames.size(); ++f) {
    if (frames[f].plate_position_id < 0) continue;
    const Eigen::VectorXd of_blocks =
        reflectance.segment(PositionIndex(model, frames[f].plate_position_id) * blocks, blocks)
            .cwiseMax(kDarkest);
    Realisation::Blocks& of_frame = realisation.blocks[f];
    of_frame.first_column_px = frames[f].nominal.roi.column_px;
    of_frame.columns_px = frames[f].nominal.roi.columns_px;
    realisation.light_relative[f] = of_blocks.mean();
    for (const double of_block : of_blocks) {
      of_frame.light_relative.push_back((1 + of_block) / (1 + of_blocks.mean()) - 1);
    }
  }
  return realisation;
}

Eigen::VectorXd ReflectanceExcesses(const SetModel& model, SetParameters parameters) {
  const std::vector<int> block_of_entry = BlocksOfEntries(model);
  const int blocks = model.blocks_along_line();
  const std::vector<double> light = ScalesOfLight(
      model, std::move(parameters), blocks * model.position_ids().size(), [&](int e, int) {
        const Eigen::Index position = PositionIndex(model, PlatePositionOf(model, e));
        return static_cast<int>(position) * blocks + block_of_entry[e];
      });
  const std::vector<double> excesses = OverMedian(light);
  return Eigen::Map<const Eigen::VectorXd>(excesses.data(),
                                           static_cast<Eigen::Index>(excesses.size()));
}

std::vector<double> DisplacementsAtPositions(const SetModel& model,
                                             const SetParameters& parameters) {
  const RecordedSet& set = model.set();
  std::vector<double> displacements = LineMovements(model, parameters).shift_px;
  for (int id : model.position_ids()) {
    std::vector<size_t> of_position;
    for (size_t f = 0; f < set.frames.size(); ++f) {
      if (set.frames[f].plate_position_id == id) of_position.push_back(f);
    }
    double mean = 0, farthest = 0;
    for (size_t f : of_position) {
      mean += displacements[f] / static_cast<double>(of_position.size());
    }
    for (size_t f : of_position) {
      displacements[f] -= mean;
      farthest = std::max(farthest, std::abs(displacements[f]));
    }
    constexpr double kNear_px = 0.3;
    for (size_t f : of_position) {
      if (farthest < kNear_px) displacements[f] = 0;
    }
  }
  return displacements;
}

}  // namespace sightline
