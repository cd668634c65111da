// SPDX-License-Identifier: Apache-2.0
#include "report/plan/plan_scene.h"

#include <meshoptimizer.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <numeric>
#include <span>
#include <utility>
#include <variant>

#include "core/part/point_index.h"
#include "report/document/packed_numbers.h"
#include "report/plan/surface/uncovered_reasons.h"

namespace sightline {
namespace {

static_assert(std::endian::native == std::endian::little,
              "floats are written as they are in memory");

// Limit for obstacles, so that the page opens quickly; larger ones are left out.
constexpr size_t kMaxObstacleTriangles = 200000;
// Lengths are coded as 16-bit steps of equal ratio from 1 nm to 1 m (0.03 % each).
constexpr double kLowestM = 1e-9, kHighestM = 1;

using Numbers = google::protobuf::RepeatedField<double>;

template <class Vector>
void Put(const Vector& values, Numbers* numbers) {
  numbers->Assign(values.begin(), values.end());
}

// 4 x 4, row by row.
void PutMatrix(const Eigen::Matrix4d& matrix, Numbers* numbers) {
  for (int i = 0; i < 16; ++i) numbers->Add(matrix(i / 4, i % 4));
}

template <class T>
std::string PackFloats(const std::vector<T>& values) {
  return PackBytes(
      absl::string_view(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T)));
}

// Positions as 16-bit steps inside a cube around everything: 7 um on a 450 mm part.
class Quantiser {
 public:
  explicit Quantiser(const Eigen::AlignedBox3d& bounds)
      : origin_m_(bounds.min()), quantum_m_(std::max(bounds.sizes().maxCoeff() / 65535.0, 1e-12)) {}

  const Eigen::Vector3d& origin_m() const { return origin_m_; }
  double quantum_m() const { return quantum_m_; }

  void Append(const Eigen::Vector3f& position_m, std::vector<uint16_t>* steps) const {
    for (int axis = 0; axis < 3; ++axis) {
      const double step = (position_m[axis] - origin_m_[axis]) / quantum_m_;
      steps->push_back(static_cast<uint16_t>(std::clamp(std::round(step), 0.0, 65535.0)));
    }
  }

  std::string Pack(const std::vector<Eigen::Vector3f>& positions_m) const {
    std::vector<uint16_t> steps;
    for (const Eigen::Vector3f& position_m : positions_m) Append(position_m, &steps);
    return PackNumbers(steps, 3);
  }

