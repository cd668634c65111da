// SPDX-License-Identifier: Apache-2.0
// Recordings of a groove by the renderer, with light that the model lacks, and without.
#include "render_worker/scene_diagnosis/diagnose_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "render_worker/scene_diagnosis/light_paths.h"
#include "tests/render_worker/scene_diagnosis/groove_scene.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;
using ::testing::UnorderedElementsAreArray;

// Properties of every answer: probabilities, terms of the evidence, and when unknown light leads.
void ExpectRules(const v1::Diagnosis& diagnosis) {
  double sum = 0;
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    sum += explanation.probability();
    EXPECT_LE(explanation.probability(), diagnosis.ranked(0).probability());
    const v1::Evidence& terms = explanation.evidence();
    EXPECT_NEAR(terms.fit_nats() + terms.covariance_nats() + terms.curvature_nats() +
                    terms.parameter_prior_nats(),
                explanation.log_evidence_gain(),
                1e-9 * (1 + std::abs(terms.fit_nats()) + std::abs(terms.covariance_nats())))
        << explanation.effect();
    if (explanation.effect() == "none") {
      EXPECT_EQ(terms.model_prior_nats(), 0);
    }
    // A tenth of what is not "none", for any number of known paths.
    if (explanation.effect() == "unknown") {
      EXPECT_NEAR(terms.model_prior_nats(), std::log(0.07 / 0.3), 1e-9);
    }
  }
  EXPECT_NEAR(sum, 1, 1e-9);
  if (diagnosis.ranked(0).effect() == "unknown") {
    EXPECT_FALSE(diagnosis.has_remainder());
  }
  EXPECT_GE(diagnosis.remainder().share(), 0);
  EXPECT_LE(diagnosis.remainder().share(), 1);
}

v1::Diagnosis Diagnosed(const RecordedScene& scene, int threads = 2) {
  SceneDiagnosisSettings settings;
  settings.threads = threads;
  auto diagnosis = DiagnoseScene(scene, settings, nullptr);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  if (!diagnosis.ok()) return {};
  ExpectRules(*diagnosis);
  return *diagnosis;
}

TEST(DiagnoseScene, FindsInterreflection) {
  RecordedScene scene = GrooveScene();
  Inspection truth = scene.inspection;
  truth.render.laser_interreflection = true;
  ASSERT_NO_FATAL_FAILURE(Record(&scene, truth, {}, 11));
  const v1::Diagnosis diagnosis = Diagnosed(scene);
  EXPECT_EQ(diagnosis.verdict(), "effect");
  const v1::Explanation& best = diagnosis.ranked(0);
  EXPECT_EQ(best.effect(), "illumination.interreflection") << diagnosis.finding();
  ASSERT_EQ(best.effects_size(), 1);
  EXPECT_GT(best.probability(), 0.95);
  // The model knows the materials: its own light, within four standard errors.
  const v1::FittedParameter& factor = best.effects(0).parameters(0);
  EXPECT_NEAR(factor.value(), 1, 4 * factor.standard_error() + 0.05);
  // Held-out blocks: chi squared of n has a standard deviation of sqrt(2 n); speckle's tails and
  // correlation across blocks make it up to twice that.
  const double n = diagnosis.model_fit().degrees_of_freedom();
  EXPECT_NEAR(diagnosis.held_out_improvement().with_effect(), 1, 4 * 2 * std::sqrt(2 / n));
  EXPECT_GT(diagnosis.held_out_improvement().null(), 2);
  EXPECT_THAT(diagnosis.finding(), HasSubstr("paint"));
  EXPECT_THAT(best.effects(0).regions(), Contains(HasSubstr("surface \"paint\"")));
  EXPECT_THAT(best.effects(0).regions(), Contains(HasSubstr("mm of the part")));
  // The description as fitted; power is known to some per cent from these images.
  ASSERT_EQ(diagnosis.calibrated_effects_size(), 1);
  EXPECT_EQ(diagnosis.calibrated_effects(0).effect(), "illumination.interreflection");
  ASSERT_GT(diagnosis.inspection_changes_size(), 0);
  EXPECT_EQ(diagnosis.inspection_changes(0).field(), "render.laser_interreflection");
  EXPECT_EQ(diagnosis.calibrated().format_version(), 2);
  EXPECT_EQ(diagnosis.calibrated().recordings_size(), 2);
  double laser_factor = 1;
  for (const v1::FittedDeviation& d : diagnosis.model_fit().deviations()) {
    if (d.name() == "laser_factor") laser_factor += d.value();
  }
  EXPECT_NEAR(diagnosis.calibrated().laser().power_w(),
              scene.recordings.laser.power_w * laser_factor, 1e-12);
}

