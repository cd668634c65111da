// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <optional>

#include "core/process/out_of_memory.h"
#include "core/version/version.h"
#include "coverage_server/occlusion/occluder_mesh.h"
#include "coverage_server/scene/coverage_scene.h"
#include "coverage_server/scene/hull_corners.h"
#include "coverage_server/service/server_main.h"
#include "coverage_server/view/render_view.h"
#include "coverage_server/visibility/field_worker.h"
#include "coverage_server/worker_process/worker_task.h"

int main(int argc, char** argv) {
  // Must come first: this process may have been started as a worker of a server.
  if (const std::optional<int> code = sightline::MaybeRunFieldWorker(argc, argv)) return *code;
  const std::array tasks = {sightline::OccluderMeshTask(), sightline::HullCornersTask()};
  if (const std::optional<int> code = sightline::MaybeRunWorkerTask(argc, argv, tasks)) {
    return *code;
  }
  sightline::ReportOutOfMemory("coverage_server");
  return sightline::CoverageServerMain(argc, argv,
                                       {sightline::CoverageScene::Build, sightline::RenderView},
                                       sightline::VersionText("coverage_server"));
}
