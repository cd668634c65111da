// SPDX-License-Identifier: Apache-2.0
// Recordings of a part through DiagnosisService and its client, over a real socket.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>

#include "absl/strings/str_cat.h"
#include "core/recordings/part_inspection.h"
#include "planner_client/diagnosis_client/diagnosis_client.h"
#include "proto/status/rpc_status.h"
#include "tests/render_worker/scene_diagnosis/groove_scene.h"
#include "tests/render_worker/service/recorded_set_fixture.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// Answers at once, with what it was asked.
absl::StatusOr<v1::Diagnosis> EchoScene(const RecordedScene& scene,
                                        const SceneDiagnosisSettings& settings,
                                        const SceneDiagnosisProgress& progress) {
  progress(0.5, "half");
  v1::Diagnosis answer;
  answer.set_set(absl::StrCat(scene.part.triangles.size(), " triangles, ", scene.raw_dn.size(),
                              " images of ", scene.raw_dn[0].columns_px, " x ",
                              scene.raw_dn[0].rows_px, ", ", settings.max_effects, " effects"));
  answer.set_seed(static_cast<int64_t>(settings.seed));
  for (const std::string& effect : settings.excluded_effects) {
    answer.add_ranked()->set_effect(effect);
  }
  return answer;
}

class SceneDiagnosisServiceTest : public RecordedSetTest {
 protected:
  // A groove with the light that goes from flank to flank, rendered once for all tests.
  static void SetUpTestSuite() {
    v1::RenderSpec spec;
    v1::PartRender* part = spec.mutable_part();
    ASSERT_TRUE(
        ParseStrictJson(GrooveInspectionJson(), "inspection", part->mutable_inspection()).ok());
    part->mutable_inspection()->mutable_render()->set_laser_interreflection(true);
    for (int i = 0; i < 2; ++i) {
      v1::PartFrame* frame = part->add_frames();
      frame->mutable_measurement()->set_camera_distance_m(0.3);
      frame->mutable_measurement()->set_triangulation_angle_deg(30);
      frame->set_stage_position_m(0.001 * i);
      frame->set_scan(1);
      frame->set_frame(i);
    }
    rendered_ = new RenderedFolder(spec, {{"groove.obj", kGrooveObj}});
  }
  static void TearDownTestSuite() { delete rendered_; }

  void SetUp() override {
    Open(rendered_->set());
    StartServer({.diagnose_scene = EchoScene});
  }

  v1::CreateDiagnosisRequest Request() const {
    v1::CreateDiagnosisRequest request;
    *request.mutable_source()->mutable_recordings() = set_.recordings;
    *request.mutable_inspection() = *InspectionOfRecordings(set_.recordings, "set");
    request.mutable_inspection()->mutable_part()->set_unit("m");
    return request;
  }
  absl::StatusOr<v1::Diagnosis> Diagnosed(const v1::CreateDiagnosisRequest& request) const {
    return DiagnoseRecordings(client_, request, set_.images, assets_);
  }

  static RenderedFolder* rendered_;
  std::vector<AssetFile> assets_ = {{"groove.obj", kGrooveObj}};
};

RenderedFolder* SceneDiagnosisServiceTest::rendered_ = nullptr;

TEST_F(SceneDiagnosisServiceTest, FindsTheLightThatTheModelLacks) {
  StartServer({.diagnose_scene = DiagnoseScene});
  double reported = 0;
  client_.on_progress = [&reported](double fraction, const std::string&) {
    EXPECT_GE(fraction, reported);
    reported = fraction;
  };
  const auto answer = Diagnosed(Request());
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->verdict(), "effect");
  EXPECT_EQ(answer->ranked(0).effect(), "illumination.interreflection") << answer->finding();
  EXPECT_EQ(answer->region_maps_size(), 2);
  EXPECT_EQ(reported, 1);
}

TEST_F(SceneDiagnosisServiceTest, SceneAndSettingsReachTheDiagnosis) {
  v1::CreateDiagnosisRequest request = Request();
  auto answer = Diagnosed(request);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->set(), "4 triangles, 2 images of 128 x 96, 2 effects");
  EXPECT_EQ(answer->seed(), 1);
  request.set_seed(7);
  request.set_max_effects(1);
  request.add_excluded_effects("optics.veiling_glare");
  answer = Diagnosed(request);
  ASSERT_TRUE(answer.ok()) << answer.status();
  EXPECT_EQ(answer->set(), "4 triangles, 2 images of 128 x 96, 1 effects");
  EXPECT_EQ(answer->seed(), 7);
  EXPECT_EQ(answer->ranked(0).effect(), "optics.veiling_glare");
}

