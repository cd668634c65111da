// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/engine/task_folder.h"

#include <stdlib.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <thread>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/file/atomic_write.h"
#include "core/status/status_macros.h"
#include "proto/status/rpc_status.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kRecordFile[] = "/cluster.json";
// Tasks run as long as this file exists.
constexpr char kLeaseFile[] = "/go";
constexpr int kLeaseInterval_s = 2;
constexpr absl::Duration kRevokedWithin = absl::Seconds(2 * kLeaseInterval_s + 1);
constexpr absl::Duration kWaitStep = absl::Milliseconds(200);
constexpr double kShareOfParts = 0.95;
// Limit on the blocks that one Read takes; the next Read takes the rest.
constexpr int kMostBlocks = 256;

std::string Quoted(const std::string& text) {
  return absl::StrCat("'", absl::StrReplaceAll(text, {{"'", "'\\''"}}), "'");
}

// A shell that receives SIGTERM from the workload manager passes it on and waits.
constexpr char kScript[] = R"(#!/bin/sh
tasks=$TASKS
[ -e "$tasks/go" ] && cd $FOLDER || exit 1
$COMMAND </dev/null >/dev/null 2>"$tasks/$NAME.stderr" &
command=$!
trap 'kill "$command" 2>/dev/null' TERM INT
(while [ -e "$tasks/go" ]; do sleep $INTERVAL; done; kill "$command") >/dev/null 2>&1 &
watch=$!
wait "$command"
code=$?
while kill -0 "$command" 2>/dev/null; do wait "$command"; code=$?; done
kill "$watch" 2>/dev/null
echo "$code" >"$tasks/$NAME.exit.new" && mv "$tasks/$NAME.exit.new" "$tasks/$NAME.exit"
exit "$code"
)";

absl::Status WriteScript(const AttemptOptions& options, const std::string& tasks,
                         const std::string& name, const std::vector<std::string>& arguments) {
  std::string command = absl::StrCat(Quoted(options.program), " --progress=json");
  for (const std::string& argument : arguments) absl::StrAppend(&command, " ", Quoted(argument));
  const std::string path = absl::StrCat(tasks, "/", name, ".sh");
  std::ofstream file(path);
  file << absl::StrReplaceAll(kScript, {{"$TASKS", Quoted(tasks)},
                                        {"$FOLDER", Quoted(options.folder + "/in")},
                                        {"$COMMAND", command},
                                        {"$NAME", name},
                                        {"$INTERVAL", absl::StrCat(kLeaseInterval_s)}});
  file.close();
  if (file) return absl::OkStatus();
  return absl::InternalError(absl::StrCat(path, ": cannot be written"));
}

}  // namespace

JobProgress ProgressOfParts(const std::vector<JobProgress>& parts, const JobProgress& conclusion) {
  if (parts.empty()) return conclusion;
  double sum = 0;
  size_t done = 0;
  const JobProgress* least = &parts.front();
  for (const JobProgress& part : parts) {
    sum += part.fraction;
    done += part.fraction >= 1;
    if (part.fraction < least->fraction) least = &part;
  }
  JobProgress whole;
  whole.fraction = kShareOfParts * sum / static_cast<double>(parts.size()) +
                   (1 - kShareOfParts) * conclusion.fraction;
  if (done == parts.size()) {
    whole.message = conclusion.message;
  } else {
    whole.message = absl::StrCat(done, " of ", parts.size(), " parts done",
                                 least->message.empty() ? "" : "; ", least->message);
  }
  return whole;
}

std::optional<JobProcessEnd> PrepareFailure(const AttemptOptions& options) {
  if (!options.prepare) return std::nullopt;
  const absl::Status prepared = options.prepare();
  if (prepared.ok()) return std::nullopt;
  JobProcessEnd end;
  end.kind = JobProcessEnd::Kind::kFailed;
  end.failure = {prepared.code(), ErrorReason(prepared), std::string(prepared.message())};
  return end;
}

