// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/part_file.h"

#include <cstdio>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/part/load_part.h"
#include "core/status/status_macros.h"
#include "core/text/printable.h"
#include "planner_client/part_files/step_mesh.h"

namespace sightline {
namespace {

// A STEP file has one unit: its own, or the stated one where it has none.
constexpr std::string_view kStepUnitAdvice =
    "its length unit does not suit its numbers: export the part again in the unit it was drawn in";

void Say(const std::string& path, const std::vector<std::string>& remarks,
         const PartFileOptions& options) {
  for (const std::string& remark : remarks) {
    std::string text = absl::StrCat(path, ": ", remark);
    if (options.remarks != nullptr) {
      options.remarks->push_back(std::move(text));
    } else {
      std::fprintf(stderr, "%s\n", Printable(text).c_str());
    }
  }
}

absl::StatusOr<StepMesh> MeshStepPart(const std::string& path, const std::string& unit,
                                      const PartFileOptions& options) {
  StepMeshOptions meshing;
  meshing.unit = unit;
  meshing.construction_geometry = options.construction_geometry;
  auto mesh = MeshOfStepFile(path, meshing);
  if (mesh.ok()) Say(path, mesh->remarks, options);
  return mesh;
}

absl::Status CheckOptions(const std::string& path, const PartFileOptions& options) {
  if (!options.construction_geometry || IsStepFile(path)) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat(
      path, ": construction_geometry is given, but only a STEP file tells it from the part"));
}

}  // namespace

std::string PartFileEndings() {
  return absl::StrCat(".step, .stp, .", absl::StrJoin(PartFormats(), ", ."));
}

absl::StatusOr<MeshFile> MeshFileOf(const std::string& path, const std::string& unit,
                                    const PartFileOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckOptions(path, options));
  if (!IsStepFile(path)) return MeshFile{path, unit};
  SIGHTLINE_ASSIGN_OR_RETURN(auto mesh, MeshStepPart(path, unit, options));
  return MeshFile{std::move(mesh.file), ""};
}

absl::StatusOr<TriangleMesh> LoadPartFile(const std::string& path, const std::string& unit,
                                          const PartFileOptions& options) {
  SIGHTLINE_RETURN_IF_ERROR(CheckOptions(path, options));
  if (!IsStepFile(path)) {
    auto part = LoadPart(path, unit);
    if (part.ok()) Say(path, part->remarks, options);
    return part;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(const auto mesh, MeshStepPart(path, unit, options));
  // Users know the STEP file, but not the file of its mesh.
  return LoadPartFromMemory(mesh.glb, "glb", "", path, {}, kStepUnitAdvice);
}

bool NeedsPartUnit(const std::string& path) {
  if (!IsStepFile(path)) return !CheckPartUnit(path, "").ok();
  return IsMissingStepUnit(MeshOfStepFile(path).status());
}

}  // namespace sightline
