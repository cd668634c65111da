// SPDX-License-Identifier: Apache-2.0
// Model-discrepancy terms: nothing at null, light conserved, the same in the renderer and in the
// expectation, and laws of no vocabulary approximated.
#include "render_worker/effects/discrepancy/free_form.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <functional>
#include <numbers>
#include <set>
#include <string>

#include "render_worker/diagnosis/expectation/expected_frame.h"
#include "render_worker/diagnosis/finding/describe_term.h"
#include "render_worker/diagnosis/random_effect/compare_random_effects.h"
#include "render_worker/effects/described_effect.h"
#include "render_worker/effects/discrepancy/free_form_effect.h"
#include "render_worker/effects/stage_name.h"
#include "render_worker/effects/vocabulary.h"
#include "render_worker/image_chain/form_image.h"

namespace sightline {
namespace {

FrameSetup NominalFrame() {
  FrameSetup frame;
  frame.sensor.pixel_pitch_m = 5.86e-6;
  frame.sensor.columns_px = 1936;
  frame.sensor.rows_px = 1216;
  frame.sensor.gain_dn_per_electron = 0.1;
  frame.sensor.saturation_capacity_electrons = 33000;
  frame.sensor.dark_mean_electrons = 60;
  frame.sensor.dark_noise_electrons = 5;
  for (QuantumEfficiencyCurve& curve : frame.sensor.quantum_efficiency) {
    curve.wavelength_m = {661e-9};
    curve.quantum_efficiency = {0.4};
  }
  frame.lens.focal_length_m = 0.016;
  frame.lens.f_number = 5.6;
  frame.lens.focus_distance_m = 0.36;
  frame.lens.transmission = 0.9;
  frame.laser.power_w = 6e-4;
  frame.laser.divergence_rad = 1e-3;
  frame.laser.beam_focus_distance_m = 0.43;
  frame.laser.fan_angle_rad = 0.7;
  frame.plate = {0.352, 0.41, std::numbers::pi / 4, 0};
  frame.roi = {200, -96, 4, 192};
  frame.seeds = {11, 12, 13, 14};
  frame.exposure_time_s = 4e-4;
  frame.timestamp_s = 700;
  return frame;
}

FrameSetup BayerFrame() {
  FrameSetup frame = NominalFrame();
  frame.sensor.colour_filter = ColourFilter::kBayerRggb;
  frame.sensor.quantum_efficiency[kGreen].quantum_efficiency = {0.1};
  frame.sensor.quantum_efficiency[kBlue].quantum_efficiency = {0.03};
  frame.plate.camera_distance_m = 0.3;
  frame.plate.line_offset_m = 1e-3;
  frame.lens.focus_distance_m = 0.36;
  frame.lens.f_number = 2.8;
  frame.exposure_time_s = 1e-4;
  return frame;
}

FrameSetup DarkFrame() {
  FrameSetup frame = NominalFrame();
  frame.shutter_open = false;
  frame.laser_on = false;
  frame.exposure_time_s = 0.1;
  return frame;
}

std::vector<double> NullOf(const Effect& term) {
  std::vector<double> null;
  for (const EffectParameter& parameter : term.description().parameters) {
    null.push_back(parameter.null_value);
  }
  return null;
}

// A place, a width, a time: does not vanish with the strength.
bool IsShape(const EffectParameter& parameter) { return parameter.lower > 0; }

const Effect& Term(const char* id) {
  const Effect* term = FindFreeFormTerm(id);
  assert(term != nullptr);
  return *term;
}

// Everything the expectation says about a frame that follows another: levels of speckle one by one,
// or their mean only.
std::vector<double> Expected(const FrameSetup& frame, const std::vector<ActiveEffect>& effects,
                             bool every_level) {
  Image<double> previous(frame.roi.columns_px, frame.roi.rows_px);
  for (size_t i = 0; i < previous.values.size(); ++i) {
    previous.values[i] = 10.0 * static_cast<double>(i % 700);
  }
  const ExpectedFrame expected = ExpectFrame(frame, effects, &previous, nullptr, 4);
  std::vector<double> numbers;
  for (int row = 0; row < frame.roi.rows_px; ++row) {
    for (int column = 0; column < frame.roi.columns_px; ++column) {
      numbers.push_back(expected.MeanDn(row, column));
    }
  }
  for (const Image<float>& level : expected.level_dn) {
    if (every_level) numbers.insert(numbers.end(), level.values.begin(), level.values.end());
  }
  numbers.push_back(std::pow(expected.row_scatter_dn, 2));
  numbers.push_back(std::pow(expected.column_scatter_dn, 2));
  for (const Image<float>* image : {&expected.noise_variance_dn2, &expected.pattern_variance_dn2}) {
    numbers.insert(numbers.end(), image->values.begin(), image->values.end());
  }
  return numbers;
}

TEST(FreeForm, TermsAreDescribed) {
  std::set<std::string_view> ids;
  std::set<Stage> stages;
  for (const Effect* term : FreeFormTerms()) {
    const EffectDescription& description = term->description();
    EXPECT_TRUE(ids.insert(description.id).second) << description.id;
    EXPECT_TRUE(description.id.starts_with("unknown.")) << description.id;
    EXPECT_EQ(FindEffect(description.id), nullptr) << description.id;
    EXPECT_EQ(FindFreeFormTerm(description.id), term);
    EXPECT_FALSE(description.summary.empty());
    EXPECT_FALSE(description.reference.empty());
    EXPECT_GE(description.parameters.size(), 2U) << description.id;
    // Eight harmonics have a cosine and a sine each; more cannot be selected (SelectCoefficients).
    const size_t most = description.parameters.front().name.starts_with("cosine") ? 16 : 6;
    EXPECT_LE(description.parameters.size(), most) << description.id;
    for (const EffectParameter& parameter : description.parameters) {
      if (!IsShape(parameter) || &parameter == &description.parameters.front()) {
        EXPECT_EQ(parameter.null_value, 0) << parameter.name;
        EXPECT_LE(parameter.lower, 0) << parameter.name;
      }
      EXPECT_GT(parameter.upper, parameter.prior_scale) << parameter.name;
      EXPECT_GT(parameter.prior_scale, 0) << parameter.name;
    }
    stages.insert(description.stage);
  }
  EXPECT_EQ(stages.size(), 6U);
  EXPECT_EQ(FindFreeFormTerm("unknown.nothing"), nullptr);
}

TEST(FreeForm, NullIsBitIdenticalInTheExpectation) {
  for (const FrameSetup& frame : {NominalFrame(), BayerFrame(), DarkFrame()}) {
    const std::vector<double> without = Expected(frame, {}, true);
    for (const Effect* term : FreeFormTerms()) {
      EXPECT_EQ(Expected(frame, {{term, NullOf(*term)}}, true), without) << term->description().id;
    }
  }
}

TEST(FreeForm, NullIsBitIdenticalInTheRenderer) {
  FrameSetup frame = NominalFrame();
  frame.roi = {200, -16, 16, 32};
  Image<double> previous(16, 32, 500.0);
  const auto without = RenderPlateFrame(frame, {}, &previous, 1);
  ASSERT_TRUE(without.ok());
  std::vector<ActiveEffect> all;
  for (const Effect* term : FreeFormTerms()) all.push_back({term, NullOf(*term)});
  const auto with = RenderPlateFrame(frame, all, &previous, 1);
  ASSERT_TRUE(with.ok());
  EXPECT_EQ(with->raw_dn.values, without->raw_dn.values);
  EXPECT_EQ(with->mean_photo_electrons.values, without->mean_photo_electrons.values);
}

// Every coefficient acts on some frame, and a small one acts half as much as one twice as large.
TEST(FreeForm, EveryCoefficientActsSmoothly) {
  FrameSetup early = NominalFrame(), late = NominalFrame(), second = NominalFrame();
  FrameSetup defocused = NominalFrame(), off_axis = NominalFrame();
  off_axis.roi.column_px += 300;
  defocused.plate.camera_distance_m *= 1.05;
  early.timestamp_s = 40;
  late.timestamp_s = 1900;
  second.timestamp_s = 300;
  late.exposure_time_s = 3e-3;
  // These change patterns, codes and what differs between frames; they have their own tests.
  const std::set<std::string_view> elsewhere = {
      "unknown.pixel_tail",       "unknown.codes",
      "unknown.motion",           "unknown.power_scatter",
      "unknown.exposure_scatter", "unknown.reflectance_scatter",
      "unknown.movement"};
  for (const Effect* term : FreeFormTerms()) {
    if (elsewhere.contains(term->description().id)) continue;
    // All others change the mean or a variance.
    const bool levels = term->description().id == "unknown.coherence" ||
                        term->description().id == "unknown.speckle_averaging";
    const auto& parameters = term->description().parameters;
    for (size_t k = 0; k < parameters.size(); ++k) {
      if (IsShape(parameters[k])) continue;
      double change = 0, twice = 0, bend = 0;
      for (const FrameSetup& frame :
           {NominalFrame(), BayerFrame(), DarkFrame(), early, late, second, defocused, off_axis}) {
        const std::vector<double> null = Expected(frame, {}, levels);
        std::vector<double> p = NullOf(*term);
        p[k] = 0.1 * parameters[k].prior_scale;
        const std::vector<double> one = Expected(frame, {{term, p}}, levels);
        p[k] *= 2;
        const std::vector<double> two = Expected(frame, {{term, p}}, levels);
        for (size_t i = 0; i < null.size(); ++i) {
          change += std::pow(one[i] - null[i], 2);
          twice += std::pow(two[i] - null[i], 2);
          bend += std::pow(two[i] - 2 * one[i] + null[i], 2);
        }
      }
      EXPECT_GT(change, 0) << parameters[k].name;
      EXPECT_LT(bend, 0.05 * twice) << parameters[k].name;
    }
  }
}

TEST(FreeForm, PixelTailIsPartOfThePixels) {
  FrameSetup frame = DarkFrame();
  frame.roi = {0, 0, 400, 400};
  const Effect& term = Term("unknown.pixel_tail");
  const std::array<double, 3> mean = {30, 1000 * frame.exposure_time_s,
                                      10000 * frame.exposure_time_s};
  for (size_t k = 0; k < mean.size(); ++k) {
    std::vector<double> p = NullOf(term);
    p[k] = 0.02;
    Image<double> electrons(400, 400, 0.0);
    term.OnElectrons(electrons, frame, p);
    double pixels = 0, sum = 0, square = 0;
    for (const double e : electrons.values) {
      pixels += e > 0 ? 1 : 0;
      sum += e;
      square += e * e;
    }
    // 3200 pixels: four standard deviations.
    EXPECT_NEAR(pixels, 3200, 4 * 56) << k;
    EXPECT_NEAR(sum / pixels / mean[k], 1, 0.07) << k;
    EXPECT_NEAR(square / pixels / (2 * mean[k] * mean[k]), 1, 0.16) << k;
  }
}

TEST(FreeForm, CodesLoseBitsForPartOfTheNumbers) {
  const FrameSetup frame = NominalFrame();
  const Effect& term = Term("unknown.codes");
  Image<uint16_t> ramp(4096, 1);
  for (int dn = 0; dn < 4096; ++dn) ramp.values[dn] = static_cast<uint16_t>(dn);
  for (const double part : {0.1, 0.5, 0.9}) {
    for (int bit = 0; bit < 4; ++bit) {
      std::vector<double> p = NullOf(term);
      p[bit] = part;
      Image<uint16_t> read = ramp;
      term.OnRaw(read, frame, p);
      int lost = 0;
      for (int dn = 0; dn < 4096; ++dn) {
        EXPECT_TRUE(read.values[dn] == dn || (read.values[dn] | 1 << bit) == dn) << dn;
        lost += read.values[dn] != dn ? 1 : 0;
      }
      EXPECT_NEAR(lost, 2048 * part, 16) << part << " " << bit;
    }
  }
  Image<uint16_t> all = ramp, missing = ramp;
  term.OnRaw(all, frame, std::array{1.0, 1.0, 0.0, 0.0});
  AdcMissingBits().OnRaw(missing, frame, std::array{2.0});
  EXPECT_EQ(all.values, missing.values);
}

// With a steady speed, as far as the plate's motion until the exposure goes.
TEST(FreeForm, MotionIsThatOfThePlate) {
  FrameSetup frame = NominalFrame();
  frame.exposure_time_s = 0;
  SpeckleModel free, plate;
  Term("unknown.motion").OnSpeckle(free, frame, std::array{1e-6, 0.0});
  PlateMotion().OnSpeckle(plate, frame, std::array{1e-6});
  ASSERT_FALSE(free.shifts.empty());
  ASSERT_FALSE(plate.shifts.empty());
  EXPECT_NEAR(free.shifts[0].u_m, plate.shifts[0].u_m, 1e-12);
  EXPECT_GT(std::abs(free.shifts[0].u_m), 1e-5);
}

TEST(FreeForm, HalosConserveLight) {
  const FrameSetup frame = NominalFrame();
  for (const char* id : {"unknown.halo", "unknown.one_sided_halo", "unknown.displaced_images"}) {
    const Effect& term = Term(id);
    std::vector<double> p = NullOf(term);
    for (size_t k = 0; k < p.size(); ++k) {
      if (!IsShape(term.description().parameters[k])) p[k] = k % 2 == 0 ? 0.1 : -0.07;
    }
    const std::vector<ActiveEffect> effects = {{&term, p}};
    const OpticsModel optics = MakeOpticsModel(frame, effects);
    ASSERT_EQ(optics.transfer.size(), 1U);
    EXPECT_EQ(optics.transfer[0](0, 0), std::complex<double>(1)) << id;
    EXPECT_NE(optics.transfer[0](0, 5e3), std::complex<double>(1)) << id;
    // An image is real.
    EXPECT_EQ(optics.transfer[0](0, -5e3), std::conj(optics.transfer[0](0, 5e3))) << id;
  }
}

TEST(FreeForm, OneSidedHaloLiesBelow) {
  const FrameSetup frame = NominalFrame();
  const Effect& term = Term("unknown.one_sided_halo");
  const std::vector<ActiveEffect> effects = {{&term, {0, 0.02, 0.02}}};
  const ExpectedFrame null = ExpectFrame(frame, {}, nullptr, nullptr, 1);
  const ExpectedFrame with = ExpectFrame(frame, effects, nullptr, nullptr, 1);
  double above = 0, below = 0;
  for (int row = 0; row < frame.roi.rows_px; ++row) {
    (row < -frame.roi.row_px ? above : below) +=
        with.mean_photo_electrons.At(row, 0) - null.mean_photo_electrons.At(row, 0);
  }
  EXPECT_GT(below, 0);
  EXPECT_LT(above, 0);
}

// Integral of the irradiance over the plate: power over length of the line.
TEST(FreeForm, BeamAndPlateSpreadConserveLight) {
  const FrameSetup frame = NominalFrame();
  const auto integral = [&](const PlateScene& scene) {
    double sum = 0;
    for (int i = -4000; i < 4000; ++i)
      sum += scene.laser_irradiance_w_m2(0, (i + 0.5) * 1e-5) * 1e-5;
    return sum;
  };
  const double null = integral(MakePlateScene(frame));
  for (const char* id :
       {"unknown.beam", "unknown.beam_foot", "unknown.beam_lobes", "unknown.plate_spread"}) {
    const Effect& term = Term(id);
    PlateScene scene = MakePlateScene(frame);
    std::vector<double> p = NullOf(term);
    for (size_t k = 0; k < p.size(); ++k) {
      if (!IsShape(term.description().parameters[k])) p[k] = 0.05;
    }
    term.OnPlate(scene, frame, p);
    // Kernels of 2 mm lose 21 exp(-20) beyond 4 cm; the series of the beam is cut at 4 sigma.
    EXPECT_NEAR(integral(scene), null, 1e-4 * null) << id;
  }
}

TEST(FreeForm, ChargeSpreadKeepsTheCharge) {
  const FrameSetup frame = NominalFrame();
  Image<double> electrons(frame.roi.columns_px, frame.roi.rows_px);
  double before = 0, after = 0;
  for (size_t i = 0; i < electrons.values.size(); ++i) {
    electrons.values[i] = static_cast<double>(i * 7919 % 9000);
    before += electrons.values[i];
  }
  const std::vector<double> parts = {0.01, 0.02};
  Term("unknown.charge_spread").OnMeanElectrons(electrons, nullptr, frame, parts);
  Term("unknown.charge_flow").OnElectrons(electrons, frame, parts);
  for (const double e : electrons.values) after += e;
  EXPECT_NEAR(after, before, 1e-9 * before);
}

TEST(FreeForm, FlowAlikeInBothDirectionsIsBrighterFatter) {
  const FrameSetup frame = NominalFrame();
  Image<double> electrons(frame.roi.columns_px, frame.roi.rows_px);
  for (size_t i = 0; i < electrons.values.size(); ++i) {
    electrons.values[i] = static_cast<double>(i * 7919 % 9000);
  }
  Image<double> by_term = electrons, by_effect = electrons;
  const double full = frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
  constexpr double kShiftPerElectron = 1e-6;
  const double part = 0.5 * kShiftPerElectron * full;
  Term("unknown.charge_flow").OnElectrons(by_term, frame, std::vector<double>{part, part});
  FindEffect("sensor.brighter_fatter")
      ->OnElectrons(by_effect, frame, std::vector<double>{kShiftPerElectron});
  for (size_t i = 0; i < electrons.values.size(); ++i) {
    ASSERT_NEAR(by_term.values[i], by_effect.values[i], 1e-9 * 9000);
  }
  EXPECT_NE(by_term.values, electrons.values);
}

TEST(FreeForm, ReadoutLagFollowsAStepAndLeavesAnEvenFieldAlone) {
  const FrameSetup frame = NominalFrame();
  const std::vector<double> parts = {0.1, 0.02, 0.05, 0.03};
  const Effect& term = Term("unknown.readout_lag");
  Image<double> even(3, 40, 800.0);
  term.OnElectrons(even, frame, parts);
  for (const double electrons : even.values) EXPECT_EQ(electrons, 800.0);
  // A step upwards: what is read after it lags behind, less and less.
  Image<double> step(1, 40, 100.0);
  for (int row = 10; row < 40; ++row) step.At(row, 0) = 2000;
  term.OnElectrons(step, frame, parts);
  EXPECT_EQ(step.At(9, 0), 100.0);
  for (int row = 10; row < 39; ++row) {
    EXPECT_LT(step.At(row, 0), 2000) << row;
    EXPECT_LT(step.At(row, 0), step.At(row + 1, 0)) << row;
  }
  EXPECT_NEAR(step.At(39, 0), 2000, 1);
}

TEST(FreeForm, FineColumnsContinueTheHarmonicsOfTheCoarseOnes) {
  const auto& coarse = dynamic_cast<const FreeFormEffect&>(Term("unknown.column_sensitivity"));
  const auto& fine = dynamic_cast<const FreeFormEffect&>(Term("unknown.fine_column_sensitivity"));
  std::vector<double> p(16, 0.0);
  p[0] = 0.1;                                           // cosine of the first harmonic of either
  EXPECT_NEAR(coarse.CurveAt(256, p), 0.9, 1e-12);      // half of 512 px
  EXPECT_NEAR(fine.CurveAt(256.0 / 9, p), 0.9, 1e-12);  // half of a ninth of it
  EXPECT_NEAR(fine.CurveAt(512.0 / 9, p), 1.1, 1e-12);
}

TEST(FreeForm, LineNoiseScattersAsExpected) {
  const std::vector<double> variances = {4, 9};  // of rows, of columns
  const std::vector<ActiveEffect> effects = {{&Term("unknown.line_noise"), variances}};
  FrameSetup frame = DarkFrame();
  frame.roi = {0, 0, 400, 400};
  Image<double> electrons(400, 400, 0.0);
  Term("unknown.line_noise").OnElectrons(electrons, frame, variances);
  const auto variance_of_means = [&](bool rows) {
    double sum = 0, squares = 0;
    for (int i = 0; i < 400; ++i) {
      double mean = 0;
      for (int j = 0; j < 400; ++j) mean += (rows ? electrons.At(i, j) : electrons.At(j, i)) / 400;
      sum += mean;
      squares += mean * mean;
    }
    return squares / 400 - std::pow(sum / 400, 2);
  };
  // Relative standard error of a variance of 400: 0.07.
  EXPECT_NEAR(variance_of_means(true), 4, 4 * 0.21);
  EXPECT_NEAR(variance_of_means(false), 9, 9 * 0.21);
  const ExpectedFrame expected = ExpectFrame(frame, effects, nullptr, nullptr, 1);
  const double gain = frame.sensor.gain_dn_per_electron;
  EXPECT_DOUBLE_EQ(expected.row_scatter_dn, 2 * gain);
  EXPECT_DOUBLE_EQ(expected.column_scatter_dn, 3 * gain);
  EXPECT_EQ(expected.mean_dn.values, ExpectFrame(frame, {}, nullptr, nullptr, 1).mean_dn.values);
}

// The line model of the diagnosis and the renderer's wave optics in two dimensions take a term the
// same way.
TEST(FreeForm, RendererAndExpectationAgree) {
  FrameSetup frame = NominalFrame();
  // Far off the axis: the renderer's optics are constant over blocks of 96 px.
  frame.roi = {900, -32, 4, 64};
  // Beyond the plate: farther still changes the image by more than the samples leave over.
  frame.lens.focus_distance_m = 0.36;
  frame.speckle = false;
  const auto rendered = [&](const std::vector<ActiveEffect>& effects) {
    return RenderPlateFrame(frame, effects, nullptr, 1)->mean_photo_electrons;
  };
  const auto expected = [&](const std::vector<ActiveEffect>& effects) {
    return ExpectFrame(frame, effects, nullptr, nullptr, 1).mean_photo_electrons;
  };
  const Image<double> rendered_null = rendered({}), expected_null = expected({});
  for (const char* id :
       {"unknown.beam",          "unknown.along_line",      "unknown.power_course",
        "unknown.other_light",   "unknown.plate_spread",    "unknown.reflectance",
        "unknown.halo",          "unknown.one_sided_halo",  "unknown.wavefront",
        "unknown.aperture",      "unknown.field",           "unknown.pupil_cut",
        "unknown.setup",         "unknown.line_place",      "unknown.keystone",
        "unknown.distortion",    "unknown.focus_field",     "unknown.focus_curvature",
        "unknown.charge_spread", "unknown.column_trail",    "unknown.exposure",
        "unknown.beam_lobes",    "unknown.displaced_images"}) {
    const Effect& term = Term(id);
    std::vector<double> p = NullOf(term);
    // The renderer's layers of curvature are an eighth of a wave apart at the pupil's rim.
    const double strength = std::string_view(id).starts_with("unknown.focus") ? 4 : 1;
    for (size_t k = 0; k < p.size(); ++k) {
      const EffectParameter& parameter = term.description().parameters[k];
      if (IsShape(parameter)) continue;
      p[k] = strength * parameter.prior_scale * (k % 2 == 0 ? 1 : 0.5);
    }
    const Image<double> a = rendered({{&term, p}}), b = expected({{&term, p}});
    double difference = 0, change = 0;
    for (size_t i = 0; i < a.values.size(); ++i) {
      const double by_rendering = a.values[i] - rendered_null.values[i];
      const double by_expectation = b.values[i] - expected_null.values[i];
      difference += std::pow(by_rendering - by_expectation, 2);
      change += std::pow(by_rendering, 2);
    }
    EXPECT_GT(change, 0) << id;
    // For small terms the sampling error of both counts: 1e-3 of the image.
    EXPECT_LT(std::sqrt(difference / change), 0.03) << id;
  }
}

// A law that the vocabulary does not have.
class Variant : public DescribedEffect {
 public:
  Variant()
      : DescribedEffect({.id = "variant",
                         .stage = Stage::kSensor,
                         .summary = "",
                         .reference = "",
                         .parameters = {}}) {}
};

class PowerLawResponse final : public Variant {
 public:
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const double full = frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
    for (double& e : electrons.values) e = full * std::pow(std::max(0.0, e / full), 1 + p[0]);
  }
};
class CubicResponse final : public Variant {
 public:
  void OnElectrons(Image<double>& electrons, const FrameSetup& frame, Parameters p) const override {
    const double full = frame.sensor.largest_dn() / frame.sensor.gain_dn_per_electron;
    for (double& e : electrons.values) e *= 1 - p[0] * std::pow(std::min(1.0, e / full), 2);
  }
};
class RingHalo final : public Variant {
 public:
  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    optics.transfer.push_back([g = p[0], radius = p[1]](double qx, double qy) {
      const double x = 2 * std::numbers::pi * radius * std::hypot(qx, qy);
      return std::complex<double>(1 - g + g * std::cyl_bessel_j(0.0, x));
    });
  }
};
// Halo 1/(1 + (r/r0)^2)^(3/2), with the transform exp(-2 pi q r0).
class FarReachingHalo final : public Variant {
 public:
  void OnOptics(OpticsModel& optics, const FrameSetup&, Parameters p) const override {
    optics.transfer.push_back([g = p[0], radius = p[1]](double qx, double qy) {
      return std::complex<double>(
          1 - g + g * std::exp(-2 * std::numbers::pi * radius * std::hypot(qx, qy)));
    });
  }
};
class LinearDrift final : public Variant {
 public:
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= 1 + p[0] * frame.timestamp_s;
  }
};
class PeriodicDrift final : public Variant {
 public:
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.laser.power_w *= 1 + p[0] * std::sin(frame.timestamp_s / p[1]);
  }
};
class GaussianSpread final : public Variant {
 public:
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    // Both are Gaussian: the sum of squares of their widths.
    const double w = BeamRadius(frame.laser, frame.plate.laser_distance_m) /
                     std::cos(frame.plate.incidence_angle_rad);
    const double wide = std::hypot(w, 2 * p[1]);
    const double centre = frame.plate.line_offset_m;
    scene.laser_irradiance_w_m2 = [w, wide, centre, part = p[0],
                                   before = scene.laser_irradiance_w_m2](double x_m, double s_m) {
      return (1 - part) * before(x_m, s_m) +
             part * w / wide * before(x_m, centre + (s_m - centre) * w / wide);
    };
  }
};
class ExponentialSpread final : public Variant {
 public:
  void OnPlate(PlateScene& scene, const FrameSetup& frame, Parameters p) const override {
    FindEffect("surface.subsurface_scattering")->OnPlate(scene, frame, p);
  }
};
class SaturatingLag final : public Variant {
 public:
  void OnMeanElectrons(Image<double>& electrons, const Image<double>* previous, const FrameSetup&,
                       Parameters p) const override {
    for (size_t i = 0; i < electrons.values.size(); ++i) {
      electrons.values[i] += p[0] * (1 - std::exp(-previous->values[i] / p[1]));
    }
  }
};
class CosinePowerShading final : public Variant {
 public:
  void OnPixelIrradiance(PixelIrradiance& light, const FrameSetup& frame,
                         Parameters p) const override {
    for (int i = 0; i < light.roi.rows_px; ++i) {
      for (int j = 0; j < light.roi.columns_px; ++j) {
        const double r = std::hypot(light.roi.row_px + i, light.roi.column_px + j) *
                         frame.sensor.pixel_pitch_m / frame.ImageDistance();
        light.laser_irradiance_w_m2.At(i, j) *=
            static_cast<float>(std::pow(1 + r * r, -0.5 * p[0]));
      }
    }
  }
};
class RootDarkSignal final : public Variant {
 public:
  void OnFrame(FrameSetup& frame, Parameters p) const override {
    frame.sensor.dark_mean_electrons += p[0] * std::pow(frame.exposure_time_s, 1.5);
  }
};

