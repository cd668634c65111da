// SPDX-License-Identifier: Apache-2.0
// Part files made to take long, or much memory, or to read what they should not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <numbers>
#include <random>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "core/part/part_health.h"
#include "tests/limits/same_hash.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::StartsWith;

using Outline = std::vector<std::array<double, 2>>;

double AreaOf(const Outline& outline) {
  double twice = 0;
  for (size_t i = 0; i < outline.size(); ++i) {
    const auto& a = outline[i];
    const auto& b = outline[(i + 1) % outline.size()];
    twice += a[0] * b[1] - a[1] * b[0];
  }
  return twice / 2;
}

// A face of the outline in a plane that leans, `times` times.
std::string Obj(const Outline& outline, int times = 1) {
  std::string text;
  for (const auto& [x, y] : outline) absl::StrAppend(&text, "v ", x, " ", y, " ", 0.5 * x, "\n");
  std::string face = "f";
  for (size_t i = 1; i <= outline.size(); ++i) absl::StrAppend(&face, " ", i);
  for (int i = 0; i < times; ++i) absl::StrAppend(&text, face, "\n");
  return text;
}

// "ok" if the triangles cover the face once, none turned over.
std::string Check(const Outline& outline, int times = 1) {
  const auto mesh = LoadPartFromMemory(Obj(outline, times), "obj", "m", "part.obj");
  if (!mesh.ok()) return std::string(mesh.status().message());
  // Ears may lie on a line.
  const size_t cut = mesh->triangles.size() + static_cast<size_t>(mesh->left_out_triangles);
  if (cut != times * (outline.size() - 2)) return absl::StrCat(cut, " triangles");
  const double slope = std::sqrt(1.25);
  double area = 0;
  for (size_t t = 0; t < mesh->triangles.size(); ++t) {
    const double turned = (mesh->Corner(t, 1) - mesh->Corner(t, 0))
                              .cross(mesh->Corner(t, 2) - mesh->Corner(t, 0))
                              .z();
    if (turned < -1e-6) return absl::StrCat("triangle ", t, " is turned over");
    area += mesh->Area(t);
  }
  const double expected = times * slope * AreaOf(outline);
  if (std::abs(area - expected) > 1e-4 * expected) return absl::StrCat(area, " not ", expected);
  return "ok";
}

Outline Comb(int teeth) {
  Outline outline = {{0, 0}, {1, 0}};
  for (int i = teeth; i > 0; --i) {
    outline.push_back({static_cast<double>(i) / teeth, 1});
    outline.push_back({(i - 0.5) / teeth, 0.01});
  }
  outline.push_back({0, 1});
  return outline;
}

Outline Star(int corners) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> radius(0.1, 1);
  Outline outline;
  for (int i = 0; i < corners; ++i) {
    const double angle = 2 * std::numbers::pi * i / corners, r = radius(random);
    outline.push_back({r * std::cos(angle), r * std::sin(angle)});
  }
  return outline;
}

// A band that winds inwards.
Outline Spiral(int corners) {
  Outline outline;
  const int half = corners / 2;
  for (const bool inner : {false, true}) {
    for (int k = 0; k < half; ++k) {
      const int i = inner ? half - 1 - k : k;
      const double angle = 0.05 * i;
      const double r = 1 + 0.01 * angle + (inner ? -0.02 : 0);
      outline.push_back({r * std::cos(angle), r * std::sin(angle)});
    }
  }
  return outline;
}

// A plate with holes, each tied to the outline by an edge that is there twice.
Outline PerforatedPlate(int holes, int corners) {
  Outline outline = {{0, 0}};
  for (int h = 0; h < holes; ++h) {
    const double x = (h + 0.5) / holes, r = 0.3 / holes;
    outline.push_back({x, 0});
    for (int k = 0; k <= corners; ++k) {
      const double angle = -std::numbers::pi / 2 - 2 * std::numbers::pi * k / corners;
      outline.push_back({x + r * std::cos(angle), 0.5 / holes + r * std::sin(angle)});
    }
    outline.push_back({x, 0});
  }
  outline.insert(outline.end(), {{1, 0}, {1, 0.2}, {0, 0.2}});
  return outline;
}

