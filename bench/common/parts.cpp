// SPDX-License-Identifier: Apache-2.0
#include "bench/common/parts.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "bench/common/measure.h"
#include "core/part/load_part.h"
#include "core/targets/poisson_disk.h"

namespace sightline::bench {
namespace {

namespace fs = std::filesystem;

fs::path SourceFolder() {
  const char* folder = std::getenv("SIGHTLINE_SOURCE_DIR");
  return folder != nullptr ? fs::path(folder) : fs::current_path();
}

fs::path SharedFolder() {
  const char* folder = std::getenv("SIGHTLINE_SHARED_DIR");
  return folder != nullptr ? fs::path(folder) : SourceFolder() / "../shared";
}

struct PartFile {
  fs::path path;
  std::string unit;
  double length_m = 0;  // scaled so that the longest side has this length; 0: as it is
};

PartFile FileOf(const std::string& name) {
  const fs::path cad = SharedFolder() / "data/cad";
  if (name == "head") return {SourceFolder() / "examples/cylinder_head/cylinder_head.glb", ""};
  if (name == "bracket-262") return {cad / "brackets/262.obj", "mm"};
  if (name == "bracket-320") return {cad / "brackets/320.obj", "mm"};
  if (name == "inline4-head") return {cad / "inline4_engine/Cylinder Head.STL", "mm", 0.45};
  std::string known;
  for (const std::string& n : PartNames()) known += " " + n;
  Fail("--parts", "\"" + name + "\" is none of" + known);
}

}  // namespace

const std::vector<std::string>& PartNames() {
  static const std::vector<std::string> names = {"head", "bracket-262", "bracket-320",
                                                 "inline4-head"};
  return names;
}

std::unique_ptr<TriangleMesh> LoadBenchPart(const std::string& name) {
  const PartFile file = FileOf(name);
  if (name != "head" && !fs::exists(file.path)) {
    std::printf("%s: skipped: no shared data\n", name.c_str());
    return nullptr;
  }
  auto mesh = LoadPart(file.path, file.unit);
  if (!mesh.ok()) Fail(name, std::string(mesh.status().message()));
  if (file.length_m > 0) {
    const double scale = file.length_m / mesh->BoundingBox().sizes().maxCoeff();
    for (Eigen::Vector3f& p : mesh->positions_m) p *= static_cast<float>(scale);
  }
  return std::make_unique<TriangleMesh>(std::move(*mesh));
}

double SpacingForTargets(const TriangleMesh& mesh, double targets) {
  double area_m2 = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) area_m2 += mesh.Area(t);
  // Poisson-disk samples of spacing r have a density of about 0.7 / r^2; edges add some.
  TargetSampling sampling;
  sampling.spacing_m = std::sqrt(0.7 * area_m2 / targets);
  for (int i = 0; i < 2; ++i) {
    auto set = SampleTargets(mesh, sampling);
    if (!set.ok()) Fail("targets", std::string(set.status().message()));
    sampling.spacing_m *= std::sqrt(static_cast<double>(set->size()) / targets);
  }
  return sampling.spacing_m;
}

std::unique_ptr<CoverageScene> BuildScene(const TriangleMesh& mesh, double spacing_m) {
  SceneDefinition definition;
  definition.part = mesh;
  definition.sampling.spacing_m = spacing_m;
  auto scene = CoverageScene::Build(std::move(definition), {});
  if (!scene.ok()) Fail("scene", std::string(scene.status().message()));
  return std::move(*scene);
}

}  // namespace sightline::bench
