// SPDX-License-Identifier: Apache-2.0
#include "render_worker/sensor_diagnosis/diagnose_sensor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using testing::HasSubstr;
using testing::UnorderedElementsAre;

constexpr int kColumns_px = 160, kRows_px = 128, kBits = 12;
constexpr double kGain = 0.25, kEfficiency = 0.5, kDarkNoise_e = 8, kBlack_dn = 40;
constexpr double kDarkCurrent_e_s = 2000;

// A simulated camera for the tests: the linear model with departures of known size.
struct TestCamera {
  double quadratic = 0;         // response, relative at 16 000 electrons
  double time_offset_s = 0;     // of the exposure
  double row_noise_dn = 0;      // of whole rows, per frame
  double column_offset_dn = 0;  // every fourth column
  double carried_over = 0;      // part of the frame before
  double light_drift = 0;       // relative, over the long series
  int hot_pixels = 0;
  bool drop_lowest_bit = false;
};

class TestSet {
 public:
  explicit TestSet(const TestCamera& camera, bool with_series = true) : camera_(camera) {
    set_.set_name("test");
    set_.set_bit_depth_bit(kBits);
    set_.set_columns_px(kColumns_px);
    set_.set_rows_px(kRows_px);
    for (int i = 0; i < 30; ++i) {
      const double time_s = 1e-4 + 4.8e-4 * i;
      AddStep(false, time_s, 2);
      AddStep(true, time_s, 2);
    }
    if (with_series) {
      AddStep(false, 5e-3, 16);
      AddStep(true, 5e-3, 16);
    }
  }

  v1::SensorSet& set() { return set_; }

  absl::StatusOr<v1::SensorDiagnosis> Diagnose() {
    SensorDiagnosisHooks hooks;
    hooks.read_image = [this](const std::string& file) { return Frame(file); };
    return DiagnoseSensor(set_, hooks);
  }

 private:
  static constexpr double kPhotonRate = 3e6;  // per second and pixel

  void AddStep(bool dark, double time_s, int frames) {
    v1::FlatFieldStep* step = set_.add_steps();
    step->set_dark(dark);
    step->set_exposure_time_s(time_s);
    if (!dark) step->set_photons(kPhotonRate * time_s);
    for (int i = 0; i < frames; ++i) {
      step->add_files(absl::StrCat(set_.steps_size() - 1, "/", i, "/", frames));
    }
    taken_.push_back(*step);
  }

  // Frames are asked for in the order of the files.
  absl::StatusOr<Image<uint16_t>> Frame(const std::string& file) {
    const int step_index = std::stoi(file);
    const v1::FlatFieldStep& step = taken_[step_index];
    const size_t first = file.find('/') + 1;
    const int frame = std::stoi(file.substr(first));
    std::mt19937_64 random(1000 * step_index + frame);
    double light =
        step.dark() ? 0
                    : kEfficiency * kPhotonRate * (step.exposure_time_s() + camera_.time_offset_s);
    if (step.files_size() > 2) light *= 1 + camera_.light_drift * frame / step.files_size();
    const double dark = kDarkCurrent_e_s * step.exposure_time_s();
    std::poisson_distribution<int> charge(light + dark);
    std::normal_distribution<double> normal;
    if (frame == 0) held_.assign(kColumns_px * kRows_px, light + dark);
    Image<uint16_t> image(kColumns_px, kRows_px);
    for (int row = 0; row < kRows_px; ++row) {
      const double row_dn = camera_.row_noise_dn * normal(random);
      for (int column = 0; column < kColumns_px; ++column) {
        const size_t i = static_cast<size_t>(row) * kColumns_px + column;
        const double collected = charge(random);
        double electrons = (1 - camera_.carried_over) * collected + camera_.carried_over * held_[i];
        held_[i] = collected;
        electrons *= 1 + camera_.quadratic * electrons / 16000;
        electrons = std::min(electrons, 16000.0) + kDarkNoise_e * normal(random);
        double dn = kGain * electrons + kBlack_dn + row_dn;
        if (column % 4 == 1) dn += camera_.column_offset_dn;
        if (static_cast<int>(i) % 1009 == 7 && static_cast<int>(i) / 1009 < camera_.hot_pixels) {
          dn += 60;
        }
        int value = static_cast<int>(std::lround(std::clamp(dn, 0.0, 4095.0)));
        if (camera_.drop_lowest_bit) value &= ~1;
        image.values[i] = static_cast<uint16_t>(value);
      }
    }
    return image;
  }

