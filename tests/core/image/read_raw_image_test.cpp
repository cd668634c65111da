// SPDX-License-Identifier: Apache-2.0
#include "core/image/read_raw_image.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <png.h>
#include <sys/stat.h>
#include <tiffio.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::HasSubstr;

struct TiffForm {
  uint16_t compression = COMPRESSION_NONE;
  uint32_t rows_per_strip = 0;  // 0: all rows
  uint32_t tile_px = 0;         // 0: strips
  uint16_t bits = 16, samples = 1, photometric = PHOTOMETRIC_MINISBLACK;
  const char* mode = "w";  // "wb": big-endian
};

class RawImageTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / absl::StrCat("raw_image_", getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  std::string Path(const std::string& name) const { return (folder_ / name).string(); }

  static Image<uint16_t> Noise(int columns, int rows) {
    std::mt19937 random(5);
    Image<uint16_t> image(columns, rows);
    for (uint16_t& value : image.values) value = static_cast<uint16_t>(random() % 4096 + 1);
    return image;
  }

  std::string WriteTiff(const std::string& name, const Image<uint16_t>& image,
                        const TiffForm& form) const {
    TIFF* tiff = TIFFOpen(Path(name).c_str(), form.mode);
    TIFFSetField(tiff, TIFFTAG_IMAGEWIDTH, image.columns_px);
    TIFFSetField(tiff, TIFFTAG_IMAGELENGTH, image.rows_px);
    TIFFSetField(tiff, TIFFTAG_BITSPERSAMPLE, form.bits);
    TIFFSetField(tiff, TIFFTAG_SAMPLESPERPIXEL, form.samples);
    TIFFSetField(tiff, TIFFTAG_PHOTOMETRIC, form.photometric);
    TIFFSetField(tiff, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tiff, TIFFTAG_COMPRESSION, form.compression);
    if (form.tile_px > 0) {
      TIFFSetField(tiff, TIFFTAG_TILEWIDTH, form.tile_px);
      TIFFSetField(tiff, TIFFTAG_TILELENGTH, form.tile_px);
      std::vector<uint16_t> tile(size_t{form.tile_px} * form.tile_px);
      for (int row = 0; row < image.rows_px; row += static_cast<int>(form.tile_px)) {
        for (int column = 0; column < image.columns_px; column += static_cast<int>(form.tile_px)) {
          for (uint32_t r = 0; r < form.tile_px; ++r) {
            for (uint32_t c = 0; c < form.tile_px; ++c) {
              const int y = row + static_cast<int>(r), x = column + static_cast<int>(c);
              const bool inside = y < image.rows_px && x < image.columns_px;
              tile[r * form.tile_px + c] = inside ? image.At(y, x) : 0;
            }
          }
          TIFFWriteTile(tiff, tile.data(), static_cast<uint32_t>(column),
                        static_cast<uint32_t>(row), 0, 0);
        }
      }
    } else {
      TIFFSetField(
          tiff, TIFFTAG_ROWSPERSTRIP,
          form.rows_per_strip > 0 ? form.rows_per_strip : static_cast<uint32_t>(image.rows_px));
      std::vector<uint8_t> narrow(static_cast<size_t>(image.columns_px));
      std::vector<uint16_t> wide(static_cast<size_t>(image.columns_px) * form.samples);
      for (int row = 0; row < image.rows_px; ++row) {
        const uint16_t* values = image.Row(row);
        std::copy_n(values, image.columns_px, narrow.begin());
        for (size_t i = 0; i < wide.size(); ++i) wide[i] = values[i / form.samples];
        void* data = form.bits == 8 ? static_cast<void*>(narrow.data()) : wide.data();
        TIFFWriteScanline(tiff, data, static_cast<uint32_t>(row), 0);
      }
    }
    TIFFClose(tiff);
    return Path(name);
  }
  static std::string Bytes(const std::string& path) {
    std::ostringstream bytes;
    bytes << std::ifstream(path, std::ios::binary).rdbuf();
    return bytes.str();
  }
  std::string WriteBytes(const std::string& name, const std::string& bytes) const {
    std::ofstream(Path(name), std::ios::binary) << bytes;
    return Path(name);
  }
  static std::string ErrorOf(const std::string& path, const ImageSizeCheck& check = {}) {
    return WithinLimits({.cpu_time_s = 3, .memory_bytes = int64_t{200} << 20}, [&] {
      const auto image = ReadRawImageFile(path, check);
      if (image.ok()) return std::string("read");
      if (!absl::IsInvalidArgument(image.status())) return image.status().ToString();
      return std::string(image.status().message());
    });
  }

  fs::path folder_;
};

