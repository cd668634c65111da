// SPDX-License-Identifier: Apache-2.0
// A real server in this process, over TCP and unix sockets, around the fake engine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstring>
#include <future>
#include <limits>
#include <thread>

#include "core/part/part_digest.h"
#include "grpcpp/generic/generic_stub.h"
#include "planner_client/coverage_client/coverage_client.h"
#include "tests/integration/coverage_server/fake_scene.h"
#include "tests/integration/coverage_server/service_fixture.h"
#include "tests/limits/wait_until.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class CoverageServiceTest : public ::testing::Test {
 protected:
  void Start(FakeOptions fake = {}, CoverageServerOptions options = {}) {
    fake.counters = &counters_;
    if (options.listen.empty()) options.listen = "127.0.0.1:0";
    if (options.threads == 0) options.threads = 2;
    auto server = CoverageServer::Start(options, MakeFakeBackend(fake));
    ASSERT_TRUE(server.ok()) << server.status();
    server_ = *std::move(server);
    connection_ = std::make_unique<Connection>(server_->address());
  }

  FakeCounters counters_;
  std::unique_ptr<CoverageServer> server_;
  std::unique_ptr<Connection> connection_;
};

std::string AsciiPly(const std::string& first_x, int faces = 4) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face " +
      std::to_string(faces) + "\nproperty list uchar int vertex_indices\nend_header\n" + first_x +
      " 0 0\n0.1 0 0\n0 0.1 0\n0 0 0.1\n";
  const char* const triangles[] = {"3 0 2 1\n", "3 0 1 3\n", "3 1 2 3\n", "3 0 3 2\n"};
  for (int i = 0; i < faces; ++i) text += triangles[i];
  return text;
}

TEST_F(CoverageServiceTest, UploadsPartsAndReportsTheirHealth) {
  Start();
  const TriangleMesh box = MakeBox({0.1f, 0.2f, 0.3f});
  v1::UploadPartResponse response;
  absl::Status status = connection_->Upload(EncodePly(box), "ply", "m", &response);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_EQ(response.part_digest(), PartDigestOf(*LoadedBox({0.1f, 0.2f, 0.3f})).Text());
  EXPECT_EQ(response.health().triangle_count(), 12);
  EXPECT_EQ(response.health().open_edge_count(), 0);
  EXPECT_NEAR(response.health().area_m2(), 0.22, 1e-6);
  EXPECT_NEAR(response.health().bounding_box_m().max_z_m(), 0.3, 1e-6);

  // The same in other chunks, in millimetres: the same part.
  v1::UploadPartResponse again;
  ASSERT_TRUE(connection_->Upload(EncodePly(box), "ply", "m", &again, std::nullopt, 13).ok());
  EXPECT_EQ(again.part_digest(), response.part_digest());
  EXPECT_EQ(again.health().SerializeAsString(), response.health().SerializeAsString());
}

