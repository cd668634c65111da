// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of what the sensor's readout adds: noise of pixels, rows and columns,
// pixels far out of line, codes that do not occur.
#include <array>
#include <cmath>
#include <vector>

#include "core/random/counter_random.h"
#include "render_worker/effects/discrepancy/free_form_effect.h"
#include "render_worker/effects/pixel_pattern.h"
#include "render_worker/effects/vocabulary.h"

namespace sightline {
namespace {

class NoiseTerm final : public FreeFormEffect {
 public:
  NoiseTerm()
      : FreeFormEffect("noise",
                       {.id = "unknown.noise",
                        .stage = Stage::kSensor,
                        .summary = "variance of the readout's noise times 1 + a, plus b t; of shot "
                                   "noise times 1 + c; more fixed pattern of gain and offset",
                        .reference = "EMVA 1288 R4.0 Linear, sections 2.2 and 4",
                        .parameters = {Coefficient("read_variance_relative", 100, 0.3),
                                       Coefficient("variance_electrons2_per_s", 1e6, 30),
                                       Coefficient("shot_variance_relative", 0.9, 0.05),
                                       {"gain_pattern_variance", 0, 0, 0.25, 1e-3},
                                       {"offset_pattern_variance_electrons2", 0, 0, 1e5, 4}}}) {}

