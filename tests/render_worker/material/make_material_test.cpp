// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "tests/render_worker/material/material_fixture.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string Error(const v1::Material& message) {
  const auto material = MakeMaterial(message, 661e-9, SamePath, "materials[0]");
  EXPECT_FALSE(material.ok());
  return std::string(material.status().message());
}

TEST(MakeMaterial, SaysWhatIsWrong) {
  EXPECT_THAT(Error(v1::Material()), HasSubstr("materials[0] has no model"));
  v1::Material lambert;
  lambert.mutable_lambert();
  EXPECT_THAT(Error(lambert), HasSubstr("lambert.diffuse_albedo is missing, must be in [0, 1]"));
  lambert.mutable_lambert()->set_diffuse_albedo(1.2);
  EXPECT_THAT(Error(lambert), HasSubstr("diffuse_albedo is 1.2, must be in [0, 1]"));
  EXPECT_THAT(Error(LambertGgxMessage(0.5, 0.6, 0.3)),
              AllOf(HasSubstr("diffuse_albedo + specular_f0 is 1.1"), HasSubstr("at most 1")));
  EXPECT_THAT(Error(LambertGgxMessage(0.3, 0.6, 0)), HasSubstr("ggx_alpha is 0"));
  v1::Material bright = LambertGgxMessage(0.4, 0.5, 0.3);
  v1::SpectrumPoint* point = bright.add_reflectance_spectrum();
  point->set_wavelength_m(500e-9);
  point->set_value(1.5);
  EXPECT_THAT(Error(bright), HasSubstr("reflectance_spectrum"));
  v1::Material machined = ConductorMessage(0.1, 0.3, 0);
  machined.mutable_conductor()->clear_machining_direction();
  EXPECT_THAT(Error(machined), HasSubstr("machining_direction is missing"));
  v1::Material no_data = ConductorMessage(0.3, 0.3, 0);
  no_data.mutable_conductor()->clear_refractive_index();
  EXPECT_THAT(Error(no_data), HasSubstr("either refractive_index or refractive_index_file"));
  v1::Material no_file = ConductorMessage(0.3, 0.3, 0);
  no_file.mutable_height_field()->set_file("/does/not/exist.png");
  no_file.mutable_height_field()->set_sample_pitch_m(1e-6);
  EXPECT_THAT(Error(no_file), HasSubstr("/does/not/exist.png"));
}

TEST(MakeMaterial, BrokenTablesAreNamedWithTheirLine) {
  const std::string path = TestFile("broken.csv");
  v1::Material message;
  message.mutable_measured_table()->set_file(path);
  std::ofstream(path) << "theta_l_deg,theta_d_deg,phi_d_deg,brdf_per_sr\n0,0,0,0.3\n0,0,2\n";
  EXPECT_THAT(Error(message), HasSubstr("line 3"));
  std::ofstream(path) << "0,0,0,0.3\n0,95,2,0.1\n";
  EXPECT_THAT(Error(message), HasSubstr("line 2: theta_d_deg is 95, must be in [0, 90]"));
  v1::Material merl;
  merl.mutable_merl()->set_file(path);
  EXPECT_THAT(Error(merl), HasSubstr("must be 90 x 90 x 180"));
  v1::Material metal = ConductorMessage(0.3, 0.3, 0);
  metal.mutable_conductor()->clear_refractive_index();
  metal.mutable_conductor()->set_refractive_index_file(path);
  std::ofstream(path) << "wavelength_nm,n,k\n600,1.2,6\n650,x,7\n";
  EXPECT_THAT(Error(metal), HasSubstr("line 3"));
}

TEST(MakeMaterial, RefractiveIndexFileIsTheInlineTable) {
  const std::string path = TestFile("nk.csv");
  std::ofstream(path) << "wavelength_nm,n,k\n661,1.47,7.6\n";
  v1::Material from_file = ConductorMessage(0.2, 0.3, 0.1);
  from_file.mutable_conductor()->clear_refractive_index();
  from_file.mutable_conductor()->set_refractive_index_file(path);
  EXPECT_THAT(MaterialFiles(from_file), ElementsAre(path));
  const Eigen::Vector3f out = Direction(30, 40), in = Direction(50, 200);
  EXPECT_EQ(Make(from_file)->Brdf(out, in, {}),
            Make(ConductorMessage(0.2, 0.3, 0.1))->Brdf(out, in, {}));
}

TEST(CheckScale, WarnsBeyondTheFactorOnly) {
  const std::string path = TestFile("flat.csv");
  std::ofstream(path) << "0,0,0,0.3\n";
  v1::Material message;
  message.mutable_measured_table()->set_file(path);
  message.mutable_measured_table()->set_spot_diameter_m(1e-3);
  const auto material = Make(message);
  EXPECT_FALSE(CheckScale(*material, "alu", 1e-3 * 0.99 * kScaleMismatchFactor).has_value());
  EXPECT_FALSE(CheckScale(*material, "alu", 1e-3 * 1.01 / kScaleMismatchFactor).has_value());
  EXPECT_THAT(CheckScale(*material, "alu", 1e-4).value_or(""),
              AllOf(HasSubstr("\"alu\""), HasSubstr("factor of 4")));
}

}  // namespace
}  // namespace sightline
