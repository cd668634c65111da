// SPDX-License-Identifier: Apache-2.0
// Options that select frames of a part, and their interpretation.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

struct FrameChoice {
  std::string input, out;  // inspection file, and the output folder
  std::string plan, measurement;
  bool other_part = false;  // the plan may be of another part
  std::optional<int> scan, frame;
  std::optional<double> stage_position_m;
};

// --plan, --measurement, --scan, --frame, --stage-position and --other-part.
void AddFrameOptions(CLI::App& app, FrameChoice* choice);

// Returns all frames of a plan or of one of its scans, one frame, or the frame of the measurement
// that is given or that the inspection fixes; each with the settings of the plan's scans.
// INVALID_ARGUMENT names options that exclude each other, a number out of range, missing data of a
// plan, or a plan of another part. Adds remarks on the plan to `remarks`.
absl::StatusOr<std::vector<v1::PartFrame>> ChooseFrames(FrameChoice options,
                                                        const Inspection& inspection,
                                                        std::vector<std::string>* remarks);

}  // namespace sightline
