// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms of the sensor: response, colours, dark signal, charge displaced in space
// and time. Noise and codes: free_form_readout.cpp.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string_view>
#include <vector>

#include "render_worker/effects/discrepancy/free_form_effect.h"
#include "render_worker/effects/pixel_pattern.h"

namespace sightline {
namespace {

// Charge that fills the converter.
double FullScale(const FrameSetup& frame) {
  return frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
}

// Relative change of the signal as a cubic spline of Catmull and Rom through its values at signals
// of (k/5)^3 of full scale, closer where signals are small; constant beyond the ends.
class ResponseTerm final : public FreeFormEffect {
 public:
  ResponseTerm()
      : FreeFormEffect("response", {.id = "unknown.response",
                                    .stage = Stage::kSensor,
                                    .summary = "charge e reads as e (1 + c(e)), c a smooth curve",
                                    .reference = "EMVA 1288 R4.0 Linear, linearity error LE",
                                    .parameters = {Coefficient("change_at_0.008", 0.5, 0.05),
                                                   Coefficient("change_at_0.064", 0.5, 0.05),
                                                   Coefficient("change_at_0.216", 0.5, 0.05),
                                                   Coefficient("change_at_0.512", 0.5, 0.05),
                                                   Coefficient("change_at_1", 0.5, 0.05)}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;
    const double per_full = 1 / FullScale(frame);
    for (double& e : electrons.values) e *= 1 + CurveAt(e * per_full, p);
  }

  Axes CurveAxes() const override {
    return {"signal_over_full_scale", "response_change_relative", EvenlySpaced(0, 1, 41)};
  }
  double CurveAt(double signal, Parameters p) const override {
    const double place = std::clamp(5 * std::cbrt(std::max(0.0, signal)) - 1, 0.0, 4.0);
    const int k = std::min(3, static_cast<int>(place));
    const double t = place - k;
    // Straight on beyond the ends.
    const auto at = [p](int i) {
      if (i < 0) return 2 * p[0] - p[1];
      return i < 5 ? p[i] : 2 * p[4] - p[3];
    };
    const double a = at(k - 1), b = at(k), c = at(k + 1), d = at(k + 2);
    return b + 0.5 * t * (c - a + t * (2 * a - 5 * b + 4 * c - d + t * (3 * (b - c) + d - a)));
  }
};

// It has as few coefficients as `unknown.exposure`, so that the comparison of the two is fair: in
// exposures of one scene only the profile distinguishes a response to the signal from one to time.
class ResponseLawTerm final : public FreeFormEffect {
 public:
  ResponseLawTerm()
      : FreeFormEffect(
            "response",
            {.id = "unknown.response_law",
             .stage = Stage::kSensor,
             .summary = "charge e reads as e y^a exp(b ln^2 y), y = (e/full + 0.01)/1.01; of "
                        "light's charge c electrons at most are lost: c e/(e + 1)",
             .reference = "EMVA 1288 R4.0 Linear, linearity error LE",
             .parameters = {Coefficient("exponent", 0.5, 0.02), Coefficient("bend", 0.1, 5e-3),
                            Coefficient("lost_electrons", 1e3, 3)}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>*, const FrameSetup&,
                       Parameters p) const override {
    if (p[2] == 0) return;
    for (double& e : electrons.values) {
      if (e > 0) e = std::max(0.0, e - p[2] * e / (e + 1));
    }
  }
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[0] == 0 && p[1] == 0) return;
    const double per_full = 1 / FullScale(frame);
    for (double& e : electrons.values) e *= 1 + CurveAt(e * per_full, p);
  }

  Axes CurveAxes() const override {
    return {"signal_over_full_scale", "response_change_relative_but_for_lost_electrons",
            EvenlySpaced(0, 1, 41)};
  }
  double CurveAt(double signal, Parameters p) const override {
    const double y = std::log((std::max(0.0, signal) + 0.01) / 1.01);
    return std::expm1(y * (p[0] + p[1] * y));
  }
};

class DarkSignalTerm final : public FreeFormEffect {
 public:
  DarkSignalTerm()
      : FreeFormEffect(
            "offset",
            {.id = "unknown.dark_signal",
             .stage = Stage::kSensor,
             .summary = "dark signal a + b t + c t^2 of the exposure time t, and slopes "
                        "from the principal point to the edge of the sensor",
             .reference = "EMVA 1288 R4.0 Linear, section 3 (dark current)",
             .parameters = {
                 Coefficient("electrons", 1e3, 3), Coefficient("electrons_per_s", 1e5, 30),
                 Coefficient("electrons_per_s2", 1e6, 60), Coefficient("slope_u_electrons", 1e3, 3),
                 Coefficient("slope_v_electrons", 1e3, 3)}}) {}

