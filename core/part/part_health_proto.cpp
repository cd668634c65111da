// SPDX-License-Identifier: Apache-2.0
#include "core/part/part_health_proto.h"

namespace sightline {

v1::PartHealth PartHealthToProto(const PartHealth& health) {
  v1::PartHealth message;
  message.set_triangle_count(health.triangle_count);
  message.set_vertex_count(health.vertex_count);
  message.set_area_m2(health.area_m2);
  auto* box = message.mutable_bounding_box_m();
  box->set_min_x_m(health.bounding_box_m.min().x());
  box->set_min_y_m(health.bounding_box_m.min().y());
  box->set_min_z_m(health.bounding_box_m.min().z());
  box->set_max_x_m(health.bounding_box_m.max().x());
  box->set_max_y_m(health.bounding_box_m.max().y());
  box->set_max_z_m(health.bounding_box_m.max().z());
  message.set_open_edge_count(health.open_edge_count);
  message.set_non_manifold_edge_count(health.non_manifold_edge_count);
  message.set_degenerate_triangle_count(health.degenerate_triangle_count);
  message.set_duplicate_triangle_count(health.duplicate_triangle_count);
  message.set_component_count(health.component_count);
  message.set_flipped_component_count(health.flipped_component_count);
  for (const std::string& finding : health.findings) message.add_findings(finding);
  return message;
}

}  // namespace sightline
