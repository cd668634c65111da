// SPDX-License-Identifier: Apache-2.0
#include "render_worker/render/part_inspection.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/field_limits/field_checks.h"
#include "core/file/read_file.h"
#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/part_digest.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

// An asset's size; the store limits it.
constexpr uint64_t kMaxMeshBytes = uint64_t{2} << 30;
constexpr int kMaxFrames = 100000;

absl::StatusOr<CameraSetting> ParseCameraSetting(const v1::OpticalSetting& message,
                                                 const Lens& lens, const std::string& context) {
  const Checker check(context);
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("f_number", message.f_number(),
                  {lens.min_f_number.value_or(0.5), lens.max_f_number.value_or(128), ""}));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("exposure_time_s", message.exposure_time_s(), {0, 100, " s", true}));
  SIGHTLINE_RETURN_IF_ERROR(check.Range(
      "focus_distance_m", message.focus_distance_m(),
      {std::max(lens.min_focus_distance_m.value_or(0), 1.01 * lens.focal_length_m), 1000, " m"}));
  SIGHTLINE_RETURN_IF_ERROR(check.Range("laser_power_w", message.laser_power_w(), {0, 100, " W"}));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("sensor_tilt_x_deg", message.sensor_tilt_x_deg(), {-30, 30, " deg"}));
  SIGHTLINE_RETURN_IF_ERROR(
      check.Range("sensor_tilt_y_deg", message.sensor_tilt_y_deg(), {-30, 30, " deg"}));
  return CameraSetting{message.f_number(),
                       message.exposure_time_s(),
                       message.focus_distance_m(),
                       message.laser_power_w(),
                       Radians(message.sensor_tilt_x_deg()),
                       Radians(message.sensor_tilt_y_deg())};
}

}  // namespace

absl::StatusOr<Inspection> ParsePartInspection(const v1::Inspection& message,
                                               const std::string& field) {
  if (!message.camera().sensor_file().empty()) {
    return InvalidFields({{field + ".camera.sensor_file", "must be inline: give camera.sensor"}});
  }
  for (int i = 0; i < message.materials_size(); ++i) {
    if (message.materials(i).file().empty()) continue;
    return InvalidFields(
        {{absl::StrCat(field, ".materials[", i, "].file"), "must be inline: give material"}});
  }
  SIGHTLINE_ASSIGN_OR_RETURN(Inspection inspection, ParseInspection(message, field, ""));
  if (!inspection.sensor) {
    return InvalidFields(
        {{field + ".camera.sensor", "is missing: images need a sensor (camera.sensor_file)"}});
  }
  if (!inspection.rig.lens) {
    return InvalidFields({{field + ".lens", "is missing: images need a lens"}});
  }
  if (inspection.materials.empty()) {
    return InvalidFields({{field + ".materials", "is missing: images need the part's materials"}});
  }
  return inspection;
}

std::vector<std::string> AssetFiles(const Inspection& inspection) {
  std::vector<std::string> files = {inspection.part_file};
  for (const ObstacleSource& obstacle : inspection.obstacles) files.push_back(obstacle.file);
  for (const MaterialChoice& choice : inspection.materials) {
    v1::Material material = choice.material;
    for (const std::string* file : MutableMaterialFiles(&material)) files.push_back(*file);
  }
  std::sort(files.begin(), files.end());
  files.erase(std::unique(files.begin(), files.end()), files.end());
  return files;
}

absl::StatusOr<TriangleMesh> LoadMeshAsset(const std::string& file, const std::string& unit,
                                           const AssetResolver& assets) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string path, assets(file));
  SIGHTLINE_ASSIGN_OR_RETURN(std::string bytes, ReadRegularFile(path, kMaxMeshBytes));
  std::string format = std::filesystem::path(file).extension().string();
  if (!format.empty()) format = format.substr(1);
  std::transform(format.begin(), format.end(), format.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return LoadPartFromMemory(bytes, format, unit, file);
}

