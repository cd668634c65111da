// SPDX-License-Identifier: Apache-2.0
#include "planner_client/part_files/part_file.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "core/part/load_part.h"
#include "planner_client/part_files/step_mesh.h"

namespace sightline {

std::string PartFileEndings() {
  return absl::StrCat(".step, .stp, .", absl::StrJoin(PartFormats(), ", ."));
}

absl::StatusOr<std::string> MeshFileOf(const std::string& path) {
  return IsStepFile(path) ? MeshOfStepFile(path) : path;
}

absl::StatusOr<TriangleMesh> LoadPartFile(const std::string& path, const std::string& unit) {
  if (!IsStepFile(path)) return LoadPart(path, unit);
  if (absl::Status checked = CheckPartUnit(path, unit); !checked.ok()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": unit ", checked.message()));
  }
  const auto file = MeshOfStepFile(path);
  if (!file.ok()) return file.status();
  auto mesh = LoadPart(*file, "");
  if (mesh.ok()) return mesh;
  // People know the STEP file, not where its mesh is kept.
  return absl::Status(mesh.status().code(),
                      absl::StrReplaceAll(mesh.status().message(), {{*file, path}}));
}

}  // namespace sightline
