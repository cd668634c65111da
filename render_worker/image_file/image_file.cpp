#include "render_worker/image_file/image_file.h"

#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

// TIFF's way to say that it is not known; the library would write the time of day.
constexpr char kUnknownTime[] = "    :  :     :  :  ";

absl::Status WriteError(const std::string& path, const std::string& reason) {
  const std::string message = absl::StrCat(path, ": cannot be written: ", reason);
  const bool no_room = errno == ENOSPC || errno == EDQUOT || errno == EFBIG;
  return no_room ? absl::ResourceExhaustedError(message) : absl::InternalError(message);
}

absl::Status Write(const std::string& path, const char* plugin, OIIO::ImageSpec spec,
                   OIIO::TypeDesc type, const void* data, const std::string& description) {
  spec.attribute("ImageDescription", description);
  spec.attribute("Software", "sightline");
  spec.attribute("DateTime", kUnknownTime);
  const std::string temporary = absl::StrCat(path, ".part-", getpid());
  errno = 0;
  const std::unique_ptr<OIIO::ImageOutput> file = OIIO::ImageOutput::create(plugin);
  if (file == nullptr) return WriteError(path, OIIO::geterror());
  bool ok = file->open(temporary, spec);
  ok = ok && file->write_image(type, data);
  const std::string reason = ok ? "" : file->geterror();
  ok = file->close() && ok;
  if (ok && std::rename(temporary.c_str(), path.c_str()) == 0) return absl::OkStatus();
  const absl::Status status =
      WriteError(path, !reason.empty() ? reason : std::string(std::strerror(errno)));
  std::remove(temporary.c_str());
  return status;
}

const char* Plugin(ImageFormat format) { return format == ImageFormat::kPng ? "png" : "tiff"; }

}  // namespace

const char* FileExtension(ImageFormat format) {
  return format == ImageFormat::kPng ? ".png" : ".tif";
}

absl::Status WriteRawImage(const std::string& path, const Image<uint16_t>& raw_dn,
                           const std::string& description, ImageFormat format) {
  OIIO::ImageSpec spec(raw_dn.columns_px, raw_dn.rows_px, 1, OIIO::TypeDesc::UINT16);
  return Write(path, Plugin(format), spec, OIIO::TypeDesc::UINT16, raw_dn.values.data(),
               description);
}

absl::Status WriteColourImage(const std::string& path, const std::array<Image<float>, 3>& image_dn,
                              const std::string& description, ImageFormat format) {
  std::vector<uint16_t> interleaved(3 * image_dn[0].values.size());
  for (int channel = 0; channel < 3; ++channel) {
    assert(image_dn[channel].values.size() == image_dn[0].values.size());
    for (size_t i = 0; i < image_dn[0].values.size(); ++i) {
      interleaved[3 * i + channel] =
          static_cast<uint16_t>(std::clamp(std::round(image_dn[channel].values[i]), 0.F, 65535.F));
    }
  }
  OIIO::ImageSpec spec(image_dn[0].columns_px, image_dn[0].rows_px, 3, OIIO::TypeDesc::UINT16);
  return Write(path, Plugin(format), spec, OIIO::TypeDesc::UINT16, interleaved.data(), description);
}

absl::Status WriteLayers(const std::string& path, const std::vector<ImageLayer>& layers,
                         const std::string& description) {
  assert(!layers.empty());
  const Image<float>& first = *layers.front().image;
  const size_t channels = layers.size();
  std::vector<float> interleaved(channels * first.values.size());
  OIIO::ImageSpec spec(first.columns_px, first.rows_px, static_cast<int>(channels),
                       OIIO::TypeDesc::FLOAT);
  spec.channelnames.clear();
  for (size_t channel = 0; channel < channels; ++channel) {
    const Image<float>& image = *layers[channel].image;
    assert(image.values.size() == first.values.size());
    spec.channelnames.push_back(layers[channel].name);
    for (size_t i = 0; i < image.values.size(); ++i) {
      interleaved[channels * i + channel] = image.values[i];
    }
  }
  spec.attribute("compression", "zip");
  return Write(path, "openexr", spec, OIIO::TypeDesc::FLOAT, interleaved.data(), description);
}

}  // namespace sightline
