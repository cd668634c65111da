#include "render_worker/diagnosis/realisation.h"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <utility>

#include "render_worker/diagnosis/line_displacement.h"

namespace sightline {

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

void RealisedEffect::OnOptics(OpticsModel& optics, const FrameSetup& frame, Parameters) const {
  const double pitch_m = frame.sensor.pixel_pitch_m;
  const double shift_m = pitch_m * realisation_.shift_px[frame.recording_index];
  const double blur_m2 = pitch_m * pitch_m * realisation_.blur_px2[frame.recording_index];
  if (shift_m == 0 && blur_m2 == 0) return;
  // Of whole periods of a sinusoid (Lohmann and Paris, Appl. Opt. 4 (1965) 393); for parts of one,
  // of the right width.
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
  const RecordedSet& set = model.set();
  // Where a line is not where it is expected, its light would seem to be missing.
  parameters.line_shift_px = model.EstimateLineShifts(parameters);
  const Entries expected = model.Expect(parameters, false).mean;
  // Scale of the expected line that is nearest to the observed one, where neither is cut off.
  constexpr double kNotCutOff = 0.8;
  std::vector<double> product(set.frames.size(), 0), square(set.frames.size(), 0);
  for (int e = 0; e < model.entries(); ++e) {
    if (model.StatisticOf(e).name() != "profile") continue;
    const double background = expected[e].minCoeff();
    for (int row = 0; row < static_cast<int>(expected[e].size()); ++row) {
      const int f = model.FrameOfRow(e, row);
      const double top_dn = kNotCutOff * set.frames[f].nominal.sensor.largest_dn();
      const double observed = model.observed()[e][row];
      if (expected[e][row] > top_dn || observed > top_dn) continue;
      const double signal = expected[e][row] - background;
      product[f] += signal * (observed - background);
      square[f] += signal * signal;
    }
  }
  std::vector<double> excesses(set.frames.size(), 0), sorted;
  for (size_t f = 0; f < set.frames.size(); ++f) {
    if (set.frames[f].plate_position_id < 0 || square[f] <= 0) continue;
    excesses[f] = product[f] / square[f] - 1;
    sorted.push_back(excesses[f]);
  }
  if (sorted.empty()) return excesses;
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
  const double median = sorted[sorted.size() / 2];
  for (size_t f = 0; f < set.frames.size(); ++f) {
    if (set.frames[f].plate_position_id >= 0) excesses[f] -= median;
  }
  return excesses;
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
