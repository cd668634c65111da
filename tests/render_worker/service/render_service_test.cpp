// SPDX-License-Identifier: Apache-2.0
// The service in this process, over a real socket.
#include "render_worker/service/render_service.h"

#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>

#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/json/strict_json.h"
#include "core/recordings/recordings.h"
#include "core/status/status_macros.h"
#include "planner_client/render_client/render_client.h"
#include "proto/status/rpc_status.h"
#include "render_worker/image_file/image_file.h"
#include "render_worker/service/render_server.h"
#include "sightline/v1/diagnosis_service.grpc.pb.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/optics_service.grpc.pb.h"
#include "sightline/v1/sensor_service.grpc.pb.h"
#include "tests/limits/cpu_time.h"
#include "tests/limits/wait_until.h"
#include "tests/limits/within_limits.h"
#include "tests/render_worker/service/plate_spec.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

// A table of 0.2 x 0.2 m, its upper side in z = 0.
std::string TableObj() {
  return "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";
}

// One frame of the table seen from above at f/16, the sheet through the middle of the image.
v1::RenderSpec PartSpec() {
  v1::RenderSpec spec;
  const absl::Status status = ParseStrictJson(
      absl::StrCat(R"({"part": {"inspection": {"name": "table",
        "part": {"file": "table.obj", "unit": "m"}, "camera": {"sensor": {)",
                   kPlateSpecSensor, R"(}}, "lens": {"focal_length_m": 0.016, "f_number": 16},
        "laser": {"power_w": 0.005, "fan_angle_deg": 40},
        "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.5}}}],
        "render": {"exposure_time_s": 0.005}},
        "frames": [{"measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30},
                    "stage_position_m": 0, "scan": 3, "frame": 120}]}})"),
      "spec", &spec);
  EXPECT_TRUE(status.ok()) << status;
  return spec;
}

class RenderServiceTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    Start(/*threads=*/2);
  }
  void TearDown() override {
    server_.reset();
    // Nothing is left behind.
    EXPECT_TRUE(fs::is_empty(folder_ + "/spool"));
    fs::remove_all(folder_);
  }

  void Start(int threads, int64_t max_queued_jobs = 64) {
    server_.reset();
    fs::create_directories(folder_ + "/spool");
    RenderServerOptions options;
    options.listen = "unix:" + folder_ + "/s";
    options.spool_folder = folder_ + "/spool";
    options.threads = threads;
    options.max_asset_bytes = 1 << 20;
    options.max_image_bytes = int64_t{1} << 30;
    options.max_queued_jobs = max_queued_jobs;
    auto server = RenderServer::Start(options);
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    grpc::ChannelArguments arguments;
    arguments.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    channel_ = grpc::CreateCustomChannel(server_->address(), grpc::InsecureChannelCredentials(),
                                         arguments);
    render_ = v1::RenderService::NewStub(channel_);
    jobs_ = v1::JobService::NewStub(channel_);
  }

  static void SetTimeout(grpc::ClientContext* context) { context->set_deadline(FarDeadline()); }

  absl::Status Upload(const std::string& bytes, std::optional<int64_t> size,
                      const std::string& digest, v1::UploadAssetResponse* response) {
    grpc::ClientContext context;
    SetTimeout(&context);
    auto writer = render_->UploadAsset(&context, response);
    v1::UploadAssetRequest message;
    message.mutable_header()->set_size_bytes(size.value_or(static_cast<int64_t>(bytes.size())));
    message.mutable_header()->set_asset_digest(digest);
    message.mutable_header()->set_file_name("test");
    writer->Write(message);
    message.set_chunk(bytes);
    writer->Write(message);
    writer->WritesDone();
    return FromGrpcStatus(writer->Finish());
  }

  absl::StatusOr<v1::Job> Create(const v1::RenderSpec& spec, const std::string& request_id = "") {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::CreateRenderRequest request;
    request.set_request_id(request_id);
    *request.mutable_spec() = spec;
    v1::CreateRenderResponse response;
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(render_->CreateRender(&context, request, &response)));
    return response.job();
  }

  struct File {
    std::string name, bytes, sha256;
  };
  absl::Status Stream(const std::string& job_id, std::vector<File>* files, int skip = 0) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::StreamRenderFilesRequest request;
    request.set_job_id(job_id);
    request.set_skip_files(skip);
    auto reader = render_->StreamRenderFiles(&context, request);
    v1::StreamRenderFilesResponse response;
    while (reader->Read(&response)) {
      if (response.has_header()) {
        files->push_back({response.header().file(), "", response.header().sha256()});
      } else if (!response.chunk().empty()) {
        files->back().bytes += response.chunk();
      }
    }
    return FromGrpcStatus(reader->Finish());
  }

  absl::StatusOr<v1::Job> Cancel(const std::string& job_id) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::CancelJobRequest request;
    request.set_job_id(job_id);
    v1::CancelJobResponse response;
    SIGHTLINE_RETURN_IF_ERROR(FromGrpcStatus(jobs_->CancelJob(&context, request, &response)));
    return response.job();
  }
  v1::Job Get(const std::string& job_id) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::GetJobRequest request;
    request.set_job_id(job_id);
    v1::GetJobResponse response;
    EXPECT_TRUE(jobs_->GetJob(&context, request, &response).ok());
    return response.job();
  }

  std::string folder_ = "/tmp/sightline-render-test-XXXXXX";
  std::unique_ptr<RenderServer> server_;
  std::shared_ptr<grpc::Channel> channel_;
  std::unique_ptr<v1::RenderService::Stub> render_;
  std::unique_ptr<v1::JobService::Stub> jobs_;
};

