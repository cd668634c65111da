// SPDX-License-Identifier: Apache-2.0
// Files of the `sightline explore` page, served unchanged.
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

// The page loads nothing from elsewhere; all its addresses are relative.
const std::vector<ExplorePageFile>& ExplorePage();

}  // namespace sightline
