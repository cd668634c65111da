// SPDX-License-Identifier: Apache-2.0
#include "core/part/load_part.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <random>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "core/part/part_digest.h"
#include "core/part/part_health.h"
#include "tests/core/part/mesh_formats.h"
#include "tests/core/part/test_meshes.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

double Volume(const TriangleMesh& mesh) {
  double volume = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    volume += mesh.Corner(t, 0).dot(mesh.Corner(t, 1).cross(mesh.Corner(t, 2))) / 6;
  }
  return volume;
}

double Area(const TriangleMesh& mesh) {
  double area = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) area += mesh.Area(t);
  return area;
}

std::string ErrorOf(const std::string& bytes, const std::string& format,
                    const std::string& unit = "m") {
  const absl::StatusOr<TriangleMesh> mesh = LoadPartFromMemory(bytes, format, unit, "part.x");
  EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(mesh.status().message()), HasSubstr("part.x: "));
  return std::string(mesh.status().message());
}

TriangleMesh Load(const std::string& bytes, const std::string& format,
                  const std::string& unit = "m") {
  const absl::StatusOr<TriangleMesh> mesh = LoadPartFromMemory(bytes, format, unit, "part.x");
  EXPECT_TRUE(mesh.ok()) << mesh.status();
  return mesh.ok() ? *mesh : TriangleMesh();
}

const TriangleMesh& Box() {
  static const TriangleMesh box = BoxMesh({-0.1f, 0.05f, 0.2f}, {0.3f, 0.25f, 0.5f});
  return box;  // 0.4 x 0.2 x 0.3 m
}

void ExpectIsBox(const TriangleMesh& mesh) {
  EXPECT_EQ(mesh.positions_m.size(), 8u);
  EXPECT_EQ(mesh.triangles.size(), 12u);
  EXPECT_NEAR(Volume(mesh), 0.4 * 0.2 * 0.3, 1e-8);
  EXPECT_NEAR(Area(mesh), 2 * (0.08 + 0.12 + 0.06), 1e-7);
  EXPECT_NEAR((mesh.BoundingBox().min() - Eigen::Vector3d(-0.1, 0.05, 0.2)).norm(), 0, 1e-7);
  EXPECT_NEAR((mesh.BoundingBox().max() - Eigen::Vector3d(0.3, 0.25, 0.5)).norm(), 0, 1e-7);
  EXPECT_TRUE(CheckPartHealth(mesh).findings.empty());
}

// --- every format gives the same part -----------------------------------------------------------

TEST(LoadPart, ReadsEveryFormat) {
  ExpectIsBox(Load(BinaryStl(Box()), "stl"));
  ExpectIsBox(Load(AsciiStl(Box()), "stl"));
  ExpectIsBox(Load(Ply(Box(), "ascii"), "ply"));
  ExpectIsBox(Load(Ply(Box(), "binary_little_endian"), "ply"));
  ExpectIsBox(Load(Ply(Box(), "binary_big_endian"), "ply"));
  ExpectIsBox(Load(Obj(Box()), "obj"));
  ExpectIsBox(Load(GlbOf(Box()).ToBytes(), "glb"));
}

TEST(LoadPart, SameGeometryHasTheSameDigestInEveryFormat) {
  const PartDigest digest = PartDigestOf(Load(BinaryStl(Box()), "stl"));
  EXPECT_EQ(digest.hex.size(), 64u);
  EXPECT_EQ(PartDigestOf(Load(AsciiStl(Box()), "stl")), digest);
  EXPECT_EQ(PartDigestOf(Load(Ply(Box(), "binary_big_endian"), "ply")), digest);
  EXPECT_EQ(PartDigestOf(Load(Obj(Box()), "obj")), digest);
  EXPECT_EQ(PartDigestOf(Load(GlbOf(Box()).ToBytes(), "glb")), digest);
}

TEST(PartDigestTest, IsSha256OfTheCanonicalBytes) {
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.triangles = {{0, 1, 2}};
  // sha256 of 03 00.. (8 bytes), 9 floats, 3 uint32, computed with Python's hashlib.
  EXPECT_EQ(PartDigestOf(mesh).Text(),
            "2:03eb40a74ceda1686377f2e3277882024503eccb4490d0b8d56ed1eecdae71d7");
  TriangleMesh other = mesh;
  other.positions_m[1].x() = std::nextafter(1.0f, 2.0f);
  EXPECT_NE(PartDigestOf(other), PartDigestOf(mesh));
  other = mesh;
  std::swap(other.triangles[0][1], other.triangles[0][2]);
  EXPECT_NE(PartDigestOf(other), PartDigestOf(mesh));
}

TEST(PartDigestTest, TextCarriesTheRule) {
  const PartDigest digest = PartDigestOf(Box());
  EXPECT_EQ(*ParsePartDigest(digest.Text()), digest);
  // Before rules had numbers.
  const absl::StatusOr<PartDigest> old = ParsePartDigest(digest.hex);
  ASSERT_TRUE(old.ok()) << old.status();
  EXPECT_EQ(old->rule, 1);
  EXPECT_EQ(Compare(*old, digest), DigestComparison::kOtherRule);
  PartDigest other = digest;
  other.hex[5] = other.hex[5] == 'a' ? 'b' : 'a';
  EXPECT_EQ(Compare(other, digest), DigestComparison::kOtherPart);
  EXPECT_EQ(Compare(digest, digest), DigestComparison::kSame);
  for (const std::string& bad :
       {std::string(), std::string("2:"), digest.hex.substr(1), "0:" + digest.hex,
        "02:" + digest.hex, "-1:" + digest.hex, "2::" + digest.hex, "9999:" + digest.hex,
        digest.Text() + "0", std::string(64, 'A')}) {
    EXPECT_FALSE(ParsePartDigest(bad).ok()) << bad;
  }
}

