// sightline_step_import: STEP to GLB, one node per solid, metres, coordinates as modelled.
// Exit codes: 0 done; 1 failed while running; 2 the input is wrong.

#include <CLI/CLI.hpp>
#include <Message.hxx>
#include <Message_Messenger.hxx>
#include <Standard_Failure.hxx>
#include <algorithm>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "tools/step_import/glb_writer.h"
#include "tools/step_import/shape_mesh.h"
#include "tools/step_import/step_reader.h"

namespace sightline {
namespace {

constexpr int kFailed = 1;
constexpr int kInputWrong = 2;

struct Arguments {
  std::filesystem::path in;
  std::filesystem::path out;
  MeshingOptions meshing;
};

TriangleMesh MeshBody(const StepBody& body, const MeshingOptions& meshing) {
  TriangleMesh mesh = MeshShape(body.shape, meshing);
  mesh.name = body.name;
  MeshHealth health = CheckMesh(mesh);
  if (health.watertight() && health.volume_mm3 < 0.0) {
    std::fprintf(stderr, "%s: inside out in the file; turned\n", mesh.name.c_str());
    for (auto& triangle : mesh.triangles) std::swap(triangle[1], triangle[2]);
    health = CheckMesh(mesh);
  }
  std::printf("%s: %zu triangles, %.6f m2, %.3f cm3, %s\n", mesh.name.c_str(),
              mesh.triangles.size(), health.area_mm2 * 1e-6, health.volume_mm3 * 1e-3,
              health.watertight() ? "watertight" : "NOT watertight");
  if (!health.watertight() || health.degenerate_triangles > 0) {
    std::fprintf(stderr,
                 "%s: %zu open, %zu non-manifold, %zu inconsistently oriented edges, %zu "
                 "triangles without area\n",
                 mesh.name.c_str(), health.boundary_edges, health.non_manifold_edges,
                 health.misoriented_edges, health.degenerate_triangles);
  }
  return mesh;
}

void Import(const Arguments& arguments) {
  const std::filesystem::path folder = arguments.out.parent_path();
  if (!folder.empty() && !std::filesystem::is_directory(folder)) {
    throw StepInputError("--out " + arguments.out.string() + ": no such folder");
  }
  const StepModel model = ReadStep(arguments.in);
  std::vector<TriangleMesh> meshes;
  for (const StepBody& body : model.bodies) meshes.push_back(MeshBody(body, arguments.meshing));
  GlbDescription description;
  description.generator = "sightline_step_import";
  description.extras["source_file"] = arguments.in.filename().string();
  description.extras["chord_tolerance_mm"] = arguments.meshing.chord_tolerance_mm;
  description.extras["angular_tolerance_deg"] = arguments.meshing.angular_tolerance_deg;
  description.extras["step_length_unit"] = model.length_unit;
  WriteGlb(meshes, description, arguments.out);
}

}  // namespace
}  // namespace sightline

int main(int argc, char** argv) {
  sightline::Arguments arguments;
  CLI::App app("Meshes the solids of a STEP file and writes them as GLB, in metres.");
  app.add_option("IN", arguments.in, "STEP file (AP203, AP214, AP242)")->required();
  app.add_option("--out", arguments.out, "GLB file to write")->required();
  app.add_option("--chord-tolerance-mm", arguments.meshing.chord_tolerance_mm,
                 "largest distance between triangles and surface")
      ->check(CLI::Range(1e-4, 1e3))
      ->capture_default_str();
  app.add_option("--angular-tolerance-deg", arguments.meshing.angular_tolerance_deg,
                 "largest turn of the normal across a facet")
      ->check(CLI::Range(0.1, 90.0))
      ->capture_default_str();
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
    std::fprintf(stderr, "sightline_step_import: %s\n", error.what());
    return sightline::kInputWrong;
  } catch (const Standard_Failure& failure) {
    std::fprintf(stderr, "sightline_step_import: %s: %s: %s\n", arguments.in.c_str(),
                 failure.DynamicType()->Name(), failure.GetMessageString());
  } catch (const std::exception& error) {
    std::fprintf(stderr, "sightline_step_import: %s: %s\n", arguments.in.c_str(), error.what());
  }
  return sightline::kFailed;
}
