// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/engine/cluster_engine.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/status/status_macros.h"
#include "planning_service/execution/engine/task_folder.h"

namespace sightline {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = JobProcessEnd::Kind;
using State = ElementStatus::State;

constexpr absl::Duration kFirstRetry = absl::Seconds(1);
constexpr absl::Duration kLongestRetry = absl::Seconds(30);
constexpr int kExitOfSignal = 128;  // of a shell: 128 + signal
constexpr int kExitOfKill = 137;

JobProcessEnd EndWithoutWord(const std::string& name, const std::string& how, bool was_killed,
                             const std::string& last_words) {
  JobProcessEnd end;
  end.kind = Kind::kWithoutWord;
  end.was_killed = was_killed;
  end.failure = {absl::StatusCode::kInternal, "PROCESS_ENDED",
                 absl::StrCat("the process of the job (", name, ") ", how,
                              last_words.empty() ? "" : "; its last words: ", last_words)};
  return end;
}

JobProcessEnd Stopped() {
  JobProcessEnd end;
  end.kind = Kind::kStopped;
  return end;
}

// One command of an attempt, by its files and its state in the workload manager.
class Element {
 public:
  Element(const std::string& tasks, std::string name, absl::Duration grace)
      : name_(std::move(name)), files_(tasks, name_), grace_(grace) {}

  void ReadFiles() { files_.Read(); }
  void SetStatus(const std::optional<ElementStatus>& status) { status_ = status; }

  JobProgress Progress() const {
    if (IsDone()) return {1, ""};
    JobProgress progress = files_.messages().progress();
    // A task that reports progress runs, whatever the workload manager said before.
    if (progress.message.empty() && status_ && status_->state == State::kWaiting) {
      progress.message = absl::StrCat("waits for a machine of the cluster",
                                      status_->reason.empty() ? "" : ": ", status_->reason);
    }
    return progress;
  }

  bool IsDone() const { return files_.exit_code() == 0; }
  // True if, by the workload manager, the command neither runs nor waits.
  bool IsGone() const {
    return !status_ || (status_->state != State::kRunning && status_->state != State::kWaiting);
  }

  // How the command failed, if it did. Called after each answer of the workload manager.
  std::optional<JobProcessEnd> BadEnd() {
    if (IsDone()) return std::nullopt;
    const bool gone = IsGone();
    const std::optional<int> code = files_.exit_code();
    if (!gone && !code) {
      ended_since_.reset();
      return std::nullopt;
    }
    JobProcessEnd end;
    if (code && *code < kExitOfSignal && files_.messages().failure()) {
      end.kind = Kind::kFailed;
      end.failure = *files_.messages().failure();
      return end;
    }
    const State state = status_ ? status_->state : State::kLost;
    if (state == State::kOutOfMemory || state == State::kOutOfTime) {
      end.kind = state == State::kOutOfMemory ? Kind::kOutOfMemory : Kind::kOutOfTime;
      return end;
    }
    if (state == State::kCancelled) {
      end.kind = Kind::kFailed;
      end.failure = {absl::StatusCode::kInternal, "CLUSTER_CANCELLED",
                     absl::StrCat("the job was cancelled in the cluster (", name_,
                                  "), not by the service; ", status_->reason)};
      return end;
    }
    if (gone && state == State::kLost && status_) {
      return EndWithoutWord(name_, absl::StrCat("lost its machine: ", status_->reason), true,
                            files_.messages().last_words());
    }
    // Exit code and state come by different ways: wait for the later one, which may say more.
    const Clock::time_point now = Clock::now();
    if (!ended_since_) ended_since_ = now;
    if (!(gone && code) && absl::FromChrono(now - *ended_since_) < grace_) return std::nullopt;
    if (code) {
      return EndWithoutWord(name_, absl::StrCat("ended with exit code ", *code),
                            *code == kExitOfKill, files_.messages().last_words());
    }
    return EndWithoutWord(name_,
                          absl::StrCat("is gone from the cluster without an exit code",
                                       status_ ? ": " : "", status_ ? status_->reason : ""),
                          true, files_.messages().last_words());
  }

 private:
  std::string name_;
  TaskFiles files_;
  absl::Duration grace_;
  std::optional<ElementStatus> status_ = ElementStatus{};
  std::optional<Clock::time_point> ended_since_;
};

class ClusterEngine final : public ComputeEngine {
 public:
  ClusterEngine(std::unique_ptr<BatchScheduler> scheduler, ClusterTiming timing)
      : scheduler_(std::move(scheduler)), timing_(timing) {}

