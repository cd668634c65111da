// What every planning command starts with: the inspection, its part, and a coverage server that
// knows them.
#pragma once

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/part/part_health.h"
#include "planner_client/coverage_client/coverage_client.h"

namespace sightline {

struct SessionOptions {
  std::string inspection_file;
  // Empty: an embedded server is started.
  std::string coverage_server;
  int field_directions = kDefaultFieldDirections;
};

struct PlanningSession {
  Inspection inspection;
  std::shared_ptr<const TriangleMesh> part;
  PartHealth health;
  std::unique_ptr<EmbeddedServer> server;  // null with --coverage-server
  std::unique_ptr<CoverageClient> client;
  double open_time_s = 0;  // from start to the first possible query
};

// Prints the part's health findings and shows progress on stderr.
absl::StatusOr<PlanningSession> OpenSession(const SessionOptions& options);

}  // namespace sightline
