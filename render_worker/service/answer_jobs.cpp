// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/answer_jobs.h"

#include <chrono>
#include <optional>
#include <utility>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"
#include "render_worker/service/without_folders.h"
#include "rpc_server/rpc_server.h"

namespace sightline {
namespace {

// Room for the envelope of an answer in its message.
constexpr size_t kMostAnswerBytes = kMaxMessageBytes - (1 << 20);

}  // namespace

absl::StatusOr<v1::Job> AnswerJobs::Queue(const std::string& kind, const std::string& request_id,
                                          const std::string& request_digest,
                                          std::unique_ptr<JobRoom> room, Work work) {
  absl::StatusOr<JobRecord> job = jobs_->Create(
      kind, request_id, request_digest,
      [this, work = std::move(work)](JobContext& context) -> absl::StatusOr<std::string> {
        // Every report wakes all who watch.
        std::optional<std::chrono::steady_clock::time_point> reported;
        const Progress progress = [&](double fraction, const std::string& what) {
          const auto now = std::chrono::steady_clock::now();
          if (!reported || now - *reported >= kProgressInterval) {
            reported = now;
            context.ReportProgress(fraction, what);
          }
          return !context.cancelled();
        };
        absl::StatusOr<std::string> bytes = work(progress, context);
        if (!bytes.ok()) return WithoutFolders(bytes.status(), {spool_folder_});
        if (bytes->size() > kMostAnswerBytes) {
          return absl::ResourceExhaustedError(absl::StrCat("the answer has ", bytes->size(),
                                                           " bytes, at most ", kMostAnswerBytes,
                                                           " can be sent: ask for less"));
        }
        const std::string key = Sha256Hex(*bytes);
        const auto size = static_cast<int64_t>(bytes->size());
        SIGHTLINE_RETURN_IF_ERROR(
            results_.Put(key, std::make_shared<const std::string>(*std::move(bytes)), size));
        return key;
      },
      std::move(room));
  if (!job.ok()) return job.status();
  return JobToProto(*job);
}

absl::StatusOr<std::shared_ptr<const std::string>> AnswerJobs::Result(const std::string& job_id,
                                                                      const std::string& kind) {
  const absl::StatusOr<JobRecord> job = jobs_->Get(job_id);
  const std::string name = absl::StrCat(kind, " job \"", absl::Utf8SafeCEscape(job_id), "\"");
  if (!job.ok() || job->kind != kind) {
    return WithErrorInfo(absl::NotFoundError("no " + name), "JOB_UNKNOWN");
  }
  if (!job->finished()) {
    return WithErrorInfo(
        absl::FailedPreconditionError(absl::StrCat(name, " has not finished: watch it first")),
        "JOB_NOT_FINISHED");
  }
  const bool unfinished_answer = absl::IsCancelled(job->error) && !job->result_key.empty();
  if (!job->error.ok() && !unfinished_answer) return job->error;
  auto result = results_.Get(job->result_key);
  if (result == nullptr) {
    return WithErrorInfo(
        absl::NotFoundError(absl::StrCat("the answer of ", name, " is not kept any more")),
        "RESULT_DROPPED");
  }
  return result;
}

}  // namespace sightline
