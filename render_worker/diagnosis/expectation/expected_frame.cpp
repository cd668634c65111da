// SPDX-License-Identifier: Apache-2.0
#include "render_worker/diagnosis/expectation/expected_frame.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "render_worker/diagnosis/expectation/charge_spread.h"
#include "render_worker/diagnosis/expectation/charge_trail.h"
#include "render_worker/diagnosis/expectation/mean_numbers.h"
#include "render_worker/diagnosis/expectation/rounded_normal.h"
#include "render_worker/diagnosis/expectation/texture_law.h"
#include "render_worker/image_chain/form_image.h"
#include "render_worker/sensor/expose.h"
#include "render_worker/speckle/integrated_speckle.h"

namespace sightline {

namespace {

// Fills in what the effects state about variances between rows and columns: standard deviations of
// their offsets [DN], and the relative variance of laser light within a block of
// `block_columns_px` columns (0: no block).
void AddScatter(const FrameSetup& nominal, std::span<const ActiveEffect> effects,
                int block_columns_px, ExpectedFrame& expected) {
  const double gain = nominal.sensor.gain_dn_per_electron;
  LineOffsets offsets;
  for (const ActiveEffect& active : effects) {
    active.effect->OnLineOffsets(offsets, active.parameters);
    if (block_columns_px <= 0) continue;
    const RandomLaw law = active.effect->description().random_law;
    if (IsTexture(law)) {
      expected.drawn_variance_along_line +=
          TextureLaw(law, nominal, active.parameters)
              .VarianceAlong(LengthOnPlate(nominal, block_columns_px));
    }
    expected.drawn_variance_along_line +=
        active.effect->VarianceWithinBlock(block_columns_px, active.parameters);
  }
  expected.row_scatter_dn = gain * offsets.row_electrons;
  expected.column_scatter_dn = gain * offsets.column_electrons;
}

// Effects whose numbers of the frame hold for every recording. The hook of an effect that is random
// per recording sets a realised value.
std::vector<ActiveEffect> OfEveryFrame(std::span<const ActiveEffect> effects) {
  std::vector<ActiveEffect> kept(effects.begin(), effects.end());
  std::erase_if(kept, [](const ActiveEffect& active) {
    return active.effect->description().kind == EffectKind::kRandomPerRecording;
  });
  return kept;
}

// True for effects that move a larger share of the charge the more there is: neighbours of a pixel
// are not as bright as the pixel itself.
bool GrowsWithCharge(const Effect& effect) {
  return effect.description().charge_transport == ChargeTransport::kGrowsWithCharge;
}

// Equally likely levels of speckle, over the mean, of every pixel of a column sample.
class LevelFactors {
 public:
  // `speckle`: one pattern for each of the four pixels of a cell of the colour filter, the same
  // object where they do not differ. `pattern_share`: contrast squared of all patterns over that of
  // one.
  LevelFactors(const std::array<std::shared_ptr<const LineSpeckle>, 4>& speckle,
               double pattern_share, const FrameSetup& frame, int levels)
      : cells_(speckle[0] == speckle[1] ? 1 : 4), place_of_row_(frame.roi.rows_px) {
    for (int cell = 0; cell < cells_; ++cell) {
      for (int place = 0; place < speckle[cell]->places(); ++place) {
        // Strengths beyond sense would move more charge than there is.
        const double contrast_squared = std::clamp(
            speckle[cell]->At(place).At(0, 0) * pattern_share, kLeastContrastSquared, 1.0);
        of_place_[cell].push_back(SpeckleLevels(contrast_squared, levels));
      }
    }
    for (int row = 0; row < frame.roi.rows_px; ++row) {
      place_of_row_[row] =
          speckle[0]->PlaceOf((frame.roi.row_px + row) * frame.sensor.pixel_pitch_m);
    }
  }

