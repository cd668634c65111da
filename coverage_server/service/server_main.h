// SPDX-License-Identifier: Apache-2.0
// Command line, signals and life of a coverage server process.
#pragma once

#include <string>

#include "coverage_server/service/coverage_backend.h"

namespace sightline {

// Runs `coverage_server --listen unix:PATH | HOST:PORT [options]`. Prints one line "listening on
// ADDRESS" to stdout when it serves; logs to stderr. SIGTERM and SIGINT drain the server; a second
// signal ends it at once. `version`: text of --version. Returns the exit code: 0 ended as asked,
// 1 the server could not start, 2 wrong arguments.
int CoverageServerMain(int argc, char** argv, const CoverageBackend& backend,
                       const std::string& version = "");

}  // namespace sightline