// Means of the rows of all frames over their standard deviation, as one vector. Each frame follows
// one of twice the light. Rows have 384 pixels.
Eigen::VectorXd Means(const std::vector<FrameSetup>& frames, const ActiveEffect* effect) {
  std::vector<ActiveEffect> effects;
  if (effect != nullptr) effects.push_back(*effect);
  std::vector<double> means;
  for (const FrameSetup& frame : frames) {
    const ExpectedFrame null = ExpectFrame(frame, {}, nullptr, nullptr, 6);
    Image<double> previous = null.mean_photo_electrons;
    for (double& e : previous.values) e *= 2;
    const ExpectedFrame expected = ExpectFrame(frame, effects, &previous, nullptr, 6);
    for (int row = 0; row < frame.roi.rows_px; ++row) {
      means.push_back(expected.MeanDn(row, 1) /
                      std::sqrt(null.noise_variance_dn2.At(row, 1) / 384));
    }
  }
  return Eigen::Map<Eigen::VectorXd>(means.data(), static_cast<Eigen::Index>(means.size()));
}

// Part of a variant's chi squared over the null model that the fitted term takes away.
double Absorbed(const std::vector<FrameSetup>& frames, const Effect& variant,
                const std::vector<double>& strength, const char* id,
                std::vector<double>* coefficients = nullptr) {
  const Effect& term = Term(id);
  const auto& parameters = term.description().parameters;
  const ActiveEffect true_effect{&variant, strength};
  const Eigen::VectorXd seen = Means(frames, &true_effect);
  const Eigen::VectorXd null = Means(frames, nullptr);
  ActiveEffect fitted{&term, NullOf(term)};
  Eigen::VectorXd mean = null;
  const auto n = static_cast<Eigen::Index>(parameters.size());
  for (int iteration = 0; iteration < 4; ++iteration) {
    Eigen::MatrixXd jacobian(mean.size(), n);
    for (Eigen::Index k = 0; k < n; ++k) {
      ActiveEffect moved = fitted;
      if (IsShape(parameters[static_cast<size_t>(k)])) {  // stays where it is
        jacobian.col(k).setZero();
        continue;
      }
      const double step = 0.05 * parameters[static_cast<size_t>(k)].prior_scale;
      moved.parameters[static_cast<size_t>(k)] += step;
      jacobian.col(k) = (Means(frames, &moved) - mean) / step;
    }
    // With the priors, as the diagnosis fits.
    Eigen::MatrixXd information = jacobian.transpose() * jacobian;
    Eigen::VectorXd gradient = jacobian.transpose() * (seen - mean);
    for (Eigen::Index k = 0; k < n; ++k) {
      const double scale = parameters[static_cast<size_t>(k)].prior_scale;
      information(k, k) += 1 / (scale * scale);
      if (IsShape(parameters[static_cast<size_t>(k)])) continue;
      gradient[k] -= fitted.parameters[static_cast<size_t>(k)] / (scale * scale);
    }
    const Eigen::VectorXd step = information.ldlt().solve(gradient);
    for (Eigen::Index k = 0; k < n; ++k) {
      const EffectParameter& parameter = parameters[static_cast<size_t>(k)];
      double& value = fitted.parameters[static_cast<size_t>(k)];
      value = std::clamp(value + step[k], parameter.lower, parameter.upper);
    }
    mean = Means(frames, &fitted);
  }
  if (coefficients != nullptr) *coefficients = fitted.parameters;
  return 1 - (seen - mean).squaredNorm() / (seen - null).squaredNorm();
}

