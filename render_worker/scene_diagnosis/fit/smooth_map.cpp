// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/fit/smooth_map.h"

#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {
namespace {

// Cosines per axis. Chosen: 25 coefficients are as many as a few recordings determine.
constexpr int kMapOrder = 5;

Image<double> CosineImage(int rows, int columns, int v, int u) {
  Image<double> image(columns, rows);
  for (int i = 0; i < rows; ++i) {
    for (int j = 0; j < columns; ++j) {
      image.At(i, j) = std::cos(std::numbers::pi * v * (i + 0.5) / rows) *
                       std::cos(std::numbers::pi * u * (j + 0.5) / columns);
    }
  }
  return image;
}

}  // namespace

std::vector<LightPath> SmoothMap(const RecordedScene& scene, int recordings,
                                 double scale_electrons) {
  const int columns = scene.inspection.rig.camera.columns_px;
  const int rows = scene.inspection.rig.camera.rows_px;
  std::vector<LightPath> map;
  for (int v = 0; v < kMapOrder; ++v) {
    for (int u = 0; u < kMapOrder; ++u) {
      LightPath path;
      path.effect = std::string(kUnknownLight);
      path.parameter = absl::StrCat("cosine_", v, "_", u, "_electrons");
      path.prior_standard_deviation = scale_electrons;
      path.may_be_negative = true;
      const Image<double> image = CosineImage(rows, columns, v, u);
      for (int r = 0; r < recordings; ++r) {
        const RecordedImage& recorded = scene.recordings.recordings[static_cast<size_t>(r)];
        path.electrons.push_back(
            recorded.kind == RecordingKind::kDark ? Image<double>(columns, rows) : image);
      }
      map.push_back(std::move(path));
    }
  }
  return map;
}

}  // namespace sightline