  absl::StatusOr<JobProcessEnd> Run(const AttemptOptions& options,
                                    const ProgressCallback& wish) override {
    std::optional<ClusterRecord> record = ClusterRecord::Read(options.folder);
    if (record && record->IsComplete() && record->scheduler == scheduler_->kind()) {
      spdlog::info("event=cluster_arrays_found job={} parts=\"{}\" conclusion=\"{}\"", options.name,
                   record->parts, record->conclusion);
    } else {
      SIGHTLINE_ASSIGN_OR_RETURN(auto submitted, Begin(options, wish));
      if (const auto* end = std::get_if<JobProcessEnd>(&submitted)) return *end;
      record = std::get<ClusterRecord>(submitted);
    }
    return Watch(options, *record, wish);
  }

 private:
  using Begun = std::variant<ClusterRecord, JobProcessEnd>;

  // Repeats the call until the workload manager answers or the caller stops the attempt. A missing
  // answer says nothing about the job.
  template <typename Call>
  auto Insist(const std::string& what, const ProgressCallback& wish, const Call& call)
      -> decltype(call()) {
    absl::Duration retry = kFirstRetry;
    while (true) {
      auto result = call();
      const absl::Status status = StatusOf(result);
      if (!absl::IsUnavailable(status)) return result;
      spdlog::warn("event=cluster_unavailable what={} error=\"{}\"", what, status.ToString());
      JobProgress progress;
      progress.message = absl::StrCat("waits for the cluster: ", status.message());
      const Clock::time_point until = Clock::now() + absl::ToChronoNanoseconds(retry);
      while (Clock::now() < until) {
        if (wish(progress) != Wish::kGoOn) return absl::CancelledError();
        std::this_thread::sleep_for(absl::ToChronoMilliseconds(timing_.files));
      }
      retry = std::min(2 * retry, kLongestRetry);
    }
  }
  static const absl::Status& StatusOf(const absl::Status& status) { return status; }
  template <typename T>
  static const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
    return result.status();
  }

  static JobProcessEnd NotSubmitted(const absl::Status& status) {
    if (absl::IsCancelled(status)) return Stopped();
    JobProcessEnd end;
    end.kind = Kind::kFailed;
    end.failure = {absl::StatusCode::kFailedPrecondition, "CLUSTER_REFUSED",
                   absl::StrCat("the cluster refused the job: ", status.message())};
    return end;
  }

  absl::StatusOr<Begun> Begin(const AttemptOptions& options, const ProgressCallback& wish) {
    // A service that was killed may have submitted tasks without recording them.
    if (RevokeTasks(options.folder)) {
      absl::Status cancelled =
          Insist("cancel", wish, [&] { return scheduler_->CancelJob(options.name); });
      if (!cancelled.ok()) return NotSubmitted(cancelled);
      AwaitRevokedTasks(wish);
    }
    if (const auto failure = PrepareFailure(options)) return *failure;
    SIGHTLINE_ASSIGN_OR_RETURN(auto tasks, MakeTaskFolder(options));
    ClusterRecord record;
    record.scheduler = scheduler_->kind();
    record.tasks = tasks;
    record.part_count = static_cast<int>(options.commands.parts.size());
    SIGHTLINE_RETURN_IF_ERROR(record.Write(options.folder));
    TaskArray array;
    array.job = options.name;
    array.folder = options.folder + "/in";
    array.max_memory_bytes = options.max_memory_bytes;
    array.max_time = options.max_time;
    for (const bool conclusion : {false, true}) {
      if (!conclusion && record.part_count == 0) continue;
      array.script = absl::StrCat(tasks, conclusion ? "/conclusion" : "/parts");
      array.size = conclusion ? 1 : record.part_count;
      if (conclusion) array.after = record.parts;
      auto id = Insist("submit", wish, [&] { return scheduler_->Submit(array); });
      if (!id.ok()) {
        Stop(options, record, wish).IgnoreError();
        return NotSubmitted(id.status());
      }
      (conclusion ? record.conclusion : record.parts) = *id;
    }
    if (absl::Status s = record.Write(options.folder); !s.ok()) {
      Stop(options, record, wish).IgnoreError();
      return s;
    }
    spdlog::info("event=cluster_arrays_submitted job={} size={} parts=\"{}\" conclusion=\"{}\"",
                 options.name, record.part_count, record.parts, record.conclusion);
    return record;
  }

  struct Arrays {
    std::vector<Element> parts;
    std::vector<Element> conclusion;
  };

  absl::Status LookAt(const std::string& id, std::vector<Element>* elements) {
    if (id.empty()) return absl::OkStatus();
    SIGHTLINE_ASSIGN_OR_RETURN(auto statuses,
                               scheduler_->Look(id, static_cast<int>(elements->size())));
    for (size_t i = 0; i < elements->size(); ++i) (*elements)[i].SetStatus(statuses[i]);
    return absl::OkStatus();
  }

