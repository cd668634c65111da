// SPDX-License-Identifier: Apache-2.0
// A quick preview of the camera's image: rendered with fewer, larger pixels.
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

struct DraftPicture {
  std::string png;  // 8-bit, grey or colour
  int columns_px = 0, rows_px = 0;
  int reduction = 1;            // pixels of the camera per pixel of the picture and axis
  double clipped_fraction = 0;  // of the picture's pixels: at the end of the sensor's scale
  std::vector<std::string> warnings;
};

// CANCELLED once `cancelled` is set.
using DrawDraft = std::function<absl::StatusOr<DraftPicture>(const v1::PartFrame& frame,
                                                             const std::atomic<bool>& cancelled)>;

// Most pixels of a draft.
inline constexpr int64_t kDraftPixels = 60'000;

struct DraftSettings {
  int64_t max_pixels = kDraftPixels;
  // Standard error of the incoherent image relative to the local signal. With few samples,
  // difficult light does not reach it.
  double noise_relative = 0.2;
};

// Changes a request for images of a part into a draft; its inspection is self-contained (see
// v1::PartRender). Square groups of pixels are joined until at most `max_pixels` are left, with up
// to three pixels lost at the edges. The exposure (and, by a faster stage, the motion blur) is
// shortened so that each group collects as much light as one pixel of the camera. No speckle, one
// reflection, few samples. `reduction`: pixels of the camera per pixel and axis.
v1::RenderSpec DraftOf(v1::RenderSpec spec, const DraftSettings& settings, int* reduction);

// The same for one frame, as PNG.
v1::RenderSpec DraftSpec(const v1::Inspection& inspection, const v1::PartFrame& frame,
                         int64_t max_pixels, int* reduction);

// Converts a raw image (16-bit greyscale PNG, `bit_depth_bit` in use, RGGB mosaic if `bayer`) for a
// screen: black at `black_dn`, white at the sensor's full scale, so that longer exposures look
// brighter. INTERNAL: `file` is no such image.
absl::StatusOr<DraftPicture> PictureOfRaw(const std::string& file, int bit_depth_bit,
                                          double black_dn, bool bayer);

// Draws with a render worker. `inspection`: as for DraftSpec, its `assets` as files. `worker` has
// the address and must outlive the returned function.
DrawDraft DrawWithWorker(v1::Inspection inspection, std::vector<AssetFile> assets,
                         ServerAccess worker);

}  // namespace sightline
