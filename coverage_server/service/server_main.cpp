// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/service/server_main.h"

#include "core/status/status_macros.h"
#include "coverage_server/service/coverage_server.h"
#include "rpc_server/server_main.h"

namespace sightline {

int CoverageServerMain(int argc, char** argv, const CoverageBackend& backend,
                       const std::string& version) {
  CoverageServerOptions options;
  ServerProgram program;
  program.name = "coverage_server";
  program.version = version;
  program.description = "Coverage of parts by linear laser scans, served by gRPC.";
  program.add_options = [&options](CLI::App& app) {
    app.add_option("--threads", options.threads, "Queries at a time; 0: one per core")
        ->check(CLI::Range(0, 1024));
    app.add_option("--scene-workers", options.scene_workers, "Scenes built at a time")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    AddBytesOption(app, "--max-part-bytes", &options.max_part_file_bytes, "Largest part file");
    AddBytesOption(app, "--max-part-store-bytes", &options.max_part_store_bytes,
                   "Memory for parts; the longest unused go first");
    AddBytesOption(app, "--max-scene-bytes", &options.max_scene_bytes,
                   "Memory for scenes; the longest unused go first");
  };
  program.start = [&]() -> absl::StatusOr<std::unique_ptr<RunningServer>> {
    SIGHTLINE_ASSIGN_OR_RETURN(auto server, CoverageServer::Start(options, backend));
    return std::unique_ptr<RunningServer>(std::move(server));
  };
  return ServerMain(argc, argv, program, &options);
}

}  // namespace sightline
