// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/server_main.h"

#include <sys/stat.h>

#include "absl/time/time.h"
#include "core/status/status_macros.h"
#include "render_worker/diagnosis/diagnose.h"
#include "render_worker/scene_diagnosis/diagnose_scene.h"
#include "render_worker/service/render_server.h"
#include "render_worker/verification/verify.h"
#include "rpc_server/server_main.h"

namespace sightline {

int RenderWorkerMain(int argc, char** argv, const std::string& version) {
  // Parts and images are secrets of their owners.
  umask(S_IRWXG | S_IRWXO);
  RenderServerOptions options;
  double keep_hours = absl::ToDoubleHours(options.keep);
  ServerProgram program;
  program.name = "render_worker";
  program.version = version;
  program.description = "What the camera would record, served by gRPC.";
  program.add_options = [&](CLI::App& app) {
    app.add_option("--threads", options.threads, "Threads of one job; 0: one per core")
        ->check(CLI::Range(0, 1024));
    app.add_option("--render-workers", options.render_workers, "Jobs at a time")
        ->check(CLI::Range(1, 64))
        ->capture_default_str();
    app.add_option("--max-queued-jobs", options.max_queued_jobs,
                   "Jobs that wait or run; more get RESOURCE_EXHAUSTED")
        ->check(CLI::Range(1, 100000))
        ->capture_default_str();
    AddBytesOption(app, "--max-queued-bytes", &options.max_queued_bytes,
                   "Memory for the requests of jobs that wait or run");
    app.add_option("--spool", options.spool_folder,
                   "Folder for assets and images; default: the system's temporary folder");
    app.add_option(
           "--keep-hours", keep_hours,
           "How long uploaded files stay that no request uses, and images of jobs that have "
           "ended")
        ->check(CLI::Range(0.01, 8760.0))
        ->capture_default_str();
    AddBytesOption(app, "--max-asset-bytes", &options.max_asset_bytes, "Largest uploaded file");
    AddBytesOption(app, "--max-asset-store-bytes", &options.max_asset_store_bytes,
                   "Disk space for uploaded files; the longest unused go first");
    AddBytesOption(app, "--max-output-bytes", &options.max_output_bytes,
                   "Disk space for images; the oldest jobs' go first");
    AddBytesOption(app, "--max-image-bytes", &options.max_image_bytes,
                   "Memory for one image; more get RESOURCE_EXHAUSTED");
    AddBytesOption(app, "--max-set-bytes", &options.max_set_bytes,
                   "Memory for the images of all sets of recordings that wait");
  };
  program.start = [&]() -> absl::StatusOr<std::unique_ptr<RunningServer>> {
    options.keep = absl::Hours(keep_hours);
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto server,
        RenderServer::Start(
            options, {.diagnose = Diagnose, .verify = Verify, .diagnose_scene = DiagnoseScene}));
    return std::unique_ptr<RunningServer>(std::move(server));
  };
  return ServerMain(argc, argv, program, &options);
}

}  // namespace sightline