std::vector<FrameSetup> Exposures() {
  std::vector<FrameSetup> frames;
  for (const double time_s : {1e-4, 4e-4, 1.6e-3, 3e-3}) {
    frames.push_back(NominalFrame());
    frames.back().exposure_time_s = time_s;
  }
  return frames;
}

TEST(FreeForm, ResponsesThatAreNotInTheVocabulary) {
  std::vector<double> c;
  EXPECT_GT(Absorbed(Exposures(), CubicResponse(), {0.1}, "unknown.response", &c), 0.99);
  // The curve is the law, up to where hardly any pixel gets.
  const v1::FreeFormTerm curve = DescribeFreeForm(Term("unknown.response"), c, {});
  for (int i = 0; i < curve.values_size() && curve.abscissa_values(i) < 0.75; ++i) {
    EXPECT_NEAR(curve.values(i), -0.1 * std::pow(curve.abscissa_values(i), 2), 0.01);
  }
  EXPECT_GT(Absorbed(Exposures(), PowerLawResponse(), {0.03}, "unknown.response"), 0.9);
}

TEST(FreeForm, HalosThatAreNotInTheVocabulary) {
  EXPECT_GT(Absorbed(Exposures(), FarReachingHalo(), {0.05, 1e-4}, "unknown.halo"), 0.9);
  EXPECT_GT(Absorbed(Exposures(), RingHalo(), {0.05, 1.2e-4}, "unknown.halo"), 0.7);
  EXPECT_GT(Absorbed(Exposures(), RingHalo(), {0.05, 1e-4}, "unknown.displaced_images"), 0.95);
}

