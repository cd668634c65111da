#include "render_worker/render/part_inspection.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

absl::StatusOr<std::string> ReadFile(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::ostringstream bytes;
  bytes << file.rdbuf();
  if (!file || !bytes) return absl::NotFoundError(absl::StrCat(path, ": cannot be read"));
  return std::move(bytes).str();
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
  absl::StatusOr<Inspection> inspection = ParseInspection(message, field, "");
  if (!inspection.ok()) return inspection.status();
  if (!inspection->sensor) {
    return InvalidFields(
        {{field + ".camera.sensor", "is missing: images need a sensor (camera.sensor_file)"}});
  }
  if (!inspection->rig.lens) {
    return InvalidFields({{field + ".lens", "is missing: images need a lens"}});
  }
  if (inspection->materials.empty()) {
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
  absl::StatusOr<std::string> path = assets(file);
  if (!path.ok()) return path.status();
  absl::StatusOr<std::string> bytes = ReadFile(*path);
  if (!bytes.ok()) return bytes.status();
  std::string format = std::filesystem::path(file).extension().string();
  if (!format.empty()) format = format.substr(1);
  std::transform(format.begin(), format.end(), format.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return LoadPartFromMemory(*bytes, format, unit, file);
}

absl::StatusOr<std::vector<TriangleMesh>> LoadObstacles(const Inspection& inspection,
                                                        const AssetResolver& assets) {
  std::vector<TriangleMesh> meshes;
  for (const ObstacleSource& source : inspection.obstacles) {
    absl::StatusOr<TriangleMesh> mesh = LoadMeshAsset(source.file, source.unit, assets);
    if (!mesh.ok()) return mesh.status();
    meshes.push_back(*std::move(mesh));
  }
  return meshes;
}

}  // namespace sightline
