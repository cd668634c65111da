// SPDX-License-Identifier: Apache-2.0
// Every material of examples/catalogue/materials loads and is physical.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/json/strict_json.h"
#include "tests/render_worker/material/material_fixture.h"

namespace sightline {
namespace {

TEST(Catalogue, EveryMaterialLoads) {
  const char* source = std::getenv("SIGHTLINE_SOURCE_DIR");
  ASSERT_NE(source, nullptr) << "SIGHTLINE_SOURCE_DIR is not set";
  const std::filesystem::path folder =
      std::filesystem::path(source) / "examples" / "catalogue" / "materials";
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() != ".json") continue;
    v1::Material message;
    const absl::Status read = ReadStrictJsonFile(entry.path().string(), &message);
    ASSERT_TRUE(read.ok()) << read;
    EXPECT_EQ(message.name(), entry.path().stem().string());
    const auto material = MakeMaterial(message, 661e-9, SamePath, message.name());
    ASSERT_TRUE(material.ok()) << material.status();
    const Eigen::Vector3f out = Direction(0, 0), in = Direction(45, 90);
    EXPECT_GT((*material)->Brdf(out, in, {}), 0) << entry.path();
    EXPECT_EQ((*material)->Brdf(out, in, {}), (*material)->Brdf(in, out, {})) << entry.path();
    ++count;
  }
  EXPECT_GE(count, 7);
}

}  // namespace
}  // namespace sightline
