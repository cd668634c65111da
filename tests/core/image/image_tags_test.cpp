// SPDX-License-Identifier: Apache-2.0
// Tags that change the place or the meaning of pixels: one rule for every format of raw images. A
// new reader joins with one line of kWriters.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "core/image/read_raw_image.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;

// Tags that a file of any format is to have beside its pixels.
struct Saying {
  int orientation = 0;      // by the format's own tag (TIFF, Exif); 0: not stated
  int xmp_orientation = 0;  // by an XMP packet
  std::string packet = {};  // the XMP packet itself, in place of one with the orientation
  int images = 1;
  int surplus_rows = 0;     // stored beyond those that the header claims
  std::string behind = {};  // bytes behind the end
};

std::string LittleEndian(uint64_t value, int bytes) {
  std::string text;
  for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 255);
  return text;
}

std::string BigEndian(uint32_t value) {
  std::string text = LittleEndian(value, 4);
  std::reverse(text.begin(), text.end());
  return text;
}

std::string XmpPacket(int orientation) {
  return absl::StrCat("<x:xmpmeta><rdf:Description tiff:Orientation=\"", orientation,
                      "\"/></x:xmpmeta>");
}

// Empty: the file has no packet.
std::string PacketOf(const Saying& saying) {
  if (!saying.packet.empty() || saying.xmp_orientation == 0) return saying.packet;
  return XmpPacket(saying.xmp_orientation);
}

std::vector<uint16_t> WithSurplus(const Image<uint16_t>& stored, int rows) {
  std::vector<uint16_t> values = stored.values;
  values.resize(values.size() + static_cast<size_t>(rows) * stored.columns_px, 7);
  return values;
}

struct TiffEntry {
  uint16_t tag, type;
  uint64_t value;
};

// One strip; classic, little-endian. `entries` replace or extend the usual ones.
std::string TiffWith(const Image<uint16_t>& stored, const Saying& saying,
                     const std::vector<TiffEntry>& entries = {}) {
  std::string file = "II*" + std::string(1, '\0') + LittleEndian(8, 4);
  std::string pixels;
  for (const uint16_t value : WithSurplus(stored, saying.surplus_rows)) {
    pixels += LittleEndian(value, 2);
  }
  const std::string xmp = PacketOf(saying);
  for (int image = 0; image < saying.images; ++image) {
    std::vector<TiffEntry> all = {{256, 4, static_cast<uint64_t>(stored.columns_px)},
                                  {257, 4, static_cast<uint64_t>(stored.rows_px)},
                                  {258, 3, 16},
                                  {259, 3, 1},
                                  {262, 3, 1},
                                  {273, 4, 0},
                                  {277, 3, 1},
                                  {278, 4, static_cast<uint64_t>(stored.rows_px)},
                                  {279, 4, pixels.size()}};
    if (saying.orientation > 0) {
      all.push_back({274, 3, static_cast<uint64_t>(saying.orientation)});
    }
    if (!xmp.empty()) all.push_back({700, 1, 0});
    for (const TiffEntry& entry : entries) {
      std::erase_if(all, [&](const TiffEntry& known) { return known.tag == entry.tag; });
      if (entry.type != 0) all.push_back(entry);
    }
    std::sort(all.begin(), all.end(),
              [](const TiffEntry& a, const TiffEntry& b) { return a.tag < b.tag; });
    const uint64_t data = file.size() + 2 + 12 * all.size() + 4;
    file += LittleEndian(all.size(), 2);
    for (const TiffEntry& entry : all) {
      const bool packet = entry.tag == 700;
      const uint64_t value = entry.tag == 273 ? data : packet ? data + pixels.size() : entry.value;
      file += LittleEndian(entry.tag, 2) + LittleEndian(entry.type, 2) +
              LittleEndian(packet ? xmp.size() : 1, 4) + LittleEndian(value, 4);
    }
    const uint64_t next = data + pixels.size() + xmp.size();
    file += LittleEndian(image + 1 < saying.images ? next : 0, 4) + pixels + xmp;
  }
  return file + saying.behind;
}

std::string Tiff(const Image<uint16_t>& stored, const Saying& saying) {
  return TiffWith(stored, saying);
}

std::string PngChunk(const std::string& type, const std::string& data) {
  const std::string checked = type + data;
  const uLong checksum =
      crc32(0, reinterpret_cast<const Bytef*>(checked.data()), static_cast<uInt>(checked.size()));
  return BigEndian(static_cast<uint32_t>(data.size())) + checked +
         BigEndian(static_cast<uint32_t>(checksum));
}