 private:
  Eigen::Vector3d origin_m_;
  double quantum_m_;
};

uint16_t LengthCode(double length_m) {
  if (!(length_m > 0)) return 0;
  const double place = std::log(length_m / kLowestM) / std::log(kHighestM / kLowestM);
  return static_cast<uint16_t>(1 + std::lround(65534 * std::clamp(place, 0.0, 1.0)));
}

template <class T>
v1::SceneLengths Lengths(const std::vector<T>& lengths_m) {
  std::vector<uint16_t> codes;
  codes.reserve(lengths_m.size());
  for (const T length_m : lengths_m) codes.push_back(LengthCode(length_m));
  v1::SceneLengths lengths;
  lengths.set_lowest_m(kLowestM);
  lengths.set_highest_m(kHighestM);
  lengths.set_codes(PackNumbers(codes));
  return lengths;
}

// Vertices in the order of their use by triangles, so that neighbours in the lists are neighbours
// on the surface.
v1::SceneMesh Mesh(const DisplayMesh& mesh, const Quantiser& quantiser) {
  const size_t vertices = mesh.positions_m.size();
  std::vector<uint32_t> corners;
  for (const auto& triangle : mesh.triangles) {
    corners.insert(corners.end(), triangle.begin(), triangle.end());
  }
  std::vector<uint32_t> ordered(corners.size()), place_of(vertices);
  meshopt_optimizeVertexCache(ordered.data(), corners.data(), corners.size(), vertices);
  const size_t used =
      meshopt_optimizeVertexFetchRemap(place_of.data(), ordered.data(), ordered.size(), vertices);
  for (uint32_t& corner : ordered) corner = place_of[corner];
  std::vector<Eigen::Vector3f> positions_m(used);
  std::vector<uint8_t> normals(3 * used);
  std::vector<uint32_t> nearest_target(mesh.nearest_target.empty() ? 0 : used);
  for (size_t v = 0; v < vertices; ++v) {
    const size_t at = place_of[v];
    if (at >= used) continue;  // no triangle uses it
    positions_m[at] = mesh.positions_m[v];
    for (int axis = 0; axis < 3; ++axis) {
      normals[3 * at + static_cast<size_t>(axis)] = static_cast<uint8_t>(
          static_cast<int8_t>(std::lround(127.0F * std::clamp(mesh.normals[v][axis], -1.F, 1.F))));
    }
    if (!nearest_target.empty()) nearest_target[at] = mesh.nearest_target[v];
  }
  std::vector<uint16_t> edges;
  for (const auto& edge : mesh.feature_edges_m) {
    for (const Eigen::Vector3f& end_m : edge) quantiser.Append(end_m, &edges);
  }
  v1::SceneMesh packed;
  packed.set_positions(quantiser.Pack(positions_m));
  packed.set_normals(PackNumbers(normals, 3));
  packed.set_nearest_target(PackNumbers(nearest_target));
  packed.set_triangles(PackNumbers(ordered, 3));
  packed.set_edges(PackNumbers(edges, 3));
  return packed;
}

template <class Solids>
void PutBodies(const std::vector<Body>& bodies, Solids* solids) {
  for (const Body& body : bodies) {
    v1::SceneSolid& solid = *solids->Add();
    if (const auto* box = std::get_if<BoxBody>(&body)) {
      Put(box->centre_m, solid.mutable_centre_m());
      Put(box->size_m, solid.mutable_size_m());
      continue;
    }
    const auto& cylinder = std::get<CylinderBody>(body);
    Put(cylinder.centre_m, solid.mutable_centre_m());
    solid.set_radius_m(cylinder.radius_m);
    solid.set_length_m(cylinder.length_m);
  }
}

v1::SceneRig SceneRigOf(const Rig& rig) {
  v1::SceneRig shown;
  shown.set_vertical_fov_rad(rig.camera.vertical_fov_rad);
  shown.set_aspect(static_cast<double>(rig.camera.columns_px) / rig.camera.rows_px);
  shown.set_fan_angle_rad(rig.laser.fan_angle_rad);
  PutBodies(rig.camera_bodies, shown.mutable_camera_bodies());
  PutBodies(rig.laser_bodies, shown.mutable_laser_bodies());
  return shown;
}

v1::SceneSolid RobotSolid(const ReportSolid& solid) {
  v1::SceneSolid shown;
  if (!solid.triangles_m.empty()) {
    shown.set_triangles(PackFloats(solid.triangles_m));
  } else if (solid.radius_m > 0) {
    shown.set_radius_m(solid.radius_m);
    shown.set_length_m(solid.length_m);
  } else {
    Put(solid.box_m, shown.mutable_size_m());
  }
  return shown;
}

// A hundredth of a millimetre is less than the screen shows.
void PutRounded(const std::vector<Eigen::Isometry3d>& poses, Numbers* numbers) {
  for (const Eigen::Isometry3d& pose : poses) {
    PutMatrix((pose.matrix() * 1e5).array().round().matrix() / 1e5, numbers);
  }
}

v1::SceneScan Scan(const ReportData& data, int i) {
  const v1::PlannedScan& scan = data.plan.scans(i);
  v1::SceneScan shown;
  shown.set_covered(PackBytes(data.scans[static_cast<size_t>(i)].covered.ToBytes()));
  *shown.mutable_camera_pose() = scan.camera_pose().matrix();
  *shown.mutable_laser_pose() = scan.laser_pose().matrix();
  // The part moves along +x of the world; seen from the part the sensors move the other way.
  for (int axis = 0; axis < 3; ++axis) {
    shown.add_sensor_direction(-scan.part_pose().matrix(axis));
  }
  shown.set_camera_distance_m(scan.measurement().camera_distance_m());
  shown.set_laser_distance_m(
      data.rig.laser.distance_m.value_or(scan.measurement().camera_distance_m()));
  shown.set_stage_start_m(scan.stage_start_m());
  shown.set_stage_end_m(scan.stage_end_m());
  if (data.robot) {
    const ReportRobot::ScanPoses& poses = data.robot->scans[static_cast<size_t>(i)];
    PutRounded(poses.start, shown.mutable_robot_start());
    PutRounded(poses.end, shown.mutable_robot_end());
  }
  return shown;
}

// Pose x_part = M x_frame with the stage at its start. The stage's frame has its origin at the
// part's centre, the table's frame below it.
Eigen::Matrix4d FramePose(v1::Obstacle::Frame frame, const v1::PlannedScan& scan) {
  Eigen::Matrix4d world_from_part;
  for (int i = 0; i < 16; ++i) world_from_part(i / 4, i % 4) = scan.part_pose().matrix(i);
  Eigen::Matrix4d world_from_frame = Eigen::Matrix4d::Identity();
  if (frame == v1::Obstacle::FRAME_WORLD) {
    world_from_frame(0, 3) = -scan.stage_start_m();
  } else {
    world_from_frame(1, 3) = scan.measurement().offset_y_m();
    world_from_frame(2, 3) = frame == v1::Obstacle::FRAME_TABLE ? scan.table_height_m()
                                                                : scan.measurement().offset_z_m();
  }
  return world_from_part.inverse() * world_from_frame;
}

void PutObstacles(const ReportData& data, v1::ReportScene* scene) {
  size_t triangles = 0;
  for (const ReportObstacle& obstacle : data.obstacles) {
    triangles += obstacle.mesh->triangles.size();
    if (triangles > kMaxObstacleTriangles) break;
    v1::DrawnObstacle& shown = *scene->add_obstacles();
    shown.set_name(obstacle.name);
    shown.set_turns_with_part(obstacle.frame == v1::Obstacle::FRAME_PART);
    shown.set_stands_still(obstacle.frame == v1::Obstacle::FRAME_WORLD);
    shown.set_positions(PackFloats(obstacle.mesh->positions_m));
    std::vector<uint32_t> corners;
    for (const auto& triangle : obstacle.mesh->triangles) {
      corners.insert(corners.end(), triangle.begin(), triangle.end());
    }
    shown.set_triangles(PackNumbers(corners, 3));
    if (shown.turns_with_part()) continue;
    for (const v1::PlannedScan& scan : data.plan.scans()) {
      PutMatrix(FramePose(obstacle.frame, scan), shown.mutable_poses());
    }
  }
}

v1::SceneReasons Reasons(const ReportData& data) {
  std::vector<std::string> names;
  for (const ReportObstacle& obstacle : data.obstacles) names.push_back(obstacle.name);
  std::vector<uint32_t> all(data.targets.size());
  std::iota(all.begin(), all.end(), 0U);
  v1::SceneReasons reasons;
  std::map<std::pair<int, std::string>, uint8_t> number_of;
  for (const v1::UncoveredCount& count :
       JoinMeasurable(CountReasons(data.reasons, data.measurable, names, all))) {
    v1::SceneReasons::Kind& kind = *reasons.add_kinds();
    kind.set_reason(count.reason());
    kind.set_text(ReasonWords(count, data.permitted_exposures));
    kind.set_targets(count.targets());
    number_of[{count.reason(), count.obstacle()}] = static_cast<uint8_t>(reasons.kinds_size());
  }
  std::vector<uint8_t> of_target;
  for (const TargetReason& reason : data.reasons) {
    const bool named = reason.obstacle >= 0 && static_cast<size_t>(reason.obstacle) < names.size();
    const auto kind = number_of.find(
        {reason.reason, named ? names[static_cast<size_t>(reason.obstacle)] : std::string()});
    of_target.push_back(kind == number_of.end() ? 0 : kind->second);
  }
  reasons.set_of_target(PackNumbers(of_target));
  return reasons;
}

// Sensitivity of the measured point nearest to each target that a scan covers.
v1::SceneSensitivity Sensitivity(const ScanSensitivityMap& map, const TargetSet& targets,
                                 const TargetBits& covered) {
  v1::SceneSensitivity sensitivity;
  if (map.positions_m.empty()) return sensitivity;
  const PointIndex<3> index(map.positions_m);
  std::vector<float> detection_m(targets.size(), 0), calibration_m(targets.size(), 0);
  for (size_t i = 0; i < targets.size(); ++i) {
    if (!covered.Test(i)) continue;
    const uint32_t nearest = index.Nearest(targets.positions_m[i]);
    detection_m[i] = map.detection_m[nearest];
    if (!map.calibration_m.empty()) calibration_m[i] = map.calibration_m[nearest];
  }
  *sensitivity.mutable_detection() = Lengths(detection_m);
  if (!map.calibration_m.empty()) *sensitivity.mutable_calibration() = Lengths(calibration_m);
  return sensitivity;
}

v1::ScenePlace Feature(const ReportData& data, size_t f) {
  v1::ScenePlace place;
  const std::vector<uint32_t>& targets = data.uncertainty->feature_targets[f];
  const v1::FeatureVerdict& verdict = data.plan.uncertainty().features(static_cast<int>(f));
  place.set_name(verdict.name().empty() ? verdict.id() : verdict.name());
  if (targets.empty()) return place;
  Eigen::AlignedBox3d bounds;
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
  for (const uint32_t target : targets) {
    bounds.extend(data.targets.positions_m[target].cast<double>());
    normal += data.targets.normals[target].cast<double>();
  }
  Put(bounds.min(), place.mutable_min_m());
  Put(bounds.max(), place.mutable_max_m());
  Put(Eigen::Vector3d(normal / static_cast<double>(targets.size())), place.mutable_normal());
  place.set_targets(PackNumbers(targets));
  return place;
}

v1::SceneUncertainty Uncertainty(const ReportData& data) {
  const TargetUncertainties& uncertainties = *data.uncertainty;
  v1::SceneUncertainty shown;
  *shown.mutable_total() = Lengths(uncertainties.total_m);
  *shown.mutable_noise() = Lengths(uncertainties.noise_m);
  *shown.mutable_sampling() = Lengths(uncertainties.sampling_m);
  *shown.mutable_calibration() = Lengths(uncertainties.calibration_m);
  if (!uncertainties.registration_m.empty()) {
    *shown.mutable_registration() = Lengths(uncertainties.registration_m);
  }
  *shown.mutable_admissible() = Lengths(uncertainties.admissible_m);
  shown.set_relaxed_m(uncertainties.relaxed_m);
  // Classes follow from the exact numbers, not from the codes above.
  std::vector<uint8_t> classes(data.targets.size());
  for (size_t i = 0; i < classes.size(); ++i) {
    classes[i] = static_cast<uint8_t>(ClassOfTarget(uncertainties, data.measurable, i));
  }
  shown.set_classes(PackNumbers(classes));
  for (size_t i = 0; i < uncertainties.scan_sensitivities.size(); ++i) {
    *shown.add_sensitivities() =
        Sensitivity(uncertainties.scan_sensitivities[i], data.targets, data.scans[i].covered);
  }
  for (size_t f = 0; f < uncertainties.feature_targets.size(); ++f) {
    *shown.add_features() = Feature(data, f);
  }
  return shown;
}

void PutRegions(const ReportData& data, const std::vector<UncoveredRegion>& regions,
                v1::ReportScene* scene) {
  for (const UncoveredRegion& region : regions) {
    v1::ScenePlace& place = *scene->add_unmeasured_regions();
    Put(region.bounds_m.min(), place.mutable_min_m());
    Put(region.bounds_m.max(), place.mutable_max_m());
    Put(region.mean_normal, place.mutable_normal());
    place.set_targets(PackNumbers(region.targets));
  }
  for (const TargetRegion& region : data.sampling.regions) {
    v1::ScenePlace& place = *scene->add_regions_of_interest();
    place.set_name(region.name);
    Put(region.min_m, place.mutable_min_m());
    Put(region.max_m, place.mutable_max_m());
  }
}

}  // namespace

