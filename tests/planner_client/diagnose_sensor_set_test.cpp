// SPDX-License-Identifier: Apache-2.0
// `sightline diagnose` of flat-field and dark frames, with a worker in this process that finds the
// same whatever the images are.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

#include "core/json/strict_json.h"
#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/commands/commands.h"
#include "proto/status/rpc_status.h"
#include "sightline/v1/job_service.grpc.pb.h"
#include "sightline/v1/render_service.grpc.pb.h"
#include "sightline/v1/sensor_service.grpc.pb.h"
#include "tests/planner_client/run_command.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr char kJob[] = "job";

v1::SensorDiagnosis Answer() {
  v1::SensorDiagnosis answer;
  answer.set_set("camera");
  answer.set_verdict("effect");
  answer.set_finding("Signals fall short of proportion by 2 %.");
  answer.mutable_camera()->set_name("camera");
  answer.mutable_camera()->set_gain_dn_per_electron(0.125);
  v1::SensorQuantity* gain = answer.add_quantities();
  gain->set_name("gain_dn_per_electron");
  gain->set_unit("DN/e-");
  gain->set_value(0.125);
  gain->set_lower(0.1245);
  gain->set_upper(0.1255);
  gain->set_emva_value(0.126);
  v1::SensorQuantity* current = answer.add_quantities();
  current->set_name("dark_current_electrons_per_s");
  current->set_note("all dark steps have one exposure time");
  v1::SensorDeparture* departure = answer.add_departures();
  departure->set_effect("response_nonlinearity");
  departure->set_stage("readout");
  departure->set_description("the signal falls short of proportion");
  departure->set_found(true);
  departure->set_testable(true);
  departure->set_p_value(1e-9);
  departure = answer.add_departures();
  departure->set_effect("light_drift");
  departure->set_testable(true);
  departure = answer.add_departures();
  departure->set_effect("dark_current");
  answer.add_warnings("few steps");
  return answer;
}

class Worker : public v1::RenderService::Service,
               public v1::JobService::Service,
               public v1::SensorService::Service {
 public:
  grpc::Status UploadAsset(grpc::ServerContext*, grpc::ServerReader<v1::UploadAssetRequest>* reader,
                           v1::UploadAssetResponse*) override {
    v1::UploadAssetRequest message;
    std::string digest, bytes;
    while (reader->Read(&message)) {
      if (message.has_header()) digest = message.header().asset_digest();
      bytes += message.chunk();
    }
    const std::lock_guard lock(mutex_);
    assets_[digest] = bytes;
    return grpc::Status::OK;
  }
  grpc::Status WatchJob(grpc::ServerContext*, const v1::WatchJobRequest*,
                        grpc::ServerWriter<v1::WatchJobResponse>*) override {
    return grpc::Status::OK;
  }
  grpc::Status CreateSensorDiagnosis(grpc::ServerContext*,
                                     const v1::CreateSensorDiagnosisRequest* request,
                                     v1::CreateSensorDiagnosisResponse* response) override {
    const std::lock_guard lock(mutex_);
    for (const v1::RenderAsset& image : request->images()) {
      if (assets_.contains(image.asset_digest())) continue;
      return ToGrpcStatus(WithErrorInfo(absl::NotFoundError("unknown asset"), "ASSET_UNKNOWN",
                                        {{"asset_digest", image.asset_digest()}}));
    }
    request_ = *request;
    response->mutable_job()->set_job_id(kJob);
    return grpc::Status::OK;
  }
  grpc::Status GetSensorDiagnosis(grpc::ServerContext*,
                                  const v1::GetSensorDiagnosisRequest* request,
                                  v1::GetSensorDiagnosisResponse* response) override {
    if (request->job_id() != kJob) return {grpc::StatusCode::NOT_FOUND, "which job?"};
    const std::lock_guard lock(mutex_);
    if (!fault_.ok()) return ToGrpcStatus(fault_);
    *response->mutable_diagnosis() = Answer();
    return grpc::Status::OK;
  }

  std::mutex mutex_;
  std::map<std::string, std::string> assets_;  // bytes by digest
  v1::CreateSensorDiagnosisRequest request_;   // the last complete one
  absl::Status fault_;                         // of the job
};

class DiagnoseSensorSetTest : public ::testing::Test {
 protected:
  void SetUp() override {
    ASSERT_NE(mkdtemp(folder_.data()), nullptr);
    grpc::ServerBuilder builder;
    builder.AddListeningPort("unix:" + folder_ + "/s", grpc::InsecureServerCredentials());
    builder.RegisterService(static_cast<v1::RenderService::Service*>(&worker_));
    builder.RegisterService(static_cast<v1::JobService::Service*>(&worker_));
    builder.RegisterService(static_cast<v1::SensorService::Service*>(&worker_));
    server_ = builder.BuildAndStart();
    ASSERT_NE(server_, nullptr);
    set_ = folder_ + "/camera";
    fs::create_directories(set_ + "/images");
    std::ofstream(set_ + "/EMVA1288_Data.txt")
        << "v 3.0\nn 12 640 480\nb 40000.0 120.0\ni images\\b_1.png\ni images\\b_2.png\n"
           "d 40000.0\ni images\\d_1.png\ni images\\d_2.png\n";
    for (const char* image : {"b_1", "b_2", "d_1", "d_2"}) {
      std::ofstream(set_ + "/images/" + image + ".png") << "bytes of " << image;
    }
  }
  void TearDown() override {
    if (server_ != nullptr) server_->Shutdown();
    fs::remove_all(folder_);
  }

