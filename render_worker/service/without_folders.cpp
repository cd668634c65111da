// SPDX-License-Identifier: Apache-2.0
#include "render_worker/service/without_folders.h"

#include "absl/strings/cord.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/string_view.h"

namespace sightline {

std::string WithoutFolders(const std::string& message, const std::vector<std::string>& folders) {
  std::string renamed = message;
  for (const std::string& folder : folders) {
    renamed = absl::StrReplaceAll(renamed, {{absl::StrCat(folder, "/"), ""}});
    renamed = absl::StrReplaceAll(renamed, {{folder, "the folder of the job"}});
  }
  return renamed;
}

absl::Status WithoutFolders(const absl::Status& status, const std::vector<std::string>& folders) {
  if (status.ok()) return status;
  absl::Status renamed(status.code(), WithoutFolders(std::string(status.message()), folders));
  status.ForEachPayload([&renamed](absl::string_view type_url, const absl::Cord& payload) {
    renamed.SetPayload(type_url, payload);
  });
  return renamed;
}

}  // namespace sightline
