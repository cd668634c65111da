// SPDX-License-Identifier: Apache-2.0
// Paths of incoherent light: lamps and ambient.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "render_worker/light_transport/lamps/lamp_sampling.h"
#include "render_worker/light_transport/sampling.h"
#include "render_worker/light_transport/scene.h"

namespace sightline {

// Unidirectional path tracing from the camera. Lamps use next-event estimation by solid angle,
// combined with BRDF rays that meet them by the power heuristic (Veach 1997). Ambient light is the
// same in all directions, so sampling the BRDF suffices. Paths carry one number in grey scenes and
// a spectrum in others.
class PathTracer {
 public:
  // One output per channel weight; `scene` must outlive this.
  PathTracer(const RayScene& scene, const std::vector<Spectrum>& channel_weights, int max_bounces);

  int channels() const { return channels_; }

  // Adds the light along one camera ray to the channels; the caller has found the first surface
  // (null: none). Returns the number of rays, as AddReflected. This part contains light directly
  // from lamps to the first surface or the camera, and from ambient to the camera.
  int AddDirect(const SurfacePoint* first, const Eigen::Vector3f& direction, PixelSamples& samples,
                std::span<float> sums) const;
  // Adds all other light. `inverse_distance_1_m`: to the next surface; 0: none met.
  int AddReflected(const SurfacePoint& first, const Eigen::Vector3f& direction,
                   PixelSamples& samples, std::span<float> sums, float& inverse_distance_1_m) const;

 private:
  template <class Value>
  int Direct(const SurfacePoint* first, const Eigen::Vector3f& direction, PixelSamples& samples,
             std::span<float> sums) const;
  template <class Value>
  int Reflected(const SurfacePoint& first, const Eigen::Vector3f& direction, PixelSamples& samples,
                std::span<float> sums, float& inverse_distance_1_m) const;
  // Light of one source times a factor; a spectrum in scenes that are not grey.
  template <class Value>
  class Sum;

  const RayScene& scene_;
  LampChoice lamps_;
  int channels_;
  int max_bounces_;
  std::vector<Spectrum> sources_;  // lamps beyond the ambient radiance, then the ambient one
  std::vector<Spectrum> weights_;
  std::vector<float> channel_radiance_;  // [source][channel]
};

}  // namespace sightline
