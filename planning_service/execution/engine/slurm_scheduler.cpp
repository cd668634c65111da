// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "core/process/run_program.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "planning_service/execution/engine/batch_scheduler.h"

namespace sightline {
namespace {

using State = ElementStatus::State;

// True for errors that say nothing about the job, so that a later call may succeed. Slurm's tools
// exit with 1 for every error, so the text decides.
bool IsTransientSlurmError(const std::string& errors) {
  const std::string lower = absl::AsciiStrToLower(errors);
  for (const char* words :
       {"contact slurm controller", "timed out", "zero bytes", "standby", "connection refused",
        "onnection failure", "temporarily unavailable", "submit limit", "authentication",
        "unexpected message", "slurm_persist_conn", "still initializing"}) {
    if (absl::StrContains(lower, words)) return true;
  }
  return false;
}

// States of squeue(1). An element in an unknown state may still run.
State StateOf(const std::string& name, const std::string& reason) {
  static const std::set<std::string> waiting = {"PENDING",      "CONFIGURING", "REQUEUED",
                                                "REQUEUE_HOLD", "REQUEUE_FED", "RESV_DEL_HOLD",
                                                "SPECIAL_EXIT"};
  static const std::set<std::string> lost = {"NODE_FAIL", "BOOT_FAIL", "PREEMPTED", "REVOKED",
                                             "LAUNCH_FAILED"};
  if (waiting.contains(name)) return State::kWaiting;
  if (lost.contains(name)) return State::kLost;
  if (name == "COMPLETED" || name == "FAILED") return State::kEnded;
  if (name == "OUT_OF_MEMORY") return State::kOutOfMemory;
  if (name == "TIMEOUT" || name == "DEADLINE") return State::kOutOfTime;
  if (name == "CANCELLED") {
    // The array that it waits for failed in Slurm, although its commands had succeeded.
    return absl::StartsWith(reason, "Dependency") ? State::kLost : State::kCancelled;
  }
  return State::kRunning;
}

class SlurmScheduler final : public BatchScheduler {
 public:
  explicit SlurmScheduler(SlurmOptions options) : options_(std::move(options)) {}

  std::string kind() const override { return "slurm"; }

  absl::Status Check() override { return Run("sbatch", {"--version"}).status(); }

  absl::StatusOr<std::string> Submit(const TaskArray& array) override {
    std::vector<std::string> arguments = {
        "--parsable", "--no-requeue", "--export=PATH", "--nodes=1", "--ntasks=1",
        "--output=/dev/null", "--error=/dev/null",
        // Slurm must not requeue: it would restart a command that the service counts as lost.
        absl::StrCat("--job-name=", NameOf(array.job)), absl::StrCat("--array=1-", array.size),
        absl::StrCat("--chdir=", array.folder)};
    if (!options_.partition.empty()) {
      arguments.push_back(absl::StrCat("--partition=", options_.partition));
    }
    if (!options_.account.empty())
      arguments.push_back(absl::StrCat("--account=", options_.account));
    if (options_.cpus > 0) arguments.push_back(absl::StrCat("--cpus-per-task=", options_.cpus));
    if (array.max_memory_bytes > 0) {
      arguments.push_back(absl::StrCat("--mem=", ((array.max_memory_bytes - 1) >> 20) + 1, "M"));
    }
    if (array.max_time != absl::InfiniteDuration()) {
      const auto minutes = static_cast<int64_t>(std::ceil(absl::ToDoubleMinutes(array.max_time)));
      arguments.push_back(absl::StrCat("--time=", std::max<int64_t>(minutes, 1)));
    }
    if (!array.after.empty()) {
      arguments.push_back(absl::StrCat("--dependency=afterok:", array.after));
      arguments.push_back("--kill-on-invalid-dep=yes");
    }
    arguments.push_back(
        absl::StrCat("--wrap=exec /bin/sh \"", array.script, "-$SLURM_ARRAY_TASK_ID.sh\""));
    SIGHTLINE_ASSIGN_OR_RETURN(auto answer, Run("sbatch", arguments));
    // "123" or "123;cluster".
    const std::string id = std::vector<std::string>(absl::StrSplit(answer, ';'))[0];
    const auto number = ParseWhole(std::string(absl::StripAsciiWhitespace(id)));
    if (number.ok() && *number > 0) return absl::StrCat(*number);
    return absl::InternalError(absl::StrCat("sbatch answered \"", answer, "\""));
  }

  absl::Status Release(const std::string&) override { return absl::OkStatus(); }

  absl::StatusOr<std::vector<std::optional<ElementStatus>>> Look(const std::string& id,
                                                                 int size) override {
    std::vector<std::optional<ElementStatus>> statuses(static_cast<size_t>(size));
    auto answer = Run(
        "squeue", {"--jobs=" + id, "--states=all", "--array", "--noheader", "--format=%K|%T|%r"});
    if (!answer.ok()) {
      // Slurm forgets jobs that ended some time ago (MinJobAge).
      if (absl::StrContains(answer.status().message(), "Invalid job id")) return statuses;
      return answer.status();
    }
    for (const absl::string_view line : absl::StrSplit(*answer, '\n')) {
      const std::vector<std::string> fields = absl::StrSplit(line, absl::MaxSplits('|', 2));
      if (fields.size() != 3) continue;
      const auto number = ParseWhole(std::string(absl::StripAsciiWhitespace(fields[0])));
      if (!number.ok() || *number < 1 || *number > size) continue;
      const std::string reason = fields[2] == "None" ? "" : fields[2];
      statuses[static_cast<size_t>(*number - 1)] =
          ElementStatus{StateOf(fields[1], fields[2]), reason.empty() ? fields[1] : reason};
    }
    return statuses;
  }

  absl::Status Cancel(const std::string& id) override { return RunCancel(id); }

  absl::Status CancelJob(const std::string& job) override {
    return RunCancel(absl::StrCat("--name=", NameOf(job)));
  }

 private:
  static std::string NameOf(const std::string& job) { return absl::StrCat("sightline-", job); }

  absl::Status RunCancel(const std::string& argument) const {
    absl::Status status = Run("scancel", {"--quiet", argument}).status();
    if (absl::StrContains(status.message(), "Invalid job id")) return absl::OkStatus();
    return status;
  }

  // Runs the program; returns its stdout without white space at the end.
  absl::StatusOr<std::string> Run(const std::string& program,
                                  const std::vector<std::string>& arguments) const {
    std::vector<std::string> words = {options_.command_folder.empty()
                                          ? program
                                          : absl::StrCat(options_.command_folder, "/", program)};
    words.insert(words.end(), arguments.begin(), arguments.end());
    auto result = RunProgram({.words = std::move(words), .in_path = true},
                             {.time_limit = kSchedulerToolTimeout});
    if (!result.ok()) return absl::UnavailableError(result.status().message());
    absl::StripTrailingAsciiWhitespace(&result->output);
    if (result->wait_status == 0) return result->output;
    absl::StripTrailingAsciiWhitespace(&result->errors);
    const std::string message = absl::StrCat(program, ": ", result->errors);
    return IsTransientSlurmError(message) ? absl::UnavailableError(message)
                                          : absl::FailedPreconditionError(message);
  }

  const SlurmOptions options_;
};

}  // namespace

std::unique_ptr<BatchScheduler> MakeSlurmScheduler(SlurmOptions options) {
  return std::make_unique<SlurmScheduler>(std::move(options));
}

}  // namespace sightline
