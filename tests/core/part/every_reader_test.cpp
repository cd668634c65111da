// SPDX-License-Identifier: Apache-2.0
// Properties of the readers of all mesh formats. Their table is in mesh_formats.cpp.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "core/part/load_part.h"
#include "core/part/part_digest.h"
#include "core/part/part_health.h"
#include "tests/core/part/mesh_formats.h"
#include "tests/core/part/test_meshes.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class EveryReaderTest : public ::testing::TestWithParam<MeshFormat> {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              absl::StrCat("every_reader_", std::random_device()());
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  absl::StatusOr<TriangleMesh> Read(const std::string& bytes, const std::string& unit = "m") {
    const std::string path = (folder_ / absl::StrCat("part.", GetParam().extension)).string();
    std::ofstream(path, std::ios::binary) << bytes;
    return LoadPart(path, unit);
  }
  std::string ErrorOf(const std::string& bytes) {
    const absl::StatusOr<TriangleMesh> mesh = Read(bytes);
    EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument) << mesh.status();
    return std::string(mesh.status().message());
  }
  std::string Write(const TriangleMesh& mesh) const { return GetParam().write(mesh); }

  std::filesystem::path folder_;
};

const TriangleMesh& Block() {
  static const TriangleMesh block = BoxMesh({-0.1f, 0.05f, 0.2f}, {0.3f, 0.25f, 0.5f});
  return block;
}

TriangleMesh Moved(TriangleMesh mesh, const Eigen::Vector3f& by_m) {
  for (Eigen::Vector3f& p : mesh.positions_m) p += by_m;
  return mesh;
}

TEST_P(EveryReaderTest, ReadsTheSamePart) {
  const auto mesh = Read(Write(Block()));
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(PartDigestOf(*mesh),
            PartDigestOf(*LoadPartFromMemory(BinaryStl(Block()), "stl", "m", "part.stl")));
  EXPECT_TRUE(CheckPartHealth(*mesh).findings.empty());
}

// Kind 1: geometry that is no surface changes nothing.
TEST_P(EveryReaderTest, GeometryThatIsNoSurfaceChangesNothing) {
  const auto clean = Read(Write(Block()));
  ASSERT_TRUE(clean.ok()) << clean.status();
  struct Junk {
    const char* name;
    std::vector<Eigen::Vector3f> corners;  // three: a triangle; otherwise vertices without faces
  };
  const std::vector<Junk> all = {
      {"a point", {{5, 5, 5}, {5, 5, 5}, {5, 5, 5}}},
      {"a point far off", {{4e5f, 0, 0}, {4e5f, 0, 0}, {4e5f, 0, 0}}},
      {"a line", {{0, 0, 0}, {500, 0, 0}, {250, 0, 0}}},
      {"a line that leans", {{0, 0, 0}, {1, 2, 3}, {0.5f, 1, 1.5f}}},
      {"a line between corners", {{-0.1f, 0.05f, 0.2f}, {0.3f, 0.25f, 0.5f}, {0.1f, 0.15f, 0.35f}}},
      {"a speck beside the part", {{0.7f, 0, 0}, {0.7f + 1e-7f, 0, 0}, {0.7f, 1e-7f, 0}}},
      {"vertices without faces", {{1e6f, 0, 0}, {-3, 7, 9}}}};
  for (const Junk& junk : all) {
    for (const bool first : {false, true}) {
      TriangleMesh mesh = Block();
      const auto base = static_cast<uint32_t>(mesh.positions_m.size());
      mesh.positions_m.insert(mesh.positions_m.end(), junk.corners.begin(), junk.corners.end());
      if (junk.corners.size() == 3) {
        mesh.triangles.insert(first ? mesh.triangles.begin() : mesh.triangles.end(),
                              {base, base + 1, base + 2});
      }
      const auto read = Read(Write(mesh));
      ASSERT_TRUE(read.ok()) << junk.name << ": " << read.status();
      EXPECT_EQ(PartDigestOf(*read), PartDigestOf(*clean)) << junk.name;
      EXPECT_EQ(read->BoundingBox().min(), clean->BoundingBox().min()) << junk.name;
      EXPECT_EQ(read->BoundingBox().max(), clean->BoundingBox().max()) << junk.name;
      EXPECT_EQ(CheckPartHealth(*read).degenerate_triangle_count, junk.corners.size() == 3)
          << junk.name;
    }
  }
}