// The answer has no excluded effects, and no pairs if one effect at most is asked for.
TEST(DiagnoseScene, ExcludedEffects) {
  RecordedScene scene = GrooveScene();
  scene.recordings.recordings.pop_back();
  Inspection truth = scene.inspection;
  truth.render.laser_interreflection = true;
  ASSERT_NO_FATAL_FAILURE(Record(&scene, truth, {}, 9));
  SceneDiagnosisSettings settings;
  settings.excluded_effects = {"illumination.interreflection", "optics.veiling_glare"};
  settings.max_effects = 1;
  auto diagnosis = DiagnoseScene(scene, settings, nullptr);
  ASSERT_TRUE(diagnosis.ok()) << diagnosis.status();
  std::set<std::string> seen;
  for (const v1::Explanation& explanation : diagnosis->ranked()) {
    EXPECT_LE(explanation.effects_size(), 1);
    seen.insert(explanation.effect());
  }
  EXPECT_THAT(seen, ElementsAre("illumination.ambient_light", "illumination.laser_stray_light",
                                "none", "sensor.black_level_error", "unknown"));
  settings.max_effects = 3;
  EXPECT_THAT(DiagnoseScene(scene, settings, nullptr).status().message(),
              HasSubstr("max_effects: is 3, must be 1 or 2"));
}

// Every id that is listed is traced, and every path that is traced is listed.
TEST(LightPaths, LeftOutEffectsAreThoseThatAreTraced) {
  RecordedScene scene = GrooveScene(R"(, "lighting": {"ambient": {"radiance_w_m2_sr": 0.01}})");
  scene.inspection.render.max_bounces = 0;
  scene.recordings.recordings.resize(1);
  scene.recordings.recordings[0].kind = RecordingKind::kDark;
  const auto light = TraceLightPaths(scene, {});
  ASSERT_TRUE(light.ok()) << light.status();
  std::set<std::string> traced;
  for (const LightPath& path : light->paths) {
    if (!path.nominal) traced.insert(path.effect);
  }
  EXPECT_THAT(traced, UnorderedElementsAreArray(LeftOutEffects()));
}

TEST(DiagnoseScene, NothingIsMissing) {
  for (const int seed : {1, 2}) {
    RecordedScene scene = GrooveScene();
    scene.recordings.recordings.pop_back();
    ASSERT_NO_FATAL_FAILURE(Record(&scene, scene.inspection, {}, seed));
    const v1::Diagnosis diagnosis = Diagnosed(scene);
    EXPECT_EQ(diagnosis.verdict(), "none") << diagnosis.finding();
  }
}

// With interreflection in the null model its images are explained by that.
TEST(DiagnoseScene, InterreflectionInTheModel) {
  RecordedScene scene = GrooveScene();
  scene.recordings.recordings.pop_back();
  scene.inspection.render.laser_interreflection = true;
  ASSERT_NO_FATAL_FAILURE(Record(&scene, scene.inspection, {}, 5));
  EXPECT_EQ(Diagnosed(scene).verdict(), "none");
}

TEST(DiagnoseScene, VeilingGlareIsNotInterreflection) {
  RecordedScene scene = GrooveScene();
  scene.recordings.recordings.pop_back();
  auto glare =
      MakeActiveEffect("optics.veiling_glare", {{"glare_fraction", 0.05}, {"halo_radius_m", 2e-4}});
  ASSERT_TRUE(glare.ok());
  ASSERT_NO_FATAL_FAILURE(Record(&scene, scene.inspection, {*glare}, 6));
  const v1::Diagnosis diagnosis = Diagnosed(scene);
  const v1::Explanation& best = diagnosis.ranked(0);
  EXPECT_EQ(best.effect(), "optics.veiling_glare") << diagnosis.finding();
  ASSERT_FALSE(best.effects().empty());
  const v1::FittedParameter& fraction = best.effects(0).parameters(0);
  EXPECT_NEAR(fraction.value(), 0.05, 4 * fraction.standard_error() + 0.005);
}

