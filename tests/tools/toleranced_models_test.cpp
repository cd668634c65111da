// SPDX-License-Identifier: Apache-2.0
// Verdicts about the tolerances of real models: how many are evaluated, and whether every printed
// reason agrees with the figures beside it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <regex>
#include <string>
#include <utility>
#include <vector>

#include "core/status/status_macros.h"
#include "planner_client/tolerance_import/tolerance_import.h"
#include "planning/requirements/feature_verdicts.h"
#include "planning/requirements/requirements.h"

namespace sightline {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> Models() {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  const fs::path root = source != nullptr ? source : ".";
  std::vector<fs::path> models = {root / "tests/tools/data/toleranced_plate.stp"};
  const fs::path nist = root / "../shared/data/cad/nist_ap242";
  if (fs::is_directory(nist)) {
    for (const auto& entry : fs::directory_iterator(nist)) {
      if (entry.path().extension() == ".stp") models.push_back(entry.path());
    }
  }
  std::sort(models.begin(), models.end());
  return models;
}

// A model, its faces as a mesh, and targets on them: every 8 mm, but some 60 on every face.
struct Model {
  ImportedTolerances imported;
  TriangleMesh mesh;
  TargetSet targets;
};

void AddTargets(const FaceTriangles& face, TargetSet* targets) {
  double area_m2 = 0;
  const auto corner = [&](size_t t, size_t k) { return face.positions_m[face.triangles[t][k]]; };
  const auto normal = [&](size_t t) -> Eigen::Vector3d {
    return (corner(t, 1) - corner(t, 0)).cross(corner(t, 2) - corner(t, 0));
  };
  for (size_t t = 0; t < face.triangles.size(); ++t) area_m2 += 0.5 * normal(t).norm();
  const double spacing_m = std::min(0.008, std::sqrt(area_m2 / 60));
  for (size_t t = 0; t < face.triangles.size(); ++t) {
    const Eigen::Vector3d n = normal(t);
    if (!(n.norm() > 0)) continue;
    // As many midpoints of a triangular grid as the triangle's area asks for, at least one.
    const int steps =
        std::max(1, static_cast<int>(std::lround(std::sqrt(0.5 * n.norm()) / spacing_m)));
    for (int i = 0; i < steps; ++i) {
      for (int j = 0; i + j < steps; ++j) {
        const double u = (i + 1.0 / 3) / steps, v = (j + 1.0 / 3) / steps;
        const Eigen::Vector3d p = (1 - u - v) * corner(t, 0) + u * corner(t, 1) + v * corner(t, 2);
        targets->positions_m.push_back(p.cast<float>());
        targets->normals.push_back(n.normalized().cast<float>());
        targets->regions.push_back(-1);
      }
    }
  }
}

absl::StatusOr<Model> LoadModel(const fs::path& path) {
  ToleranceImportOptions options;
  const char* bin = std::getenv("SIGHTLINE_BIN_DIR");
  if (bin != nullptr) options.step_import_program = std::string(bin) + "/sightline_step_import";
  SIGHTLINE_ASSIGN_OR_RETURN(auto imported, ImportTolerances(path.string(), options));
  Model model{std::move(imported), {}, {}};
  for (const FaceTriangles& face : model.imported.faces) {
    const auto first = static_cast<uint32_t>(model.mesh.positions_m.size());
    for (const Eigen::Vector3d& p : face.positions_m)
      model.mesh.positions_m.push_back(p.cast<float>());
    for (const auto& t : face.triangles)
      model.mesh.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    AddTargets(face, &model.targets);
  }
  return model;
}

absl::StatusOr<std::vector<v1::FeatureVerdict>> Judge(const Model& model, double u_m,
                                                      bool some_missing) {
  Inspection inspection;
  inspection.uncertainty.emplace();
  inspection.tolerances.emplace();
  inspection.tolerances->file = "model.stp";
  inspection.domain = ThesisDomain();
  SIGHTLINE_ASSIGN_OR_RETURN(
      auto requirements,
      MakeRequirements(inspection, model.mesh, model.imported.report, model.imported.faces));
  PlanKnowledge knowledge;
  knowledge.targets = &model.targets;
  TargetBits measurable(model.targets.size());
  knowledge.measurable = &measurable;
  for (size_t t = 0; t < model.targets.size(); ++t) {
    // Some are known twice as well as others, and one end of the part may be missing.
    const double own_m = u_m * (1 + 0.5 * std::sin(static_cast<double>(t)));
    const bool missing = some_missing && model.targets.positions_m[t].x() < 0.02f;
    knowledge.uncertainty.push_back({own_m, 0.8 * own_m, 0.6 * own_m, 0});
    knowledge.points.push_back(missing ? 0 : 10);
  }
  return JudgeFeatures(inspection, requirements, knowledge);
}

// A length as reasons print it: "12.3 um", "0.25 mm".
double Metres(const std::string& number, const std::string& unit) {
  return std::stod(number) * (unit == "um" ? 1e-6 : 1e-3);
}

// The length that follows `before` in the reason agrees with the figure in three digits.
void ExpectLength(const std::string& because, const std::string& before, double figure_m) {
  const std::regex pattern(before + R"( ([-0-9.e+]+) (um|mm))");
  std::smatch match;
  if (!std::regex_search(because, match, pattern)) return;
  EXPECT_NEAR(Metres(match[1], match[2]), figure_m, 6e-3 * std::abs(figure_m)) << because;
}

void ExpectReasonAgrees(const v1::FeatureVerdict& v) {
  const std::string& because = v.because();
  EXPECT_EQ(v.can_be_proven(), v.verdict() == v1::FeatureVerdict::CAN_BE_PROVEN) << because;
  if (v.verdict() == v1::FeatureVerdict::NOT_EVALUATED) {
    EXPECT_THAT(because, ::testing::StartsWith("not evaluated: "));
    EXPECT_FALSE(v.has_uncertainty_m() || v.has_noise_m() || v.has_sampling_m() ||
                 v.has_calibration_m() || v.has_admissible_uncertainty_m() ||
                 v.has_acceptance_zone_m() || v.has_probability_wrong_acceptance() ||
                 v.has_probability_wrong_rejection() || v.has_admissible_targets());
    return;
  }
  EXPECT_THAT(because,
              ::testing::StartsWith(v.can_be_proven() ? "can be proven: " : "cannot be proven: "));
  std::smatch match;
  if (std::regex_search(because, match, std::regex(R"((\d+) of its (\d+) targets are not)"))) {
    EXPECT_EQ(std::stoll(match[1]), v.targets() - v.measured_targets()) << because;
    EXPECT_EQ(std::stoll(match[2]), v.targets()) << because;
    EXPECT_GT(20 * (v.targets() - v.measured_targets()), v.targets()) << because;
    EXPECT_FALSE(v.can_be_proven());
  }
  if (std::regex_search(because, match, std::regex(R"((\d+) of its (\d+) measured targets)"))) {
    EXPECT_EQ(std::stoll(match[1]), v.measured_targets() - v.used_targets()) << because;
    EXPECT_EQ(std::stoll(match[2]), v.measured_targets()) << because;
    EXPECT_FALSE(v.can_be_proven());
  }
  if (!v.has_uncertainty_m()) return;
  EXPECT_GT(v.uncertainty_m(), 0) << v.text();
  EXPECT_NEAR(std::hypot(v.noise_m(), v.sampling_m(), v.calibration_m()), v.uncertainty_m(),
              1e-6 * v.uncertainty_m());
  ExpectLength(because, "u is", v.uncertainty_m());
  ExpectLength(because, "u must be below", v.admissible_uncertainty_m());
  ExpectLength(because, "errors alone make a form of", v.bias_m());
  ExpectLength(because, "an acceptance zone of", v.acceptance_zone_m());
  ExpectLength(because, "is left of", v.zone_width_m() + v.material_bonus_m());
  ExpectLength(because, "is left of the zone of", v.zone_width_m() + v.material_bonus_m());
  // The decision is the comparison of the two figures that are printed.
  if (v.can_be_proven()) {
    EXPECT_LT(v.uncertainty_m(), v.admissible_uncertainty_m()) << because;
  }
  if (because.find("no acceptance zone") != std::string::npos) {
    EXPECT_GE(v.uncertainty_m(), v.admissible_uncertainty_m() * (1 - 1e-9)) << because;
  }
}

TEST(TolerancedModels, EveryReasonAgreesWithTheFiguresBesideIt) {
  int proven = 0, refused = 0;
  for (const fs::path& path : Models()) {
    const auto model = LoadModel(path);
    ASSERT_TRUE(model.ok()) << model.status();
    for (const auto& [u_m, some_missing] :
         {std::pair{5e-6, false}, std::pair{1e-4, true}, std::pair{2e-3, false}}) {
      const auto verdicts = Judge(*model, u_m, some_missing);
      ASSERT_TRUE(verdicts.ok()) << verdicts.status();
      for (const v1::FeatureVerdict& verdict : *verdicts) {
        SCOPED_TRACE(path.filename().string() + ": " + verdict.text());
        ExpectReasonAgrees(verdict);
        proven += verdict.can_be_proven();
        refused += verdict.verdict() == v1::FeatureVerdict::CANNOT_BE_PROVEN;
      }
    }
  }
  EXPECT_GT(proven, 0);
  EXPECT_GT(refused, 0);
}

// The counts by kind are those of docs/plan-for-uncertainty.md. What is left has datum targets,
// edges or curves, or binds nothing.
TEST(TolerancedModels, TolerancesOfFacesWithDatumsOfFacesAreEvaluated) {
  struct Row {
    int read = 0, evaluated = 0;
  };
  std::map<std::string, Row> rows;
  int read = 0, evaluated = 0;
  for (const fs::path& path : Models()) {
    const auto model = LoadModel(path);
    ASSERT_TRUE(model.ok()) << model.status();
    const auto verdicts = Judge(*model, 1e-5, false);
    ASSERT_TRUE(verdicts.ok()) << verdicts.status();
    EXPECT_EQ(verdicts->size(), model->imported.report.read.size());
    for (const v1::FeatureVerdict& verdict : *verdicts) {
      const bool known = verdict.verdict() != v1::FeatureVerdict::NOT_EVALUATED;
      Row& row = rows[verdict.kind()];
      ++row.read, ++read;
      row.evaluated += known, evaluated += known;
      if (!known) {
        EXPECT_THAT(verdict.because(),
                    ::testing::AnyOf(::testing::HasSubstr("binds no face"),
                                     ::testing::HasSubstr("a distance needs two surfaces")))
            << verdict.text();
      }
      if (!known || std::getenv("SIGHTLINE_PRINT_VERDICTS") != nullptr) {
        std::printf("%s: %s: %s\n", path.filename().c_str(), verdict.text().c_str(),
                    verdict.because().c_str());
      }
    }
  }
  for (const auto& [kind, row] : rows)
    std::printf("%-20s read %3d evaluated %3d\n", kind.c_str(), row.read, row.evaluated);
  EXPECT_GE(evaluated, 0.85 * read);
}

}  // namespace
}  // namespace sightline
