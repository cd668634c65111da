// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/visibility/domain_measurability.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <numbers>

#include "core/physics/angle.h"
#include "core/rig/scan_geometry.h"
#include "core/rig/sensor_bodies.h"

namespace sightline {
namespace {

// About as fine as the field's directions.
constexpr double kStep_deg = 4;
// Laser at the smallest polar angle: camera upright, the largest triangulation angle.
constexpr double kFirstPolar_deg = -80;
constexpr size_t kMostRests = 64;
constexpr size_t kMostArcs = 20000;
// A target near the edge of the image is nearer to the camera than the rig's origin is: with 30
// degrees of triangulation and 22 degrees off the axis 0.58 of its distance.
constexpr double kNearest = 0.6;
constexpr int kMostObstacleTests = 256;

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

// Azimuths of the sensors as seen from a part that is not turned: azimuth - gamma.
std::vector<double> RelativeAzimuths(const ParameterDomain& azimuth, const ParameterDomain& gamma,
                                     size_t most) {
  constexpr double kTurn = 2 * std::numbers::pi;
  std::vector<double> relative;
  if (FullTurn(azimuth) || FullTurn(gamma)) {
    const size_t count = std::min<size_t>(most, static_cast<size_t>(360 / kStep_deg));
    for (size_t i = 0; i < count; ++i) {
      relative.push_back(kTurn * static_cast<double>(i) / static_cast<double>(count));
    }
    return relative;
  }
  for (const double a : Thinned(Samples(azimuth, kStep_deg * kRadPerDeg), 90)) {
    for (const double g : Thinned(Samples(gamma, kStep_deg * kRadPerDeg), 90)) {
      // To half a degree.
      relative.push_back(std::round((a - g) / (0.5 * kRadPerDeg)) * 0.5 * kRadPerDeg);
      relative.back() -= kTurn * std::floor(relative.back() / kTurn);
    }
  }
  std::sort(relative.begin(), relative.end());
  relative.erase(std::unique(relative.begin(), relative.end()), relative.end());
  return Thinned(relative, most);
}

// From the target to a sensor at this polar angle and azimuth, tilted along the laser line.
Eigen::Vector3f DirectionOf(double polar_rad, double azimuth_rad, double tilt_rad) {
  const double sp = std::sin(polar_rad), cp = std::cos(polar_rad);
  const double sa = std::sin(azimuth_rad), ca = std::cos(azimuth_rad);
  return (std::cos(tilt_rad) * Eigen::Vector3d(sp * ca, sp * sa, cp) +
          std::sin(tilt_rad) * Eigen::Vector3d(-sa, ca, 0))
      .cast<float>();
}

// How far the lowest point of a sensor's bodies is below the sensor at this polar angle.
double DropOf(const std::vector<Body>& bodies, double polar_rad) {
  // z towards the origin, y = z x x for x = e_y: world heights of the sensor's axes.
  const double z_up = -std::cos(polar_rad), y_up = -std::sin(polar_rad);
  double lowest = 0;
  for (const Body& body : bodies) {
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
  Eigen::Vector3f place, normal;
  std::vector<uint8_t> cell_open;  // of the field's map: seen and on the near side
  // Cells of the finer map: 0 not asked yet, 1 open, 2 closed.
  std::vector<uint8_t> fine;
  int obstacle_tests = 0;
};

DomainMeasurability::DomainMeasurability(const Rig& rig, const TargetSampling& sampling,
                                         const MeasurementDomain& domain,
                                         const Eigen::Vector3d& part_centre_m,
                                         const VisibilityField& field,
                                         const std::vector<Occluder>& occluders)
    : field_(field),
      occluders_(occluders),
      part_centre_m_(part_centre_m.cast<float>()),
      fine_{2 * field.map().side},
      azimuth_(domain.parameters[kCameraAzimuth]) {
  for (int c = 0; c < fine_.cells(); ++c) fine_directions_.push_back(fine_.Direction(c));
  if (sampling.max_incidence_rad) {
    min_cos_incidence_ = static_cast<float>(std::max(0.0, std::cos(*sampling.max_incidence_rad)));
  }
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
    } else {
      others_.push_back(&occluder);
    }
  }
  for (int i = 0; i < kPolars; ++i) {
    drop_[0][i] = static_cast<float>(DropOf(rig.camera_bodies, PolarOf(i)));
    drop_[1][i] = static_cast<float>(DropOf(rig.laser_bodies, PolarOf(i)));
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
  const std::vector<double> azimuths =
      RelativeAzimuths(azimuth_, domain.parameters[kPartGamma], most);
  turns_rad_ = Thinned(Samples(domain.parameters[kPartGamma], 30 * kRadPerDeg), 12);
  for (const auto& [a, b] : orientations) AddRest(rig, a, b, azimuths);
}

void DomainMeasurability::AllowPairs(const Rig& rig, const TargetSampling& sampling,
                                     const MeasurementDomain& domain) {
  const double infinity = std::numeric_limits<double>::infinity();
  min_angle_rad_ = infinity;
  max_angle_rad_ = -infinity;
  nearest_m_ = static_cast<float>(infinity);
  const double half_rows_rad = 0.5 * rig.camera.vertical_fov_rad;
  const double step = kStep_deg * kRadPerDeg;
  // Every angle stands for those nearer than half a step.
  std::vector<double> thetas = Samples(domain.parameters[kCameraPolar], step);
  std::vector<double> taus = Samples(domain.parameters[kTriangulationAngle], step);
  const std::vector<double> all_distances = Samples(domain.parameters[kCameraDistance], 0.02);
  std::vector<double> off_axis;
  const int rows = std::max(1, static_cast<int>(std::ceil(half_rows_rad / step)));
  for (int i = -rows; i <= rows; ++i) off_axis.push_back(half_rows_rad * i / rows);

  const auto index = [](double polar_rad) {
    return static_cast<int>(std::lround((polar_rad / kRadPerDeg - kFirstPolar_deg) / kStep_deg));
  };
  for (const double tau : taus) {
    // At which there is room for the bodies of both sensors.
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
      double least_m = infinity, most_m = 0;
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
        least_m = std::min(least_m, distance);
        most_m = std::max(most_m, distance);
      }
      if (least_m == infinity) continue;
      min_angle_rad_ = std::min(min_angle_rad_, std::abs(angle));
      max_angle_rad_ = std::max(max_angle_rad_, std::abs(angle));
      nearest_m_ = std::min(nearest_m_, static_cast<float>(kNearest * least_m));
      farthest_m_ = std::max(farthest_m_, static_cast<float>(most_m));
      for (const double theta : thetas) {
        const int camera = index(theta - off), laser = index(theta - tau);
        if (camera < 0 || camera >= kPolars || laser < 0 || laser >= kPolars) continue;
        allowed_lasers_[camera] |= uint64_t{1} << laser;
        cameras_ |= uint64_t{1} << camera;
        lasers_ |= uint64_t{1} << laser;
      }
    }
  }
}