TEST_F(RenderServiceTest, AssetsAreKnownByTheirDigest) {
  v1::UploadAssetResponse response;
  ASSERT_TRUE(Upload("abc", {}, "", &response).ok());
  // FIPS 180-2, appendix B.1.
  const std::string digest = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad";
  EXPECT_EQ(response.asset_digest(), digest);
  EXPECT_TRUE(Upload("abc", {}, digest, &response).ok());
  EXPECT_EQ(FieldViolations(Upload("abd", {}, digest, &response)).at(0).field,
            "header.asset_digest");
  EXPECT_EQ(FieldViolations(Upload("abc", 4, "", &response)).at(0).field, "header.size_bytes");
  EXPECT_EQ(FieldViolations(Upload("abc", 2, "", &response)).at(0).field, "header.size_bytes");
  EXPECT_EQ(FieldViolations(Upload("abc", 0, "", &response)).at(0).field, "header.size_bytes");
  const absl::Status large = Upload("abc", 2 << 20, "", &response);
  EXPECT_TRUE(absl::IsResourceExhausted(large)) << large;
  EXPECT_EQ(ErrorReason(large), "ASSET_TOO_LARGE");
}

TEST_F(RenderServiceTest, PlateSetIsValidAndTheSameForAnyThreadCount) {
  std::vector<File> files, again;
  const auto job = Create(PlateSpec());
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->kind(), "render");
  ASSERT_TRUE(Stream(job->job_id(), &files).ok());
  ASSERT_EQ(files.size(), 3u);
  EXPECT_EQ(files[0].name, "images/0.png");
  EXPECT_EQ(files[2].name, "recordings.json");
  for (const File& file : files) EXPECT_EQ(Sha256Hex(file.bytes), file.sha256) << file.name;
  std::ofstream(folder_ + "/recordings.json") << files[2].bytes;
  const auto set = ReadRecordings(folder_ + "/recordings.json");
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->recordings.size(), 2u);
  // The line is brighter than the dark frame.
  std::vector<Image<uint16_t>> images;
  for (int i = 0; i < 2; ++i) {
    const std::string path = absl::StrCat(folder_, "/", i, ".png");
    std::ofstream(path, std::ios::binary) << files[i].bytes;
    auto image = ReadRawImage(path);
    ASSERT_TRUE(image.ok()) << image.status();
    images.push_back(*std::move(image));
  }
  const auto mean = [](const Image<uint16_t>& image) {
    double sum = 0;
    for (const uint16_t value : image.values) sum += value;
    return sum / static_cast<double>(image.values.size());
  };
  EXPECT_EQ(images[0].columns_px, 64);
  EXPECT_NEAR(mean(images[1]), 0.16 * 27.57, 5 * 0.16 * 6.5 / std::sqrt(64 * 48) + 0.02);
  EXPECT_GT(mean(images[0]), mean(images[1]) + 1);

  // A stream may begin in the middle and long after the job.
  ASSERT_TRUE(Stream(job->job_id(), &again, /*skip=*/2).ok());
  ASSERT_EQ(again.size(), 1u);
  EXPECT_EQ(again[0].bytes, files[2].bytes);

  Start(/*threads=*/1);
  again.clear();
  const auto other = Create(PlateSpec());
  ASSERT_TRUE(other.ok());
  ASSERT_TRUE(Stream(other->job_id(), &again).ok());
  ASSERT_EQ(again.size(), files.size());
  for (size_t i = 0; i < files.size(); ++i) EXPECT_EQ(again[i].bytes, files[i].bytes);
}