TEST_F(RawImageTest, EveryLosslessTiffGivesItsNumbers) {
  const Image<uint16_t> image = Noise(75, 50);
  for (const TiffForm& form :
       std::vector<TiffForm>{{},
                             {.rows_per_strip = 7},
                             {.mode = "wb"},
                             {.mode = "w8"},
                             {.tile_px = 16},
                             {.compression = COMPRESSION_ADOBE_DEFLATE, .rows_per_strip = 8},
                             {.compression = COMPRESSION_LZW},
                             {.compression = COMPRESSION_PACKBITS, .mode = "wb"},
                             {.compression = COMPRESSION_LZW, .tile_px = 32, .mode = "wb"}}) {
    const auto read = ReadRawImageFile(WriteTiff("a.tif", image, form));
    ASSERT_TRUE(read.ok()) << read.status();
    EXPECT_EQ(read->raw_dn, image) << form.compression << form.mode;
    EXPECT_EQ(read->file_bits, 16);
  }
  const auto narrow = ReadRawImageFile(WriteTiff("b.tif", Image<uint16_t>(9, 5, 200), {.bits = 8}));
  ASSERT_TRUE(narrow.ok()) << narrow.status();
  EXPECT_EQ(narrow->raw_dn, Image<uint16_t>(9, 5, 200));
  EXPECT_EQ(narrow->file_bits, 8);
}

// A reader for pictures gives zeros for what is missing, which pass for dark pixels.
TEST_F(RawImageTest, TruncatedTiffIsRefusedWhereverItEnds) {
  const Image<uint16_t> image = Noise(384, 256);
  for (const TiffForm& form :
       std::vector<TiffForm>{{},
                             {.rows_per_strip = 16},
                             {.tile_px = 64},
                             {.compression = COMPRESSION_ADOBE_DEFLATE},
                             {.compression = COMPRESSION_ADOBE_DEFLATE, .rows_per_strip = 16},
                             {.compression = COMPRESSION_LZW, .rows_per_strip = 16},
                             {.compression = COMPRESSION_PACKBITS}}) {
    std::string bytes = Bytes(WriteTiff("whole.tif", image, form));
    // The list of what is in the file is behind the pixels; with it in front, cuts hit the pixels.
    std::vector<std::string> files = {bytes};
    const auto offset = static_cast<uint32_t>(
        static_cast<unsigned char>(bytes[4]) | static_cast<unsigned char>(bytes[5]) << 8 |
        static_cast<unsigned char>(bytes[6]) << 16 | static_cast<unsigned char>(bytes[7]) << 24);
    ASSERT_LT(offset, bytes.size());
    for (const double share : {0.01, 0.3, 0.5, 0.9}) {
      const auto size = static_cast<size_t>(share * static_cast<double>(bytes.size()));
      EXPECT_THAT(ErrorOf(WriteBytes("cut.tif", bytes.substr(0, size))),
                  AllOf(HasSubstr("cut.tif"), HasSubstr("damaged or truncated")))
          << form.compression << " " << form.rows_per_strip << " " << share;
    }
    EXPECT_THAT(ErrorOf(WriteBytes("cut.tif", bytes.substr(0, bytes.size() - 75))),
                HasSubstr("damaged or truncated"));
  }
}