TEST(DiagnoseScene, SurroundingLight) {
  RecordedScene scene = GrooveScene();
  scene.recordings.recordings.pop_back();
  Inspection truth = scene.inspection;
  truth.lighting.mutable_ambient()->set_radiance_w_m2_sr(0.5);
  truth.lighting.mutable_ambient()->mutable_spectrum()->set_illuminant("d65");
  ASSERT_NO_FATAL_FAILURE(Record(&scene, truth, {}, 7));
  const v1::Diagnosis diagnosis = Diagnosed(scene);
  EXPECT_EQ(diagnosis.ranked(0).effect(), "illumination.ambient_light") << diagnosis.finding();
}

TEST(DiagnoseScene, SameBytesForAnyNumberOfThreads) {
  RecordedScene scene = GrooveScene();
  Inspection truth = scene.inspection;
  truth.render.laser_interreflection = true;
  scene.recordings.recordings.pop_back();
  ASSERT_NO_FATAL_FAILURE(Record(&scene, truth, {}, 8));
  EXPECT_EQ(Diagnosed(scene, 1).SerializeAsString(), Diagnosed(scene, 3).SerializeAsString());
}

// Cancelled as soon as `progress` says so.
absl::StatusOr<v1::Diagnosis> Interrupted(
    const RecordedScene& scene, const std::function<bool(double, std::string_view)>& interrupt) {
  std::atomic<bool> cancelled = false;
  SceneDiagnosisSettings settings;
  settings.cancelled = &cancelled;
  return DiagnoseScene(scene, settings, [&](double fraction, std::string_view what) {
    if (interrupt(fraction, what)) cancelled = true;
  });
}

TEST(DiagnoseScene, KeepsWhatWasComparedWhenInterrupted) {
  RecordedScene scene = GrooveScene();
  scene.recordings.recordings.pop_back();
  Inspection truth = scene.inspection;
  truth.render.laser_interreflection = true;
  ASSERT_NO_FATAL_FAILURE(Record(&scene, truth, {}, 8));
  // Interreflection, the second in the alphabet, has been compared by then.
  const auto half = Interrupted(scene, [](double, std::string_view what) {
    return what == "illumination.laser_stray_light";
  });
  ASSERT_TRUE(half.ok()) << half.status();
  EXPECT_EQ(half->verdict(), "interrupted");
  EXPECT_THAT(half->finding(),
              AllOf(HasSubstr("1 of 1 recordings"), HasSubstr("2 explanations"),
                    HasSubstr("so far illumination.interreflection"), HasSubstr("no finding")));
  std::vector<std::string> compared;
  for (const v1::Explanation& explanation : half->ranked()) {
    compared.push_back(explanation.effect());
  }
  EXPECT_EQ(compared.front(), "illumination.interreflection");
  EXPECT_THAT(compared, UnorderedElementsAre("illumination.interreflection", "none",
                                             "illumination.ambient_light"));
  // The same numbers as if it had not been interrupted.
  const v1::Diagnosis whole = Diagnosed(scene);
  ASSERT_EQ(whole.ranked(0).effect(), "illumination.interreflection");
  EXPECT_EQ(half->ranked(0).log_evidence_gain(), whole.ranked(0).log_evidence_gain());
  EXPECT_EQ(half->null_fit().SerializeAsString(), whole.null_fit().SerializeAsString());
  EXPECT_FALSE(half->has_calibrated());
  EXPECT_EQ(half->calibrated_effects_size(), 0);
  // The null model alone has been fitted: its residuals are known.
  const auto none =
      Interrupted(scene, [](double, std::string_view what) { return what == "null model"; });
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_EQ(none->ranked_size(), 1);
  EXPECT_EQ(none->null_fit().SerializeAsString(), whole.null_fit().SerializeAsString());
}

