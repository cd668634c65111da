// SPDX-License-Identifier: Apache-2.0
#include "planner_client/replanning/measured_part.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "core/part/load_part.h"
#include "core/part/part_digest.h"
#include "core/physics/angle.h"
#include "tests/core/registration/measured_shapes.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

using testing::Test;

bool Says(const absl::Status& status, const std::string& text) {
  return std::string(status.message()).find(text) != std::string::npos;
}

TEST(AssignScans, NumbersInNamesOrTheOrder) {
  const auto named = AssignScans({"b/scan_03.ply", "a/scan_01.ply"}, 5);
  ASSERT_TRUE(named.ok()) << named.status();
  ASSERT_EQ(named->size(), 2u);
  EXPECT_EQ((*named)[0].path, "a/scan_01.ply");
  EXPECT_EQ((*named)[0].scan, 0);
  EXPECT_EQ((*named)[1].scan, 2);
  const auto ordered = AssignScans({"left.ply", "right.ply"}, 2);
  ASSERT_TRUE(ordered.ok()) << ordered.status();
  EXPECT_EQ((*ordered)[0].path, "left.ply");
  EXPECT_EQ((*ordered)[0].scan, 0);
  EXPECT_EQ((*ordered)[1].scan, 1);
}

TEST(AssignScans, WhatFitsNoScanIsNamed) {
  const auto mixed = AssignScans({"scan_01.ply", "right.ply"}, 5);
  EXPECT_TRUE(Says(mixed.status(), "right.ply")) << mixed.status();
  const auto mixed_too = AssignScans({"right.ply", "scan_02.ply"}, 5);
  EXPECT_TRUE(Says(mixed_too.status(), "scan_02.ply")) << mixed_too.status();
  const auto beyond = AssignScans({"scan_06.ply"}, 5);
  EXPECT_TRUE(Says(beyond.status(), "scan_06.ply")) << beyond.status();
  EXPECT_FALSE(AssignScans({"scan_00.ply"}, 5).ok());
  const auto twice = AssignScans({"a/scan_02.ply", "b/scan_02.ply"}, 5);
  EXPECT_TRUE(Says(twice.status(), "b/scan_02.ply")) << twice.status();
  EXPECT_FALSE(AssignScans({"a.ply", "b.ply", "c.ply"}, 2).ok());
}

class MeasuredPartTest : public Test {
 protected:
  MeasuredPartTest()
      : folder_(std::filesystem::temp_directory_path() /
                absl::StrCat("measured_part_", getpid(), "_",
                             testing::UnitTest::GetInstance()->current_test_info()->name())),
        model_(StepPart()) {
    std::filesystem::create_directories(folder_);
    inspection_.targets.spacing_m = 0.004;
    truth_.centre_m = model_.BoundingBox().center();
    truth_.parameters << 0.8 * kRadPerDeg, 0.4 * kRadPerDeg, -0.5 * kRadPerDeg, 1.5e-3, 1e-3,
        -0.8e-3;
    scan_.camera_distance_m = 0.3;
    scan_.triangulation_angle_rad = 0.5;
  }
  ~MeasuredPartTest() override { std::filesystem::remove_all(folder_); }

  std::string Write(const std::string& name, const SurfaceSample& sample) {
    std::vector<Eigen::Vector3f> positions, normals;
    for (const auto& p : sample.positions_m) positions.push_back(p.cast<float>());
    for (const auto& n : sample.normals) normals.push_back(n.cast<float>());
    const std::string path = (folder_ / name).string();
    EXPECT_TRUE(WritePlyPoints(path, positions, normals).ok());
    return path;
  }
  std::string WriteText(const std::string& name, const std::string& text) {
    const std::string path = (folder_ / name).string();
    std::ofstream(path) << text;
    return path;
  }
  SurfaceSample Measured(const TriangleMesh& mesh, const PartPose& pose, uint64_t seed,
                         int count = 8000) {
    CounterRandom random(seed, 0);
    return Measure(SampleSurface(mesh, count, random), pose, 2e-5, random);
  }
  absl::StatusOr<MeasuredPart> Find(const std::string& path) {
    return FindMeasuredPart(model_, inspection_, {{path, 0}}, {scan_}, {});
  }

  std::filesystem::path folder_;
  TriangleMesh model_;
  Inspection inspection_;
  PartPose truth_;
  Measurement scan_;
};