absl::StatusOr<std::vector<TriangleMesh>> LoadObstacles(const Inspection& inspection,
                                                        const AssetResolver& assets) {
  std::vector<TriangleMesh> meshes;
  for (const ObstacleSource& source : inspection.obstacles) {
    SIGHTLINE_ASSIGN_OR_RETURN(TriangleMesh mesh, LoadMeshAsset(source.file, source.unit, assets));
    meshes.push_back(std::move(mesh));
  }
  return meshes;
}

absl::StatusOr<std::vector<ActiveEffect>> MakeEffects(const std::vector<EffectChoice>& choices) {
  std::vector<ActiveEffect> effects;
  for (const EffectChoice& choice : choices) {
    std::vector<NamedValue> parameters;
    for (const auto& [name, value] : choice.parameters) parameters.push_back({name, value});
    SIGHTLINE_ASSIGN_OR_RETURN(auto effect, MakeActiveEffect(choice.id, parameters));
    effects.push_back(std::move(effect));
  }
  SIGHTLINE_RETURN_IF_ERROR(OrderEffects(&effects));
  return effects;
}

absl::StatusOr<std::vector<PartFrameRequest>> ParsePartFrames(
    const google::protobuf::RepeatedPtrField<v1::PartFrame>& frames, const Inspection& inspection,
    const std::string& field) {
  if (frames.empty()) return InvalidFields({{field, "is empty"}});
  if (frames.size() > kMaxFrames) {
    return InvalidFields(
        {{field, absl::StrCat("has ", frames.size(), " entries, at most ", kMaxFrames)}});
  }
  const MeasurementDomain domain = ThesisDomain();
  std::vector<PartFrameRequest> requests;
  for (int i = 0; i < frames.size(); ++i) {
    const v1::PartFrame& frame = frames[i];
    const std::string path = absl::StrCat(field, "[", i, "]");
    PartFrameRequest request{MeasurementFromProto(frame.measurement()), frame.stage_position_m(),
                             std::nullopt};
    if (!domain.Contains(request.measurement)) {
      return InvalidFields({{path + ".measurement", "has a parameter outside Table 2.1"}});
    }
    if (!(std::abs(request.stage_position_m) <= 100)) {
      return InvalidFields(
          {{path + ".stage_position_m", absl::StrCat("is ", NumberText(request.stage_position_m),
                                                     ", must be in [-100, 100] m")}});
    }
    if (frame.has_setting()) {
      SIGHTLINE_ASSIGN_OR_RETURN(
          request.setting,
          ParseCameraSetting(frame.setting(), *inspection.rig.lens, path + ".setting"));
    }
    const FrameSetup setup = PartFrameSetup(inspection, request);
    if (*setup.lens.focus_distance_m <= 1.01 * setup.lens.focal_length_m) {
      return InvalidFields({{path + ".measurement.camera_distance_m",
                             absl::StrCat("is ", NumberText(request.measurement.camera_distance_m),
                                          ", too near for the lens's focal length of ",
                                          NumberText(setup.lens.focal_length_m), " m")}});
    }
    requests.push_back(request);
  }
  return requests;
}

absl::StatusOr<std::unique_ptr<PartScene>> LoadPartScene(const Inspection& inspection,
                                                         const AssetResolver& assets,
                                                         std::string* part_digest) {
  PartSceneInput input;
  input.inspection = inspection;
  input.assets = assets;
  SIGHTLINE_ASSIGN_OR_RETURN(auto part,
                             LoadMeshAsset(inspection.part_file, inspection.part_unit, assets));
  if (part_digest != nullptr) *part_digest = PartDigestOf(part).Text();
  input.part = std::move(part);
  SIGHTLINE_ASSIGN_OR_RETURN(input.obstacles, LoadObstacles(inspection, assets));
  return PartScene::Make(std::move(input));
}

}  // namespace sightline
