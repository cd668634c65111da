// SPDX-License-Identifier: Apache-2.0
// The pieces of the service, each alone.
#include <gmock/gmock.h>
#include <grpcpp/support/status.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <set>
#include <thread>

#include "core/memo/lru_store.h"
#include "coverage_server/service/evaluation_pool.h"
#include "coverage_server/service/query_validation.h"
#include "coverage_server/service/scene_spec.h"
#include "google/rpc/error_details.pb.h"
#include "google/rpc/status.pb.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

absl::Status Ok() { return absl::OkStatus(); }

TEST(RpcStatus, CarriesAllDetailsThereAndBack) {
  absl::Status status = InvalidFields(
      {{"measurements[3].offset_y_m", "nan: must be finite"}, {"evaluator", "must be given"}});
  status = WithRetryDelay(status, absl::Milliseconds(1500));
  const absl::Status back = FromGrpcStatus(ToGrpcStatus(status));
  EXPECT_EQ(back.code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(back.message(), status.message());
  EXPECT_EQ(ErrorReason(back), "INVALID_FIELD");
  EXPECT_EQ(RetryDelay(back), absl::Milliseconds(1500));
  EXPECT_THAT(FieldViolations(back),
              ElementsAre(FieldViolation{"measurements[3].offset_y_m", "nan: must be finite"},
                          FieldViolation{"evaluator", "must be given"}));

  const absl::Status unknown = FromGrpcStatus(ToGrpcStatus(
      WithErrorInfo(absl::NotFoundError("no"), kReasonPartUnknown, {{"part_digest", "abc"}})));
  EXPECT_EQ(ErrorReason(unknown), "PART_UNKNOWN");
  EXPECT_EQ(ErrorMetadata(unknown).at("part_digest"), "abc");
}

// Libraries of other languages expect this form in grpc-status-details-bin.
TEST(RpcStatus, WireFormIsGoogleRpcStatus) {
  const grpc::Status status = ToGrpcStatus(absl::UnavailableError("later"));
  google::rpc::Status message;
  ASSERT_TRUE(message.ParseFromString(status.error_details()));
  EXPECT_EQ(message.code(), 14);
  EXPECT_EQ(message.message(), "later");
  ASSERT_EQ(message.details_size(), 1);
  EXPECT_EQ(message.details(0).type_url(), "type.googleapis.com/google.rpc.ErrorInfo");
  google::rpc::ErrorInfo info;
  ASSERT_TRUE(message.details(0).UnpackTo(&info));
  EXPECT_EQ(info.domain(), "sightline");
  EXPECT_EQ(info.reason(), "UNAVAILABLE");
}

TEST(RpcStatus, StaysWithinTrailerLimitsAndUtf8) {
  std::vector<FieldViolation> many(5000, {std::string(5000, 'f'), std::string(5000, 'd')});
  const grpc::Status large = ToGrpcStatus(InvalidFields(many));
  EXPECT_LT(large.error_details().size() + large.error_message().size(), 8192u);
  const grpc::Status binary = ToGrpcStatus(absl::InvalidArgumentError("bad \xff\xfe name"));
  EXPECT_EQ(binary.error_message(), "bad \\xff\\xfe name");
  const grpc::Status umlaut = ToGrpcStatus(absl::InvalidArgumentError("Zylinderkopf für"));
  EXPECT_EQ(umlaut.error_message(), "Zylinderkopf für");
}

TEST(LruStore, DropsTheLongestUnusedFirst) {
  LruStore<int> store(100);
  ASSERT_TRUE(store.Put("a", std::make_shared<int>(1), 40).ok());
  ASSERT_TRUE(store.Put("b", std::make_shared<int>(2), 40).ok());
  ASSERT_NE(store.Get("a"), nullptr);  // now b is the older one
  ASSERT_TRUE(store.Put("c", std::make_shared<int>(3), 40).ok());
  EXPECT_EQ(store.Get("b"), nullptr);
  ASSERT_NE(store.Get("a"), nullptr);
  EXPECT_EQ(*store.Get("c"), 3);
  EXPECT_EQ(store.bytes(), 80);
  EXPECT_EQ(store.Put("d", std::make_shared<int>(4), 101).code(),
            absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(store.count(), 2);
  ASSERT_TRUE(store.Put("e", std::make_shared<int>(5), 100).ok());
  EXPECT_EQ(store.count(), 1);
  ASSERT_TRUE(store.Put("e", std::make_shared<int>(6), 50).ok());
  EXPECT_EQ(store.bytes(), 50);
}

TEST(EvaluationPool, RunsEveryItemOnceOnItsThreads) {
  EvaluationPool pool(3, 10);
  std::vector<std::atomic<int>> seen(1000);
  std::mutex mutex;
  std::set<std::thread::id> threads;
  ASSERT_TRUE(pool.Run(seen.size(), 7, Ok,
                       [&](size_t begin, size_t end, const std::atomic<bool>&) {
                         EXPECT_LE(end - begin, 7u);
                         for (size_t i = begin; i < end; ++i) ++seen[i];
                         std::lock_guard lock(mutex);
                         threads.insert(std::this_thread::get_id());
                       })
                  .ok());
  for (const auto& count : seen) EXPECT_EQ(count, 1);
  EXPECT_LE(threads.size(), 3u);
  EXPECT_EQ(threads.count(std::this_thread::get_id()), 0u);
  EXPECT_TRUE(pool.Run(0, 1, Ok, [](size_t, size_t, const std::atomic<bool>&) { FAIL(); }).ok());
}

TEST(EvaluationPool, StopsSoonAfterTheCallerWantsTo) {
  EvaluationPool pool(2, 10);
  std::atomic<int> chunks = 0;
  const absl::Status status = pool.Run(
      1000, 1, [&] { return chunks == 2 ? absl::CancelledError("enough") : absl::OkStatus(); },
      [&](size_t, size_t, const std::atomic<bool>& cancelled) {
        ++chunks;
        while (!cancelled) std::this_thread::yield();
      });
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(chunks, 2);
}

TEST(EvaluationPool, SharesThreadsBetweenBatches) {
  EvaluationPool pool(1, 10);
  // The long batch would take longer than the test may.
  std::atomic<bool> long_started = false, short_done = false;
  std::thread other([&] {
    const absl::Status stopped = pool.Run(
        100'000'000, 1,
        [&] { return short_done ? absl::CancelledError("enough") : absl::OkStatus(); },
        [&](size_t, size_t, const std::atomic<bool>&) {
          long_started = true;
          std::this_thread::sleep_for(std::chrono::milliseconds(5));
        });
    EXPECT_TRUE(absl::IsCancelled(stopped)) << stopped;
  });
  while (!long_started) std::this_thread::yield();
  EXPECT_TRUE(pool.Run(1, 1, Ok, [](size_t, size_t, const std::atomic<bool>&) {}).ok());
  short_done = true;
  other.join();
}

TEST(EvaluationPool, RefusesWhenTooManyWaitAndReportsExceptions) {
  EvaluationPool pool(1, 1);
  std::atomic<bool> release = false;
  std::atomic<bool> started = false;
  std::thread first([&] {
    EXPECT_TRUE(pool.Run(1, 1, Ok,
                         [&](size_t, size_t, const std::atomic<bool>&) {
                           started = true;
                           while (!release) std::this_thread::yield();
                         })
                    .ok());
  });
  while (!started) std::this_thread::yield();
  const absl::Status refused =
      pool.Run(1, 1, Ok, [](size_t, size_t, const std::atomic<bool>&) { FAIL(); });
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(ErrorReason(refused), "OVERLOADED");
  EXPECT_TRUE(RetryDelay(refused).has_value());
  release = true;
  first.join();
  EXPECT_EQ(
      pool.Run(3, 1, Ok,
               [](size_t, size_t, const std::atomic<bool>&) { throw std::runtime_error("broken"); })
          .code(),
      absl::StatusCode::kInternal);
}

v1::SceneSpec MinimalSpec() {
  v1::SceneSpec spec;
  spec.set_part_digest(std::string(64, 'a'));
  return spec;
}

TEST(SceneSpec, DefaultsWrittenOutHaveTheSameDigest) {
  const auto minimal = ParseSceneSpec(MinimalSpec());
  ASSERT_TRUE(minimal.ok()) << minimal.status();
  EXPECT_EQ(minimal->digest.size(), 64u);
  EXPECT_EQ(minimal->normalised.camera().vertical_fov_deg(), 45);
  EXPECT_EQ(minimal->normalised.targets().max_normal_angle_deg(), 30);
  EXPECT_EQ(minimal->normalised.laser().fan_angle_deg(), 90);
  EXPECT_EQ(minimal->normalised.rig().scan_step_m(), 1e-3);
  EXPECT_EQ(minimal->normalised.field_directions(), kDefaultFieldDirections);

  v1::SceneSpec explicit_spec = MinimalSpec();
  explicit_spec.mutable_camera()->set_vertical_fov_deg(45);
  explicit_spec.mutable_targets()->set_spacing_m(0.005);
  EXPECT_EQ(ParseSceneSpec(explicit_spec)->digest, minimal->digest);
  // As a client sends them: by way of radians.
  explicit_spec.mutable_camera()->set_vertical_fov_deg(std::nextafter(45.0, 46.0));
  const auto rounded = ParseSceneSpec(explicit_spec);
  EXPECT_EQ(rounded->digest, minimal->digest);
  EXPECT_EQ(rounded->rig.camera.vertical_fov_rad, minimal->rig.camera.vertical_fov_rad);
  EXPECT_EQ(ParseSceneSpec(minimal->normalised)->digest, minimal->digest);
}

TEST(SceneSpec, NormalFormOfOddAnglesIsStable) {
  for (const double degrees : {33.3, 71.123456789, 12.000000001, 89.9}) {
    v1::SceneSpec spec = MinimalSpec();
    spec.mutable_camera()->set_vertical_fov_deg(degrees);
    spec.mutable_laser()->set_fan_angle_deg(degrees);
    spec.mutable_targets()->set_max_normal_angle_deg(degrees / 2);
    const auto once = ParseSceneSpec(spec);
    ASSERT_TRUE(once.ok()) << once.status();
    const auto twice = ParseSceneSpec(once->normalised);
    ASSERT_TRUE(twice.ok()) << twice.status();
    EXPECT_EQ(once->normalised.SerializeAsString(), twice->normalised.SerializeAsString());
    EXPECT_EQ(once->digest, twice->digest);
  }
}

TEST(SceneSpec, EveryFieldChangesTheDigest) {
  std::set<std::string> digests = {ParseSceneSpec(MinimalSpec())->digest};
  const auto add = [&digests](const std::function<void(v1::SceneSpec*)>& change) {
    v1::SceneSpec spec = MinimalSpec();
    change(&spec);
    const auto parsed = ParseSceneSpec(spec);
    ASSERT_TRUE(parsed.ok()) << parsed.status();
    EXPECT_TRUE(digests.insert(parsed->digest).second) << spec.DebugString();
  };
  add([](v1::SceneSpec* spec) { spec->set_part_digest(std::string(64, 'b')); });
  add([](v1::SceneSpec* spec) { spec->mutable_camera()->set_columns_px(640); });
  add([](v1::SceneSpec* spec) { spec->mutable_camera()->set_vertical_fov_deg(44); });
  add([](v1::SceneSpec* spec) { spec->mutable_laser()->set_distance_m(0.5); });
  add([](v1::SceneSpec* spec) { spec->mutable_rig()->set_scan_step_m(0.002); });
  add([](v1::SceneSpec* spec) { spec->mutable_targets()->set_seed(2); });
  add([](v1::SceneSpec* spec) { spec->set_field_directions(1024); });
  add([](v1::SceneSpec* spec) {
    spec->add_obstacles()->set_part_digest(std::string(64, 'c'));
    spec->mutable_obstacles(0)->set_frame(v1::Obstacle::FRAME_STAGE);
  });
  add([](v1::SceneSpec* spec) {
    spec->add_obstacles()->set_part_digest(std::string(64, 'c'));
    spec->mutable_obstacles(0)->set_frame(v1::Obstacle::FRAME_PART);
  });
  add([](v1::SceneSpec* spec) {
    spec->add_obstacles()->set_part_digest(std::string(64, 'c'));
    spec->mutable_obstacles(0)->set_frame(v1::Obstacle::FRAME_TABLE);
  });
  add([](v1::SceneSpec* spec) { spec->mutable_targets()->set_max_depth_per_pixel_m(0.002); });
  add([](v1::SceneSpec* spec) { spec->mutable_measurement(); });
  add([](v1::SceneSpec* spec) {
    spec->mutable_measurement()->add_resting_orientations()->set_part_alpha_deg(90);
  });
}

// A scan measures the same points whatever its targets are and whatever else is asked of them.
TEST(SceneSpec, GeometryIsAllButTargetsAndQuestions) {
  const auto geometry = [](const std::function<void(v1::SceneSpec*)>& change) {
    v1::SceneSpec spec = MinimalSpec();
    change(&spec);
    const auto parsed = ParseSceneSpec(spec);
    EXPECT_TRUE(parsed.ok()) << parsed.status();
    return parsed.ok() ? parsed->geometry_digest : "";
  };
  const std::string plain = geometry([](v1::SceneSpec*) {});
  const std::set<std::string> same = {
      geometry([](v1::SceneSpec* spec) { spec->mutable_targets()->set_seed(2); }),
      geometry([](v1::SceneSpec* spec) { spec->mutable_targets()->set_spacing_m(0.007); }),
      geometry([](v1::SceneSpec* spec) { spec->set_field_directions(1024); }),
      geometry([](v1::SceneSpec* spec) { spec->mutable_measurement(); }),
      geometry([](v1::SceneSpec* spec) { spec->mutable_uncertainty(); })};
  EXPECT_EQ(same, std::set<std::string>{plain});
  std::set<std::string> others = {plain};
  for (const auto& change : std::vector<std::function<void(v1::SceneSpec*)>>{
           [](v1::SceneSpec* spec) { spec->set_part_digest(std::string(64, 'b')); },
           [](v1::SceneSpec* spec) { spec->mutable_camera()->set_columns_px(640); },
           [](v1::SceneSpec* spec) { spec->mutable_laser()->set_distance_m(0.5); },
           [](v1::SceneSpec* spec) { spec->mutable_rig()->set_scan_step_m(0.002); },
           [](v1::SceneSpec* spec) {
             spec->add_obstacles()->set_part_digest(std::string(64, 'c'));
             spec->mutable_obstacles(0)->set_frame(v1::Obstacle::FRAME_STAGE);
           },
           [](v1::SceneSpec* spec) {
             spec->mutable_part_placement()->mutable_centre_m()->set_x(0.01);
           },
           [](v1::SceneSpec* spec) { spec->mutable_targets()->set_max_depth_per_pixel_m(0.002); },
           [](v1::SceneSpec* spec) {
             spec->mutable_targets()->set_max_pixel_footprint_m(0.002);
           }}) {
    EXPECT_TRUE(others.insert(geometry(change)).second);
  }
}

TEST(SceneSpec, ADomainIsWrittenOutWithoutNames) {
  v1::SceneSpec spec = MinimalSpec();
  v1::RestingOrientation& rest = *spec.mutable_measurement()->add_resting_orientations();
  rest.set_part_alpha_deg(89.99999999999);
  const auto plain = ParseSceneSpec(spec);
  ASSERT_TRUE(plain.ok()) << plain.status();
  rest.set_name("B");
  EXPECT_EQ(ParseSceneSpec(spec)->digest, plain->digest);
  EXPECT_EQ(plain->normalised.measurement().camera_distance_m().ranges(0).max(), 0.8);
  EXPECT_EQ(ParseSceneSpec(plain->normalised)->digest, plain->digest);
  ASSERT_TRUE(plain->domain);
  EXPECT_EQ(plain->domain->resting_orientations.size(), 1u);

  // The part's holding must be resolved before a scene is described.
  spec.mutable_rig()->set_part_holding(v1::Rig::PART_HOLDING_RESTING);
  EXPECT_THAT(std::string(ParseSceneSpec(spec).status().message()),
              ::testing::HasSubstr("spec.rig.part_holding"));
  spec.mutable_rig()->clear_part_holding();
  spec.mutable_measurement()->mutable_part_gamma_deg()->set_fixed(400);
  EXPECT_THAT(std::string(ParseSceneSpec(spec).status().message()),
              ::testing::HasSubstr("measurement.part_gamma_deg.fixed"));
}

TEST(SceneSpec, NamesTheFieldsAtFault) {
  v1::SceneSpec spec;
  spec.set_part_digest("../etc");
  spec.set_field_directions(1000);
  spec.add_obstacles()->set_part_digest(std::string(64, 'c'));
  const auto parsed = ParseSceneSpec(spec);
  ASSERT_EQ(parsed.status().code(), absl::StatusCode::kInvalidArgument);
  std::vector<std::string> fields;
  for (const auto& violation : FieldViolations(parsed.status())) fields.push_back(violation.field);
  EXPECT_THAT(fields,
              ElementsAre("spec.part_digest", "spec.obstacles[0].frame", "spec.field_directions"));
  v1::SceneSpec bad_camera = MinimalSpec();
  bad_camera.mutable_camera()->set_vertical_fov_deg(std::numeric_limits<double>::quiet_NaN());
  const auto camera = ParseSceneSpec(bad_camera);
  ASSERT_EQ(camera.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(camera.status().message()), HasSubstr("vertical_fov_deg"));
}

v1::Measurement Inside() {
  v1::Measurement measurement;
  measurement.set_camera_distance_m(0.4);
  measurement.set_triangulation_angle_deg(30);
  return measurement;
}

TEST(QueryValidation, SetsAsideWhatIsOutsideTable21) {
  google::protobuf::RepeatedPtrField<v1::Measurement> measurements;
  const std::vector<std::function<void(v1::Measurement*)>> outside = {
      [](v1::Measurement* m) { m->set_camera_distance_m(0.09); },
      [](v1::Measurement* m) { m->set_camera_distance_m(0.81); },
      [](v1::Measurement* m) { m->set_triangulation_angle_deg(9.9); },
      [](v1::Measurement* m) { m->set_triangulation_angle_deg(-80.1); },
      [](v1::Measurement* m) { m->set_camera_polar_deg(91); },
      [](v1::Measurement* m) { m->set_offset_y_m(0.51); },
      [](v1::Measurement* m) { m->set_offset_z_m(-0.41); }};
  for (const auto& change : outside) {
    *measurements.Add() = Inside();
    change(&*measurements.rbegin());
  }
  *measurements.Add() = Inside();
  const auto batch = ParseMeasurements(measurements);
  ASSERT_TRUE(batch.ok()) << batch.status();
  EXPECT_EQ(batch->size, outside.size() + 1);
  EXPECT_THAT(batch->inside_index, ElementsAre(outside.size()));
}

TEST(QueryValidation, NamesEveryFieldThatIsNotFinite) {
  for (int field = 0; field < v1::Measurement::descriptor()->field_count(); ++field) {
    const auto* descriptor = v1::Measurement::descriptor()->field(field);
    google::protobuf::RepeatedPtrField<v1::Measurement> measurements;
    *measurements.Add() = Inside();
    *measurements.Add() = Inside();
    measurements[1].GetReflection()->SetDouble(&measurements[1], descriptor,
                                               field % 2 == 0
                                                   ? std::numeric_limits<double>::quiet_NaN()
                                                   : std::numeric_limits<double>::infinity());
    const auto batch = ParseMeasurements(measurements);
    ASSERT_EQ(batch.status().code(), absl::StatusCode::kInvalidArgument);
    ASSERT_EQ(FieldViolations(batch.status()).size(), 1u);
    EXPECT_EQ(FieldViolations(batch.status())[0].field, "measurements[1]." + descriptor->name());
  }
}

}  // namespace
}  // namespace sightline