TEST_F(CoverageServiceTest, RefusesBrokenParts) {
  Start();
  const std::string good = EncodePly(MakeBox({0.1f, 0.2f, 0.3f}));
  v1::UploadPartResponse response;
  const auto upload = [&](const std::string& bytes, const std::string& format,
                          const std::string& unit, std::optional<int64_t> size = std::nullopt) {
    return connection_->Upload(bytes, format, unit, &response, size);
  };
  const absl::Status truncated = upload(good.substr(0, good.size() - 20), "ply", "m");
  EXPECT_EQ(truncated.code(), absl::StatusCode::kInvalidArgument) << truncated;
  EXPECT_EQ(ErrorReason(truncated), "PART_INVALID");
  EXPECT_THAT(std::string(truncated.message()), HasSubstr("test.ply"));

  const absl::Status nan = upload(AsciiPly("nan"), "ply", "m");
  EXPECT_EQ(nan.code(), absl::StatusCode::kInvalidArgument) << nan;
  EXPECT_EQ(ErrorReason(nan), "PART_INVALID");
  ASSERT_TRUE(upload(AsciiPly("0"), "ply", "m").ok());  // else the two around it mean nothing
  const absl::Status empty = upload(AsciiPly("0", 0), "ply", "m");
  EXPECT_EQ(empty.code(), absl::StatusCode::kInvalidArgument) << empty;
  EXPECT_EQ(ErrorReason(empty), "PART_INVALID");

  const absl::Status wrong_unit = upload(EncodePly(MakeBox({100, 200, 300})), "ply", "m");
  EXPECT_EQ(wrong_unit.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(wrong_unit.message()), HasSubstr("millimetres"));
  EXPECT_EQ(upload(good, "ply", "furlong").code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(upload("glTF rubbish", "glb", "").code(), absl::StatusCode::kInvalidArgument);

  const absl::Status format = upload(good, "step", "m");
  ASSERT_EQ(FieldViolations(format).size(), 1u) << format;
  EXPECT_EQ(FieldViolations(format)[0].field, "header.format");
  EXPECT_EQ(FieldViolations(upload(good, "ply", "m", 0))[0].field, "header.size_bytes");
  EXPECT_EQ(FieldViolations(upload(good, "ply", "m", good.size() + 1))[0].field,
            "header.size_bytes");
  EXPECT_EQ(FieldViolations(upload(good, "ply", "m", good.size() - 1))[0].field,
            "header.size_bytes");

  // A stream without a header.
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  auto writer = connection_->coverage->UploadPart(&context, &response);
  v1::UploadPartRequest chunk;
  chunk.set_chunk("abc");
  writer->Write(chunk);
  writer->WritesDone();
  EXPECT_EQ(FieldViolations(FromGrpcStatus(writer->Finish()))[0].field, "header");
}

TEST_F(CoverageServiceTest, RefusesPartsThatAreTooLargeAtOnce) {
  CoverageServerOptions options;
  options.max_part_file_bytes = 100000;
  options.idle_timeout = absl::Hours(24);
  Start({}, options);
  v1::UploadPartResponse response;
  const absl::Status declared =
      connection_->Upload(std::string(10, 'x'), "ply", "m", &response, int64_t{3} << 30);
  EXPECT_EQ(declared.code(), absl::StatusCode::kResourceExhausted) << declared;
  EXPECT_EQ(ErrorReason(declared), "PART_TOO_LARGE");
  EXPECT_EQ(ErrorMetadata(declared).at("max_part_bytes"), "100000");

  // A header that lies: ends at what it says although the client would go on for ever.
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  auto writer = connection_->coverage->UploadPart(&context, &response);
  v1::UploadPartRequest message;
  message.mutable_header()->set_format("ply");
  message.mutable_header()->set_size_bytes(100000);
  ASSERT_TRUE(writer->Write(message));
  message.set_chunk(std::string(60000, 'x'));
  int written = 0;
  while (written < 10000 && writer->Write(message)) ++written;
  EXPECT_LT(written, 10000);
  const absl::Status more = FromGrpcStatus(writer->Finish());
  EXPECT_EQ(more.code(), absl::StatusCode::kInvalidArgument) << more;
  EXPECT_THAT(std::string(more.message()), HasSubstr("more bytes followed"));
  // A refused upload must not hold up the end of the server for the idle timeout.
  server_->Drain(absl::ZeroDuration());
}

TEST_F(CoverageServiceTest, CreatesASceneOnce) {
  std::atomic<bool> hold = true;
  FakeOptions fake;
  fake.hold = &hold;
  Start(fake);
  v1::UploadPartResponse uploaded;
  ASSERT_TRUE(
      connection_->Upload(EncodePly(MakeBox({0.1f, 0.1f, 0.1f})), "ply", "m", &uploaded).ok());
  v1::SceneSpec spec;
  spec.set_part_digest(uploaded.part_digest());
  const auto first = connection_->CreateScene(spec, "request-1");
  ASSERT_TRUE(first.ok()) << first.status();
  EXPECT_EQ(first->kind(), "scene");
  EXPECT_LT(first->state(), v1::Job::STATE_SUCCEEDED);
  // While it is being built: by request id, by content, with defaults written out.
  EXPECT_EQ(connection_->CreateScene(spec, "request-1")->job_id(), first->job_id());
  EXPECT_EQ(connection_->CreateScene(spec, "request-2")->job_id(), first->job_id());
  v1::SceneSpec explicit_spec = spec;
  explicit_spec.mutable_camera()->set_rows_px(512);
  EXPECT_EQ(connection_->CreateScene(explicit_spec)->job_id(), first->job_id());
  v1::SceneSpec other = spec;
  other.mutable_targets()->set_seed(7);
  for (const std::string id : {"request-1", "request-2"}) {
    const auto reused = connection_->CreateScene(other, id);
    EXPECT_EQ(reused.status().code(), absl::StatusCode::kAlreadyExists);
    EXPECT_EQ(ErrorReason(reused.status()), "REQUEST_ID_REUSED");
  }

  const auto states = connection_->Watch(first->job_id(), [&] { hold = false; });
  ASSERT_TRUE(states.ok()) << states.status();
  ASSERT_GE(states->size(), 2u);
  for (size_t i = 1; i < states->size(); ++i) {
    EXPECT_GE((*states)[i].progress(), (*states)[i - 1].progress());
  }
  EXPECT_EQ(states->back().state(), v1::Job::STATE_SUCCEEDED);
  const std::string digest = states->back().result_key();

  // Built: succeeded at once.
  const auto built = connection_->CreateScene(spec, "request-3");
  ASSERT_TRUE(built.ok());
  EXPECT_EQ(built->state(), v1::Job::STATE_SUCCEEDED);
  EXPECT_EQ(built->result_key(), digest);
  EXPECT_EQ(counters_.builds_started, 1);

  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::GetSceneRequest request;
  request.set_scene_digest(digest);
  v1::GetSceneResponse scene;
  ASSERT_TRUE(connection_->coverage->GetScene(&context, request, &scene).ok());
  EXPECT_EQ(scene.target_count(), 1000);
  EXPECT_EQ(scene.measurable_count(), 900);
  EXPECT_EQ(scene.spec().part_digest(), uploaded.part_digest());
  EXPECT_EQ(scene.spec().camera().rows_px(), 512);
  EXPECT_NEAR(scene.part_size_m().x(), 0.1, 1e-7);
  EXPECT_EQ(connection_->CreateScene(scene.spec())->result_key(), digest);
}

// Parts of one shape with different materials are different to light, and the same without it.
TEST_F(CoverageServiceTest, ScenesWithLightNameTheMaterials) {
  Start();
  TriangleMesh box = *LoadedBox({0.1f, 0.1f, 0.1f});
  box.material_names = {"steel", "paint"};
  box.triangle_material.assign(box.triangles.size(), 0);
  box.triangle_material[0] = 1;
  const std::string name = PartNameWithMaterials(box);
  v1::UploadPartResponse uploaded;
  ASSERT_TRUE(connection_->Upload(EncodePly(box, true), "ply", "m", &uploaded).ok());
  EXPECT_EQ(uploaded.part_digest(), PartDigestOf(box).Text());

  v1::SceneSpec spec;
  spec.set_part_digest(name);
  v1::Detectability& light = *spec.mutable_detectability();
  light.set_min_exposure_time_s(1e-4);
  const auto incomplete = connection_->CreateScene(spec);
  EXPECT_EQ(incomplete.status().code(), absl::StatusCode::kInvalidArgument);
  light.set_max_exposure_time_s(1e-2);
  v1::DetectabilityOfMaterial& material = *light.mutable_table()->add_materials();
  material.add_camera_distances_m(1);
  material.add_camera_incidence_deg(0);
  material.add_laser_incidence_deg(0);
  material.add_azimuth_deg(0);
  material.set_laser_distance_m(1);
  material.add_shortest_exposure_time_s(1e-3);
  material.add_longest_exposure_time_s(std::numeric_limits<double>::infinity());
  const auto with_light = connection_->CreateScene(spec);
  ASSERT_TRUE(with_light.ok()) << with_light.status();
  v1::SceneSpec longer = spec;
  longer.mutable_detectability()->set_max_exposure_time_s(2e-2);
  EXPECT_NE(connection_->CreateScene(longer)->job_id(), with_light->job_id());
  // The fraction went into the table; a scene does not depend on it.
  v1::SceneSpec fraction = spec;
  fraction.mutable_detectability()->set_min_detected_fraction(0.5);
  EXPECT_EQ(connection_->CreateScene(fraction)->job_id(), with_light->job_id());

  box.triangle_material[0] = 0;
  v1::SceneSpec other = spec;
  other.set_part_digest(PartNameWithMaterials(box));
  EXPECT_EQ(ErrorReason(connection_->CreateScene(other).status()), kReasonPartUnknown);
  other.set_part_digest(name + "0");
  EXPECT_EQ(connection_->CreateScene(other).status().code(), absl::StatusCode::kInvalidArgument);
}

// The build would take longer than the test may.
TEST_F(CoverageServiceTest, CancelsAJob) {
  FakeOptions fake;
  fake.build_time = absl::Hours(24);
  Start(fake);
  v1::UploadPartResponse uploaded;
  ASSERT_TRUE(
      connection_->Upload(EncodePly(MakeBox({0.1f, 0.1f, 0.1f})), "ply", "m", &uploaded).ok());
  v1::SceneSpec spec;
  spec.set_part_digest(uploaded.part_digest());
  const auto job = connection_->CreateScene(spec);
  ASSERT_TRUE(job.ok());
  auto watched = std::async(std::launch::async, [&] { return connection_->Watch(job->job_id()); });
  WaitUntil([&] { return counters_.builds_started > 0; });
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::CancelJobRequest request;
  request.set_job_id(job->job_id());
  v1::CancelJobResponse response;
  ASSERT_TRUE(connection_->jobs->CancelJob(&context, request, &response).ok());
  const auto states = watched.get();
  ASSERT_TRUE(states.ok()) << states.status();
  EXPECT_EQ(states->back().state(), v1::Job::STATE_CANCELLED);
  EXPECT_EQ(counters_.builds_finished, 0);

  grpc::ClientContext get_context;
  Connection::SetTimeout(&get_context);
  v1::GetJobRequest get;
  get.set_job_id("no such job");
  v1::GetJobResponse got;
  const absl::Status unknown = FromGrpcStatus(connection_->jobs->GetJob(&get_context, get, &got));
  EXPECT_EQ(unknown.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ErrorReason(unknown), "JOB_UNKNOWN");
  grpc::ClientContext list_context;
  Connection::SetTimeout(&list_context);
  v1::ListJobsRequest list;
  list.set_kind("scene");
  v1::ListJobsResponse jobs;
  ASSERT_TRUE(connection_->jobs->ListJobs(&list_context, list, &jobs).ok());
  ASSERT_EQ(jobs.jobs_size(), 1);
  EXPECT_EQ(jobs.jobs(0).job_id(), job->job_id());
}

TEST_F(CoverageServiceTest, UnknownDigestsSayWhatToDo) {
  Start();
  v1::SceneSpec spec;
  spec.set_part_digest(std::string(64, 'a'));
  const absl::Status part = connection_->CreateScene(spec).status();
  EXPECT_EQ(part.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ErrorReason(part), "PART_UNKNOWN");
  EXPECT_EQ(ErrorMetadata(part).at("part_digest"), std::string(64, 'a'));
  v1::EvaluateGainsResponse gains;
  const absl::Status scene = connection_->Gains(GainsRequest(std::string(64, 'b'), 1), &gains);
  EXPECT_EQ(scene.code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(ErrorReason(scene), "SCENE_UNKNOWN");
  EXPECT_EQ(ErrorMetadata(scene).at("scene_digest"), std::string(64, 'b'));
  // A terminal would obey what somebody named.
  spec.set_part_digest("\x1b[31m");
  EXPECT_THAT(std::string(connection_->CreateScene(spec).status().message()),
              Not(HasSubstr("\x1b")));
  EXPECT_THAT(std::string(connection_->Gains(GainsRequest("\x1b[31m", 1), &gains).message()),
              HasSubstr("scene '\\x1b[31m' is not on this server"));
}

TEST_F(CoverageServiceTest, ScenesBeyondTheMemoryLimitAreDropped) {
  CoverageServerOptions options;
  options.max_scene_bytes = 80000;  // one takes 1000 * 32 bytes and a little
  Start({}, options);
  const std::string first = connection_->MakeScene({0.1f, 0.1f, 0.1f}, 1);
  connection_->MakeScene({0.1f, 0.1f, 0.1f}, 2);
  v1::EvaluateGainsResponse gains;
  EXPECT_TRUE(connection_->Gains(GainsRequest(first, 1), &gains).ok());
  connection_->MakeScene({0.1f, 0.1f, 0.1f}, 3);
  connection_->MakeScene({0.1f, 0.1f, 0.1f}, 4);
  EXPECT_EQ(ErrorReason(connection_->Gains(GainsRequest(first, 1), &gains)), "SCENE_UNKNOWN");
  EXPECT_EQ(connection_->MakeScene({0.1f, 0.1f, 0.1f}, 1), first);
  EXPECT_TRUE(connection_->Gains(GainsRequest(first, 1), &gains).ok());
}

TEST_F(CoverageServiceTest, UnaryStreamAndSplitBatchesAnswerTheSameBytes) {
  Start();
  const std::string scene = connection_->MakeScene();
  const int count = 333;
  v1::EvaluateGainsRequest whole = GainsRequest(scene, count);
  whole.mutable_measurements(5)->set_camera_distance_m(2);
  whole.mutable_measurements(6)->set_part_gamma_deg(355);
  whole.mutable_measurements(7)->set_offset_y_m(0.48);
  whole.set_covered_targets(std::string(125, '\x55'));
  for (int i = 0; i < 1000; ++i) whole.add_target_weights(0.5f + 0.001f * static_cast<float>(i));
  v1::EvaluateGainsResponse unary;
  ASSERT_TRUE(connection_->Gains(whole, &unary).ok());
  ASSERT_EQ(unary.gains_size(), count);
  EXPECT_EQ(unary.gains(5).feasibility(), v1::FEASIBILITY_OUT_OF_BOUNDS);
  EXPECT_EQ(unary.gains(6).feasibility(), v1::FEASIBILITY_COLLISION);
  EXPECT_EQ(unary.gains(7).feasibility(), v1::FEASIBILITY_TRAVEL);
  for (const int i : {5, 6, 7}) {
    EXPECT_EQ(unary.gains(i).covered_targets(), 0);
    EXPECT_EQ(unary.gains(i).weighted_gain(), 0);
  }
  EXPECT_GT(unary.gains(8).covered_targets(), unary.gains(8).new_targets());
  EXPECT_GT(unary.gains(8).new_targets(), 0);
  EXPECT_GT(unary.gains(8).weighted_gain(), 0);

  for (const int batch : {1, 7, 64, 200}) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    auto stream = connection_->coverage->StreamGains(&context);
    v1::EvaluateGainsResponse joined;
    std::thread reader([&] {
      v1::StreamGainsResponse response;
      while (stream->Read(&response)) joined.MergeFrom(response.response());
    });
    for (int begin = 0; begin < count; begin += batch) {
      v1::StreamGainsRequest request;
      *request.mutable_request() = whole;
      request.mutable_request()->clear_measurements();
      for (int i = begin; i < std::min(count, begin + batch); ++i) {
        *request.mutable_request()->add_measurements() = whole.measurements(i);
      }
      ASSERT_TRUE(stream->Write(request));
    }
    stream->WritesDone();
    reader.join();
    const grpc::Status status = stream->Finish();
    EXPECT_TRUE(status.ok()) << status.error_message();
    EXPECT_EQ(joined.SerializeAsString(), unary.SerializeAsString()) << "batches of " << batch;
  }

  // The engine itself is the reference.
  SceneDefinition definition;
  definition.part = *LoadedBox({0.1f, 0.2f, 0.3f});
  const auto reference = MakeFakeScene(definition, {});
  const TargetBits covered = TargetBits::FromBytes(1000, whole.covered_targets());
  for (const int i : {0, 8, 100, 332}) {
    const Measurement measurement = MeasurementFromProto(whole.measurements(i));
    FastGain gain;
    reference->EvaluateGains({&measurement, 1}, &covered, {whole.target_weights().data(), 1000},
                             {&gain, 1}, nullptr);
    EXPECT_EQ(unary.gains(i).new_targets(), gain.new_targets);
    EXPECT_EQ(unary.gains(i).covered_targets(), gain.covered_targets);
    EXPECT_EQ(unary.gains(i).weighted_gain(), gain.weighted_gain);
  }
}

TEST_F(CoverageServiceTest, ExactGainsCountExactCoverage) {
  Start();
  const std::string scene = connection_->MakeScene();
  v1::EvaluateGainsRequest request = GainsRequest(scene, 20, v1::EVALUATOR_EXACT);
  request.set_covered_targets(std::string(125, '\x0f'));
  for (int i = 0; i < 1000; ++i) request.add_target_weights(2);
  v1::EvaluateGainsResponse gains;
  ASSERT_TRUE(connection_->Gains(request, &gains).ok());
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  v1::EvaluateCoverageRequest coverage_request;
  coverage_request.set_scene_digest(scene);
  coverage_request.set_evaluator(v1::EVALUATOR_EXACT);
  *coverage_request.mutable_measurements() = request.measurements();
  coverage_request.mutable_measurements(3)->set_offset_z_m(0.41);
  v1::EvaluateCoverageResponse coverage;
  const grpc::Status status =
      connection_->coverage->EvaluateCoverage(&context, coverage_request, &coverage);
  ASSERT_TRUE(status.ok()) << status.error_message();
  const TargetBits covered = TargetBits::FromBytes(1000, request.covered_targets());
  TargetBits measurable(1000);
  for (size_t i = 0; i < 1000; ++i) {
    if (i % 10 != 0) measurable.Set(i);
  }
  ASSERT_EQ(coverage.coverages_size(), 20);
  for (int i = 0; i < 20; ++i) {
    TargetBits bits = TargetBits::FromBytes(1000, coverage.coverages(i).covered_targets());
    if (i == 3) {
      EXPECT_EQ(coverage.coverages(i).feasibility(), v1::FEASIBILITY_OUT_OF_BOUNDS);
      EXPECT_EQ(bits.Count(), 0);
      continue;
    }
    EXPECT_EQ(coverage.coverages(i).measurement_points(), bits.Count());
    bits &= measurable;
    EXPECT_EQ(gains.gains(i).covered_targets(), bits.Count());
    EXPECT_EQ(gains.gains(i).new_targets(), bits.CountNotIn(covered));
    EXPECT_EQ(gains.gains(i).weighted_gain(), 2.0 * gains.gains(i).new_targets());
    EXPECT_EQ(coverage.coverages(i).first_frame(), -5);
  }
}

TEST_F(CoverageServiceTest, RefusesMalformedQueries) {
  Start();
  const std::string scene = connection_->MakeScene();
  v1::EvaluateGainsResponse response;
  const auto field = [&](const v1::EvaluateGainsRequest& request) {
    const absl::Status status = connection_->Gains(request, &response);
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    const auto violations = FieldViolations(status);
    return violations.empty() ? "" : violations[0].field;
  };
  v1::EvaluateGainsRequest request = GainsRequest(scene, 3);
  request.mutable_measurements(2)->set_offset_z_m(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(field(request), "measurements[2].offset_z_m");
  // As many violations as there can be still fit into the trailers.
  request = GainsRequest(scene, 4096);
  for (auto& measurement : *request.mutable_measurements()) {
    measurement.set_triangulation_angle_deg(std::numeric_limits<double>::infinity());
  }
  EXPECT_EQ(field(request), "measurements[0].triangulation_angle_deg");
  request = GainsRequest(scene, 1);
  request.set_covered_targets(std::string(124, 'x'));
  EXPECT_EQ(field(request), "covered_targets");
  request = GainsRequest(scene, 1);
  request.add_target_weights(1);
  EXPECT_EQ(field(request), "target_weights");
  for (int i = 1; i < 1000; ++i) request.add_target_weights(i == 500 ? -1 : 1);
  EXPECT_EQ(field(request), "target_weights[500]");
  EXPECT_EQ(field(GainsRequest(scene, 1, v1::EVALUATOR_UNSPECIFIED)), "evaluator");
  EXPECT_EQ(field(GainsRequest(scene, 4097)), "measurements");
  EXPECT_TRUE(connection_->Gains(GainsRequest(scene, 4096), &response).ok());
  EXPECT_EQ(response.gains_size(), 4096);
  EXPECT_TRUE(connection_->Gains(GainsRequest(scene, 0), &response).ok());
  EXPECT_EQ(response.gains_size(), 0);
}

TEST_F(CoverageServiceTest, ExplainsTargetsOfScenesWithADomain) {
  Start();
  v1::ExplainTargetsRequest request;
  v1::ExplainTargetsResponse response;
  const auto explain = [&] {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    return FromGrpcStatus(connection_->coverage->ExplainTargets(&context, request, &response));
  };
  request.set_scene_digest(std::string(64, '0'));
  EXPECT_EQ(ErrorReason(explain()), "SCENE_UNKNOWN");

  const std::string without_domain = connection_->MakeScene();
  request.set_scene_digest(without_domain);
  request.add_targets(0);
  const absl::Status refused = explain();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition) << refused;
  EXPECT_EQ(ErrorReason(refused), "SCENE_WITHOUT_DOMAIN");

  v1::SceneSpec spec = connection_->UploadBox();
  spec.mutable_measurement()->mutable_camera_polar_deg()->set_fixed(30);
  const std::string scene = connection_->MakeScene(spec);
  EXPECT_NE(scene, without_domain);
  request.set_scene_digest(scene);
  request.clear_targets();
  // Every tenth target of the stand-in cannot be measured.
  for (const uint32_t target : {11u, 10u, 999u, 20u, 11u}) request.add_targets(target);
  ASSERT_TRUE(explain().ok());
  ASSERT_EQ(response.explanations_size(), 5);
  for (const int i : {0, 2, 4}) {
    EXPECT_EQ(response.explanations(i).reason(), v1::UNCOVERED_REASON_NOT_CHOSEN);
  }
  for (const int i : {1, 3}) {
    EXPECT_EQ(response.explanations(i).reason(), v1::UNCOVERED_REASON_OWN_OCCLUSION);
    EXPECT_EQ(response.explanations(i).obstacle(), -1);
    EXPECT_EQ(response.explanations(i).tried_scans(), 10);
    EXPECT_EQ(response.explanations(i).scans_with_reason(), 5);
  }
  request.clear_targets();
  ASSERT_TRUE(explain().ok());
  EXPECT_EQ(response.explanations_size(), 0);

  const auto field = [&] {
    const absl::Status status = explain();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << status;
    const auto violations = FieldViolations(status);
    return violations.empty() ? "" : violations[0].field;
  };
  request.add_targets(5);
  request.add_targets(1000);
  EXPECT_EQ(field(), "targets[1]");
  request.mutable_targets()->Resize(100001, 0);
  EXPECT_EQ(field(), "targets");

  spec.mutable_measurement()->mutable_camera_polar_deg()->set_fixed(130);
  EXPECT_EQ(connection_->CreateScene(spec).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(CoverageServiceTest, RefusesMalformedQueriesAboutUncertainty) {
  Start();
  const std::string coverage_only = connection_->MakeScene();
  v1::EvaluateGainsResponse response;
  v1::EvaluateGainsRequest request = GainsRequest(coverage_only, 2);
  v1::UncertaintyGain& gain = *request.mutable_uncertainty_gain();
  gain.mutable_weights()->set_admissible(1);
  gain.add_admissible_uncertainty_m(5e-5f);
  absl::Status status = connection_->Gains(request, &response);
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_EQ(ErrorReason(status), "SCENE_WITHOUT_UNCERTAINTY");
  v1::EvaluateUncertaintyRequest asked;
  asked.set_scene_digest(coverage_only);
  const auto uncertainty = [&] {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    auto reader = connection_->coverage->EvaluateUncertainty(&context, asked);
    v1::EvaluateUncertaintyResponse chunk;
    while (reader->Read(&chunk)) {
    }
    return FromGrpcStatus(reader->Finish());
  };
  EXPECT_EQ(uncertainty().code(), absl::StatusCode::kFailedPrecondition);

  v1::SceneSpec spec = connection_->UploadBox();
  spec.mutable_uncertainty()->mutable_line_detection()->set_standard_deviation_px(0.2);
  const std::string scene = connection_->MakeScene(spec);
  EXPECT_NE(scene, coverage_only);
  request.set_scene_digest(scene);
  EXPECT_TRUE(connection_->Gains(request, &response).ok());
  const auto field = [&] {
    const absl::Status refused = connection_->Gains(request, &response);
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument) << refused;
    const auto violations = FieldViolations(refused);
    return violations.empty() ? "" : violations[0].field;
  };
  request.set_evaluator(v1::EVALUATOR_EXACT);
  EXPECT_EQ(field(), "evaluator");
  request.set_evaluator(v1::EVALUATOR_FAST);
  gain.mutable_weights()->set_relaxed(-1);
  EXPECT_EQ(field(), "uncertainty_gain.weights.relaxed");
  gain.mutable_weights()->Clear();
  EXPECT_EQ(field(), "uncertainty_gain.weights");
  gain.mutable_weights()->set_information(1);
  gain.add_admissible_uncertainty_m(5e-5f);
  EXPECT_EQ(field(), "uncertainty_gain.admissible_uncertainty_m");
  gain.mutable_admissible_uncertainty_m()->Resize(1, 0);
  gain.mutable_known_information_per_m4()->Resize(1000, 0);
  gain.set_known_information_per_m4(77, std::numeric_limits<float>::infinity());
  EXPECT_EQ(field(), "uncertainty_gain.known_information_per_m4[77]");
  gain.set_known_information_per_m4(77, 1);
  gain.set_relaxed_uncertainty_m(-1);
  EXPECT_EQ(field(), "uncertainty_gain.relaxed_uncertainty_m");

  asked.set_scene_digest(scene);
  asked.add_targets(1000);
  status = uncertainty();
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(FieldViolations(status)[0].field, "targets[0]");
  asked.clear_targets();
  for (int i = 0; i < 257; ++i) *asked.add_measurements() = request.measurements(0);
  EXPECT_EQ(FieldViolations(uncertainty())[0].field, "measurements");

  spec.mutable_uncertainty()->set_resolution_m(-1);
  v1::CreateSceneRequest create;
  *create.mutable_spec() = spec;
  v1::CreateSceneResponse created;
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  status = FromGrpcStatus(connection_->coverage->CreateScene(&context, create, &created));
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(FieldViolations(status)[0].field, "spec.uncertainty");
}

TEST_F(CoverageServiceTest, StreamsTargetsAndPointsInChunksAndRendersViews) {
  FakeOptions fake;
  fake.targets = 40000;
  Start(fake);
  const std::string scene = connection_->MakeScene();
  {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::StreamTargetsRequest request;
    request.set_scene_digest(scene);
    auto reader = connection_->coverage->StreamTargets(&context, request);
    v1::StreamTargetsResponse response;
    int messages = 0;
    int targets = 0;
    int measurable = 0;
    while (reader->Read(&response)) {
      ++messages;
      EXPECT_LT(response.ByteSizeLong(), 1u << 20);
      EXPECT_EQ(response.positions_m_size(), 3 * response.regions_size());
      for (int i = 0; i < response.measurable_size(); ++i) measurable += response.measurable(i);
      targets += response.measurable_size();
    }
    EXPECT_TRUE(reader->Finish().ok());
    EXPECT_GT(messages, 1);
    EXPECT_EQ(targets, 40000);
    EXPECT_EQ(measurable, 36000);
  }
  const auto points = [&](const v1::Measurement& measurement, int* count) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::StreamMeasurementPointsRequest request;
    request.set_scene_digest(scene);
    *request.mutable_measurement() = measurement;
    auto reader = connection_->coverage->StreamMeasurementPoints(&context, request);
    v1::StreamMeasurementPointsResponse response;
    *count = 0;
    while (reader->Read(&response)) {
      EXPECT_LT(response.ByteSizeLong(), 1u << 20);
      *count += response.frames_size();
    }
    return FromGrpcStatus(reader->Finish());
  };
  int count = 0;
  ASSERT_TRUE(points(MakeMeasurement(1), &count).ok());
  EXPECT_GT(count, 10000);
  v1::Measurement collision = MakeMeasurement(1);
  collision.set_part_gamma_deg(355);
  const absl::Status infeasible = points(collision, &count);
  EXPECT_EQ(infeasible.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(ErrorMetadata(infeasible).at("feasibility"), "FEASIBILITY_COLLISION");
  v1::Measurement outside = MakeMeasurement(1);
  outside.set_camera_distance_m(3);
  EXPECT_EQ(points(outside, &count).code(), absl::StatusCode::kInvalidArgument);

  const auto view = [&](v1::RenderViewRequest request, v1::RenderViewResponse* response) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    request.set_scene_digest(scene);
    return FromGrpcStatus(connection_->coverage->RenderView(&context, request, response));
  };
  v1::RenderViewRequest request;
  v1::RenderViewResponse png;
  request.set_view(v1::RenderViewRequest::VIEW_COVERAGE);
  request.set_rows_px(100);
  request.set_covered_targets(std::string(5000, '\xff'));
  ASSERT_TRUE(view(request, &png).ok());
  EXPECT_EQ(png.png(), "\x89PNG fake 800x100 covered 40000");
  request.set_columns_px(15);
  EXPECT_EQ(FieldViolations(view(request, &png))[0].field, "columns_px");
  request = {};
  request.set_view(v1::RenderViewRequest::VIEW_CAMERA);
  EXPECT_EQ(FieldViolations(view(request, &png))[0].field, "measurement");
}

TEST_F(CoverageServiceTest, DeadlineStopsTheWork) {
  FakeOptions fake;
  fake.query_time = absl::Milliseconds(50);
  Start(fake);
  const std::string scene = connection_->MakeScene();
  for (const v1::Evaluator evaluator : {v1::EVALUATOR_FAST, v1::EVALUATOR_EXACT}) {
    const int before = counters_.queries_started;
    v1::EvaluateGainsResponse response;
    const absl::Status status =
        connection_->Gains(GainsRequest(scene, 1000, evaluator), &response,
                           std::chrono::system_clock::now() + std::chrono::milliseconds(120));
    EXPECT_EQ(status.code(), absl::StatusCode::kDeadlineExceeded) << status;
    // No query runs or begins for twice the time of one.
    WaitUntil([&] {
      const int started = counters_.queries_started;
      absl::SleepFor(2 * fake.query_time);
      return counters_.queries_running == 0 && counters_.queries_started == started;
    });
    EXPECT_LT(counters_.queries_started - before, 500);
  }
}

// The queries would take longer than the test may.
TEST_F(CoverageServiceTest, CancellationStopsTheWork) {
  FakeOptions fake;
  fake.query_time = absl::Hours(24);
  Start(fake);
  const std::string scene = connection_->MakeScene();
  for (const bool streamed : {false, true}) {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    auto call = std::async(std::launch::async, [&] {
      if (!streamed) {
        v1::EvaluateGainsResponse response;
        return FromGrpcStatus(
            connection_->coverage->EvaluateGains(&context, GainsRequest(scene, 100), &response));
      }
      auto stream = connection_->coverage->StreamGains(&context);
      v1::StreamGainsRequest request;
      *request.mutable_request() = GainsRequest(scene, 100);
      stream->Write(request);
      v1::StreamGainsResponse response;
      while (stream->Read(&response)) {
      }
      return FromGrpcStatus(stream->Finish());
    });
    WaitUntil([&] { return counters_.queries_running > 0; });
    context.TryCancel();
    EXPECT_EQ(call.get().code(), absl::StatusCode::kCancelled);
    WaitUntil([&] { return counters_.queries_running == 0; });
    EXPECT_EQ(counters_.queries_finished, 0);
  }
}

// gRPC's own health and reflection messages have no headers in the package: by hand.
std::string GenericUnary(const std::shared_ptr<grpc::Channel>& channel, const std::string& method,
                         const std::string& request_bytes, bool streaming) {
  grpc::GenericStub stub(channel);
  grpc::ClientContext context;
  Connection::SetTimeout(&context);
  grpc::CompletionQueue queue;
  auto call = stub.PrepareCall(&context, method, &queue);
  void* tag = nullptr;
  bool ok = false;
  call->StartCall(nullptr);
  queue.Next(&tag, &ok);
  grpc::Slice slice(request_bytes);
  call->Write(grpc::ByteBuffer(&slice, 1), nullptr);
  queue.Next(&tag, &ok);
  if (!streaming) {
    call->WritesDone(nullptr);
    queue.Next(&tag, &ok);
  }
  grpc::ByteBuffer buffer;
  call->Read(&buffer, nullptr);
  queue.Next(&tag, &ok);
  std::string bytes;
  if (ok) {
    std::vector<grpc::Slice> slices;
    buffer.Dump(&slices);
    for (const grpc::Slice& part : slices) {
      bytes.append(reinterpret_cast<const char*>(part.begin()), part.size());
    }
  }
  if (streaming) {
    call->WritesDone(nullptr);
    queue.Next(&tag, &ok);
  }
  grpc::Status status;
  call->Finish(&status, nullptr);
  queue.Next(&tag, &ok);
  EXPECT_TRUE(status.ok()) << method << ": " << status.error_message();
  return bytes;
}

TEST_F(CoverageServiceTest, HealthAndReflectionRespond) {
  std::atomic<bool> hold = false;
  FakeOptions fake;
  fake.hold = &hold;
  Start(fake);
  const std::string service = "sightline.v1.CoverageService";
  const std::string health_request =
      std::string("\x0a") + static_cast<char>(service.size()) + service;
  const std::string serving = "\x08\x01";
  const std::string not_serving = "\x08\x02";
  EXPECT_EQ(GenericUnary(connection_->channel, "/grpc.health.v1.Health/Check", "", false), serving);
  EXPECT_EQ(
      GenericUnary(connection_->channel, "/grpc.health.v1.Health/Check", health_request, false),
      serving);
  const std::string list_services("\x3a\x01*", 3);  // ServerReflectionRequest.list_services
  const std::string reflected = GenericUnary(
      connection_->channel, "/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo",
      list_services, true);
  EXPECT_THAT(reflected, HasSubstr("sightline.v1.CoverageService"));
  EXPECT_THAT(reflected, HasSubstr("sightline.v1.JobService"));

  // While draining: NOT_SERVING, new calls refused, the running one finishes.
  const std::string scene = connection_->MakeScene();
  hold = true;
  auto running = std::async(std::launch::async, [&] {
    v1::EvaluateGainsResponse response;
    return connection_->Gains(GainsRequest(scene, 1), &response);
  });
  WaitUntil([&] { return counters_.queries_running > 0; });
  auto drained = std::async(std::launch::async, [&] { return server_->Drain(absl::Hours(24)); });
  std::string health = serving;
  while (health == serving) {
    health = GenericUnary(connection_->channel, "/grpc.health.v1.Health/Check", "", false);
  }
  EXPECT_EQ(health, not_serving);
  EXPECT_EQ(
      GenericUnary(connection_->channel, "/grpc.health.v1.Health/Check", health_request, false),
      not_serving);
  v1::EvaluateGainsResponse response;
  absl::Status refused;
  while ((refused = connection_->Gains(GainsRequest(scene, 0), &response)).ok()) {
  }
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ErrorReason(refused), "DRAINING");
  EXPECT_TRUE(RetryDelay(refused).has_value());
  hold = false;
  const absl::Status finished = running.get();
  EXPECT_TRUE(finished.ok()) << finished;
  EXPECT_TRUE(drained.get());
}

