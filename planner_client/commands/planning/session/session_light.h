// SPDX-License-Identifier: Apache-2.0
// Limits on targets by the light of the part's materials, for a planning session.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "planner_client/command_line/process/progress_line.h"
#include "planner_client/commands/worker_session.h"
#include "sightline/v1/detectability.pb.h"

namespace sightline {

struct SessionLight {
  v1::Detectability detectability;   // with table and both exposure times
  std::vector<std::string> remarks;  // on assumptions, without a final full stop
};

// Nothing if light limits no targets of the inspection. A table in the inspection is used as it is;
// otherwise the render worker computes one, unless the user's cache has it. Surfaces without a
// material count as matt aluminium. Prints on stderr what limits exposures. INVALID_ARGUMENT if a
// table has a material that the part does not have, or if no exposure is permitted. Errors of the
// worker; NOT_FOUND if its program is missing.
absl::StatusOr<std::optional<SessionLight>> LightOfSession(const std::string& inspection_file,
                                                           const Inspection& inspection,
                                                           const TriangleMesh& part,
                                                           const WorkerSessionOptions& worker,
                                                           const ProgressPhase& phase);

}  // namespace sightline