// The build is that of the program that renders: here this one.
TEST_F(RenderServiceTest, SaysItsBuild) {
  grpc::ClientContext context;
  SetTimeout(&context);
  v1::GetRenderWorkerResponse response;
  ASSERT_TRUE(render_->GetRenderWorker(&context, v1::GetRenderWorkerRequest(), &response).ok());
  const auto program = DigestOfFile("/proc/self/exe");
  ASSERT_TRUE(program.ok()) << program.status();
  EXPECT_EQ(response.server_build(), program->sha256);
}

TEST_F(RenderServiceTest, SameRequestIdSameJob) {
  const auto first = Create(PlateSpec(), "a");
  const auto second = Create(PlateSpec(), "a");
  ASSERT_TRUE(first.ok() && second.ok());
  EXPECT_EQ(first->job_id(), second->job_id());
  std::vector<File> files;
  EXPECT_TRUE(Stream(first->job_id(), &files).ok());
  EXPECT_EQ(files.size(), 3u);
  EXPECT_TRUE(absl::IsAlreadyExists(Create(PlateSpec(3), "a").status()));
  const auto third = Create(PlateSpec(), "b");
  ASSERT_TRUE(third.ok());
  EXPECT_NE(first->job_id(), third->job_id());
}

void ExpectQueueFull(const absl::Status& status) {
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_EQ(ErrorReason(status), "QUEUE_FULL") << status;
}

// Answer to an empty request.
template <typename Request, typename Response, typename Call>
absl::Status CallWithNothing(const Call& call) {
  grpc::ClientContext context;
  context.set_deadline(FarDeadline());
  Response response;
  return FromGrpcStatus(call(&context, Request(), &response));
}

TEST_F(RenderServiceTest, AFullQueueIsSeenBeforeTheRequest) {
  Start(/*threads=*/2, /*max_queued_jobs=*/4);  // half of them for one peer
  const v1::RenderSpec nothing;
  ASSERT_TRUE(absl::IsInvalidArgument(Create(nothing).status()));
  const auto first = Create(PlateSpec(3000), "a");
  const auto second = Create(PlateSpec(3000), "b");
  ASSERT_TRUE(first.ok() && second.ok()) << first.status() << second.status();
  // A server that looks at a wrong request would reject it for that.
  ExpectQueueFull(Create(nothing, "c").status());
  ExpectQueueFull(Create(nothing).status());
  const auto optics = v1::OpticsService::NewStub(channel_);
  const auto sensor = v1::SensorService::NewStub(channel_);
  const auto diagnosis = v1::DiagnosisService::NewStub(channel_);
  ExpectQueueFull(CallWithNothing<v1::CreateOpticsRequest, v1::CreateOpticsResponse>(
      [&](auto... arguments) { return optics->CreateOptics(arguments...); }));
  ExpectQueueFull(
      CallWithNothing<v1::CreateSensorDiagnosisRequest, v1::CreateSensorDiagnosisResponse>(
          [&](auto... arguments) { return sensor->CreateSensorDiagnosis(arguments...); }));
  ExpectQueueFull(CallWithNothing<v1::CreateDiagnosisRequest, v1::CreateDiagnosisResponse>(
      [&](auto... arguments) { return diagnosis->CreateDiagnosis(arguments...); }));
  // Earlier results are found all the same.
  const auto again = Create(PlateSpec(3000), "b");
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->job_id(), second->job_id());
  EXPECT_TRUE(absl::IsAlreadyExists(Create(nothing, "b").status()));
  // Room comes back with the end of a job, and what is refused keeps none.
  ASSERT_TRUE(Cancel(second->job_id()).ok());
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(absl::IsInvalidArgument(Create(nothing).status()));
  const auto third = Create(PlateSpec(3000), "d");
  EXPECT_TRUE(third.ok()) << third.status();
  ExpectQueueFull(Create(nothing).status());
  ASSERT_TRUE(Cancel(first->job_id()).ok());
}

