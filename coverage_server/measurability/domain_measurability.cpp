// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/measurability/domain_measurability.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"
#include "core/rig/sensor_bodies.h"

namespace sightline {
namespace {

// Step of the pairs of directions, about as fine as the field's.
constexpr double kStep_deg = 4;
// Step of the scans that are tried at a pair.
constexpr double kScanStep_deg = 2;
// Laser at the smallest polar angle: camera upright, the largest triangulation angle.
constexpr double kFirstPolar_deg = -80;
constexpr size_t kMostRests = 64;
constexpr size_t kMostArcs = 20000;
constexpr size_t kMostTurns = 12;
// A target near the edge of the image is nearer to the camera than the rig's origin is: with 30
// degrees of triangulation and 22 degrees off the axis 0.58 of its distance.
constexpr double kNearest = 0.6;
// Scans that are evaluated exactly for one target and orientation.
constexpr int kMostScans = 2048;
// Look-ups of light for pairs of directions, for one target and orientation: about a millisecond.
constexpr int kMostLooks = 50000;
// Cosine by which the middle of a cell or step may be steeper than a direction in it: 2.8 degrees,
// half the diagonal of a step, at an incidence of 70 degrees.
constexpr float kCellSlack = 0.05f;
// Factor that keeps the last line of sight inside the image after rounding.
constexpr double kInsideImage = 1 - 1e-6;

double PolarOf(int i) { return (kFirstPolar_deg + kStep_deg * i) * kRadPerDeg; }

bool FullTurn(const ParameterDomain& domain) {
  double total = 0;
  for (const auto& range : domain.ranges) total += range.max - range.min;
  return total >= 2 * std::numbers::pi - 1e-6;
}

// Values of the domain, ranges in steps of at most `step`.
std::vector<double> Samples(const ParameterDomain& domain, double step) {
  std::vector<double> samples = domain.values;
  for (const auto& range : domain.ranges) {
    const int count =
        std::max(0, static_cast<int>(std::ceil((range.max - range.min) / step - 1e-9)));
    for (int i = 0; i <= count; ++i) {
      samples.push_back(count == 0 ? range.min : range.min + (range.max - range.min) * i / count);
    }
  }
  return samples;
}

// Every `stride`-th so that at most `most` remain.
template <typename T>
std::vector<T> Thinned(const std::vector<T>& all, size_t most) {
  if (all.size() <= most) return all;
  std::vector<T> some;
  for (size_t i = 0; i < most; ++i) some.push_back(all[i * all.size() / most]);
  return some;
}

// From the target to a sensor at this polar angle and azimuth, tilted along the laser line.
Eigen::Vector3f DirectionOf(double polar_rad, double azimuth_rad, double tilt_rad) {
  const double sp = std::sin(polar_rad), cp = std::cos(polar_rad);
  const double sa = std::sin(azimuth_rad), ca = std::cos(azimuth_rad);
  return (std::cos(tilt_rad) * Eigen::Vector3d(sp * ca, sp * sa, cp) +
          std::sin(tilt_rad) * Eigen::Vector3d(-sa, ca, 0))
      .cast<float>();
}

// Height of the sensor above the lowest point of its bodies at this polar angle.
double DropOf(const std::vector<Body>& bodies, double clearance_m, double polar_rad) {
  // z towards the origin, y = z x x for x = e_y: world heights of the sensor's axes.
  const double z_up = -std::cos(polar_rad), y_up = -std::sin(polar_rad);
  double lowest = 0;
  for (const Body& without_margin : bodies) {
    const Body body = WithMargin(without_margin, clearance_m);
    if (const auto* box = std::get_if<BoxBody>(&body)) {
      lowest = std::min(lowest, z_up * box->centre_m.z() + y_up * box->centre_m.y() -
                                    0.5 * std::abs(z_up) * box->size_m.z() -
                                    0.5 * std::abs(y_up) * box->size_m.y());
    } else {
      const auto& cylinder = std::get<CylinderBody>(body);
      lowest = std::min(lowest, z_up * cylinder.centre_m.z() + y_up * cylinder.centre_m.y() -
                                    0.5 * std::abs(z_up) * cylinder.length_m -
                                    std::abs(y_up) * cylinder.radius_m);
    }
  }
  return -lowest;
}

}  // namespace

struct DomainMeasurability::TargetState {
  Eigen::Vector3d target_m;        // part coordinates
  Eigen::Vector3f place, normal;   // lifted off the surface
  std::vector<uint8_t> cell_open;  // of the field's map: seen and on the near side
  // Cells of the finer map: 0 not asked yet, 1 open, 2 closed.
  std::vector<uint8_t> fine;
  int16_t light_entry = LightLimit::kUnlimited;
  int scans = 0;  // evaluated exactly
  int looks = 0;  // look-ups of light for pairs
};

DomainMeasurability::DomainMeasurability(const Rig& rig, const TargetSampling& sampling,
                                         const MeasurementDomain& domain,
                                         const Eigen::Vector3d& part_centre_m,
                                         const VisibilityField& field,
                                         const std::vector<Occluder>& occluders,
                                         const LightLimit* light, const LightMap* light_map)
    : field_(field),
      occluders_(occluders),
      part_centre_m_(part_centre_m.cast<float>()),
      fine_{2 * field.map().side},
      azimuth_(domain.parameters[kCameraAzimuth]),
      gamma_(domain.parameters[kPartGamma]),
      light_(light),
      light_map_(light_map),
      laser_distance_m_(rig.laser.distance_m) {
  for (int c = 0; c < fine_.cells(); ++c) fine_directions_.push_back(fine_.Direction(c));
  if (sampling.max_incidence_rad) {
    min_cos_incidence_ = static_cast<float>(std::max(0.0, std::cos(*sampling.max_incidence_rad)));
  }
  const Occluder* the_table = nullptr;
  for (const Occluder& occluder : occluders) {
    if (occluder.frame != ObstacleFrame::kStage && occluder.frame != ObstacleFrame::kTable)
      continue;
    const Eigen::AlignedBox3f& bounds = occluder.bvh.bounds();
    const float radius_m =
        std::min({-bounds.min().x(), bounds.max().x(), -bounds.min().y(), bounds.max().y()});
    const bool table = occluder.frame == ObstacleFrame::kTable && bounds.max().z() <= 0 &&
                       bounds.max().z() > -1e-6f && radius_m > table_radius_m_;
    if (table) {
      table_radius_m_ = radius_m;
      the_table = &occluder;
    } else {
      other_obstacles_ = true;
    }
  }
  exact_.emplace(rig, sampling, part_centre_m, occluders, the_table, light);
  for (int i = 0; i < kPolars; ++i) {
    const auto drop = [&](const std::vector<Body>& bodies) {
      return static_cast<float>(DropOf(bodies, rig.clearance_m, PolarOf(i)));
    };
    drop_[0][i] = drop(rig.camera_bodies);
    drop_[1][i] = drop(rig.laser_bodies);
  }
  const double half_columns_rad =
      std::atan(0.5 * rig.camera.columns_px / rig.camera.FocalLengthPx());
  tilt_rad_ = 0.75 * std::min(half_columns_rad, 0.5 * rig.laser.fan_angle_rad);
  AllowPairs(rig, sampling, domain);

  std::vector<std::pair<double, double>> orientations;
  for (const RestingOrientation& o : domain.resting_orientations) {
    orientations.push_back({o.part_alpha_rad, o.part_beta_rad});
  }
  const ParameterDomain &alpha = domain.parameters[kPartAlpha],
                        &beta = domain.parameters[kPartBeta];
  if (orientations.empty() && !(FullTurn(alpha) && FullTurn(beta))) {
    for (const double a : Thinned(Samples(alpha, 10 * kRadPerDeg), 36)) {
      for (const double b : Thinned(Samples(beta, 10 * kRadPerDeg), 36))
        orientations.push_back({a, b});
    }
  }
  orientations = Thinned(orientations, std::max(kMostRests, domain.resting_orientations.size()));
  if (orientations.empty()) return;
  constexpr size_t kTilts = 3;
  const size_t most = std::clamp<size_t>(kMostArcs / (kTilts * orientations.size()), 12, 90);
  const std::vector<AzimuthAndTurn> azimuths = Azimuths(most);
  for (const auto& [a, b] : orientations) AddRest(rig, a, b, azimuths);
}

std::vector<DomainMeasurability::AzimuthAndTurn> DomainMeasurability::Azimuths(size_t most) const {
  constexpr double kTurn = 2 * std::numbers::pi;
  constexpr size_t kMostOfEach = 90;
  const double step_rad = kStep_deg * kRadPerDeg;
  std::vector<AzimuthAndTurn> azimuths;
  if (FullTurn(azimuth_) || FullTurn(gamma_)) {
    // A camera across the scan direction has a laser line along it and measures nothing.
    std::vector<double> stands = Samples(azimuth_, step_rad);
    std::stable_sort(stands.begin(), stands.end(), [](double a, double b) {
      return std::abs(std::cos(a)) > std::abs(std::cos(b)) + 1e-9;
    });
    const double turn = Samples(gamma_, step_rad).front();
    const size_t count = std::min<size_t>(most, static_cast<size_t>(360 / kStep_deg));
    for (size_t i = 0; i < count; ++i) {
      const double azimuth = kTurn * static_cast<double>(i) / static_cast<double>(count);
      azimuths.push_back({azimuth, FullTurn(gamma_) ? stands.front() - azimuth : turn});
    }
    return azimuths;
  }
  for (const double a : Thinned(Samples(azimuth_, step_rad), kMostOfEach)) {
    for (const double g : Thinned(Samples(gamma_, step_rad), kMostOfEach)) {
      azimuths.push_back({a - g - kTurn * std::floor((a - g) / kTurn), g});
    }
  }
  std::stable_sort(azimuths.begin(), azimuths.end(),
                   [](const auto& a, const auto& b) { return a.azimuth_rad < b.azimuth_rad; });
  // One for every half degree.
  azimuths.erase(std::unique(azimuths.begin(), azimuths.end(),
                             [](const auto& a, const auto& b) {
                               return b.azimuth_rad - a.azimuth_rad < 0.5 * kRadPerDeg;
                             }),
                 azimuths.end());
  return Thinned(azimuths, most);
}

std::vector<double> DomainMeasurability::TurnsAt(double azimuth_rad, double gamma_rad) const {
  std::vector<double> turns = {gamma_rad};
  // Table and part turn together, so their turn only matters with other obstacles.
  if (!other_obstacles_) return turns;
  const double step_rad = 30 * kRadPerDeg;
  if (FullTurn(gamma_)) {
    for (const double a : Thinned(Samples(azimuth_, step_rad), kMostTurns)) {
      turns.push_back(a - azimuth_rad);
    }
    return turns;
  }
  for (const double g : Thinned(Samples(gamma_, step_rad), kMostTurns)) {
    if (FullTurn(azimuth_) || azimuth_.Contains(azimuth_rad + g)) turns.push_back(g);
  }
  return turns;
}

void DomainMeasurability::AddPairScan(int camera, int laser, const PairScan& scan) {
  PairScans& scans = pair_scans_[camera * kPolars + laser];
  if ((allowed_lasers_[camera] & (uint64_t{1} << laser)) == 0) {
    scans.fill(scan);
    allowed_lasers_[camera] |= uint64_t{1} << laser;
    cameras_ |= uint64_t{1} << camera;
    lasers_ |= uint64_t{1} << laser;
    return;
  }
  for (int corner = 0; corner < kPairScans; ++corner) {
    const auto score = [&](const PairScan& s) {
      const double c = s.CameraPolar() - PolarOf(camera), l = s.LaserPolar() - PolarOf(laser);
      if (corner == 0) return -std::max(std::abs(c), std::abs(l));
      return (corner & 1 ? c : -c) + (corner & 2 ? l : -l);
    };
    if (score(scan) > score(scans[corner])) scans[corner] = scan;
  }
}

void DomainMeasurability::AllowPairs(const Rig& rig, const TargetSampling& sampling,
                                     const MeasurementDomain& domain) {
  const double infinity = std::numeric_limits<double>::infinity();
  min_angle_rad_ = infinity;
  max_angle_rad_ = -infinity;
  nearest_m_ = static_cast<float>(infinity);
  const double half_rows_rad = 0.5 * rig.camera.vertical_fov_rad;
  const double step = kScanStep_deg * kRadPerDeg;
  pair_scans_.resize(kPolars * kPolars);
  std::vector<double> thetas = Samples(domain.parameters[kCameraPolar], step);
  std::vector<double> taus = Samples(domain.parameters[kTriangulationAngle], step);
  const std::vector<double> all_distances = Samples(domain.parameters[kCameraDistance], 0.02);
  std::vector<double> off_axis;
  const int rows = std::max(1, static_cast<int>(std::ceil(half_rows_rad / step)));
  for (int i = -rows; i <= rows; ++i) off_axis.push_back(kInsideImage * half_rows_rad * i / rows);

  const auto index = [](double polar_rad) {
    return static_cast<int>(std::lround((polar_rad / kRadPerDeg - kFirstPolar_deg) / kStep_deg));
  };
  for (const double tau : taus) {
    // Camera distances at which the bodies of both sensors do not collide.
    std::vector<double> distances;
    std::copy_if(all_distances.begin(), all_distances.end(), std::back_inserter(distances),
                 [&](double distance) {
                   Measurement m;
                   m.camera_distance_m = distance;
                   m.triangulation_angle_rad = tau;
                   return !SensorBodiesCollide(rig, MakeScanGeometry(rig, m));
                 });
    for (const double off : off_axis) {
      // The line of sight is turned by `off` towards the side the laser is on.
      const double angle = tau - off;
      if (angle * tau <= 0 || std::abs(angle) > 2.5) continue;
      std::vector<double> admissible_m;
      for (const double distance : distances) {
        const double range_m = distance * std::sin(std::abs(tau)) / std::sin(std::abs(angle));
        const double depth_m = range_m * std::cos(off);
        const PointLimits depth = AdmissibleDepth(rig, distance, sampling.max_pixel_footprint_m,
                                                  sampling.max_circle_of_confusion_px);
        if (range_m > rig.max_range_m || depth_m < depth.min_m || depth_m > depth.max_m) continue;
        if (sampling.max_depth_per_pixel_m) {
          Measurement m;
          m.camera_distance_m = distance;
          m.triangulation_angle_rad = tau;
          if (depth_m * range_m >
              MaxDepthTimesDistance(rig.camera, m, *sampling.max_depth_per_pixel_m)) {
            continue;
          }
        }
        admissible_m.push_back(distance);
      }
      if (admissible_m.empty()) continue;
      std::sort(admissible_m.begin(), admissible_m.end());
      const double least_m = admissible_m.front(), most_m = admissible_m.back();
      min_angle_rad_ = std::min(min_angle_rad_, std::abs(angle));
      max_angle_rad_ = std::max(max_angle_rad_, std::abs(angle));
      nearest_m_ = std::min(nearest_m_, static_cast<float>(kNearest * least_m));
      farthest_m_ = std::max(farthest_m_, static_cast<float>(most_m));
      for (const double theta : thetas) {
        const int camera = index(theta - off), laser = index(theta - tau);
        if (camera < 0 || camera >= kPolars || laser < 0 || laser >= kPolars) continue;
        AddPairScan(camera, laser,
                    {theta, tau, off, {most_m, admissible_m[admissible_m.size() / 2], least_m}});
      }
    }
  }
}

void DomainMeasurability::AddRest(const Rig& rig, double alpha_rad, double beta_rad,
                                  const std::vector<AzimuthAndTurn>& azimuths) {
  Measurement m;
  m.part_alpha_rad = alpha_rad;
  m.part_beta_rad = beta_rad;
  const ScanGeometry geometry = MakeScanGeometry(rig, m);
  Rest rest;
  rest.alpha_rad = alpha_rad;
  rest.beta_rad = beta_rad;
  rest.rotation = geometry.part_rotation.cast<float>();
  rest.table_height_m = static_cast<float>(geometry.table_height_m);
  const Eigen::Matrix3f to_part = rest.rotation.transpose();
  for (const double tilt : {0.0, tilt_rad_, -tilt_rad_}) {
    for (const AzimuthAndTurn& at : azimuths) {
      Arc& arc = rest.arcs.emplace_back();
      arc.azimuth_rad = at.azimuth_rad;
      arc.gamma_rad = at.gamma_rad;
      arc.tilt_rad = tilt;
      for (int i = 0; i < kPolars; ++i) {
        const Eigen::Vector3f direction = to_part * DirectionOf(PolarOf(i), at.azimuth_rad, tilt);
        arc.cell[i] = static_cast<uint16_t>(field_.map().Cell(direction));
        arc.fine_cell[i] = static_cast<uint16_t>(fine_.Cell(direction));
      }
    }
  }
  rests_.push_back(std::move(rest));
}

bool DomainMeasurability::ScanMeasures(const Rest& rest, const PairScan& scan, double azimuth_rad,
                                       double gamma_rad, double tilt_rad,
                                       TargetState& state) const {
  Measurement m;
  m.triangulation_angle_rad = scan.tau_rad;
  m.camera_polar_rad = scan.theta_rad;
  m.camera_azimuth_rad = azimuth_rad + gamma_rad;
  m.part_alpha_rad = rest.alpha_rad;
  m.part_beta_rad = rest.beta_rad;
  m.part_gamma_rad = gamma_rad;
  const Eigen::Vector3d axis = DirectionOf(scan.theta_rad, m.camera_azimuth_rad, 0).cast<double>();
  const Eigen::Vector3d sight =
      DirectionOf(scan.CameraPolar(), m.camera_azimuth_rad, 0).cast<double>();
  const Eigen::Vector3d line(-std::sin(m.camera_azimuth_rad), std::cos(m.camera_azimuth_rad), 0);
  for (const double distance_m : scan.distances_m) {
    if (state.scans >= kMostScans) return false;
    ++state.scans;
    m.camera_distance_m = distance_m;
    // Triangle of camera, origin and target: law of sines.
    const double range_m =
        distance_m * std::sin(scan.tau_rad) / std::sin(scan.tau_rad - scan.off_axis_rad);
    const Eigen::Vector3d lit_at_m =
        distance_m * axis - range_m * sight - range_m * std::tan(tilt_rad) * line;
    if (exact_->Measures(m, rest.table_height_m, state.target_m, state.normal.cast<double>(),
                         state.light_entry, lit_at_m)) {
      return true;
    }
    if (scan.distances_m.front() == scan.distances_m.back()) break;
  }
  return false;
}

bool DomainMeasurability::MayHaveLight(const TargetState& state, float cosine) const {
  if (light_map_ == nullptr || state.light_entry == LightLimit::kUnlimited) return true;
  const float nearest_m =
      laser_distance_m_ ? static_cast<float>(kNearest * *laser_distance_m_) : nearest_m_;
  // The middle of a cell represents all its directions, so its neighbourhood is checked too.
  for (const float slack : {0.0F, kCellSlack, -kCellSlack}) {
    if (light_map_->FarthestLaser(state.light_entry, cosine + slack) >= nearest_m) return true;
  }
  return false;
}

bool DomainMeasurability::MayHaveLight(const PairScan& scan, TargetState& state,
                                       const Eigen::Vector3f& normal,
                                       const Eigen::Vector3f& to_camera,
                                       const Eigen::Vector3f& to_laser) const {
  // Tolerance for the steps of the map and for approximate distances of the laser.
  constexpr float kSlack = 1.5F;
  if (light_map_ == nullptr || state.light_entry == LightLimit::kUnlimited) return true;
  ++state.looks;
  const float cos_camera = normal.dot(to_camera), cos_laser = normal.dot(to_laser),
              cos_between = to_camera.dot(to_laser);
  for (const double distance_m : scan.distances_m) {
    const auto range_m = static_cast<float>(distance_m * std::sin(scan.tau_rad) /
                                            std::sin(scan.tau_rad - scan.off_axis_rad));
    const auto laser_m = static_cast<float>(laser_distance_m_.value_or(distance_m));
    for (const float factor : {1.0F, kSlack, 1 / kSlack}) {
      if (light_map_->Detects(state.light_entry, range_m, factor * laser_m, cos_camera, cos_laser,
                              cos_between)) {
        return true;
      }
    }
  }
  return false;
}

bool DomainMeasurability::PairMeasures(const Rest& rest, const Arc& arc, const PairScans& scans,
                                       TargetState& state) const {
  const Eigen::Vector3f normal = rest.rotation * state.normal;
  const bool any_azimuth = FullTurn(azimuth_) || FullTurn(gamma_);
  // Along the laser line camera and laser are tilted by angles that differ a little.
  const float slack = arc.tilt_rad == 0 ? 1e-5f : 0.02f;
  const double beside_rad = any_azimuth ? 0.5 * kStep_deg * kRadPerDeg : 0;
  for (const PairScan& scan : scans) {
    for (const double step_rad : {0.0, beside_rad, -beside_rad}) {
      const double azimuth = arc.azimuth_rad + step_rad;
      const auto too_steep = [&](const Eigen::Vector3f& direction) {
        return normal.dot(direction) < min_cos_incidence_ - slack;
      };
      const Eigen::Vector3f to_camera = DirectionOf(scan.CameraPolar(), azimuth, arc.tilt_rad);
      if (too_steep(to_camera)) continue;
      const Eigen::Vector3f to_laser = DirectionOf(scan.LaserPolar(), azimuth, arc.tilt_rad);
      if (too_steep(to_laser)) continue;
      if (!MayHaveLight(scan, state, normal, to_camera, to_laser)) continue;
      // If gamma is free, the part turns and the sensors stay; otherwise the sensors turn.
      const double gamma = FullTurn(gamma_) ? arc.gamma_rad - step_rad : arc.gamma_rad;
      for (const double turn : TurnsAt(azimuth, gamma)) {
        if (ScanMeasures(rest, scan, azimuth, turn, arc.tilt_rad, state)) return true;
      }
      if (beside_rad == 0) break;
    }
  }
  return false;
}

uint64_t DomainMeasurability::ClearOfTable(const Rest& rest, const TargetState& state,
                                           int sensor) const {
  if (table_radius_m_ <= 0) return ~uint64_t{0};
  uint64_t clear = 0;
  const Eigen::Vector3f at = rest.rotation * (state.place - part_centre_m_);
  const float height_m = std::max(0.0f, at.z() - rest.table_height_m);
  const float aside_m = at.head<2>().norm();
  for (int i = 0; i < kPolars; ++i) {
    const auto cosine = static_cast<float>(std::cos(PolarOf(i)));
    const float reach_m = cosine < 0 ? nearest_m_ : farthest_m_;
    const bool above = height_m + reach_m * cosine > drop_[sensor][i];
    const bool beside =
        cosine < -0.01f &&
        aside_m - height_m / cosine * std::sqrt(1 - cosine * cosine) >= table_radius_m_;
    if (above || beside) clear |= uint64_t{1} << i;
  }
  return clear;
}

bool DomainMeasurability::HasPair(uint64_t open, uint64_t cameras, uint64_t lasers) const {
  for (uint64_t c = open & cameras; c != 0; c &= c - 1) {
    if ((allowed_lasers_[std::countr_zero(c)] & open & lasers) != 0) return true;
  }
  return false;
}

void DomainMeasurability::ConfirmOpen(const Arc& arc, TargetState& state, uint64_t& open) const {
  std::vector<uint16_t> ask;
  for (uint64_t bits = open; bits != 0; bits &= bits - 1) {
    const uint16_t cell = arc.fine_cell[std::countr_zero(bits)];
    if (state.fine[cell] != 0) continue;
    state.fine[cell] = 2;
    if (state.normal.dot(fine_directions_[cell]) > min_cos_incidence_ - kCellSlack) {
      ask.push_back(cell);
    }
  }
  for (size_t begin = 0; begin < ask.size(); begin += TriangleBvh::kLanes) {
    const size_t count = std::min<size_t>(TriangleBvh::kLanes, ask.size() - begin);
    uint32_t free = (1u << count) - 1;
    for (const Occluder& occluder : occluders_) {
      if (occluder.frame != ObstacleFrame::kPart) continue;
      const float far_m = 2 * occluder.bvh.bounds().sizes().norm() +
                          (occluder.bvh.bounds().center() - state.place).norm();
      TriangleBvh::Bundle bundle;
      for (size_t k = 0; k < TriangleBvh::kLanes; ++k) {
        const Eigen::Vector3f to =
            state.place + far_m * fine_directions_[ask[begin + std::min(k, count - 1)]];
        bundle.to_x[k] = to.x();
        bundle.to_y[k] = to.y();
        bundle.to_z[k] = to.z();
        bundle.gap[k] = 0;
      }
      free &= ~occluder.bvh.Occluded(state.place, bundle, free);
    }
    for (size_t k = 0; k < count; ++k) {
      if ((free >> k) & 1) state.fine[ask[begin + k]] = 1;
    }
  }
  for (uint64_t bits = open; bits != 0; bits &= bits - 1) {
    const int i = std::countr_zero(bits);
    if (state.fine[arc.fine_cell[i]] != 1) open &= ~(uint64_t{1} << i);
  }
}

bool DomainMeasurability::MeasurableAt(const Rest& rest, TargetState& state) const {
  // Polar angles at which a sensor keeps clear of the table.
  const uint64_t cameras = cameras_ & ClearOfTable(rest, state, 0),
                 lasers = lasers_ & ClearOfTable(rest, state, 1);
  for (const Arc& arc : rest.arcs) {
    uint64_t open = 0;
    for (uint64_t asked = cameras | lasers; asked != 0; asked &= asked - 1) {
      const int i = std::countr_zero(asked);
      if (state.cell_open[arc.cell[i]]) open |= uint64_t{1} << i;
    }
    if (!HasPair(open, cameras, lasers)) continue;
    // Segment tests confirm the cells that the field leaves open.
    ConfirmOpen(arc, state, open);
    for (uint64_t c = open & cameras; c != 0; c &= c - 1) {
      const int camera = std::countr_zero(c);
      for (uint64_t l = allowed_lasers_[camera] & open & lasers; l != 0; l &= l - 1) {
        if (state.scans >= kMostScans || state.looks >= kMostLooks) return false;
        if (PairMeasures(rest, arc, pair_scans_[camera * kPolars + std::countr_zero(l)], state)) {
          return true;
        }
      }
    }
  }
  return false;
}

void DomainMeasurability::Keep(const TargetSet& targets, size_t begin, size_t end,
                               const std::atomic<bool>* cancelled, TargetBits& measurable,
                               std::vector<uint64_t>& orientations) const {
  if (any_orientation()) return;
  const OctahedralMap& map = field_.map();
  std::vector<Eigen::Vector3f> directions(map.cells());
  for (int c = 0; c < map.cells(); ++c) directions[c] = map.Direction(c);
  // Lifted off its own surface.
  constexpr float kLiftM = 2e-5f;
  TargetState state;
  for (size_t t = begin; t < end; ++t) {
    if (!measurable.Test(t)) continue;
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return;
    state.target_m = targets.positions_m[t].cast<double>();
    state.normal = targets.normals[t];
    state.place = targets.positions_m[t] + kLiftM * state.normal;
    if (light_ != nullptr) state.light_entry = light_->EntryOf(targets.triangles[t]);
    state.cell_open.assign(map.cells(), 0);
    for (int c = 0; c < map.cells(); ++c) {
      // Directions of a cell may be on the near side where its middle is not.
      const float cosine = state.normal.dot(directions[c]);
      state.cell_open[c] = field_.Probes(t, c) != 0 && cosine > min_cos_incidence_ - kCellSlack &&
                           MayHaveLight(state, cosine);
    }
    state.fine.assign(fine_.cells(), 0);
    bool found = false;
    for (size_t r = 0; r < rests_.size() && !(found && orientations.empty()); ++r) {
      state.scans = 0;
      state.looks = 0;
      if (!MeasurableAt(rests_[r], state)) continue;
      found = true;
      if (!orientations.empty()) orientations[t] |= uint64_t{1} << r;
    }
    if (!found) measurable.Reset(t);
  }
}

}  // namespace sightline