  // The part that grows with time is charge, with its shot noise.
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    Sensor& sensor = frame.sensor;
    sensor.dark_mean_electrons += p[0];
    const double t = frame.exposure_time_s;
    const double charge = t * (p[1] + t * p[2]);
    const double doublings =
        (frame.sensor_temperature_c - sensor.dark_current_reference_temperature_c) /
        sensor.dark_current_doubling_k;
    if (charge > 0) {
      sensor.dark_current_electrons_per_s += charge / t / std::exp2(doublings);
    } else {
      sensor.dark_mean_electrons += charge;
    }
  }
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (p[3] == 0 && p[4] == 0) return;
    const double per_column = p[3] / (0.5 * frame.sensor.columns_px);
    const double per_row = p[4] / (0.5 * frame.sensor.rows_px);
    for (int i = 0; i < electrons.rows_px; ++i) {
      for (int j = 0; j < electrons.columns_px; ++j) {
        electrons.At(i, j) +=
            per_column * (frame.roi.column_px + j) + per_row * (frame.roi.row_px + i);
      }
    }
  }

  Axes CurveAxes() const override {
    Axes axes{"exposure_time_s", "dark_signal_electrons", {0}};
    for (int k = -8; k <= 0; ++k) axes.abscissa_values.push_back(std::pow(10, 0.5 * k));
    return axes;
  }
  double CurveAt(double t, Parameters p) const override { return p[0] + t * (p[1] + t * p[2]); }
};

class ColourTerm final : public FreeFormEffect {
 public:
  ColourTerm()
      : FreeFormEffect("response",
                       {.id = "unknown.colour",
                        .stage = Stage::kSensor,
                        .summary = "signal of red, green and blue pixels times 1 + a, b, c",
                        .reference = "EMVA 1288 R4.0 Linear, section 2.1 (quantum efficiency)",
                        .parameters = {Coefficient("red_relative", 0.9, 0.1),
                                       Coefficient("green_relative", 0.9, 0.1),
                                       Coefficient("blue_relative", 0.9, 0.1)}}) {}

  void OnFrame(FrameSetup& frame, Parameters p) const override {
    if (frame.sensor.colour_filter == ColourFilter::kMono) return;
    for (int channel = 0; channel < frame.sensor.channels(); ++channel) {
      for (double& efficiency : frame.sensor.quantum_efficiency[channel].quantum_efficiency) {
        efficiency *= 1 + p[channel];
      }
    }
  }
};

// Columns or rows that are read out by converters of their own, which are not alike.
class CellGainTerm final : public FreeFormEffect {
 public:
  CellGainTerm()
      : FreeFormEffect("response",
                       {.id = "unknown.cell_gain",
                        .stage = Stage::kSensor,
                        .summary = "charge of odd columns, of odd rows, and of pixels of which one "
                                   "of both is odd times 1 + a, b, c, of the others 1 - a, b, c",
                        .reference = "EMVA 1288 R4.0 Linear, section 4 (periodic non-uniformity)",
                        .parameters = {Coefficient("odd_columns_relative", 0.5, 0.02),
                                       Coefficient("odd_rows_relative", 0.5, 0.02),
                                       Coefficient("checkerboard_relative", 0.5, 0.02)}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;
    double factor[2][2];
    for (int row = 0; row < 2; ++row) {
      for (int column = 0; column < 2; ++column) {
        factor[row][column] = 1 + (column == 1 ? p[0] : -p[0]) + (row == 1 ? p[1] : -p[1]) +
                              (row != column ? p[2] : -p[2]);
      }
    }
    for (int row = 0; row < electrons.rows_px; ++row) {
      for (int column = 0; column < electrons.columns_px; ++column) {
        electrons.At(row, column) *=
            factor[(frame.roi.row_px + row) & 1][(frame.roi.column_px + column) & 1];
      }
    }
  }
};

// Blocks of columns that were exposed, ground or read out in turn differ in sensitivity. A Fourier
// series describes any such pattern, wherever the region lies on the sensor. Two terms share its
// harmonics, so that each has as many coefficients as can be selected.
class ColumnSensitivityTerm final : public FreeFormEffect {
 public:
  ColumnSensitivityTerm(std::string_view id, std::string_view summary, int first_harmonic)
      : FreeFormEffect("multiplicative_light",
                       {.id = id,
                        .stage = Stage::kSensor,
                        .finer_than_block = true,
                        .summary = summary,
                        .reference = "EMVA 1288 R4.0 Linear, section 4 (column non-uniformity)",
                        .parameters = Harmonics(first_harmonic, first_harmonic + 7, 5e-3)}),
        first_harmonic_(first_harmonic) {}

  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup&, Parameters p) const override {
    if (IsNull(p)) return;
    std::vector<double> factors;
    for (int j = 0; j < light.roi.columns_px; ++j) {
      factors.push_back(std::max(0.0, CurveAt(light.roi.column_px + j, p)));
    }
    MultiplyLight(light, false, [&](int column_px, int /*row_px*/) {
      return factors[static_cast<size_t>(column_px - light.roi.column_px)];
    });
  }