TEST(FreeForm, SpreadOnThePlateThatIsNotInTheVocabulary) {
  EXPECT_GT(Absorbed({NominalFrame(), BayerFrame()}, GaussianSpread(), {0.2, 4e-4},
                     "unknown.plate_spread"),
            0.9);
  EXPECT_GT(Absorbed({NominalFrame(), BayerFrame()}, ExponentialSpread(), {0.2, 5e-4},
                     "unknown.plate_spread"),
            0.9);
}

TEST(FreeForm, DriftsThatAreNotInTheVocabulary) {
  std::vector<FrameSetup> frames;
  for (int k = 0; k < 16; ++k) {
    frames.push_back(NominalFrame());
    frames.back().timestamp_s = 60 + 110 * k;
  }
  EXPECT_GT(Absorbed(frames, LinearDrift(), {5e-5}, "unknown.power_course"), 0.99);
  EXPECT_GT(Absorbed(frames, PeriodicDrift(), {0.05, 300}, "unknown.power_course"), 0.8);
}

TEST(FreeForm, LagShadingAndDarkSignalThatAreNotInTheVocabulary) {
  EXPECT_GT(Absorbed(Exposures(), SaturatingLag(), {60, 2000}, "unknown.memory"), 0.9);
  std::vector<FrameSetup> field;
  for (const int column : {-960, -500, 0, 500, 956}) {
    field.push_back(NominalFrame());
    field.back().roi.column_px = column;
  }
  EXPECT_GT(Absorbed(field, CosinePowerShading(), {2}, "unknown.field"), 0.99);
  EXPECT_GT(Absorbed(field, *FindEffect("optics.field_curvature"), {4}, "unknown.focus_curvature"),
            0.99);
  std::vector<FrameSetup> apertures;
  for (const double f_number : {1.4, 2.0, 2.8, 5.6}) {
    for (FrameSetup frame : field) {
      frame.lens.f_number = f_number;
      apertures.push_back(frame);
    }
  }
  const Effect& rim = *FindEffect("optics.mechanical_vignetting");
  EXPECT_GT(Absorbed(apertures, rim, {0.008, 0.01}, "unknown.pupil_cut"), 0.99);
  EXPECT_LT(Absorbed(apertures, rim, {0.008, 0.01}, "unknown.field"), 0.95);
  std::vector<FrameSetup> dark;
  for (const double time_s : {2e-4, 2e-3, 0.02, 0.1, 0.5}) {
    dark.push_back(DarkFrame());
    dark.back().exposure_time_s = time_s;
  }
  EXPECT_GT(Absorbed(dark, RootDarkSignal(), {100}, "unknown.dark_signal"), 0.99);
}