TEST(LoadPart, UnitsScale) {
  for (const auto& [unit, metres] : std::vector<std::pair<std::string, double>>{
           {"m", 1}, {"cm", 1e-2}, {"mm", 1e-3}, {"um", 1e-6}, {"inch", 0.0254}}) {
    const float size = static_cast<float>(0.05 / metres);
    const TriangleMesh mesh = Load(BinaryStl(BoxMesh({0, 0, 0}, {size, size, size})), "stl", unit);
    EXPECT_NEAR(mesh.BoundingBox().sizes().x(), 0.05, 1e-8) << unit;
  }
  EXPECT_THAT(ErrorOf(BinaryStl(Box()), "stl", "yard"), AllOf(HasSubstr("yard"), HasSubstr("mm")));
  EXPECT_THAT(ErrorOf(BinaryStl(Box()), "stl", ""), HasSubstr("carries no unit"));
  ExpectIsBox(Load(GlbOf(Box()).ToBytes(), "glb", ""));  // glTF is in metres
}

TEST(LoadPart, ImplausibleSizeIsRefused) {
  EXPECT_THAT(ErrorOf(BinaryStl(BoxMesh({0, 0, 0}, {450, 280, 100})), "stl", "m"),
              AllOf(HasSubstr("450"), HasSubstr("looks like millimetres read as metres")));
  EXPECT_THAT(ErrorOf(BinaryStl(BoxMesh({0, 0, 0}, {0.45f, 0.28f, 0.1f})), "stl", "mm"),
              HasSubstr("looks like metres read as millimetres"));
  // The limits themselves are allowed.
  Load(BinaryStl(BoxMesh({0, 0, 0}, {10, 1, 1})), "stl", "m");
  Load(BinaryStl(BoxMesh({0, 0, 0}, {1, 1, 1})), "stl", "mm");
}

TEST(LoadPart, UnknownFormatsAreNamed) {
  EXPECT_THAT(ErrorOf("x", "fbx"), HasSubstr("fbx"));
  EXPECT_THAT(ErrorOf("ISO-10303-21;", "step", ""), HasSubstr("step_import"));
  EXPECT_THAT(ErrorOf("ISO-10303-21;", "step", "mm"), HasSubstr("step_import"));
}

TEST(LoadPart, WeldsCoincidentVerticesIncludingSignedZeros) {
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {-0.0f, 0, 0}, {0, 1, 0}, {-1, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  const TriangleMesh welded = Load(BinaryStl(mesh), "stl");
  EXPECT_EQ(welded.positions_m.size(), 4u);
  EXPECT_EQ(CheckPartHealth(welded).component_count, 1);
}

// As real exporters write the same corner twice.
TEST(LoadPart, WeldsAcrossRoundingButNotAcrossGaps) {
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0},
                      {0.1f, 0, 0},
                      {0, 0.1f, 0},
                      {1e-9f, -1e-9f, 0},
                      {-1e-10f, std::nextafter(0.1f, 1.0f), 0},
                      {-0.1f, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {3, 4, 5}};
  EXPECT_EQ(Load(BinaryStl(mesh), "stl").positions_m.size(), 4u);
  mesh.positions_m[3].x() = 1e-6f;  // a real gap of one micrometre
  EXPECT_EQ(Load(BinaryStl(mesh), "stl").positions_m.size(), 5u);
}

TEST(LoadPart, TrianglesWithoutAreaAreLeftOutAndCounted) {
  TriangleMesh mesh = Box();
  mesh.triangles.push_back({0, 0, 1});
  const TriangleMesh loaded = Load(BinaryStl(mesh), "stl");
  EXPECT_EQ(loaded.triangles.size(), 12u);
  EXPECT_EQ(loaded.left_out_triangles, 1);
  EXPECT_EQ(CheckPartHealth(loaded).degenerate_triangle_count, 1);
}