TEST_F(CoverageServiceTest, DrainCancelsWhatDoesNotFinishInTime) {
  FakeOptions fake;
  fake.query_time = absl::Hours(24);
  Start(fake);
  const std::string scene = connection_->MakeScene();
  auto running = std::async(std::launch::async, [&] {
    v1::EvaluateGainsResponse response;
    return connection_->Gains(GainsRequest(scene, 1), &response);
  });
  WaitUntil([&] { return counters_.queries_running > 0; });
  EXPECT_FALSE(server_->Drain(absl::Milliseconds(100)));
  EXPECT_EQ(running.get().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(counters_.queries_finished, 0);
}

std::string HttpGet(int port, const std::string& path) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons(static_cast<uint16_t>(port));
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  EXPECT_EQ(connect(fd, reinterpret_cast<sockaddr*>(&address), sizeof(address)), 0);
  const std::string request = "GET " + path + " HTTP/1.0\r\n\r\n";
  EXPECT_EQ(write(fd, request.data(), request.size()), static_cast<ssize_t>(request.size()));
  std::string answer;
  char buffer[4096];
  ssize_t got = 0;
  while ((got = read(fd, buffer, sizeof(buffer))) > 0) answer.append(buffer, got);
  close(fd);
  return answer;
}

TEST_F(CoverageServiceTest, ServesMetrics) {
  CoverageServerOptions options;
  options.metrics_host = "127.0.0.1";
  options.metrics_port = 0;
  Start({}, options);
  ASSERT_GT(server_->metrics_port(), 0);
  const std::string scene = connection_->MakeScene();
  v1::EvaluateGainsResponse response;
  ASSERT_TRUE(connection_->Gains(GainsRequest(scene, 70), &response).ok());
  ASSERT_FALSE(connection_->Gains(GainsRequest("x", 70), &response).ok());
  const std::string metrics = HttpGet(server_->metrics_port(), "/metrics");
  for (const std::string line :
       {"sightline_requests_total{code=\"OK\",method=\"EvaluateGains\"} 1",
        "sightline_requests_total{code=\"NOT_FOUND\",method=\"EvaluateGains\"} 1",
        "sightline_queries_total{evaluator=\"fast\"} 70",
        "sightline_request_seconds_count{method=\"EvaluateGains\"} 2", "sightline_scenes 1",
        "sightline_parts 1", "sightline_in_flight_requests 0"}) {
    EXPECT_THAT(metrics, HasSubstr(line));
  }
}

