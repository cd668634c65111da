// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/part_assets.h"

#include <filesystem>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/inspection/inspection.h"
#include "core/part/load_part.h"
#include "core/status/status_macros.h"
#include "planner_client/coverage_client/part_upload.h"
#include "planner_client/part_files/part_file.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

std::string FileName(const std::string& path) { return fs::path(path).filename().string(); }

// Moves a file's bytes into the request under a name of its own.
absl::Status AddAsset(const std::string& path, const std::string& name,
                      std::vector<AssetFile>* assets) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::string bytes, ReadFile(path));
  if (bytes.empty()) return absl::InvalidArgumentError(absl::StrCat(path, ": is empty"));
  assets->push_back({name, std::move(bytes)});
  return absl::OkStatus();
}

// Reads a mesh file. STEP files are sent as their mesh, glTF files with external buffers as PLY.
absl::Status AddMesh(const std::string& prefix, const PartFileOptions& options, std::string* file,
                     std::string* unit, std::vector<AssetFile>* assets) {
  const std::string path = *file;
  SIGHTLINE_ASSIGN_OR_RETURN(const MeshFile mesh_file, MeshFileOf(path, *unit, options));
  *unit = mesh_file.unit;
  const std::string extension = fs::path(mesh_file.path).extension();
  if (!absl::EqualsIgnoreCase(extension, ".gltf")) {
    // The server has no terminal, so remarks are printed here.
    if (absl::EndsWithIgnoreCase(path, ".glb")) {
      SIGHTLINE_RETURN_IF_ERROR(LoadPartFile(path, *unit, options).status());
    }
    *file = absl::StrCat(prefix, fs::path(path).stem().string(), extension);
    return AddAsset(mesh_file.path, *file, assets);
  }
  SIGHTLINE_ASSIGN_OR_RETURN(TriangleMesh mesh, LoadPartFile(path, *unit, options));
  if (!mesh.material_names.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": its materials cannot be sent; save it as .glb"));
  }
  *file = absl::StrCat(prefix, fs::path(path).stem().string(), ".ply");
  *unit = std::string("m");
  assets->push_back({*file, EncodePly(mesh)});
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  // As much as a part file may have.
  constexpr uint64_t kMaxBytes = uint64_t{2} << 30;
  return ReadRegularFile(path, kMaxBytes);
}

absl::StatusOr<ImagingInspection> CheckImagingInspection(const v1::Inspection& message,
                                                         const std::string& path) {
  ImagingInspection checked;
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto inlined, InlineInspectionFiles(message, path, fs::path(path).parent_path().string()));
  SIGHTLINE_ASSIGN_OR_RETURN(auto inspection, ParseInspection(inlined, path, ""));
  const auto missing = [&](const std::string& field, const std::string& what) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": ", field, " is missing: images need ", what));
  };
  if (!inspection.sensor) return missing("camera.sensor_file", "a sensor");
  if (!inspection.rig.lens) return missing("lens", "a lens");
  if (inspection.materials.empty()) return missing("materials", "the part's materials");
  return ImagingInspection{std::move(inlined), std::move(inspection)};
}

absl::Status TakeAssets(const std::string& context, v1::Inspection* inspection,
                        std::vector<AssetFile>* assets) {
  inspection->clear_targets();
  // The housing of a rigid head has the distance and the angle of the domain.
  if (inspection->rig().sensor_mount() != v1::Rig::SENSOR_MOUNT_RIGID) {
    inspection->clear_measurement();
  }
  inspection->clear_goal();
  inspection->clear_costs();
  inspection->clear_uncertainty();
  inspection->clear_tolerances();
  inspection->clear_detectability();
  PartFileOptions options;
  options.construction_geometry = inspection->part().construction_geometry();
  absl::Status status = AddMesh("", options, inspection->mutable_part()->mutable_file(),
                                inspection->mutable_part()->mutable_unit(), assets);
  inspection->mutable_part()->clear_construction_geometry();
  if (!status.ok()) return status;
  for (int i = 0; i < inspection->obstacles_size(); ++i) {
    v1::Obstacle* obstacle = inspection->mutable_obstacles(i);
    status = AddMesh(absl::StrCat("obstacle-", i, "/"), {}, obstacle->mutable_file(),
                     obstacle->mutable_unit(), assets);
    if (!status.ok()) return status;
  }
  return TakeMaterialAssets(context, inspection->mutable_materials(), assets);
}

absl::Status TakeMaterialAssets(
    const std::string& context,
    google::protobuf::RepeatedPtrField<v1::MaterialAssignment>* materials,
    std::vector<AssetFile>* assets) {
  for (int i = 0; i < materials->size(); ++i) {
    int number = 0;
    for (std::string* file : MutableMaterialFiles(materials->Mutable(i)->mutable_material())) {
      const std::string name = absl::StrCat("material-", i, "-", number++, "/", FileName(*file));
      absl::Status status = AddAsset(*file, name, assets);
      if (!status.ok()) {
        return absl::Status(status.code(),
                            absl::StrCat(context, ": materials[", i, "]: ", status.message()));
      }
      *file = name;
    }
  }
  return absl::OkStatus();
}

}  // namespace sightline
