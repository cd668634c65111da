// SPDX-License-Identifier: Apache-2.0
#include "render_worker/spectrum/spectrum.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "render_worker/spectrum/illuminants.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

constexpr double kPlanck = 6.62607015e-34, kLight = 299792458, kBoltzmann = 1.380649e-23;

Spectrum Source(const v1::SourceSpectrum& message) {
  absl::StatusOr<Spectrum> spectrum = ParseSourceSpectrum(message, "test");
  EXPECT_TRUE(spectrum.ok()) << spectrum.status();
  return spectrum.value_or(Spectrum{});
}

Spectrum Illuminant(const std::string& name) {
  v1::SourceSpectrum message;
  message.set_illuminant(name);
  return Source(message);
}

// CIE 1931 2-degree chromaticity by the analytic fit of Wyman, Sloan and Shirley (JCGT 2013), which
// holds to about 0.005.
struct Chromaticity {
  double x, y;
};
Chromaticity ChromaticityOf(const Spectrum& spectrum) {
  const auto lobe = [](double l, double mean, double below, double above) {
    const double t = (l - mean) / (l < mean ? below : above);
    return std::exp(-0.5 * t * t);
  };
  double X = 0, Y = 0, Z = 0;
  for (int i = 0; i < kSpectralBins; ++i) {
    const double l = BinCentre_m(i) * 1e9;
    X += spectrum[i] * (1.056 * lobe(l, 599.8, 37.9, 31.0) + 0.362 * lobe(l, 442.0, 16.0, 26.7) -
                        0.065 * lobe(l, 501.1, 20.4, 26.2));
    Y += spectrum[i] * (0.821 * lobe(l, 568.8, 46.9, 40.5) + 0.286 * lobe(l, 530.9, 16.3, 31.1));
    Z += spectrum[i] * (1.217 * lobe(l, 437.0, 11.8, 36.0) + 0.681 * lobe(l, 459.0, 26.0, 13.8));
  }
  return {X / (X + Y + Z), Y / (X + Y + Z)};
}

TEST(SourceSpectrum, AllSumToOne) {
  std::vector<v1::SourceSpectrum> messages(7);
  messages[1].set_illuminant("d65");
  messages[2].set_illuminant("led_4000k");
  messages[3].set_illuminant("fluorescent_f2");
  messages[4].set_blackbody_k(2856);
  messages[5].mutable_line()->set_wavelength_m(589e-9);
  auto* point = messages[6].mutable_table()->add_points();
  point->set_wavelength_m(400e-9);
  point->set_value(0);
  point = messages[6].mutable_table()->add_points();
  point->set_wavelength_m(900e-9);
  point->set_value(5);
  for (const v1::SourceSpectrum& message : messages) {
    double sum = 0;
    for (const float share : Source(message)) {
      EXPECT_GE(share, 0);
      sum += share;
    }
    EXPECT_NEAR(sum, 1, 47 * 0x1p-24);
  }
}

// Published chromaticities (CIE 015:2018); a wrong or exchanged number in the tables shows here.
TEST(SourceSpectrum, ChromaticityOfStandardIlluminants) {
  const Chromaticity d65 = ChromaticityOf(Illuminant("d65"));
  EXPECT_NEAR(d65.x, 0.3127, 0.006);
  EXPECT_NEAR(d65.y, 0.3290, 0.006);
  const Chromaticity f2 = ChromaticityOf(Illuminant("fluorescent_f2"));
  EXPECT_NEAR(f2.x, 0.3721, 0.006);
  EXPECT_NEAR(f2.y, 0.3751, 0.006);
  const Chromaticity led = ChromaticityOf(Illuminant("led_4000k"));
  EXPECT_NEAR(led.x, 0.3805, 0.006);
  EXPECT_NEAR(led.y, 0.3768, 0.006);
  v1::SourceSpectrum incandescent;
  incandescent.set_blackbody_k(2855.5);
  const Chromaticity a = ChromaticityOf(Source(incandescent));
  EXPECT_NEAR(a.x, 0.4476, 0.006);
  EXPECT_NEAR(a.y, 0.4074, 0.006);
}

TEST(Planck, StefanBoltzmannIntegralAndWien) {
  const double temperature = 5000;
  double sum = 0, largest = 0, largest_at = 0;
  const double step = 1e-9;
  for (double l = 50e-9; l < 400e-6; l += step) {
    const double radiance = PlanckRadiance(l, temperature);
    sum += radiance * step;
    if (radiance > largest) {
      largest = radiance;
      largest_at = l;
    }
  }
  const double sigma = 2 * std::pow(std::numbers::pi, 5) * std::pow(kBoltzmann, 4) /
                       (15 * std::pow(kPlanck, 3) * kLight * kLight);
  const double expected = sigma * std::pow(temperature, 4) / std::numbers::pi;
  // Beyond 400 um the Rayleigh-Jeans tail, 2 c k T/(3 l^3), is 1e-9 of the whole.
  EXPECT_NEAR(sum / expected, 1, 1e-6);
  EXPECT_NEAR(largest_at, 2.897771955e-3 / temperature, step);
}

