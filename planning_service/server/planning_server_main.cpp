// SPDX-License-Identifier: Apache-2.0
#include <malloc.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

#include "absl/strings/str_cat.h"
#include "core/command_options/option_values.h"
#include "core/process/program_path.h"
#include "core/status/status_macros.h"
#include "planning_service/server/planning_server.h"
#include "rpc_server/server_main.h"

namespace sightline {
namespace {

struct EventFlags {
  std::vector<std::string> mqtt, webhooks;
  std::string mqtt_prefix = "sightline";
  std::string mqtt_credentials, mqtt_ca, mqtt_certificate, mqtt_key;
  std::string webhook_secret, webhook_ca;
};

void AddEventOptions(CLI::App& app, EventFlags* flags) {
  app.add_option("--mqtt", flags->mqtt,
                 "Broker to publish job events to: ssl://HOST:PORT, or tcp:// on this machine; may "
                 "be repeated");
  app.add_option("--mqtt-prefix", flags->mqtt_prefix, "First part of the topics")
      ->capture_default_str();
  app.add_option("--mqtt-credentials", flags->mqtt_credentials,
                 "File of two lines, user and password");
  app.add_option("--mqtt-ca", flags->mqtt_ca, "PEM file of the broker's authorities");
  app.add_option("--mqtt-cert", flags->mqtt_certificate, "PEM, our certificate for the broker");
  app.add_option("--mqtt-key", flags->mqtt_key, "PEM, its key");
  app.add_option(
      "--webhook", flags->webhooks,
      "URL to post job events to: https://, or http:// on this machine; may be repeated");
  app.add_option("--webhook-secret", flags->webhook_secret,
                 "File of the secret that signs them (HMAC-SHA256)");
  app.add_option("--webhook-ca", flags->webhook_ca, "PEM file of the receiver's authorities");
  NeedOption(app, {"--mqtt-prefix", "--mqtt-credentials", "--mqtt-ca", "--mqtt-cert", "--mqtt-key"},
             "--mqtt");
  NeedOption(app, {"--webhook-secret", "--webhook-ca"}, "--webhook");
}

void AddRunnerOptions(CLI::App& app, PlanningServerOptions* options, int* cpus) {
  app.add_option(
         "--runner", options->runner,
         "Where jobs run: local, or on a cluster that sees --data under the same path: slurm "
         "or kubernetes")
      ->check(CLI::IsMember({"local", "slurm", "kubernetes"}))
      ->capture_default_str();
  app.add_option(
         "--parts", options->parts,
         "Number of shards, run at the same time, into which renderings of several images are "
         "split")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app.add_option("--cpus", *cpus,
                 "Processors that every command requests from the cluster; default: the cluster's")
      ->check(CLI::Range(1, 4096));
  app.add_option("--slurm-partition", options->slurm.partition, "Partition; default: Slurm's");
  app.add_option("--slurm-account", options->slurm.account, "Account; default: the user's");
  app.add_option("--kubernetes-namespace", options->kubernetes.name_space, "Namespace of the jobs")
      ->capture_default_str();
  app.add_option("--kubernetes-image", options->kubernetes.image,
                 "Container image with the programs where this server has them");
  app.add_option("--kubernetes-volume-claim", options->kubernetes.volume_claim,
                 "Claim of the volume that has --data");
  app.add_option("--kubernetes-mount-path", options->kubernetes.mount_path,
                 "Where the volume is mounted, as for this server; default: --data");
  NeedOption(app,
             {"--cpus", "--slurm-partition", "--slurm-account", "--kubernetes-namespace",
              "--kubernetes-image", "--kubernetes-volume-claim", "--kubernetes-mount-path"},
             "--runner");
}

// Options of a cluster other than that of --runner have no effect.
absl::Status CheckRunnerOptions(const PlanningServerOptions& options, int cpus) {
  const SlurmOptions& slurm = options.slurm;
  const KubernetesOptions& kubernetes = options.kubernetes;
  const std::string& runner = options.runner;
  const auto wrong = [&](const char* names) {
    return absl::InvalidArgumentError(absl::StrCat(names, " has no effect with --runner ", runner));
  };
  if (runner == "local" && cpus > 0) return wrong("--cpus");
  if (runner != "slurm" && !(slurm.partition.empty() && slurm.account.empty())) {
    return wrong("--slurm-partition or --slurm-account");
  }
  if (runner != "kubernetes" && !(kubernetes.image.empty() && kubernetes.volume_claim.empty() &&
                                  kubernetes.mount_path.empty())) {
    return wrong("--kubernetes-image, --kubernetes-volume-claim or --kubernetes-mount-path");
  }
  return absl::OkStatus();
}

void FillEventOptions(const EventFlags& flags, bool allow_plaintext,
                      PlanningServerOptions* options) {
  for (const std::string& url : flags.mqtt) {
    MqttOptions mqtt;
    mqtt.url = url;
    mqtt.topic_prefix = flags.mqtt_prefix;
    mqtt.credentials_file = flags.mqtt_credentials;
    mqtt.ca_file = flags.mqtt_ca;
    mqtt.certificate_file = flags.mqtt_certificate;
    mqtt.key_file = flags.mqtt_key;
    mqtt.allow_plaintext = allow_plaintext;
    options->mqtt.push_back(mqtt);
  }
  for (const std::string& url : flags.webhooks) {
    WebhookOptions webhook;
    webhook.url = url;
    webhook.secret_file = flags.webhook_secret;
    webhook.ca_file = flags.webhook_ca;
    webhook.allow_plaintext = allow_plaintext;
    options->webhooks.push_back(webhook);
  }
}

}  // namespace

int PlanningServerMain(int argc, char** argv) {
  // Parts, tasks and results are their clients' secrets: nothing is readable by other users.
  umask(S_IRWXG | S_IRWXO);
  // Every thread may get an arena, which keeps memory that large bodies have freed. So there are
  // two arenas, and blocks from 1 MiB on return to the system at once (mallopt(3)).
  mallopt(M_ARENA_MAX, 2);
  mallopt(M_MMAP_THRESHOLD, 1 << 20);
  PlanningServerOptions options;
  EventFlags events;
  double max_job_time_s = 0;
  double retention_days = 30;
  int cpus = 0;
  ServerProgram program;
  program.name = "sightline serve";
  program.description =
      "Planning jobs for remote clients: gRPC, HTTP and a web page; jobs outlive the server.";
  program.add_options = [&](CLI::App& app) {
    app.add_option("--data", options.data_folder, "Folder of jobs and their files")->required();
    app.add_option("--http", options.http_listen,
                   "HOST:PORT of HTTP/JSON and the web page; default: none");
    app.add_option("--http-host", options.http_hosts,
                   "Name of this server in requests of browsers; may be repeated");
    app.add_option("--database", options.database,
                   "PostgreSQL that several servers share, e.g. \"host=db dbname=sightline\"; "
                   "default: SQLite in --data");
    app.add_option("--clients", options.clients_file,
                   "JSON file of clients and their rights; default: all rights for everybody");
    app.add_option("--workers", options.workers,
                   "Jobs at a time; 0: none, other servers of the same database run them")
        ->check(CLI::Range(0, 256))
        ->capture_default_str();
    AddBytesOption(app, "--max-job-memory", &options.max_job_memory_bytes,
                   "Memory of one job with all its processes, e.g. 16GB; default: no limit");
    app.add_option("--max-job-time-s", max_job_time_s, "Longest time of one job; 0: no limit")
        ->check(CLI::Range(0.0, 1e7));
    app.add_option("--retention-days", retention_days,
                   "How long finished jobs are kept, in days that the service was running")
        ->check(CLI::Range(0.0, 36500.0))
        ->capture_default_str();
    NeedOption(app, {"--http-host"}, "--http");
    AddBytesOption(app, "--min-free", &options.min_free_bytes,
                   "Free space of the disk below which nothing is accepted or started");
    AddBytesOption(app, "--max-request-bytes", &options.max_request_bytes,
                   "Largest body of an HTTP request");
    AddRunnerOptions(app, &options, &cpus);
    AddEventOptions(app, &events);
  };
  // The processes of the jobs have to be ended too.
  program.stop_within = absl::Seconds(8);
  program.start = [&]() -> absl::StatusOr<std::unique_ptr<RunningServer>> {
    // Jobs are commands of the program `sightline`, also if another program serves.
    options.program = FindProgram("sightline").string();
    if (access(options.program.c_str(), X_OK) != 0) {
      return absl::NotFoundError(
          absl::StrCat("jobs are carried out by the program sightline, and "
                       "there is no executable ",
                       options.program));
    }
    SIGHTLINE_RETURN_IF_ERROR(CheckRunnerOptions(options, cpus));
    if (max_job_time_s > 0) options.max_job_time = absl::Seconds(max_job_time_s);
    options.slurm.cpus = options.kubernetes.cpus = cpus;
    options.keep_finished = absl::Hours(24 * retention_days);
    FillEventOptions(events, options.rpc.allow_plaintext, &options);
    SIGHTLINE_ASSIGN_OR_RETURN(auto server, StartPlanningServer(options));
    // Printed before the line "listening on ADDRESS".
    if (const std::string url = server->http_url(); !url.empty()) {
      std::printf("%s\n", url.c_str());
    }
    return server;
  };
  return ServerMain(argc, argv, program, &options.rpc);
}

}  // namespace sightline
