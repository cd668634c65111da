// SPDX-License-Identifier: Apache-2.0
// Materials and shapes of known behaviour.
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "render_worker/light_transport/light_transport.h"

namespace sightline {

std::shared_ptr<const Material> TestLambert(double albedo);
// Reflectance that differs between bins: albedo * (bin + 1) / 47, at the laser `albedo`.
std::shared_ptr<const Material> TestColouredLambert(double albedo);

// Rectangle of two triangles, normal u x v.
TriangleMesh Rectangle(const Eigen::Vector3d& centre, const Eigen::Vector3d& half_u,
                       const Eigen::Vector3d& half_v);
// Closed box with normals inwards.
TriangleMesh InwardBox(const Eigen::Vector3d& centre, const Eigen::Vector3d& half);

Spectrum EvenSpectrum(double total);

// Camera at `origin` that looks along -z with x to the right (so y of the image is -y of the part).
SensorPose LookDown(const Eigen::Vector3d& origin);
// Any pose from its viewing direction and the direction of its x axis.
SensorPose Look(const Eigen::Vector3d& origin, const Eigen::Vector3d& z, const Eigen::Vector3d& x);

SubPixelGrid Grid(int columns, int rows, double pitch_m, int sub_pixels = 1);

}  // namespace sightline