  int cells() const { return cells_; }  // that differ
  double At(int cell, int row, int level) const {
    return of_place_[cell][place_of_row_[row]][level];
  }
  int CellOf(int row, int column) const { return cells_ == 1 ? 0 : 2 * (row % 2) + column % 2; }

 private:
  int cells_;
  std::array<std::vector<std::vector<double>>, 4> of_place_;
  std::vector<int> place_of_row_;
};

// Repeats the columns of an image until there are `columns_px`.
template <typename T>
Image<T> Widened(const Image<T>& columns, int columns_px) {
  Image<T> wide(columns_px, columns.rows_px);
  for (int row = 0; row < wide.rows_px; ++row) {
    for (int c = 0; c < columns_px; ++c) wide.At(row, c) = columns.At(row, c % columns.columns_px);
  }
  return wide;
}

// Noise that all pixels of a frame have, in addition to the shot noise of their light.
struct ReadNoise {
  double dark_electrons = 0;  // mean without light
  double variance_electrons2 = 0, rounding_variance_dn2 = 0;
  int step_dn = 1;  // of the numbers that occur

  // Temporal variance of the charge of a pixel with this mean of photo-electrons [electrons^2].
  double ChargeVarianceAt(double photo_electrons) const {
    return std::max(0.0, photo_electrons) + variance_electrons2;
  }
  // Temporal variance of its number; `gain` includes that of the effects on charge [DN^2].
  double VarianceAt(double photo_electrons, double gain_dn_per_electron) const {
    return gain_dn_per_electron * gain_dn_per_electron * ChargeVarianceAt(photo_electrons) +
           rounding_variance_dn2;
  }
};

// Mean photo-electrons of a column sample at one level of speckle, after the effects on them.
// Charge comes from neighbours at the same level: the level contains the variance of their sum
// already.
Image<double> PhotoElectronsAt(int level, const ExpectedLight& light, const LevelFactors* factors,
                               const SmearTrail& smear, const FrameSetup& frame,
                               std::span<const ActiveEffect> effects,
                               const Image<double>* previous) {
  const Image<double>&total = light.total_electrons, &steady = light.steady_electrons;
  const auto factor_at = [&](int cell, int row) {
    return factors == nullptr ? 1.0 : factors->At(cell, row, level);
  };
  const auto of_cell = [&](int cell) {
    Image<double> scaled = total;
    // The frame before in a burst shows the same speckle.
    std::optional<Image<double>> before;
    const bool follows = previous != nullptr && previous->values.size() == total.values.size();
    if (factors != nullptr && follows) before = *previous;
    for (int row = 0; row < scaled.rows_px; ++row) {
      const double factor = factor_at(cell, row);
      for (int column = 0; column < scaled.columns_px; ++column) {
        const double other = steady.At(row, column);
        const double all = scaled.At(row, column);
        scaled.At(row, column) = other + factor * (all - other);
        if (before && all > 0) before->At(row, column) *= scaled.At(row, column) / all;
      }
    }
    for (const ActiveEffect& active : effects) {
      if (IsSmear(active)) continue;
      active.effect->OnMeanElectrons(scaled, before ? &*before : previous, frame,
                                     active.parameters);
    }
    if (smear.laser.empty()) return scaled;
    const double factor = 1 + smear.contrast_kept * (factor_at(cell, smear.crest_row) - 1);
    for (size_t i = 0; i < scaled.values.size(); ++i) {
      scaled.values[i] += smear.steady.values[i] + factor * smear.laser.values[i];
    }
    return scaled;
  };
  if (factors == nullptr || factors->cells() == 1) return of_cell(0);
  Image<double> electrons(total.columns_px, total.rows_px);
  for (int cell = 0; cell < factors->cells(); ++cell) {
    const Image<double> scaled = of_cell(cell);
    for (int row = cell / 2; row < scaled.rows_px; row += 2) {
      for (int column = cell % 2; column < scaled.columns_px; column += 2) {
        electrons.At(row, column) = scaled.At(row, column);
      }
    }
  }
  return electrons;
}

// Fills in mean and variance over the levels, and the variances of noise and of fixed patterns at
// the mean level. `noise_gains`: as NoiseGains.
void AddMoments(const Image<double>& photo_electrons, const ReadNoise& noise,
                const Image<double>& noise_gains, ExpectedFrame& expected) {
  const Sensor& sensor = expected.frame.sensor;
  const auto level_count = static_cast<double>(expected.level_dn.size());
  const int columns_px = photo_electrons.columns_px, rows_px = photo_electrons.rows_px;
  expected.mean_dn = Image<double>(columns_px, rows_px, 0.0);
  expected.level_variance_dn2 = expected.mean_dn;
  for (const Image<float>& level : expected.level_dn) {
    for (size_t i = 0; i < level.values.size(); ++i) expected.mean_dn.values[i] += level.values[i];
  }
  for (double& mean : expected.mean_dn.values) mean /= level_count;
  for (const Image<float>& level : expected.level_dn) {
    for (size_t i = 0; i < level.values.size(); ++i) {
      const double deviation = level.values[i] - expected.mean_dn.values[i];
      expected.level_variance_dn2.values[i] += deviation * deviation / level_count;
    }
  }
  expected.noise_variance_dn2 = Image<float>(columns_px, rows_px);
  expected.pattern_variance_dn2 = expected.noise_variance_dn2;
  for (size_t i = 0; i < photo_electrons.values.size(); ++i) {
    const double mean = std::max(0.0, photo_electrons.values[i]);
    const double gain = noise_gains.values[i];
    expected.noise_variance_dn2.values[i] = static_cast<float>(noise.VarianceAt(mean, gain));
    const double before_rounding = noise.VarianceAt(mean, gain) - noise.rounding_variance_dn2;
    const double spread = expected.level_variance_dn2.values[i];
    if (before_rounding > 0 &&
        IsCoarselyRounded(std::sqrt(before_rounding + spread), noise.step_dn)) {
      const RoundedMoments rounded = MomentsAfterRounding(
          sensor.gain_dn_per_electron * (mean + noise.dark_electrons) + sensor.black_level_dn,
          std::sqrt(before_rounding), noise.step_dn);
      expected.noise_variance_dn2.values[i] = static_cast<float>(rounded.variance);
      if (expected.noise_excess_kurtosis.empty()) {
        expected.noise_excess_kurtosis = Image<float>(columns_px, rows_px);
      }
      expected.noise_excess_kurtosis.values[i] = static_cast<float>(rounded.excess_kurtosis);
    }
    expected.pattern_variance_dn2.values[i] = static_cast<float>(
        gain * gain *
        (std::pow(sensor.prnu_relative * mean, 2) + std::pow(sensor.dsnu_electrons, 2)));
  }
}

ReadNoise ReadNoiseOf(const FrameSetup& frame, const MeanNumbers& numbers) {
  const Sensor& sensor = frame.sensor;
  ReadNoise noise;
  noise.dark_electrons = sensor.dark_mean_electrons + DarkCurrentElectrons(frame);
  noise.variance_electrons2 = sensor.dark_noise_electrons * sensor.dark_noise_electrons +
                              noise.dark_electrons - sensor.dark_mean_electrons;
  noise.rounding_variance_dn2 = numbers.rounding_variance_dn2();
  noise.step_dn = numbers.step_dn();
  return noise;
}

// How the pixels' light differs between levels of speckle.
struct LevelModel {
  std::optional<LevelFactors> factors;  // none: there is no laser light, one level
  std::optional<NeighboursOfLevel>
      neighbours;  // none: no effect moves more charge the more there is
};

// Fills in `model` and the speckle of `expected`, after charge has spread.
void ModelLevels(const ExpectedLight& light, std::span<const ActiveEffect> effects,
                 double dark_electrons, int speckle_levels, LevelModel& model,
                 ExpectedFrame& expected) {
  const FrameSetup& frame = expected.frame;
  if (!frame.laser_on || !frame.shutter_open) return;
  const Image<double>&total = light.total_electrons, &steady = light.steady_electrons;
  const std::shared_ptr<const LineSpeckle>& optical = light.imaging->speckle;
  expected.speckle_of_cell = AfterChargeSpread(*optical, total, frame, effects);
  const bool spreads = expected.speckle_of_cell[0] != nullptr;
  expected.speckle = spreads ? expected.speckle_of_cell[BrightestCell(total)] : optical;
  // Charge that flows the more there is of it differs between levels: the flow is computed at each.
  std::vector<ActiveEffect> but_by_charge(effects.begin(), effects.end());
  std::erase_if(but_by_charge, [](const auto& active) { return GrowsWithCharge(*active.effect); });
  const bool by_charge = but_by_charge.size() < effects.size();
  auto speckle_of_levels = by_charge ? AfterChargeSpread(*optical, total, frame, but_by_charge)
                                     : expected.speckle_of_cell;
  if (speckle_of_levels[0] == nullptr) speckle_of_levels.fill(optical);
  model.factors.emplace(speckle_of_levels, light.pattern_share, frame, speckle_levels);
  if (!by_charge) return;
  Image<double> laser = total, other = steady;
  for (size_t i = 0; i < laser.values.size(); ++i) {
    laser.values[i] -= steady.values[i];
    other.values[i] += dark_electrons;
  }
  model.neighbours.emplace(std::move(laser), std::move(other), *speckle_of_levels[0], frame,
                           light.pattern_share, frame.sensor.saturation_capacity_electrons);
}

// Mean photo-electrons at every level.
std::vector<Image<double>> PhotoElectronsOfLevels(int level_count, const ExpectedLight& light,
                                                  const LevelModel& model,
                                                  const ExpectedFrame& expected,
                                                  const std::vector<ActiveEffect>& effects,
                                                  const Image<double>* previous) {
  const FrameSetup& frame = expected.frame;
  const LevelFactors* factors = model.factors ? &*model.factors : nullptr;
  const SmearTrail smear = TrailOfSmear(light.total_electrons, light.steady_electrons, frame,
                                        effects, expected.speckle.get());
  const auto at_levels = [&](std::span<const ActiveEffect> acting) {
    std::vector<Image<double>> levels;
    for (int level = 0; level < level_count; ++level) {
      levels.push_back(PhotoElectronsAt(level, light, factors, smear, frame, acting, previous));
    }
    return levels;
  };
  std::vector<Image<double>> electrons = at_levels(effects);
  const auto blooming = std::find_if(effects.begin(), effects.end(), IsBlooming);
  if (blooming != effects.end() && expected.speckle != nullptr) {
    std::vector<ActiveEffect> others = effects;
    std::erase_if(others, IsBlooming);
    EvenOutOverflow(*blooming, frame, *expected.speckle, at_levels(others), electrons);
  }
  return electrons;
}

// Adds the dark signal to the photo-electrons of a level and applies the effects on charge.
Image<double> ChargeOfLevel(int level, Image<double> electrons, double dark_electrons,
                            const LevelModel& model, const FrameSetup& frame,
                            std::span<const ActiveEffect> effects) {
  // Charge beyond this limit gives the same raw values for any noise.
  const double capacity = frame.sensor.saturation_capacity_electrons;
  const double overfull_electrons = capacity + 6 * std::sqrt(capacity);
  for (double& value : electrons.values) {
    value = std::min(value + dark_electrons, overfull_electrons);
  }
  Image<double> factor;
  if (model.neighbours) {
    factor = Image<double>(electrons.columns_px, electrons.rows_px);
    for (int row = 0; row < factor.rows_px; ++row) {
      for (int column = 0; column < factor.columns_px; ++column) {
        factor.At(row, column) = model.factors->At(model.factors->CellOf(row, column), row, level);
      }
    }
  }
  for (const ActiveEffect& active : effects) {
    if (model.neighbours && GrowsWithCharge(*active.effect)) {
      electrons = model.neighbours->After(active, frame, electrons, factor);
    } else {
      active.effect->OnElectrons(electrons, frame, active.parameters);
    }
  }
  return electrons;
}

// Numbers per electron of a pixel's noise [DN/electron]: the sensor's gain times the derivative of
// the effects on charge, which act after the noise has been added. The derivative is the central
// difference over one standard deviation of the noise. Effects that move charge between pixels are
// left out: they conserve it.
Image<double> NoiseGains(const Image<double>& photo_electrons, const ReadNoise& noise,
                         const FrameSetup& frame, std::span<const ActiveEffect> effects) {
  Image<double> gains(photo_electrons.columns_px, photo_electrons.rows_px,
                      frame.sensor.gain_dn_per_electron);
  Image<double> lower = photo_electrons, upper = photo_electrons, deviation = photo_electrons;
  for (size_t i = 0; i < gains.values.size(); ++i) {
    const double variance = noise.ChargeVarianceAt(photo_electrons.values[i]);
    deviation.values[i] = variance > 0 ? std::sqrt(variance) : 1;
    lower.values[i] += noise.dark_electrons - deviation.values[i];
    upper.values[i] += noise.dark_electrons + deviation.values[i];
  }
  for (const ActiveEffect& active : effects) {
    if (active.effect->description().MovesCharge()) continue;
    active.effect->OnElectrons(lower, frame, active.parameters);
    active.effect->OnElectrons(upper, frame, active.parameters);
  }
  for (size_t i = 0; i < gains.values.size(); ++i) {
    gains.values[i] *= (upper.values[i] - lower.values[i]) / (2 * deviation.values[i]);
  }
  return gains;
}

ExpectedFrame ExpectColumns(const FrameSetup& nominal, std::span<const ActiveEffect> all_effects,
                            const Image<double>* previous,
                            std::shared_ptr<const LineImaging> known_imaging, int speckle_levels,
                            int block_columns_px) {
  ExpectedFrame expected;
  // Set-up: random effects state variances, the others act on the frame and on what follows.
  expected.frame = ApplyFrameEffects(nominal, OfEveryFrame(all_effects));
  AddScatter(nominal, all_effects, block_columns_px, expected);
  std::vector<ActiveEffect> effects(all_effects.begin(), all_effects.end());
  std::erase_if(effects, [](const ActiveEffect& active) {
    return !active.effect->description().ChangesExpectation();
  });

  // Light on the pixels.
  const FrameSetup& frame = expected.frame;
  const ExpectedLight light =
      ExpectLight(frame, effects, std::move(known_imaging), block_columns_px);
  expected.imaging = light.imaging;
  expected.level_along_line = light.level_along_line;

  // Charge at every level of speckle.
  MeanNumbers numbers(frame, effects);
  const ReadNoise read_noise = ReadNoiseOf(frame, numbers);
  expected.rounding_variance_dn2 = numbers.rounding_variance_dn2();
  LevelModel model;
  ModelLevels(light, effects, read_noise.dark_electrons, speckle_levels, model, expected);
  const int level_count = model.factors ? speckle_levels : 1;
  std::vector<Image<double>> electrons_of_level =
      PhotoElectronsOfLevels(level_count, light, model, expected, effects, previous);

  // Numbers, and their moments over the levels.
  Image<double> mean_of_levels(frame.roi.columns_px, frame.roi.rows_px, 0.0);
  for (const Image<double>& electrons : electrons_of_level) {
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      mean_of_levels.values[i] += electrons.values[i] / level_count;
    }
  }
  Image<double> spread_dn2(frame.roi.columns_px, frame.roi.rows_px, 0.0);
  for (const Image<double>& electrons : electrons_of_level) {
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      const double away_dn =
          frame.sensor.gain_dn_per_electron * (electrons.values[i] - mean_of_levels.values[i]);
      spread_dn2.values[i] += away_dn * away_dn / level_count;
    }
  }
  const Image<double> noise_gains = NoiseGains(mean_of_levels, read_noise, frame, effects);
  for (int level = 0; level < level_count; ++level) {
    Image<double>& electrons = electrons_of_level[level];
    Image<float> noise_dn(electrons.columns_px, electrons.rows_px);
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      noise_dn.values[i] = static_cast<float>(
          std::sqrt(read_noise.VarianceAt(electrons.values[i], noise_gains.values[i])));
    }
    electrons = ChargeOfLevel(level, std::move(electrons), read_noise.dark_electrons, model, frame,
                              effects);
    expected.level_dn.push_back(numbers.Of(electrons, noise_dn, spread_dn2));
  }
  AddMoments(mean_of_levels, read_noise, noise_gains, expected);
  expected.mean_photo_electrons = std::move(mean_of_levels);
  return expected;
}

}  // namespace

