// SPDX-License-Identifier: Apache-2.0
// sightline_step_import: STEP to GLB, one node per solid, metres, coordinates as modelled; and the
// file's tolerances with the faces they bind, as JSON (proto/sightline/v1/tolerance.proto).
// Exit codes: 0 done; 1 failed while running; 2 the input is wrong.

#include <CLI/CLI.hpp>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Standard_Failure.hxx>
#include <Standard_OutOfMemory.hxx>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <new>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "core/command_options/option_values.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/process/start_process.h"
#include "core/tolerance/tolerance_proto.h"
#include "core/version/version.h"
#include "tools/step_import/glb_writer.h"
#include "tools/step_import/model/crash_report.h"
#include "tools/step_import/model/exchange_structure.h"
#include "tools/step_import/shape_mesh.h"
#include "tools/step_import/step_reader.h"

namespace sightline {
namespace {

constexpr char kProgram[] = "sightline_step_import";
constexpr int kFailed = 1;
constexpr int kInputWrong = 2;

// Beginning of lines that say what of the file is left out. planner_client/part_files/step_mesh.cpp
// looks for them.
constexpr char kRemark[] = "remark: ";

struct Arguments {
  std::filesystem::path in;  // "-": standard input
  std::string name;          // name in messages; empty: `in`
  std::filesystem::path out;
  std::filesystem::path tolerances;  // "-": standard output
  MeshingOptions meshing;
  StepReadOptions reading;

  std::string NameOfInput() const { return name.empty() ? in.string() : name; }

  // Stream for the report of the mesh: never between lines of JSON.
  FILE* log() const { return tolerances == "-" ? stderr : stdout; }
};

struct BodyMesh {
  ShapeMesh mesh;
  bool turned = false;  // the file has it inside out
};

// A line that names from the file cannot break.
std::string OneLine(std::string text) {
  for (char& c : text) {
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  }
  return text;
}

ShapeMesh MeshOf(const std::string& file, const StepBody& body, const MeshingOptions& meshing) {
  if (body.shape.IsNull()) return body.tessellation;
  try {
    return MeshShape(body.shape, meshing);
  } catch (const std::runtime_error& error) {
    throw StepInputError(file + ": " + OneLine(body.name) + ": " + error.what());
  }
}

BodyMesh MeshBody(const std::string& file, const StepBody& body, const MeshingOptions& meshing,
                  FILE* log) {
  ShapeMesh mesh = MeshOf(file, body, meshing);
  mesh.name = OneLine(body.name);
  MeshHealth health = CheckMesh(mesh);
  bool turned = false;
  if (health.watertight() && health.volume_mm3 < 0.0) {
    std::fprintf(stderr, "%s: inside out in the file; turned\n", mesh.name.c_str());
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
    turned = true;
    health = CheckMesh(mesh);
  }
  std::fprintf(log, "%s: %zu triangles, %.6f m2, %.3f cm3, %s\n", mesh.name.c_str(),
               mesh.triangles.size(), health.area_mm2 * 1e-6, health.volume_mm3 * 1e-3,
               health.watertight() ? "watertight" : "NOT watertight");
  if (!health.watertight() || health.degenerate_triangles > 0) {
    std::fprintf(stderr,
                 "%s: %zu open, %zu non-manifold, %zu inconsistently oriented edges, %zu "
                 "triangles without area\n",
                 mesh.name.c_str(), health.boundary_edges, health.non_manifold_edges,
                 health.misoriented_edges, health.degenerate_triangles);
  }
  return {std::move(mesh), turned};
}

void RequireFolder(const char* option, const std::filesystem::path& file) {
  const std::filesystem::path folder = file.parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder)) {
    throw StepInputError(option + (" " + file.string()) + ": no such folder");
  }
}

// Faces of all bodies, as meshed. Those that no tolerance and no datum names are left out where all
// of them would make the file unwieldy.
std::vector<FaceTriangles> FacesToWrite(const StepModel& model, const std::vector<bool>& turned,
                                        ToleranceReport& report) {
  constexpr std::size_t kManyTriangles = 500'000;
  std::vector<FaceTriangles> faces;
  std::size_t triangles = 0;
  for (std::size_t b = 0; b < model.bodies.size(); ++b) {
    for (FaceTriangles& face : TriangulatedFaces(model.bodies[b].shape, turned[b])) {
      face.face = static_cast<int>(faces.size() + 1);
      triangles += face.triangles.size();
      faces.push_back(std::move(face));
    }
  }
  if (triangles <= kManyTriangles) return faces;
  std::set<int> named;
  for (const auto* list : {&report.read, &report.untoleranced}) {
    for (const Tolerance& tolerance : *list) {
      named.insert(tolerance.faces.begin(), tolerance.faces.end());
    }
  }
  for (const Datum& datum : report.datums) named.insert(datum.faces.begin(), datum.faces.end());
  std::erase_if(faces, [&](const FaceTriangles& face) { return !named.contains(face.face); });
  report.notes.push_back("the part has " + std::to_string(triangles) +
                         " triangles; only faces with a tolerance, dimension or datum are given");
  return faces;
}

void WriteTolerances(const StepModel& model, const std::vector<bool>& turned,
                     const Arguments& arguments) {
  ToleranceReport report = *model.tolerances;
  const std::vector<FaceTriangles> faces = FacesToWrite(model, turned, report);
  const std::string json = ToJson(ToleranceReportToProto(report, faces)) + "\n";
  if (arguments.tolerances == "-") {
    if (std::fwrite(json.data(), 1, json.size(), stdout) != json.size() ||
        std::fflush(stdout) != 0) {
      throw std::runtime_error("standard output cannot be written");
    }
    return;
  }
  const absl::Status status = WriteFileAtomically(arguments.tolerances.string(), json);
  if (!status.ok()) throw std::runtime_error(std::string(status.message()));
}