  Axes CurveAxes() const override {
    return {"column_px_modulo_512", "light_factor", EvenlySpaced(0, kPeriod_px, 129)};
  }
  double CurveAt(double column_px, Parameters p) const override {
    return 1 + FourierSeries(column_px / kPeriod_px, first_harmonic_, p);
  }

 private:
  // Longer than a region of the recordings format is wide, so that a pattern need not repeat in it.
  static constexpr double kPeriod_px = 512;
  int first_harmonic_;
};

// Charge flow between neighbouring pixels of the region; the sum is conserved. `between_rows` and
// `between_columns` give the flow from one pixel to the other.
template <typename Flow>
void MoveBetweenNeighbours(Image<double>& electrons, const Flow& between_rows,
                           const Flow& between_columns) {
  const Image<double> before = electrons;
  const auto move = [&](int row, int column, int to_row, int to_column, const Flow& flow) {
    if (to_row == before.rows_px || to_column == before.columns_px) return;
    const double moved = flow(before.At(row, column), before.At(to_row, to_column));
    electrons.At(row, column) -= moved;
    electrons.At(to_row, to_column) += moved;
  };
  for (int i = 0; i < before.rows_px; ++i) {
    for (int j = 0; j < before.columns_px; ++j) {
      move(i, j, i + 1, j, between_rows);
      move(i, j, i, j + 1, between_columns);
    }
  }
}

class ChargeSpreadTerm final : public FreeFormEffect {
 public:
  ChargeSpreadTerm()
      : FreeFormEffect("point_spread",
                       {.id = "unknown.charge_spread",
                        .stage = Stage::kSensor,
                        .charge_transport = ChargeTransport::kProportional,
                        .summary = "part of the difference of neighbours flows: across rows, "
                                   "across columns",
                        .reference = "EMVA 1288 R4.0 Linear, section 2.1 (pixels independent)",
                        .parameters = {Coefficient("between_rows", 0.2, 0.01),
                                       Coefficient("between_columns", 0.2, 0.01)}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>*, const FrameSetup&,
                       Parameters p) const override {
    if (IsNull(p)) return;
    const auto part_of_difference = [](double part) {
      return [part](double from, double to) { return part * (from - to); };
    };
    MoveBetweenNeighbours(electrons, part_of_difference(p[0]), part_of_difference(p[1]));
  }
};

class ChargeFlowTerm final : public FreeFormEffect {
 public:
  ChargeFlowTerm()
      : FreeFormEffect(
            "point_spread",
            {.id = "unknown.charge_flow",
             .stage = Stage::kSensor,
             .charge_transport = ChargeTransport::kGrowsWithCharge,
             .summary = "part of the difference of neighbours flows, in proportion to their mean "
                        "over full scale: across rows, across columns",
             .reference = "Antilogus et al., JINST 9 (2014) C03048",
             .parameters = {Coefficient("between_rows_at_full_scale", 0.2, 0.01),
                            Coefficient("between_columns_at_full_scale", 0.2, 0.01)}}) {}

  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    if (IsNull(p)) return;
    const auto part_of_squares = [&](double part) {
      return [per_electron = part / (2 * FullScale(frame))](double from, double to) {
        return per_electron * (from + to) * (from - to);
      };
    };
    MoveBetweenNeighbours(electrons, part_of_squares(p[0]), part_of_squares(p[1]));
  }
};