TEST_F(CoverageServiceTest, TakenAddressesAreErrors) {
  Start();
  CoverageServerOptions options;
  options.listen = server_->address();
  const auto second = CoverageServer::Start(options, MakeFakeBackend({}));
  EXPECT_EQ(second.status().code(), absl::StatusCode::kUnavailable) << second.status();
  TemporaryFolder folder;
  options.listen = "unix:" + folder.path() + "/s";
  const auto third = CoverageServer::Start(options, MakeFakeBackend({}));
  ASSERT_TRUE(third.ok()) << third.status();
  EXPECT_EQ(CoverageServer::Start(options, MakeFakeBackend({})).status().code(),
            absl::StatusCode::kUnavailable);
  for (const std::string wrong : {"", "nonsense", "host:99999", ":1", "unix:"}) {
    options.listen = wrong;
    EXPECT_EQ(CoverageServer::Start(options, MakeFakeBackend({})).status().code(),
              absl::StatusCode::kInvalidArgument)
        << wrong;
  }
}

CoverageTask TaskOf(const Eigen::Vector3f& size_m, int64_t seed = 1) {
  CoverageTask task;
  task.part = LoadedBox(size_m);
  task.sampling.seed = seed;
  return task;
}

std::vector<int64_t> Numbers(const std::vector<ScanGain>& gains) {
  std::vector<int64_t> numbers;
  for (const ScanGain& gain : gains) {
    numbers.push_back(static_cast<int64_t>(gain.feasibility));
    numbers.push_back(gain.new_targets);
    numbers.push_back(gain.covered_targets);
    numbers.push_back(static_cast<int64_t>(gain.weighted_gain * 1e6));
  }
  return numbers;
}