TEST_P(EveryReaderTest, NothingButFacesWithoutAreaIsRefused) {
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0}, {1, 0, 0}, {0.5f, 0, 0}};
  mesh.triangles = {{0, 1, 2}};
  EXPECT_THAT(ErrorOf(Write(mesh)), HasSubstr("no triangles with area"));
}

// Tessellators close a T-junction with a triangle without area.
TEST_P(EveryReaderTest, TrianglesThatSealAnEdgeStay) {
  // A tetrahedron; edge 0-1 of one face is divided at 4.
  TriangleMesh mesh;
  mesh.positions_m = {{0, 0, 0}, {0.2f, 0, 0}, {0, 0.2f, 0}, {0, 0, 0.2f}, {0.1f, 0, 0}};
  mesh.triangles = {{0, 2, 4}, {4, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}, {0, 4, 1}};
  const auto sealed = Read(Write(mesh));
  ASSERT_TRUE(sealed.ok()) << sealed.status();
  EXPECT_EQ(sealed->triangles.size(), 6u);
  EXPECT_EQ(CheckPartHealth(*sealed).open_edge_count, 0);
  mesh.triangles.pop_back();
  EXPECT_EQ(CheckPartHealth(*Read(Write(mesh))).open_edge_count, 3);
}

// Both ends of an upload must compute the same digest.
TEST_P(EveryReaderTest, WrittenAndReadAgainThePartIsTheSame) {
  std::mt19937_64 random(7);
  for (int trial = 0; trial < 20; ++trial) {
    // Small faces, some of them thin or nearly welded, some without area.
    TriangleMesh mesh = Block();
    std::uniform_real_distribution<float> place(-0.3f, 0.3f);
    for (int i = 0; i < 300; ++i) {
      const float size = std::pow(10.0f, -9 + 8 * (place(random) / 0.6f + 0.5f));
      const auto base = static_cast<uint32_t>(mesh.positions_m.size());
      const Eigen::Vector3f at = i % 3 == 0 ? mesh.positions_m[random() % base]
                                            : Eigen::Vector3f(place(random), place(random), 0);
      for (int k = 0; k < 3; ++k) {
        mesh.positions_m.push_back(at + size * Eigen::Vector3f(place(random), place(random), 0));
      }
      mesh.triangles.push_back({base, base + 1, base + 2});
    }
    const auto once = Read(Write(mesh));
    ASSERT_TRUE(once.ok()) << once.status();
    const auto twice = Read(Write(*once));
    ASSERT_TRUE(twice.ok()) << twice.status();
    ASSERT_EQ(PartDigestOf(*twice), PartDigestOf(*once)) << trial;
    std::set<uint32_t> used;
    for (const auto& t : once->triangles) used.insert(t.begin(), t.end());
    EXPECT_EQ(used.size(), once->positions_m.size());
  }
}

// Kind 5: within 1 um wherever the part lies, or refused.
TEST_P(EveryReaderTest, FarFromTheOriginThePartIsRightOrRefused) {
  int read = 0, refused = 0;
  for (const float distance_m : {0.0f, 1.0f, 7.0f, 15.0f, 16.0f, 17.0f, 400.0f, 1e6f}) {
    const TriangleMesh moved = Moved(BoxMesh({0, 0, 0}, {0.125f, 0.25f, 0.5f}), {0, distance_m, 0});
    const auto mesh = Read(Write(moved));
    if (mesh.ok()) {
      ++read;
      const Eigen::Vector3d size = mesh->BoundingBox().sizes();
      EXPECT_NEAR((size - Eigen::Vector3d(0.125, 0.25, 0.5)).norm(), 0, 1e-6) << distance_m;
    } else {
      ++refused;
      EXPECT_THAT(std::string(mesh.status().message()),
                  AllOf(HasSubstr("from the origin of its file"), HasSubstr("at most 1 um")))
          << distance_m;
    }
    EXPECT_EQ(mesh.ok(), distance_m < 15.7f) << distance_m;
  }
  EXPECT_EQ(read, 4);
  EXPECT_EQ(refused, 4);
}

