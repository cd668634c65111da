// SPDX-License-Identifier: Apache-2.0
// The page of `sightline explore`: files that are handed out as they are.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace sightline {

struct ExplorePageFile {
  std::string path;  // of the URL
  std::string content_type;
  std::string_view bytes;
};

// It loads nothing from elsewhere; all addresses in it are relative.
const std::vector<ExplorePageFile>& ExplorePage();

}  // namespace sightline
