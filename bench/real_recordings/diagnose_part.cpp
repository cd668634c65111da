// SPDX-License-Identifier: Apache-2.0
// Diagnoses recordings of a part (format version 2) in this process:
//   bench_diagnose_part SET_FOLDER PART_FILE OUT.json
// The null model has no interreflection. Prints finding, ranking, fit and time.
#include <google/protobuf/util/json_util.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "core/part/load_part.h"
#include "core/status/status_macros.h"
#include "render_worker/image_file/image_file.h"
#include "render_worker/scene_diagnosis/diagnose_scene.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<RecordedScene> ReadScene(const std::string& folder, const std::string& part_file) {
  const std::string description = folder + "/recordings.json";
  v1::Recordings message;
  SIGHTLINE_RETURN_IF_ERROR(ReadRecordingsMessage(description, &message));
  RecordedScene scene;
  SIGHTLINE_ASSIGN_OR_RETURN(scene.recordings, ParseRecordings(message, description));
  SIGHTLINE_ASSIGN_OR_RETURN(auto nominal, InspectionOfRecordings(message, description));
  SIGHTLINE_ASSIGN_OR_RETURN(scene.inspection, ParseInspection(nominal, description, folder));
  SIGHTLINE_ASSIGN_OR_RETURN(scene.part, LoadPart(part_file, ""));
  scene.assets = [](const std::string& file) -> absl::StatusOr<std::string> { return file; };
  for (const RecordedImage& image : scene.recordings.recordings) {
    SIGHTLINE_ASSIGN_OR_RETURN(auto raw, ReadRawImage((fs::path(folder) / image.file).string()));
    scene.raw_dn.push_back(std::move(raw));
  }
  return scene;
}

int Run(const std::string& folder, const std::string& part_file, const std::string& out) {
  auto scene = ReadScene(folder, part_file);
  if (!scene.ok()) {
    std::fprintf(stderr, "%s\n", std::string(scene.status().message()).c_str());
    return 1;
  }
  const auto start = std::chrono::steady_clock::now();
  auto diagnosis = DiagnoseScene(*scene, {}, nullptr);
  if (!diagnosis.ok()) {
    std::fprintf(stderr, "%s\n", std::string(diagnosis.status().message()).c_str());
    return 1;
  }
  std::printf("%s\n", diagnosis->finding().c_str());
  for (const v1::Explanation& explanation : diagnosis->ranked()) {
    std::string parameters;
    for (const v1::FittedEffect& effect : explanation.effects()) {
      parameters += " " + effect.effect();
      for (const v1::FittedParameter& parameter : effect.parameters()) {
        parameters += " " + parameter.name() + " " + std::to_string(parameter.value()) + " +- " +
                      std::to_string(parameter.standard_error());
      }
    }
    std::printf("p %.4f  gain %9.1f  held-out chi^2/dof %7.3f  %s%s\n", explanation.probability(),
                explanation.log_evidence_gain(), explanation.held_out_chi_squared_per_dof(),
                explanation.effect().c_str(), parameters.c_str());
  }
  for (const v1::FittedDeviation& deviation : diagnosis->model_fit().deviations()) {
    std::printf("refitted %s by %.3f +- %.3f\n", deviation.name().c_str(), deviation.value(),
                deviation.standard_error());
  }
  for (const v1::DetectableStrength& strength : diagnosis->power()) {
    std::printf("detectable %s %s %.4g %s\n", strength.effect().c_str(),
                strength.parameter().c_str(), strength.strength(), strength.unit_note().c_str());
  }
  std::printf("%.1f s\n",
              std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
  std::string json;
  google::protobuf::util::JsonPrintOptions options;
  options.add_whitespace = true;
  options.preserve_proto_field_names = true;
  if (!google::protobuf::util::MessageToJsonString(*diagnosis, &json, options).ok()) return 1;
  std::ofstream(out) << json;
  return 0;
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s SET_FOLDER PART_FILE OUT.json\n", argv[0]);
    return 2;
  }
  return sightline::Run(argv[1], argv[2], argv[3]);
}