TEST(LoadPart, NotFiniteVerticesAreRefused) {
  for (float bad : {std::nanf(""), INFINITY, -INFINITY}) {
    TriangleMesh mesh = Box();
    mesh.positions_m[3].y() = bad;
    for (const std::string& message :
         {ErrorOf(BinaryStl(mesh), "stl"), ErrorOf(AsciiStl(mesh), "stl"),
          ErrorOf(Ply(mesh, "ascii"), "ply"), ErrorOf(Ply(mesh, "binary_big_endian"), "ply"),
          ErrorOf(Obj(mesh), "obj"), ErrorOf(GlbOf(mesh).ToBytes(), "glb")}) {
      EXPECT_THAT(message, HasSubstr("not finite"));
    }
  }
  // Finite as double, not as float.
  EXPECT_THAT(ErrorOf("v 1e200 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "obj"), HasSubstr("not finite"));
}

TEST(LoadPart, NoTrianglesIsAnError) {
  EXPECT_THAT(ErrorOf(BinaryStl(TriangleMesh()), "stl"), HasSubstr("no triangles"));
  EXPECT_THAT(ErrorOf("solid empty\nendsolid\n", "stl"), HasSubstr("no triangles"));
  EXPECT_THAT(ErrorOf("v 0 0 0\n", "obj"), HasSubstr("no triangles"));
  EXPECT_THAT(ErrorOf("", "obj"), HasSubstr("no triangles"));
  EXPECT_THAT(ErrorOf(Ply(TriangleMesh(), "ascii"), "ply"), HasSubstr(""));
}

// No prefix of a file may crash, hang, be read beyond its end or pass as the whole part.
TEST(LoadPart, TruncationIsNoticedEverywhere) {
  struct File {
    std::string format, bytes;
    size_t complete_from;  // from this length on the file is whole
  };
  const std::string ascii_stl = AsciiStl(Box()), ascii_ply = Ply(Box(), "ascii");
  const std::vector<File> files = {
      {"stl", BinaryStl(Box()), BinaryStl(Box()).size()},
      {"stl", ascii_stl, ascii_stl.find("endsolid") + 8},
      {"ply", ascii_ply, ascii_ply.size() - 2},  // "-1\n": "-" is no number, "-1" is whole
      {"ply", Ply(Box(), "binary_little_endian"), Ply(Box(), "binary_little_endian").size()},
      {"ply", Ply(Box(), "binary_big_endian"), Ply(Box(), "binary_big_endian").size()},
      {"glb", GlbOf(Box()).ToBytes(), GlbOf(Box()).ToBytes().size()},
  };
  for (const File& file : files) {
    for (size_t length = 0; length < file.complete_from; ++length) {
      const absl::StatusOr<TriangleMesh> mesh =
          LoadPartFromMemory(file.bytes.substr(0, length), file.format, "m", "part.x");
      ASSERT_FALSE(mesh.ok()) << file.format << " cut at " << length;
    }
  }
}

// Damaged files end in an error or in a sound mesh, never in a crash (run under sanitizers).
TEST(LoadPart, DamagedBytesNeverCrash) {
  std::mt19937_64 random(5);
  const std::vector<std::pair<std::string, std::string>> files = {
      {"stl", BinaryStl(Box())},    {"stl", AsciiStl(Box())},
      {"ply", Ply(Box(), "ascii")}, {"ply", Ply(Box(), "binary_little_endian")},
      {"obj", Obj(Box())},          {"glb", GlbOf(Box()).ToBytes()}};
  int refused = 0;
  for (const auto& [format, bytes] : files) {
    for (int trial = 0; trial < 1500; ++trial) {
      std::string damaged = bytes;
      for (int change = 0; change < 1 + trial % 3; ++change) {
        damaged[random() % damaged.size()] = static_cast<char>(random());
      }
      const absl::StatusOr<TriangleMesh> mesh = LoadPartFromMemory(damaged, format, "m", "part.x");
      if (!mesh.ok()) {
        ++refused;
        continue;
      }
      for (const auto& triangle : mesh->triangles) {
        for (uint32_t index : triangle) ASSERT_LT(index, mesh->positions_m.size());
      }
      for (const Eigen::Vector3f& p : mesh->positions_m) ASSERT_TRUE(p.allFinite());
    }
  }
  EXPECT_GT(refused, 1000);
}

// --- STL ----------------------------------------------------------------------------------------

TEST(Stl, BinaryThatStartsWithSolidIsBinary) {
  ExpectIsBox(Load(BinaryStl(Box(), "solid exported by a CAD program"), "stl"));
}

TEST(Stl, HugeCountInASmallFileIsRefused) {
  std::string bytes = BinaryStl(Box());
  const std::string count = Bytes<uint32_t>({0xffffffffu});
  bytes.replace(80, 4, count);
  EXPECT_THAT(ErrorOf(bytes, "stl"), AllOf(HasSubstr("truncated"), HasSubstr("4294967295")));
}

TEST(Stl, TrailingPaddingIsAllowedTrailingDataIsNot) {
  ExpectIsBox(Load(BinaryStl(Box()) + std::string(5, '\0'), "stl"));
  EXPECT_THAT(ErrorOf(BinaryStl(Box()) + "more", "stl"), HasSubstr("too long"));
}

TEST(Stl, SeveralSolidsAreOnePart) {
  const std::string two = AsciiStl(Box()) + AsciiStl(BoxMesh({1, 1, 1}, {2, 2, 2}));
  EXPECT_EQ(Load(two, "stl").triangles.size(), 24u);
}

TEST(Stl, AsciiErrorsNameTheLine) {
  std::string text = AsciiStl(Box());
  text.replace(text.find("vertex"), 8, "vertex x");
  EXPECT_THAT(ErrorOf(text, "stl"), AllOf(HasSubstr("line 4"), HasSubstr("coordinate")));
}

// --- PLY ----------------------------------------------------------------------------------------

std::string PlyHeader(const std::string& elements) {
  return "ply\nformat ascii 1.0\n" + elements + "end_header\n";
}
constexpr char kVertex4[] =
    "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n";
constexpr char kFace1[] = "element face 1\nproperty list uchar int vertex_indices\n";
constexpr char kSquare[] = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n";

TEST(PlyFile, PolygonsAreTriangulated) {
  const TriangleMesh mesh =
      Load(PlyHeader(std::string(kVertex4) + kFace1) + kSquare + "4 0 1 2 3\n", "ply");
  EXPECT_EQ(mesh.triangles.size(), 2u);
  EXPECT_NEAR(Area(mesh), 1, 1e-7);
}

TEST(PlyFile, OtherElementsAndListsAreSteppedOver) {
  const TriangleMesh mesh = Load(
      PlyHeader(std::string("element material 2\nproperty list int float ks\nproperty int id\n") +
                kVertex4 + "property list uchar uchar tags\n" + kFace1) +
          "2 0.5 0.5 7\n0 8\n0 0 0 1 5\n1 0 0 0\n1 1 0 0\n0 1 0 2 1 1\n4 0 1 2 3\n",
      "ply");
  EXPECT_EQ(mesh.triangles.size(), 2u);
}

// A coverage server gets the materials of a part so.
TEST(PlyFile, MaterialsAreReadByTheirIndex) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement material 2\nproperty list uint uchar name\n"
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar uint vertex_indices\nproperty ushort material_index\n"
      "end_header\n2 97 32\n1 98\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n";
  const auto mesh = LoadPartFromMemory(head + "3 0 1 2 1\n3 0 1 3 0\n", "ply", "m", "ply");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  ASSERT_EQ(mesh->triangle_material.size(), 2u);
  EXPECT_EQ(mesh->material_names[mesh->triangle_material[0]], "b");
  EXPECT_EQ(mesh->material_names[mesh->triangle_material[1]], "a ");
  const auto beyond = LoadPartFromMemory(head + "3 0 1 2 1\n3 0 1 3 2\n", "ply", "m", "ply");
  EXPECT_TRUE(absl::StrContains(beyond.status().message(), "material_index 2, there are 2"))
      << beyond.status();
}

// The shape and the materials of its triangles, whatever order the file names them in.
TEST(PartName, SaysTheMaterialsBehindTheShape) {
  TriangleMesh box = BoxMesh({0, 0, 0}, {1, 1, 1});
  const std::string shape = PartDigestOf(box).Text();
  EXPECT_EQ(PartNameWithMaterials(box), shape);
  box.material_names = {"steel", "paint"};
  box.triangle_material.assign(box.triangles.size(), 0);
  box.triangle_material[3] = 1;
  const std::string name = PartNameWithMaterials(box);
  EXPECT_EQ(PartDigestOf(box).Text(), shape);
  const auto parsed = ParsePartName(name);
  ASSERT_TRUE(parsed.ok()) << parsed.status();
  EXPECT_EQ(parsed->digest.Text(), shape);
  EXPECT_EQ(parsed->materials.size(), 64u);

  TriangleMesh reordered = box;
  reordered.material_names = {"unused", "paint", "steel"};
  reordered.triangle_material.assign(box.triangles.size(), 2);
  reordered.triangle_material[3] = 1;
  EXPECT_EQ(PartNameWithMaterials(reordered), name);
  box.triangle_material[3] = 0;
  EXPECT_NE(PartNameWithMaterials(box), name);

  EXPECT_FALSE(ParsePartName(shape + "+12").ok());
  EXPECT_TRUE(ParsePartName(shape)->materials.empty());
}

TEST(PlyFile, BadContentIsNamed) {
  const std::string header = PlyHeader(std::string(kVertex4) + kFace1) + kSquare;
  EXPECT_THAT(ErrorOf(header + "3 0 1 4\n", "ply"), AllOf(HasSubstr("index 4"), HasSubstr("4 v")));
  EXPECT_THAT(ErrorOf(header + "3 0 1 -1\n", "ply"), HasSubstr("index -1"));
  EXPECT_THAT(ErrorOf(header + "2 0 1\n", "ply"), HasSubstr("at least 3"));
  EXPECT_THAT(ErrorOf(header + "250 0 1\n", "ply"), HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf(PlyHeader("element vertex 99999999999\nproperty float x\nproperty float "
                                "y\nproperty float z\n"),
                      "ply"),
              HasSubstr("truncated"));
  EXPECT_THAT(ErrorOf(PlyHeader("element nothing 99999999999\n"), "ply"), HasSubstr("properties"));
  EXPECT_THAT(ErrorOf(PlyHeader("element vertex 1\nproperty float x\n") + "1\n", "ply"),
              HasSubstr("x, y and z"));
  // The file does not say which of two lists is the outline.
  EXPECT_THAT(
      ErrorOf(PlyHeader(std::string(kVertex4) + kFace1 + "property list uchar int vertex_index\n") +
                  kSquare + "3 0 1 2 3 1 2 3\n",
              "ply"),
      HasSubstr("two lists"));
}

// The line of a file of nine lines of data on which the fault is, for each kind of fault.
TEST(PlyFile, FaultsAreNamedWithTheirLine) {
  const std::string header = PlyHeader(std::string(kVertex4) + "element face 2\n" +
                                       "property list uchar int vertex_indices\n");
  const auto header_lines = std::count(header.begin(), header.end(), '\n');
  const std::vector<std::string> good = {"0 0 0", "1 0 0", "1 1 0", "0 1 0", "3 0 1 2", "3 0 2 3"};
  struct Fault {
    size_t at;  // in `good`
    std::string line, reason;
  };
  for (const std::string end : {"\n", "\r\n"}) {
    for (const Fault& fault : {
             Fault{1, "1 x 0", "vertex 1 has a wrong value: \"x\" is no number"},
             Fault{2, "1 1,5 0", "vertex 2 has a wrong value: \"1,5\" is no number"},
             Fault{2, "1 1", "vertex 2 has fewer numbers on its line"},
             Fault{2, "1 1 0 5", "vertex 2 has more numbers on its line"},
             Fault{0, "0 0 0 0 0 0", "vertex 0 has more numbers on its line"},
             Fault{4, "3 0 1", "face 0 has fewer numbers on its line"},
             Fault{4, "3 0 1 9", "face 0 has vertex index 9"},
             Fault{5, "2 0 1", "face 1 has 2 vertices"},
             Fault{5, "3 0 2 x", "face 1 has a wrong value: \"x\" is no number"},
         }) {
      std::string file = header;
      for (size_t i = 0; i < good.size(); ++i) {
        file += (i == fault.at ? fault.line : good[i]) + end;
      }
      EXPECT_THAT(ErrorOf(file, "ply"),
                  HasSubstr(absl::StrCat("line ", header_lines + 1 + static_cast<int64_t>(fault.at),
                                         ": ", fault.reason)))
          << fault.line;
    }
  }
  // Lines that are not there are no damage of those that are.
  EXPECT_THAT(
      ErrorOf(header + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n", "ply"),
      AllOf(HasSubstr("truncated"), HasSubstr("2 elements \"face\""), HasSubstr("index 1")));
  EXPECT_THAT(ErrorOf(PlyHeader(std::string(kVertex4) +
                                "element face 1\nproperty list char int vertex_indices\n") +
                          kSquare + "-3 0 1 2\n",
                      "ply"),
              HasSubstr("face 0 has a list of -3 values"));
}

// A number of an ASCII file is a value of its property's type, or the line is named: for each type
// the ends of its range, and what lies beyond them.
TEST(PlyFile, NumbersAreValuesOfTheirTypes) {
  struct TypeCase {
    const char* type;
    std::vector<const char*> good, bad;
  };
  const std::vector<const char*> no_integers = {"0.5", "1e30", "nan", "inf"};
  const std::vector<TypeCase> cases = {
      {"char", {"-128", "127", "1.0"}, {"-129", "128"}},
      {"uchar", {"0", "255"}, {"-1", "256", "300"}},
      {"short", {"-32768", "32767"}, {"-32769", "32768"}},
      {"ushort", {"0", "65535"}, {"-1", "65536"}},
      {"int", {"-2147483648", "2147483647"}, {"-2147483649", "2147483648"}},
      {"uint", {"0", "4294967295"}, {"-1", "4294967296"}},
      {"float", {"-3.40282347e38", "1e-50", "nan", "-inf"}, {"1e50", "-3.41e38", "1e400"}},
      {"double", {"1e50", "1e-400", "nan", "inf"}, {"1e400", "-1e400"}},
  };
  for (const TypeCase& c : cases) {
    const std::string name = c.type;
    const bool whole = name != "float" && name != "double";
    // As a property, and in a list that nobody reads.
    for (const std::string& property :
         {"property " + name + " p\n", "property list uchar " + name + " p\n"}) {
      const std::string count = property.find("list") == property.npos ? "" : "1 ";
      const std::string start = PlyHeader(std::string(kVertex4) + property + kFace1);
      const auto file = [&](const std::string& value) {
        return start + "0 0 0 " + count + "0\n1 0 0 " + count + value + "\n1 1 0 " + count +
               "0\n0 1 0 " + count + "0\n4 0 1 2 3\n";
      };
      const auto line = std::count(start.begin(), start.end(), '\n') + 2;
      std::vector<const char*> bad = c.bad;
      if (whole) bad.insert(bad.end(), no_integers.begin(), no_integers.end());
      for (const char* value : c.good) EXPECT_EQ(Load(file(value), "ply").triangles.size(), 2u);
      for (const char* value : bad) {
        EXPECT_THAT(ErrorOf(file(value), "ply"),
                    AllOf(HasSubstr(absl::StrCat("line ", line, ": vertex 1 has a wrong value: ",
                                                 value, " is no value of type ", name))));
      }
    }
  }
  const std::string header = PlyHeader(std::string(kVertex4) + kFace1) + kSquare;
  EXPECT_THAT(ErrorOf(header + "999 0 1\n", "ply"), HasSubstr("999 is no value of type uchar"));
  EXPECT_THAT(ErrorOf(header + "3 0 1 1.5\n", "ply"), HasSubstr("1.5 is no value of type int"));
}

// --- OBJ ----------------------------------------------------------------------------------------

TEST(ObjFile, NegativeIndicesCountFromTheEnd) {
  const TriangleMesh mesh =
      Load("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf -4 -3 -2 -1\nv 2 0 0\nf -4 -1 -3\n", "obj");
  EXPECT_EQ(mesh.triangles.size(), 3u);
  EXPECT_NEAR(Area(mesh), 1.5, 1e-7);
}

TEST(ObjFile, LinesContinueAfterABackslashAndEndWithCrLf) {
  EXPECT_NEAR(Area(Load("v 0 0 0\r\nv 1 0 0\r\nv 1 1 0\r\nv 0 1 0\r\nf 1 2 \\\r\n3 4\r\n", "obj")),
              1, 1e-7);
}

// An L: a fan from its first corner would leave the shape.
TEST(ObjFile, ConcavePolygonsKeepTheirShape) {
  const std::string corners[] = {"0 0 0", "2 0 0", "2 1 0", "1 1 0", "1 2 0", "0 2 0"};
  for (int first = 0; first < 6; ++first) {
    std::string text;
    for (const std::string& corner : corners) absl::StrAppend(&text, "v ", corner, "\n");
    text += "f";
    for (int i = 0; i < 6; ++i) absl::StrAppend(&text, " ", (first + i) % 6 + 1);
    const TriangleMesh mesh = Load(text + "\n", "obj");
    EXPECT_EQ(mesh.triangles.size(), 4u);
    EXPECT_NEAR(Area(mesh), 3, 1e-6) << first;
    for (size_t t = 0; t < mesh.triangles.size(); ++t) EXPECT_GT(mesh.Normal(t).z(), 0.99);
  }
}

TEST(ObjFile, BadContentNamesTheLine) {
  const std::string square = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";
  EXPECT_THAT(ErrorOf(square + "f 1 2 5\n", "obj"), AllOf(HasSubstr("line 5"), HasSubstr("5")));
  EXPECT_THAT(ErrorOf(square + "f 1 2 0\n", "obj"), HasSubstr("line 5"));
  EXPECT_THAT(ErrorOf(square + "f 1 2 -5\n", "obj"), HasSubstr("out of range"));
  EXPECT_THAT(ErrorOf(square + "f 1 2\n", "obj"), HasSubstr("at least 3"));
  EXPECT_THAT(ErrorOf(square + "f 1 2 99999999999999999999\n", "obj"), HasSubstr("line 5"));
  EXPECT_THAT(ErrorOf("v 0 0\n", "obj"), HasSubstr("3 coordinates"));
  EXPECT_THAT(ErrorOf("v 0 0 zero\n", "obj"), HasSubstr("\"zero\""));
  EXPECT_THAT(ErrorOf("cstype bspline\n", "obj"), HasSubstr("free-form"));
  EXPECT_THAT(ErrorOf("<html>\n", "obj"), HasSubstr("unknown keyword"));
}

// --- glTF ---------------------------------------------------------------------------------------

TEST(ObjFile, FacesKeepTheNamesOfTheirMaterials) {
  const auto mesh = LoadPartFromMemory(
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl cast\nf 1 3 2\nusemtl milled\nf 1 2 4\nf 1 4 "
      "3\nusemtl cast\nf 2 3 4\n",
      "obj", "m", "test");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_THAT(mesh->material_names, testing::ElementsAre("cast", "milled"));
  EXPECT_THAT(mesh->triangle_material, testing::ElementsAre(0, 1, 1, 0));
}

TEST(Glb, TheExampleHeadHasThreeSurfaces) {
  const char* folder = std::getenv("SIGHTLINE_SOURCE_DIR");
  const auto mesh = LoadPart(
      std::string(folder == nullptr ? "." : folder) + "/examples/cylinder_head/cylinder_head.glb",
      "");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_THAT(mesh->material_names, testing::ElementsAre("machined", "cast_outer", "sand_cast"));
  ASSERT_EQ(mesh->triangle_material.size(), mesh->triangles.size());
  const double top_m = mesh->BoundingBox().max().z();
  for (size_t t = 0; t < mesh->triangles.size(); ++t) {
    if (mesh->Normal(t).z() < 0.999) continue;
    const bool on_top = std::abs(mesh->Corner(t, 0).z() - top_m) < 1e-6;
    EXPECT_EQ(mesh->triangle_material[t] == 0, on_top) << "triangle " << t;
  }
}

TEST(Glb, EveryIndexType) {
  ExpectIsBox(Load(GlbOf<uint8_t>(Box(), 5121).ToBytes(), "glb"));
  ExpectIsBox(Load(GlbOf<uint16_t>(Box(), 5123).ToBytes(), "glb"));
  ExpectIsBox(Load(GlbOf<uint32_t>(Box(), 5125).ToBytes(), "glb"));
  EXPECT_THAT(ErrorOf(GlbOf<uint32_t>(Box(), 5126).ToBytes(), "glb"), HasSubstr("5126"));
}

TEST(Glb, WithoutIndices) {
  TriangleMesh soup;
  for (const auto& t : Box().triangles) {
    for (uint32_t index : t) soup.positions_m.push_back(Box().positions_m[index]);
  }
  GlbParts parts = GlbOf(soup);
  parts.indices.clear();
  ExpectIsBox(Load(parts.ToBytes(), "glb"));
}

TEST(Glb, StripsAndFansKeepTheirOrientation) {
  // A unit square as strip and as fan, normal +z both times.
  TriangleMesh square;
  square.positions_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}};
  square.triangles = {{0, 1, 2}};
  for (const auto& [mode, order] :
       std::vector<std::pair<int, std::vector<uint32_t>>>{{5, {0, 1, 2, 3}}, {6, {0, 1, 3, 2}}}) {
    GlbParts parts = GlbOf(square);
    parts.indices = Bytes(order);
    parts.index_count = 4;
    parts.primitive_extra = absl::StrCat(", \"mode\": ", mode);
    const TriangleMesh mesh = Load(parts.ToBytes(), "glb");
    ASSERT_EQ(mesh.triangles.size(), 2u);
    EXPECT_NEAR(Area(mesh), 1, 1e-7);
    for (size_t t = 0; t < 2; ++t) EXPECT_NEAR(mesh.Normal(t).z(), 1, 1e-7) << mode;
  }
}