void DomainMeasurability::AddRest(const Rig& rig, double alpha_rad, double beta_rad,
                                  const std::vector<double>& azimuths_rad) {
  Measurement m;
  m.part_alpha_rad = alpha_rad;
  m.part_beta_rad = beta_rad;
  const ScanGeometry geometry = MakeScanGeometry(rig, m);
  Rest rest;
  rest.rotation = geometry.part_rotation.cast<float>();
  rest.table_height_m = static_cast<float>(geometry.table_height_m);
  const Eigen::Matrix3f to_part = rest.rotation.transpose();
  for (const double tilt : {0.0, tilt_rad_, -tilt_rad_}) {
    for (const double azimuth : azimuths_rad) {
      Arc& arc = rest.arcs.emplace_back();
      arc.azimuth_rad = static_cast<float>(azimuth);
      for (int i = 0; i < kPolars; ++i) {
        const Eigen::Vector3f direction = to_part * DirectionOf(PolarOf(i), azimuth, tilt);
        arc.cell[i] = static_cast<uint16_t>(field_.map().Cell(direction));
        arc.fine_cell[i] = static_cast<uint16_t>(fine_.Cell(direction));
      }
    }
  }
  rests_.push_back(std::move(rest));
}

bool DomainMeasurability::FreeOfObstacles(const Rest& rest, const Eigen::Vector3f& place,
                                          float azimuth_rad, const Eigen::Vector3f& to_camera,
                                          const Eigen::Vector3f& to_laser) const {
  if (others_.empty()) return true;
  constexpr float kGap_m = 2e-5f;
  for (const double turn : turns_rad_) {
    if (!FullTurn(azimuth_) && !azimuth_.Contains(azimuth_rad + turn)) continue;
    const Eigen::Matrix3f rotation =
        Eigen::AngleAxisf(static_cast<float>(turn), Eigen::Vector3f::UnitZ()).toRotationMatrix() *
        rest.rotation;
    const Eigen::Vector3f here = rotation * (place - part_centre_m_);
    const bool free = std::none_of(others_.begin(), others_.end(), [&](const Occluder* other) {
      Eigen::Vector3f from = here;
      if (other->frame == ObstacleFrame::kTable) from.z() -= rest.table_height_m;
      const auto hidden = [&](const Eigen::Vector3f& direction) {
        return other->bvh.Occluded(from + nearest_m_ * (rotation * direction), from, kGap_m);
      };
      return hidden(to_camera) || hidden(to_laser);
    });
    if (free) return true;
  }
  return false;
}

