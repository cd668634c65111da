// SPDX-License-Identifier: Apache-2.0
// `sightline diagnose` for flat-field and dark frames: values of the camera, and effects outside
// the linear model of EMVA 1288.
#pragma once

#include <string>

#include "absl/status/statusor.h"
#include "planner_client/commands/worker_session.h"

namespace sightline {

struct SensorSetOptions {
  std::string input;  // the set's folder or its data file
  std::string out;    // empty: diagnosis/ in the set's folder
  WorkerSessionOptions worker;
};

// Runs the diagnosis, prints the finding and writes diagnosis.json, camera.json and report.html.
// Returns the exit code. Errors of reading the set, of the worker and of writing; without a
// diagnosis no file is written.
absl::StatusOr<int> RunSensorSetDiagnosis(SensorSetOptions options);

}  // namespace sightline
