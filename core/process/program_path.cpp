// SPDX-License-Identifier: Apache-2.0
#include "core/process/program_path.h"

#include <unistd.h>

#include <algorithm>
#include <system_error>

namespace sightline {
namespace {

namespace fs = std::filesystem;

// cmake/Install.cmake installs by these names.
constexpr char kBinFolder[] = "bin";
constexpr char kLibexecFolder[] = "libexec/sightline";

// PREFIX of an executable in PREFIX/bin or PREFIX/libexec/sightline; otherwise empty.
fs::path InstallPrefix(const fs::path& own) {
  const fs::path folder = own.parent_path();
  if (folder.filename() == kBinFolder) return folder.parent_path();
  const fs::path above = folder.parent_path();
  if (above.filename() / folder.filename() == kLibexecFolder) return above.parent_path();
  return {};
}

bool IsExecutableFile(const fs::path& path) {
  std::error_code error;
  return fs::is_regular_file(path, error) && access(path.c_str(), X_OK) == 0;
}

}  // namespace

fs::path OwnProgram() {
  std::error_code error;
  return fs::read_symlink("/proc/self/exe", error);
}

std::vector<fs::path> ProgramFolders(const fs::path& own) {
  std::vector<fs::path> folders = {own.parent_path()};
  if (const fs::path prefix = InstallPrefix(own); !prefix.empty()) {
    for (const char* folder : {kBinFolder, kLibexecFolder}) {
      if (std::find(folders.begin(), folders.end(), prefix / folder) == folders.end()) {
        folders.push_back(prefix / folder);
      }
    }
  }
  return folders;
}

fs::path FindProgram(std::string_view name) {
  const std::vector<fs::path> folders = ProgramFolders(OwnProgram());
  for (const fs::path& folder : folders) {
    if (IsExecutableFile(folder / name)) return folder / name;
  }
  return folders.front() / name;
}

fs::path InstalledDataFolder() {
  const fs::path own = OwnProgram();
  const fs::path prefix = InstallPrefix(own);
  return (prefix.empty() ? own.parent_path().parent_path() : prefix) / "share/sightline";
}

}  // namespace sightline