TEST_F(RenderServiceTest, CancelledJobEndsSoonAndItsStreamSaysSo) {
  const auto job = Create(PlateSpec(3000));
  ASSERT_TRUE(job.ok());
  WaitUntil([&] { return Get(job->job_id()).state() != v1::Job::STATE_QUEUED; });
  absl::SleepFor(absl::Milliseconds(50));
  ASSERT_TRUE(Cancel(job->job_id()).ok());
  std::vector<File> files;
  EXPECT_TRUE(absl::IsCancelled(Stream(job->job_id(), &files)));
  EXPECT_EQ(Get(job->job_id()).state(), v1::Job::STATE_CANCELLED);
  EXPECT_LT(files.size(), 2999u);
}

TEST_F(RenderServiceTest, BadRequestsAreNamed) {
  using Change = std::function<void(v1::RenderSpec*)>;
  const struct {
    bool part;
    Change change;
    std::string expected;
  } cases[] = {
      {true, [](auto* s) { s->clear_scene(); }, "spec.scene"},
      {true,
       [](auto* s) {
         s->mutable_output()->set_image_format(static_cast<v1::RenderOutput::ImageFormat>(9));
       },
       "output.image_format"},
      {true, [](auto* s) { s->mutable_part()->mutable_inspection()->mutable_camera()->Clear(); },
       "part.inspection.camera.sensor"},
      {true, [](auto* s) { s->mutable_part()->mutable_inspection()->clear_lens(); },
       "part.inspection.lens"},
      {true, [](auto* s) { s->mutable_part()->mutable_inspection()->clear_materials(); },
       "part.inspection.materials"},
      {true, [](auto* s) { s->mutable_part()->clear_frames(); }, "part.frames"},
      {true,
       [](auto* s) {
         s->mutable_part()->mutable_frames(0)->mutable_measurement()->set_camera_distance_m(5);
       },
       "part.frames[0].measurement"},
      {true,
       [](auto* s) {
         s->mutable_part()
             ->mutable_inspection()
             ->mutable_camera()
             ->mutable_sensor()
             ->set_gain_dn_per_electron(0);
       },
       "gain_dn_per_electron is 0"},
      {true,
       [](auto* s) {
         s->mutable_part()
             ->mutable_inspection()
             ->mutable_camera()
             ->mutable_sensor()
             ->mutable_quantum_efficiency()
             ->set_mono(1.1);
       },
       "quantum_efficiency.mono is 1.1"},
      {true,
       [](auto* s) {
         s->mutable_part()->mutable_inspection()->add_effects()->set_effect("optics.veiling_glre");
       },
       "optics.veiling_glre"},
      // The server reads no files of its own.
      {true,
       [](auto* s) {
         s->mutable_part()->mutable_inspection()->mutable_camera()->set_sensor_file("/etc/passwd");
       },
       "sensor_file"},
      {true,
       [](auto* s) {
         s->mutable_part()->mutable_inspection()->mutable_materials(0)->set_file("/etc/passwd");
       },
       "materials[0].file"},
      {true, [](auto* s) { s->mutable_part()->clear_assets(); }, "part.assets: has no entry"},
      {false,
       [](auto* s) {
         s->mutable_plate()->mutable_recordings()->mutable_recordings(0)->set_file("../../x");
       },
       "must stay in the set's folder"},
      {false,
       [](auto* s) {
         s->mutable_plate()->mutable_recordings()->mutable_recordings(0)->set_file(
             "recordings.json");
       },
       "recordings.json"},
      {false, [](auto* s) { s->mutable_output()->set_layers(true); }, "output.layers"},
      {false, [](auto* s) { s->mutable_plate()->mutable_deviations()->set_f_number_relative(-2); },
       "deviations.f_number_relative is -2"},
  };
  v1::UploadAssetResponse table;
  ASSERT_TRUE(Upload(TableObj(), {}, "", &table).ok());
  for (const auto& c : cases) {
    v1::RenderSpec spec = c.part ? PartSpec() : PlateSpec();
    if (c.part) {
      v1::RenderAsset* asset = spec.mutable_part()->add_assets();
      asset->set_file("table.obj");
      asset->set_asset_digest(table.asset_digest());
    }
    c.change(&spec);
    const absl::Status status = Create(spec).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << c.expected << ": " << status;
    EXPECT_THAT(std::string(status.message()), HasSubstr(c.expected.substr(0, 20)));
    EXPECT_EQ(ErrorReason(status), "INVALID_FIELD");
  }
}