  const TestCamera camera_;
  v1::SensorSet set_;
  std::vector<v1::FlatFieldStep> taken_;  // all steps, also those that a test removes from the set
  std::vector<double> held_;
};

v1::SensorDiagnosis DiagnosisOf(const TestCamera& camera) {
  auto diagnosis = TestSet(camera).Diagnose();
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *std::move(diagnosis) : v1::SensorDiagnosis();
}

std::vector<std::string> Found(const v1::SensorDiagnosis& diagnosis) {
  std::vector<std::string> found;
  for (const v1::SensorDeparture& departure : diagnosis.departures()) {
    if (departure.found()) found.push_back(departure.effect());
  }
  return found;
}

const v1::SensorDeparture& DepartureNamed(const v1::SensorDiagnosis& diagnosis,
                                          const std::string& effect) {
  for (const v1::SensorDeparture& departure : diagnosis.departures()) {
    if (departure.effect() == effect) return departure;
  }
  ADD_FAILURE() << effect;
  return v1::SensorDeparture::default_instance();
}

void ExpectParameter(const v1::SensorDeparture& departure, double truth) {
  const v1::SensorParameter& parameter = departure.parameters(0);
  EXPECT_NEAR(parameter.value(), truth, 4 * parameter.standard_error()) << departure.effect();
  EXPECT_LT(parameter.standard_error(), 0.2 * std::abs(truth)) << departure.effect();
}

TEST(DiagnoseSensor, LinearCameraIsMeasuredAndNothingIsFound) {
  const v1::SensorDiagnosis diagnosis = DiagnosisOf({});
  EXPECT_EQ(diagnosis.verdict(), "none");
  EXPECT_THAT(Found(diagnosis), testing::IsEmpty());
  const std::vector<std::pair<std::string, double>> truths = {
      {"gain_dn_per_electron", kGain},
      {"quantum_efficiency", kEfficiency},
      {"dark_noise_electrons", kDarkNoise_e},
      {"black_level_dn", kBlack_dn},
      {"dark_current_electrons_per_s", kDarkCurrent_e_s}};
  for (const auto& [name, truth] : truths) {
    bool seen = false;
    for (const v1::SensorQuantity& quantity : diagnosis.quantities()) {
      if (quantity.name() != name) continue;
      seen = true;
      // Twice the 95 % interval: nearly four standard errors.
      const double half = quantity.upper() - quantity.lower();
      EXPECT_NEAR(quantity.value(), truth, half) << name;
      EXPECT_LT(half, 0.1 * truth) << name;
    }
    EXPECT_TRUE(seen) << name;
  }
  // Saturation is the last step of the series before the variance falls: known to one step.
  const double step_electrons = 4.8e-4 * (kEfficiency * 3e6 + kDarkCurrent_e_s);
  EXPECT_NEAR(diagnosis.camera().saturation_capacity_electrons(), 16000, 1.1 * step_electrons);
}

TEST(DiagnoseSensor, ResponseAndExposureTimeAreToldApart) {
  const v1::SensorDiagnosis bent = DiagnosisOf({.quadratic = -0.03});
  EXPECT_THAT(Found(bent), UnorderedElementsAre("sensor.response_nonlinearity"));
  const v1::SensorDiagnosis late = DiagnosisOf({.time_offset_s = 20e-6});
  EXPECT_THAT(Found(late), UnorderedElementsAre("time.exposure_time_offset"));
  ExpectParameter(DepartureNamed(late, "time.exposure_time_offset"), 20e-6);
  for (const v1::SensorDiagnosis* diagnosis : {&bent, &late}) {
    EXPECT_LT(diagnosis->model_fit().held_out_chi_squared(),
              1.5 * diagnosis->model_fit().held_out_numbers());
    EXPECT_GT(diagnosis->model_fit().held_out_log_score_gain(), 3);
  }
}