TEST_F(CoverageServiceTest, ClientAnswersDoNotDependOnBatches) {
  FakeOptions fake;
  fake.build_time = absl::Milliseconds(40);
  Start(fake);
  std::vector<double> progress;
  CoverageClientOptions options;
  options.address = server_->address();
  options.on_progress = [&](double value, const std::string&) { progress.push_back(value); };
  auto client = CoverageClient::Open(options, TaskOf({0.1f, 0.2f, 0.3f}));
  ASSERT_TRUE(client.ok()) << client.status();
  EXPECT_GE(progress.size(), 3u);
  EXPECT_EQ(progress.back(), 1);
  EXPECT_EQ((*client)->scene().target_count, 1000);
  EXPECT_EQ((*client)->targets().size(), 1000u);
  EXPECT_EQ((*client)->measurable().Count(), 900);
  const std::vector<Measurement> measurements = Measurements(500);
  TargetBits covered(1000);
  std::vector<float> known(1000, 0);
  for (size_t i = 0; i < 1000; i += 3) {
    covered.Set(i);
    known[i] = 1;
  }
  const auto gains = (*client)->Gains(measurements, known);
  ASSERT_TRUE(gains.ok()) << gains.status();
  ASSERT_EQ(gains->size(), 500u);
  std::vector<float> weights(1000);
  for (size_t i = 0; i < 1000; ++i) weights[i] = 0.001f * static_cast<float>(i);
  const auto weighted = (*client)->WeightedGains(measurements, weights);
  ASSERT_TRUE(weighted.ok()) << weighted.status();
  EXPECT_GT((*weighted)[0].weighted_gain, 0);
  EXPECT_EQ((*client)->evaluations(), 1000);

  options.min_batch = 1;
  options.max_batch = 3;
  options.outstanding_requests = 4;
  auto other = CoverageClient::Open(options, TaskOf({0.1f, 0.2f, 0.3f}));
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_EQ(counters_.builds_started, 1);
  EXPECT_EQ(Numbers(*(*other)->Gains(measurements, known)), Numbers(*gains));
  EXPECT_EQ(Numbers(*(*other)->WeightedGains(measurements, weights)), Numbers(*weighted));
  const auto fast = (*client)->FastCoverage(measurements);
  const auto split = (*other)->FastCoverage(measurements);
  ASSERT_TRUE(fast.ok() && split.ok());
  for (size_t i = 0; i < measurements.size(); ++i) {
    EXPECT_EQ((*fast)[i].covered, (*split)[i].covered);
    EXPECT_EQ((*fast)[i].covered.Count(), (*gains)[i].covered_targets);
    EXPECT_EQ((*fast)[i].covered.CountNotIn(covered), (*gains)[i].new_targets);
  }
  const auto exact = (*client)->ExactCoverage(std::span(measurements).first(20));
  ASSERT_TRUE(exact.ok()) << exact.status();
  for (const ScanCoverage& scan : *exact) {
    EXPECT_EQ(scan.covered.CountNotIn((*client)->measurable()), 0);
    EXPECT_EQ(scan.covered.CountNotIn(scan.covered_without_normal_gate), 0);
    EXPECT_EQ(scan.first_frame, -5);
  }
  const auto points = (*client)->MeasurementPoints(measurements[0]);
  ASSERT_TRUE(points.ok()) << points.status();
  EXPECT_EQ(static_cast<int64_t>(points->size()), (*exact)[0].measurement_points);
  v1::RenderViewRequest view;
  view.set_view(v1::RenderViewRequest::VIEW_FREE);
  EXPECT_THAT(*(*client)->RenderView(view), HasSubstr("800x600"));
  EXPECT_EQ((*client)->Gains({}, known)->size(), 0u);
}

