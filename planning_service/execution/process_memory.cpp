// SPDX-License-Identifier: Apache-2.0
#include "planning_service/execution/process_memory.h"

#include <dirent.h>
#include <unistd.h>

#include <fstream>
#include <map>
#include <memory>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// From /proc/PID/stat: "pid (name) state ppid ...", where a name may hold anything.
pid_t ParentOf(pid_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/stat"));
  std::string line;
  std::getline(file, line);
  const size_t end = line.rfind(')');
  if (end == std::string::npos) return -1;
  std::istringstream rest(line.substr(end + 1));
  std::string state;
  pid_t parent = -1;
  rest >> state >> parent;
  return rest ? parent : -1;
}

std::multimap<pid_t, pid_t> ChildrenByParent() {
  std::multimap<pid_t, pid_t> children;
  const std::unique_ptr<DIR, int (*)(DIR*)> proc(opendir("/proc"), closedir);
  if (proc == nullptr) return children;
  while (const dirent* entry = readdir(proc.get())) {
    pid_t pid = 0;
    if (absl::SimpleAtoi(entry->d_name, &pid)) children.emplace(ParentOf(pid), pid);
  }
  return children;
}

int64_t MemoryOf(pid_t pid) {
  std::ifstream rollup(absl::StrCat("/proc/", pid, "/smaps_rollup"));
  std::string word;
  while (rollup >> word) {
    int64_t kilobytes = 0;
    if (word == "Pss:" && rollup >> kilobytes) return kilobytes * 1024;
  }
  std::ifstream statm(absl::StrCat("/proc/", pid, "/statm"));
  int64_t total = 0, resident = 0;
  return statm >> total >> resident ? resident * sysconf(_SC_PAGESIZE) : 0;
}

}  // namespace

int64_t ProcessTreeMemory(pid_t pid) {
  const std::multimap<pid_t, pid_t> children = ChildrenByParent();
  int64_t bytes = 0;
  std::set<pid_t> seen;
  std::vector<pid_t> left = {pid};
  while (!left.empty()) {
    const pid_t next = left.back();
    left.pop_back();
    if (!seen.insert(next).second) continue;
    bytes += MemoryOf(next);
    const auto [begin, end] = children.equal_range(next);
    for (auto child = begin; child != end; ++child) left.push_back(child->second);
  }
  return bytes;
}

}  // namespace sightline
