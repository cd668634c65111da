// SPDX-License-Identifier: Apache-2.0
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/file/atomic_write.h"
#include "core/process/run_program.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "planning_service/execution/engine/batch_scheduler.h"
#include "planning_service/job_store/random_number.h"

namespace sightline {
namespace {

using nlohmann::json;
using State = ElementStatus::State;

constexpr char kJobLabel[] = "sightline/job";
constexpr char kIndexAnnotation[] = "batch.kubernetes.io/job-completion-index";
// Time for which a machine may be unreachable before its pods count as lost.
constexpr int kUnreachable_s = 30;
// Kubernetes removes finished jobs after this time if the service has not removed them.
constexpr int kKeepFinished_s = 24 * 3600;

// True for errors that say nothing about the job, so that a later call may succeed.
bool IsTransientKubernetesError(const std::string& errors) {
  const std::string lower = absl::AsciiStrToLower(errors);
  for (const char* words :
       {"unable to connect", "connection refused", "did you specify the right host", "timeout",
        "timed out", "serviceunavailable", "unable to handle the request", "too many requests",
        "etcdserver", "exceeded quota", "internalerror", ": eof", "connection reset"}) {
    if (absl::StrContains(lower, words)) return true;
  }
  return false;
}

std::string ResourceText(const json& object, const char* field) {
  if (!object.is_object()) return "";
  const auto found = object.find(field);
  return found != object.end() && found->is_string() ? found->get<std::string>() : "";
}

const json& Member(const json& object, const char* field) {
  static const json none;
  if (!object.is_object()) return none;
  const auto found = object.find(field);
  return found == object.end() ? none : *found;
}

std::string TerminationReason(const json& pod) {
  for (const json& container : Member(Member(pod, "status"), "containerStatuses")) {
    const json& state = Member(container, "state");
    if (std::string reason = ResourceText(Member(state, "terminated"), "reason"); !reason.empty()) {
      return reason;
    }
    if (std::string reason = ResourceText(Member(state, "waiting"), "reason"); !reason.empty()) {
      return reason;
    }
  }
  return "";
}

ElementStatus StatusOfPod(const json& pod) {
  const json& status = Member(pod, "status");
  const std::string phase = ResourceText(status, "phase");
  std::string reason = ResourceText(status, "reason");
  if (reason.empty()) reason = TerminationReason(pod);
  for (const json& condition : Member(status, "conditions")) {
    if (reason.empty() && ResourceText(condition, "type") == "PodScheduled" &&
        ResourceText(condition, "status") == "False") {
      reason = ResourceText(condition, "message");
    }
  }
  if (reason.empty()) reason = phase;
  if (phase == "Succeeded") return {State::kEnded, reason};
  if (phase == "Failed") {
    if (reason == "OOMKilled") return {State::kOutOfMemory, reason};
    if (reason == "DeadlineExceeded") return {State::kOutOfTime, reason};
    // The reasons Error and Completed belong to containers that ended by themselves.
    const bool by_itself = reason == "Error" || reason == "Completed";
    return {by_itself ? State::kEnded : State::kLost, reason};
  }
  // The pod was evicted, or its machine is unreachable: it will not come back.
  if (Member(pod, "metadata").contains("deletionTimestamp")) {
    return {State::kLost, reason == "Running" ? "its node is gone" : reason};
  }
  if (phase == "Pending") return {State::kWaiting, reason};
  return {State::kRunning, reason};
}

// If several pods have the same index, the one of the largest weight counts.
int Weight(State state) {
  switch (state) {
    case State::kEnded:
      return 3;
    case State::kRunning:
      return 2;
    case State::kWaiting:
      return 1;
    default:
      return 0;
  }
}

class KubernetesScheduler final : public BatchScheduler {
 public:
  explicit KubernetesScheduler(KubernetesOptions options) : options_(std::move(options)) {}

  std::string kind() const override { return "kubernetes"; }

  absl::Status Check() override { return Run({"version", "--client"}).status(); }

  absl::StatusOr<std::string> Submit(const TaskArray& array) override {
    const std::string id = absl::StrFormat("%s-%08x", array.job, RandomBits() & 0xffffffffu);
    // The request is kept beside the scripts, for analysis.
    const std::string file = absl::StrCat(array.script, ".json");
    SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(file, Manifest(array, id).dump(2) + "\n"));
    SIGHTLINE_RETURN_IF_ERROR(Run({"create", "--filename=" + file}).status());
    return id;
  }

  absl::Status Release(const std::string& id) override {
    return Run({"patch", "job", id, "--type=merge", R"(--patch={"spec":{"suspend":false}})"})
        .status();
  }

  absl::StatusOr<std::vector<std::optional<ElementStatus>>> Look(const std::string& id,
                                                                 int size) override {
    SIGHTLINE_ASSIGN_OR_RETURN(
        auto answer, Run({"get", "jobs,pods", absl::StrCat("--selector=sightline/array=", id),
                          "--output=json"}));
    const json list = json::parse(answer, nullptr, /*allow_exceptions=*/false);
    if (!Member(list, "items").is_array()) {
      return absl::UnavailableError("kubectl get: the answer is no list");
    }
    std::vector<std::optional<ElementStatus>> statuses(static_cast<size_t>(size));
    bool failed = false;
    bool there = false;
    for (const json& item : list["items"]) {
      if (ResourceText(item, "kind") == "Job") {
        there = true;
        failed = failed || HasFailed(item);
      } else if (ResourceText(item, "kind") == "Pod") {
        const std::string text =
            ResourceText(Member(Member(item, "metadata"), "annotations"), kIndexAnnotation);
        const auto index = ParseWhole(text);
        if (!index.ok() || *index < 0 || *index >= size) continue;
        const ElementStatus status = StatusOfPod(item);
        auto& known = statuses[static_cast<size_t>(*index)];
        if (!known || Weight(status.state) >= Weight(known->state)) known = status;
      }
    }
    for (auto& status : statuses) {
      // The pod does not exist yet, or was removed with its machine.
      if (!status && there) {
        status = failed ? ElementStatus{State::kLost, "its pod is gone"}
                        : ElementStatus{State::kWaiting, ""};
      }
    }
    return statuses;
  }

