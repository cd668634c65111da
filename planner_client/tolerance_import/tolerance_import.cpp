#include "planner_client/tolerance_import/tolerance_import.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "absl/time/clock.h"
#include "core/json/strict_json.h"
#include "core/tolerance/qif_reader.h"
#include "core/tolerance/tolerance_proto.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

constexpr const char* kProgram = "sightline_step_import";
// Half a million triangles take about 40 MB.
constexpr size_t kMaxOutputBytes = size_t{1} << 29;
constexpr size_t kStderrTailBytes = 2000;

struct Finished {
  std::string output, errors;
  int wait_status = 0;
};

class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() { Close(); }
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;
  int get() const { return fd_; }
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }

 private:
  int fd_;
};

// Kills the program and waits for it unless it has been waited for.
class Child {
 public:
  explicit Child(pid_t pid) : pid_(pid) {}
  ~Child() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    Wait();
  }
  Child(const Child&) = delete;
  Child& operator=(const Child&) = delete;
  int Wait() {
    int status = 0;
    while (waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
    }
    pid_ = 0;
    return status;
  }

 private:
  pid_t pid_;
};

absl::Status SystemError(const std::string& what) {
  return absl::InternalError(absl::StrCat(what, ": ", std::strerror(errno)));
}

// Runs a program without a shell, its standard input empty, and collects what it writes.
absl::StatusOr<Finished> Run(const std::string& program, std::vector<std::string> arguments,
                             absl::Duration time_limit) {
  std::array<int, 2> out{}, err{};
  if (pipe2(out.data(), O_CLOEXEC) != 0) return SystemError("pipe");
  Fd out_read(out[0]), out_write(out[1]);
  if (pipe2(err.data(), O_CLOEXEC) != 0) return SystemError("pipe");
  Fd err_read(err[0]), err_write(err[1]);

  arguments.insert(arguments.begin(), program);
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (std::string& argument : arguments) argv.push_back(argument.data());
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, out_write.get(), 1);
  posix_spawn_file_actions_adddup2(&actions, err_write.get(), 2);
  pid_t pid = 0;
  const int failed = posix_spawn(&pid, program.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (failed != 0) {
    return absl::InternalError(absl::StrCat(program, ": ", std::strerror(failed)));
  }
  Child child(pid);
  out_write.Close();
  err_write.Close();

  Finished finished;
  const absl::Time deadline = absl::Now() + time_limit;
  std::array<pollfd, 2> polled = {{{out_read.get(), POLLIN, 0}, {err_read.get(), POLLIN, 0}}};
  std::array<std::string*, 2> sinks = {&finished.output, &finished.errors};
  std::vector<char> buffer(1 << 16);
  while (polled[0].fd >= 0 || polled[1].fd >= 0) {
    const int64_t left_ms = absl::ToInt64Milliseconds(deadline - absl::Now());
    if (left_ms <= 0) {
      return absl::DeadlineExceededError(absl::StrCat(
          program, " took longer than ", absl::FormatDuration(time_limit), " and was ended"));
    }
    const int ready =
        poll(polled.data(), polled.size(), static_cast<int>(std::min<int64_t>(left_ms, 1000)));
    if (ready < 0 && errno != EINTR) return SystemError("poll");
    if (ready <= 0) continue;
    for (size_t i = 0; i < polled.size(); ++i) {
      if (polled[i].fd < 0 || polled[i].revents == 0) continue;
      const ssize_t count = read(polled[i].fd, buffer.data(), buffer.size());
      if (count < 0 && (errno == EINTR || errno == EAGAIN)) continue;
      if (count <= 0) {
        polled[i].fd = -1;
        continue;
      }
      sinks[i]->append(buffer.data(), static_cast<size_t>(count));
      if (finished.output.size() > kMaxOutputBytes) {
        return absl::InternalError(absl::StrCat(program, " wrote more than 512 MiB"));
      }
      // What it wrote last tells why it failed.
      if (finished.errors.size() > 2 * kStderrTailBytes) {
        finished.errors.erase(0, finished.errors.size() - kStderrTailBytes);
      }
    }
  }
  finished.wait_status = child.Wait();
  return finished;
}

absl::StatusOr<ImportedTolerances> ImportStep(const std::string& file,
                                              const ToleranceImportOptions& options) {
  fs::path program = options.step_import_program;
  if (program.empty()) {
    std::error_code error;
    program = fs::read_symlink("/proc/self/exe", error).parent_path() / kProgram;
  }
  if (access(program.c_str(), X_OK) != 0) {
    return absl::NotFoundError(absl::StrCat(file, ": STEP is read by the program ", kProgram,
                                            ", and there is no executable ", program.string(),
                                            "; build the target ", kProgram,
                                            " (CMake option SIGHTLINE_BUILD_STEP_IMPORT)"));
  }
  // Absolute, so that no name is taken for an option.
  auto finished =
      Run(program.string(), {fs::absolute(file).string(), "--tolerances", "-"}, options.time_limit);
  if (!finished.ok()) {
    return absl::Status(finished.status().code(),
                        absl::StrCat(file, ": ", std::string(finished.status().message())));
  }
  absl::StripAsciiWhitespace(&finished->errors);
  const int status = finished->wait_status;
  if (WIFSIGNALED(status)) {
    return absl::InternalError(absl::StrCat(file, ": ", kProgram, " was killed by signal ",
                                            WTERMSIG(status), ": ", finished->errors));
  }
  if (WEXITSTATUS(status) != 0) {
    const std::string message(absl::StripPrefix(finished->errors, absl::StrCat(kProgram, ": ")));
    // 2: the input is wrong, and the message names it.
    if (WEXITSTATUS(status) == 2) return absl::InvalidArgumentError(message);
    return absl::InternalError(absl::StrCat(file, ": ", kProgram, " ended with exit code ",
                                            WEXITSTATUS(status), ": ", message));
  }
  v1::ToleranceReport message;
  if (absl::Status parsed = ParseStrictJson(
          finished->output, absl::StrCat("output of ", kProgram, " for ", file), &message);
      !parsed.ok()) {
    return absl::InternalError(std::string(parsed.message()));
  }
  ImportedTolerances imported;
  auto report = ToleranceReportFromProto(message);
  auto faces = FacesFromProto(message);
  for (const absl::Status& wrong : {report.status(), faces.status()}) {
    if (!wrong.ok()) {
      return absl::InternalError(
          absl::StrCat("output of ", kProgram, " for ", file, ": ", std::string(wrong.message())));
    }
  }
  imported.report = *std::move(report);
  imported.faces = *std::move(faces);
  return imported;
}

}  // namespace

absl::StatusOr<ImportedTolerances> ImportTolerances(const std::string& file,
                                                    const ToleranceImportOptions& options) {
  const std::string suffix = absl::AsciiStrToLower(fs::path(file).extension().string());
  const bool step = suffix == ".stp" || suffix == ".step" || suffix == ".p21";
  if (!step && suffix != ".qif") {
    return absl::InvalidArgumentError(absl::StrCat(
        file, ": tolerances are read from STEP (.stp, .step, .p21) and QIF (.qif) files only"));
  }
  std::error_code error;
  if (!fs::is_regular_file(file, error)) return absl::NotFoundError(file + ": no such file");
  if (step) return ImportStep(file, options);
  auto report = ReadQif(file, options.qif_schema_folder);
  if (!report.ok()) return report.status();
  return ImportedTolerances{*std::move(report), {}};
}

}  // namespace sightline