TEST_F(CoverageServiceTest, TwoClientsWithDifferentParts) {
  TemporaryFolder folder;
  CoverageServerOptions options;
  options.listen = "unix:" + folder.path() + "/s";
  Start({}, options);
  const auto run = [&](int64_t seed) {
    CoverageClientOptions client_options;
    client_options.address = server_->address();
    auto client = CoverageClient::Open(client_options,
                                       TaskOf({0.1f, 0.2f, 0.1f * static_cast<float>(seed)}, seed));
    EXPECT_TRUE(client.ok()) << client.status();
    std::vector<int64_t> all;
    if (!client.ok()) return all;
    for (int round = 0; round < 20; ++round) {
      const auto gains = (*client)->Gains(Measurements(300), std::vector<float>(1000));
      EXPECT_TRUE(gains.ok()) << gains.status();
      if (!gains.ok()) return all;
      const auto numbers = Numbers(*gains);
      all.insert(all.end(), numbers.begin(), numbers.end());
    }
    return all;
  };
  auto first = std::async(std::launch::async, run, 1);
  auto second = std::async(std::launch::async, run, 5);
  const auto first_gains = first.get();
  const auto second_gains = second.get();
  EXPECT_NE(first_gains, second_gains);
  // Alone they get the same.
  EXPECT_EQ(run(1), first_gains);
  EXPECT_EQ(run(5), second_gains);
}