std::string ExifOf(int orientation) {
  return "II*" + std::string(1, '\0') + LittleEndian(8, 4) + LittleEndian(1, 2) +
         LittleEndian(274, 2) + LittleEndian(3, 2) + LittleEndian(1, 4) +
         LittleEndian(static_cast<uint64_t>(orientation), 4) + LittleEndian(0, 4);
}

std::string PngWith(const Image<uint16_t>& stored, const Saying& saying, bool tags_behind,
                    const std::string& chunk = "") {
  std::string rows;
  const std::vector<uint16_t> values = WithSurplus(stored, saying.surplus_rows);
  for (size_t i = 0; i < values.size(); ++i) {
    if (i % static_cast<size_t>(stored.columns_px) == 0) rows += '\0';
    rows += static_cast<char>(values[i] >> 8);
    rows += static_cast<char>(values[i] & 255);
  }
  uLongf packed_size = compressBound(rows.size());
  std::string packed(packed_size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &packed_size,
           reinterpret_cast<const Bytef*>(rows.data()), rows.size());
  packed.resize(packed_size);
  std::string tags = chunk;
  if (saying.orientation > 0) tags += PngChunk("eXIf", ExifOf(saying.orientation));
  if (const std::string packet = PacketOf(saying); !packet.empty()) {
    tags += PngChunk("iTXt", std::string("XML:com.adobe.xmp") + std::string(5, '\0') + packet);
  }
  std::string animation;
  if (saying.images > 1) {
    animation = PngChunk("acTL", BigEndian(static_cast<uint32_t>(saying.images)) + BigEndian(0)) +
                PngChunk("fcTL", std::string(26, '\0'));
  }
  const std::string header = BigEndian(static_cast<uint32_t>(stored.columns_px)) +
                             BigEndian(static_cast<uint32_t>(stored.rows_px)) + "\x10" +
                             std::string(4, '\0');
  return "\x89PNG\r\n\x1a\n" + PngChunk("IHDR", header) + animation + (tags_behind ? "" : tags) +
         PngChunk("IDAT", packed) + (tags_behind ? tags : "") + PngChunk("IEND", "") +
         saying.behind;
}

std::string Png(const Image<uint16_t>& stored, const Saying& saying) {
  return PngWith(stored, saying, false);
}

std::string PngWithTagsBehindPixels(const Image<uint16_t>& stored, const Saying& saying) {
  return PngWith(stored, saying, true);
}

using Writer = std::string (*)(const Image<uint16_t>&, const Saying&);
const std::vector<std::pair<std::string, Writer>> kWriters = {
    {"tiff", Tiff}, {"png", Png}, {"png_tags_behind", PngWithTagsBehindPixels}};

class ImageTagsOfFormat : public ::testing::TestWithParam<std::pair<std::string, Writer>> {
 protected:
  void SetUp() override {
    path_ = (fs::path(::testing::TempDir()) /
             absl::StrCat("image_tags_", getpid(), "_", GetParam().first))
                .string();
  }
  void TearDown() override { fs::remove(path_); }

  absl::StatusOr<RawImageFile> ReadBytes(const std::string& bytes,
                                         const ImageSizeCheck& check = {}) const {
    std::ofstream(path_, std::ios::binary) << bytes;
    return ReadRawImageFile(path_, check);
  }
  absl::StatusOr<RawImageFile> Read(const Saying& saying, const ImageSizeCheck& check = {}) const {
    return ReadBytes(GetParam().second(Stored(), saying), check);
  }
  std::string ErrorOf(const Saying& saying) const {
    const auto image = Read(saying);
    return image.ok() ? "read" : std::string(image.status().message());
  }
  // 1 2 3
  // 4 5 6
  static Image<uint16_t> Stored() {
    Image<uint16_t> image(3, 2);
    image.values = {1, 2, 3, 4, 5, 6};
    return image;
  }

  std::string path_;
};

INSTANTIATE_TEST_SUITE_P(Formats, ImageTagsOfFormat, ::testing::ValuesIn(kWriters),
                         [](const auto& format) { return format.param.first; });

