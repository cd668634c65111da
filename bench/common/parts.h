// SPDX-License-Identifier: Apache-2.0
// The parts that benchmarks run on.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "core/part/mesh.h"
#include "coverage_server/scene/coverage_scene.h"

namespace sightline::bench {

// "head": examples/cylinder_head; "bracket-262", "bracket-320", "inline4-head": shared data, in
// SIGHTLINE_SHARED_DIR or ../shared next to the source folder (SIGHTLINE_SOURCE_DIR, default: the
// working directory).
const std::vector<std::string>& PartNames();

// The inline-4 head, 137 mm long, is scaled to 450 mm. Prints "NAME: skipped: no shared data" and
// returns null if the data is missing; ends the process for an unknown name or a broken file.
std::unique_ptr<TriangleMesh> LoadBenchPart(const std::string& name);

// Target spacing that gives about `targets` targets on the mesh.
double SpacingForTargets(const TriangleMesh& mesh, double targets);

// A scene with the default rig. Ends the process on errors.
std::unique_ptr<CoverageScene> BuildScene(const TriangleMesh& mesh, double spacing_m);

}  // namespace sightline::bench