const SpecklePixelCovariance& ExpectedFrame::SpeckleAt(int row, int column) const {
  const LineSpeckle* of_cell = speckle_of_cell[2 * (row % 2) + column % 2].get();
  if (of_cell == nullptr) of_cell = speckle.get();
  return of_cell->At(of_cell->PlaceOf((frame.roi.row_px + row) * frame.sensor.pixel_pitch_m));
}

bool ColumnsAlternate(std::span<const ActiveEffect> effects) {
  return std::any_of(effects.begin(), effects.end(), [](const ActiveEffect& active) {
    return active.effect->description().columns_alternate;
  });
}

ExpectedFrame ExpectFrame(const FrameSetup& frame, std::span<const ActiveEffect> effects,
                          const Image<double>* previous, std::shared_ptr<const LineImaging> imaging,
                          int speckle_levels, int block_columns_px) {
  const int columns_px = frame.roi.columns_px;
  if (frame.sensor.colour_filter != ColourFilter::kMono || columns_px < 2) {
    return ExpectColumns(frame, effects, previous, std::move(imaging), speckle_levels,
                         block_columns_px);
  }
  // Without colours all columns have the same expectation, or every second one does: one column or
  // two neighbours are computed. These start at a whole number of periods, so that the column c of
  // the region repeats the column c % period of them.
  const int period = ColumnsAlternate(effects) ? 2 : 1;
  const int first_column = columns_px / 2 / period * period;
  FrameSetup narrow = frame;
  narrow.roi.column_px += first_column;
  narrow.roi.columns_px = period;
  Image<double> previous_columns;
  if (previous != nullptr && !previous->empty()) {
    previous_columns = Image<double>(period, previous->rows_px);
    for (int row = 0; row < previous->rows_px; ++row) {
      for (int c = 0; c < period; ++c) {
        previous_columns.At(row, c) = previous->At(row, std::min(c, previous->columns_px - 1));
      }
    }
  }
  ExpectedFrame expected =
      ExpectColumns(narrow, effects, previous == nullptr ? nullptr : &previous_columns,
                    std::move(imaging), speckle_levels, block_columns_px);
  expected.frame.roi.column_px -= first_column;
  expected.frame.roi.columns_px = columns_px;
  for (Image<float>& level : expected.level_dn) level = Widened(level, columns_px);
  expected.mean_dn = Widened(expected.mean_dn, columns_px);
  expected.level_variance_dn2 = Widened(expected.level_variance_dn2, columns_px);
  expected.noise_variance_dn2 = Widened(expected.noise_variance_dn2, columns_px);
  if (!expected.noise_excess_kurtosis.empty()) {
    expected.noise_excess_kurtosis = Widened(expected.noise_excess_kurtosis, columns_px);
  }
  expected.pattern_variance_dn2 = Widened(expected.pattern_variance_dn2, columns_px);
  expected.mean_photo_electrons = Widened(expected.mean_photo_electrons, columns_px);
  return expected;
}

}  // namespace sightline