TEST(FreeForm, CurvesCarryTheStandardErrorsOfTheCoefficients) {
  // Linear in the coefficients: variance of the curve by hand, at f/8 between two knots of time.
  const Effect& term = Term("unknown.power_course");
  const std::vector<double> c = {0.01, 0.02, -0.01, 0.03, 0};
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(5, 5);
  covariance.diagonal() << 1e-4, 4e-4, 9e-4, 1e-4, 1e-4;
  covariance(2, 3) = covariance(3, 2) = 1e-4;
  const v1::FreeFormTerm curve = DescribeFreeForm(term, c, covariance);
  EXPECT_EQ(curve.stage(), "illumination");
  EXPECT_EQ(curve.term(), "time_course");
  EXPECT_EQ(curve.abscissa(), "timestamp_s");
  ASSERT_EQ(curve.values_size(), curve.abscissa_values_size());
  ASSERT_EQ(curve.standard_errors_size(), curve.abscissa_values_size());
  int checked = 0;
  for (int i = 0; i < curve.values_size(); ++i) {
    if (curve.abscissa_values(i) != 750) continue;
    EXPECT_NEAR(curve.values(i), 1.01, 1e-12);
    EXPECT_NEAR(curve.standard_errors(i), std::sqrt(0.25 * (9e-4 + 1e-4 + 2e-4)), 1e-9);
    ++checked;
  }
  EXPECT_EQ(checked, 1);
  for (const Effect* other : FreeFormTerms()) {
    const v1::FreeFormTerm null = DescribeFreeForm(*other, NullOf(*other), {});
    EXPECT_GE(null.values_size(), 2) << other->description().id;
    EXPECT_EQ(null.standard_errors_size(), 0);
    EXPECT_FALSE(null.ordinate().empty());
    EXPECT_EQ(null.stage(), StageName(other->description().stage));
  }
}

