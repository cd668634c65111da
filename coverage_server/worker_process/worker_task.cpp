// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/worker_process/worker_task.h"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstring>
#include <new>
#include <thread>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/process/start_process.h"
#include "core/status/status_macros.h"
#include "coverage_server/worker_process/worker_process.h"

namespace sightline {
namespace {

constexpr char kFlag[] = "--worker-task";
// Exit codes.
constexpr int kWrongUse = 2;
constexpr int kOutOfMemory = 3;
constexpr int kTaskFailed = 4;  // the answer holds the status

absl::Status RunOn(const WorkerTask& task, int input_fd, SharedWriter& answer) {
  SIGHTLINE_ASSIGN_OR_RETURN(SharedReader input, SharedReader::Map(input_fd));
  absl::Status status = task.run(input, answer);
  if (status.ok() && !input.ok()) status = absl::InternalError("a task's input is not whole");
  return status.ok() ? answer.status() : status;
}

// `state`: status by waitpid() of a process that exited.
absl::StatusOr<SharedReader> AnswerOf(int state, int answer_fd, const std::string& name) {
  absl::StatusOr<SharedReader> answer = SharedReader::Map(answer_fd);
  if (!answer.ok() || WEXITSTATUS(state) == 0) return answer;
  if (WEXITSTATUS(state) == kOutOfMemory) return absl::ResourceExhaustedError("out of memory");
  if (WEXITSTATUS(state) == kTaskFailed) {
    const auto code = static_cast<absl::StatusCode>(answer->Get<int32_t>());
    const std::string message(answer->GetText());
    if (answer->ok()) return absl::Status(code, message);
  }
  return absl::InternalError(absl::StrCat("worker process for ", name, " failed"));
}

}  // namespace

absl::StatusOr<SharedReader> RunWorkerTask(const std::string& program, const std::string& name,
                                           const SharedMemory& input,
                                           const std::atomic<bool>* cancelled) {
  // The task itself may be what kills its workers, so restarts are limited.
  constexpr int kMostStarts = 3;
  int signal = 0;
  for (int starts = 0; starts < kMostStarts; ++starts) {
    SIGHTLINE_ASSIGN_OR_RETURN(SharedMemory answer, SharedMemory::Make("sightline-task-answer", 0));
    SIGHTLINE_ASSIGN_OR_RETURN(
        WorkerProcess worker,
        WorkerProcess::Start(program,
                             {kFlag, name, absl::StrCat(input.fd()), absl::StrCat(answer.fd())},
                             std::array{input.fd(), answer.fd()}));
    std::optional<int> state;
    while (!(state = worker.Ended())) {
      // The destructor of `worker` kills the process.
      if (cancelled != nullptr && cancelled->load()) return absl::CancelledError(name);
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    if (WIFEXITED(*state)) return AnswerOf(*state, answer.fd(), name);
    signal = WTERMSIG(*state);
  }
  return absl::UnavailableError(absl::StrCat("worker processes for ", name, " were killed ",
                                             kMostStarts, " times, at last by signal ", signal));
}

std::optional<int> MaybeRunWorkerTask(int argc, char** argv, std::span<const WorkerTask> tasks) {
  if (argc != 5 || std::strcmp(argv[1], kFlag) != 0) return std::nullopt;
  EndWithParent();
  int input_fd = -1, answer_fd = -1;
  if (!absl::SimpleAtoi(argv[3], &input_fd) || !absl::SimpleAtoi(argv[4], &answer_fd)) {
    return kWrongUse;
  }
  for (const WorkerTask& task : tasks) {
    if (task.name != argv[2]) continue;
    try {
      SharedWriter answer(answer_fd);
      const absl::Status status = RunOn(task, input_fd, answer);
      if (status.ok()) return 0;
      if (ftruncate(answer_fd, 0) != 0 || lseek(answer_fd, 0, SEEK_SET) != 0) return 1;
      SharedWriter instead(answer_fd);
      instead.Put(static_cast<int32_t>(status.code()));
      instead.PutText(std::string(status.message()));
      return instead.status().ok() ? kTaskFailed : kOutOfMemory;
    } catch (const std::bad_alloc&) {
      return kOutOfMemory;
    }
  }
  return kWrongUse;
}

}  // namespace sightline