v1::ReportScene PlanScene(const ReportData& data, const DisplayMesh& mesh,
                          const std::vector<UncoveredRegion>& regions) {
  const Eigen::AlignedBox3d part_m = data.mesh.BoundingBox();
  Eigen::AlignedBox3d bounds_m = part_m;
  for (const Eigen::Vector3f& target : data.targets.positions_m) {
    bounds_m.extend(target.cast<double>());
  }
  const Quantiser quantiser(bounds_m);
  v1::ReportScene scene;
  Put(quantiser.origin_m(), scene.mutable_origin_m());
  scene.set_quantum_m(quantiser.quantum_m());
  Put(part_m.min(), scene.mutable_part_min_m());
  Put(part_m.max(), scene.mutable_part_max_m());
  *scene.mutable_mesh() = Mesh(mesh, quantiser);
  v1::SceneTargets& targets = *scene.mutable_targets();
  targets.set_count(static_cast<int64_t>(data.targets.size()));
  targets.set_spacing_m(data.sampling.spacing_m);
  targets.set_positions(quantiser.Pack(data.targets.positions_m));
  targets.set_measurable(PackBytes(data.measurable.ToBytes()));
  *scene.mutable_rig() = SceneRigOf(data.rig);
  if (data.robot) {
    for (const ReportSolid& solid : data.robot->solids) *scene.add_robot() = RobotSolid(solid);
  }
  for (int i = 0; i < data.plan.scans_size(); ++i) *scene.add_scans() = Scan(data, i);
  PutRegions(data, regions, &scene);
  if (data.uncertainty.has_value()) *scene.mutable_uncertainty() = Uncertainty(data);
  if (!data.reasons.empty()) *scene.mutable_reasons() = Reasons(data);
  PutObstacles(data, &scene);
  if (!data.depth_per_pixel_m.empty()) {
    *scene.mutable_depth_per_pixel() = Lengths(data.depth_per_pixel_m);
  }
  return scene;
}

}  // namespace sightline
