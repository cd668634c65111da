// SPDX-License-Identifier: Apache-2.0
#include "render_worker/render/part_scene.h"

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "core/inspection/vector_proto.h"
#include "core/status/status_macros.h"

namespace sightline {
namespace {

// Obstacles have no material of their own: grey, matt.
constexpr double kObstacleAlbedo = 0.5;

std::string Quoted(const std::string& text) { return absl::StrCat("\"", text, "\""); }

std::string MaterialContext(const MaterialChoice& choice, size_t index) {
  return choice.material.name().empty() ? absl::StrCat("materials[", index, "]")
                                        : absl::StrCat("material ", choice.material.name());
}

// Rotation and shift that take the coordinates of an obstacle into those of the part.
struct ToPart {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d shift_m = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& x) const { return rotation * x + shift_m; }
};

ToPart WorldToPartMap(const ScanGeometry& geometry, const Eigen::Vector3d& centre_m,
                      double stage_m) {
  ToPart map;
  map.rotation = geometry.part_rotation.transpose();
  map.shift_m =
      centre_m - map.rotation * (geometry.part_offset_m + stage_m * Eigen::Vector3d::UnitX());
  return map;
}

TriangleMesh Moved(const TriangleMesh& mesh, const ToPart& map) {
  TriangleMesh moved = mesh;
  for (Eigen::Vector3f& position : moved.positions_m) {
    position = map(position.cast<double>()).cast<float>();
  }
  return moved;
}

}  // namespace

PartScene::PartScene(PartSceneInput input) : input_(std::move(input)) {}

absl::StatusOr<std::unique_ptr<PartScene>> PartScene::Make(PartSceneInput input) {
  std::unique_ptr<PartScene> scene(new PartScene(std::move(input)));
  SIGHTLINE_RETURN_IF_ERROR(scene->Prepare());
  return scene;
}

absl::Status PartScene::Prepare() {
  const Inspection& inspection = input_.inspection;
  part_box_ = input_.part.BoundingBox();
  part_centre_m_ = part_box_.center();
  if (std::any_of(inspection.obstacles.begin(), inspection.obstacles.end(),
                  [](const auto& o) { return o.frame == ObstacleFrame::kTable; })) {
    // All vertices: looking through them takes less than a hull does, which nothing can stop.
    auto points = std::make_shared<std::vector<Eigen::Vector3d>>();
    points->reserve(input_.part.positions_m.size());
    for (const Eigen::Vector3f& position : input_.part.positions_m) {
      points->push_back(position.cast<double>() - part_centre_m_);
    }
    input_.inspection.rig.part_support_points_m = std::move(points);
  }

  // Surfaces of the part: one name for all if the file names none.
  const std::vector<std::string> surfaces = input_.part.material_names.empty()
                                                ? std::vector<std::string>{""}
                                                : input_.part.material_names;
  std::map<std::string, uint16_t> by_surface;
  std::optional<uint16_t> fallback;
  std::vector<std::string> names;
  for (const std::string& surface : surfaces) {
    if (!surface.empty()) names.push_back(Quoted(surface));
  }
  for (size_t i = 0; i < inspection.materials.size(); ++i) {
    const MaterialChoice& choice = inspection.materials[i];
    if (!choice.part_material.empty() &&
        std::find(surfaces.begin(), surfaces.end(), choice.part_material) == surfaces.end()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "materials[", i, "].part_material is ", Quoted(choice.part_material), ", but the part ",
          names.empty() ? "names no materials"
                        : absl::StrCat("has only ", absl::StrJoin(names, ", "))));
    }
    SIGHTLINE_ASSIGN_OR_RETURN(auto material,
                               MakeMaterial(choice.material, inspection.rig.laser.wavelength_m,
                                            input_.assets, MaterialContext(choice, i)));
    materials_.push_back(std::move(material));
    material_names_.push_back(choice.material.name());
    const auto index = static_cast<uint16_t>(i);
    if (choice.part_material.empty()) {
      fallback = index;
    } else {
      by_surface[choice.part_material] = index;
    }
  }
  std::vector<uint16_t> material_of_surface(surfaces.size(), 0);
  std::vector<bool> has_triangles(surfaces.size(), input_.part.triangle_material.empty());
  for (const uint16_t surface : input_.part.triangle_material) has_triangles[surface] = true;
  for (size_t s = 0; s < surfaces.size(); ++s) {
    const auto found = by_surface.find(surfaces[s]);
    if (found != by_surface.end()) {
      material_of_surface[s] = found->second;
    } else if (fallback) {
      material_of_surface[s] = *fallback;
    } else if (has_triangles[s]) {
      return absl::InvalidArgumentError(absl::StrCat(
          "materials: no entry for ",
          surfaces[s].empty() ? "surfaces without a name"
                              : absl::StrCat("the part's material ", Quoted(surfaces[s])),
          "; add one with that part_material, or one without part_material for all others"));
    } else {
      continue;
    }
  }
  triangle_material_.reserve(input_.part.triangle_material.size());
  for (const uint16_t surface : input_.part.triangle_material) {
    triangle_material_.push_back(material_of_surface[surface]);
  }
  if (triangle_material_.empty()) {
    triangle_material_.assign(input_.part.triangles.size(), material_of_surface[0]);
  }

  v1::Material grey;
  grey.set_name("obstacle");
  grey.mutable_lambert()->set_diffuse_albedo(kObstacleAlbedo);
  SIGHTLINE_ASSIGN_OR_RETURN(auto obstacle, MakeMaterial(grey, inspection.rig.laser.wavelength_m,
                                                         input_.assets, "obstacles"));
  materials_.push_back(std::move(obstacle));
  material_names_.push_back("obstacle");

  const v1::Lighting& lighting = inspection.lighting;
  if (lighting.ambient().radiance_w_m2_sr() > 0) {
    SIGHTLINE_ASSIGN_OR_RETURN(
        ambient_, ParseSourceSpectrum(lighting.ambient().spectrum(), "lighting.ambient.spectrum"));
    for (float& bin : ambient_) {
      bin *= static_cast<float>(lighting.ambient().radiance_w_m2_sr());
    }
    has_incoherent_light_ = true;
  }
  for (int i = 0; i < lighting.area_lights_size(); ++i) {
    const v1::AreaLight& light = lighting.area_lights(i);
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto spectrum, ParseSourceSpectrum(light.spectrum(),
                                           absl::StrCat("lighting.area_lights[", i, "].spectrum")));
    for (float& bin : spectrum) bin *= static_cast<float>(light.radiance_w_m2_sr());
    area_light_spectra_.push_back(spectrum);
    has_incoherent_light_ = true;
  }
  for (size_t i = 0; i < input_.obstacles.size(); ++i) {
    if (inspection.obstacles[i].frame == ObstacleFrame::kPart) {
      part_box_.extend(input_.obstacles[i].BoundingBox());
    }
  }
  return absl::OkStatus();
}

