// SPDX-License-Identifier: Apache-2.0
// Samples the pixels of an image until their standard error meets a target.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "render_worker/light_transport/light_transport.h"
#include "render_worker/light_transport/sampling.h"

namespace sightline {

// Features of the first surface that a sample hits, to distinguish surfaces.
struct SampleFeatures {
  bool surface = false;
  bool textured = false;  // a height field tilts its normals
  uint16_t material = 0xffff;
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();  // of the triangle
  float footprint_m = 0;           // width of a pixel on a surface facing the camera
  float inverse_distance_1_m = 0;  // of the light's origin
};

// Means over a pixel's samples.
struct PixelFeatures {
  Eigen::Vector3f position_m = Eigen::Vector3f::Zero();
  Eigen::Vector3f normal = Eigen::Vector3f::Zero();
  float footprint_m = 0;
  float inverse_distance_1_m = 0;
  uint16_t material = 0xffff;  // 0xffff: nothing
  bool uniform = true;         // all samples are on one smooth surface, or none is on any
  bool textured = false;
};

// The light of an image is sampled in two parts, each as often as required.
enum LightPart : int { kUnfiltered = 0, kFilterable = 1 };

// The samples of every pixel form two independent halves, from which errors are estimated, also
// those of filtered images.
struct AdaptiveOptions {
  int channels = 1;       // of either part
  int noise_channel = 0;  // the channel whose noise is controlled
  double noise_target_relative = 0.01;
  double noise_floor_relative =
      0.25;                // relative to the image's mean: darker pixels need no smaller error
  double noise_floor = 0;  // absolute, the same
  // Power of two, at least 2; unfiltered ones may be 0: all light is filterable.
  std::array<int, 2> first_samples_per_px = {16, 16};
  int max_samples_per_px = 4096;
  bool filter = true;
  int filter_radius_px = 16;
  uint64_t seed = 1;
  int threads = 1;
};

struct AdaptiveResult {
  std::vector<Image<float>> unfiltered;  // per channel
  std::vector<Image<float>> filterable;  // per channel; filtered if requested
  // Standard error of the noise channel's sum, bias of the filter included.
  Image<float> standard_error;
  std::vector<PixelFeatures> features;  // per pixel
  int64_t rays = 0;
};

// One sample of one part of a pixel: adds to the channels' sums and returns the number of rays.
// Without sums only the features are computed. The halves (0, 1) must be independent. Called from
// many threads.
using PixelSample =
    std::function<int(int row, int column, int half, int part, PixelSamples& samples,
                      std::span<float> sums, SampleFeatures& features)>;

// True if a sample is on the same smooth surface as another position.
bool SameSurface(const Eigen::Vector3f& position_m, const Eigen::Vector3f& normal,
                 const Eigen::Vector3f& other_m, const Eigen::Vector3f& other_normal,
                 float footprint_m);

absl::StatusOr<AdaptiveResult> SampleAdaptively(int columns, int rows,
                                                const AdaptiveOptions& options,
                                                const PixelSample& sample,
                                                const TransportProgress& progress, double from,
                                                double to);

}  // namespace sightline