// Kind 8: bytes that belong to nothing.
TEST_P(EveryReaderTest, BytesLeftOverAreRefused) {
  const std::string bytes = Write(Block());
  ASSERT_TRUE(Read(bytes).ok());
  std::string facet(50, '\0');
  facet[20] = 1;
  for (const std::string& more :
       {std::string("x"), std::string("0 0 0\n"), std::string("7 0 0 0\n"), facet,
        std::string("glTF"), bytes.substr(bytes.size() / 2)}) {
    EXPECT_FALSE(Read(bytes + more).ok()) << more.size() << " bytes more";
  }
}

TEST_P(EveryReaderTest, CutFilesAreRefused) {
  const std::string bytes = Write(Block());
  // The text of an OBJ file may end anywhere.
  if (GetParam().extension == std::string("obj")) return;
  const size_t whole = bytes.find_last_not_of(" \n\0") + 1;
  for (size_t length = 0; length + 3 < whole; length += 1 + length / 40) {
    const auto mesh = Read(bytes.substr(0, length));
    if (mesh.ok()) {
      // The name of the solid behind "endsolid" may be missing.
      EXPECT_THAT(bytes.substr(0, length), HasSubstr("endsolid")) << length;
    }
  }
}

TEST_P(EveryReaderTest, TextMayHaveMarksAndAnyLineEnds) {
  if (!GetParam().is_text) return;
  const std::string text = Write(Block());
  const auto plain = Read(text);
  ASSERT_TRUE(plain.ok()) << plain.status();
  const std::vector<std::pair<const char*, std::string>> variants = {
      {"byte order mark", "\xef\xbb\xbf" + text},
      {"CR LF", absl::StrReplaceAll(text, {{"\n", "\r\n"}})},
      {"CR alone", absl::StrReplaceAll(text, {{"\n", "\r"}})},
      {"NUL at the end", text + std::string(4, '\0')},
      {"Ctrl-Z at the end", text + "\x1a"},
      {"blank lines at the end", text + "\r\n \n\t\n"}};
  for (const auto& [name, bytes] : variants) {
    const auto mesh = Read(bytes);
    ASSERT_TRUE(mesh.ok()) << name << ": " << mesh.status();
    EXPECT_EQ(PartDigestOf(*mesh), PartDigestOf(*plain)) << name;
  }
  std::string wide = "\xff\xfe";
  for (const char c : text) wide += {c, '\0'};
  EXPECT_THAT(ErrorOf(wide), AllOf(HasSubstr("byte order mark of UTF-16"), HasSubstr("UTF-8")));
}

INSTANTIATE_TEST_SUITE_P(Formats, EveryReaderTest, ::testing::ValuesIn(MeshFormats()),
                         [](const auto& format) {
                           std::string name;
                           for (const char c : std::string(format.param.name)) {
                             if (std::isalnum(static_cast<unsigned char>(c))) name += c;
                           }
                           return name;
                         });

TEST(MeshFormatsTest, HoldEveryFormatThatIsRead) {
  for (const std::string& extension : PartFormats()) {
    EXPECT_TRUE(std::any_of(MeshFormats().begin(), MeshFormats().end(),
                            [&](const MeshFormat& f) { return f.extension == extension; }))
        << extension << " is missing in mesh_formats.cpp";
  }
}

// --- single formats -----------------------------------------------------------------------------

absl::StatusOr<TriangleMesh> FromText(const std::string& text, const char* format) {
  return LoadPartFromMemory(text, format, "m", "part");
}

