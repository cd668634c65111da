// SPDX-License-Identifier: Apache-2.0
// 16-bit greyscale PNG for tests. (In a file of its own: headers of OpenImageIO and protobuf 3.21
// do not go together in this order.)
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace sightline {

bool WritePng16(const std::string& path, int columns, int rows,
                const std::vector<uint16_t>& numbers);

}  // namespace sightline
