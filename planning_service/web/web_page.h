// SPDX-License-Identifier: Apache-2.0
// The web page of `sightline serve`: files that the HTTP front end serves as they are.
#pragma once

#include <string>
#include <vector>

namespace sightline {

struct WebPageFile {
  std::string path;  // of the URL: "/" or "/assets/page.js"
  std::string content_type;
  std::string bytes;
};

// Everything that the page consists of. It loads nothing from elsewhere: it works with the header
// "Content-Security-Policy: default-src 'self'". All addresses in it are relative.
std::vector<WebPageFile> WebPage();

}  // namespace sightline
