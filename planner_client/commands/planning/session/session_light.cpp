// SPDX-License-Identifier: Apache-2.0
#include "planner_client/commands/planning/session/session_light.h"

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/digest/sha256.h"
#include "core/inspection/exposure_limit.h"
#include "core/json/strict_json.h"
#include "core/process/program_path.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/part_assets.h"
#include "planner_client/optics_client/detectability_client.h"
#include "planner_client/part_files/private_folder.h"

namespace sightline {
namespace {

// Surfaces without a material: examples/catalogue/materials/sand_cast_aluminium.json.
v1::Material MattAluminium() {
  v1::Material material;
  material.set_name("matt aluminium");
  v1::Material::LambertGgx& model = *material.mutable_lambert_ggx();
  model.set_diffuse_albedo(0.4);
  model.set_specular_f0(0.4);
  model.set_ggx_alpha(0.6);
  return material;
}

std::string Quoted(const std::string& text) { return absl::StrCat("\"", text, "\""); }

// Names of the materials that triangles of the part have; one empty name for a part without.
std::set<std::string> SurfacesOf(const TriangleMesh& part) {
  if (part.triangle_material.empty()) return {""};
  std::vector<bool> used(part.material_names.size(), false);
  for (const uint16_t material : part.triangle_material) used[material] = true;
  std::set<std::string> names;
  for (size_t i = 0; i < used.size(); ++i) {
    if (used[i]) names.insert(part.material_names[i]);
  }
  return names;
}

absl::Status CheckTableNames(const std::string& inspection_file, const Detectability& stated,
                             const std::set<std::string>& surfaces) {
  for (size_t i = 0; i < stated.materials.size(); ++i) {
    const std::string& name = stated.materials[i].part_material;
    if (name.empty() || surfaces.count(name) > 0) continue;
    std::vector<std::string> known;
    for (const std::string& surface : surfaces) {
      if (!surface.empty()) known.push_back(Quoted(surface));
    }
    return absl::InvalidArgumentError(
        absl::StrCat(inspection_file, ": detectability.table.materials[", i, "].part_material is ",
                     Quoted(name), ", but the part ",
                     known.empty() ? "names no materials"
                                   : absl::StrCat("has only ", absl::StrJoin(known, ", "))));
  }
  return absl::OkStatus();
}

// The fields of the inspection that the light on a facet depends on, and which tables the part
// needs. Adds matt aluminium for the surfaces in `bare`, which have no material.
absl::StatusOr<DetectabilityQuestion> QuestionFor(const std::string& inspection_file,
                                                  const std::set<std::string>& surfaces,
                                                  std::vector<std::string>* bare) {
  v1::Inspection message;
  SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(inspection_file, &message));
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto inlined,
      InlineInspectionFiles(message, inspection_file,
                            std::filesystem::path(inspection_file).parent_path().string()));

  DetectabilityQuestion question;
  v1::Inspection& asked = *question.request.mutable_inspection();
  asked.set_defaults(inlined.defaults());
  // Messages need a part; the worker does not read it.
  asked.mutable_part()->set_file("facet.stl");
  asked.mutable_part()->set_unit("m");
  *asked.mutable_camera() = inlined.camera();
  *asked.mutable_lens() = inlined.lens();
  *asked.mutable_laser() = inlined.laser();
  if (inlined.has_lighting()) *asked.mutable_lighting() = inlined.lighting();
  if (inlined.has_render()) *asked.mutable_render() = inlined.render();
  if (inlined.has_optics()) *asked.mutable_optics() = inlined.optics();
  *asked.mutable_effects() = inlined.effects();
  if (inlined.measurement().has_camera_distance_m()) {
    *asked.mutable_measurement()->mutable_camera_distance_m() =
        inlined.measurement().camera_distance_m();
  }
  if (inlined.detectability().has_min_detected_fraction()) {
    asked.mutable_detectability()->set_min_detected_fraction(
        inlined.detectability().min_detected_fraction());
  }
  // Surfaces with a material of their own, and one for all others.
  std::set<std::string> own, needed;
  bool has_fallback = false;
  for (const v1::MaterialAssignment& assignment : inlined.materials()) {
    if (assignment.part_material().empty()) {
      has_fallback = true;
    } else {
      own.insert(assignment.part_material());
    }
  }
  for (const std::string& surface : surfaces) {
    needed.insert(own.count(surface) > 0 ? surface : "");
    if (own.count(surface) == 0 && !has_fallback) bare->push_back(surface);
  }
  for (const v1::MaterialAssignment& assignment : inlined.materials()) {
    if (needed.count(assignment.part_material()) > 0) *asked.add_materials() = assignment;
  }
  if (!bare->empty()) *asked.add_materials()->mutable_material() = MattAluminium();
  for (const std::string& name : needed) question.request.add_part_materials(name);
  SIGHTLINE_RETURN_IF_ERROR(
      TakeMaterialAssets(inspection_file, asked.mutable_materials(), &question.assets));
  return question;
}

