// SPDX-License-Identifier: Apache-2.0
#include "rpc_server/upload.h"

#include <optional>

namespace sightline {

absl::Status GrowUpload(SharedLimit::Share* memory, const std::string& peer, int64_t bytes) {
  const std::optional<Shortage> shortage = memory->Grow(bytes);
  if (!shortage) return absl::OkStatus();
  return WithRetryDelay(
      WithErrorInfo(absl::UnavailableError(absl::StrCat(
                        "overloaded: ", shortage->of_owner ? peer + " is" : "clients are",
                        " uploading ", shortage->held, " bytes already")),
                    "OVERLOADED"),
      absl::Seconds(1));
}

}  // namespace sightline