TEST(ObjFile, LogicalLinesAreJoinedAnywhere) {
  const std::string corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n";
  const std::string faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n";
  const auto plain = FromText(corners + faces, "obj");
  ASSERT_TRUE(plain.ok()) << plain.status();
  // A backslash and a line end in every place between two words, attached to the first or not.
  for (const char* lines : {"\n", "\r\n", "\r"}) {
    for (const std::string join : {" \\\n", "\\\n", "\\\n ", " \\ \n"}) {
      const std::string joined = absl::StrReplaceAll(corners + "vn 0 0 1\n" + faces, {{" ", join}});
      const auto mesh = FromText(absl::StrReplaceAll(joined, {{"\n", lines}}), "obj");
      ASSERT_TRUE(mesh.ok()) << mesh.status();
      EXPECT_EQ(PartDigestOf(*mesh), PartDigestOf(*plain));
    }
  }
  // A comment does not swallow the line behind it.
  const auto commented = FromText("# C:\\parts\\\n" + corners +
                                      "f 1 3 2 # D:\\\nf 1 2 4\n"
                                      "f 2 3 4\nf 1 4 3\n",
                                  "obj");
  ASSERT_TRUE(commented.ok()) << commented.status();
  EXPECT_EQ(PartDigestOf(*commented), PartDigestOf(*plain));
}

TEST(ObjFile, VerticesHaveCoordinatesAWeightAndAColour) {
  const std::string rest = "v 1 0 0\nv 0 1 0\nf 1 2 3\n";
  for (const char* good :
       {"v 0 0 0\n", "v 0 0 0 1\n", "v 0 0 0 1 0 0\n", "v 0 0 0 1 1 0 0\n", "v 0 0 0 # origin\n"}) {
    EXPECT_TRUE(FromText(good + rest, "obj").ok()) << good;
  }
  for (const char* bad : {"v 0 0 0 1 2\n", "v 0 0 0 x\n", "v 0 0 0 1 2 3 4 5\n", "v 0 0\n"}) {
    EXPECT_FALSE(FromText(bad + rest, "obj").ok()) << bad;
  }
}

TEST(Stl, HabitsOfExporters) {
  const std::string text = AsciiStl(Block());
  const auto plain = FromText(text, "stl");
  ASSERT_TRUE(plain.ok()) << plain.status();
  for (const auto& [from, to] : std::vector<std::pair<std::string, std::string>>{
           {"endsolid", "end solid"},
           {"endfacet", "end facet"},
           {"endloop", "END LOOP"},
           {"facet normal 0 0 0\n", "facet normal -nan(ind) 1.#QNAN nan\n"},
           {"facet normal 0 0 0\n", "facet normal 0 0 0 "},  // a facet on one line
           {"facet normal 0 0 0\n", "facet "}}) {
    const auto mesh = FromText(absl::StrReplaceAll(text, {{from, to}}), "stl");
    ASSERT_TRUE(mesh.ok()) << to << ": " << mesh.status();
    EXPECT_EQ(PartDigestOf(*mesh), PartDigestOf(*plain)) << to;
  }
  // Nothing of a facet may be lost.
  const size_t loop = text.find("  outer loop"), loop_end = text.find("  endloop");
  std::string empty = text;
  empty.erase(loop, text.find(" endfacet") - loop);
  EXPECT_FALSE(FromText(empty, "stl").ok());
  std::string twice = text;
  twice.insert(loop_end + 10, text.substr(loop, loop_end + 10 - loop));
  EXPECT_FALSE(FromText(twice, "stl").ok());
  std::string one_line = absl::StrReplaceAll(text, {{"\n", " "}});
  EXPECT_FALSE(FromText(one_line, "stl").ok());
}