TEST(Glb, NodeTransformsAreAppliedThroughTheTree) {
  GlbParts parts = GlbOf(BoxMesh({0, 0, 0}, {0.1f, 0.2f, 0.3f}));
  // Parent: shift by 1 m along x. Child: scale by 2, turn by 90 degrees about z, shift along y.
  // p -> R S p + (0, 5, 0), then + (1, 0, 0); x -> y, y -> -x.
  parts.nodes =
      R"([{"children": [1], "translation": [1, 0, 0]},
          {"mesh": 0, "scale": [2, 2, 2], "rotation": [0, 0, 0.70710678118654752, 0.70710678118654752],
           "translation": [0, 5, 0]}])";
  const TriangleMesh mesh = Load(parts.ToBytes(), "glb");
  const Eigen::AlignedBox3d box = mesh.BoundingBox();
  EXPECT_NEAR((box.min() - Eigen::Vector3d(0.6, 5, 0)).norm(), 0, 1e-6);
  EXPECT_NEAR((box.max() - Eigen::Vector3d(1, 5.2, 0.6)).norm(), 0, 1e-6);
  EXPECT_NEAR(Volume(mesh), 8 * 0.006, 1e-6);
}

TEST(Glb, MatrixIsColumnMajor) {
  GlbParts parts = GlbOf(Box());
  parts.nodes = R"([{"mesh": 0, "matrix": [1,0,0,0, 0,1,0,0, 0,0,1,0, 3,4,5,1]}])";
  const Eigen::Vector3d shift =
      Load(parts.ToBytes(), "glb").BoundingBox().center() - Box().BoundingBox().center();
  EXPECT_NEAR((shift - Eigen::Vector3d(3, 4, 5)).norm(), 0, 1e-6);
}

