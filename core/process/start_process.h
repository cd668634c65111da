// SPDX-License-Identifier: Apache-2.0
// Starts another program; and how such a program ends with the one that started it.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct ProcessStart {
  std::vector<std::string> words = {};  // the program, and its arguments
  // Look for a program without '/' in its name in the folders of PATH.
  bool in_path = false;
  // Folder that it runs in; empty: this one.
  std::string folder = {};

  // Variables of its environment besides ours, "NAME=VALUE"; they replace ours of the same name.
  std::vector<std::string> environment = {};

  // A descriptor that the process inherits: one of ours, or a file (`flags` as of open(2); mode
  // 0600). Standard input is empty unless given here; of other descriptors of ours it has those
  // that are not close-on-exec.
  struct Descriptor {
    int number;
    int ours = -1;  // -1: the file
    std::string file = {};
    int flags = 0;
  };
  std::vector<Descriptor> descriptors = {};

  // It stays in this process's group: signals of a terminal, as on Ctrl-C, reach it too.
  bool in_our_group = false;
  // It is one of our programs, which calls EndWithParent(): the thread that starts it must outlive
  // it, for the kernel ends it with that thread.
  bool ends_with_us = false;
};

// The new process leads a process group of its own unless asked otherwise, so that signals of a
// terminal do not reach it and kill(-pid, ...) ends it with its children; it blocks and ignores no
// signal. The caller waits for it. UNAVAILABLE: it cannot be started, and why.
absl::StatusOr<pid_t> StartProcess(const ProcessStart& start);

// For a program that was started with `ends_with_us`, first of all that it does: it is killed when
// the thread ends that started it, at once if its parent is gone already. Nothing for one that was
// started otherwise.
void EndWithParent();

}  // namespace sightline