// The pattern stays on the sensor, whatever the region, and keeps the mean sensitivity.
TEST(FreeForm, ColumnSensitivityIsFixedOnTheSensor) {
  const Effect& term = Term("unknown.column_sensitivity");
  std::vector<double> p = NullOf(term);
  p[2] = 0.02;   // cosine_2
  p[13] = 0.01;  // sine_7
  const FrameSetup frame = NominalFrame();
  const auto light_at = [&](int column_px, int columns_px) {
    PixelIrradiance light;
    light.roi = {column_px, 0, columns_px, 2};
    light.laser_irradiance_w_m2 = Image<float>(columns_px, 2, 1.0F);
    term.OnPixelIrradiance(light, frame, p);
    return light.laser_irradiance_w_m2;
  };
  const Image<float> whole = light_at(-300, 512), part = light_at(-260, 64);
  double sum = 0;
  for (int j = 0; j < 512; ++j) sum += whole.At(0, j);
  EXPECT_NEAR(sum / 512, 1, 1e-6);
  for (int j = 0; j < 64; ++j) {
    EXPECT_FLOAT_EQ(part.At(0, j), whole.At(0, j + 40));
    EXPECT_EQ(part.At(1, j), part.At(0, j));
  }
  // 1 + 0.02 cos(2 pi 2 j/512) + 0.01 sin(2 pi 7 j/512) at column 0.
  EXPECT_NEAR(whole.At(0, 300), 1.02, 1e-6);
}

}  // namespace
}  // namespace sightline