TEST(Glb, MirroringTurnsTrianglesSoThatOutsideStaysOutside) {
  GlbParts parts = GlbOf(Box());
  parts.nodes = R"([{"mesh": 0, "scale": [-1, 1, 1]}])";
  EXPECT_NEAR(Volume(Load(parts.ToBytes(), "glb")), 0.4 * 0.2 * 0.3, 1e-7);
  parts.nodes = R"([{"mesh": 0, "matrix": [0,1,0,0, 1,0,0,0, 0,0,1,0, 0,0,0,1]}])";  // x <-> y
  EXPECT_NEAR(Volume(Load(parts.ToBytes(), "glb")), 0.4 * 0.2 * 0.3, 1e-7);
}

TEST(Glb, OneMeshMayStandInSeveralPlaces) {
  GlbParts parts = GlbOf(Box());
  parts.nodes = R"([{"mesh": 0}, {"mesh": 0, "translation": [1, 0, 0]}, {"mesh": 0}])";
  parts.scene_nodes = "[0, 1]";  // the third is in no scene
  const TriangleMesh mesh = Load(parts.ToBytes(), "glb");
  EXPECT_EQ(mesh.triangles.size(), 24u);
  EXPECT_NEAR(Volume(mesh), 2 * 0.4 * 0.2 * 0.3, 1e-7);
}

