// SPDX-License-Identifier: Apache-2.0
#include <sys/stat.h>

#include <memory>
#include <string>

#include "planner_client/command_line/process/exit_code.h"
#include "planner_client/command_line/process/interrupt.h"
#include "planner_client/command_line/process/print.h"
#include "planner_client/commands/commands.h"
#include "planning_service/backup/back_up.h"

namespace sightline {
namespace {

struct BackupOptions {
  std::string data, out;
  bool only_files = false;
};

int RunBackup(const BackupOptions& options) {
  // The jobs of a service are its clients' secrets: nothing is readable by other users.
  umask(S_IRWXG | S_IRWXO);
  const auto report = BackUp(options.data, options.out, options.only_files, InterruptFlag());
  if (absl::IsCancelled(report.status())) {
    ReportError(report.status());
    return kExitInterrupted;
  }
  if (!report.ok()) return ReportError(report.status());
  PrintText("%s: %lld files, %lld of them new (%.1f MB)\n", options.out.c_str(),
            static_cast<long long>(report->files), static_cast<long long>(report->copied_files),
            1e-6 * static_cast<double>(report->copied_bytes));
  return kExitDone;
}

}  // namespace

Command AddBackupCommand(CLI::App& app) {
  auto options = std::make_shared<BackupOptions>();
  app.add_option("data", options->data, "data folder of `sightline serve`, which may run")
      ->required();
  app.add_option("--out", options->out,
                 "folder of the backup; with an earlier one in it, only what that lacks is copied")
      ->required();
  app.add_flag("--only-files", options->only_files,
               "all files and no database, where that is PostgreSQL and has been dumped before");
  return [options] { return RunBackup(*options); };
}

}  // namespace sightline
