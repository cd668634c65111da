// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/scan/fast_evaluator.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/cpu/function_clones.h"

namespace sightline {

// ScanInPart in single precision, with precomputed values of the inner loop.
struct FloatScan {
  float cx, cy, cz;              // camera at stage 0
  float ex, ey, ez;              // image x axis
  float yx, yy, yz;              // image y axis
  float wx, wy, wz;              // optical axis
  float lx, ly, lz;              // laser at stage 0
  float lwx, lwy, lwz;           // laser axis
  float sx, sy, sz;              // scan direction
  float gx, gy, gz, lit_offset;  // lit stage position
  float hx, hy, hz, normal_x;    // sheet normal, |n . e_x|
  float focal_px, half_columns, half_rows, tan_x, tan_y, fan_tangent;
  float max_range, min_depth, max_depth, max_depth_times_distance;
  // Cosine and sine of the steepest incidence, and the largest distance of a probe from its target
  // for that test; 0 at 90 degrees, because the field contains the horizon itself.
  float cos_incidence, sin_incidence, reach_incidence;
  float inverse_step, step, radius_squared;
  // Largest distance of a probe from its target: in space, and across the planes that bound the
  // image and the fan. The latter include the motion of the sensors between both lit moments.
  float reach, reach_x, reach_y, reach_fan;
};

struct FastEvaluator::Lanes {
  alignas(64) int32_t valid[kTargetsPerBlock];
  alignas(64) int32_t camera_cell[kTargetsPerBlock];
  alignas(64) int32_t laser_cell[kTargetsPerBlock];
  alignas(64) float stage[kTargetsPerBlock];
  alignas(64) int32_t sparse[kTargetsPerBlock];
  alignas(64) int32_t border[kTargetsPerBlock];
};

namespace {

FloatScan ToFloat(const ScanInPart& scan, float radius) {
  FloatScan f;
  const auto set = [](const Eigen::Vector3d& v, float& x, float& y, float& z) {
    x = static_cast<float>(v.x());
    y = static_cast<float>(v.y());
    z = static_cast<float>(v.z());
  };
  set(scan.camera.origin_m, f.cx, f.cy, f.cz);
  set(scan.camera.x_axis, f.ex, f.ey, f.ez);
  set(scan.camera.y_axis, f.yx, f.yy, f.yz);
  set(scan.camera.z_axis, f.wx, f.wy, f.wz);
  set(scan.laser.origin_m, f.lx, f.ly, f.lz);
  set(scan.laser.z_axis, f.lwx, f.lwy, f.lwz);
  set(scan.scan_direction, f.sx, f.sy, f.sz);
  set(scan.lit_gradient, f.gx, f.gy, f.gz);
  set(scan.sheet_normal, f.hx, f.hy, f.hz);
  f.lit_offset = static_cast<float>(scan.lit_offset_m);
  f.normal_x = static_cast<float>(scan.sheet_normal_x);
  f.focal_px = static_cast<float>(scan.focal_length_px);
  f.half_columns = static_cast<float>(scan.half_columns_px);
  f.half_rows = static_cast<float>(scan.half_rows_px);
  f.tan_x = f.half_columns / f.focal_px;
  f.tan_y = f.half_rows / f.focal_px;
  f.fan_tangent = static_cast<float>(scan.fan_tangent);
  f.max_range = static_cast<float>(scan.max_range_m);
  f.min_depth = static_cast<float>(std::max(scan.depth.min_m, 1e-4));
  f.max_depth = static_cast<float>(scan.depth.max_m);
  f.max_depth_times_distance = static_cast<float>(scan.depth.max_depth_times_distance_m2);
  f.step = static_cast<float>(scan.scan_step_m);
  f.inverse_step = 1 / f.step;
  f.radius_squared = radius * radius;
  f.reach = radius * (1 + 1 / f.normal_x);
  f.cos_incidence = static_cast<float>(std::max(scan.depth.min_cos_incidence, 0.0));
  f.sin_incidence = std::sqrt(1 - f.cos_incidence * f.cos_incidence);
  f.reach_incidence = f.cos_incidence > 0 ? f.reach : 0;
  f.reach_x = f.reach * std::sqrt(1 + f.tan_x * f.tan_x);
  f.reach_y = f.reach * std::sqrt(1 + f.tan_y * f.tan_y);
  f.reach_fan = f.reach * std::sqrt(1 + f.fan_tangent * f.fan_tangent);
  return f;
}

// Nearest integer; plain arithmetic, so inlined everywhere and the same on every machine.
inline float Round(float x) {
  constexpr float kMagic = 12582912.0f;  // 1.5 * 2^23
  return (x + kMagic) - kMagic;
}

// Marks a target's probes that face camera and laser and are in view, each when it is lit.
SIGHTLINE_CLONES("avx2")
uint8_t ProbesInView(const FloatScan& f, const FastEvaluator::TargetProbes& p) {
  int32_t passes[kProbesPerTarget];
  for (int k = 0; k < kProbesPerTarget; ++k) {
    const float s = f.gx * p.x[k] + f.gy * p.y[k] + f.gz * p.z[k] + f.lit_offset;
    const float vx = f.cx - s * f.sx - p.x[k], vy = f.cy - s * f.sy - p.y[k],
                vz = f.cz - s * f.sz - p.z[k];
    const float lx = f.lx - s * f.sx - p.x[k], ly = f.ly - s * f.sy - p.y[k],
                lz = f.lz - s * f.sz - p.z[k];
    const float depth = -(vx * f.wx + vy * f.wy + vz * f.wz);
    const float laser_depth = -(lx * f.lwx + ly * f.lwy + lz * f.lwz);
    const float facing = p.nx[k] * vx + p.ny[k] * vy + p.nz[k] * vz;
    const float lit = p.nx[k] * lx + p.ny[k] * ly + p.nz[k] * lz;
    const float range = vx * vx + vy * vy + vz * vz, laser_range = lx * lx + ly * ly + lz * lz;
    passes[k] = (facing > f.cos_incidence * std::sqrt(range)) &
                (lit > f.cos_incidence * std::sqrt(laser_range)) & (depth >= f.min_depth) &
                (depth <= f.max_depth) &
                (std::abs(vx * f.ex + vy * f.ey + vz * f.ez) <= depth * f.tan_x) &
                (std::abs(vx * f.yx + vy * f.yy + vz * f.yz) <= depth * f.tan_y) &
                (range <= f.max_range * f.max_range) &
                (depth * std::sqrt(range) <= f.max_depth_times_distance) & (laser_depth > 0) &
                (std::abs(lx * f.ex + ly * f.ey + lz * f.ez) <= laser_depth * f.fan_tangent);
  }
  uint8_t in_view = 0;
  for (int k = 0; k < kProbesPerTarget; ++k) in_view |= static_cast<uint8_t>(passes[k] << k);
  return in_view;
}

// True if `accept` takes one of the measurement points within a radius of `point` on its tangent
// plane. Lit stage position s and image column u are both functions on the surface; measurement
// points are where s is a multiple of the step and u is the centre of a column. With t along the
// lit line and q across it, a frame d away along q has its points at u(d) + multiples of one column
// along t.
template <typename Accept>
bool HasGridPoint(const FloatScan& f, const Eigen::Vector3f& point, const Eigen::Vector3f& normal,
                  float radius_squared, const Accept& accept) {
  const Eigen::Vector3f h(f.hx, f.hy, f.hz), gradient(f.gx, f.gy, f.gz), scan(f.sx, f.sy, f.sz);
  const Eigen::Vector3f e(f.ex, f.ey, f.ez), w(f.wx, f.wy, f.wz);
  const Eigen::Vector3f along = h.cross(normal);
  const float length = along.norm();
  const float stage = gradient.dot(point) + f.lit_offset;
  if (length < 1e-4f) return false;  // the sheet touches the surface: no line
  const Eigen::Vector3f t = along / length, q = normal.cross(t);
  const Eigen::Vector3f camera = Eigen::Vector3f(f.cx, f.cy, f.cz) - stage * scan;
  const Eigen::Vector3f view = point - camera;
  const float depth = view.dot(w), slope = view.dot(e) / depth;
  // du = gradient_u . dx on the surface; moving the point also moves the stage to keep it lit.
  const Eigen::Vector3f image = f.focal_px / depth * (e - slope * w);
  const float u = f.focal_px * slope + f.half_columns - 0.5f;
  const float u_along = image.dot(t);
  const float u_across = image.dot(q) + image.dot(scan) * gradient.dot(q);
  const float stage_across = gradient.dot(q);
  const float inverse_across = 1 / stage_across;
  const float nearest = Round(stage * f.inverse_step);
  const float u_along_squared = u_along * u_along;
  // Frames in order of distance: 0, 1, -1, 2, -2, ... from the nearest one.
  constexpr int kMaxFrames = 64;
  for (int i = 0; i < kMaxFrames; ++i) {
    const float frame = nearest + static_cast<float>(i % 2 == 0 ? -(i / 2) : (i + 1) / 2);
    const float across = (frame * f.step - stage) * inverse_across;
    const float rest = radius_squared - across * across;
    if (rest < 0) {
      if (i % 2 == 0) break;  // both neighbours at this distance are too far
      continue;
    }
    const float column = u + u_across * across;
    const float off_centre = column - Round(column);
    if (off_centre * off_centre > rest * u_along_squared) continue;
    if (accept(Eigen::Vector3f(point + across * q - off_centre / u_along * t))) return true;
  }
  return false;
}

// True if a measurement point covers the target. The point must be near a `seen` probe, because
// the tangent plane extends beyond the surface, and on curved surfaces also on the probe's plane.
// Every point of the disc is within half its radius of a probe.
bool GridCovers(const FloatScan& f, const FastEvaluator::TargetProbes& probes, bool flat,
                uint8_t seen) {
  const auto probe = [&](int k) { return Eigen::Vector3f(probes.x[k], probes.y[k], probes.z[k]); };
  const auto normal = [&](int k) {
    return Eigen::Vector3f(probes.nx[k], probes.ny[k], probes.nz[k]);
  };
  const float near_squared = 0.25f * f.radius_squared;
  return HasGridPoint(
      f, probe(0), normal(0), f.radius_squared, [&](const Eigen::Vector3f& measured) {
        for (int k = 0; k < kProbesPerTarget; ++k) {
          if (!((seen >> k) & 1) || (probe(k) - measured).squaredNorm() > near_squared) continue;
          if (flat || HasGridPoint(f, probe(k), normal(k), near_squared,
                                   [](const Eigen::Vector3f&) { return true; })) {
            return true;
          }
        }
        return false;
      });
}

// True if the segment from `place` to `sensor`, both in the box's axes, meets the box. Hits within
// the gap that keeps a surface from hiding itself do not count.
bool Meets(const TravellingBox& box, const Eigen::Vector3f& place, const Eigen::Vector3f& sensor) {
  constexpr float kSurfaceGapM = 2e-5f;
  const Eigen::Vector3f way = sensor - place;
  float enters = kSurfaceGapM / way.norm(), leaves = 1;
  for (int axis = 0; axis < 3; ++axis) {
    if (way[axis] == 0) {
      if (place[axis] < box.low[axis] || place[axis] > box.high[axis]) return false;
      continue;
    }
    const float a = (box.low[axis] - place[axis]) / way[axis];
    const float b = (box.high[axis] - place[axis]) / way[axis];
    enters = std::max(enters, std::min(a, b));
    leaves = std::min(leaves, std::max(a, b));
  }
  return enters < leaves;
}

// True if a travelling box hides the lit target from camera or laser.
bool HiddenByBox(const ScanInPart& scan, const FloatScan& f, const Eigen::Vector3f& target,
                 float stage_m) {
  const Eigen::Vector3f moved = stage_m * Eigen::Vector3f(f.sx, f.sy, f.sz);
  for (const TravellingBox& box : scan.boxes) {
    const Eigen::Vector3f place = box.rotation * target + box.shift;
    const auto hides = [&](const Eigen::Vector3f& sensor) {
      return Meets(box, place, box.rotation * (sensor - moved) + box.shift);
    };
    if (box.hides_camera && hides({f.cx, f.cy, f.cz})) return true;
    if (box.hides_laser && hides({f.lx, f.ly, f.lz})) return true;
  }
  return false;
}

// Places and normals, and for each the result: a permitted exposure shows the line there.
struct LitPlaces {
  alignas(64) float x[kTargetsPerBlock], y[kTargetsPerBlock], z[kTargetsPerBlock];
  alignas(64) float nx[kTargetsPerBlock], ny[kTargetsPerBlock], nz[kTargetsPerBlock];
  // Cells of the map before those of the place's table.
  alignas(64) int32_t first_cell[kTargetsPerBlock];
  alignas(64) int32_t shows[kTargetsPerBlock];
};

// LightMap::Detects of the first `count` places at their lit moments, vectorised. `count` is a
// multiple of kLitStep.
constexpr int kLitStep = 8;
SIGHTLINE_CLONES("avx512f", "avx2")
void AskLight(const FloatScan& f, const float* distances_m, int bins, float first_bin_m,
              float bins_per_m, int count, LitPlaces& places) {
  constexpr float kLast = LightMap::kSide - 1;
  for (int i = 0; i < count; ++i) {
    const float x = places.x[i], y = places.y[i], z = places.z[i];
    const float nx = places.nx[i], ny = places.ny[i], nz = places.nz[i];
    const float s = f.gx * x + f.gy * y + f.gz * z + f.lit_offset;
    const float vx = f.cx - s * f.sx - x, vy = f.cy - s * f.sy - y, vz = f.cz - s * f.sz - z;
    const float lx = f.lx - s * f.sx - x, ly = f.ly - s * f.sy - y, lz = f.lz - s * f.sz - z;
    const float camera_m = std::sqrt(vx * vx + vy * vy + vz * vz);
    const float laser_m = std::sqrt(lx * lx + ly * ly + lz * lz);
    const float cos_camera = (nx * vx + ny * vy + nz * vz) / camera_m;
    const float cos_laser = (nx * lx + ny * ly + nz * lz) / laser_m;
    const float cos_between = (vx * lx + vy * ly + vz * lz) / (camera_m * laser_m);
    const auto place = [](float square) {
      return static_cast<int32_t>(kLast * std::sqrt(std::min(std::max(square, 0.0f), 1.0f)) + 0.5f);
    };
    const float bin = std::min(std::max((camera_m - first_bin_m) * bins_per_m, 0.0f),
                               static_cast<float>(bins - 1));
    const int32_t cell =
        places.first_cell[i] +
        ((static_cast<int32_t>(bin + 0.5f) * LightMap::kSide + place(1 - cos_camera)) *
             LightMap::kSide +
         place(1 - cos_laser)) *
            LightMap::kSide +
        place(0.5f * (1 - cos_between));
    places.shows[i] = (laser_m >= distances_m[2 * cell]) & (laser_m <= distances_m[2 * cell + 1]);
  }
}

inline int32_t OctahedralCell(float x, float y, float z, int side) {
  const float scale = 1 / (std::abs(x) + std::abs(y) + std::abs(z));
  const float u = x * scale, v = y * scale;
  const float fu = std::copysign(1 - std::abs(v), u), fv = std::copysign(1 - std::abs(u), v);
  const float a = z < 0 ? fu : u, b = z < 0 ? fv : v;
  const float half = 0.5f * static_cast<float>(side);
  const int32_t column = std::min(std::max(static_cast<int32_t>((a + 1) * half), 0), side - 1);
  const int32_t row = std::min(std::max(static_cast<int32_t>((b + 1) * half), 0), side - 1);
  return row * side + column;
}

}  // namespace

FastEvaluator::FastEvaluator(const TargetSet& targets, const TargetSampling& sampling,
                             const SurfaceProbes& probes, const VisibilityField& field,
                             TargetLight light)
    : target_count_(targets.size()),
      coverage_radius_m_(static_cast<float>(sampling.coverage_radius_m)),
      field_(field),
      light_(std::move(light)) {
  blocks_.resize(field.blocks());
  probes_.resize(blocks_.size() * kTargetsPerBlock);
  if (light_.map != nullptr) {
    light_.entries.resize(blocks_.size() * kTargetsPerBlock, LightLimit::kUnlimited);
  }
  for (size_t t = 0; t < target_count_; ++t) {
    for (int k = 0; k < kProbesPerTarget; ++k) {
      const Eigen::Vector3f& p = probes.positions_m[t * kProbesPerTarget + k];
      const Eigen::Vector3f& n = probes.normals[t * kProbesPerTarget + k];
      probes_[t].x[k] = p.x(), probes_[t].y[k] = p.y(), probes_[t].z[k] = p.z();
      probes_[t].nx[k] = n.x(), probes_[t].ny[k] = n.y(), probes_[t].nz[k] = n.z();
    }
  }
  for (size_t b = 0; b < blocks_.size(); ++b) {
    Block& block = blocks_[b];
    const size_t begin = b * kTargetsPerBlock;
    const size_t end = std::min(begin + kTargetsPerBlock, target_count_);
    Eigen::AlignedBox3f box;
    Eigen::Vector3f mean = Eigen::Vector3f::Zero();
    for (size_t i = 0; i < kTargetsPerBlock; ++i) {
      // Padding repeats the last target; its bits are dropped at the end.
      const size_t t = std::min(begin + i, end - 1);
      const Eigen::Vector3f p = targets.positions_m[t], n = targets.normals[t];
      block.x[i] = p.x(), block.y[i] = p.y(), block.z[i] = p.z();
      block.nx[i] = n.x(), block.ny[i] = n.y(), block.nz[i] = n.z();
      box.extend(p);
      mean += n;
      block.horizon[i] = 0;
      for (int k = 0; k < kProbesPerTarget; ++k) {
        block.horizon[i] =
            std::max(block.horizon[i], n.cross(probes.normals[t * kProbesPerTarget + k]).norm());
      }
      block.max_horizon = std::max(block.max_horizon, block.horizon[i]);
    }
    block.centre = box.center();
    block.radius = 0.5f * box.sizes().norm();
    block.cone_axis = mean.normalized();
    float cosine = 1;
    for (size_t t = begin; t < end; ++t)
      cosine = std::min(cosine, targets.normals[t].dot(block.cone_axis));
    block.cone_sine =
        mean.norm() > 1e-3f && cosine > 0 ? std::sqrt(1 - std::min(cosine * cosine, 1.0f)) : 2.0f;
  }
}

SIGHTLINE_CLONES("avx512f", "avx2")
void FastEvaluator::TestBlock(const Block& block, const FloatScan& f, int map_side, Lanes& lanes) {
  for (int i = 0; i < kTargetsPerBlock; ++i) {
    const float x = block.x[i], y = block.y[i], z = block.z[i];
    const float nx = block.nx[i], ny = block.ny[i], nz = block.nz[i];
    const float s = f.gx * x + f.gy * y + f.gz * z + f.lit_offset;
    // From the target to camera and laser at its lit moment.
    const float vx = f.cx - s * f.sx - x, vy = f.cy - s * f.sy - y, vz = f.cz - s * f.sz - z;
    const float lx = f.lx - s * f.sx - x, ly = f.ly - s * f.sy - y, lz = f.lz - s * f.sz - z;
    const float depth = -(vx * f.wx + vy * f.wy + vz * f.wz);
    const float image_x = -(vx * f.ex + vy * f.ey + vz * f.ez);
    const float image_y = -(vx * f.yx + vy * f.yy + vz * f.yz);
    const float range = vx * vx + vy * vy + vz * vz;
    const float laser_depth = -(lx * f.lwx + ly * f.lwy + lz * f.lwz);
    const float laser_x = -(lx * f.ex + ly * f.ey + lz * f.ez);
    // `loose` holds if some probe can pass, `tight` if every probe does: probes lie within the
    // coverage radius and their normals differ little from the target's.
    const float horizon = block.horizon[i];
    const float facing = nx * vx + ny * vy + nz * vz, lit = nx * lx + ny * ly + nz * lz;
    // Cosines of the steepest incidence plus and minus the angle whose sine is `horizon`. If that
    // angle is the larger one, no probe is certain to pass.
    const float level = std::sqrt(std::max(0.0f, 1 - horizon * horizon));
    const float spread = f.sin_incidence * horizon;
    const float loose_cosine = f.cos_incidence * level - spread;
    const float tight_cosine = horizon > f.sin_incidence ? 2.0f : f.cos_incidence * level + spread;
    const float laser_distance = std::sqrt(lx * lx + ly * ly + lz * lz);
    const float out_x = std::abs(image_x) - depth * f.tan_x,
                out_y = std::abs(image_y) - depth * f.tan_y;
    const float out_fan = std::abs(laser_x) - laser_depth * f.fan_tangent;
    const float distance = std::sqrt(range), far = distance - f.max_range;
    const int32_t loose = (facing > loose_cosine * distance - f.reach_incidence) &
                          (lit > loose_cosine * laser_distance - f.reach_incidence) &
                          (depth >= f.min_depth - f.reach) & (depth <= f.max_depth + f.reach) &
                          (out_x <= f.reach_x) & (out_y <= f.reach_y) & (far <= f.reach) &
                          ((depth - f.reach) * (distance - f.reach) <= f.max_depth_times_distance) &
                          (laser_depth > 0) & (out_fan <= f.reach_fan);
    const int32_t tight = (facing > tight_cosine * distance + f.reach_incidence) &
                          (lit > tight_cosine * laser_distance + f.reach_incidence) &
                          (depth >= f.min_depth + f.reach) & (depth <= f.max_depth - f.reach) &
                          (out_x <= -f.reach_x) & (out_y <= -f.reach_y) & (far <= -f.reach) &
                          ((depth + f.reach) * (distance + f.reach) <= f.max_depth_times_distance) &
                          (out_fan <= -f.reach_fan);
    // On the surface, frames are step |n_x| / |n_t| apart across the lit line, and columns one
    // pixel's footprint apart along it. If half of both fits into the coverage radius, some point
    // of this grid covers the target; otherwise GridCovers decides.
    const float hn = f.hx * nx + f.hy * ny + f.hz * nz;
    const float tangential = std::max(1 - hn * hn, 1e-6f);  // |n_t|^2
    const float tx = f.hy * nz - f.hz * ny, ty = f.hz * nx - f.hx * nz, tz = f.hx * ny - f.hy * nx;
    const float slope = image_x / depth;
    const float te = tx * f.ex + ty * f.ey + tz * f.ez, tw = tx * f.wx + ty * f.wy + tz * f.wz;
    const float px_per_length = f.focal_px * (te - slope * tw) / depth;  // times |n_t|
    const float across = f.step * f.normal_x;
    const float spacing_squared =
        across * across / tangential + tangential / std::max(px_per_length * px_per_length, 1e-12f);
    lanes.sparse[i] = 0.25f * spacing_squared > f.radius_squared;
    lanes.valid[i] = loose;
    lanes.border[i] = loose & (1 - tight);
    lanes.stage[i] = s;
    lanes.camera_cell[i] = OctahedralCell(vx, vy, vz, map_side);
    lanes.laser_cell[i] = OctahedralCell(lx, ly, lz, map_side);
  }
}

int FastEvaluator::KeepLit(const FloatScan& f, size_t block, SeenLane* seen, int count) const {
  const LightMap& map = *light_.map;
  const auto ask = [&](int places_count, LitPlaces& places) {
    AskLight(f, map.distances_m(), map.bins(), map.first_bin_m(), map.bins_per_m(), places_count,
             places);
  };
  const Block& b = blocks_[block];
  const size_t begin = block * kTargetsPerBlock;
  const auto first_cell = [&](int lane) {
    const int16_t entry = light_.entries[begin + static_cast<size_t>(lane)];
    return static_cast<int32_t>(map.CellsBefore(std::max<int16_t>(entry, 0)));
  };
  LitPlaces places;
  const int asked = (count + kLitStep - 1) / kLitStep * kLitStep;
  for (int k = 0; k < asked; ++k) {
    const int i = seen[std::min(k, count - 1)].lane;
    places.x[k] = b.x[i], places.y[k] = b.y[i], places.z[k] = b.z[i];
    places.nx[k] = b.nx[i], places.ny[k] = b.ny[i], places.nz[k] = b.nz[i];
    places.first_cell[k] = first_cell(i);
  }
  ask(asked, places);
  int kept = 0;
  LitPlaces on_probes;
  for (int k = 0; k < count; ++k) {
    const SeenLane here = seen[k];
    bool shows =
        places.shows[k] != 0 || light_.entries[begin + here.lane] == LightLimit::kUnlimited;
    if (!shows && b.horizon[here.lane] > 0) {
      const TargetProbes& probes = probes_[begin + here.lane];
      for (int p = 0; p < kProbesPerTarget; ++p) {
        on_probes.x[p] = probes.x[p], on_probes.y[p] = probes.y[p], on_probes.z[p] = probes.z[p];
        on_probes.nx[p] = probes.nx[p], on_probes.ny[p] = probes.ny[p];
        on_probes.nz[p] = probes.nz[p];
        on_probes.first_cell[p] = places.first_cell[k];
      }
      static_assert(kProbesPerTarget % kLitStep == 0);
      ask(kProbesPerTarget, on_probes);
      for (int p = 0; p < kProbesPerTarget; ++p) {
        shows = shows || (((here.probes >> p) & 1) != 0 && on_probes.shows[p] != 0);
      }
    }
    if (shows) seen[kept++] = here;
  }
  return kept;
}

void FastEvaluator::Evaluate(std::span<const ScanInPart> scans, std::span<FastScan> results,
                             bool with_seen, const std::atomic<bool>* cancelled) const {
  std::vector<FloatScan> floats;
  floats.reserve(scans.size());
  for (const ScanInPart& scan : scans) floats.push_back(ToFloat(scan, coverage_radius_m_));
  std::vector<float> start(scans.size(), std::numeric_limits<float>::infinity());
  std::vector<float> end(scans.size(), -std::numeric_limits<float>::infinity());
  for (FastScan& result : results) result.covered = TargetBits(target_count_);

  const int side = field_.map().side;
  // Pipeline of two queries: geometry of the current one, look-ups of the previous one.
  struct Pending {
    size_t query = 0;
    int count = 0;
    uint8_t target[kTargetsPerBlock + 1];
  };
  Lanes pipeline[2];
  Pending waiting[2];
  int turn = 0;
  const auto look_up = [&](int slot, const uint8_t* data, size_t b) {
    Pending& pending = waiting[slot];
    if (pending.count == 0) return;
    const Lanes& lanes = pipeline[slot];
    SeenLane seen_lanes[kTargetsPerBlock];
    int seen_count = 0;
    for (int k = 0; k < pending.count; ++k) {
      const int i = pending.target[k];
      uint8_t seen = data[static_cast<size_t>(lanes.camera_cell[i]) * kTargetsPerBlock + i] &
                     data[static_cast<size_t>(lanes.laser_cell[i]) * kTargetsPerBlock + i];
      if (seen == 0) continue;
      const TargetProbes& probes = probes_[b * kTargetsPerBlock + i];
      if (lanes.border[i]) seen &= ProbesInView(floats[pending.query], probes);
      if (seen == 0) continue;
      const Block& block = blocks_[b];
      if (!scans[pending.query].boxes.empty() &&
          HiddenByBox(scans[pending.query], floats[pending.query],
                      {block.x[i], block.y[i], block.z[i]}, lanes.stage[i])) {
        continue;
      }
      seen_lanes[seen_count++] = {static_cast<uint8_t>(i), seen};
    }
    if (light_.map != nullptr && seen_count > 0) {
      seen_count = KeepLit(floats[pending.query], b, seen_lanes, seen_count);
    }
    uint64_t bits = 0;
    float low = start[pending.query], high = end[pending.query];
    for (int k = 0; k < seen_count; ++k) {
      const int i = seen_lanes[k].lane;
      const size_t target = b * kTargetsPerBlock + static_cast<size_t>(i);
      if (with_seen && target < target_count_) {
        results[pending.query].seen.push_back(
            {static_cast<uint32_t>(target), seen_lanes[k].probes});
        low = std::min(low, lanes.stage[i]);
        high = std::max(high, lanes.stage[i]);
      }
      if (lanes.sparse[i] && !GridCovers(floats[pending.query], probes_[target],
                                         blocks_[b].horizon[i] == 0, seen_lanes[k].probes)) {
        continue;
      }
      bits |= uint64_t{1} << i;
      low = std::min(low, lanes.stage[i]);
      high = std::max(high, lanes.stage[i]);
    }
    start[pending.query] = low;
    end[pending.query] = high;
    results[pending.query].covered.words()[b] = bits;
    pending.count = 0;
  };
  for (size_t b = 0; b < blocks_.size(); ++b) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) return;
    const Block& block = blocks_[b];
    const uint8_t* data = field_.BlockData(b);
    for (size_t q = 0; q < scans.size(); ++q) {
      if (!scans[q].sweeps) continue;
      const FloatScan& f = floats[q];
      // Whole block outside: the camera's coordinates are linear in the point, so a sphere test on
      // the lit moment of the centre would be wrong; bound the lit moment by the gradient instead.
      const Eigen::Vector3f c = block.centre;
      const float s = f.gx * c.x() + f.gy * c.y() + f.gz * c.z() + f.lit_offset;
      const float reach = block.radius * (1 + 1 / f.normal_x) + f.reach;
      const Eigen::Vector3f to_camera(f.cx - s * f.sx - c.x(), f.cy - s * f.sy - c.y(),
                                      f.cz - s * f.sz - c.z());
      const float depth = -(to_camera.x() * f.wx + to_camera.y() * f.wy + to_camera.z() * f.wz);
      const float distance = to_camera.norm();
      if (depth < std::max(0.0f, f.min_depth) - reach || depth > f.max_depth + reach) continue;
      if (distance > f.max_range + reach) continue;
      if (std::max(depth - reach, 0.0f) * (distance - reach) > f.max_depth_times_distance) continue;
      const float image_x =
          std::abs(to_camera.x() * f.ex + to_camera.y() * f.ey + to_camera.z() * f.ez);
      if (image_x - depth * f.tan_x > reach * std::sqrt(1 + f.tan_x * f.tan_x)) continue;
      const float image_y =
          std::abs(to_camera.x() * f.yx + to_camera.y() * f.yy + to_camera.z() * f.yz);
      if (image_y - depth * f.tan_y > reach * std::sqrt(1 + f.tan_y * f.tan_y)) continue;
      const Eigen::Vector3f to_laser(f.lx - s * f.sx - c.x(), f.ly - s * f.sy - c.y(),
                                     f.lz - s * f.sz - c.z());
      // Laser and camera travel together, so both move away from the centre's lit moment alike.
      const float laser_depth =
          -(to_laser.x() * f.lwx + to_laser.y() * f.lwy + to_laser.z() * f.lwz);
      const float laser_x =
          std::abs(to_laser.x() * f.ex + to_laser.y() * f.ey + to_laser.z() * f.ez);
      if (laser_x - laser_depth * f.fan_tangent >
          reach * std::sqrt(1 + f.fan_tangent * f.fan_tangent)) {
        continue;
      }
      const auto turned_away = [&](const Eigen::Vector3f& to_sensor, float to_sensor_m) {
        return block.cone_axis.dot(to_sensor) <
               -to_sensor_m * (block.cone_sine + block.max_horizon) - reach;
      };
      if (block.cone_sine < 1 &&
          (turned_away(to_camera, distance) || turned_away(to_laser, to_laser.norm()))) {
        continue;
      }
      Lanes& lanes = pipeline[turn];
      TestBlock(block, f, side, lanes);
      Pending& pending = waiting[turn];
      pending.query = q;
      pending.count = 0;
      for (int i = 0; i < kTargetsPerBlock; ++i) {
        pending.target[pending.count] = static_cast<uint8_t>(i);
        pending.count += lanes.valid[i];
      }
      // A row is one cache line; fetch it while the next query's geometry is computed.
      for (int k = 0; k < pending.count; ++k) {
        const int i = pending.target[k];
        __builtin_prefetch(data + static_cast<size_t>(lanes.camera_cell[i]) * kTargetsPerBlock);
        __builtin_prefetch(data + static_cast<size_t>(lanes.laser_cell[i]) * kTargetsPerBlock);
      }
      turn ^= 1;
      look_up(turn, data, b);
    }
    look_up(turn ^ 1, data, b);
    look_up(turn, data, b);
  }
  for (size_t q = 0; q < scans.size(); ++q) {
    if (target_count_ % 64 != 0) {
      results[q].covered.words().back() &= (uint64_t{1} << (target_count_ % 64)) - 1;
    }
    results[q].stage_start_m = start[q] <= end[q] ? start[q] : 1;
    results[q].stage_end_m = start[q] <= end[q] ? end[q] : 0;
  }
}

}  // namespace sightline
