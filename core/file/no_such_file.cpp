// SPDX-License-Identifier: Apache-2.0
#include "core/file/no_such_file.h"

#include <filesystem>
#include <system_error>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"

namespace sightline {

std::string NameInOtherCase(const std::string& path) {
  namespace fs = std::filesystem;
  constexpr int kMostNames = 4096;
  const fs::path wanted(path);
  const std::string name = wanted.filename().string();
  const fs::path folder = wanted.parent_path();
  std::error_code error;
  fs::directory_iterator entry(folder.empty() ? fs::path(".") : folder, error);
  for (int i = 0; !error && entry != fs::directory_iterator() && i < kMostNames;
       entry.increment(error), ++i) {
    const std::string there = entry->path().filename().string();
    if (there != name && absl::EqualsIgnoreCase(there, name)) {
      return absl::StrCat(" (no such file, but \"", there, "\" is in its folder)");
    }
  }
  return "";
}

}  // namespace sightline