// Cool radiators follow Wien's law, exp(-hc/(l k T))/l^5.
TEST(Planck, WienLimitOfTheBins) {
  v1::SourceSpectrum message;
  message.set_blackbody_k(1000);
  const Spectrum spectrum = Source(message);
  std::array<double, kSpectralBins> wien;
  double sum = 0;
  for (int i = 0; i < kSpectralBins; ++i) {
    wien[i] = 0;
    for (int j = 0; j < 100; ++j) {
      const double l = kSpectrumStart_m + (i + (j + 0.5) / 100) * kBinWidth_m;
      wien[i] += std::exp(-kPlanck * kLight / (l * kBoltzmann * 1000)) / std::pow(l, 5);
    }
    sum += wien[i];
  }
  for (int i = 0; i < kSpectralBins; ++i) {
    // Midpoint rule with 100 steps: relative error below (x/100)^2/24, x = d ln/d bin < 1.2.
    EXPECT_NEAR(spectrum[i] * sum / wien[i], 1, 2e-5) << i;
  }
}

TEST(SourceSpectrum, TableIsIntegratedExactlyAndZeroOutside) {
  v1::SourceSpectrum message;
  for (const auto& [nm, value] : {std::pair{405.0, 1.0}, {425.0, 3.0}}) {
    auto* point = message.mutable_table()->add_points();
    point->set_wavelength_m(nm * 1e-9);
    point->set_value(value);
  }
  const Spectrum spectrum = Source(message);
  // Trapezoids: 1 to 1.5 over 5 nm, 1.5 to 2.5 over 10 nm, 2.5 to 3 over 5 nm; total 40.
  EXPECT_NEAR(spectrum[4], 6.25 / 40, 1e-6);
  EXPECT_NEAR(spectrum[5], 20.0 / 40, 1e-6);
  EXPECT_NEAR(spectrum[6], 13.75 / 40, 1e-6);
  EXPECT_EQ(spectrum[3], 0);
  EXPECT_EQ(spectrum[7], 0);
}

TEST(SourceSpectrum, BadInputIsNamed) {
  const auto error = [](const v1::SourceSpectrum& message) {
    return std::string(
        ParseSourceSpectrum(message, "lighting.ambient.spectrum").status().message());
  };
  v1::SourceSpectrum message;
  message.set_blackbody_k(400);
  EXPECT_THAT(error(message),
              HasSubstr("lighting.ambient.spectrum.blackbody_k is 400, must be in [500, 50000]"));
  message.set_illuminant("d50");
  EXPECT_THAT(error(message), HasSubstr("\"d50\""));
  message.mutable_line()->set_wavelength_m(1064e-9);
  EXPECT_THAT(error(message), HasSubstr("line.wavelength_m"));
  auto* point = message.mutable_table()->add_points();
  point->set_wavelength_m(500e-9);
  EXPECT_THAT(error(message), HasSubstr("has 1 points"));
  point = message.mutable_table()->add_points();
  point->set_wavelength_m(400e-9);
  EXPECT_THAT(error(message), HasSubstr("points[1].wavelength_m"));
}

TEST(QuantumEfficiency, ConstantCurveCountsPhotons) {
  QuantumEfficiencyCurve curve;
  curve.wavelength_m = {661e-9};
  curve.quantum_efficiency = {0.5};
  const Spectrum electrons = ElectronsPerJoule(curve);
  for (int i = 0; i < kSpectralBins; ++i) {
    // The mean of lambda over a bin is its centre.
    EXPECT_NEAR(electrons[i] / (0.5 * BinCentre_m(i) / (kPlanck * kLight)), 1, 1e-6);
  }
  const Spectrum flat = Illuminant("equal_energy");
  // Mean wavelength of an equal-energy source is 595 nm.
  EXPECT_NEAR(Integrate(flat, electrons) / (0.5 * 595e-9 / (kPlanck * kLight)), 1, 1e-6);
}

TEST(QuantumEfficiency, BendInsideABin) {
  QuantumEfficiencyCurve curve;
  curve.wavelength_m = {500e-9, 505e-9, 510e-9};
  curve.quantum_efficiency = {0, 1, 0};
  // Integral of a triangle times lambda: mean 1/2 at 505 nm. Midpoint rule with 20 steps of a
  // piecewise quadratic: error below 1e-3 of it.
  EXPECT_NEAR(ElectronsPerJoule(curve)[14] / (0.5 * 505e-9 / (kPlanck * kLight)), 1, 1e-3);
}

TEST(Reflectance, EmptyIsOneAndTableIsConstantBeyondItsEnds) {
  google::protobuf::RepeatedPtrField<v1::SpectrumPoint> points;
  const Spectrum ones = *ParseReflectanceSpectrum(points, "test");
  for (const float value : ones) EXPECT_EQ(value, 1);
  v1::SpectrumPoint* point = points.Add();
  point->set_wavelength_m(500e-9);
  point->set_value(0.2);
  point = points.Add();
  point->set_wavelength_m(600e-9);
  point->set_value(0.6);
  const Spectrum spectrum = *ParseReflectanceSpectrum(points, "test");
  EXPECT_NEAR(spectrum[0], 0.2, 1e-6);
  EXPECT_NEAR(spectrum[19], 0.2 + 0.4 * 0.55, 1e-6);
  EXPECT_NEAR(spectrum[46], 0.6, 1e-6);
}

}  // namespace
}  // namespace sightline