// A file's model, and the mesh of each of its bodies.
struct MeshedModel {
  StepModel model;
  std::vector<ShapeMesh> meshes;
  std::vector<bool> turned;
};

// Throws StepInputError for whatever goes wrong in the geometry of the file, inside OpenCASCADE,
// too; std::bad_alloc when memory ends.
MeshedModel ReadAndMesh(const StepText& text, const Arguments& arguments) {
  const CrashReport crashes(std::string(kProgram) + ": " + text.name +
                                ": OpenCASCADE crashed when it translated the file; its geometry "
                                "is damaged, or of a kind that OpenCASCADE does not read",
                            kInputWrong);
  try {
    StepReadOptions reading = arguments.reading;
    reading.with_tolerances = !arguments.tolerances.empty();
    MeshedModel meshed;
    meshed.model = ReadStep(text, reading);
    for (const std::string& remark : meshed.model.remarks) {
      std::fprintf(arguments.log(), "%s%s\n", kRemark, OneLine(remark).c_str());
    }
    for (const StepBody& body : meshed.model.bodies) {
      BodyMesh mesh = MeshBody(text.name, body, arguments.meshing, arguments.log());
      if (!body.shape.IsNull()) {
        for (const std::string& remark : FacesOfOtherArea(body.shape, arguments.meshing)) {
          std::fprintf(arguments.log(), "%s%s: %s\n", kRemark, OneLine(body.name).c_str(),
                       remark.c_str());
        }
      }
      meshed.meshes.push_back(std::move(mesh.mesh));
      meshed.turned.push_back(mesh.turned);
    }
    return meshed;
  } catch (const Standard_OutOfMemory&) {
    throw std::bad_alloc();
  } catch (const Standard_Failure& failure) {
    throw StepInputError(text.name + ": OpenCASCADE cannot translate the file: " +
                         failure.DynamicType()->Name() + ": " + failure.GetMessageString());
  }
}

void Import(const Arguments& arguments) {
  if (arguments.out.empty() && arguments.tolerances.empty()) {
    throw StepInputError("nothing to do: give --out, --tolerances or both");
  }
  RequireFolder("--out", arguments.out);
  RequireFolder("--tolerances", arguments.tolerances);
  StepText text = arguments.in == "-" ? ReadStepTextFromInput(arguments.NameOfInput())
                                      : ReadStepText(arguments.in);
  text.name = arguments.NameOfInput();
  const MeshedModel meshed = ReadAndMesh(text, arguments);
  if (!arguments.tolerances.empty()) WriteTolerances(meshed.model, meshed.turned, arguments);
  if (arguments.out.empty()) return;
  GlbDescription description;
  description.generator = kProgram;
  description.extras["source_file"] = std::filesystem::path(text.name).filename().string();
  description.extras["chord_tolerance_mm"] = arguments.meshing.chord_tolerance_mm;
  description.extras["angular_tolerance_deg"] = arguments.meshing.angular_tolerance_deg;
  description.extras["step_length_unit"] = meshed.model.length_unit;
  WriteGlb(meshed.meshes, description, arguments.out);
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::EndWithParent();
  sightline::Arguments arguments;
  CLI::App app(
      "Meshes the solids of a STEP file and writes them as GLB, in metres; reads its tolerances.");
  app.set_version_flag("--version", sightline::VersionText("sightline_step_import"));
  app.add_option("IN", arguments.in, "STEP file (AP203, AP214, AP242); -: standard input")
      ->required();
  app.add_option("--name", arguments.name, "what messages call the file; default: IN");
  app.add_option("--unit", arguments.reading.unit,
                 "length unit of a file that states none: m, cm, mm, um, inch")
      ->transform(sightline::NameOfLengthUnit());
  app.add_flag("--construction-geometry", arguments.reading.construction_geometry,
               "mesh construction geometry and surface models beside a solid as well");
  app.add_option("--out", arguments.out, "GLB file to write");
  app.add_option("--tolerances", arguments.tolerances,
                 "JSON file to write: the file's tolerances, what could not be read of them, and "
                 "the triangles of its faces; -: standard output");
  app.add_option("--chord-tolerance-mm", arguments.meshing.chord_tolerance_mm,
                 "largest distance between triangles and surface")
      ->check(CLI::Range(1e-4, 1e3))
      ->capture_default_str();
  app.add_option("--angular-tolerance-deg", arguments.meshing.angular_tolerance_deg,
                 "largest turn of the normal across a facet")
      ->check(CLI::Range(0.1, 90.0))
      ->capture_default_str();
  sightline::RequireStrictNumbers(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : sightline::kInputWrong;
  }
  // OpenCASCADE would report on stdout.
  Message::DefaultMessenger()->ChangePrinters().Clear();
  try {
    sightline::Import(arguments);
    return 0;
  } catch (const sightline::StepInputError& error) {
    std::fprintf(stderr, "%s: %s\n", sightline::kProgram, error.what());
    return sightline::kInputWrong;
  } catch (const Standard_Failure& failure) {
    std::fprintf(stderr, "%s: %s: %s: %s\n", sightline::kProgram, arguments.NameOfInput().c_str(),
                 failure.DynamicType()->Name(), failure.GetMessageString());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s: %s\n", sightline::kProgram, arguments.NameOfInput().c_str(),
                 error.what());
  }
  return sightline::kFailed;
}