TEST(Glb, UnsupportedFeaturesAreRefusedByName) {
  const auto error_with = [](auto change) {
    GlbParts parts = GlbOf(Box());
    change(parts);
    return ErrorOf(parts.ToBytes(), "glb");
  };
  EXPECT_THAT(error_with([](GlbParts& p) {
                p.root_extra = R"(, "extensionsUsed": ["KHR_draco_mesh_compression"],
                                    "extensionsRequired": ["KHR_draco_mesh_compression"])";
              }),
              HasSubstr("KHR_draco_mesh_compression"));
  EXPECT_THAT(error_with([](GlbParts& p) {
                p.root_extra = R"(, "extensionsRequired": ["EXT_meshopt_compression"])";
              }),
              HasSubstr("EXT_meshopt_compression"));
  EXPECT_THAT(error_with([](GlbParts& p) {
                p.root_extra = R"(, "extensionsRequired": ["KHR_implicit_shapes"])";
              }),
              HasSubstr("KHR_implicit_shapes"));
  EXPECT_THAT(
      error_with([](GlbParts& p) { p.primitive_extra = R"(, "targets": [{"POSITION": 0}])"; }),
      HasSubstr("morph"));
  EXPECT_THAT(error_with([](GlbParts& p) {
                p.nodes = R"([{"mesh": 0, "skin": 0}])";
                p.root_extra = R"(, "skins": [{"joints": [0]}])";
              }),
              HasSubstr("skin"));
  EXPECT_THAT(error_with([](GlbParts& p) {
                p.position_accessor_extra =
                    R"(, "sparse": {"count": 8, "indices": {"bufferView": 1, "componentType": 5125},
                        "values": {"bufferView": 0}})";
              }),
              HasSubstr("no larger than the one before"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.primitive_extra = R"(, "mode": 1)"; }),
              HasSubstr("only points and lines"));
  // Extensions that concern only the looks are accepted.
  GlbParts parts = GlbOf(Box());
  parts.root_extra = R"(, "extensionsRequired": ["KHR_materials_unlit", "KHR_texture_transform"])";
  ExpectIsBox(Load(parts.ToBytes(), "glb"));
}