// As OpenImageIO and most cameras write it: the list in front of the pixels.
std::string TiffWithListInFront(uint32_t columns, uint32_t rows, size_t pixel_bytes) {
  std::string bytes("II*\0\x08\0\0\0", 8);
  const auto add16 = [&](uint32_t value) {
    bytes += static_cast<char>(value & 255);
    bytes += static_cast<char>(value >> 8 & 255);
  };
  const auto add32 = [&](uint32_t value) {
    add16(value & 65535);
    add16(value >> 16);
  };
  const std::vector<std::array<uint32_t, 3>> entries = {
      {256, 4, columns},
      {257, 4, rows},
      {258, 3, 16},
      {259, 3, 1},
      {262, 3, 1},
      {273, 4, 8 + 2 + 9 * 12 + 4},
      {277, 3, 1},
      {278, 4, rows},
      {279, 4, static_cast<uint32_t>(uint64_t{2} * columns * rows)}};
  add16(static_cast<uint32_t>(entries.size()));
  for (const auto& [tag, type, value] : entries) {
    add16(tag);
    add16(type);
    add32(1);
    add32(value);
  }
  add32(0);
  return bytes + std::string(pixel_bytes, '\x07');
}

TEST_F(RawImageTest, PixelsThatAreMissingAreNotTakenForZeros) {
  const std::string whole = TiffWithListInFront(384, 256, size_t{2} * 384 * 256);
  const auto read = ReadRawImageFile(WriteBytes("whole.tif", whole));
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->raw_dn, Image<uint16_t>(384, 256, 0x0707));
  for (const size_t size :
       {whole.size() - 1, whole.size() * 9 / 10, size_t{100'000}, size_t{200}}) {
    EXPECT_THAT(ErrorOf(WriteBytes("cut.tif", whole.substr(0, size))),
                HasSubstr("damaged or truncated"))
        << size;
  }
}

TEST_F(RawImageTest, WhatIsNotRawIsRefused) {
  const Image<uint16_t> image(16, 8, 3);
  EXPECT_THAT(ErrorOf(WriteTiff("a.tif", image, {.samples = 3, .photometric = PHOTOMETRIC_RGB})),
              HasSubstr("3 channels"));
  EXPECT_THAT(ErrorOf(WriteTiff("a.tif", image, {.photometric = PHOTOMETRIC_MINISWHITE})),
              HasSubstr("white as 0"));
  EXPECT_THAT(ErrorOf(WriteTiff("a.tif", image, {.compression = COMPRESSION_JPEG, .bits = 8})),
              HasSubstr("compression 7"));
  EXPECT_THAT(ErrorOf(Path("none.tif")), HasSubstr("NOT_FOUND"));
  EXPECT_THAT(ErrorOf(folder_.string()), HasSubstr("is a folder"));
  ASSERT_EQ(mkfifo(Path("pipe.png").c_str(), 0600), 0);
  EXPECT_THAT(ErrorOf(Path("pipe.png")), HasSubstr("no regular file"));
  EXPECT_THAT(ErrorOf("/dev/zero"), HasSubstr("no regular file"));
}

// 16-bit grey of nothing but zeros; with compressed texts of zeros in front, in as many chunks.
void WriteLargePng(const std::string& path, uint32_t columns, uint32_t rows, int texts = 0,
                   size_t text_bytes = 0) {
  std::FILE* file = std::fopen(path.c_str(), "wb");
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, nullptr, nullptr);
  png_infop info = png_create_info_struct(png);
  png_init_io(png, file);
  png_set_compression_level(png, 1);
  png_set_IHDR(png, info, columns, rows, 16, PNG_COLOR_TYPE_GRAY, PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  std::string key = "Comment", zeros(text_bytes, '0');
  png_text text{};
  text.compression = PNG_TEXT_COMPRESSION_zTXt;
  text.key = key.data();
  text.text = zeros.data();
  text.text_length = zeros.size();
  for (int i = 0; i < texts; ++i) png_set_text(png, info, &text, 1);
  png_write_info(png, info);
  const std::vector<png_byte> row(size_t{2} * columns);
  for (uint32_t i = 0; i < rows; ++i) png_write_row(png, row.data());
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  std::fclose(file);
}

TEST_F(RawImageTest, TheSizeIsLookedAtBeforeAnythingIsMade) {
  const auto must_be_small = [](int columns, int rows) {
    return columns == 32 && rows == 32
               ? absl::OkStatus()
               : absl::InvalidArgumentError(absl::StrCat("is ", columns, " x ", rows));
  };
  EXPECT_THAT(ErrorOf(WriteBytes("a.tif", TiffWithListInFront(40'000, 40'000, 60)), must_be_small),
              HasSubstr("a.tif: is 40000 x 40000"));
  EXPECT_THAT(ErrorOf(WriteBytes("a.tif", TiffWithListInFront(4'000'000'000, 2, 60))),
              HasSubstr("at most 65536 a side"));
  WriteLargePng(Path("a.png"), 20'000, 10'000);
  EXPECT_THAT(ErrorOf(Path("a.png"), must_be_small), HasSubstr("a.png: is 20000 x 10000"));
}

// A text of zeros is a thousandth of its size in the file.
TEST_F(RawImageTest, TextsInPngAreNotUnpacked) {
  WriteLargePng(Path("a.png"), 40, 30, 100, 7'000'000);
  ASSERT_LT(std::filesystem::file_size(Path("a.png")), 8'000'000u);
  EXPECT_EQ(WithinLimits({.cpu_time_s = 2, .memory_bytes = int64_t{100} << 20},
                         [&] {
                           const auto image = ReadRawImageFile(Path("a.png"), {}, {});
                           return image.ok() ? "read" : image.status().ToString();
                         }),
            "read");
}

TEST_F(RawImageTest, ReadingEndsWhenNobodyWaits) {
  WriteLargePng(Path("a.png"), 100, 2000);
  WriteTiff("a.tif", Noise(100, 100), {.rows_per_strip = 10});
  for (const char* name : {"a.png", "a.tif"}) {
    int asked = 0;
    const auto image = ReadRawImageFile(Path(name), {}, [&] {
      return ++asked < 3 ? absl::OkStatus() : absl::DeadlineExceededError("too late");
    });
    EXPECT_EQ(image.status().code(), absl::StatusCode::kDeadlineExceeded) << name;
  }
}

TEST_F(RawImageTest, DamagedBytesNeverCrash) {
  WriteLargePng(Path("whole.png"), 40, 30);
  const std::vector<std::string> files = {
      Bytes(Path("whole.png")), TiffWithListInFront(40, 30, 2400),
      Bytes(WriteTiff("w.tif", Noise(40, 30), {.compression = COMPRESSION_LZW, .tile_px = 16})),
      Bytes(WriteTiff("w.tif", Noise(40, 30),
                      {.compression = COMPRESSION_ADOBE_DEFLATE, .rows_per_strip = 4}))};
  EXPECT_EQ(WithinLimits({.cpu_time_s = 60, .memory_bytes = int64_t{20} << 30},
                         [&] {
                           std::mt19937 random(11);
                           for (int i = 0; i < 4000; ++i) {
                             std::string bytes = files[i % files.size()];
                             for (int k = 0; k < 1 + i % 4; ++k) {
                               bytes[random() % bytes.size()] = static_cast<char>(random());
                             }
                             const auto check = [](int columns, int rows) {
                               return columns * int64_t{rows} <= 1'000'000
                                          ? absl::OkStatus()
                                          : absl::InvalidArgumentError("large");
                             };
                             (void)ReadRawImageFile(WriteBytes("d", bytes), check);
                           }
                           return std::string("ok");
                         }),
            "ok");
}

}  // namespace
}  // namespace sightline
