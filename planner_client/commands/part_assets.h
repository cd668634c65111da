// SPDX-License-Identifier: Apache-2.0
// Reads the files that an inspection needs, to send them to a render worker.
#pragma once

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "planner_client/rpc_client/worker_call.h"
#include "sightline/v1/inspection.pb.h"

namespace sightline {

// Reads a file of any type. NOT_FOUND names it.
absl::StatusOr<std::string> ReadFile(const std::string& path);

// An inspection file with camera and materials inline, checked for the inputs of images.
struct ImagingInspection {
  v1::Inspection message;
  Inspection inspection;
};
// `message`: as it was read from `path`. INVALID_ARGUMENT: errors of ParseInspection; no sensor,
// lens or materials.
absl::StatusOr<ImagingInspection> CheckImagingInspection(const v1::Inspection& message,
                                                         const std::string& path);

// Reads part, obstacles and material files into `assets` and replaces their names in `inspection`
// by the names in the request. Sensor and materials are inline; fields for planning only are
// cleared. Errors name the file; `context`: source of the inspection.
absl::Status TakeAssets(const std::string& context, v1::Inspection* inspection,
                        std::vector<AssetFile>* assets);

// Reads the files of inline materials into `assets` and replaces their names by those in the
// request.
absl::Status TakeMaterialAssets(
    const std::string& context,
    google::protobuf::RepeatedPtrField<v1::MaterialAssignment>* materials,
    std::vector<AssetFile>* assets);

}  // namespace sightline
