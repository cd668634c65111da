// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/plate_inspection.h"

#include <algorithm>
#include <string>

namespace sightline {

const char kPlateObj[] =
    "v -0.2 -0.2 0\nv 0.2 -0.2 0\nv 0.2 0.2 0\nv -0.2 0.2 0\nf 1 2 3\nf 1 3 4\n";

v1::Inspection InspectionOfPlate(const v1::Recordings& recordings, const std::string& part_file) {
  const auto& all = recordings.recordings();
  auto lit = std::find_if(all.begin(), all.end(),
                          [](const v1::Recording& r) { return r.kind() == "laser"; });
  const v1::Recording& first = lit == all.end() ? all[0] : *lit;

  v1::Inspection inspection;
  inspection.set_name(recordings.set());
  inspection.mutable_part()->set_file(part_file);
  inspection.mutable_part()->set_unit("m");
  *inspection.mutable_camera()->mutable_sensor() = recordings.camera();
  v1::Lens* lens = inspection.mutable_lens();
  lens->set_focal_length_m(recordings.lens().focal_length_m());
  lens->set_transmission(recordings.lens().transmission());
  lens->set_f_number(first.f_number());
  lens->set_focus_distance_m(first.focus_distance_m());
  v1::Laser* laser = inspection.mutable_laser();
  laser->set_distance_m(first.laser_distance_m());
  laser->set_wavelength_m(recordings.laser().wavelength_m());
  laser->set_power_w(recordings.laser().power_w());
  laser->set_divergence_rad(recordings.laser().divergence_rad());
  laser->set_beam_focus_distance_m(recordings.laser().beam_focus_distance_m());
  laser->set_fan_angle_deg(recordings.laser().fan_angle_deg());
  v1::Material* material = inspection.add_materials()->mutable_material();
  material->set_name("plate");
  material->mutable_lambert_ggx()->set_diffuse_albedo(recordings.surface().diffuse_albedo());
  material->mutable_lambert_ggx()->set_specular_f0(recordings.surface().specular_f0());
  material->mutable_lambert_ggx()->set_ggx_alpha(recordings.surface().ggx_alpha());
  v1::MeasurementDomain* domain = inspection.mutable_measurement();
  domain->mutable_camera_distance_m()->set_fixed(first.camera_distance_m());
  domain->mutable_triangulation_angle_deg()->set_fixed(recordings.rig().incidence_angle_deg());
  for (v1::ParameterDomain* zero :
       {domain->mutable_camera_azimuth_deg(), domain->mutable_camera_polar_deg(),
        domain->mutable_part_alpha_deg(), domain->mutable_part_beta_deg(),
        domain->mutable_part_gamma_deg(), domain->mutable_offset_y_m(),
        domain->mutable_offset_z_m()}) {
    zero->set_fixed(0);
  }
  inspection.mutable_render()->set_exposure_time_s(first.exposure_time_s());
  return inspection;
}

}  // namespace sightline