  absl::Status Cancel(const std::string& id) override {
    return Delete(absl::StrCat("--selector=sightline/array=", id));
  }

  absl::Status CancelJob(const std::string& job) override {
    return Delete(absl::StrCat("--selector=", kJobLabel, "=", job));
  }

 private:
  static bool HasFailed(const json& job) {
    for (const json& condition : Member(Member(job, "status"), "conditions")) {
      if (ResourceText(condition, "type") == "Failed" &&
          ResourceText(condition, "status") == "True") {
        return true;
      }
    }
    return false;
  }

  absl::Status Delete(const std::string& selector) const {
    return Run({"delete", "jobs", selector, "--ignore-not-found", "--wait=false",
                "--cascade=background"})
        .status();
  }

  json Manifest(const TaskArray& array, const std::string& id) const {
    const json labels = {{"app.kubernetes.io/name", "sightline"},
                         {"app.kubernetes.io/component", "job"},
                         {kJobLabel, array.job},
                         {"sightline/array", id}};
    json resources = json::object();
    if (options_.cpus > 0) {
      resources["requests"]["cpu"] = absl::StrCat(options_.cpus);
    }
    if (array.max_memory_bytes > 0) {
      resources["requests"]["memory"] = absl::StrCat(array.max_memory_bytes);
      resources["limits"]["memory"] = absl::StrCat(array.max_memory_bytes);
    }
    const json container = {
        {"name", "sightline"},
        {"image", options_.image},
        {"command",
         {"/bin/sh", "-c",
          absl::StrCat("exec /bin/sh \"", array.script, "-$((JOB_COMPLETION_INDEX + 1)).sh\"")}},
        {"workingDir", array.folder},
        {"resources", resources},
        {"volumeMounts",
         {{{"name", "data"}, {"mountPath", options_.mount_path}},
          {{"name", "tmp"}, {"mountPath", "/tmp"}}}},
        {"securityContext",
         {{"allowPrivilegeEscalation", false},
          {"readOnlyRootFilesystem", true},
          {"capabilities", {{"drop", json::array({"ALL"})}}}}}};
    json tolerations = json::array();
    for (const char* taint : {"node.kubernetes.io/not-ready", "node.kubernetes.io/unreachable"}) {
      tolerations.push_back({{"key", taint},
                             {"operator", "Exists"},
                             {"effect", "NoExecute"},
                             {"tolerationSeconds", kUnreachable_s}});
    }
    // Files that pods make belong to the user of the service.
    json security = {{"runAsUser", getuid()}, {"runAsGroup", getgid()}};
    if (getuid() != 0) security["runAsNonRoot"] = true;
    security["seccompProfile"]["type"] = "RuntimeDefault";
    json pod = {
        {"restartPolicy", "Never"},
        {"automountServiceAccountToken", false},
        {"enableServiceLinks", false},
        {"securityContext", security},
        {"tolerations", tolerations},
        {"containers", json::array({container})},
        {"volumes",
         {{{"name", "data"}, {"persistentVolumeClaim", {{"claimName", options_.volume_claim}}}},
          {{"name", "tmp"}, {"emptyDir", json::object()}}}}};
    if (array.max_time != absl::InfiniteDuration()) {
      const auto seconds = static_cast<int64_t>(std::ceil(absl::ToDoubleSeconds(array.max_time)));
      pod["activeDeadlineSeconds"] = std::max<int64_t>(seconds, 1);
    }
    return {{"apiVersion", "batch/v1"},
            {"kind", "Job"},
            {"metadata", {{"name", id}, {"namespace", options_.name_space}, {"labels", labels}}},
            {"spec",
             {{"completions", array.size},
              {"parallelism", array.size},
              {"completionMode", "Indexed"},
              // No retries by Kubernetes: the service itself restarts lost commands.
              {"backoffLimit", 0},
              {"suspend", !array.after.empty()},
              {"ttlSecondsAfterFinished", kKeepFinished_s},
              {"template", {{"metadata", {{"labels", labels}}}, {"spec", pod}}}}}};
  }

  absl::StatusOr<std::string> Run(const std::vector<std::string>& arguments) const {
    std::vector<std::string> words = {options_.command_folder.empty()
                                          ? "kubectl"
                                          : absl::StrCat(options_.command_folder, "/kubectl"),
                                      absl::StrCat("--namespace=", options_.name_space)};
    words.insert(words.end(), arguments.begin(), arguments.end());
    auto result = RunProgram({.words = std::move(words), .in_path = true},
                             {.time_limit = kSchedulerToolTimeout});
    if (!result.ok()) return absl::UnavailableError(result.status().message());
    if (result->wait_status == 0) return std::move(result->output);
    absl::StripTrailingAsciiWhitespace(&result->errors);
    const std::string message = absl::StrCat("kubectl ", arguments[0], ": ", result->errors);
    return IsTransientKubernetesError(message) ? absl::UnavailableError(message)
                                               : absl::FailedPreconditionError(message);
  }

  const KubernetesOptions options_;
};

}  // namespace

std::unique_ptr<BatchScheduler> MakeKubernetesScheduler(KubernetesOptions options) {
  return std::make_unique<KubernetesScheduler>(std::move(options));
}

}  // namespace sightline
