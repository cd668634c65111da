// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/answer/departure_messages.h"

#include <gtest/gtest.h>

#include <vector>

namespace sightline {
namespace {

Departure Tested(double p_value) {
  return {.effect = "row_noise", .stage = "readout", .p_value = p_value, .material = true};
}

v1::SensorDiagnosis AnswerOf(const std::vector<Departure>& departures) {
  v1::SensorDiagnosis answer;
  AddDepartures(departures, &answer);
  return answer;
}

TEST(DepartureMessages, ProbabilityFallsWithThePValue) {
  for (const int tests : {1, 5, 30}) {
    double before = 1;
    for (const double p : {0.0, 1e-200, 1e-30, 1e-6, 1e-3, 0.05, 0.3}) {
      const v1::SensorDeparture found =
          AnswerOf(std::vector<Departure>(static_cast<size_t>(tests), Tested(p))).departures(0);
      ASSERT_TRUE(found.has_probability());
      EXPECT_GT(found.probability(), 0);
      EXPECT_LE(found.probability(), before) << p;
      before = found.probability();
      // A departure that is found is probable, too.
      if (found.found()) {
        EXPECT_GT(found.probability(), 0.9) << p;
      }
    }
  }
}

// A test that says nothing leaves the prior; all of them together have that of some departure.
TEST(DepartureMessages, PriorIsSharedOut) {
  const std::vector<Departure> departures(20, Tested(0.8));
  double sum = 0;
  const v1::SensorDiagnosis answer = AnswerOf(departures);
  for (const v1::SensorDeparture& departure : answer.departures()) {
    sum += departure.probability();
  }
  EXPECT_NEAR(sum, 0.7, 1e-12);
}

TEST(DepartureMessages, NoProbabilityWithoutATest) {
  Departure untested = Tested(1);
  untested.testable = false;
  const v1::SensorDiagnosis answer = AnswerOf({untested, Tested(1e-9)});
  ASSERT_EQ(answer.departures_size(), 2);
  EXPECT_TRUE(answer.departures(0).found());
  EXPECT_FALSE(answer.departures(1).has_probability());
}

}  // namespace
}  // namespace sightline