// TIFF 6.0, tag 274: what the 0th row and the 0th column of the stored image are.
TEST_P(ImageTagsOfFormat, EveryOrientationIsObeyed) {
  const std::vector<std::vector<uint16_t>> seen = {
      {1, 2, 3, 4, 5, 6}, {1, 2, 3, 4, 5, 6}, {3, 2, 1, 6, 5, 4},
      {6, 5, 4, 3, 2, 1}, {4, 5, 6, 1, 2, 3}, {1, 4, 2, 5, 3, 6},
      {4, 1, 5, 2, 6, 3}, {6, 3, 5, 2, 4, 1}, {3, 6, 2, 5, 1, 4}};
  for (int orientation = 0; orientation <= 8; ++orientation) {
    for (const Saying& saying :
         {Saying{.orientation = orientation}, Saying{.xmp_orientation = orientation},
          Saying{.orientation = orientation, .xmp_orientation = orientation}}) {
      const bool swapped = orientation >= 5;
      const auto check = [&](int columns_px, int rows_px) {
        return columns_px == (swapped ? 2 : 3) && rows_px == (swapped ? 3 : 2)
                   ? absl::OkStatus()
                   : absl::InvalidArgumentError("asked for another size");
      };
      const auto image = Read(saying, check);
      ASSERT_TRUE(image.ok()) << image.status() << orientation;
      EXPECT_EQ(image->raw_dn.values, seen[static_cast<size_t>(orientation)]) << orientation;
      EXPECT_EQ(image->raw_dn.columns_px, swapped ? 2 : 3);
      EXPECT_EQ(image->orientation, std::max(1, orientation));
    }
  }
}

TEST_P(ImageTagsOfFormat, OrientationsThatDoNotExistOrContradictAreRefused) {
  EXPECT_THAT(ErrorOf({.orientation = 9}), AllOf(HasSubstr(path_), HasSubstr("must be 1 to 8")));
  EXPECT_THAT(ErrorOf({.orientation = 1, .xmp_orientation = 6}), HasSubstr("read in two ways"));
}

// The prefix of a namespace is the writer's choice.
TEST_P(ImageTagsOfFormat, AnXmpOrientationIsFoundByItsNamespace) {
  const std::string tiff = "http://ns.adobe.com/tiff/1.0/";
  for (const auto& [packet, orientation] : std::vector<std::pair<std::string, int>>{
           {"<x xmlns:tiff=\"" + tiff + "\" tiff:Orientation=\"3\"/>", 3},
           {"<x xmlns:t=\"" + tiff + "\" t:Orientation=\"3\"/>", 3},
           {"<x t:Orientation = '4' xmlns:t = '" + tiff + "'/>", 4},
           {"<x xmlns:a.b-c=\"" + tiff + "\"><a.b-c:Orientation>2</a.b-c:Orientation></x>", 2},
           {"<x><Orientation xmlns=\"" + tiff + "\">3</Orientation></x>", 3},
           {"<x xmlns:t=\"" + tiff + "\" u:Orientation=\"3\" ut:Orientation=\"3\"/>", 1},
           {"<x xmlns:t=\"" + tiff + "\" t:OrientationNote=\"3\"/>", 1},
           {"<x about=\"" + tiff + "\" t:Orientation=\"3\"/>", 1}}) {
    const auto image = Read({.packet = packet});
    ASSERT_TRUE(image.ok()) << packet << image.status();
    EXPECT_EQ(image->orientation, orientation) << packet;
  }
  EXPECT_THAT(ErrorOf({.packet = "<x xmlns:t=\"" + tiff + "\" t:Orientation=\"x\"/>"}),
              HasSubstr("must be 1 to 8"));
  for (const bool big_endian : {false, true}) {
    std::string wide;
    for (const char c : XmpPacket(3)) {
      wide += big_endian ? std::string({'\0', c}) : std::string({c, '\0'});
    }
    EXPECT_THAT(ErrorOf({.packet = wide}), HasSubstr("XMP packet in UTF-16"));
  }
}

TEST_P(ImageTagsOfFormat, FurtherImagesAreCountedAndRefused) {
  for (const int images : {2, 5}) {
    EXPECT_THAT(ErrorOf({.images = images}), HasSubstr(absl::StrCat("has ", images, " images")));
  }
}

