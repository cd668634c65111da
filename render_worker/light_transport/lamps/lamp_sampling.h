// SPDX-License-Identifier: Apache-2.0
// Samples rectangular lamps by solid angle.
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render_worker/light_transport/scene.h"

namespace sightline {

// A rectangle as seen from a point: uniform directions within its solid angle. Urena, Fajardo and
// King, "An area-preserving parametrization for spherical rectangles", EGSR 2013.
class SphericalRectangle {
 public:
  SphericalRectangle(const EmittingRectangle& rectangle, const Eigen::Vector3d& from_m);

  double solid_angle_sr() const { return solid_angle_; }
  // Returns a point of the rectangle.
  Eigen::Vector3d Sample(double u1, double u2) const;

 private:
  Eigen::Vector3d origin_, x_, y_, z_;
  double x0_, x1_, y0_, y1_, z0_;
  double b0_, b1_, k_, solid_angle_;
};

// Chooses a lamp for a surface point, roughly in proportion to its irradiance there.
class LampChoice {
 public:
  explicit LampChoice(const SceneDescription& description);

  bool empty() const { return lamps_.empty(); }
  struct Sample {
    int lamp = -1;  // -1: none lights the point
    Eigen::Vector3f point_m = Eigen::Vector3f::Zero();
    Eigen::Vector3f direction = Eigen::Vector3f::Zero();
    float pdf = 0;  // [1/sr], choice included
  };
  Sample SampleLamp(const SurfacePoint& from, float u_choice, float u1, float u2) const;
  // Density [1/sr] of the direction towards a lamp that a ray from the point has met.
  float Pdf(const SurfacePoint& from, int lamp) const;
  // Nearest lamp whose emitting side a ray meets, and the point; -1: none. Other surfaces are
  // ignored.
  int Meet(const Eigen::Vector3f& from_m, const Eigen::Vector3f& direction,
           Eigen::Vector3f& place_m) const;

 private:
  float Weight(const SurfacePoint& from, int lamp) const;
  float TotalWeight(const SurfacePoint& from) const;

  const std::vector<EmittingRectangle>& lamps_;
  std::vector<Eigen::Vector3f> normals_, centres_m_;
  // Half edges over their squared lengths.
  std::vector<Eigen::Vector3f> inverse_u_1_m_, inverse_v_1_m_;
  std::vector<float> areas_m2_;
  std::vector<float> powers_;
};

}  // namespace sightline
