// SPDX-License-Identifier: Apache-2.0
// The light of the part's materials as a limit of targets, for a planning session.
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
  std::vector<std::string> remarks;  // on assumptions, without a full stop
};

// Unset where light limits no targets of the inspection. A table that the inspection has is taken
// as it is; else the render worker computes one, or one that was computed before is read from the
// user's cache. Surfaces without a material are taken as matt aluminium. Says on stderr what limits
// exposures. INVALID_ARGUMENT: a table for a material that the part has not, or no permitted
// exposure; errors of the worker, and NOT_FOUND if its program is not there.
absl::StatusOr<std::optional<SessionLight>> LightOfSession(const std::string& inspection_file,
                                                           const Inspection& inspection,
                                                           const TriangleMesh& part,
                                                           const WorkerSessionOptions& worker,
                                                           const ProgressPhase& phase);

}  // namespace sightline