// The header says 3 of 8 points: 218 of 2183 were read once.
TEST(PlyFile, MoreElementsThanTheHeaderCounts) {
  const std::string path =
      (std::filesystem::path(::testing::TempDir()) / "counted_wrong.ply").string();
  for (const char* form : {"ascii", "binary_little_endian", "binary_big_endian"}) {
    TriangleMesh points = Block();
    points.triangles.clear();
    std::string bytes = Ply(points, form);
    std::ofstream(path, std::ios::binary) << bytes;
    EXPECT_EQ(LoadPoints(path)->positions_m.size(), 8u) << form;
    std::ofstream(path, std::ios::binary) << absl::StrReplaceAll(bytes, {{"vertex 8", "vertex 3"}});
    EXPECT_THAT(std::string(LoadPoints(path).status().message()), HasSubstr("left behind")) << form;
  }
  std::filesystem::remove(path);
}

TEST(PlyFile, LinesWithMoreNumbersThanProperties) {
  const std::string text =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
      "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n";
  EXPECT_TRUE(FromText(text + "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n", "ply").ok());
  EXPECT_THAT(
      std::string(
          FromText(text + "0 0 0 7\n1 0 0 7\n0 1 0 7\n3 0 1 2\n", "ply").status().message()),
      HasSubstr("more numbers on its line"));
}

// --- glTF ---------------------------------------------------------------------------------------

GlbParts BlockParts() { return GlbOf(Block()); }

std::string GlbError(const GlbParts& parts) {
  const auto mesh = LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb");
  EXPECT_EQ(mesh.status().code(), absl::StatusCode::kInvalidArgument);
  return std::string(mesh.status().message());
}

