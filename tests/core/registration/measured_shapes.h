// SPDX-License-Identifier: Apache-2.0
// Parts and points on them for tests of registration.
#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/part/mesh.h"
#include "core/random/counter_random.h"
#include "core/registration/rigid_registration.h"
#include "tests/core/part/test_meshes.h"

namespace sightline {

// Two boxes: no symmetry, 80 x 60 x 50 mm.
inline TriangleMesh StepPart() {
  return Merged(BoxMesh({0, 0, 0}, {0.08f, 0.06f, 0.03f}),
                BoxMesh({0, 0, 0.03f}, {0.03f, 0.045f, 0.05f}));
}

struct SurfaceSample {
  std::vector<Eigen::Vector3d> positions_m, normals;
};

// Points spread evenly over the mesh by area.
inline SurfaceSample SampleSurface(const TriangleMesh& mesh, int count, CounterRandom& random) {
  std::vector<double> sums = {0};
  for (size_t t = 0; t < mesh.triangles.size(); ++t) sums.push_back(sums.back() + mesh.Area(t));
  SurfaceSample sample;
  for (int i = 0; i < count; ++i) {
    const double at = sums.back() * random.Uniform();
    const auto t =
        static_cast<size_t>(std::upper_bound(sums.begin(), sums.end(), at) - sums.begin() - 1);
    double u = random.Uniform(), v = random.Uniform();
    if (u + v > 1) {
      u = 1 - u;
      v = 1 - v;
    }
    const Eigen::Vector3d a = mesh.Corner(t, 0), b = mesh.Corner(t, 1), c = mesh.Corner(t, 2);
    sample.positions_m.push_back(a + u * (b - a) + v * (c - a));
    sample.normals.push_back(mesh.Normal(t));
  }
  return sample;
}

// The part's points as measured: moved by `pose`, with Gaussian noise along the normals.
inline SurfaceSample Measure(SurfaceSample sample, const PartPose& pose, double noise_m,
                             CounterRandom& random) {
  for (size_t i = 0; i < sample.positions_m.size(); ++i) {
    sample.positions_m[i] =
        pose.Matrix() * (sample.positions_m[i] + noise_m * random.Normal() * sample.normals[i]);
    sample.normals[i] = pose.Rotation() * sample.normals[i];
  }
  return sample;
}

}  // namespace sightline