Spectrum PartScene::LightSpectrum() const {
  Spectrum sum = ambient_;
  for (const Spectrum& light : area_light_spectra_) {
    for (int bin = 0; bin < kSpectralBins; ++bin) sum[bin] += light[bin];
  }
  return sum;
}

absl::StatusOr<std::shared_ptr<const LightTransport>> PartScene::TransportAt(
    const Measurement& measurement, double stage_position_m) {
  const Inspection& inspection = input_.inspection;
  // The inputs that the scene in part coordinates depends on.
  std::vector<double> key;
  bool turns = false, travels = inspection.lighting.area_lights_size() > 0;
  for (const ObstacleSource& obstacle : inspection.obstacles) {
    turns =
        turns || obstacle.frame == ObstacleFrame::kStage || obstacle.frame == ObstacleFrame::kTable;
    travels = travels || obstacle.frame == ObstacleFrame::kWorld;
  }
  if (turns || travels) {
    const auto parameters = ToArray(measurement);
    key.assign(parameters.begin(), parameters.end());
  }
  if (travels) key.push_back(stage_position_m);
  std::lock_guard lock(mutex_);
  if (transport_ != nullptr && key == built_for_) return transport_;

  const ScanGeometry geometry = MakeScanGeometry(inspection.rig, measurement);
  const ToPart from_world = WorldToPartMap(geometry, part_centre_m_, stage_position_m);
  // The stage's frame: axes of the world, origin at the part's centre.
  ToPart from_stage;
  from_stage.rotation = geometry.part_rotation.transpose();
  from_stage.shift_m = part_centre_m_;
  ToPart from_table = from_stage;
  from_table.shift_m += from_stage.rotation * Eigen::Vector3d(0, 0, geometry.table_height_m);

  SceneDescription scene;
  scene.materials = materials_;
  scene.meshes.push_back({input_.part, triangle_material_});
  const auto obstacle_material = static_cast<uint16_t>(materials_.size() - 1);
  for (size_t i = 0; i < input_.obstacles.size(); ++i) {
    const ObstacleFrame frame = inspection.obstacles[i].frame;
    const ToPart map = frame == ObstacleFrame::kPart    ? ToPart()
                       : frame == ObstacleFrame::kStage ? from_stage
                       : frame == ObstacleFrame::kTable ? from_table
                                                        : from_world;
    TriangleMesh mesh = Moved(input_.obstacles[i], map);
    std::vector<uint16_t> material(mesh.triangles.size(), obstacle_material);
    scene.meshes.push_back({std::move(mesh), std::move(material)});
  }
  for (size_t i = 0; i < area_light_spectra_.size(); ++i) {
    const v1::AreaLight& light = inspection.lighting.area_lights(static_cast<int>(i));
    scene.area_lights.push_back({from_world(VectorFromProto(light.centre_m())),
                                 from_world.rotation * VectorFromProto(light.half_edge_u_m()),
                                 from_world.rotation * VectorFromProto(light.half_edge_v_m()),
                                 area_light_spectra_[i]});
  }
  scene.ambient_radiance_w_m2_sr = ambient_;
  SIGHTLINE_ASSIGN_OR_RETURN(transport_, LightTransport::Make(std::move(scene)));
  built_for_ = key;
  return transport_;
}

}  // namespace sightline
