// SPDX-License-Identifier: Apache-2.0
// The inspection in a request: self-contained, with its other files among the request's assets.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "render_worker/effects/effect.h"
#include "render_worker/material/material.h"
#include "render_worker/render/part_frame.h"
#include "render_worker/render/part_scene.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/render_service.pb.h"

namespace sightline {

// INVALID_ARGUMENT names the field: a sensor or materials given as files (a request must never make
// the server read its own files) or missing, no lens, and errors of ParseInspection. `field`: path
// of the inspection in the request.
absl::StatusOr<Inspection> ParsePartInspection(const v1::Inspection& message,
                                               const std::string& field);

// Effects of the inspection in the order in which they act. INVALID_ARGUMENT as MakeActiveEffect.
absl::StatusOr<std::vector<ActiveEffect>> MakeEffects(const std::vector<EffectChoice>& choices);

// Frames of a request, 1 to 100 000. INVALID_ARGUMENT names the frame and the field: a measurement
// outside Table 2.1, a stage position more than 100 m away, a camera nearer than the lens can
// focus, a setting out of range. `field`: path of the list.
absl::StatusOr<std::vector<PartFrameRequest>> ParsePartFrames(
    const google::protobuf::RepeatedPtrField<v1::PartFrame>& frames, const Inspection& inspection,
    const std::string& field);

// Loads part, obstacles and materials. `part_digest`: filled in unless null. Errors of
// LoadMeshAsset and PartScene::Make.
absl::StatusOr<std::unique_ptr<PartScene>> LoadPartScene(const Inspection& inspection,
                                                         const AssetResolver& assets,
                                                         std::string* part_digest);

// Names of the required files as in the request: part, obstacles, tables and height fields of
// materials. Sorted, without duplicates.
std::vector<std::string> AssetFiles(const Inspection& inspection);

// Loads the mesh of an asset; its extension determines the format. Errors of `assets` and
// LoadPartFromMemory.
absl::StatusOr<TriangleMesh> LoadMeshAsset(const std::string& file, const std::string& unit,
                                           const AssetResolver& assets);
absl::StatusOr<std::vector<TriangleMesh>> LoadObstacles(const Inspection& inspection,
                                                        const AssetResolver& assets);

}  // namespace sightline
