// SPDX-License-Identifier: Apache-2.0
#include "report/page/number_text.h"

#include <gtest/gtest.h>

#include <limits>

namespace sightline {
namespace {

TEST(Number, RoundsToSignificantDigits) {
  EXPECT_EQ(Number(0), "0");
  EXPECT_EQ(Number(0.012345), "0.0123");
  EXPECT_EQ(Number(-3.14159), "\u22123.14");
  EXPECT_EQ(Number(9.999), "10.0");
  EXPECT_EQ(Number(123456), "123000");
  EXPECT_EQ(Number(1.25e-7, 3), "1.25\u00b710\u207b\u2077");
  EXPECT_EQ(Number(1e9), "10\u2079");
  EXPECT_EQ(Number(-1e9), "\u22121\u00b710\u2079");
  EXPECT_EQ(Number(std::numeric_limits<double>::quiet_NaN()), "\u2013");
  EXPECT_EQ(Number(-std::numeric_limits<double>::infinity()), "\u2212\u221e");
  EXPECT_EQ(ShortNumber(0.2), "0.2");
  EXPECT_EQ(ShortNumber(1000), "1000");
  EXPECT_EQ(FixedNumber(-0.04, 1), "0.0");
}

TEST(ProbabilityText, NeverSaysCertainOrImpossible) {
  EXPECT_EQ(ProbabilityText(0), "<\u202f0.1\u202f%");
  EXPECT_EQ(ProbabilityText(1), ">\u202f99.9\u202f%");
  EXPECT_EQ(ProbabilityText(0.5), "50\u202f%");
  EXPECT_EQ(ProbabilityText(0.973), "97.3\u202f%");
  EXPECT_EQ(PValueText(0.432), "p = 0.43");
  EXPECT_EQ(PValueText(0), "p < 10\u207b\u2076");
}

TEST(QuantityText, ShowsUnitsOfFittingSize) {
  EXPECT_EQ(QuantityText("halo_radius_m", 2.1e-4), "0.210\u202fmm");
  EXPECT_EQ(QuantityText("wavelength_shift_m", -1.2e-8), "\u221212.0\u202fnm");
  EXPECT_EQ(QuantityText("glare_fraction", 0.05), "5.00\u202f%");
  EXPECT_EQ(QuantityText("dark_current_electrons_per_s", 12.34), "12.3\u202fe\u207b/s");
  EXPECT_EQ(QuantityText("ambient_radiance_w_m2_sr", 0.0055), "5.50\u202fmW/(m\u00b2 sr)");
  EXPECT_EQ(QuantityText("plate_speed_m_s", 3e-5), "30.0\u202f\u00b5m/s");
  EXPECT_EQ(QuantityText("roll_deg", 0.25), "0.250\u00b0");
  EXPECT_EQ(QuantityText("f_number_factor", 1.071), "1.07");
  EXPECT_EQ(SettingText("exposure_time_s", 0.0051), "5.1\u202fms");
  EXPECT_EQ(SettingText("camera_distance_m", 0.366), "366\u202fmm");
}

TEST(QuantityWithError, RoundsToTwoDigitsOfTheError) {
  EXPECT_EQ(QuantityWithError("spread_m", 3.4012e-3, 4.4e-4), "3.40\u202f\u00b1\u202f0.44\u202fmm");
  EXPECT_EQ(QuantityWithError("glare_fraction", 0.051234, 0.0021),
            "5.12\u202f\u00b1\u202f0.21\u202f%");
  // The unit follows the larger of both.
  EXPECT_EQ(QuantityWithError("bow_m", 1e-7, 2e-3), "0.0\u202f\u00b1\u202f2.0\u202fmm");
  EXPECT_EQ(QuantityWithError("bow_m", 1e-3, std::nullopt), "1.00\u202fmm");
  EXPECT_EQ(QuantityWithError("variance_electrons2_per_s", 31.2, 4.1),
            "31.2\u202f\u00b1\u202f4.1\u202f(e\u207b)\u00b2/s");
  EXPECT_EQ(QuantityInterval("glare_fraction", 0.0471, 0.0553),
            "4.71\u202f\u2026\u202f5.53\u202f%");
}

TEST(EffectTitle, ReadsLikeWords) {
  EXPECT_EQ(EffectTitle("optics.veiling_glare"), "Veiling glare");
  EXPECT_EQ(EffectTitle("optics.f_number_error"), "f-number error");
  EXPECT_EQ(EffectTitle("sensor.prnu"), "PRNU");
  EXPECT_EQ(EffectTitle("none"), "Nothing left out");
  EXPECT_EQ(EffectTitle(""), "");
  EXPECT_EQ(QuantityName("dark_current_electrons_per_s"), "dark current");
  EXPECT_EQ(QuantityName("glare_fraction"), "glare fraction");
  EXPECT_EQ(QuantityName("exposure_time_s"), "exposure time");
}

}  // namespace
}  // namespace sightline