TEST_F(MeasuredPartTest, PartIsFoundWhereItLies) {
  const auto part = Find(Write("points.ply", Measured(model_, truth_, 1)));
  ASSERT_TRUE(part.ok()) << part.status();
  const PoseVector error = part->registration.pose.parameters - truth_.parameters;
  for (int k = 0; k < 6; ++k) {
    EXPECT_LT(std::abs(error[k]), 4 * std::sqrt(part->registration.covariance(k, k))) << k;
  }
  // The rig's placement puts every point of the part where the pose says.
  const Eigen::Vector3d x(0.07, 0.01, 0.02), c = model_.BoundingBox().center();
  EXPECT_LT((part->placement.rotation * (x - part->placement.centre_m) -
             (part->registration.pose.Matrix() * x - c))
                .norm(),
            1e-12);
  const v1::AsMeasured& message = part->message;
  ASSERT_EQ(message.scans_size(), 1);
  EXPECT_EQ(message.scans(0).file(), "points.ply");
  EXPECT_EQ(message.scans(0).points(), 8000);
  EXPECT_LT(message.scans(0).upper_quartile_distance_m(), 4e-5);
  EXPECT_EQ(message.covariance_size(), 36);
  EXPECT_EQ(message.pose().matrix_size(), 16);
  EXPECT_EQ(message.not_fixed_size(), 0);
  EXPECT_NEAR(message.translation_m().x(), 1.5e-3, 1e-5);
  EXPECT_NEAR(message.rotation_deg().z(), -0.5, 0.01);
  // No surface deviates: nothing moves.
  EXPECT_EQ(message.deviation().significant_targets(), 0);
  EXPECT_EQ(PartDigestOf(*part->mesh), PartDigestOf(model_));
}

TEST_F(MeasuredPartTest, SameFilesSameBytesWhateverTheThreads) {
  const std::string path = Write("points.ply", Measured(model_, truth_, 1));
  MeasuredPartOptions one, three;
  one.threads = 1;
  three.threads = 3;
  const auto a = FindMeasuredPart(model_, inspection_, {{path, 0}}, {scan_}, one);
  const auto b = FindMeasuredPart(model_, inspection_, {{path, 0}}, {scan_}, three);
  ASSERT_TRUE(a.ok() && b.ok());
  EXPECT_EQ(a->message.SerializeAsString(), b->message.SerializeAsString());
}