// A name for the build of the worker, under which its answers are kept.
absl::StatusOr<std::string> WorkerBuild(const WorkerSessionOptions& worker) {
  if (!worker.address.empty()) return absl::StrCat("remote ", SIGHTLINE_VERSION);
  SIGHTLINE_ASSIGN_OR_RETURN(const auto digest,
                             DigestOfFile(FindProgram("render_worker").string()));
  return digest.sha256;
}

absl::StatusOr<v1::DetectabilityTable> TableFor(const DetectabilityQuestion& question,
                                                const WorkerSessionOptions& worker,
                                                const ProgressPhase& phase) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto build, WorkerBuild(worker));
  SIGHTLINE_ASSIGN_OR_RETURN(const auto folder, UserCacheFolder("detectability"));
  return KeptDetectability(folder, build, question,
                           [&]() -> absl::StatusOr<v1::DetectabilityTable> {
                             ProgressLine progress(phase);
                             WorkerClientOptions client;
                             SIGHTLINE_ASSIGN_OR_RETURN(
                                 const auto server, StartWorkerSession(worker, &progress, &client));
                             auto table = AskDetectability(client, question);
                             progress.Finish();
                             return table;
                           });
}

std::string MillisecondsText(double time_s) {
  return absl::StrCat(NumberText(1e3 * time_s), " ms");
}

}  // namespace

absl::StatusOr<std::optional<SessionLight>> LightOfSession(const std::string& inspection_file,
                                                           const Inspection& inspection,
                                                           const TriangleMesh& part,
                                                           const WorkerSessionOptions& worker,
                                                           const ProgressPhase& phase) {
  if (!inspection.detectability) return std::nullopt;
  SIGHTLINE_ASSIGN_OR_RETURN(const auto permitted,
                             PermittedExposuresOf(inspection, inspection_file));
  PrintTextTo(stderr, "light: exposures of %s to %s are permitted (the longest by %s)\n",
              MillisecondsText(permitted.shortest_s).c_str(),
              MillisecondsText(permitted.longest_s).c_str(), permitted.longest_because.c_str());
  SessionLight light;
  light.detectability.set_min_exposure_time_s(permitted.shortest_s);
  light.detectability.set_max_exposure_time_s(permitted.longest_s);
  const std::set<std::string> surfaces = SurfacesOf(part);
  if (!inspection.detectability->materials.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(
        CheckTableNames(inspection_file, *inspection.detectability, surfaces));
    v1::Inspection message;
    SIGHTLINE_RETURN_IF_ERROR(ReadStrictJsonFile(inspection_file, &message));
    *light.detectability.mutable_table() = message.detectability().table();
    return light;
  }
  std::vector<std::string> bare;
  SIGHTLINE_ASSIGN_OR_RETURN(auto question, QuestionFor(inspection_file, surfaces, &bare));
  if (!bare.empty()) {
    std::vector<std::string> names;
    for (const std::string& name : bare) {
      names.push_back(name.empty() ? "surfaces without a name" : Quoted(name));
    }
    light.remarks.push_back(absl::StrCat(
        "Light: no material is given for ",
        surfaces.size() == 1 && bare[0].empty() ? std::string("the part")
                                                : absl::StrJoin(names, ", "),
        "; matt aluminium is assumed (diffuse albedo 0.4, F0 0.4, GGX roughness 0.6)"));
    PrintTextTo(stderr, "%s\n", light.remarks.back().c_str());
  }
  auto table = TableFor(question, worker, phase);
  if (absl::IsNotFound(table.status())) {
    return absl::NotFoundError(absl::StrCat(
        inspection_file, ": detectability needs the render worker: ", table.status().message(),
        "; give --render-worker, or detectability.table, or `defaults` \"0.1\", by which light "
        "limits nothing"));
  }
  if (!table.ok()) return AboutInput(table.status(), inspection_file);
  *light.detectability.mutable_table() = *std::move(table);
  return light;
}

}  // namespace sightline
