// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/scan/exact_evaluator.h"

#include <algorithm>
#include <cmath>

#include "coverage_server/scan/place_conditions.h"

namespace sightline {
namespace {

struct Candidate {
  Eigen::Vector3f point;
  float depth;
  uint32_t triangle;
  int32_t column;
};

// Clears candidates that are occluded from `from` (part coordinates).
void RemoveOccluded(const std::vector<Occluder>& occluders, const ScanGeometry& geometry,
                    const Eigen::Vector3d& part_centre_m, double stage_m,
                    const Eigen::Vector3f& from, std::vector<Candidate>& candidates) {
  for (const Occluder& occluder : occluders) {
    const FrameChange change = FromPart(occluder.frame, geometry, part_centre_m, stage_m);
    const Eigen::Vector3f source = change(from);
    size_t kept = 0;
    TriangleBvh::Bundle bundle;
    for (size_t i = 0; i < candidates.size(); i += TriangleBvh::kLanes) {
      const size_t lanes = std::min<size_t>(TriangleBvh::kLanes, candidates.size() - i);
      for (size_t k = 0; k < TriangleBvh::kLanes; ++k) {
        const Eigen::Vector3f to = change(candidates[i + std::min(k, lanes - 1)].point);
        bundle.to_x[k] = to.x();
        bundle.to_y[k] = to.y();
        bundle.to_z[k] = to.z();
        bundle.gap[k] = kSurfaceGapM / (to - source).norm();
      }
      const uint32_t occluded = occluder.bvh.Occluded(source, bundle, (1u << lanes) - 1);
      for (size_t k = 0; k < lanes; ++k) {
        if (!((occluded >> k) & 1)) candidates[kept++] = candidates[i + k];
      }
    }
    candidates.resize(kept);
  }
}

}  // namespace

std::vector<MeasurementPoint> MeasureScan(const TriangleMesh& part, const Rig& rig,
                                          const Eigen::Vector3d& part_centre_m,
                                          const std::vector<Occluder>& occluders,
                                          const ScanGeometry& geometry, const PointLimits& depth,
                                          const std::atomic<bool>* cancelled,
                                          const LightLimit* light) {
  std::vector<MeasurementPoint> points;
  const ScanInPart scan = MakeScanInPart(rig, part_centre_m, geometry, depth);
  if (!scan.sweeps) return points;
  const double step = scan.scan_step_m;

  // Frames in which a triangle can be lit, imaged and in range.
  const size_t triangle_count = part.triangles.size();
  std::vector<double> stage(part.positions_m.size());
  for (size_t v = 0; v < stage.size(); ++v) {
    stage[v] = scan.lit_gradient.dot(part.positions_m[v].cast<double>()) + scan.lit_offset_m;
  }
  struct FrameRange {
    int32_t first, last;
  };
  std::vector<FrameRange> ranges(triangle_count, {0, -1});
  int32_t first_frame = 0, last_frame = -1;
  const auto& camera = scan.camera;
  const double reach_x = scan.half_columns_px / scan.focal_length_px;
  const double reach_y = scan.half_rows_px / scan.focal_length_px;
  for (size_t t = 0; t < triangle_count; ++t) {
    const auto& corner = part.triangles[t];
    const double s[3] = {stage[corner[0]], stage[corner[1]], stage[corner[2]]};
    const double low = std::min({s[0], s[1], s[2]}), high = std::max({s[0], s[1], s[2]});
    const double first = std::ceil(low / step), last = std::floor(high / step);
    if (!(first <= last) || std::abs(first) > 1e8 || std::abs(last) > 1e8) continue;
    // Facing and field of view at both ends of the triangle's lit interval: both are linear in the
    // stage position, so a triangle that fails at both ends fails in between.
    const Eigen::Vector3d a = part.Corner(t, 0), b = part.Corner(t, 1), c = part.Corner(t, 2);
    const Eigen::Vector3d n = (b - a).cross(c - a);
    bool faces_camera = false, faces_laser = false;
    bool outside[5] = {true, true, true, true, true};
    for (const double stage_m : {low, high}) {
      const Eigen::Vector3d shift = stage_m * scan.scan_direction;
      faces_camera |= n.dot(camera.origin_m - shift - a) > 0;
      faces_laser |= n.dot(scan.laser.origin_m - shift - a) > 0;
      for (const Eigen::Vector3d& p : {a, b, c}) {
        const Eigen::Vector3d q = p - (camera.origin_m - shift);
        const double x = q.dot(camera.x_axis), y = q.dot(camera.y_axis), z = q.dot(camera.z_axis);
        outside[0] &= z < kNearPlaneM;
        outside[1] &= x > reach_x * z;
        outside[2] &= -x > reach_x * z;
        outside[3] &= y > reach_y * z;
        outside[4] &= -y > reach_y * z;
      }
    }
    if (!faces_camera || !faces_laser) continue;
    if (outside[0] || outside[1] || outside[2] || outside[3] || outside[4]) continue;
    ranges[t] = {static_cast<int32_t>(first), static_cast<int32_t>(last)};
    if (first_frame > last_frame) {
      first_frame = ranges[t].first;
      last_frame = ranges[t].last;
    } else {
      first_frame = std::min(first_frame, ranges[t].first);
      last_frame = std::max(last_frame, ranges[t].last);
    }
  }
  if (first_frame > last_frame) return points;

  // Triangles by the frame they enter in; `active` holds those the sheet is passing through.
  std::vector<std::vector<uint32_t>> entering(static_cast<size_t>(last_frame - first_frame) + 1);
  for (size_t t = 0; t < triangle_count; ++t) {
    if (ranges[t].first <= ranges[t].last)
      entering[ranges[t].first - first_frame].push_back(static_cast<uint32_t>(t));
  }
  std::vector<uint32_t> active;
  std::vector<Candidate> candidates;
  const double half_columns = scan.half_columns_px, focal = scan.focal_length_px;

  for (int32_t frame = first_frame; frame <= last_frame; ++frame) {
    if (cancelled != nullptr && cancelled->load(std::memory_order_relaxed)) break;
    const double stage_m = frame * step;
    std::erase_if(active, [&](uint32_t t) { return ranges[t].last < frame; });
    const auto& entered = entering[frame - first_frame];
    active.insert(active.end(), entered.begin(), entered.end());
    const Eigen::Vector3d camera_at = camera.origin_m - stage_m * scan.scan_direction;
    const Eigen::Vector3d laser_at = scan.laser.origin_m - stage_m * scan.scan_direction;

    candidates.clear();
    for (const uint32_t t : active) {
      const auto& corner = part.triangles[t];
      const Eigen::Vector3d a = part.Corner(t, 0), b = part.Corner(t, 1), c = part.Corner(t, 2);
      const Eigen::Vector3d n = (b - a).cross(c - a);
      if (n.dot(camera_at - a) <= 0 || n.dot(laser_at - a) <= 0) continue;
      // The segment cut by the sheet: crossings of edges. "Above" includes equality, so a vertex on
      // the sheet belongs to one side and neighbouring triangles share their end points.
      const double d[3] = {stage[corner[0]] - stage_m, stage[corner[1]] - stage_m,
                           stage[corner[2]] - stage_m};
      const Eigen::Vector3d v[3] = {a, b, c};
      Eigen::Vector3d ends[2];
      int count = 0;
      for (int k = 0; k < 3 && count < 2; ++k) {
        const int m = (k + 1) % 3;
        if ((d[k] >= 0) == (d[m] >= 0)) continue;
        // Interpolate from the lower vertex index, so that both triangles of an edge agree.
        const bool swap = corner[m] < corner[k];
        const int p = swap ? m : k, q = swap ? k : m;
        ends[count++] = v[p] + d[p] / (d[p] - d[q]) * (v[q] - v[p]);
      }
      if (count < 2) continue;
      double x[2], z[2];
      for (int k = 0; k < 2; ++k) {
        const Eigen::Vector3d q = ends[k] - camera_at;
        x[k] = q.dot(camera.x_axis);
        z[k] = q.dot(camera.z_axis);
      }
      double t0 = 0, t1 = 1;  // clip to the near plane
      if (z[0] < kNearPlaneM && z[1] < kNearPlaneM) continue;
      if (z[0] < kNearPlaneM) t0 = (kNearPlaneM - z[0]) / (z[1] - z[0]);
      if (z[1] < kNearPlaneM) t1 = (kNearPlaneM - z[0]) / (z[1] - z[0]);
      const auto image_column = [&](double u) {
        return focal * (x[0] + u * (x[1] - x[0])) / (z[0] + u * (z[1] - z[0])) + half_columns;
      };
      const double u0 = image_column(t0), u1 = image_column(t1);
      // Column centres in the half-open interval: shared end points count once.
      const double low = std::max(std::min(u0, u1) - 0.5, -1.0);
      const double high = std::min(std::max(u0, u1) - 0.5, 2 * half_columns);
      const int first = std::max(0, static_cast<int>(std::ceil(low)));
      const int last = std::min(rig.camera.columns_px - 1, static_cast<int>(std::ceil(high)) - 1);
      for (int column = first; column <= last; ++column) {
        const double offset = column + 0.5 - half_columns;
        const double denominator = focal * (x[1] - x[0]) - offset * (z[1] - z[0]);
        if (denominator == 0) continue;
        const double u = std::clamp((offset * z[0] - focal * x[0]) / denominator, 0.0, 1.0);
        const Eigen::Vector3d point = ends[0] + u * (ends[1] - ends[0]);
        const Eigen::Vector3d q = point - camera_at;
        const double depth_m = DepthOf(scan, q);
        if (depth_m < kNearPlaneM || !WithinDepth(scan.depth, depth_m)) continue;
        if (!InRows(scan, q, depth_m) || !InRange(scan, q)) continue;
        if (!FineInDepth(scan.depth, q, depth_m)) continue;
        if (!InFan(scan, point - laser_at)) continue;
        if (!WithinIncidence(scan.depth, n, -q) ||
            !WithinIncidence(scan.depth, n, laser_at - point)) {
          continue;
        }
        candidates.push_back({point.cast<float>(), static_cast<float>(depth_m), t, column});
      }
    }
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& p, const Candidate& q) {
      return std::tie(p.column, p.depth, p.triangle) < std::tie(q.column, q.depth, q.triangle);
    });
    RemoveOccluded(occluders, geometry, part_centre_m, stage_m, laser_at.cast<float>(), candidates);
    RemoveOccluded(occluders, geometry, part_centre_m, stage_m, camera_at.cast<float>(),
                   candidates);
    for (const Candidate& c : candidates) {
      const Eigen::Vector3d normal = part.Normal(c.triangle);
      if (light != nullptr) {
        const Eigen::Vector3d place = c.point.cast<double>();
        const LightOfPlace here =
            light->At(light->EntryOf(c.triangle), normal, camera_at - place, laser_at - place);
        if (here.verdict != LightVerdict::kDetected) continue;
      }
      points.push_back({c.point, normal.cast<float>(), frame, c.column});
    }
  }
  return points;
}

}  // namespace sightline
