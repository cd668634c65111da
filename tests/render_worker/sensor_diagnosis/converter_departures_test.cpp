// SPDX-License-Identifier: Apache-2.0
// Converters of simulated cameras: unequal widths of codes are found, and clipping at any level is
// not mistaken for them.
#include "render_worker/sensor_diagnosis/converter/converter_departures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/recordings/raw_numbers.h"
#include "render_worker/sensor_diagnosis/departure_names.h"

namespace sightline {
namespace {

struct Converter {
  int bits = 12;
  int clip_dn = 0;         // largest number; 0: 2^bits - 1
  int second_clip_dn = 0;  // of every fourth pixel; 0: the same
  double dark_noise_dn = 2;
  double brightest = 1.1;  // mean of the brightest step over 2^bits
  double black_level_dn = 40;
  double odd_minus_even = 0;  // widths of codes [DN]
  int pixels = 20'000;        // of each step
};

// Numbers of a light sweep of 40 steps with photon noise, converted with codes of unequal width.
Histogram CountsOf(const Converter& converter, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Histogram counts(65536, 0);
  const int codes = 1 << converter.bits;
  constexpr int kSteps = 40;
  for (int step = 0; step < kSteps; ++step) {
    const double signal = converter.brightest * codes * step / (kSteps - 1);
    const double deviation = std::hypot(converter.dark_noise_dn, std::sqrt(0.25 * signal));
    for (int i = 0; i < converter.pixels; ++i) {
      const double dn = converter.black_level_dn + signal + deviation * normal(random);
      // Pairs of an even and an odd code keep their common width of two.
      const double pair = std::floor(dn / 2);
      const bool odd = dn - 2 * pair >= 1 - converter.odd_minus_even / 2;
      int value = static_cast<int>(2 * pair) + (odd ? 1 : 0);
      const int clip = i % 4 == 0 && converter.second_clip_dn > 0 ? converter.second_clip_dn
                       : converter.clip_dn > 0                    ? converter.clip_dn
                                                                  : codes - 1;
      value = std::clamp(value, 0, std::min(clip, codes - 1));
      ++counts[value];
    }
  }
  return counts;
}

Departure OddEven(const Converter& converter, unsigned seed) {
  for (const Departure& departure :
       ConverterDepartures(CountsOf(converter, seed), converter.bits, 0)) {
    if (departure.effect == NamesInVocabulary().odd_even_width) return departure;
  }
  ADD_FAILURE() << "no such departure";
  return {};
}

TEST(ConverterDepartures, ClippingAtAnyLevelIsNoNonlinearity) {
  unsigned seed = 1;
  for (const int bits : {8, 10, 12}) {
    const int largest = (1 << bits) - 1;
    for (const double level : {1.0, 0.98, 0.93, 0.8, 0.6}) {
      for (const double brightest : {0.5, 0.95, 1.1, 2.0}) {
        for (const int odd : {0, 1}) {
          const Converter converter{.bits = bits,
                                    .clip_dn = static_cast<int>(largest * level) / 2 * 2 + odd,
                                    .brightest = brightest,
                                    .black_level_dn = bits == 8 ? 6.0 : 40.0};
          const Departure departure = OddEven(converter, ++seed);
          EXPECT_FALSE(departure.material && departure.p_value < 1e-3)
              << converter.clip_dn << " of " << bits << " bits, " << brightest << ": "
              << departure.p_value << " " << departure.description;
          // 120 cameras: the smallest p of all is rarely below a tenth of 1/120.
          EXPECT_GT(departure.p_value, 1e-5) << converter.clip_dn << " " << departure.description;
        }
      }
    }
  }
}

TEST(ConverterDepartures, SeveralClipLevelsAndNarrowPeaksAreNoNonlinearity) {
  unsigned seed = 500;
  for (const Converter& converter : {Converter{.clip_dn = 3900, .second_clip_dn = 3893},
                                     Converter{.clip_dn = 3900, .second_clip_dn = 3899},
                                     Converter{.clip_dn = 3000, .second_clip_dn = 2500},
                                     Converter{.dark_noise_dn = 0.4, .black_level_dn = 40.3},
                                     Converter{.dark_noise_dn = 0.8, .black_level_dn = 0}}) {
    const Departure departure = OddEven(converter, ++seed);
    ASSERT_TRUE(departure.testable);
    EXPECT_GT(departure.p_value, 1e-3) << departure.description;
  }
}

TEST(ConverterDepartures, ARealNonlinearityIsFound) {
  unsigned seed = 900;
  for (const int clip : {0, 3900, 3001, 2000}) {
    for (const double width : {0.06, -0.1, 0.3}) {
      const Departure departure = OddEven({.clip_dn = clip, .odd_minus_even = width}, ++seed);
      ASSERT_TRUE(departure.testable);
      EXPECT_LT(departure.p_value, 1e-6) << clip << " " << width;
      EXPECT_TRUE(departure.material);
      EXPECT_NEAR(departure.parameters[0].value, width, 4 * departure.parameters[0].standard_error);
      EXPECT_LT(departure.parameters[0].standard_error, 0.01);
    }
  }
}

TEST(ConverterDepartures, TheTestHasItsSize) {
  constexpr int kCameras = 200;
  int below_5_percent = 0;
  for (int i = 0; i < kCameras; ++i) {
    const Departure departure =
        OddEven({.bits = 10, .clip_dn = i % 2 == 0 ? 0 : 900 + i % 50, .pixels = 6000}, 2000U + i);
    ASSERT_TRUE(departure.testable);
    below_5_percent += departure.p_value < 0.05;
  }
  // 10 of 200 by chance; 24 is four standard deviations and a half above.
  EXPECT_LE(below_5_percent, 24);
}

TEST(ConverterDepartures, FewCodesAreNotTestable) {
  Histogram counts(65536, 0);
  for (int value = 100; value < 120; ++value) counts[value] = 5000;
  for (const Departure& departure : ConverterDepartures(counts, 12, 0)) {
    if (departure.effect == NamesInVocabulary().odd_even_width) {
      EXPECT_FALSE(departure.testable);
    }
  }
}

TEST(ClipLevel, IsFoundFromThePileUp) {
  for (const int clip : {3900, 3001, 2000}) {
    EXPECT_EQ(ClipLevel(CountsOf({.clip_dn = clip}, static_cast<unsigned>(clip))), clip);
    EXPECT_EQ(UpperLimit(CountsOf({.clip_dn = clip}, static_cast<unsigned>(clip)), 4095), clip);
  }
  // Little piles up: the brightest step's mean is two standard deviations below.
  EXPECT_EQ(ClipLevel(CountsOf({.clip_dn = 3880, .brightest = 0.9222, .black_level_dn = 40}, 3)),
            3880);
}

TEST(ClipLevel, UnclippedCamerasRarelyHaveOne) {
  int found = 0;
  constexpr int kCameras = 300;
  for (int i = 0; i < kCameras; ++i) {
    found += ClipLevel(CountsOf({.brightest = 0.7, .pixels = 500}, 5000U + i)).has_value();
  }
  // The level of the test is 0.1 %.
  EXPECT_LE(found, 3);
  EXPECT_EQ(ClipLevel(Histogram(65536, 0)), std::nullopt);
}

}  // namespace
}  // namespace sightline