// Kind 3: an unknown extension is refused by name wherever the default scene uses it.
TEST(GltfExtensions, AreRefusedByNameWhereTheDefaultSceneUsesThem) {
  const std::string use = R"("extensions": {"ACME_bend": {"angle": 3}})";
  const std::string declared = R"(, "extensionsUsed": ["ACME_bend"])";
  for (const bool declare : {false, true}) {
    for (int place = 0; place < 4; ++place) {
      GlbParts parts = BlockParts();
      if (declare) parts.root_extra = declared;
      if (place == 0) parts.nodes = R"([{"mesh": 0, )" + use + "}]";
      if (place == 1) parts.primitive_extra = ", " + use;
      if (place == 2) parts.position_accessor_extra = ", " + use;
      if (place == 3) parts.root_extra += ", " + use;
      EXPECT_THAT(GlbError(parts), HasSubstr("ACME_bend")) << place;
    }
  }
  // Declared and unused, used outside the default scene, or about looks: no obstacle.
  GlbParts parts = BlockParts();
  parts.root_extra = declared;
  EXPECT_TRUE(LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb").ok());
  parts.nodes = R"([{"mesh": 0}, {"mesh": 0, )" + use + "}]";
  EXPECT_TRUE(LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb").ok());
  parts.nodes = R"([{"mesh": 0, "extensions": {"KHR_lights_punctual": {"light": 0}}}])";
  EXPECT_TRUE(LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb").ok());
}

TEST(GltfExtensions, HiddenNodesAreNoPart) {
  GlbParts parts = BlockParts();
  parts.nodes =
      R"([{"mesh": 0}, {"children": [2], "extensions": {"KHR_node_visibility": {"visible": false}}},
          {"mesh": 0, "translation": [3, 0, 0]}])";
  parts.scene_nodes = "[0, 1]";
  const auto mesh = LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb");
  ASSERT_TRUE(mesh.ok()) << mesh.status();
  EXPECT_EQ(mesh->triangles.size(), 12u);
}

TEST(Glb, NodesOfScaleZeroAreNoPart) {
  GlbParts parts = BlockParts();
  const auto clean = LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb");
  for (const char* scale : {"[0, 0, 0]", "[1e-9, 1e-9, 1e-9]", "[0, 0, 4]"}) {
    parts.nodes = absl::StrCat(R"([{"mesh": 0}, {"mesh": 0, "translation": [5, 5, 5], "scale": )",
                               scale, "}]");
    parts.scene_nodes = "[1, 0]";
    const auto mesh = LoadPartFromMemory(parts.ToBytes(), "glb", "", "part.glb");
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(PartDigestOf(*mesh), PartDigestOf(*clean)) << scale;
  }
}

TEST(Glb, ChunksAreReadToTheEnd) {
  const std::string bytes = BlockParts().ToBytes();
  const auto with_length = [](std::string file) {
    const auto size = static_cast<uint32_t>(file.size());
    file.replace(8, 4, Bytes<uint32_t>({size}));
    return file;
  };
  const auto error = [](const std::string& file) {
    return std::string(LoadPartFromMemory(file, "glb", "", "part.glb").status().message());
  };
  const std::string chunk = Bytes<uint32_t>({4});
  EXPECT_THAT(error(bytes + "more"), HasSubstr("too long"));
  EXPECT_THAT(error(with_length(bytes + chunk + std::string("BIN\0more", 8))),
              HasSubstr("chunk 2"));
  EXPECT_THAT(error(with_length(bytes + "more")), HasSubstr("chunk 2"));
  // More bytes in the binary chunk than the buffer has.
  GlbParts parts = BlockParts();
  parts.indices += std::string(8, '\0');
  std::string longer = parts.ToBytes();
  const std::string stated = absl::StrCat("\"byteLength\": ", 96 + 144 + 8, "}],");
  ASSERT_NE(longer.find(stated), std::string::npos);
  longer.replace(longer.find(stated), stated.size(), "\"byteLength\": 240}],");
  EXPECT_THAT(error(longer), HasSubstr("buffers[0] uses 240"));
}

// The inputs of the issue, where they lie beside the tree.
TEST(CaseFiles, AreReadAsTheirTableSays) {
  const auto shared = SharedData();
  if (!shared || !std::filesystem::exists(*shared / "data/cases/files")) GTEST_SKIP();
  const auto load = [&](const std::string& name) {
    const bool gltf = name.find(".gl") != std::string::npos;
    return LoadPart((*shared / "data/cases/files" / name).string(), gltf ? "" : "mm");
  };
  const auto clean = load("f01_clean.obj");
  ASSERT_TRUE(clean.ok()) << clean.status();
  for (const char* name : {"f01_zero_area_face.obj", "f13_attached.obj", "f13_vn_continued.obj",
                           "f18_bom.obj", "f18_cr.obj"}) {
    const auto mesh = load(name);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_EQ(PartDigestOf(*mesh), PartDigestOf(*clean)) << name;
  }
  for (const auto& [name, size_mm] : std::vector<std::pair<const char*, Eigen::Vector3d>>{
           {"f15_sparse.gltf", {20, 20, 20}},
           {"quantized.glb", {50, 40, 20}},
           {"draco_optional_fallback.glb", {50, 40, 20}},
           {"f17_bom.stl", {20, 20, 20}},
           {"f17_end_solid.stl", {20, 20, 20}},
           {"cr_only.stl", {50, 40, 20}},
           {"trailing_nul.stl", {50, 40, 20}},
           {"cyl_loose_1e6.obj", {20, 20, 20}},
           {"f02_gpu_instancing.gltf", {120, 20, 20}}}) {
    const auto mesh = load(name);
    ASSERT_TRUE(mesh.ok()) << mesh.status();
    EXPECT_NEAR((1e3 * mesh->BoundingBox().sizes() - size_mm).norm(), 0, 1e-3)
        << name << " " << (1e3 * mesh->BoundingBox().sizes()).transpose();
  }
  EXPECT_THAT(std::string(load("f07_far.obj").status().message()),
              HasSubstr("lies 894.4 m from the origin"));
}

TEST(LoadPartFile, NamesAFileInOtherCase) {
  const std::filesystem::path folder =
      std::filesystem::path(::testing::TempDir()) / "other_case_of_part";
  std::filesystem::create_directories(folder);
  std::ofstream((folder / "Part.STL").string(), std::ios::binary) << BinaryStl(Block());
  EXPECT_THAT(std::string(LoadPart((folder / "part.stl").string(), "m").status().message()),
              HasSubstr("no such file, but \"Part.STL\""));
  EXPECT_THAT(std::string(LoadPart((folder / "other.stl").string(), "m").status().message()),
              ::testing::Not(HasSubstr("but")));
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sightline
