// SPDX-License-Identifier: Apache-2.0
// Description of the HTTP contract for programs.
#pragma once

#include <string>

namespace sightline {

// OpenAPI 3.0.3: the paths of openapi.json, with schemas generated from the messages that the
// service reads and writes, so that schemas and messages always agree.
std::string OpenApiJson();

}  // namespace sightline
