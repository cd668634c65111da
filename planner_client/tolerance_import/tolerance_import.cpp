// SPDX-License-Identifier: Apache-2.0
#include "planner_client/tolerance_import/tolerance_import.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/tolerance/qif/qif_reader.h"
#include "core/tolerance/tolerance_proto.h"
#include "planner_client/part_files/step_program.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

absl::StatusOr<ImportedTolerances> ImportStep(const std::string& file,
                                              const ToleranceImportOptions& options) {
  const StepProgramOptions program{options.step_import_program, options.time_limit};
  std::vector<std::string> arguments = {"--tolerances", "-"};
  if (!options.length_unit.empty())
    arguments.insert(arguments.end(), {"--unit", options.length_unit});
  const auto json = RunStepImport(file, arguments, program);
  if (IsMissingStepUnit(json.status())) {
    return absl::InvalidArgumentError(absl::StrCat(
        file,
        ": states no length unit; tolerances.unit of the inspection must state it (--unit of "
        "`sightline part`, --tolerances-unit of `sightline new`): m, cm, mm, um, inch"));
  }
  if (!json.ok()) return json.status();
  v1::ToleranceReport message;
  if (absl::Status parsed =
          ParseStrictJson(*json, absl::StrCat("output of ", kStepProgram, " for ", file), &message);
      !parsed.ok()) {
    return absl::InternalError(std::string(parsed.message()));
  }
  ImportedTolerances imported;
  auto report = ToleranceReportFromProto(message);
  auto faces = FacesFromProto(message);
  for (const absl::Status& wrong : {report.status(), faces.status()}) {
    if (!wrong.ok()) {
      return absl::InternalError(absl::StrCat("output of ", kStepProgram, " for ", file, ": ",
                                              std::string(wrong.message())));
    }
  }
  imported.report = *std::move(report);
  imported.faces = *std::move(faces);
  return imported;
}

}  // namespace

absl::StatusOr<std::vector<FaceTriangles>> FacesOf(const ImportedTolerances& imported,
                                                   const TriangleMesh& part) {
  const ToleranceReport& report = imported.report;
  const auto has_surface = [](const NominalFace& face) {
    return face.surface.kind != SurfaceKind::kFreeform;
  };
  if (std::none_of(report.nominal_faces.begin(), report.nominal_faces.end(), has_surface)) {
    return imported.faces;
  }
  std::vector<FaceTriangles> faces = FacesOnMesh(report.nominal_faces, part);
  if (!faces.empty()) return faces;
  return absl::InvalidArgumentError(absl::StrCat(
      report.file, ": no surface of the part lies on any of its ", report.nominal_faces.size(),
      " faces of features, the first of them ", report.nominal_faces.front().feature,
      ": part and file must have the same coordinates and describe the same part"));
}

absl::StatusOr<ImportedTolerances> ImportTolerances(const std::string& file,
                                                    const ToleranceImportOptions& options) {
  const std::string suffix = absl::AsciiStrToLower(fs::path(file).extension().string());
  const bool step = IsStepFile(file);
  if (!step && suffix != ".qif") {
    return absl::InvalidArgumentError(absl::StrCat(
        file, ": tolerances are read from STEP (.stp, .step, .p21) and QIF (.qif) files only"));
  }
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return absl::NotFoundError(file + ": no such file");
  if (step) return ImportStep(file, options);
  SIGHTLINE_ASSIGN_OR_RETURN(auto report,
                             ReadQif(file, options.qif_schema_folder, options.length_unit));
  return ImportedTolerances{std::move(report), {}};
}

}  // namespace sightline
