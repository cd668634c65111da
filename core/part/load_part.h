// SPDX-License-Identifier: Apache-2.0
// Part files.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/part/mesh.h"
#include "core/status/stop_check.h"

namespace sightline {

// Advice about the length unit of a part of implausible size, where LoadPart is given it.
inline constexpr std::string_view kStateUnitAdvice = "state the unit of the file";

// Extensions of the files that LoadPart reads, in lower case without the dot; and of those that can
// come from memory, because they need no other files.
std::vector<std::string> PartFormats();
std::vector<std::string> PartFormatsInMemory();

// `unit`: "m", "cm", "mm", "um", "inch"; empty means metres for glTF and is an error for formats
// without units. Axes are not swapped; glTF node transforms are applied, and all meshes of the
// default scene are merged. The mesh has only faces with area, with coinciding corners welded, by
// the rule of core/part/surface/normalise.h. Files are read to their end: bytes that belong to
// nothing are an error. INVALID_ARGUMENT names file and reason: truncated, too long, NaN, no
// triangles with area, a feature or extension that is not supported, unknown unit, implausible size
// (largest extent below 1 mm or above 10 m: "looks like millimetres read as metres"), a part so far
// from the origin of its file (16 m) that 32-bit coordinates would be off by more than 1 um, not a
// regular file (a pipe), a buffer of a glTF file outside its folder, faces that take too long to
// cut into triangles, more JSON in a glTF file than docs/errors-and-limits.md allows. NOT_FOUND: no
// such file. `stop` ends the work early. `unit_advice`: remedy at the end of the message about an
// implausible size, if it is not to state a
// unit.
absl::StatusOr<TriangleMesh> LoadPart(const std::string& path, const std::string& unit,
                                      const StopCheck& stop = {},
                                      std::string_view unit_advice = kStateUnitAdvice);

// Whether the name is that of a STEP file: .step, .stp or .p21, in any case.
bool IsStepFileName(const std::string& file_name);

// Checks only the unit: it must be known, and given for formats without units (by the name's
// extension). The message of INVALID_ARGUMENT starts with "is ...".
absl::Status CheckPartUnit(const std::string& file_name, const std::string& unit);

// The same from memory; `format` is one of PartFormatsInMemory; `name` is for messages.
absl::StatusOr<TriangleMesh> LoadPartFromMemory(const std::string& bytes, const std::string& format,
                                                const std::string& unit, const std::string& name,
                                                const StopCheck& stop = {},
                                                std::string_view unit_advice = kStateUnitAdvice);

// Points as a scanner delivers them.
struct PointCloud {
  std::vector<Eigen::Vector3d> positions_m;
  std::vector<Eigen::Vector3d> normals;  // unit vectors; empty if the file has none
};

// Vertices of a PLY file (ASCII or binary) in metres, with normals if it has nx, ny, nz.
// INVALID_ARGUMENT names the file: damaged, without points, or with coordinates that are not
// finite; then also the index of the first such point (from 0) and their number. NOT_FOUND: no such
// file.
absl::StatusOr<PointCloud> LoadPoints(const std::string& path);

// Binary little-endian PLY of points with normals, metres. For planned point clouds.
absl::Status WritePlyPoints(const std::string& path, const std::vector<Eigen::Vector3f>& points_m,
                            const std::vector<Eigen::Vector3f>& normals);

}  // namespace sightline