std::optional<ClusterRecord> ClusterRecord::Read(const std::string& folder) {
  std::ifstream file(folder + kRecordFile);
  if (!file) return std::nullopt;
  const nlohmann::json json = nlohmann::json::parse(file, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object()) return std::nullopt;
  ClusterRecord record;
  for (const auto& [name, field] :
       {std::pair("scheduler", &record.scheduler), std::pair("tasks", &record.tasks),
        std::pair("parts", &record.parts), std::pair("conclusion", &record.conclusion)}) {
    if (!json.contains(name) || !json[name].is_string()) return std::nullopt;
    *field = json[name].get<std::string>();
  }
  if (!json.contains("part_count") || !json["part_count"].is_number_integer()) return std::nullopt;
  record.part_count = json["part_count"].get<int>();
  return record;
}

absl::Status ClusterRecord::Write(const std::string& folder) const {
  const nlohmann::json json = {{"scheduler", scheduler},
                               {"tasks", tasks},
                               {"part_count", part_count},
                               {"parts", parts},
                               {"conclusion", conclusion}};
  return WriteFileAtomically(folder + kRecordFile, json.dump() + "\n");
}

absl::StatusOr<std::string> MakeTaskFolder(const AttemptOptions& options) {
  // Each attempt has its own folder: an unreachable earlier attempt cannot write here.
  std::string tasks = options.folder + "/tasks-XXXXXX";
  if (mkdtemp(tasks.data()) == nullptr) {
    return absl::InternalError(absl::StrCat(tasks, ": ", std::strerror(errno)));
  }
  const TaskCommands& commands = options.commands;
  for (size_t i = 0; i < commands.parts.size(); ++i) {
    SIGHTLINE_RETURN_IF_ERROR(
        WriteScript(options, tasks, absl::StrCat("parts-", i + 1), commands.parts[i]));
  }
  SIGHTLINE_RETURN_IF_ERROR(WriteScript(options, tasks, "conclusion-1", commands.conclusion));
  SIGHTLINE_RETURN_IF_ERROR(WriteFileAtomically(tasks + kLeaseFile, ""));
  return tasks;
}

bool RevokeTasks(const std::string& folder) {
  std::error_code error;
  bool any = fs::remove(folder + kRecordFile, error);
  std::vector<fs::path> old;
  for (auto entry = fs::directory_iterator(folder, error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (entry->path().filename().string().rfind("tasks-", 0) == 0) old.push_back(entry->path());
  }
  for (const fs::path& tasks : old) {
    any = fs::remove(tasks.string() + kLeaseFile, error) || any;
    fs::remove_all(tasks, error);
  }
  return any;
}

void AwaitRevokedTasks(const ProgressCallback& wish) {
  JobProgress progress;
  progress.message = "waits until the attempt before has ended";
  for (int i = 0; i < kRevokedWithin / kWaitStep && wish(progress) == Wish::kGoOn; ++i) {
    std::this_thread::sleep_for(absl::ToChronoMilliseconds(kWaitStep));
  }
}

TaskFiles::TaskFiles(const std::string& folder, const std::string& name)
    : path_(absl::StrCat(folder, "/", name)) {}

void TaskFiles::Read() {
  // The exit code is read first: all messages were written before it.
  if (!exit_code_) {
    int code = 0;
    if (std::ifstream file(path_ + ".exit"); file >> code) exit_code_ = code;
  }
  std::ifstream file(path_ + ".stderr", std::ios::binary);
  file.seekg(static_cast<std::streamoff>(read_));
  std::array<char, 4096> buffer;
  for (int i = 0; i < kMostBlocks && file; ++i) {
    file.read(buffer.data(), buffer.size());
    messages_.Add(buffer.data(), static_cast<size_t>(file.gcount()));
    read_ += static_cast<size_t>(file.gcount());
  }
  caught_up_ = !file;
}

}  // namespace sightline