TEST(DiagnoseSensor, ReadoutPatternsAreFoundByTheirNames) {
  const v1::SensorDiagnosis rows = DiagnosisOf({.row_noise_dn = 0.8});
  EXPECT_THAT(Found(rows), testing::Contains("sensor.row_noise"));
  ExpectParameter(DepartureNamed(rows, "sensor.row_noise"), 0.8);
  const v1::SensorDiagnosis columns = DiagnosisOf({.column_offset_dn = 1});
  EXPECT_THAT(Found(columns),
              testing::IsSupersetOf({"sensor.dsnu_column_pattern", "dark_column_period"}));
  EXPECT_NEAR(DepartureNamed(columns, "dark_column_period").parameters(0).value(), 4, 0.1);
  const v1::SensorDiagnosis hot = DiagnosisOf({.hot_pixels = 12});
  EXPECT_THAT(Found(hot), UnorderedElementsAre("sensor.hot_pixels"));
  EXPECT_EQ(DepartureNamed(hot, "sensor.hot_pixels").parameters(0).value(), 12);
  const v1::SensorDiagnosis bits = DiagnosisOf({.drop_lowest_bit = true});
  EXPECT_THAT(Found(bits), testing::Contains("sensor.adc_missing_bits"));
}

TEST(DiagnoseSensor, CarriedOverSignalAndDriftAreFoundByTheirNames) {
  const v1::SensorDiagnosis averaged = DiagnosisOf({.carried_over = 0.05});
  EXPECT_THAT(Found(averaged), testing::Contains("frame_correlation"));
  const v1::SensorDiagnosis drift = DiagnosisOf({.light_drift = 0.02});
  EXPECT_THAT(Found(drift), testing::Contains("light_drift"));
  EXPECT_NEAR(DepartureNamed(drift, "light_drift").parameters(0).value(), 0.02, 0.003);
}

TEST(DiagnoseSensor, SaysWhatASetCannotShow) {
  TestSet pairs({}, /*with_series=*/false);
  const auto diagnosis = pairs.Diagnose();
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  EXPECT_FALSE(DepartureNamed(*diagnosis, "frame_correlation").testable());
  EXPECT_FALSE(DepartureNamed(*diagnosis, "dark_pattern").testable());
  EXPECT_FALSE(DepartureNamed(*diagnosis, "reciprocity_failure").testable());
  TestSet dark({});
  auto* steps = dark.set().mutable_steps();
  steps->erase(std::remove_if(steps->begin(), steps->end(),
                              [](const v1::FlatFieldStep& step) { return !step.dark(); }),
               steps->end());
  const auto only_dark = dark.Diagnose();
  ASSERT_TRUE(only_dark.ok()) << only_dark.status();
  EXPECT_THAT(only_dark->warnings(), testing::Contains(HasSubstr("gain and what follows")));
}

TEST(DiagnoseSensor, ErrorsNameTheImage) {
  TestSet wide({});
  wide.set().set_columns_px(kColumns_px + 1);
  EXPECT_THAT(std::string(wide.Diagnose().status().message()), HasSubstr("0/0/2: has 160 x 128"));
  TestSet shallow({});
  shallow.set().set_bit_depth_bit(5);
  EXPECT_THAT(std::string(shallow.Diagnose().status().message()), HasSubstr("cannot hold"));
}

TEST(DiagnoseSensor, CancelledBetweenImages) {
  TestSet set({});
  std::atomic<bool> cancelled = true;
  SensorDiagnosisHooks hooks;
  hooks.read_image = [](const std::string&) { return Image<uint16_t>(); };
  hooks.cancelled = &cancelled;
  EXPECT_TRUE(absl::IsCancelled(DiagnoseSensor(set.set(), hooks).status()));
}

}  // namespace
}  // namespace sightline
