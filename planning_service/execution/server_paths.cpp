// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/server_paths.h"

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <system_error>

#include "absl/strings/ascii.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"
#include "core/process/program_path.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr char kJobFolder[] = "(the folder of the job)";
constexpr char kServiceFolder[] = "(a folder of the service)";
// Folders whose files belong to the client; commands run in `in` and may use relative paths.
constexpr const char* kJobFolders[] = {"in", "out", "checkpoint"};

// Letters of file names as they stand in messages without quotes.
bool IsNameLetter(char c) {
  return absl::ascii_isalnum(static_cast<unsigned char>(c)) ||
         static_cast<unsigned char>(c) >= 0x80 ||
         absl::string_view("_-.+~@%").find(c) != absl::string_view::npos;
}

size_t SkipSlashes(absl::string_view text, size_t at) {
  while (at < text.size() && text[at] == '/') ++at;
  return at;
}

// End of `folder` in `text` if `text` has it at `begin`, else npos. Several slashes in a row count
// as one, because programs join paths in that way.
size_t MatchFolder(absl::string_view text, size_t begin, absl::string_view folder) {
  size_t at = begin;
  for (size_t i = 0; i < folder.size(); ++i) {
    if (at >= text.size() || text[at] != folder[i]) return absl::string_view::npos;
    at = folder[i] == '/' ? SkipSlashes(text, at) : at + 1;
  }
  // "/data/work/job-1" is no part of "/data/work/job-12", but the full stop of a sentence may
  // follow.
  const bool goes_on = at < text.size() && IsNameLetter(text[at]) &&
                       !(text[at] == '.' && (at + 1 == text.size() || text[at + 1] == ' '));
  return goes_on ? absl::string_view::npos : at;
}

// True if a path may begin at `at`, that is not within a longer path.
bool MayBegin(absl::string_view text, size_t at) {
  return at == 0 || (!IsNameLetter(text[at - 1]) && text[at - 1] != '/');
}

size_t EndOfPath(absl::string_view text, size_t at) {
  while (at < text.size() && (IsNameLetter(text[at]) || text[at] == '/')) ++at;
  return at;
}

// Returns the text that a client reads in place of a path whose folder ends at `*at`, and moves
// `*at` behind that path.
std::string ShownPath(absl::string_view text, bool of_job, size_t* at) {
  const size_t rest = SkipSlashes(text, *at);
  if (of_job) {
    // Names of clients may hold anything.
    const bool ends_here =
        rest == *at || rest == text.size() ||
        absl::string_view(" \t\n\r\"'`:,;)]").find(text[rest]) != absl::string_view::npos;
    *at = rest;
    return ends_here ? kJobFolder : "";
  }
  if (rest == *at) return kServiceFolder;
  *at = EndOfPath(text, rest);
  absl::string_view path = text.substr(rest, *at - rest);
  while (absl::ConsumeSuffix(&path, "/")) {
  }
  if (path.empty()) return kServiceFolder;
  return std::string(path.substr(path.rfind('/') + 1));
}

}  // namespace

ServerPaths::ServerPaths(const std::string& job_folder, const std::vector<std::string>& folders) {
  Add(job_folder, true);
  for (const std::string folder : kJobFolders) {
    Add(job_folder + "/" + folder, true);
    folders_.push_back({"../" + folder, true});
  }
  for (const std::string& folder : folders) Add(folder, false);
  std::stable_sort(folders_.begin(), folders_.end(),
                   [](const Folder& a, const Folder& b) { return a.path.size() > b.path.size(); });
}

void ServerPaths::Add(const std::string& path, bool of_job) {
  if (path.empty()) return;
  std::error_code error;
  const fs::path real = fs::weakly_canonical(path, error);
  for (const fs::path& name : {fs::path(path).lexically_normal(), error ? fs::path() : real}) {
    std::string folder = name.string();
    while (!folder.empty() && folder.back() == '/') folder.pop_back();
    // The root folder is never hidden: hiding it would shorten every path.
    if (!folder.empty() && folder.front() == '/') folders_.push_back({folder, of_job});
  }
}

std::string ServerPaths::WithoutPaths(const std::string& message) const {
  const absl::string_view text = message;
  std::string shown;
  size_t at = 0;
  while (at < text.size()) {
    size_t end = absl::string_view::npos;
    bool of_job = false;
    if ((text[at] == '/' || text[at] == '.') && MayBegin(text, at)) {
      for (const Folder& folder : folders_) {
        end = MatchFolder(text, at, folder.path);
        of_job = folder.of_job;
        if (end != absl::string_view::npos) break;
      }
    }
    if (end == absl::string_view::npos) {
      shown += text[at++];
      continue;
    }
    at = end;
    shown += ShownPath(text, of_job, &at);
  }
  return shown;
}

std::vector<std::string> FoldersOfProgram(const std::string& program) {
  std::vector<std::string> folders = {InstalledDataFolder().string()};
  for (const fs::path& folder : ProgramFolders(program)) folders.push_back(folder.string());
  return folders;
}

}  // namespace sightline