bool DomainMeasurability::MeasurableAt(const Rest& rest, TargetState& state) const {
  // Polar angles at which a sensor keeps clear of the table.
  uint64_t clear[2] = {~uint64_t{0}, ~uint64_t{0}};
  if (table_radius_m_ > 0) {
    const Eigen::Vector3f at = rest.rotation * (state.place - part_centre_m_);
    const float height_m = std::max(0.0f, at.z() - rest.table_height_m);
    const float aside_m = at.head<2>().norm();
    for (int sensor = 0; sensor < 2; ++sensor) {
      for (int i = 0; i < kPolars; ++i) {
        const auto cosine = static_cast<float>(std::cos(PolarOf(i)));
        const float reach_m = cosine < 0 ? nearest_m_ : farthest_m_;
        const bool above = height_m + reach_m * cosine > drop_[sensor][i];
        const bool beside =
            cosine < -0.01f &&
            aside_m - height_m / cosine * std::sqrt(1 - cosine * cosine) >= table_radius_m_;
        if (!above && !beside) clear[sensor] &= ~(uint64_t{1} << i);
      }
    }
  }
  const uint64_t cameras = cameras_ & clear[0], lasers = lasers_ & clear[1];
  const auto has_pair = [&](uint64_t open) {
    for (uint64_t c = open & cameras; c != 0; c &= c - 1) {
      if ((allowed_lasers_[std::countr_zero(c)] & open & lasers) != 0) return true;
    }
    return false;
  };
  for (const Arc& arc : rest.arcs) {
    uint64_t open = 0;
    for (uint64_t rest_bits = cameras | lasers; rest_bits != 0; rest_bits &= rest_bits - 1) {
      const int i = std::countr_zero(rest_bits);
      if (state.cell_open[arc.cell[i]]) open |= uint64_t{1} << i;
    }
    if (!has_pair(open)) continue;
    // Exact segments decide the cells that the field suggests.
    std::vector<uint16_t> ask;
    for (uint64_t bits = open; bits != 0; bits &= bits - 1) {
      const uint16_t cell = arc.fine_cell[std::countr_zero(bits)];
      if (state.fine[cell] != 0) continue;
      state.fine[cell] = 2;
      if (state.normal.dot(fine_directions_[cell]) > min_cos_incidence_) ask.push_back(cell);
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
    if (!has_pair(open)) continue;
    if (others_.empty()) return true;
    for (uint64_t c = open & cameras; c != 0; c &= c - 1) {
      const int camera = std::countr_zero(c);
      for (uint64_t l = allowed_lasers_[camera] & open & lasers; l != 0; l &= l - 1) {
        if (++state.obstacle_tests > kMostObstacleTests) return false;
        if (FreeOfObstacles(rest, state.place, arc.azimuth_rad,
                            fine_directions_[arc.fine_cell[camera]],
                            fine_directions_[arc.fine_cell[std::countr_zero(l)]])) {
          return true;
        }
      }
    }
  }
  return false;
}

void DomainMeasurability::Keep(const TargetSet& targets, size_t begin, size_t end,
                               const std::atomic<bool>* cancelled, TargetBits& measurable) const {
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
    state.normal = targets.normals[t];
    state.place = targets.positions_m[t] + kLiftM * state.normal;
    state.cell_open.assign(map.cells(), 0);
    for (int c = 0; c < map.cells(); ++c) {
      // Directions of a cell may be on the near side where its middle is not.
      state.cell_open[c] =
          field_.Probes(t, c) != 0 && state.normal.dot(directions[c]) > min_cos_incidence_ - 0.05f;
    }
    state.fine.assign(fine_.cells(), 0);
    state.obstacle_tests = 0;
    const bool found = std::any_of(rests_.begin(), rests_.end(),
                                   [&](const Rest& rest) { return MeasurableAt(rest, state); });
    if (!found) measurable.Reset(t);
  }
}

}  // namespace sightline