TEST_F(SceneDiagnosisServiceTest, InterruptCancelsTheJob) {
  StartServer({.diagnose_scene =
                   [](const RecordedScene&, const SceneDiagnosisSettings& settings,
                      const SceneDiagnosisProgress& progress) -> absl::StatusOr<v1::Diagnosis> {
    progress(0.5, "working");
    while (!*settings.cancelled) absl::SleepFor(absl::Milliseconds(1));
    return absl::CancelledError("stopped");
  }});
  std::atomic<bool> interrupted = false;
  client_.interrupted = &interrupted;
  client_.on_progress = [&](double fraction, const std::string&) {
    if (fraction >= 0.5) interrupted = true;
  };
  const absl::Status status = Diagnosed(Request()).status();
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
}

TEST_F(SceneDiagnosisServiceTest, BadRequestsAreNamed) {
  const struct {
    std::function<void(v1::CreateDiagnosisRequest*)> change;
    std::string field, expected;
  } cases[] = {
      {[](auto* r) { r->set_max_effects(3); }, "max_effects", "is 3, must be in [1, 2]"},
      {[](auto* r) { r->add_excluded_effects("sensor.smear"); }, "excluded_effects[0]",
       "illumination.interreflection"},
      {[](auto* r) { r->mutable_inspection()->mutable_part()->set_file("head.obj"); }, "assets",
       "has no entry for head.obj"},
      {[](auto* r) { r->mutable_inspection()->mutable_camera()->set_sensor_file("/etc/passwd"); },
       "inspection.camera.sensor_file", "must be inline"},
      {[](auto* r) { r->mutable_inspection()->clear_materials(); }, "inspection.materials",
       "is missing"},
      {[](auto* r) { r->mutable_inspection()->add_effects()->set_effect("optics.coma"); },
       "inspection.effects", "is not empty"},
      {[](auto* r) {
         r->mutable_source()->mutable_recordings()->mutable_recordings(1)->set_file("x.png");
       },
       "source.images", "has no entry for x.png"},
  };
  for (const auto& c : cases) {
    v1::CreateDiagnosisRequest request = Request();
    c.change(&request);
    const absl::Status status = Diagnosed(request).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << c.expected << ": " << status;
    const std::vector<FieldViolation> violations = FieldViolations(status);
    ASSERT_FALSE(violations.empty()) << status;
    EXPECT_EQ(violations[0].field, c.field);
    EXPECT_THAT(violations[0].description, HasSubstr(c.expected));
  }
  // Without an inspection the worker makes its own, for which this file's unit is missing.
  v1::CreateDiagnosisRequest request = Request();
  request.clear_inspection();
  const absl::Status status = Diagnosed(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("part.unit"));
}

TEST_F(SceneDiagnosisServiceTest, AnotherUnitOrPartIsNoticed) {
  v1::CreateDiagnosisRequest request = Request();
  request.mutable_inspection()->mutable_part()->set_unit("inch");
  absl::Status status = Diagnosed(request).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("groove.obj: is not the part of the recordings"),
                    HasSubstr("another unit"), HasSubstr("1.016 x 0.6096 x 0.3048 mm")));
  assets_[0].bytes = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n";
  status = Diagnosed(Request()).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("another file"));
  assets_[0].bytes = "no mesh";
  status = Diagnosed(Request()).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_THAT(std::string(status.message()),
              AllOf(HasSubstr("groove.obj"), Not(HasSubstr(folder_))));
}

TEST_F(SceneDiagnosisServiceTest, OnlyWhatTheWorkerHas) {
  v1::CreateVerificationRequest verification;
  *verification.mutable_source()->mutable_recordings() = set_.recordings;
  StartServer(
      {.verify = [](const RecordedSet&, const VerificationSettings&, const DiagnosisProgress&) {
        return absl::StatusOr<v1::Verification>(v1::Verification());
      }});
  EXPECT_TRUE(absl::IsUnimplemented(Diagnosed(Request()).status()));
  const absl::Status status = VerifyRecordings(client_, verification, set_.images).status();
  EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
  EXPECT_EQ(FieldViolations(status).at(0).field, "source.recordings.format_version");
}

}  // namespace
}  // namespace sightline
