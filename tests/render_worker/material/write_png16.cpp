// SPDX-License-Identifier: Apache-2.0
#include "tests/render_worker/material/write_png16.h"

#include <OpenImageIO/imageio.h>

namespace sightline {

bool WritePng16(const std::string& path, int columns, int rows,
                const std::vector<uint16_t>& numbers) {
  const auto output = OIIO::ImageOutput::create(path);
  return output != nullptr &&
         output->open(path, OIIO::ImageSpec(columns, rows, 1, OIIO::TypeDesc::UINT16)) &&
         output->write_image(OIIO::TypeDesc::UINT16, numbers.data()) && output->close();
}

}  // namespace sightline
