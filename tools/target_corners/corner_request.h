// SPDX-License-Identifier: Apache-2.0
// Request to the program and its answer, as JSON.
//
//   {"images": [FILE, ...], "inner_corners_x": 7, "inner_corners_y": 6, "square_m": 0.01,
//    "camera": {"fx": .., "fy": .., "cx": .., "cy": .., "distortion": [k1, k2, p1, p2, k3]}}
//   -> {"columns_px": 1280, "rows_px": 1024, "camera": {.., "rms_px": ..},
//       "frames": [{"corners_px": [[x, y], ..], "rotation_vector": [..], "translation_m": [..]},
//                  {"because": ".."}]}
//
// Without "camera" it is estimated from all views. Frames come in the order of the images.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "absl/status/statusor.h"

namespace sightline {

// INVALID_ARGUMENT: the request is no such message, an image cannot be read, images differ in size,
// or fewer than three show the board and the camera is to be estimated.
absl::StatusOr<nlohmann::json> AnswerCornerRequest(const nlohmann::json& request);

}  // namespace sightline
