// SPDX-License-Identifier: Apache-2.0
// Makes the surface of a part from the triangles of its file. This is rule 2 of
// core/part/part_digest.h.
//
// Only faces with area are surface. A face has no area if its height over its longest side is at
// most a millionth of that side or 2^-20 of the part's largest coordinate (at most 4 um): rounding
// determines its normal. Size, hull, resting faces, weld tolerance and digest of the mesh do not
// depend on such faces, nor on vertices that no face uses.
//
// Corners that coincide within 2^-22 of the largest coordinate of faces with area (at most 1 um)
// are welded: exporters write the same corner once as 0 and once as 1e-9.
//
// Tessellators close T-junctions with triangles without area. Such a triangle stays if it lies on
// an edge that would be open without it, and between corners of faces with area.
#pragma once

#include <string_view>

#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "core/part/mesh_readers.h"
#include "core/status/stop_check.h"

namespace sightline {

// The mesh may be off by this much, in metres: by rounding to 32-bit coordinates, by welding.
inline constexpr double kLargestMeshError_m = 1e-6;

// `metres_per_unit`: unit of the coordinates in `raw`. `unit_advice`: remedy for a part of
// implausible size ("state the unit of the file"). The result is unchanged if it is written with
// all its digits, read and normalised again, so that both ends of an upload compute the same
// digest. INVALID_ARGUMENT states the reason: no face with area, a coordinate that
// is not finite, an implausible size, or a part so far from the origin of its file that 32-bit
// coordinates would be off by more than kLargestMeshError_m.
absl::StatusOr<TriangleMesh> NormaliseMesh(const RawMesh& raw, double metres_per_unit,
                                           std::string_view unit_advice, const StopCheck& stop);

}  // namespace sightline
