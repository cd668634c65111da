// SPDX-License-Identifier: Apache-2.0
// Writes image files with OpenImageIO; core/image/read_raw_image.h reads raw ones. Every file is
// written under another name and then renamed, so that no incomplete file is visible. The same
// image and text give the same bytes.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/image/image.h"
#include "core/image/read_raw_image.h"

namespace sightline {

enum class ImageFormat { kPng, kTiff };

// ".png" or ".tif".
const char* FileExtension(ImageFormat format);

// Writes raw values unscaled as 16-bit greyscale. `description` (JSON about the image's origin)
// becomes the TIFF's ImageDescription or the PNG's text "Description". RESOURCE_EXHAUSTED or
// INTERNAL names the file and the reason why it cannot be written.
absl::Status WriteRawImage(const std::string& path, const Image<uint16_t>& raw_dn,
                           const std::string& description, ImageFormat format);

// Red, green, blue, 16 bits each; values are rounded and clipped to [0, 65535].
absl::Status WriteColourImage(const std::string& path, const std::array<Image<float>, 3>& image_dn,
                              const std::string& description, ImageFormat format);

// One float channel per layer; all have the same size.
struct ImageLayer {
  std::string name;  // with its unit: "laser_radiance_w_m2_sr"
  const Image<float>* image;
};
// OpenEXR, ZIP compression (lossless), 32-bit float.
absl::Status WriteLayers(const std::string& path, const std::vector<ImageLayer>& layers,
                         const std::string& description);

}  // namespace sightline