TEST(Glb, InconsistentReferencesAreRefused) {
  const auto error_with = [](auto change) {
    GlbParts parts = GlbOf(Box());
    change(parts);
    return ErrorOf(parts.ToBytes(), "glb");
  };
  EXPECT_THAT(error_with([](GlbParts& p) { p.vertex_count = 9; }), HasSubstr("beyond its buffer"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.vertex_count = 4000000000; }),
              HasSubstr("beyond its buffer"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.vertex_count = 7; }), HasSubstr("index 7"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.index_count = 35; }), HasSubstr("multiple of 3"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.position_accessor_extra = R"(, "byteOffset": 8)"; }),
              HasSubstr("beyond its buffer"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.nodes = R"([{"mesh": 3}])"; }),
              HasSubstr("meshes[3]"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.scene_nodes = "[7]"; }), HasSubstr("nodes[7]"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.nodes = R"([{"mesh": 0, "children": [0]}])"; }),
              HasSubstr("several parents"));
  EXPECT_THAT(error_with([](GlbParts& p) {
                p.nodes = R"([{"children": [1, 1]}, {"children": [2, 2]}, {"mesh": 0}])";
              }),
              HasSubstr("several parents"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.nodes = R"([{"mesh": 0, "matrix": [1, 2]}])"; }),
              HasSubstr("matrix"));
  EXPECT_THAT(
      error_with([](GlbParts& p) { p.nodes = R"([{"mesh": 0, "rotation": [0, 0, 0, 0]}])"; }),
      HasSubstr("quaternion"));
  EXPECT_THAT(error_with([](GlbParts& p) { p.nodes = R"([{"mesh": 0, "scale": [1, 1]}])"; }),
              HasSubstr("scale"));
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "[";
  for (int i = 0; i < 100000; ++i) deep += "]";
  EXPECT_THAT(error_with([&](GlbParts& p) { p.root_extra = ", \"extras\": " + deep; }),
              HasSubstr("nested"));
}

TEST(Glb, NothingOutsideTheFileIsRead) {
  const std::string json =
      R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 10, "uri": "/etc/hostname"}]})";
  EXPECT_THAT(ErrorOf(Glb(json, ""), "glb"), HasSubstr("cannot be parsed"));
  // Nor may one small file claim its own bytes many times over.
  EXPECT_THAT(
      ErrorOf(
          Glb(R"({"asset": {"version": "2.0"}, "buffers": [{"byteLength": 4}, {"byteLength": 4}]})",
              "1234"),
          "glb"),
      HasSubstr("buffers[1]"));
}

// --- files --------------------------------------------------------------------------------------

class LoadPartFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("load_part_" + std::to_string(std::random_device()()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  std::filesystem::path folder_;
};

TEST_F(LoadPartFileTest, TheExtensionSaysTheFormatInAnyCase) {
  for (const std::string& path : {Write("a.STL", BinaryStl(Box())), Write("a.Obj", Obj(Box())),
                                  Write("a.glb", GlbOf(Box()).ToBytes())}) {
    const absl::StatusOr<TriangleMesh> mesh = LoadPart(path, "m");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    ExpectIsBox(*mesh);
  }
  EXPECT_EQ(LoadPart((folder_ / "none.stl").string(), "m").status().code(),
            absl::StatusCode::kNotFound);
  EXPECT_EQ(LoadPart(folder_.string(), "m").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(LoadPartFileTest, GltfReadsItsBufferFromBesideIt) {
  std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  Write("triangle.bin", Bytes(positions));
  const std::string json =
      R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
          "buffers": [{"byteLength": 36, "uri": "triangle.bin"}],
          "bufferViews": [{"buffer": 0, "byteLength": 36}],
          "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
          "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})";
  const std::string path = Write("triangle.gltf", json);
  const absl::StatusOr<TriangleMesh> mesh = LoadPart(path, "");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_NEAR(Area(*mesh), 0.5, 1e-7);
  std::filesystem::remove(folder_ / "triangle.bin");
  EXPECT_THAT(std::string(LoadPart(path, "").status().message()),
              AllOf(HasSubstr(path), HasSubstr("triangle.bin")));
}

// If the file leaves the choice of a scene open, a message names the scene that is read.
TEST_F(LoadPartFileTest, ASceneThatIsChosenIsNamed) {
  Write("triangle.bin", Bytes(std::vector<float>{0, 0, 0, 1, 0, 0, 0, 1, 0}));
  const auto path_of = [&](const std::string& scenes) {
    return Write("scenes.gltf",
                 R"({"asset": {"version": "2.0"},
            "nodes": [{"mesh": 0}, {"mesh": 0, "scale": [2, 2, 2]}], )" +
                     scenes + R"(,
          "buffers": [{"byteLength": 36, "uri": "triangle.bin"}],
          "bufferViews": [{"buffer": 0, "byteLength": 36}],
          "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
          "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})");
  };
  const auto read = [&](const std::string& scenes) {
    const absl::StatusOr<TriangleMesh> mesh = LoadPart(path_of(scenes), "");
    EXPECT_TRUE(mesh.ok()) << mesh.status();
    return mesh.ok() ? *mesh : TriangleMesh();
  };
  const std::string two = R"("scenes": [{"name": "part", "nodes": [0]}, {"nodes": [1]}])";
  const TriangleMesh first = read(two);
  EXPECT_NEAR(Area(first), 0.5, 1e-7);
  ASSERT_EQ(first.remarks.size(), 1u);
  EXPECT_THAT(first.remarks[0],
              AllOf(HasSubstr("of its 2 scenes"), HasSubstr("read was scenes[0] \"part\""),
                    HasSubstr("not scenes[1]")));
  // A default and a single scene leave nothing open.
  const TriangleMesh second = read("\"scene\": 1, " + two);
  EXPECT_NEAR(Area(second), 2, 1e-6);
  EXPECT_TRUE(second.remarks.empty());
  EXPECT_TRUE(read("\"scene\": 0, " + two).remarks.empty());
  EXPECT_TRUE(read(R"("scenes": [{"nodes": [0]}])").remarks.empty());
  // Without a scene all nodes without a parent are read: of several this is said.
  const TriangleMesh all = read(R"("extras": {})");
  EXPECT_NEAR(Area(all), 2.5, 1e-6);
  ASSERT_EQ(all.remarks.size(), 1u);
  EXPECT_THAT(all.remarks[0], AllOf(HasSubstr("no scene"), HasSubstr("nodes[0], nodes[1]")));
  // A scene without triangles is not the whole file.
  const std::string empty = R"("scenes": [{"name": "stage"}, {"name": "part", "nodes": [0]}])";
  for (const std::string& scenes : {empty, "\"scene\": 0, " + empty}) {
    const absl::StatusOr<TriangleMesh> none = LoadPart(path_of(scenes), "");
    EXPECT_THAT(std::string(none.status().message()),
                AllOf(HasSubstr("scenes[0] \"stage\""), HasSubstr("has no triangles"),
                      HasSubstr("scenes[1] \"part\"")));
  }
}

TEST_F(LoadPartFileTest, PointCloudsAreBinaryPly) {
  const std::string path = (folder_ / "points.ply").string();
  const std::vector<Eigen::Vector3f> points = {{1, 2, 3}, {-4, 5.5f, 6}};
  const std::vector<Eigen::Vector3f> normals = {{0, 0, 1}, {1, 0, 0}};
  ASSERT_TRUE(WritePlyPoints(path, points, normals).ok());
  std::ifstream stream(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(stream)), {});
  EXPECT_THAT(bytes, HasSubstr("element vertex 2\n"));
  EXPECT_EQ(bytes.substr(bytes.size() - 48),
            Bytes<float>({1, 2, 3, 0, 0, 1, -4, 5.5f, 6, 1, 0, 0}));
  EXPECT_FALSE(WritePlyPoints(path, points, {}).ok());
}

// --- whole files --------------------------------------------------------------------------------

std::filesystem::path OwnPart(const std::string& name) {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  return std::filesystem::path(source != nullptr ? source : ".") / "tests/core/part/data" / name;
}

// data/make_flange.py writes this part as CAD systems do.
TEST(WholeFileTest, FlangeIsClosedInEveryFormat) {
  // Area of a ring of 48 corners: r^2 times this instead of pi.
  const double area_factor = 24 * std::sin(2 * std::numbers::pi / 48);
  const double volume_m3 =
      1e-9 * area_factor * ((30 * 30 - 10 * 10) * 8 + (18 * 18 - 10 * 10) * 12);
  for (const char* name : {"flange.obj", "flange.stl"}) {
    const absl::StatusOr<TriangleMesh> mesh = LoadPart(OwnPart(name).string(), "mm");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    const PartHealth health = CheckPartHealth(*mesh);
    EXPECT_THAT(health.findings, ::testing::IsEmpty()) << name;
    EXPECT_EQ(health.triangle_count, 576) << name;
    EXPECT_EQ(health.vertex_count, 288) << name;
    EXPECT_EQ(health.component_count, 1) << name;
    EXPECT_EQ(health.flipped_component_count, 0) << name;
    EXPECT_EQ(health.open_edge_count, 0) << name;
    EXPECT_EQ(health.non_manifold_edge_count, 0) << name;
    // The numbers in the files have six or seven digits.
    EXPECT_NEAR(Volume(*mesh) / volume_m3, 1, 1e-6) << name;
    EXPECT_NEAR(mesh->BoundingBox().sizes().z(), 0.02, 1e-8) << name;
  }
}

TEST(WholeFileTest, WrongUnitIsNoticed) {
  EXPECT_THAT(std::string(LoadPart(OwnPart("flange.stl").string(), "m").status().message()),
              HasSubstr("looks like millimetres read as metres"));
}

// Parts of others, where they lie beside the tree.
struct RealPart {
  const char* path;  // below data/cad
  const char* unit;
  bool closed = true;
  int64_t least_triangles = 1;
  double least_m = 0.005, most_m = 1;  // longest edge of the bounding box
};

std::vector<RealPart> RealParts() {
  std::vector<RealPart> parts;
  const auto shared = SharedData();
  if (!shared) return parts;
  for (const RealPart& part : {RealPart{"brackets/262.obj", "mm", true, 60001, 0.05, 0.5},
                               RealPart{"brackets/320.obj", "mm", true, 60001, 0.05, 0.5},
                               RealPart{"inline4_engine/Cylinder Head.STL", "mm"},
                               RealPart{"inline4_engine/Engine Block.STL", "mm"},
                               RealPart{"inline4_engine/Crankshaft.STL", "mm"},
                               RealPart{"trimesh/ADIS16480.STL", "m", false, 1, 0.037, 0.057},
                               RealPart{"trimesh/angle_block.STL", "inch", false},
                               RealPart{"trimesh/busted.STL", "inch", false}}) {
    if (std::filesystem::exists(*shared / "data/cad" / part.path)) parts.push_back(part);
  }
  return parts;
}

class RealPartTest : public ::testing::TestWithParam<RealPart> {};
GTEST_ALLOW_UNINSTANTIATED_PARAMETERIZED_TEST(RealPartTest);

TEST_P(RealPartTest, Loads) {
  const RealPart& part = GetParam();
  const absl::StatusOr<TriangleMesh> mesh =
      LoadPart((*SharedData() / "data/cad" / part.path).string(), part.unit);
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  const double size_m = mesh->BoundingBox().sizes().maxCoeff();
  EXPECT_GT(size_m, part.least_m);
  EXPECT_LT(size_m, part.most_m);
  const PartHealth health = CheckPartHealth(*mesh);
  EXPECT_GE(health.triangle_count, part.least_triangles);
  if (!part.closed) return;
  EXPECT_EQ(health.open_edge_count, 0);
  EXPECT_EQ(health.non_manifold_edge_count, 0);
  EXPECT_EQ(health.flipped_component_count, 0);
  EXPECT_GT(Volume(*mesh), 0);
}

INSTANTIATE_TEST_SUITE_P(Shared, RealPartTest, ::testing::ValuesIn(RealParts()));

}  // namespace
}  // namespace sightline