TEST_F(RenderServiceTest, UnknownThingsAreNotFound) {
  v1::RenderSpec spec = PartSpec();
  v1::RenderAsset* asset = spec.mutable_part()->add_assets();
  asset->set_file("table.obj");
  asset->set_asset_digest("00");
  const absl::Status status = Create(spec).status();
  EXPECT_TRUE(absl::IsNotFound(status)) << status;
  EXPECT_EQ(ErrorReason(status), "ASSET_UNKNOWN");
  EXPECT_EQ(ErrorMetadata(status)["asset_digest"], "00");
  std::vector<File> files;
  const absl::Status stream = Stream("render-none", &files);
  EXPECT_TRUE(absl::IsNotFound(stream));
  EXPECT_EQ(ErrorReason(stream), "JOB_UNKNOWN");
}

// A table of exposure times is a job as all others: its answer by its id, errors by fields.
TEST_F(RenderServiceTest, ExposuresOfAMaterialAreAJob) {
  const auto optics = v1::OpticsService::NewStub(channel_);
  v1::CreateDetectabilityRequest request;
  *request.mutable_inspection() = PartSpec().part().inspection();
  auto* distance = request.mutable_inspection()->mutable_measurement()->mutable_camera_distance_m();
  distance->set_fixed(0.3);
  request.add_part_materials("");
  const auto create = [&] {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::CreateDetectabilityResponse response;
    const absl::Status status =
        FromGrpcStatus(optics->CreateDetectability(&context, request, &response));
    return status.ok() ? absl::StatusOr<v1::Job>(response.job()) : status;
  };
  const auto get = [&](const std::string& id, v1::GetDetectabilityResponse* response) {
    grpc::ClientContext context;
    SetTimeout(&context);
    v1::GetDetectabilityRequest asked;
    asked.set_job_id(id);
    return FromGrpcStatus(optics->GetDetectability(&context, asked, response));
  };
  v1::GetDetectabilityResponse response;
  EXPECT_TRUE(absl::IsNotFound(get("gone", &response)));

  const auto cancelled = create();
  ASSERT_TRUE(cancelled.ok()) << cancelled.status();
  ASSERT_TRUE(Cancel(cancelled->job_id()).ok());
  const auto job = create();
  ASSERT_TRUE(job.ok()) << job.status();
  WaitUntil([&] { return Get(job->job_id()).state() == v1::Job::STATE_SUCCEEDED; });
  ASSERT_TRUE(get(job->job_id(), &response).ok());
  ASSERT_EQ(response.table().materials_size(), 1);
  const v1::DetectabilityOfMaterial& material = response.table().materials(0);
  EXPECT_EQ(material.shortest_exposure_time_s_size(),
            material.camera_distances_m_size() * material.camera_incidence_deg_size() *
                material.laser_incidence_deg_size() * material.azimuth_deg_size());
  // Seen and lit along the normal, the line is found.
  EXPECT_TRUE(std::isfinite(material.shortest_exposure_time_s(0)));
  EXPECT_TRUE(absl::IsCancelled(get(cancelled->job_id(), &response)));

  request.clear_part_materials();
  EXPECT_THAT(create().status().message(), HasSubstr("part_materials"));
  request.add_part_materials("");
  request.mutable_inspection()->mutable_materials(0)->mutable_material()->mutable_merl()->set_file(
      "gone.binary");
  EXPECT_THAT(create().status().message(), HasSubstr("gone.binary"));
}

