// An inspection as a request brings it: self-contained, its other files among the request's assets.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "render_worker/material/material.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// INVALID_ARGUMENT names the field: sensor or materials that are files (a request must never make
// the server read files of its own) or missing, no lens, and what ParseInspection says. `field`: of
// the inspection in the request.
absl::StatusOr<Inspection> ParsePartInspection(const v1::Inspection& message,
                                               const std::string& field);

// Names of the files it takes, as they stand in the request: part, obstacles, tables and height
// fields of materials. Sorted, each once.
std::vector<std::string> AssetFiles(const Inspection& inspection);

// The mesh of an asset; its extension tells the format. Errors of `assets` and LoadPartFromMemory.
absl::StatusOr<TriangleMesh> LoadMeshAsset(const std::string& file, const std::string& unit,
                                           const AssetResolver& assets);
absl::StatusOr<std::vector<TriangleMesh>> LoadObstacles(const Inspection& inspection,
                                                        const AssetResolver& assets);

}  // namespace sightline
