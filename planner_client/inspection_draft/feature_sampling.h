// SPDX-License-Identifier: Apache-2.0
// Denser sampling of small toleranced surfaces. At the spacing that suits the whole part, an 11 mm
// hole has four targets, too few for a fit.
#pragma once

#include <Eigen/Geometry>
#include <span>
#include <string>
#include <vector>

#include "core/tolerance/face_surface.h"
#include "core/tolerance/tolerance.h"
#include "sightline/v1/targets.pb.h"

namespace sightline {

// A face that a tolerance or a datum binds.
struct TolerancedSurface {
  std::string name;  // "face 12: position.3"
  Eigen::AlignedBox3d box_m;
  double area_m2 = 0;
};

// The faces that the report's tolerances and datums bind, each once, by number.
std::vector<TolerancedSurface> TolerancedSurfacesOf(const ToleranceReport& report,
                                                    std::span<const FaceTriangles> faces);

// Least number of targets of every toleranced surface. A fit needs kFewestFeatureTargets; its form
// needs several targets per parameter.
inline constexpr int kWishedFeatureTargets = 25;
// Most regions; the surfaces with the fewest targets get them.
inline constexpr size_t kMostSampledFeatures = 200;

// Returns a region of targets for each surface with fewer than kWishedFeatureTargets at the general
// spacing [m], in the order of the surfaces. At the spacing s a surface of area A gets about
// kTargetsPerSpacing2 A / s^2 targets. s is rounded down to a multiple of 0.05 mm, but is at least
// 0.1 mm.
std::vector<v1::TargetRegion> SampleFeatures(std::span<const TolerancedSurface> surfaces,
                                             double spacing_m);

}  // namespace sightline
