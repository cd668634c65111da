// SPDX-License-Identifier: Apache-2.0
#include "planner_client/render_client/finished_images.h"

#include <google/protobuf/io/coded_stream.h>
#include <google/protobuf/io/zero_copy_stream_impl_lite.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/digest/sha256.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

// The key digests request and worker. Equal requests have equal bytes, whatever order their maps
// are in.
std::string RequestDigest(const v1::RenderSpec& spec, const std::string& worker_build) {
  std::string bytes;
  {
    google::protobuf::io::StringOutputStream stream(&bytes);
    google::protobuf::io::CodedOutputStream coded(&stream);
    coded.SetSerializationDeterministic(true);
    spec.SerializeToCodedStream(&coded);
  }
  return Sha256Hex(bytes + worker_build);
}

bool HasDigest(const fs::path& path, const std::string& sha256) {
  const auto digest = DigestOfFile(path.string());
  return digest.ok() && digest->sha256 == sha256;
}

// A line as it is written: {"image":3,"files":[["images/003.png","ab12..."]]}.
bool IsImageLine(const json& line) {
  if (!line.is_object() || !line.contains("image") || !line["image"].is_number_integer() ||
      !line.contains("files") || !line["files"].is_array()) {
    return false;
  }
  return std::all_of(line["files"].begin(), line["files"].end(), [](const json& file) {
    return file.is_array() && file.size() == 2 && file[0].is_string() && file[1].is_string();
  });
}

std::string FilesText(const json& line) {
  std::string text;
  for (const json& file : line["files"]) {
    absl::StrAppend(&text, text.empty() ? "" : ", ", file[0].get<std::string>());
  }
  return text;
}

// The list itself first, if it is there, then the others in the order of their names.
std::vector<fs::path> ListsLike(const std::string& file) {
  const fs::path own(file);
  std::vector<fs::path> lists;
  std::error_code error;
  for (auto entry = fs::directory_iterator(own.parent_path(), error);
       !error && entry != fs::directory_iterator(); entry.increment(error)) {
    if (absl::StartsWith(entry->path().filename().string(), own.filename().string())) {
      lists.push_back(entry->path());
    }
  }
  std::sort(lists.begin(), lists.end());
  return lists;
}

}  // namespace

absl::StatusOr<FinishedImages> FinishedImages::Open(const std::string& file,
                                                    const std::string& folder,
                                                    const v1::RenderSpec& spec,
                                                    const std::string& worker_build) {
  FinishedImages finished;
  const std::string start = json({{"request", RequestDigest(spec, worker_build)}}).dump() + "\n";
  std::string kept = start;
  std::set<int> seen;
  std::map<int, std::string> remade;  // files of images that are not whole
  for (const fs::path& path : ListsLike(file)) {
    std::ifstream list(path, std::ios::binary);
    std::string text;
    std::getline(list, text);
    const bool same = list && text + "\n" == start;
    // Another process is about to write a list without a first line.
    if (!same && list) {
      finished.remarks_.push_back(absl::StrCat(path.string(),
                                               ": its images are of another request or another "
                                               "build of the render worker; they are made "
                                               "again"));
    }
    while (same && std::getline(list, text) && !list.eof()) {
      const json line = json::parse(text, nullptr, /*allow_exceptions=*/false);
      if (!IsImageLine(line)) break;
      const int image = line["image"].get<int>();
      if (seen.contains(image)) continue;
      const bool whole =
          std::all_of(line["files"].begin(), line["files"].end(), [&](const json& entry) {
            return HasDigest(fs::path(folder) / entry[0].get<std::string>(),
                             entry[1].get<std::string>());
          });
      if (!whole) {
        remade.emplace(image, FilesText(line));
        continue;
      }
      seen.insert(image);
      finished.images_.push_back(image);
      for (const json& entry : line["files"]) {
        finished.files_.push_back(entry[0].get<std::string>());
      }
      absl::StrAppend(&kept, text, "\n");
    }
  }
  std::sort(finished.images_.begin(), finished.images_.end());
  for (const auto& [image, files] : remade) {
    if (seen.contains(image)) continue;  // another list has it whole
    finished.remarks_.push_back(absl::StrCat(
        file, ": kept image ", image, " (", files,
        ") is gone from its folder or has other bytes than it was written with; it is made again"));
  }
  std::error_code error;
  fs::create_directories(fs::path(file).parent_path(), error);
  finished.list_.open(file, std::ios::binary | std::ios::trunc);
  finished.list_ << kept << std::flush;
  if (!finished.list_) return absl::InternalError(absl::StrCat(file, ": cannot be written"));
  return finished;
}

void FinishedImages::AddFile(int image, const std::string& file, const std::string& sha256) {
  if (image != current_ && current_ >= 0) {
    json files = json::array();
    for (const ImageFile& entry : current_files_) files.push_back({entry.file, entry.sha256});
    list_ << json({{"image", current_}, {"files", files}}).dump() + "\n" << std::flush;
    current_files_.clear();
  }
  current_ = image;
  current_files_.push_back({file, sha256});
}

}  // namespace sightline
