// SPDX-License-Identifier: Apache-2.0
// Starts another program, which can be made to end together with the one that started it.
#pragma once

#include <sys/types.h>

#include <string>
#include <vector>

#include "absl/status/statusor.h"

namespace sightline {

struct ProcessStart {
  std::vector<std::string> words = {};  // the program, and its arguments
  // True: a program without '/' in its name is searched in the folders of PATH.
  bool in_path = false;
  // Working folder of the program; empty: the current one.
  std::string folder = {};

  // Additional environment variables, "NAME=VALUE"; they replace ours of the same name.
  std::vector<std::string> environment = {};

  // A descriptor that the process inherits: one of ours, or a file (`flags` as for open(2); mode
  // 0600). Standard input is empty unless given here. The process also inherits our descriptors
  // that are not close-on-exec.
  struct Descriptor {
    int number;
    int ours = -1;  // -1: the file
    std::string file = {};
    int flags = 0;
  };
  std::vector<Descriptor> descriptors = {};

  // True: it stays in this process's group, so that signals of a terminal (Ctrl-C) reach it too.
  bool in_our_group = false;
  // True for our programs, which call EndWithParent(). The starting thread must outlive the
  // process: the kernel ends the process together with that thread.
  bool ends_with_us = false;
};

// The new process leads a process group of its own (unless `in_our_group`), so that signals of a
// terminal do not reach it and kill(-pid, ...) ends it with its children. It blocks and ignores no
// signal. The caller must wait for it. UNAVAILABLE states why it cannot be started.
absl::StatusOr<pid_t> StartProcess(const ProcessStart& start);

// To be called first by programs that may be started with `ends_with_us`: the kernel then kills the
// process when the thread that started it ends, at once if the parent is gone already. Has no
// effect if the process was started otherwise.
void EndWithParent();

}  // namespace sightline
