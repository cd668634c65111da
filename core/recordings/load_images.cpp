#include "core/recordings/load_images.h"

#include <png.h>

#include <array>
#include <bit>
#include <cerrno>
#include <csetjmp>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sightline {
namespace {

using File = std::unique_ptr<std::FILE, int (*)(std::FILE*)>;

// By the first bytes, whatever the name says.
enum class FileType { kPng, kTiff, kJpeg, kOther };

FileType TypeOf(std::string_view head) {
  const auto starts = [&](std::string_view magic) { return head.substr(0, magic.size()) == magic; };
  if (starts("\x89PNG\r\n\x1a\n")) return FileType::kPng;
  if (starts("\xff\xd8\xff") || head.substr(4, 4) == "jP  ") return FileType::kJpeg;
  if (starts(std::string_view("II*\0", 4)) || starts(std::string_view("MM\0*", 4)) ||
      starts(std::string_view("II+\0", 4)) || starts(std::string_view("MM\0+", 4))) {
    return FileType::kTiff;
  }
  return FileType::kOther;
}

void KeepMessage(png_structp png, png_const_charp message) {
  *static_cast<std::array<char, 128>*>(png_get_error_ptr(png)) = {};
  std::strncpy(static_cast<std::array<char, 128>*>(png_get_error_ptr(png))->data(), message, 127);
  png_longjmp(png, 1);
}

void IgnoreWarning(png_structp, png_const_charp) {}

struct PngHeader {
  png_uint_32 columns = 0, rows = 0;
  int bits = 0, colour_type = 0;
};

// libpng leaves by longjmp, so nothing here has a destructor. `begin` is called with the header and
// returns the rows to read into (nullptr: do not go on); rows of 16-bit or 8-bit samples.
bool ReadPng(std::FILE* file, std::array<char, 128>* message, PngHeader* header,
             png_bytep* (*begin)(const PngHeader&, void*), void* context) {
  png_structp png =
      png_create_read_struct(PNG_LIBPNG_VER_STRING, message, KeepMessage, IgnoreWarning);
  png_infop info = png == nullptr ? nullptr : png_create_info_struct(png);
  if (info == nullptr) {
    png_destroy_read_struct(&png, nullptr, nullptr);
    return false;
  }
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_init_io(png, file);
  png_read_info(png, info);
  png_get_IHDR(png, info, &header->columns, &header->rows, &header->bits, &header->colour_type,
               nullptr, nullptr, nullptr);
  png_bytep* rows = begin(*header, context);
  if (rows != nullptr) {
    if (header->bits == 16 && std::endian::native == std::endian::little) png_set_swap(png);
    png_read_image(png, rows);
    png_read_end(png, nullptr);
  }
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

// What ReadPng reads into, or why not.
struct PngImage {
  std::string refused;
  Image<uint16_t> wide;
  std::vector<uint8_t> narrow;
  std::vector<png_bytep> rows;
};

png_bytep* BeginPng(const PngHeader& header, void* context) {
  PngImage& image = *static_cast<PngImage*>(context);
  constexpr png_uint_32 kMaxSidePx = 1 << 16;
  if (header.colour_type != PNG_COLOR_TYPE_GRAY) {
    image.refused = header.colour_type == PNG_COLOR_TYPE_GRAY_ALPHA ? "has transparency"
                    : header.colour_type == PNG_COLOR_TYPE_PALETTE  ? "has a palette"
                                                                    : "is a colour image";
    image.refused += ", must be greyscale with the numbers as read out (no demosaicing)";
  } else if (header.bits != 16 && header.bits != 8) {
    image.refused =
        absl::StrCat("has ", header.bits, " bits a pixel: record raw numbers in 16-bit files");
  } else if (header.columns > kMaxSidePx || header.rows > kMaxSidePx) {
    image.refused = absl::StrCat("is ", header.columns, " x ", header.rows, " px, too large");
  }
  if (!image.refused.empty()) return nullptr;
  image.wide = Image<uint16_t>(static_cast<int>(header.columns), static_cast<int>(header.rows));
  if (header.bits == 8) image.narrow.resize(image.wide.values.size());
  for (png_uint_32 row = 0; row < header.rows; ++row) {
    image.rows.push_back(header.bits == 8
                             ? image.narrow.data() + static_cast<size_t>(row) * header.columns
                             : reinterpret_cast<png_bytep>(image.wide.Row(static_cast<int>(row))));
  }
  return image.rows.data();
}

absl::StatusOr<Image<uint16_t>> LoadPng(std::FILE* file, const std::string& path, int* file_bits) {
  PngImage image;
  PngHeader header;
  std::array<char, 128> message{};
  const bool ok = ReadPng(file, &message, &header, BeginPng, &image);
  if (!image.refused.empty()) {
    return absl::InvalidArgumentError(absl::StrCat(path, ": ", image.refused));
  }
  if (!ok) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": is damaged: ", std::string(message.data())));
  }
  *file_bits = header.bits;
  for (size_t i = 0; i < image.narrow.size(); ++i) image.wide.values[i] = image.narrow[i];
  return std::move(image.wide);
}

