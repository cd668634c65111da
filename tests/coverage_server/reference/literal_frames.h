// SPDX-License-Identifier: Apache-2.0
// The thesis's definition of measurement points taken literally: every frame is rendered, the laser
// line is found in the picture, and its sub-pixel positions are reconstructed on the laser sheet.
// Slow, and written from the rig's equations without the engine's geometry or cutting code: the
// reference for the exact evaluator.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "core/rig/measurement.h"
#include "core/rig/rig.h"

namespace sightline {

struct LiteralPoint {
  Eigen::Vector3d position_m;  // part coordinates
  Eigen::Vector3d normal;
  int column_px;
  double row_px;  // sub-pixel, 0 at the upper border
};

class LiteralScanner {
 public:
  // The laser's depth picture is one row of samples lying in the sheet.
  static constexpr int kLaserSamples = 8192;

  // The camera's depth picture has its columns (sampled at their centres) and `sub_rows` rows per
  // pixel. The mesh must outlive the scanner. INTERNAL if OpenGL fails.
  static absl::StatusOr<std::unique_ptr<LiteralScanner>> Make(const TriangleMesh& part,
                                                              const Rig& rig,
                                                              const Measurement& measurement,
                                                              int sub_rows);
  virtual ~LiteralScanner() = default;

  // Renders the frame at stage position frame * scan_step and returns its measurement points in
  // order of column and row.
  virtual std::vector<LiteralPoint> Frame(int frame) = 0;

  // Concerns the frame rendered last: true if a rendering cannot decide a point at this place (part
  // coordinates) because within one camera pixel of it, seen from camera or laser, the picture has
  // an edge (a jump in depth, another surface, the border) or the surface is within
  // `grazing_rad` of grazing.
  virtual bool Undecided(const Eigen::Vector3d& position_m, const Eigen::Vector3d& normal,
                         double grazing_rad) const = 0;
};

}  // namespace sightline
