// SPDX-License-Identifier: Apache-2.0
// Small meshes with known area, volume and topology, and where shared test data lies.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/part/mesh.h"

namespace sightline {

// Axis-parallel box with outward normals, 12 triangles, welded.
TriangleMesh BoxMesh(const Eigen::Vector3f& min_m, const Eigen::Vector3f& max_m);

// Triangles point the other way.
TriangleMesh Flipped(TriangleMesh mesh);

// Both meshes in one, not welded to each other.
TriangleMesh Merged(const TriangleMesh& a, const TriangleMesh& b);

// Rectangle in the xy plane, normal +z, from the origin, in columns x rows cells of two triangles.
TriangleMesh PlateMesh(double width_m, double height_m, int columns, int rows);

// Sphere about the origin: an icosahedron divided `levels` times (20 * 4^levels triangles).
TriangleMesh SphereMesh(double radius_m, int levels);

// Folder of shared real data; nothing if it is not there.
std::optional<std::filesystem::path> SharedData();

}  // namespace sightline
