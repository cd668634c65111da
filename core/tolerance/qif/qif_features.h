// SPDX-License-Identifier: Apache-2.0
// Nominal geometry of the features of a QIF 3.0 document (Features.xsd).
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "core/tolerance/nominal_face.h"
#include "core/tolerance/qif/qif_units.h"
#include "core/tolerance/qif/qif_xml.h"

namespace sightline {

// The face that lies on a surface of the product (Geometry.xsd: Plane23, Cylinder23, Cone23,
// Sphere23 or Torus23), without number and words. None and INVALID_ARGUMENT as below.
absl::StatusOr<std::vector<NominalFace>> FaceOnQifSurface(const QifElement& surface,
                                                          const QifUnits& units);

// The faces of a feature, without numbers and words: one of planes, cylinders, cones, spheres and
// tori and of segments of these, two of opposite parallel planes. None: the feature is of another
// kind (lines, points, slots, ...), an element that its geometry needs is not stated, or its unit
// of length is not known. `definition` is that which the nominal names. INVALID_ARGUMENT without
// file: a value is no number, or a direction is zero; the message begins with the line.
absl::StatusOr<std::vector<NominalFace>> FacesOfQifFeature(const QifElement& nominal,
                                                           const QifElement& definition,
                                                           const QifUnits& units);

}  // namespace sightline
