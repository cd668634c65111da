// SPDX-License-Identifier: Apache-2.0
// Which solids and surface models of a STEP file are the part.
//
// A product's shape is what its SHAPE_DEFINITION_REPRESENTATION uses, what
// SHAPE_REPRESENTATION_RELATIONSHIPs join to that, and what is mapped into it (ISO 10303-41, -43;
// CAx-IF recommended practices for model styling and assemblies). All other solids and surface
// models are construction geometry: those of a CONSTRUCTIVE_GEOMETRY_REPRESENTATION ("supplemental
// geometry" in CAx-IF's words), and those that only a shape aspect refers to. OpenCASCADE
// translates the latter into the product.
#pragma once

#include <Interface_Graph.hxx>
#include <StepGeom_GeometricRepresentationItem.hxx>
#include <StepRepr_Representation.hxx>
#include <string>
#include <vector>

namespace sightline {

struct StepItem {
  Handle(StepGeom_GeometricRepresentationItem) entity;
  std::string name;  // its own, else that of its representation, else its type and number
};

struct PartItems {
  std::vector<StepItem> part;
  // Construction geometry. A surface model all of whose faces are faces of the part is none.
  std::vector<StepItem> construction;
  // Representations whose lengths the part depends on.
  std::vector<Handle(StepRepr_Representation)> representations;
  bool has_assembly = false;
};

// `construction_geometry`: take it for the part, too.
PartItems FindPartItems(const Interface_Graph& graph, bool construction_geometry);

// "#12 SHELL_BASED_SURFACE_MODEL" of the file.
std::string EntityText(const Interface_Graph& graph, const Handle(Standard_Transient) & entity);

}  // namespace sightline
