// SPDX-License-Identifier: Apache-2.0
// Selects the solids and surface models of a STEP file that are the part.
//
// A product's shape is what its SHAPE_DEFINITION_REPRESENTATION uses, what
// SHAPE_REPRESENTATION_RELATIONSHIPs join to that, and what is mapped into it (ISO 10303-41, -43;
// CAx-IF recommended practices for model styling and assemblies). In the shape of a product that
// has a solid, only solids are the part: its surface models bound no material. CATIA writes
// extracts, joins and splits there. A product without a solid keeps its surface models.
// All other solids and surface models are construction geometry: those of a
// CONSTRUCTIVE_GEOMETRY_REPRESENTATION ("supplemental geometry" in CAx-IF's words), and those that
// only a shape aspect refers to. OpenCASCADE translates the latter into the product.
#pragma once

#include <Interface_Graph.hxx>
#include <StepGeom_GeometricRepresentationItem.hxx>
#include <StepRepr_Representation.hxx>
#include <string>
#include <vector>

namespace sightline {

struct StepItem {
  Handle(StepGeom_GeometricRepresentationItem) entity;
  std::string name;           // its own, else that of its representation, else its type and number
  bool beside_solid = false;  // a surface model in the shape of a product that has a solid
};

struct PartItems {
  std::vector<StepItem> part;
  std::vector<StepItem> construction;
  // Surface models outside the part whose faces are all faces of the part.
  std::vector<StepItem> repeated;
  // Representations whose lengths the part depends on.
  std::vector<Handle(StepRepr_Representation)> representations;
  bool has_assembly = false;
};

// `construction_geometry`: take it for the part, too.
PartItems FindPartItems(const Interface_Graph& graph, bool construction_geometry);

// "#12 SHELL_BASED_SURFACE_MODEL" of the file.
std::string EntityText(const Interface_Graph& graph, const Handle(Standard_Transient) & entity);

}  // namespace sightline
