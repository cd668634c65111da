// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/answer/excess_region.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "core/rig/scan_geometry.h"

namespace sightline {
namespace {

// Residual above which blocks are significant [standard deviations]: the usual three-sigma rule.
constexpr double kExcess = 3;

std::string SurfaceName(const Inspection& inspection, int material) {
  if (material < 0 || material >= static_cast<int>(inspection.materials.size())) return "obstacle";
  const MaterialChoice& choice = inspection.materials[static_cast<size_t>(material)];
  return !choice.part_material.empty() ? choice.part_material : choice.material.name();
}

// All significant blocks connected with `start`, in the order of a breadth-first search, which
// marks them in `seen`.
std::vector<int> ConnectedBlocks(const BlockGrid& grid, const Eigen::VectorXd& residuals, int start,
                                 std::vector<bool>* seen) {
  std::vector<int> region = {start};
  (*seen)[static_cast<size_t>(start)] = true;
  for (size_t next = 0; next < region.size(); ++next) {
    const int block = region[next];
    for (const auto& [di, dj] :
         {std::pair(-1, 0), std::pair(1, 0), std::pair(0, -1), std::pair(0, 1)}) {
      const int i = grid.RowOf(block) + di, j = grid.ColumnOf(block) + dj;
      if (i < 0 || j < 0 || i >= grid.rows || j >= grid.columns) continue;
      const int neighbour = grid.Index(grid.RecordingOf(block), i, j);
      if ((*seen)[static_cast<size_t>(neighbour)] || residuals[neighbour] < kExcess) continue;
      (*seen)[static_cast<size_t>(neighbour)] = true;
      region.push_back(neighbour);
    }
  }
  return region;
}

// The region with most light; empty if none has any.
std::vector<int> BrightestRegion(const BlockGrid& grid, const Eigen::VectorXd& residuals,
                                 const Eigen::VectorXd& electrons) {
  double largest_sum = 0;
  std::vector<bool> seen(static_cast<size_t>(grid.count()));
  std::vector<int> brightest;
  for (int start = 0; start < grid.count(); ++start) {
    if (seen[static_cast<size_t>(start)] || residuals[start] < kExcess) continue;
    std::vector<int> region = ConnectedBlocks(grid, residuals, start, &seen);
    double sum = 0;
    for (const int block : region) sum += electrons[block];
    if (sum <= largest_sum) continue;
    largest_sum = sum;
    brightest = std::move(region);
  }
  return brightest;
}

// Sets the bounding box and the mean light.
void DescribeBlocks(const BlockGrid& grid, const Eigen::VectorXd& electrons,
                    const std::vector<int>& region, ExcessRegion* excess) {
  excess->first_row_px = excess->first_column_px = std::numeric_limits<int>::max();
  for (const int block : region) {
    const int top = grid.RowOf(block) * grid.block_px;
    const int left = grid.ColumnOf(block) * grid.block_px;
    excess->first_row_px = std::min(excess->first_row_px, top);
    excess->last_row_px = std::max(excess->last_row_px, top + grid.block_px - 1);
    excess->first_column_px = std::min(excess->first_column_px, left);
    excess->last_column_px = std::max(excess->last_column_px, left + grid.block_px - 1);
    excess->mean_electrons += std::max(0.0, electrons[block]);
  }
  excess->mean_electrons /= static_cast<double>(region.size());
}

// Light by material over the pixels of the region that see a surface.
std::map<int, double> LightByMaterial(const BlockGrid& grid, const SeenSurface& surface,
                                      const Eigen::VectorXd& electrons,
                                      const std::vector<int>& region, double* sum) {
  std::map<int, double> by_material;
  for (const int block : region) {
    const int top = grid.RowOf(block) * grid.block_px;
    const int left = grid.ColumnOf(block) * grid.block_px;
    const double weight = std::max(0.0, electrons[block]);
    for (int i = top; i < top + grid.block_px; ++i) {
      for (int j = left; j < left + grid.block_px; ++j) {
        if (surface.depth_m.At(i, j) <= 0) continue;
        by_material[static_cast<int>(surface.material.At(i, j))] += weight;
        *sum += weight;
      }
    }
  }
  return by_material;
}

// The point of the surface in the middle of a block, in part coordinates.
Eigen::Vector3d PlaceOfBlock(const RecordedScene& scene, const SeenSurface& surface,
                             const BlockGrid& grid, int block) {
  const int row = grid.RowOf(block) * grid.block_px + grid.block_px / 2;
  const int column = grid.ColumnOf(block) * grid.block_px + grid.block_px / 2;
  const double depth_m = surface.depth_m.At(row, column);
  const RecordedImage& recorded =
      scene.recordings.recordings[static_cast<size_t>(grid.RecordingOf(block))];
  const Camera& camera = scene.inspection.rig.camera;
  const ScanGeometry geometry = MakeScanGeometry(scene.inspection.rig, recorded.measurement);
  const SensorPose pose = WorldToPart(geometry, scene.part.BoundingBox().center(), geometry.camera,
                                      recorded.stage_position_m);
  // This pixel lies on the optical axis.
  const int axis_column = camera.columns_px / 2, axis_row = camera.rows_px / 2;
  const double x = (column - axis_column) / camera.FocalLengthPx();
  const double y = (row - axis_row) / camera.FocalLengthPx();
  return pose.origin_m + depth_m * (pose.z_axis + x * pose.x_axis + y * pose.y_axis);
}

}  // namespace

ExcessRegion FindExcessRegion(const RecordedScene& scene, const SceneLight& light,
                              const BlockGrid& grid, const Eigen::VectorXd& null_residuals,
                              const Eigen::VectorXd& electrons) {
  ExcessRegion excess;
  const std::vector<int> region = BrightestRegion(grid, null_residuals, electrons);
  if (region.empty()) return excess;
  excess.recording = grid.RecordingOf(region.front());
  DescribeBlocks(grid, electrons, region, &excess);
  const SeenSurface& surface = light.surfaces[static_cast<size_t>(excess.recording)];
  double sum = 0;
  const std::map<int, double> by_material = LightByMaterial(grid, surface, electrons, region, &sum);
  if (sum <= 0) return excess;
  const auto material =
      std::max_element(by_material.begin(), by_material.end(),
                       [](const auto& a, const auto& b) { return a.second < b.second; });
  excess.surface = SurfaceName(scene.inspection, material->first);
  excess.surface_share = material->second / sum;
  const int brightest = *std::max_element(
      region.begin(), region.end(), [&](int a, int b) { return electrons[a] < electrons[b]; });
  excess.place_m = PlaceOfBlock(scene, surface, grid, brightest);
  return excess;
}

}  // namespace sightline