TEST(Polygons, ConcaveFacesWithManyCornersKeepTheirShape) {
  for (const auto& [name, outline] :
       {std::pair("comb", Comb(2000)), {"star", Star(4096)}, {"plate", PerforatedPlate(50, 80)}}) {
    EXPECT_EQ(WithinLimits({.cpu_time_s = 5}, [&, &o = outline] { return Check(o); }), "ok")
        << name;
  }
}

TEST(Polygons, ManyLargeFacesTakeSeconds) {
  EXPECT_EQ(WithinLimits({.cpu_time_s = 10}, [] { return Check(Star(4096), 20); }), "ok");
  EXPECT_EQ(WithinLimits({.cpu_time_s = 10}, [] { return Check(PerforatedPlate(1000, 100)); }),
            "ok");
}

// Polygons that would take much longer are refused rather than cut wrongly.
TEST(Polygons, TheWorkOfAFileIsLimited) {
  const auto ends = [](const Outline& outline, int times) {
    const std::string said =
        WithinLimits({.cpu_time_s = 60}, [&] { return Check(outline, times); });
    EXPECT_TRUE(said == "ok" || said.find("too long to cut") != std::string::npos) << said;
    return said;
  };
  ends(Comb(100'000), 1);
  ends(Spiral(100'000), 1);
  EXPECT_THAT(ends(Comb(20'000), 200), HasSubstr("part.obj: line "));
}

TEST(Polygons, RandomCornersNeverHang) {
  EXPECT_EQ(
      WithinLimits({.cpu_time_s = 60},
                   [] {
                     std::mt19937 random(3);
                     std::uniform_int_distribution<int> place(0, 9);
                     for (int i = 0; i < 3000; ++i) {
                       Outline outline(4 + i % 60);
                       for (auto& corner : outline) {
                         corner = {0.1 * place(random), 0.1 * place(random)};
                       }
                       const auto mesh = LoadPartFromMemory(Obj(outline), "obj", "m", "part.obj");
                       if (mesh.ok() &&
                           mesh->triangles.size() + static_cast<size_t>(mesh->left_out_triangles) !=
                               outline.size() - 2) {
                         return absl::StrCat("case ", i);
                       }
                     }
                     return std::string("ok");
                   }),
      "ok");
}

TEST(PartFiles, ReadingEndsWhenNobodyWaits) {
  std::string points = "solid a\n", facets;
  for (int i = 0; i < 40'000; ++i) {
    facets +=
        "facet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
        "endfacet\n";
  }
  const std::string stl = points + facets + "endsolid a\n";
  const std::string obj = Obj(Comb(20'000), 3);
  for (const auto& [format, bytes] : {std::pair("stl", &stl), {"obj", &obj}}) {
    const auto mesh = LoadPartFromMemory(*bytes, format, "m", "part", [] {
      return absl::DeadlineExceededError("the client's deadline passed");
    });
    EXPECT_EQ(mesh.status().code(), absl::StatusCode::kDeadlineExceeded) << format;
  }
}

TEST(PartFiles, ManyMaterialsAreFoundByName) {
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  for (int i = 0; i < 200'000; ++i) absl::StrAppend(&text, "usemtl m", i, "\nf 1 2 3\n");
  EXPECT_EQ(WithinLimits({.cpu_time_s = 5},
                         [&] {
                           const auto mesh = LoadPartFromMemory(text, "obj", "m", "part");
                           return absl::StrCat(mesh->material_names.size(), " ",
                                               mesh->material_names[65'533], " ",
                                               mesh->triangle_material[199'999]);
                         }),
            "65535 m65533 65534");
}

// A tetrahedron of this size about the middle.
void AddTetrahedron(float size, const Eigen::Vector3f& middle, TriangleMesh* mesh) {
  const auto first = static_cast<uint32_t>(mesh->positions_m.size());
  for (const Eigen::Vector3f& corner :
       {Eigen::Vector3f(1, 1, 1), {1, -1, -1}, {-1, 1, -1}, {-1, -1, 1}}) {
    mesh->positions_m.push_back(middle + size * corner);
  }
  for (const auto& [a, b, c] :
       std::vector<std::array<uint32_t, 3>>{{0, 1, 2}, {0, 3, 1}, {0, 2, 3}, {1, 3, 2}}) {
    mesh->triangles.push_back({first + a, first + b, first + c});
  }
}

TEST(PartHealth, ManyComponentsTakeSeconds) {
  TriangleMesh nested, scattered;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> place(0, 1);
  for (int i = 1; i <= 100'000; ++i) {
    AddTetrahedron(1e-5F * static_cast<float>(i), {0, 0, 0}, &nested);
    AddTetrahedron(1e-4F, {place(random), place(random), place(random)}, &scattered);
  }
  EXPECT_THAT(
      WithinLimits({.cpu_time_s = 20}, [&] { return CheckPartHealth(nested).findings.back(); }),
      HasSubstr("too many within each other"));
  EXPECT_EQ(WithinLimits({.cpu_time_s = 20},
                         [&] {
                           const PartHealth health = CheckPartHealth(scattered);
                           return absl::StrCat(health.component_count, " ",
                                               health.flipped_component_count);
                         }),
            "100000 0");
}

// One outline of 20 million corners: the limit on triangles alone would come too late.
TEST(PlyFiles, AFaceOfTooManyCornersIsRefusedBeforeItIsCut) {
  constexpr size_t kCorners = 20'000'000;
  std::string bytes = absl::StrCat(
      "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty char x\n"
      "property char y\nproperty char z\nelement face 1\n"
      "property list int uchar vertex_indices\nend_header\n");
  bytes += std::string("\0\0\0\1\0\0\0\1\0", 9);
  const auto count = static_cast<uint32_t>(kCorners);
  bytes.append(reinterpret_cast<const char*>(&count), 4);
  for (size_t i = 0; i < kCorners; ++i) bytes.push_back(static_cast<char>(i % 3));
  EXPECT_THAT(
      WithinLimits(
          {.cpu_time_s = 2, .memory_bytes = int64_t{64} << 20},
          [&] { return LoadPartFromMemory(bytes, "ply", "m", "part.ply").status().ToString(); }),
      testing::AllOf(StartsWith("INVALID_ARGUMENT: part.ply: face 0 has 20000000 corners"),
                     HasSubstr("at most 1000000")));
}

TEST(ObjFiles, AFaceOfTooManyCornersIsRefusedBeforeItIsCut) {
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf";
  for (int i = 0; i < 10'000'000; ++i) text += " 1 2 3";
  EXPECT_THAT(
      WithinLimits(
          {.cpu_time_s = 2, .memory_bytes = int64_t{64} << 20},
          [&] { return LoadPartFromMemory(text, "obj", "m", "part.obj").status().ToString(); }),
      testing::AllOf(StartsWith("INVALID_ARGUMENT: part.obj: line 4: a face has"),
                     HasSubstr("at most 1000000")));
}

// --- glTF ---------------------------------------------------------------------------------------

std::string Glb(std::string json) {
  json.resize((json.size() + 3) / 4 * 4, ' ');
  const auto word = [](size_t value) {
    const auto number = static_cast<uint32_t>(value);
    std::string bytes(4, '\0');
    std::memcpy(bytes.data(), &number, 4);
    return bytes;
  };
  return absl::StrCat("glTF", word(2), word(20 + json.size()), word(json.size()), "JSON", json);
}

// Cells of a grid of 2^-18 m that one multiplicative hash without a seed sends to the same few
// slots of tables of up to 2^18: with linear probing every vertex would look at all before it.
TEST(StlFiles, CornersThatShareSlotsOfATableTakeNoTime) {
  constexpr size_t kCorners = 60'000;
  const auto mixed = [](uint64_t hash, int coordinate) {
    hash = (hash ^ static_cast<uint64_t>(coordinate)) * 0x9e3779b97f4a7c15u;
    return hash ^ (hash >> 29);
  };
  std::vector<float> corners = {1, 1, 1};  // the largest, which the grid follows from
  for (int x = 0; corners.size() < 3 * kCorners; ++x) {
    for (int y = 0; y < 262'144 && corners.size() < 3 * kCorners; ++y) {
      for (int z = 0; z < 512; ++z) {
        if ((mixed(mixed(mixed(0, x), y), z) & 0x3ffffu) >= 256) continue;
        for (const int cell : {x, y, z})
          corners.push_back((static_cast<float>(cell) + 0.5f) * 0x1p-18f);
      }
    }
  }
  // Every corner in a triangle of its own with these two.
  const float base[] = {1, 0, 0, 0, 1, 0};
  const auto triangles = static_cast<uint32_t>(corners.size() / 3);
  std::string bytes(80, '\0');
  bytes.append(reinterpret_cast<const char*>(&triangles), 4);
  for (uint32_t t = 0; t < triangles; ++t) {
    bytes.append(12, '\0');
    bytes.append(reinterpret_cast<const char*>(&corners[size_t{3} * t]), 12);
    bytes.append(reinterpret_cast<const char*>(base), 24);
    bytes.append(2, '\0');
  }
  EXPECT_EQ(WithinLimits({.cpu_time_s = 2},
                         [&] {
                           const auto mesh = LoadPartFromMemory(bytes, "stl", "m", "part.stl");
                           return mesh.ok() ? absl::StrCat(mesh->positions_m.size())
                                            : std::string(mesh.status().message());
                         }),
            absl::StrCat(size_t{triangles} + 2));
}

TEST(ObjFiles, MaterialsWithTheSameHashTakeNoTime) {
  std::string text = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
  const std::vector<std::string> names = SameHash(30'000);
  ASSERT_EQ(std::hash<std::string>()(names.front()), std::hash<std::string>()(names.back()));
  for (const std::string& name : names) absl::StrAppend(&text, "usemtl ", name, "\nf 1 2 3\n");
  EXPECT_EQ(WithinLimits({.cpu_time_s = 1},
                         [&] {
                           const auto mesh = LoadPartFromMemory(text, "obj", "m", "part.obj");
                           return mesh.ok() ? absl::StrCat(mesh->material_names.size())
                                            : std::string(mesh.status().message());
                         }),
            "30000");
}

TEST(GltfFiles, JsonThatWouldFillTheMemoryIsRefused) {
  std::string zeros = "0";
  for (int i = 0; i < 5'000'000; ++i) zeros += ",0";
  const std::string many =
      absl::StrCat(R"({"asset": {"version": "2.0"}, "extras": [)", zeros, "]}");
  const std::string large = absl::StrCat(R"({"asset": {"version": "2.0"}, "extras": ")",
                                         std::string(size_t{70} << 20, 'x'), "\"}");
  for (const std::string* json : {&many, &large}) {
    const std::string bytes = Glb(*json);
    EXPECT_THAT(
        WithinLimits(
            {.cpu_time_s = 5, .memory_bytes = int64_t{400} << 20},
            [&] { return LoadPartFromMemory(bytes, "glb", "", "part.glb").status().ToString(); }),
        testing::AllOf(StartsWith("INVALID_ARGUMENT: part.glb: its JSON has"),
                       HasSubstr("can be read")));
  }
}

TEST(GltfFiles, AsMuchJsonAsIsAllowedNeedsLessThanAGigabyte) {
  std::string zeros = "0";
  for (int i = 0; i < 1'990'000; ++i) zeros += ",0";
  const std::string bytes =
      Glb(absl::StrCat(R"({"asset": {"version": "2.0"}, "extras": [)", zeros, "]}"));
  EXPECT_THAT(
      WithinLimits(
          {.cpu_time_s = 10, .memory_bytes = int64_t{1} << 30},
          [&] { return LoadPartFromMemory(bytes, "glb", "", "part.glb").status().ToString(); }),
      HasSubstr("INVALID_ARGUMENT: part.glb: has no triangles"));
}

// A list of `count` elements.
std::string ListOf(size_t count, const std::string& element) {
  std::string list = "[" + element;
  list.reserve(count * (element.size() + 1) + 2);
  for (size_t i = 1; i < count; ++i) list += "," + element;
  return list + "]";
}

std::string LoadGlb(const std::string& members) {
  const std::string bytes = Glb(absl::StrCat(R"({"asset": {"version": "2.0"}, )", members, "}"));
  return WithinLimits({.cpu_time_s = 10, .memory_bytes = int64_t{1} << 30}, [&] {
    return LoadPartFromMemory(bytes, "glb", "", "part.glb").status().ToString();
  });
}

// Read, an empty element takes a hundred to a thousand times its two or three bytes.
TEST(GltfFiles, ElementsThatWouldFillTheMemoryAreRefused) {
  for (const std::string list : {"accessors", "bufferViews", "materials", "nodes", "samplers",
                                 "textures", "scenes", "skins", "images", "cameras"}) {
    EXPECT_THAT(LoadGlb(absl::StrCat("\"", list, "\": ", ListOf(1'900'000, "{}"))),
                testing::AllOf(StartsWith("INVALID_ARGUMENT"), HasSubstr("other elements")))
        << list;
  }
  EXPECT_THAT(LoadGlb(absl::StrCat(R"("meshes": [{"primitives": )",
                                   ListOf(1'900'000, "{\"attributes\":{}}"), "}]")),
              StartsWith("INVALID_ARGUMENT"));
}

TEST(GltfFiles, AsManyElementsAsAreAllowedNeedLessThanAGigabyte) {
  for (const auto& [list, count] :
       {std::pair("materials", 125'000), {"nodes", 580'000}, {"samplers", 850'000}}) {
    EXPECT_THAT(LoadGlb(absl::StrCat("\"", list, "\": ", ListOf(count, "{}"))),
                HasSubstr("INVALID_ARGUMENT: part.glb: has no triangles"))
        << list;
  }
}

class GltfFolderTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / absl::StrCat("gltf_", getpid());
    fs::create_directories(folder_ / "part");
    const std::vector<float> positions = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    for (const fs::path& path : {folder_ / "outside.bin", folder_ / "part" / "a b.bin"}) {
      std::ofstream(path, std::ios::binary)
          .write(reinterpret_cast<const char*>(positions.data()), 36);
    }
  }
  void TearDown() override { fs::remove_all(folder_); }
  std::string Load(const std::string& uri, const std::string& more_buffers = "") {
    const fs::path path = folder_ / "part" / "part.gltf";
    std::ofstream(path) << absl::StrCat(
        R"({"asset": {"version": "2.0"}, "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}],
            "images": [{"uri": "pipe"}, {"uri": "../outside.bin"}],
            "buffers": [{"byteLength": 36, "uri": ")",
        uri, "\"}", more_buffers, R"(],
            "bufferViews": [{"buffer": 0, "byteLength": 36}],
            "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
            "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}]})");
    return WithinLimits({.cpu_time_s = 2, .memory_bytes = int64_t{1} << 30},
                        [&] { return LoadPart(path.string(), "").status().ToString(); });
  }
  fs::path folder_;
};

TEST_F(GltfFolderTest, OnlyFilesOfThePartsFolderAreRead) {
  // A pipe that nobody writes to, and a picture that is none: neither may be opened.
  ASSERT_EQ(mkfifo((folder_ / "part" / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(Load("a%20b.bin"), "OK");
  EXPECT_EQ(Load("./a b.bin"), "OK");
  for (const std::string& uri :
       {std::string("../outside.bin"), std::string("%2e%2e/outside.bin"),
        std::string("x/../../outside.bin"), (folder_ / "outside.bin").string(),
        std::string("file:///etc/hostname"), std::string("..\\\\outside.bin")}) {
    EXPECT_THAT(Load(uri), testing::AllOf(StartsWith("INVALID_ARGUMENT"),
                                          HasSubstr("buffers[0].uri"), HasSubstr("folder")))
        << uri;
  }
  EXPECT_THAT(Load("pipe"), HasSubstr("no regular file"));
}

TEST_F(GltfFolderTest, LinksOutOfTheFolderAreNotFollowed) {
  fs::create_symlink("../outside.bin", folder_ / "part" / "out.bin");
  fs::create_directory_symlink("..", folder_ / "part" / "up");
  fs::create_symlink("a b.bin", folder_ / "part" / "in.bin");
  EXPECT_EQ(Load("in.bin"), "OK");
  for (const std::string uri : {"out.bin", "up/outside.bin"}) {
    EXPECT_THAT(Load(uri), testing::AllOf(StartsWith("INVALID_ARGUMENT"), HasSubstr("link out of")))
        << uri;
  }
}

// tinygltf looks into the working folder as well.
TEST_F(GltfFolderTest, TheWorkingFolderIsNoPlaceOfBuffers) {
  const fs::path before = fs::current_path();
  fs::current_path(folder_);
  const std::string said = Load("outside.bin");
  fs::current_path(before);
  EXPECT_THAT(said, testing::AllOf(StartsWith("INVALID_ARGUMENT"), HasSubstr("outside.bin")));
}

TEST_F(GltfFolderTest, BuffersTogetherAreLimited) {
  const fs::path sparse = folder_ / "part" / "large.bin";
  std::ofstream(sparse).put('x');
  fs::resize_file(sparse, uint64_t{3} << 30);
  EXPECT_THAT(Load("a b.bin", R"(, {"byteLength": 3221225472, "uri": "large.bin"})"),
              testing::AllOf(StartsWith("INVALID_ARGUMENT"), HasSubstr("large.bin")));
}

}  // namespace
}  // namespace sightline
