// SPDX-License-Identifier: Apache-2.0
// The planning service in one process: stores, front ends, execution, events.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "planning_service/events/mqtt_receiver.h"
#include "planning_service/events/webhook_receiver.h"
#include "planning_service/execution/engine/batch_scheduler.h"
#include "rpc_server/rpc_server.h"

namespace sightline {

struct PlanningServerOptions {
  RpcServerOptions rpc;
  // Folder of jobs, artefacts and working folders of running jobs; made if it does not exist.
  std::string data_folder;
  // libpq connection text of a database that several servers share; they share the data folder too.
  // Empty: SQLite in the data folder, which then belongs to this server alone.
  std::string database;
  std::string http_listen;              // HOST:PORT; empty: no HTTP
  std::vector<std::string> http_hosts;  // names of this server in requests
  std::string clients_file;             // empty: all rights for everybody
  std::string program;                  // path of `sightline`
  int workers = 1;                      // jobs at a time; 0: other servers of the database run them
  std::string runner = "local";         // runner of jobs: "local", "slurm", "kubernetes"
  int parts = 1;                        // most shards of a job that can be split
  SlurmOptions slurm;
  // If the mount path is empty, that of the data folder counts.
  KubernetesOptions kubernetes;
  int64_t max_job_memory_bytes = 0;  // 0: no limit
  absl::Duration max_job_time = absl::InfiniteDuration();
  absl::Duration keep_finished = absl::Hours(24 * 30);
  int64_t min_free_bytes = int64_t{1} << 30;
  int64_t max_request_bytes = int64_t{4} << 30;
  std::vector<MqttOptions> mqtt;
  std::vector<WebhookOptions> webhooks;
};

class PlanningServer : public RunningServer {
 public:
  // "http://HOST:PORT" or "https://..." of the HTTP front end; empty: none.
  virtual std::string http_url() const = 0;
};

// INVALID_ARGUMENT for an option that cannot be used; FAILED_PRECONDITION: another server has the
// data folder, or it is of a newer version; UNAVAILABLE: an address is taken, or the database does
// not answer.
absl::StatusOr<std::unique_ptr<PlanningServer>> StartPlanningServer(
    const PlanningServerOptions& options);

// `sightline serve [options]`: argv[0] is the program, options follow. Returns the exit code.
int PlanningServerMain(int argc, char** argv);

}  // namespace sightline