TEST_F(MeasuredPartTest, BumpIsFoundAndShownInTheMesh) {
  SurfaceSample sample = Measured(model_, PartPose(), 2, 60'000);
  for (size_t i = 0; i < sample.positions_m.size(); ++i) {
    Eigen::Vector3d& p = sample.positions_m[i];
    const double r_m = std::hypot(p.x() - 0.055, p.y() - 0.03);
    if (sample.normals[i].z() > 0.5 && p.z() < 0.035) {
      p.z() += 0.0015 * std::exp(-0.5 * r_m * r_m / (0.007 * 0.007));
    }
    p = truth_.Matrix() * p;
    sample.normals[i] = truth_.Rotation() * sample.normals[i];
  }
  inspection_.uncertainty.emplace();
  inspection_.uncertainty->detection.standard_deviations_px = {0.05};
  const auto part = Find(Write("points.ply", sample));
  ASSERT_TRUE(part.ok()) << part.status();
  const v1::SurfaceDeviation& found = part->message.deviation();
  EXPECT_GT(found.significant_targets(), 3);
  EXPECT_NEAR(found.largest_m(), 0.0015, 4e-4);
  EXPECT_NEAR(found.largest_place_m().x(), 0.055, 0.006);
  EXPECT_NEAR(found.largest_place_m().y(), 0.03, 0.006);
  const SurfaceIndex index(*part->mesh);
  const auto top = index.Nearest({0.055, 0.03, 0.0315}, Eigen::Vector3d::UnitZ(), 0.01);
  ASSERT_TRUE(top);
  EXPECT_LT(top->distance_m, 5e-4);
}

TEST_F(MeasuredPartTest, AnotherPartIsRefused) {
  const TriangleMesh other = SphereMesh(0.04, 3);
  PartPose there;
  there.parameters << 0, 0, 0, 0.04, 0.03, 0.02;
  const auto part = Find(Write("other.ply", Measured(other, there, 3)));
  EXPECT_EQ(part.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(Says(part.status(), "other.ply")) << part.status();
  EXPECT_TRUE(Says(part.status(), "tolerated")) << part.status();
  EXPECT_TRUE(Says(part.status(), "mm")) << part.status();
}

TEST_F(MeasuredPartTest, PartFarOffIsRefused) {
  for (const double shift_m : {0.1, 0.03}) {
    PartPose far = truth_;
    far.parameters[3] = shift_m;
    const auto part = Find(Write("far.ply", Measured(model_, far, 4)));
    EXPECT_EQ(part.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_TRUE(Says(part.status(), "far.ply")) << part.status();
    EXPECT_TRUE(Says(part.status(), "mm")) << part.status();
  }
}

TEST_F(MeasuredPartTest, MillimetresAreRecognised) {
  SurfaceSample sample = Measured(model_, truth_, 5);
  for (Eigen::Vector3d& p : sample.positions_m) p *= 1000;
  const auto part = Find(Write("mm.ply", sample));
  EXPECT_TRUE(Says(part.status(), "millimetres")) << part.status();
  EXPECT_TRUE(Says(part.status(), "mm.ply")) << part.status();
}

TEST_F(MeasuredPartTest, PointsThatAreNoNumbersAreNamed) {
  SurfaceSample sample = Measured(model_, truth_, 6);
  sample.positions_m[17].y() = std::numeric_limits<double>::quiet_NaN();
  sample.positions_m[90].x() = std::numeric_limits<double>::infinity();
  const auto part = Find(Write("nan.ply", sample));
  EXPECT_EQ(part.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(Says(part.status(), "nan.ply: point 17")) << part.status();
  EXPECT_TRUE(Says(part.status(), "2")) << part.status();
}

TEST_F(MeasuredPartTest, EmptyAndDamagedFilesAreRefused) {
  const std::string header = "ply\nformat ascii 1.0\nelement vertex ";
  const std::string properties =
      "property float x\nproperty float y\nproperty float z\nend_header\n";
  const auto empty = Find(WriteText("empty.ply", header + "0\n" + properties + "\n"));
  EXPECT_TRUE(Says(empty.status(), "empty.ply")) << empty.status();
  const auto cut = Find(WriteText("cut.ply", header + "3\n" + properties + "0 0 0\n1"));
  EXPECT_TRUE(Says(cut.status(), "cut.ply")) << cut.status();
  const auto few = Find(WriteText("few.ply", header + "2\n" + properties + "0 0 0\n0 0.01 0\n"));
  EXPECT_TRUE(Says(few.status(), "few.ply")) << few.status();
  EXPECT_EQ(Find((folder_ / "none.ply").string()).status().code(), absl::StatusCode::kNotFound);
}

// Files are refused by the number in their header, before points take memory.
TEST_F(MeasuredPartTest, TooManyPointsAreRefusedBeforeTheyAreRead) {
  const auto ply = [&](const std::string& name, const std::string& elements, uint64_t data_bytes) {
    const std::string path = WriteText(
        name, absl::StrCat("ply\nformat binary_little_endian 1.0\n", elements,
                           "property char x\nproperty char y\nproperty char z\n", "end_header\n"));
    std::filesystem::resize_file(path, std::filesystem::file_size(path) + data_bytes);
    return path;
  };
  const auto said = [&](const std::vector<MeasuredFile>& files) {
    return WithinLimits({.cpu_time_s = 5, .memory_bytes = int64_t{64} << 20}, [&] {
      const std::vector<Measurement> scans(files.size(), scan_);
      return std::string(
          FindMeasuredPart(model_, inspection_, files, scans, {}).status().message());
    });
  };
  const auto has = [](const std::string& text, const std::string& part) {
    return text.find(part) != std::string::npos;
  };
  const std::string many =
      said({{ply("many.ply", "element vertex 30000000\n", uint64_t{90'000'000}), 0}});
  EXPECT_TRUE(has(many, "many.ply: has 30000000 points; at most 20000000 ")) << many;
  const std::string first = Write("first.ply", Measured(model_, truth_, 8));
  const std::string together =
      said({{first, 0}, {ply("second.ply", "element vertex 19999999\n", uint64_t{60'000'000}), 1}});
  EXPECT_TRUE(has(together, "second.ply: has 19999999 points, besides 8000 of")) << together;
  const std::string twice =
      said({{ply("twice.ply",
                 "element vertex 19000000\nproperty char x\nproperty char y\nproperty char z\n"
                 "element vertex 19000000\n",
                 uint64_t{114'000'000}),
             0}});
  EXPECT_TRUE(has(twice, "twice.ply: has 38000000 points")) << twice;
  const std::string claims =
      said({{ply("claims.ply",
                 "element vertex 9223372036854775807\nelement vertex 9223372036854775807\n", 9),
             0}});
  EXPECT_TRUE(has(claims, "claims.ply: has 9223372036854775807 points")) << claims;
  std::string comments;
  while (comments.size() < (1u << 20)) comments += "comment " + std::string(1000, 'a') + "\n";
  const std::string hidden =
      said({{ply("hidden.ply", comments + "element vertex 30000000\n", uint64_t{90'000'000}), 0}});
  EXPECT_TRUE(has(hidden, "hidden.ply: its header has more than 1 MiB")) << hidden;
  // As many as there may be, but they are not there.
  const std::string cut = said({{ply("cut.ply", "element vertex 20000000\n", 300), 0}});
  EXPECT_TRUE(has(cut, "cut.ply: truncated")) << cut;
}

TEST_F(MeasuredPartTest, InchesAndMirrorImagesAreNamed) {
  SurfaceSample inches = Measured(model_, truth_, 9);
  for (Eigen::Vector3d& p : inches.positions_m) p /= 0.0254;
  const std::string path = Write("inch.ply", inches);
  const auto refused = Find(path);
  EXPECT_TRUE(Says(refused.status(), "--measured-unit inch")) << refused.status();
  MeasuredPartOptions options;
  options.metres_per_unit = 0.0254;
  const auto read = FindMeasuredPart(model_, inspection_, {{path, 0}}, {scan_}, options);
  EXPECT_TRUE(read.ok()) << read.status();
  SurfaceSample mirrored = Measured(model_, truth_, 10);
  for (size_t i = 0; i < mirrored.positions_m.size(); ++i) {
    mirrored.positions_m[i].x() = 0.08 - mirrored.positions_m[i].x();
    mirrored.normals[i].x() *= -1;
  }
  const auto mirror = Find(Write("mirror.ply", mirrored));
  EXPECT_TRUE(Says(mirror.status(), "mirrored in x")) << mirror.status();
}

TEST_F(MeasuredPartTest, RepeatedPointsAreRefusedUnlessTheyAreFew) {
  SurfaceSample sample = Measured(model_, truth_, 11);
  for (int i = 0; i < 20; ++i) {
    sample.positions_m.push_back(sample.positions_m[5]);
    sample.normals.push_back(sample.normals[5]);
  }
  const auto few = Find(Write("few.ply", sample));
  ASSERT_TRUE(few.ok()) << few.status();
  EXPECT_EQ(few->counts[0].duplicates, 20);
  EXPECT_EQ(few->counts[0].read, 8000);
  for (int i = 0; i < 1000; ++i) {
    sample.positions_m.push_back(sample.positions_m[5]);
    sample.normals.push_back(sample.normals[5]);
  }
  const auto many = Find(Write("many.ply", sample));
  EXPECT_TRUE(Says(many.status(), "many.ply: 1020 of its 9020 points repeat")) << many.status();
}

TEST_F(MeasuredPartTest, StrayPointsAreCountedAndLeftOut) {
  inspection_.uncertainty.emplace();
  inspection_.uncertainty->detection.standard_deviations_px = {0.02};
  SurfaceSample sample = Measured(model_, truth_, 12, 60'000);
  for (size_t i = 0; i < 600; ++i) {
    sample.positions_m[100 * i] +=
        2e-3 * (truth_.Rotation() * sample.normals[100 * i]).normalized();
  }
  const auto part = Find(Write("stray.ply", sample));
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_GT(part->counts[0].among_neighbours, 500);
  EXPECT_LT(part->counts[0].among_neighbours, 700);
  EXPECT_EQ(part->outliers_m.size(), static_cast<size_t>(part->counts[0].among_neighbours));
  EXPECT_LT(part->counts[0].rms_m, 2e-4);
}

// ASCII without normals as other programs write it.
TEST_F(MeasuredPartTest, AsciiWithoutNormalsIsRead) {
  const SurfaceSample sample = Measured(model_, truth_, 7);
  std::string text =
      absl::StrCat("ply\nformat ascii 1.0\nelement vertex ", sample.positions_m.size(),
                   "\nproperty double x\nproperty double y\nproperty double z\n"
                   "property uchar quality\nend_header\n");
  for (const Eigen::Vector3d& p : sample.positions_m) {
    absl::StrAppend(&text, p.x(), " ", p.y(), " ", p.z(), " 3\n");
  }
  const auto part = Find(WriteText("ascii.ply", text));
  ASSERT_TRUE(part.ok()) << part.status();
  EXPECT_NEAR(part->message.translation_m().y(), 1e-3, 2e-5);
}

}  // namespace
}  // namespace sightline