TEST_F(CoverageServiceTest, ClientMakesTheSceneAgainWhenTheServerHasDroppedIt) {
  CoverageServerOptions options;
  options.max_scene_bytes = 50000;
  options.max_part_store_bytes = 300;  // one box
  Start({}, options);
  CoverageClientOptions client_options;
  client_options.address = server_->address();
  auto first = CoverageClient::Open(client_options, TaskOf({0.1f, 0.2f, 0.3f}));
  ASSERT_TRUE(first.ok()) << first.status();
  const auto before = (*first)->Gains(Measurements(100), std::vector<float>(1000));
  auto second = CoverageClient::Open(client_options, TaskOf({0.3f, 0.2f, 0.3f}));
  ASSERT_TRUE(second.ok()) << second.status();
  const auto after = (*first)->Gains(Measurements(100), std::vector<float>(1000));
  ASSERT_TRUE(before.ok() && after.ok()) << before.status() << after.status();
  EXPECT_EQ(Numbers(*before), Numbers(*after));
  EXPECT_EQ((*first)->recoveries(), 1);
}

TEST_F(CoverageServiceTest, ClientReportsWhatCannotBeHelped) {
  FakeOptions fake;
  fake.build_time = absl::Hours(24);
  Start(fake);
  CoverageClientOptions options;
  options.address = server_->address();
  std::atomic<bool> interrupted = false;
  options.interrupted = &interrupted;
  auto opened = std::async(std::launch::async, [&] {
    return CoverageClient::Open(options, TaskOf({0.1f, 0.1f, 0.1f}));
  });
  WaitUntil([&] { return counters_.builds_started > 0; });
  interrupted = true;
  EXPECT_EQ(opened.get().status().code(), absl::StatusCode::kCancelled);
  // The build was stopped as well: another scene can be built at once (it would wait otherwise).
  WaitUntil([&] {
    grpc::ClientContext context;
    Connection::SetTimeout(&context);
    v1::ListJobsResponse jobs;
    EXPECT_TRUE(connection_->jobs->ListJobs(&context, {}, &jobs).ok());
    return jobs.jobs_size() == 1 && jobs.jobs(0).state() == v1::Job::STATE_CANCELLED;
  });

  CoverageClientOptions nobody;
  nobody.address = "unix:/nonexistent/socket";
  nobody.retry_for = absl::Milliseconds(200);
  const auto unreachable = CoverageClient::Open(nobody, TaskOf({0.1f, 0.1f, 0.1f}));
  EXPECT_EQ(unreachable.status().code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(unreachable.status().message()), HasSubstr("/nonexistent/socket"));
}

}  // namespace
}  // namespace sightline