  // More shot noise at the same mean: fewer electrons, each worth more.
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;  // a square root of a square would round
    Sensor& sensor = frame.sensor;
    const double variance = sensor.dark_noise_electrons * sensor.dark_noise_electrons * (1 + p[0]) +
                            p[1] * frame.exposure_time_s;
    sensor.dark_noise_electrons = std::sqrt(std::max(0.0, variance));
    sensor.prnu_relative = std::hypot(sensor.prnu_relative, std::sqrt(p[3]));
    sensor.dsnu_electrons = std::hypot(sensor.dsnu_electrons, std::sqrt(p[4]));
    const double worth = 1 + p[2];
    sensor.gain_dn_per_electron *= worth;
    for (double* electrons : {&sensor.saturation_capacity_electrons, &sensor.dark_mean_electrons,
                              &sensor.dark_noise_electrons, &sensor.dark_current_electrons_per_s,
                              &sensor.dsnu_electrons}) {
      *electrons /= worth;
    }
    for (QuantumEfficiencyCurve& curve : sensor.quantum_efficiency) {
      for (double& efficiency : curve.quantum_efficiency) efficiency /= worth;
    }
  }
};

// Rows that jump from frame to frame, columns that differ for good.
class LineNoiseTerm final : public FreeFormEffect {
 public:
  LineNoiseTerm()
      : FreeFormEffect("noise",
                       {.id = "unknown.line_noise",
                        .stage = Stage::kSensor,
                        .kind = EffectKind::kRandomPerRow,
                        .summary = "offsets of rows, drawn anew for every frame, and of columns, "
                                   "drawn once, normally distributed",
                        .reference = "EMVA 1288 R4.0 Linear, section 4 (row and column variation)",
                        .parameters = {{"row_variance_electrons2", 0, 0, 1e6, 4},
                                       {"column_variance_electrons2", 0, 0, 1e6, 4}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    RowNoise().OnElectrons(electrons, frame, std::array{std::sqrt(p[0])});
    DsnuColumnPattern().OnElectrons(electrons, frame, std::array{std::sqrt(p[1])});
  }
  void OnLineOffsets(LineOffsets& offsets, Parameters p) const override {
    offsets = {std::sqrt(p[0]), std::sqrt(p[1])};
  }
};

// The pixels, and the fraction of the mean, are fixed for a camera.
class PixelTailTerm final : public FreeFormEffect {
 public:
  PixelTailTerm()
      : FreeFormEffect("offset",
                       {.id = "unknown.pixel_tail",
                        .stage = Stage::kSensor,
                        .kind = EffectKind::kRandomPerPixel,
                        .summary = "parts of the pixels have exponentially distributed charge "
                                   "more, of these means",
                        .reference = "EMVA 1288 R4.0 Linear, section 4 (defect pixels)",
                        .parameters = {{"part_of_30_electrons", 0, 0, 0.1, 1e-3},
                                       {"part_of_1000_electrons_per_s", 0, 0, 0.1, 1e-3},
                                       {"part_of_10000_electrons_per_s", 0, 0, 0.1, 1e-3}}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const std::array<double, 3> mean = {30, 1000 * frame.exposure_time_s,
                                        10000 * frame.exposure_time_s};
    for (size_t k = 0; k < mean.size(); ++k) {
      if (p[k] == 0) continue;
      const uint64_t seed = DeriveSeed(frame.seeds.camera, kNames[k]);
      AddToSomePixels(electrons, frame.roi, seed, p[k], mean[k]);
    }
  }

 private:
  static constexpr std::array<const char*, 3> kNames = {
      "pixel tail of offsets", "pixel tail of dark currents", "pixel tail of high dark currents"};
};

// Rows are read out one after the other; the charge of one may shift the black level of those that
// follow.
class RowMemoryTerm final : public FreeFormEffect {
 public:
  RowMemoryTerm()
      : FreeFormEffect("offset",
                       {.id = "unknown.row_memory",
                        .stage = Stage::kSensor,
                        .summary = "every row gains a of its own mean, and b and c of the fading "
                                   "means of the 8 and 64 rows before it",
                        .reference = "EMVA 1288 R4.0 Linear, section 4 (rows read in turn)",
                        .parameters = {Coefficient("part_of_row", 0.5, 5e-3),
                                       Coefficient("part_of_8_rows_before", 0.5, 5e-3),
                                       Coefficient("part_of_64_rows_before", 0.5, 5e-3)}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;
    double short_memory = 0, long_memory = 0;
    for (int i = 0; i < electrons.rows_px; ++i) {
      double* row = electrons.Row(i);
      double mean = 0;
      for (int j = 0; j < electrons.columns_px; ++j) mean += row[j] / electrons.columns_px;
      const double offset = p[0] * mean + p[1] * short_memory + p[2] * long_memory;
      for (int j = 0; j < electrons.columns_px; ++j) row[j] += offset;
      short_memory += (mean - short_memory) / kShort_rows;
      long_memory += (mean - long_memory) / kLong_rows;
    }
  }

 private:
  static constexpr double kShort_rows = 8, kLong_rows = 64;
};

// A column's chain of amplifiers follows the signal with a delay: part of the difference from the
// pixels read before stays, and a part that grows with their charge where the chain is limited in
// speed.
class ReadoutLagTerm final : public FreeFormEffect {
 public:
  ReadoutLagTerm()
      : FreeFormEffect(
            "response",
            {.id = "unknown.readout_lag",
             .stage = Stage::kSensor,
             .summary = "every pixel gains parts a and b of the difference from the fading means "
                        "of the 1 and 4 pixels read before it in its column, and parts c and d of "
                        "these over full scale",
             .reference = "EMVA 1288 R4.0 Linear, section 2.1 (pixels independent)",
             .parameters = {Coefficient("part_of_1_row", 0.5, 5e-3),
                            Coefficient("part_of_4_rows", 0.5, 5e-3),
                            Coefficient("part_of_1_row_at_full_scale", 0.5, 0.02),
                            Coefficient("part_of_4_rows_at_full_scale", 0.5, 0.02)}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p) || electrons.rows_px == 0) return;
    const double per_full =
        frame.sensor.gain_dn_per_electron / static_cast<double>(frame.sensor.largest_dn());
    std::vector<double> before(electrons.Row(0), electrons.Row(0) + electrons.columns_px);
    std::vector<double> fading = before;
    for (int i = 0; i < electrons.rows_px; ++i) {
      double* row = electrons.Row(i);
      for (size_t j = 0; j < before.size(); ++j) {
        const double here = row[j];
        row[j] += (p[0] + p[2] * per_full * before[j]) * (before[j] - here) +
                  (p[1] + p[3] * per_full * fading[j]) * (fading[j] - here);
        before[j] = here;
        fading[j] += (here - fading[j]) / kFading_rows;
      }
    }
  }

 private:
  static constexpr double kFading_rows = 4;
};

class CodesTerm final : public FreeFormEffect {
 public:
  CodesTerm()
      : FreeFormEffect("response",
                       {.id = "unknown.codes",
                        .stage = Stage::kSensor,
                        .summary = "parts of the numbers read as if one of their four lowest bits "
                                   "were 0",
                        .reference = "EMVA 1288 R4.0 Linear, section 2.2 (quantisation)",
                        .parameters = {{"part_without_bit_0", 0, 0, 1, 0.3},
                                       {"part_without_bit_1", 0, 0, 1, 0.3},
                                       {"part_without_bit_2", 0, 0, 1, 0.3},
                                       {"part_without_bit_3", 0, 0, 1, 0.3}}}) {}

  // Numbers are taken in an order that fills the range evenly, so that any part of them is spread
  // over it.
  void OnRaw(Image<uint16_t>& raw, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;
    for (uint16_t& dn : raw.values) {
      const int number = dn;
      for (int bit = 0; bit < static_cast<int>(p.size()); ++bit) {
        // Numbers that differ in this bit only share a place.
        const double place = std::fmod(0.5 + (number >> (bit + 1)) * 0.6180339887498949, 1.0);
        if (place < p[bit]) dn = static_cast<uint16_t>(dn & ~(1U << bit));
      }
    }
  }
};

}  // namespace

std::vector<const FreeFormEffect*> ReadoutTerms() {
  static const PixelTailTerm pixel_tail;
  static const NoiseTerm noise;
  static const LineNoiseTerm line_noise;
  static const RowMemoryTerm row_memory;
  static const ReadoutLagTerm readout_lag;
  static const CodesTerm codes;
  return {&pixel_tail, &noise, &line_noise, &readout_lag, &row_memory, &codes};
}

}  // namespace sightline