TEST(DiagnoseScene, ComparesTheRecordingsThatWereTracedWhenInterrupted) {
  RecordedScene scene = GrooveScene();
  Inspection truth = scene.inspection;
  truth.render.laser_interreflection = true;
  ASSERT_NO_FATAL_FAILURE(Record(&scene, truth, {}, 8));
  // Both recordings take the same number of images, a few of which are left out.
  double traced = 0;
  const auto half = Interrupted(scene, [&traced](double fraction, std::string_view what) {
    if (what == "expected images by light path") traced = fraction;
    return fraction > 0.5 * 0.75;
  });
  ASSERT_TRUE(half.ok()) << half.status();
  EXPECT_LT(traced, 0.7);
  EXPECT_EQ(half->verdict(), "interrupted");
  EXPECT_THAT(half->finding(), HasSubstr("1 of 2 recordings"));
  EXPECT_EQ(half->region_maps_size(), 1);
  // The same as for the first recording alone.
  scene.recordings.recordings.pop_back();
  scene.raw_dn.pop_back();
  const v1::Diagnosis first = Diagnosed(scene);
  EXPECT_EQ(half->null_fit().SerializeAsString(), first.null_fit().SerializeAsString());
  EXPECT_EQ(half->ranked(0).effect(), "illumination.interreflection");
  const auto nothing = Interrupted(scene, [](double, std::string_view) { return true; });
  EXPECT_EQ(nothing.status().code(), absl::StatusCode::kCancelled) << nothing.status();
}

TEST(DiagnoseScene, SaysWhatIsWrong) {
  RecordedScene scene = GrooveScene();
  auto none = DiagnoseScene(scene, {}, nullptr);
  EXPECT_EQ(none.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(none.status().message(), HasSubstr("one for each of the 2 recordings"));
  scene.raw_dn.assign(2, Image<uint16_t>(128, 90));
  auto size = DiagnoseScene(scene, {}, nullptr);
  EXPECT_THAT(size.status().message(), HasSubstr("128 x 90 px, must be 128 x 96"));
  scene.raw_dn.assign(2, Image<uint16_t>(128, 96, 5000));
  auto large = DiagnoseScene(scene, {}, nullptr);
  EXPECT_THAT(large.status().message(), HasSubstr("5000"));
  scene.raw_dn.assign(2, Image<uint16_t>(128, 96));
  scene.recordings.recordings[1].measurement.camera_distance_m = 0.0161;
  auto near = DiagnoseScene(scene, {}, nullptr);
  EXPECT_THAT(near.status().message(), HasSubstr("001.png: is focused at 0.0161 m"));
  for (RecordedImage& image : scene.recordings.recordings) {
    image.measurement.camera_distance_m = 0.3;
  }
  for (RecordedImage& image : scene.recordings.recordings) image.kind = RecordingKind::kDark;
  auto dark = DiagnoseScene(scene, {}, nullptr);
  EXPECT_EQ(dark.status().code(), absl::StatusCode::kFailedPrecondition);
}

TEST(InspectionOfRecordings, NeedsVersionTwoInTheMiddleOfTheSensor) {
  v1::Recordings recordings;
  recordings.set_format_version(1);
  EXPECT_THAT(InspectionOfRecordings(recordings, "set").status().message(),
              HasSubstr("format_version is 1, must be 2"));
  recordings.set_format_version(2);
  recordings.mutable_part()->set_file("head.glb");
  v1::Recording* recording = recordings.add_recordings();
  recording->set_roi_columns_px(64);
  recording->set_roi_rows_px(48);
  recording->set_roi_column_px(-30);
  recording->set_roi_row_px(-24);
  EXPECT_THAT(InspectionOfRecordings(recordings, "set").status().message(), HasSubstr("-30"));
  recording->set_roi_column_px(-32);
  auto inspection = InspectionOfRecordings(recordings, "set");
  ASSERT_TRUE(inspection.ok()) << inspection.status();
  EXPECT_EQ(inspection->camera().columns_px(), 64);
  EXPECT_FALSE(inspection->render().laser_interreflection());
}

}  // namespace
}  // namespace sightline
