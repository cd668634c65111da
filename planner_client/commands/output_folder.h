// Folders for what commands write.
#pragma once

#include <string>

#include "absl/status/status.h"

namespace sightline {

// Makes the folder and those above it. INVALID_ARGUMENT names the folder and the reason.
absl::Status MakeOutputFolder(const std::string& path);

}  // namespace sightline