// Light that pixels take up on their way along the column, or charge left behind there.
class ColumnTrailTerm final : public FreeFormEffect {
 public:
  ColumnTrailTerm()
      : FreeFormEffect("additive_light",
                       {.id = "unknown.column_trail",
                        .stage = Stage::kSensor,
                        .summary = "every pixel gains from the pixels of its column: a and b (1 "
                                   "ms/t) of their mean, c of the mean of those above",
                        .reference = "Theuwissen, Solid-State Imaging with Charge-Coupled Devices "
                                     "(1995), section 3.6 (smear)",
                        .parameters = {Coefficient("part_of_mean", 1, 0.01),
                                       Coefficient("part_of_mean_at_1_ms", 1, 0.01),
                                       Coefficient("part_of_mean_above", 1, 0.01)}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>*, const FrameSetup& frame,
                       Parameters p) const override {
    if (IsNull(p) || !(frame.exposure_time_s > 0)) return;
    const double part = (p[0] + p[1] * 1e-3 / frame.exposure_time_s) / electrons.rows_px;
    const double above_part = p[2] / electrons.rows_px;
    for (int j = 0; j < electrons.columns_px; ++j) {
      double sum = 0, above = 0;
      for (int i = 0; i < electrons.rows_px; ++i) sum += electrons.At(i, j);
      for (int i = 0; i < electrons.rows_px; ++i) {
        const double here = electrons.At(i, j);
        electrons.At(i, j) = std::max(0.0, here + part * sum + above_part * above);
        above += here;
      }
    }
  }
};

class MemoryTerm final : public FreeFormEffect {
 public:
  MemoryTerm()
      : FreeFormEffect(
            "response",
            {.id = "unknown.memory",
             .stage = Stage::kSensor,
             .summary = "charge q of the frame before stays: a q + b q^2/full + c sqrt(q full)",
             .reference = "Theuwissen, Solid-State Imaging with Charge-Coupled Devices (1995), "
                          "section 5.4 (image lag)",
             .parameters = {Coefficient("linear", 1, 0.01), Coefficient("square", 1, 0.01),
                            Coefficient("root", 1, 2e-3)}}) {}

  void OnMeanElectrons(Image<double>& electrons, const Image<double>* previous,
                       const FrameSetup& frame, Parameters p) const override {
    if (previous == nullptr || IsNull(p)) return;
    const double full = FullScale(frame);
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      const double left = full * CurveAt(previous->values[i] / full, p);
      electrons.values[i] = std::max(0.0, electrons.values[i] + left);
    }
  }

  Axes CurveAxes() const override {
    return {"previous_signal_over_full_scale", "left_over_full_scale", EvenlySpaced(0, 1, 41)};
  }
  double CurveAt(double q, Parameters p) const override {
    return p[0] * q + p[1] * q * q + p[2] * std::sqrt(std::max(0.0, q));
  }
};

}  // namespace

std::vector<const FreeFormEffect*> SensorTerms() {
  static const ResponseTerm response;
  static const ResponseLawTerm response_law;
  static const ColourTerm colour;
  static const CellGainTerm cell_gain;
  static const ColumnSensitivityTerm column_sensitivity(
      "unknown.column_sensitivity",
      "light of column j times 1 + sum over k from 1 to 8 of a_k cos(2 pi k j/512) "
      "+ b_k sin(2 pi k j/512), j from the principal point",
      1);
  static const ColumnSensitivityTerm fine_column_sensitivity(
      "unknown.fine_column_sensitivity",
      "light of column j times 1 + sum over k from 9 to 16 of a_k cos(2 pi k j/512) "
      "+ b_k sin(2 pi k j/512), j from the principal point",
      9);
  static const DarkSignalTerm dark_signal;
  static const ChargeSpreadTerm charge_spread;
  static const ChargeFlowTerm charge_flow;
  static const ColumnTrailTerm column_trail;
  static const MemoryTerm memory;
  return {&column_sensitivity,
          &fine_column_sensitivity,
          &charge_spread,
          &charge_flow,
          &column_trail,
          &memory,
          &colour,
          &cell_gain,
          &dark_signal,
          &response_law,
          &response};
}

}  // namespace sightline