// `file_bits`: 8 or 16, of PNG files.
absl::StatusOr<Image<uint16_t>> LoadImage(const std::string& path, const RawImageReader& read_other,
                                          int* file_bits) {
  std::error_code ignored;
  const File file(std::fopen(path.c_str(), "rb"), std::fclose);
  if (file == nullptr || std::filesystem::is_directory(path, ignored)) {
    return absl::NotFoundError(absl::StrCat(
        path, ": ", file == nullptr ? std::strerror(errno) : "is a folder, must be an image"));
  }
  std::array<char, 12> head{};
  const size_t size = std::fread(head.data(), 1, head.size(), file.get());
  std::rewind(file.get());
  if (size == 0) return absl::InvalidArgumentError(absl::StrCat(path, ": is empty"));
  switch (TypeOf({head.data(), size})) {
    case FileType::kPng:
      return LoadPng(file.get(), path, file_bits);
    case FileType::kTiff:
      if (read_other) return read_other(path);
      return absl::InvalidArgumentError(
          absl::StrCat(path, ": is a TIFF file; only 16-bit greyscale PNG is read here"));
    case FileType::kJpeg:
      return absl::InvalidArgumentError(
          absl::StrCat(path,
                       ": is a JPEG file: its compression has changed the numbers; record "
                       "raw numbers in 16-bit greyscale PNG or TIFF"));
    case FileType::kOther:
      break;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": is neither a PNG nor a TIFF file, must be 16-bit greyscale"));
}

}  // namespace

absl::StatusOr<Image<uint16_t>> LoadRawImage(const std::string& path, int bit_depth_bit,
                                             const RawImageReader& read_other) {
  int file_bits = 16;
  auto image = LoadImage(path, read_other, &file_bits);
  if (image.ok() && file_bits == 8 && bit_depth_bit > 8) {
    return absl::InvalidArgumentError(
        absl::StrCat(path, ": has 8 bits a pixel, but the camera has ", bit_depth_bit,
                     ": record raw numbers in 16-bit files"));
  }
  return image;
}

LoadedImages LoadRecordedImages(const RecordingSet& set, const std::vector<std::string>& paths,
                                const RawImageReader& read_other) {
  LoadedImages loaded;
  std::vector<Image<uint16_t>>& images = loaded.raw_dn;
  std::vector<std::string>* const errors = &loaded.errors;
  images.resize(set.recordings.size());
  std::vector<std::string> narrow;
  for (size_t i = 0; i < images.size(); ++i) {
    const RecordedImage& recording = set.recordings[i];
    if (i >= paths.size()) {
      errors->push_back(absl::StrCat(recording.file, ": recordings[", i, "].file is missing"));
      continue;
    }
    int file_bits = 16;
    auto image = LoadImage(paths[i], read_other, &file_bits);
    if (image.ok() && file_bits == 8 && set.camera.bit_depth_bit > 8) {
      narrow.push_back(recording.file);
    }
    if (absl::IsNotFound(image.status())) {
      errors->push_back(absl::StrCat(recording.file, ": recordings[", i,
                                     "].file is missing: ", image.status().message()));
    } else if (!image.ok()) {
      errors->push_back(absl::StrCat("recordings[", i, "].file: ", image.status().message()));
    } else if (image->columns_px != recording.roi_columns_px ||
               image->rows_px != recording.roi_rows_px) {
      errors->push_back(absl::StrCat(
          recording.file, ": is ", image->columns_px, " x ", image->rows_px, " px, but recordings[",
          i, "].roi_columns_px and roi_rows_px are ", recording.roi_columns_px, " and ",
          recording.roi_rows_px, ": wrong region of interest, or another image"));
    } else {
      images[i] = *std::move(image);
    }
  }
  // Of one camera all or none.
  if (!narrow.empty() && narrow.size() == images.size()) {
    loaded.eight_bit_files = true;
  } else if (!narrow.empty()) {
    errors->push_back(absl::StrCat(
        narrow.front(), ": has 8 bits a pixel, but others have 16",
        narrow.size() > 1 ? absl::StrCat(" (like ", narrow.size() - 1, " more)") : std::string(),
        ": record raw numbers of camera.bit_depth_bit = ", set.camera.bit_depth_bit));
  }
  return loaded;
}

}  // namespace sightline
