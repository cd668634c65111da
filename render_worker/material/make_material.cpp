// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_text.h"
#include "render_worker/material/directional_albedo.h"
#include "render_worker/material/models.h"

namespace sightline {
namespace {

absl::Status OutOfRange(const std::string& field, double value, const std::string& range) {
  return absl::InvalidArgumentError(
      absl::StrCat(field, " is ", NumberText(value), ", must be ", range));
}

absl::Status CheckRange(const std::string& field, bool given, double value, double lower,
                        double upper) {
  const std::string range = absl::StrCat("in [", NumberText(lower), ", ", NumberText(upper), "]");
  if (!given)
    return absl::InvalidArgumentError(absl::StrCat(field, " is missing, must be ", range));
  if (!(value >= lower && value <= upper)) return OutOfRange(field, value, range);
  return absl::OkStatus();
}

// Rougher than 1 has no meaning for GGX, smoother than this equals a mirror in floats.
constexpr double kLeastAlpha = 1e-3;

absl::StatusOr<std::shared_ptr<const HeightField>> ParseHeightField(
    const v1::Material::HeightField& message, const AssetResolver& assets,
    const std::string& context, DetailedMaterial::Common& common) {
  const std::string pitch_field = absl::StrCat(context, ".sample_pitch_m");
  if (message.file().empty()) {
    return absl::InvalidArgumentError(absl::StrCat(context, ".file is missing"));
  }
  SIGHTLINE_RETURN_IF_ERROR(
      CheckRange(pitch_field, message.has_sample_pitch_m(), message.sample_pitch_m(), 1e-9, 0.1));
  const double unit = message.has_height_unit_m() ? message.height_unit_m() : 1e-6;
  if (!(unit > 0 && unit <= 1)) {
    return OutOfRange(absl::StrCat(context, ".height_unit_m"), unit, "in (0, 1]");
  }
  const double strength = message.has_normal_strength() ? message.normal_strength() : 1;
  SIGHTLINE_RETURN_IF_ERROR(
      CheckRange(absl::StrCat(context, ".normal_strength"), true, strength, 0, 10));
  for (const auto& [name, value] :
       {std::pair<std::string, double>{"albedo_contrast_relative",
                                       message.albedo_contrast_relative()},
        {"roughness_contrast_relative", message.roughness_contrast_relative()}}) {
    SIGHTLINE_RETURN_IF_ERROR(CheckRange(absl::StrCat(context, ".", name), true, value, -1, 1));
  }
  common.normal_strength = static_cast<float>(strength);
  common.albedo_contrast = static_cast<float>(message.albedo_contrast_relative());
  common.roughness_contrast = static_cast<float>(message.roughness_contrast_relative());
  SIGHTLINE_ASSIGN_OR_RETURN(const std::string path, assets(message.file()));
  SIGHTLINE_ASSIGN_OR_RETURN(
      HeightField field,
      ReadHeightField(path, message.sample_pitch_m(), unit, absl::StrCat(context, ".file")));
  return std::make_shared<const HeightField>(std::move(field));
}

absl::StatusOr<RefractiveIndexTable> ParseRefractiveIndex(const v1::Material::Conductor& message,
                                                          const AssetResolver& assets,
                                                          const std::string& context) {
  const bool has_file = !message.refractive_index_file().empty();
  if (has_file == (message.refractive_index_size() > 0)) {
    return absl::InvalidArgumentError(
        absl::StrCat(context, " needs either refractive_index or refractive_index_file, ",
                     has_file ? "not both" : "but has neither"));
  }
  RefractiveIndexTable table;
  std::string where = absl::StrCat(context, ".refractive_index");
  if (has_file) {
    where = absl::StrCat(context, ".refractive_index_file");
    SIGHTLINE_ASSIGN_OR_RETURN(const std::string path, assets(message.refractive_index_file()));
    SIGHTLINE_ASSIGN_OR_RETURN(table, ReadRefractiveIndex(path, where));
    where = absl::StrCat(where, ": ", path, ", value ");
  } else {
    for (const auto& point : message.refractive_index()) {
      table.wavelength_m.push_back(point.wavelength_m());
      table.n.push_back(point.n());
      table.k.push_back(point.k());
    }
  }
  if (table.n.empty()) return absl::InvalidArgumentError(absl::StrCat(where, " holds no values"));
  for (size_t i = 0; i < table.n.size(); ++i) {
    const std::string at = absl::StrCat(where, "[", i, "]");
    if (!(table.wavelength_m[i] > 1e-8 && table.wavelength_m[i] < 1e-3)) {
      return OutOfRange(absl::StrCat(at, ".wavelength_m"), table.wavelength_m[i],
                        "in (1e-8, 1e-3)");
    }
    if (i > 0 && table.wavelength_m[i] <= table.wavelength_m[i - 1]) {
      return OutOfRange(
          absl::StrCat(at, ".wavelength_m"), table.wavelength_m[i],
          absl::StrCat("above the one before, ", NumberText(table.wavelength_m[i - 1])));
    }
    if (!(table.n[i] > 0 && table.n[i] <= 100)) {
      return OutOfRange(absl::StrCat(at, ".n"), table.n[i], "in (0, 100]");
    }
    if (!(table.k[i] >= 0 && table.k[i] <= 200)) {
      return OutOfRange(absl::StrCat(at, ".k"), table.k[i], "in [0, 200]");
    }
  }
  return table;
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Material>> MakeMaterial(const v1::Material& message,
                                                             double laser_wavelength_m,
                                                             const AssetResolver& assets,
                                                             const std::string& context) {
  DetailedMaterial::Common common;
  const std::string spectrum_field = absl::StrCat(context, ".reflectance_spectrum");
  SIGHTLINE_ASSIGN_OR_RETURN(
      common.reflectance, ParseReflectanceSpectrum(message.reflectance_spectrum(), spectrum_field));
  common.reflectance_is_grey = message.reflectance_spectrum().empty();
  const float largest_reflectance =
      *std::max_element(common.reflectance.begin(), common.reflectance.end());
  if (message.has_height_field()) {
    SIGHTLINE_ASSIGN_OR_RETURN(common.height_field,
                               ParseHeightField(message.height_field(), assets,
                                                absl::StrCat(context, ".height_field"), common));
  }
  // The model's albedo times the spectrum at the laser's wavelength must stay below 1.
  const auto check_spectrum = [&](double albedo) {
    return albedo * largest_reflectance <= 1 + 1e-6
               ? absl::OkStatus()
               : OutOfRange(absl::StrCat(spectrum_field, " times the reflectance ",
                                         NumberText(albedo), " at the laser's wavelength"),
                            albedo * largest_reflectance, "at most 1");
  };

  switch (message.model_case()) {
    case v1::Material::MODEL_NOT_SET:
      return absl::InvalidArgumentError(
          absl::StrCat(context,
                       " has no model, must have one of lambert, lambert_ggx, conductor, "
                       "measured_table, merl"));
    case v1::Material::kLambert: {
      const v1::Material::Lambert& model = message.lambert();
      const std::string field = absl::StrCat(context, ".lambert.diffuse_albedo");
      absl::Status status =
          CheckRange(field, model.has_diffuse_albedo(), model.diffuse_albedo(), 0, 1);
      if (status.ok()) status = check_spectrum(model.diffuse_albedo());
      if (!status.ok()) return status;
      return MakeLambert(std::move(common), static_cast<float>(model.diffuse_albedo()));
    }
    case v1::Material::kLambertGgx: {
      const v1::Material::LambertGgx& model = message.lambert_ggx();
      const std::string field = absl::StrCat(context, ".lambert_ggx");
      absl::Status status = CheckRange(absl::StrCat(field, ".diffuse_albedo"),
                                       model.has_diffuse_albedo(), model.diffuse_albedo(), 0, 1);
      status.Update(CheckRange(absl::StrCat(field, ".specular_f0"), model.has_specular_f0(),
                               model.specular_f0(), 0, 1));
      status.Update(CheckRange(absl::StrCat(field, ".ggx_alpha"), model.has_ggx_alpha(),
                               model.ggx_alpha(), kLeastAlpha, 1));
      const double sum = model.diffuse_albedo() + model.specular_f0();
      if (status.ok() && sum > 1 + 1e-9) {
        status = OutOfRange(absl::StrCat(field, ".diffuse_albedo + specular_f0"), sum,
                            "at most 1: the surface would reflect more than it receives");
      }
      if (status.ok()) status = check_spectrum(sum);
      if (!status.ok()) return status;
      return MakeLambertGgx(std::move(common), static_cast<float>(model.diffuse_albedo()),
                            static_cast<float>(model.specular_f0()),
                            static_cast<float>(model.ggx_alpha()));
    }
    case v1::Material::kConductor: {
      const v1::Material::Conductor& model = message.conductor();
      const std::string field = absl::StrCat(context, ".conductor");
      absl::Status status = CheckRange(absl::StrCat(field, ".ggx_alpha_x"), model.has_ggx_alpha_x(),
                                       model.ggx_alpha_x(), kLeastAlpha, 1);
      status.Update(CheckRange(absl::StrCat(field, ".ggx_alpha_y"), model.has_ggx_alpha_y(),
                               model.ggx_alpha_y(), kLeastAlpha, 1));
      if (status.ok() && !(model.diffuse_albedo() >= 0 && model.diffuse_albedo() < 1)) {
        status =
            OutOfRange(absl::StrCat(field, ".diffuse_albedo"), model.diffuse_albedo(), "in [0, 1)");
      }
      if (status.ok()) status = check_spectrum(1);
      if (!status.ok()) return status;
      const Eigen::Vector3d direction(model.machining_direction().x(),
                                      model.machining_direction().y(),
                                      model.machining_direction().z());
      if (!direction.allFinite() ||
          (model.ggx_alpha_x() != model.ggx_alpha_y() && direction.norm() == 0)) {
        return absl::InvalidArgumentError(
            absl::StrCat(field,
                         ".machining_direction is missing, must be a direction in part "
                         "coordinates: ggx_alpha_x and ggx_alpha_y differ"));
      }
      if (direction.norm() > 0) {
        common.machining_direction = direction.normalized().cast<float>();
      }
      SIGHTLINE_ASSIGN_OR_RETURN(RefractiveIndexTable index,
                                 ParseRefractiveIndex(model, assets, field));
      return MakeConductor(std::move(common), index, static_cast<float>(model.ggx_alpha_x()),
                           static_cast<float>(model.ggx_alpha_y()),
                           static_cast<float>(model.diffuse_albedo()), laser_wavelength_m);
    }
    case v1::Material::kMeasuredTable: {
      const v1::Material::MeasuredTable& model = message.measured_table();
      const std::string field = absl::StrCat(context, ".measured_table");
      if (model.file().empty()) {
        return absl::InvalidArgumentError(absl::StrCat(field, ".file is missing"));
      }
      std::optional<double> spot_diameter_m;
      if (model.has_spot_diameter_m()) {
        spot_diameter_m = model.spot_diameter_m();
        if (!(*spot_diameter_m > 0 && *spot_diameter_m <= 1)) {
          return OutOfRange(absl::StrCat(field, ".spot_diameter_m"), *spot_diameter_m, "in (0, 1]");
        }
      }
      SIGHTLINE_ASSIGN_OR_RETURN(const std::string path, assets(model.file()));
      return ReadMeasuredTable(std::move(common), path, spot_diameter_m,
                               absl::StrCat(field, ".file"));
    }
    case v1::Material::kMerl: {
      const std::string field = absl::StrCat(context, ".merl.file");
      if (message.merl().file().empty()) {
        return absl::InvalidArgumentError(absl::StrCat(field, " is missing"));
      }
      SIGHTLINE_ASSIGN_OR_RETURN(const std::string path, assets(message.merl().file()));
      return ReadMerl(std::move(common), path, laser_wavelength_m, field);
    }
  }
  return absl::InvalidArgumentError(absl::StrCat(context, " has an unknown model"));
}

std::vector<std::string> MaterialFiles(const v1::Material& message) {
  std::vector<std::string> files;
  for (const std::string& file :
       {message.conductor().refractive_index_file(), message.measured_table().file(),
        message.merl().file(), message.height_field().file()}) {
    if (!file.empty()) files.push_back(file);
  }
  return files;
}

}  // namespace sightline
