// SPDX-License-Identifier: Apache-2.0
// ToleranceReport and faces from and to proto, so that they can be files (core/json).
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/tolerance/face_surface.h"
#include "core/tolerance/tolerance.h"
#include "sightline/v1/tolerance.pb.h"

namespace sightline {

v1::ToleranceReport ToleranceReportToProto(const ToleranceReport& report,
                                           const std::vector<FaceTriangles>& faces);

// INVALID_ARGUMENT names the field, e.g. "read[3].kind", its value and what is allowed: unknown
// kind, empty id or name, width that is negative or not finite, nominal value outside its limits,
// face number < 1.
absl::StatusOr<ToleranceReport> ToleranceReportFromProto(const v1::ToleranceReport& message);

// INVALID_ARGUMENT names the field: counts that are no multiples of three, indices that point
// nowhere, coordinates that are not finite, a face twice.
absl::StatusOr<std::vector<FaceTriangles>> FacesFromProto(const v1::ToleranceReport& message);

}  // namespace sightline