  CommandResult Run(const std::string& command, std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--server", "unix:" + folder_ + "/s"});
    return RunCommand(command == "verify" ? AddVerifyCommand : AddDiagnoseCommand, arguments);
  }
  static std::string Bytes(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
  }

  std::string folder_ = "/tmp/sightline-camera-XXXXXX";
  std::string set_;
  Worker worker_;
  std::unique_ptr<grpc::Server> server_;
};

TEST_F(DiagnoseSensorSetTest, SendsTheSetAndWritesTheAnswer) {
  const CommandResult result = Run("diagnose", {set_});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_EQ(worker_.request_.set().name(), "camera");
  EXPECT_EQ(worker_.request_.set().steps_size(), 2);
  EXPECT_FALSE(worker_.request_.request_id().empty());
  ASSERT_EQ(worker_.request_.images_size(), 4);
  EXPECT_EQ(worker_.request_.images(3).file(), "images/d_2.png");
  EXPECT_EQ(worker_.assets_[worker_.request_.images(3).asset_digest()], "bytes of d_2");

  EXPECT_THAT(result.output, HasSubstr("camera: Signals fall short of proportion by 2 %.\n"));
  EXPECT_THAT(result.output, HasSubstr("0.1245 to 0.1255"));
  EXPECT_THAT(result.output, HasSubstr("0.126  DN/e-\n"));
  EXPECT_THAT(result.output, HasSubstr("    all dark steps have one exposure time\n"));
  EXPECT_THAT(result.output, HasSubstr("  response_nonlinearity (readout, p = 1e-09): the signal "
                                       "falls short of proportion\n"));
  EXPECT_THAT(result.output, HasSubstr("Looked for and not found: light_drift\n"));
  EXPECT_THAT(result.output, HasSubstr("Not testable with these images: dark_current\n"));
  EXPECT_THAT(result.errors, HasSubstr("warning: few steps\n"));

  const fs::path out = set_ + "/diagnosis";
  v1::SensorDiagnosis diagnosis;
  ASSERT_TRUE(ReadStrictJsonFile((out / "diagnosis.json").string(), &diagnosis).ok());
  EXPECT_EQ(diagnosis.departures(0).effect(), "response_nonlinearity");
  EXPECT_EQ(diagnosis.departures(0).p_value(), 1e-9);
  v1::Sensor camera;
  ASSERT_TRUE(ReadStrictJsonFile((out / "camera.json").string(), &camera).ok());
  EXPECT_EQ(camera.gain_dn_per_electron(), 0.125);
  EXPECT_THAT(Bytes(out / "report.json"), HasSubstr("Signals fall short of proportion by 2 %."));
  for (const char* file : {"report.html", "report.json", "diagnosis.json", "camera.json"}) {
    EXPECT_THAT(result.output, HasSubstr((out / file).string() + "\n"));
  }
}

TEST_F(DiagnoseSensorSetTest, TakesTheDataFileAndAFolder) {
  const std::string out = folder_ + "/deep/out";
  const CommandResult result = Run("diagnose", {set_ + "/EMVA1288_Data.txt", "--out", out});
  ASSERT_EQ(result.exit_code, kExitDone) << result.errors;
  EXPECT_TRUE(fs::exists(out + "/report.html"));
  EXPECT_FALSE(fs::exists(set_ + "/diagnosis"));
}

TEST_F(DiagnoseSensorSetTest, RefusesOptionsOfPlatesAndParts) {
  for (const auto& [option, value] :
       {std::pair("--inspection", "inspection.json"), std::pair("--part", "part.stl"),
        std::pair("--part-unit", "mm"), std::pair("--exclude", "sensor.smear"),
        std::pair("--max-effects", "2")}) {
    const CommandResult result = Run("diagnose", {set_, option, value});
    EXPECT_EQ(result.exit_code, kExitWrongInput) << option;
    EXPECT_THAT(result.errors,
                HasSubstr(std::string(option) + " is for recordings of a plate or a part; " + set_ +
                          " has flat-field and dark frames"));
  }
  EXPECT_FALSE(fs::exists(set_ + "/diagnosis"));
}

TEST_F(DiagnoseSensorSetTest, VerifyNamesTheCommandToUse) {
  for (const std::string& path : {set_, set_ + "/EMVA1288_Data.txt"}) {
    const CommandResult result = Run("verify", {path});
    EXPECT_EQ(result.exit_code, kExitWrongInput);
    EXPECT_THAT(result.errors, HasSubstr(path + ": has flat-field and dark frames"));
    EXPECT_THAT(result.errors, HasSubstr("use sightline diagnose"));
  }
}

TEST_F(DiagnoseSensorSetTest, NamesWhatIsWrong) {
  worker_.fault_ = absl::InvalidArgumentError("images/b_1.png: is no image");
  CommandResult result = Run("diagnose", {set_});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("EMVA1288_Data.txt: images/b_1.png: is no image"));
  EXPECT_FALSE(fs::exists(set_ + "/diagnosis/diagnosis.json"));
  fs::remove(set_ + "/images/d_1.png");
  result = Run("diagnose", {set_});
  EXPECT_EQ(result.exit_code, kExitWrongInput);
  EXPECT_THAT(result.errors, HasSubstr("1 of 4 images cannot be read: images/d_1.png (steps[1])"));
  EXPECT_THAT(result.errors, Not(HasSubstr("is no image")));
}

}  // namespace
}  // namespace sightline