TEST_P(ImageTagsOfFormat, BytesLeftOverAreRefused) {
  EXPECT_THAT(ErrorOf({.behind = "x"}), HasSubstr("has 1 bytes behind its image"));
  EXPECT_THAT(ErrorOf({.behind = GetParam().second(Stored(), {})}),
              HasSubstr("bytes behind its image"));
  EXPECT_THAT(ErrorOf({.behind = std::string(100'000, '\0')}), HasSubstr("100000 bytes behind"));
  // Zeros that fill a block hold nothing.
  EXPECT_EQ(ErrorOf({.behind = std::string(512, '\0')}), "read");
  EXPECT_NE(ErrorOf({.surplus_rows = 1}), "read");
}

class ImageTags : public ImageTagsOfFormat {};
INSTANTIATE_TEST_SUITE_P(Tiff, ImageTags, ::testing::Values(kWriters[0]));

TEST_P(ImageTags, TiffTagsThatChangePixelsAreRefusedByName) {
  const std::vector<std::pair<TiffEntry, std::string>> cases = {
      {{262, 3, 0}, "stores white as 0"},
      {{262, 0, 0}, "PhotometricInterpretation is missing"},
      {{262, 3, 4}, "PhotometricInterpretation 4"},
      {{266, 3, 2}, "FillOrder 2"},
      {{339, 3, 2}, "numbers with sign"},
      {{32997, 4, 3}, "has 3 images"},
      {{50706, 4, 0x401}, "DNG"},
      {{254, 4, 4}, "mask"}};
  for (const auto& [entry, reason] : cases) {
    const auto image = ReadBytes(TiffWith(Stored(), {}, {entry}));
    ASSERT_FALSE(image.ok()) << reason;
    EXPECT_THAT(std::string(image.status().message()), HasSubstr(reason));
  }
  // Neither says anything about the pixels.
  for (const TiffEntry& entry :
       {TiffEntry{284, 3, 2}, TiffEntry{254, 4, 0}, TiffEntry{296, 3, 3}}) {
    EXPECT_TRUE(ReadBytes(TiffWith(Stored(), {}, {entry})).ok()) << entry.tag;
  }
}

// A directory that refers to itself, one far behind the end, one that claims all tags there are.
TEST_P(ImageTags, BrokenTiffDirectoriesAreNamed) {
  const std::string whole = TiffWith(Stored(), {});
  std::string loop = whole;
  const size_t next = 8 + 2 + 12 * 9;
  loop.replace(next, 4, LittleEndian(8, 4));
  std::string far = whole;
  far.replace(next, 4, LittleEndian(1'000'000, 4));
  std::string many = whole;
  many.replace(8, 2, LittleEndian(65535, 2));
  for (const std::string& bytes : {loop, far, many}) {
    const auto image = ReadBytes(bytes);
    ASSERT_FALSE(image.ok());
    EXPECT_THAT(std::string(image.status().message()), HasSubstr("damaged or truncated"));
  }
}

class PngTags : public ImageTagsOfFormat {};
INSTANTIATE_TEST_SUITE_P(Png, PngTags, ::testing::Values(kWriters[1]));

TEST_P(PngTags, PngChunksThatChangePixelsAreRefusedByName) {
  std::string broken = PngChunk("eXIf", ExifOf(6));
  broken.back() = static_cast<char>(broken.back() ^ 1);
  const std::vector<std::pair<std::string, std::string>> cases = {
      {PngChunk("tRNS", std::string("\0\1", 2)), "transparency"},
      {PngChunk("eXIf", "no Exif"), "damaged eXIf"},
      {broken, "checksum of its chunk eXIf"},
      {PngChunk("iTXt", std::string("XML:com.adobe.xmp\0\1\0\0\0x", 23)), "compressed XMP"},
      {PngChunk("tEXt", std::string("Raw profile type exif\0 8", 24)), "Raw profile"}};
  for (const auto& [chunk, reason] : cases) {
    const auto image = ReadBytes(PngWith(Stored(), {}, false, chunk));
    ASSERT_FALSE(image.ok()) << reason;
    EXPECT_THAT(std::string(image.status().message()), HasSubstr(reason));
  }
  for (const std::string& chunk :
       {PngChunk("gAMA", BigEndian(45455)), PngChunk("tEXt", std::string("Software\0x", 10)),
        PngChunk("acTL", BigEndian(1) + BigEndian(0)) + PngChunk("fcTL", std::string(26, '\0'))}) {
    const auto image = ReadBytes(PngWith(Stored(), {}, false, chunk));
    EXPECT_TRUE(image.ok()) << image.status();
  }
}

}  // namespace
}  // namespace sightline
