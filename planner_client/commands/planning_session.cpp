#include "planner_client/commands/planning_session.h"

#include <chrono>
#include <cstdio>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "planner_client/commands/interrupt.h"
#include "planner_client/commands/progress_line.h"

namespace sightline {

absl::StatusOr<PlanningSession> OpenSession(const SessionOptions& options) {
  const auto start = std::chrono::steady_clock::now();
  PlanningSession session;
  auto inspection = ReadInspection(options.inspection_file);
  if (!inspection.ok()) return inspection.status();
  session.inspection = std::move(*inspection);

  auto part = LoadPart(session.inspection.part_file, session.inspection.part_unit);
  if (!part.ok()) return part.status();
  session.health = CheckPartHealth(*part);
  session.part = std::make_shared<const TriangleMesh>(std::move(*part));
  const Eigen::Vector3d size_mm = 1e3 * session.health.bounding_box_m.sizes();
  std::fprintf(stderr, "part: %s, %.1f x %.1f x %.1f mm, %lld triangles, %.1f cm2\n",
               std::filesystem::path(session.inspection.part_file).filename().c_str(), size_mm.x(),
               size_mm.y(), size_mm.z(), static_cast<long long>(session.health.triangle_count),
               1e4 * session.health.area_m2);
  for (const std::string& finding : session.health.findings) {
    std::fprintf(stderr, "part: %s\n", finding.c_str());
  }

  CoverageTask task;
  task.part = session.part;
  task.part_name = session.inspection.part_file;
  task.rig = session.inspection.rig;
  task.sampling = session.inspection.targets;
  task.field_directions = options.field_directions;
  for (const ObstacleSource& source : session.inspection.obstacles) {
    auto mesh = LoadPart(source.file, source.unit);
    if (!mesh.ok()) return mesh.status();
    task.obstacles.push_back(
        {std::make_shared<const TriangleMesh>(std::move(*mesh)), source.frame, source.name});
  }

  CoverageClientOptions client;
  client.address = options.coverage_server;
  client.interrupted = &InterruptFlag();
  if (options.coverage_server.empty()) {
    auto server = EmbeddedServer::Start({});
    if (!server.ok()) return server.status();
    session.server = std::move(*server);
    client.embedded = session.server.get();
  }
  ProgressLine progress;
  client.on_progress = [&](double fraction, const std::string& message) {
    progress.Show(fraction, message);
  };
  auto opened = CoverageClient::Open(std::move(client), std::move(task));
  if (!opened.ok()) return opened.status();
  session.client = std::move(*opened);
  progress.Finish();
  const SceneInfo& scene = session.client->scene();
  session.open_time_s =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  std::fprintf(
      stderr, "targets: %lld, of which %lld (%.1f %%) can be measured; ready after %.1f s\n",
      static_cast<long long>(scene.target_count), static_cast<long long>(scene.measurable_count),
      100.0 * static_cast<double>(scene.measurable_count) / static_cast<double>(scene.target_count),
      session.open_time_s);
  if (scene.measurable_count == 0) {
    return absl::InvalidArgumentError(
        absl::StrCat(session.inspection.part_file,
                     ": no target on this part can be measured: every one is hidden "
                     "from all pairs of directions 10 to 80 degrees apart"));
  }
  return session;
}

}  // namespace sightline
