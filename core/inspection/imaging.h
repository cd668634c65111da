// SPDX-License-Identifier: Apache-2.0
// The sections of an inspection for image rendering: camera, lens, sensor, materials, lighting.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"

namespace sightline {

// Columns, rows and pitch default to the sensor's, the vertical field of view to that of rows,
// pitch and thin lens (at its focus distance, or at infinity), otherwise to 45 degrees.
// INVALID_ARGUMENT also if a stated field of view differs by more than 10 % from that of rows,
// pitch and lens.
absl::StatusOr<Camera> ParseCamera(const v1::Camera& message, const std::optional<Lens>& lens,
                                   const std::string& context);
absl::StatusOr<Lens> ParseLens(const v1::Lens& message, const std::string& context);
absl::StatusOr<Laser> ParseLaser(const v1::Laser& message, const std::string& context);

// Back to messages, every default written out.
v1::Lens LensToProto(const Lens& lens);
v1::Laser ImagingLaserToProto(const Laser& laser);

// As InlineInspectionFiles, but continues after errors: `result` lacks files that could not be
// read, and the error names them.
absl::Status InlineFiles(const v1::Inspection& message, const std::string& context,
                         const std::string& base_folder, v1::Inspection* result);

// Fills sensor, materials, lighting, render settings and effects. In `message`, camera and material
// files must be inlined (InlineInspectionFiles); inspection->rig must be set.
absl::Status ParseImaging(const v1::Inspection& message, const std::string& context,
                          Inspection* inspection);

}  // namespace sightline
