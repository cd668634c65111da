// SPDX-License-Identifier: Apache-2.0
#include "render_worker/render/memory_estimate.h"

#include <algorithm>

#include "absl/strings/str_format.h"
#include "proto/status/rpc_status.h"
#include "render_worker/optics/pupil.h"

namespace sightline {
namespace {

// Radiance, reflected radiance, depth (float), material (16 bit), and the mean over moments.
constexpr int64_t kBytesPerLaserSample = 4 + 4 + 4 + 2 + 4;
// Radiance, its error, and every channel twice (traced and as electron flux).
constexpr int64_t kBytesPerIncoherentSample = 12;
constexpr int64_t kBytesPerChannelSample = 8;
// Light of the pixel (laser, three channels), electrons before and after noise, number, layers.
constexpr int64_t kBytesPerPixel = 16 + 16 + 2 + 28;

std::string BytesText(int64_t bytes) {
  constexpr double kKib = 1 << 10, kMib = 1 << 20, kGib = 1 << 30;
  const auto number = static_cast<double>(bytes);
  if (number >= kGib) return absl::StrFormat("%.1f GiB", number / kGib);
  if (number >= kMib) return absl::StrFormat("%.1f MiB", number / kMib);
  return absl::StrFormat("%.0f KiB", number / kKib);
}

int64_t Samples(const SubPixelGrid& grid) {
  return static_cast<int64_t>(grid.columns()) * grid.rows();
}

}  // namespace

int SubPixelsOf(const FrameSetup& frame) {
  return std::max(frame.sub_pixels,
                  RequiredSubPixels(frame.PupilDiameter(), frame.laser.wavelength_m,
                                    frame.ImageDistance(), frame.sensor.pixel_pitch_m));
}

int64_t FrameBytes(const SubPixelGrid& laser_grid, const SubPixelGrid& incoherent_grid,
                   int channels) {
  return kBytesPerLaserSample * Samples(laser_grid) +
         (kBytesPerIncoherentSample + kBytesPerChannelSample * channels) *
             Samples(incoherent_grid) +
         kBytesPerPixel * laser_grid.roi.columns_px * static_cast<int64_t>(laser_grid.roi.rows_px);
}

int64_t EstimateFrameBytes(const FrameSetup& frame) {
  const double pitch = frame.sensor.pixel_pitch_m;
  return FrameBytes({frame.roi, SubPixelsOf(frame), 0, pitch}, {frame.roi, 2, 0, pitch},
                    frame.sensor.channels());
}

absl::Status CheckFrameBytes(int64_t bytes, int64_t max_bytes, const FrameSetup& frame,
                             int sub_pixels, const std::string& context) {
  if (bytes <= max_bytes) return absl::OkStatus();
  return WithErrorInfo(
      absl::ResourceExhaustedError(absl::StrFormat(
          "%s: an image of %d x %d px with %d x %d sub-pixels each (what f/%.3g needs at %.3g um "
          "pitch) takes about %s of memory, the limit is %s (--max-image-bytes)",
          context, frame.roi.columns_px, frame.roi.rows_px, sub_pixels, sub_pixels,
          frame.lens.f_number, 1e6 * frame.sensor.pixel_pitch_m, BytesText(bytes),
          BytesText(max_bytes))),
      "IMAGE_TOO_LARGE",
      {{"needed_bytes", absl::StrFormat("%d", bytes)},
       {"max_image_bytes", absl::StrFormat("%d", max_bytes)}});
}

}  // namespace sightline
