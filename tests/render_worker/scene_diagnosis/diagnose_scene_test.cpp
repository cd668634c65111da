// Recordings of a groove by the renderer, with light that the model lacks, and without.
#include "render_worker/scene_diagnosis/diagnose_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "tests/render_worker/scene_diagnosis/groove_scene.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;

v1::Diagnosis Diagnosed(const RecordedScene& scene, int threads = 2) {
  SceneDiagnosisSettings settings;
  settings.threads = threads;
  auto diagnosis = DiagnoseScene(scene, settings, nullptr);
  EXPECT_TRUE(diagnosis.ok()) << diagnosis.status();
  return diagnosis.ok() ? *diagnosis : v1::Diagnosis();
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