TEST_F(RenderServiceTest, ImageTooLargeIsRefusedUpFront) {
  v1::RenderSpec spec = PlateSpec();
  v1::Sensor* camera = spec.mutable_plate()->mutable_recordings()->mutable_camera();
  camera->set_sensor_columns_px(65536);
  camera->set_sensor_rows_px(65536);
  v1::Recording* recording = spec.mutable_plate()->mutable_recordings()->mutable_recordings(0);
  recording->set_roi_column_px(-32768);
  recording->set_roi_row_px(-32768);
  recording->set_roi_columns_px(65536);
  recording->set_roi_rows_px(65536);
  const double before_s = CpuSeconds();
  const absl::Status status = Create(spec).status();
  EXPECT_LT(CpuSeconds() - before_s, 1.0 * kSlowness);
  EXPECT_TRUE(absl::IsResourceExhausted(status)) << status;
  EXPECT_EQ(ErrorReason(status), "IMAGE_TOO_LARGE");
  // 65536^2 px of 62 bytes each, and at least 4 + 4 samples of 18 and 20 bytes.
  EXPECT_GE(std::stod(ErrorMetadata(status)["needed_bytes"]), 65536. * 65536 * (62 + 4 * 38));
  EXPECT_THAT(std::string(status.message()), HasSubstr("65536 x 65536 px"));
}

TEST_F(RenderServiceTest, PartIntoAFolder) {
  v1::RenderSpec spec = PartSpec();
  spec.mutable_output()->set_layers(true);
  RenderClientOptions options;
  options.address = server_->address();
  const fs::path out = folder_ + "/out";
  const auto files = RenderToFolder(options, spec, {{"table.obj", TableObj()}}, out.string());
  ASSERT_TRUE(files.ok()) << files.status();
  EXPECT_THAT(*files, ElementsAre("images/000.png", "images/000_layers.exr", "recordings.json"));
  const auto set = ReadRecordings((out / "recordings.json").string());
  ASSERT_TRUE(set.ok()) << set.status();
  EXPECT_EQ(set->format_version, 2);
  EXPECT_EQ(set->recordings[0].scan, 3);
  EXPECT_EQ(set->recordings[0].frame, 120);
  EXPECT_EQ(set->part->file, "table.obj");
  const auto image = ReadRawImage((out / "images/000.png").string());
  ASSERT_TRUE(image.ok());
  // The sheet passes the rig's origin, which is the middle of the image.
  const auto row_mean = [&](int row) {
    double sum = 0;
    for (int column = 0; column < image->columns_px; ++column) sum += image->At(row, column);
    return sum / image->columns_px;
  };
  EXPECT_GT(row_mean(24), row_mean(2) + 20);
  EXPECT_GT(row_mean(24), row_mean(46) + 20);
}

TEST_F(RenderServiceTest, BrokenAssetsFailTheJobWithTheirName) {
  RenderClientOptions options;
  options.address = server_->address();
  auto files = RenderToFolder(options, PartSpec(), {{"table.obj", "v 0 0\n"}}, folder_ + "/out");
  EXPECT_TRUE(absl::IsInvalidArgument(files.status())) << files.status();
  EXPECT_THAT(std::string(files.status().message()), HasSubstr("table.obj"));
  EXPECT_FALSE(fs::exists(folder_ + "/out/recordings.json"));

  v1::RenderSpec spec = PartSpec();
  spec.mutable_part()
      ->mutable_inspection()
      ->mutable_materials(0)
      ->mutable_material()
      ->clear_lambert();
  files = RenderToFolder(options, spec, {{"table.obj", TableObj()}}, folder_ + "/out");
  EXPECT_TRUE(absl::IsInvalidArgument(files.status())) << files.status();
  EXPECT_THAT(std::string(files.status().message()), HasSubstr("grey"));
}

}  // namespace
}  // namespace sightline