  absl::StatusOr<JobProcessEnd> Watch(const AttemptOptions& options, const ClusterRecord& record,
                                      const ProgressCallback& wish) {
    Arrays arrays;
    for (int i = 1; i <= record.part_count; ++i) {
      arrays.parts.emplace_back(record.tasks, absl::StrCat("parts-", i), timing_.grace);
    }
    arrays.conclusion.emplace_back(record.tasks, "conclusion-1", timing_.grace);
    Clock::time_point asked{};
    bool released = record.part_count == 0;
    while (true) {
      std::vector<JobProgress> parts;
      bool parts_done = true;
      for (Element& part : arrays.parts) {
        if (!part.IsDone()) part.ReadFiles();
        parts_done = parts_done && part.IsDone();
        parts.push_back(part.Progress());
      }
      arrays.conclusion[0].ReadFiles();
      JobProcessEnd end;
      if (arrays.conclusion[0].IsDone()) {
        end.kind = Kind::kDone;
        return end;
      }
      switch (wish(ProgressOfParts(parts, arrays.conclusion[0].Progress()))) {
        case Wish::kGoOn:
          break;
        case Wish::kLeave:
          return Stopped();
        case Wish::kCancel: {
          const auto go_on = [](const JobProgress&) { return Wish::kGoOn; };
          Stop(options, record, go_on).IgnoreError();
          return Stopped();
        }
      }
      const Clock::time_point now = Clock::now();
      if (absl::FromChrono(now - asked) >= timing_.scheduler) {
        asked = now;
        if (auto bad_end = Ask(record, parts_done, &released, &arrays)) {
          // A machine that was killed or is unreachable may still run its command.
          const absl::Status stopped = Stop(options, record, wish, bad_end->was_killed);
          if (!stopped.ok()) {
            spdlog::warn("event=cluster_stop_failed job={} error=\"{}\"", options.name,
                         stopped.ToString());
          }
          return *bad_end;
        }
      }
      std::this_thread::sleep_for(absl::ToChronoMilliseconds(timing_.files));
    }
  }

  // Queries the workload manager. Returns how the first failed task ended, if any has failed.
  std::optional<JobProcessEnd> Ask(const ClusterRecord& record, bool parts_done, bool* released,
                                   Arrays* arrays) {
    absl::Status asked = LookAt(record.parts, &arrays->parts);
    if (asked.ok()) asked = LookAt(record.conclusion, &arrays->conclusion);
    if (asked.ok() && parts_done && !*released) {
      asked = scheduler_->Release(record.conclusion);
      *released = asked.ok();
    }
    if (!asked.ok()) {
      spdlog::warn("event=cluster_unavailable what=look error=\"{}\"", asked.ToString());
      return std::nullopt;
    }
    for (Element& part : arrays->parts) {
      part.ReadFiles();
      if (auto end = part.BadEnd()) return end;
    }
    // The conclusion waits for the shards, or was cancelled because one of them failed.
    if (!parts_done) return std::nullopt;
    arrays->conclusion[0].ReadFiles();
    return arrays->conclusion[0].BadEnd();
  }

  // Ends running commands. None of them writes afterwards: if a machine is lost, or the workload
  // manager reports no state, the commands end themselves because their tasks are revoked.
  absl::Status Stop(const AttemptOptions& options, const ClusterRecord& record,
                    const ProgressCallback& wish, bool may_run_on = false) {
    RevokeTasks(options.folder);
    absl::Status result;
    bool all_gone = !may_run_on;
    for (const auto& [id, size] :
         {std::pair(record.conclusion, 1), std::pair(record.parts, record.part_count)}) {
      if (id.empty()) continue;
      if (absl::Status s = scheduler_->Cancel(id); !s.ok()) result = s;
      all_gone = AwaitGone(id, size) && all_gone;
    }
    if (!all_gone) AwaitRevokedTasks(wish);
    return result;
  }

  // Waits for all elements to end. False if one may still run.
  bool AwaitGone(const std::string& id, int size) {
    std::vector<Element> elements;
    for (int i = 1; i <= size; ++i) elements.emplace_back("", "", absl::ZeroDuration());
    const Clock::time_point end = Clock::now() + absl::ToChronoNanoseconds(timing_.stop);
    while (LookAt(id, &elements).ok() && Clock::now() < end) {
      const bool gone = std::all_of(elements.begin(), elements.end(),
                                    [](const Element& element) { return element.IsGone(); });
      if (gone) return true;
      std::this_thread::sleep_for(absl::ToChronoMilliseconds(timing_.files));
    }
    return false;
  }

  const std::unique_ptr<BatchScheduler> scheduler_;
  const ClusterTiming timing_;
};

}  // namespace

std::unique_ptr<ComputeEngine> MakeClusterEngine(std::unique_ptr<BatchScheduler> scheduler,
                                                 ClusterTiming timing) {
  return std::make_unique<ClusterEngine>(std::move(scheduler), timing);
}

}  // namespace sightline
