// SPDX-License-Identifier: Apache-2.0
#include "render_worker/image_file/image_file.h"

// clang-format off: before OpenImageIO, whose macros of byte order would hide what protobuf needs.
// clang-format on

#include <OpenImageIO/filesystem.h>
#include <OpenImageIO/imageio.h>
#include <unistd.h>

#include <algorithm>
#include <cassert>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"

namespace sightline {
namespace {

// TIFF's code for an unknown time; otherwise the library would write the current time.
constexpr char kUnknownTime[] = "    :  :     :  :  ";

absl::Status WriteError(const std::string& path, const std::string& reason) {
  const std::string message = absl::StrCat(path, ": cannot be written: ", reason);
  const bool no_room = errno == ENOSPC || errno == EDQUOT || errno == EFBIG;
  return no_room ? absl::ResourceExhaustedError(message) : absl::InternalError(message);
}

// Whether a file can be read from its first to its last pixel.
bool IsWhole(const std::string& path) {
  const std::unique_ptr<OIIO::ImageInput> file = OIIO::ImageInput::open(path);
  if (file == nullptr) return false;
  const OIIO::ImageSpec& spec = file->spec();
  std::vector<char> pixels(spec.image_bytes(/*native=*/true));
  return file->read_image(0, 0, 0, spec.nchannels, OIIO::TypeDesc::UNKNOWN, pixels.data());
}

// For formats that cannot be made in memory. Their writers do not report a full disk at the end, so
// the written file is read again.
absl::Status WriteThroughFile(OIIO::ImageOutput& file, const std::string& path,
                              const OIIO::ImageSpec& spec, const OIIO::TypeDesc& type,
                              const void* data) {
  const std::string temporary =
      absl::StrCat(path, ".part-", getpid(), std::filesystem::path(path).extension().string());
  errno = 0;
  bool ok = file.open(temporary, spec);
  ok = ok && file.write_image(type, data);
  const std::string reason = ok ? "" : file.geterror();
  ok = file.close() && ok;
  const int error = errno;
  ok = ok && IsWhole(temporary);
  if (ok && std::rename(temporary.c_str(), path.c_str()) == 0) return absl::OkStatus();
  std::error_code ignored;
  const auto space = std::filesystem::space(std::filesystem::path(path).parent_path(), ignored);
  errno = !ignored && space.available == 0 ? ENOSPC : error;
  absl::Status status =
      WriteError(path, !reason.empty() ? reason : std::string(std::strerror(errno)));
  std::remove(temporary.c_str());
  return status;
}

absl::Status Write(const std::string& path, const char* plugin, OIIO::ImageSpec spec,
                   const OIIO::TypeDesc& type, const void* data, const std::string& description) {
  spec.attribute("ImageDescription", description);
  spec.attribute("Software", "sightline");
  spec.attribute("DateTime", kUnknownTime);
  errno = 0;
  const std::unique_ptr<OIIO::ImageOutput> file = OIIO::ImageOutput::create(plugin);
  if (file == nullptr) return WriteError(path, OIIO::geterror());
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  if (!file->supports("ioproxy") || !file->set_ioproxy(&memory)) {
    return WriteThroughFile(*file, path, spec, type, data);
  }
  bool ok = file->open(path, spec);
  ok = ok && file->write_image(type, data);
  const std::string reason = ok ? "" : file->geterror();
  ok = file->close() && ok;
  if (!ok) return WriteError(path, reason);
  return WriteFileAtomically(path, std::string(bytes.begin(), bytes.end()));
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
