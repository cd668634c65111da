#include <cstdio>
#include <memory>
#include <string>

#include "core/json/strict_json.h"
#include "core/part/load_part.h"
#include "core/part/part_health.h"
#include "core/part/part_health_proto.h"
#include "planner_client/commands/commands.h"
#include "planner_client/commands/exit_code.h"

namespace sightline {

Command AddPartCommand(CLI::App& app) {
  struct Options {
    std::string file, unit;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  app.add_option("file", options->file, "part file (.glb, .gltf, .stl, .ply, .obj)")->required();
  app.add_option("--unit", options->unit, "length unit of the file: m, cm, mm, um, inch");
  app.add_flag("--json", options->json, "print the report as JSON");
  return [options]() -> int {
    const auto mesh = LoadPart(options->file, options->unit);
    if (!mesh.ok()) return ReportError(mesh.status());
    const PartHealth health = CheckPartHealth(*mesh);
    if (options->json) {
      std::printf("%s\n", ToJson(PartHealthToProto(health)).c_str());
      return kExitDone;
    }
    const Eigen::Vector3d size = 1e3 * health.bounding_box_m.sizes();
    std::printf("size              %.2f x %.2f x %.2f mm\n", size.x(), size.y(), size.z());
    const auto line = [](const char* name, int64_t value) {
      std::printf("%-18s%lld\n", name, static_cast<long long>(value));
    };
    line("triangles", health.triangle_count);
    line("vertices", health.vertex_count);
    std::printf("%-18s%.2f cm2\n", "area", 1e4 * health.area_m2);
    line("components", health.component_count);
    line("open edges", health.open_edge_count);
    line("non-manifold", health.non_manifold_edge_count);
    line("degenerate", health.degenerate_triangle_count);
    line("duplicate", health.duplicate_triangle_count);
    line("flipped", health.flipped_component_count);
    for (const std::string& finding : health.findings) std::printf("- %s\n", finding.c_str());
    if (health.findings.empty()) std::printf("- nothing that hinders planning\n");
    return kExitDone;
  };
}

}  // namespace sightline
