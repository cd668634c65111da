// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/model/part_items.h"

#include <Interface_EntityIterator.hxx>
#include <StepBasic_ProductDefinition.hxx>
#include <StepBasic_ProductDefinitionRelationship.hxx>
#include <StepData_StepModel.hxx>
#include <StepRepr_CharacterizedDefinition.hxx>
#include <StepRepr_ConstructiveGeometryRepresentation.hxx>
#include <StepRepr_ConstructiveGeometryRepresentationRelationship.hxx>
#include <StepRepr_MappedItem.hxx>
#include <StepRepr_NextAssemblyUsageOccurrence.hxx>
#include <StepRepr_PropertyDefinition.hxx>
#include <StepRepr_RepresentationItem.hxx>
#include <StepRepr_RepresentationMap.hxx>
#include <StepRepr_RepresentationRelationship.hxx>
#include <StepRepr_RepresentedDefinition.hxx>
#include <StepRepr_ShapeRepresentationRelationshipWithTransformation.hxx>
#include <StepShape_FaceBasedSurfaceModel.hxx>
#include <StepShape_FaceSurface.hxx>
#include <StepShape_ShapeDefinitionRepresentation.hxx>
#include <StepShape_ShellBasedSurfaceModel.hxx>
#include <StepShape_SolidModel.hxx>
#include <TCollection_HAsciiString.hxx>
#include <algorithm>
#include <cctype>
#include <set>
#include <string_view>

#include "core/part/disjoint_sets.h"

namespace sightline {
namespace {

using Representation = Handle(StepRepr_Representation);

std::string TextOf(const Handle(TCollection_HAsciiString) & text) {
  return text.IsNull() ? std::string() : std::string(text->ToCString());
}

bool IsSupplementalName(const Handle(TCollection_HAsciiString) & name) {
  constexpr std::string_view kName = "supplemental geometry";
  const std::string text = TextOf(name);
  return std::ranges::equal(
      text, kName, [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
}

bool IsConstructive(const Representation& representation) {
  return representation->IsKind(STANDARD_TYPE(StepRepr_ConstructiveGeometryRepresentation)) ||
         IsSupplementalName(representation->Name());
}

bool IsBody(const Handle(Standard_Transient) & item) {
  return !item.IsNull() && (item->IsKind(STANDARD_TYPE(StepShape_SolidModel)) ||
                            item->IsKind(STANDARD_TYPE(StepShape_ShellBasedSurfaceModel)) ||
                            item->IsKind(STANDARD_TYPE(StepShape_FaceBasedSurfaceModel)));
}

// Finds what belongs to products by following relations from their shape definitions.
class PartFinder {
 public:
  explicit PartFinder(const Interface_Graph& graph)
      : graph_(graph), products_(static_cast<size_t>(graph.Size()) + 1) {}

  PartItems Find(bool construction_geometry) {
    AddProductRepresentations();
    while (!waiting_.empty()) {
      const Representation next = waiting_.back();
      waiting_.pop_back();
      Follow(next);
    }
    // The surface models of a product that has a solid bound no material.
    std::set<uint32_t> with_solid;
    for (const int number : shape_) {
      if (HoldsSolid(RepresentationAt(number))) with_solid.insert(ProductOf(number));
    }
    for (const int number : shape_) {
      const bool only_solids = with_solid.contains(ProductOf(number));
      AddBodies(RepresentationAt(number), only_solids, found_.part, part_bodies_);
    }
    for (const int number : shape_) {
      AddBodies(RepresentationAt(number), false, found_.construction, other_bodies_);
    }
    for (StepItem& item : found_.construction) item.beside_solid = true;
    ForEach<StepRepr_Representation>([&](const Representation& representation) {
      if (shape_.contains(Number(representation))) return;
      const size_t before = found_.construction.size();
      AddBodies(representation, false, found_.construction, other_bodies_);
      if (construction_geometry && found_.construction.size() > before) {
        found_.representations.push_back(representation);
      }
    });
    SetRepeatedAside();
    if (construction_geometry) {
      found_.part.insert(found_.part.end(), found_.construction.begin(), found_.construction.end());
      found_.construction.clear();
    }
    ForEach<StepRepr_NextAssemblyUsageOccurrence>([&](const auto&) { found_.has_assembly = true; });
    return found_;
  }

 private:
  template <typename Entity, typename Function>
  void ForEach(const Function& call) const {
    for (int i = 1; i <= graph_.Size(); ++i) {
      const Handle(Entity) entity = Handle(Entity)::DownCast(graph_.Entity(i));
      if (!entity.IsNull()) call(entity);
    }
  }
  int Number(const Handle(Standard_Transient) & entity) const {
    return graph_.EntityNumber(entity);
  }
  Representation RepresentationAt(int number) const {
    return Handle(StepRepr_Representation)::DownCast(graph_.Entity(number));
  }

  uint32_t ProductOf(int number) { return products_.Find(static_cast<uint32_t>(number)); }
  void JoinProduct(const Handle(Standard_Transient) & a, const Handle(Standard_Transient) & b) {
    if (a.IsNull() || b.IsNull()) return;
    const int a_number = Number(a), b_number = Number(b);
    if (a_number == 0 || b_number == 0) return;
    products_.Join(static_cast<uint32_t>(a_number), static_cast<uint32_t>(b_number));
  }
  static bool HoldsSolid(const Representation& representation) {
    for (int i = 1; i <= representation->NbItems(); ++i) {
      const Handle(StepRepr_RepresentationItem) item = representation->ItemsValue(i);
      if (!item.IsNull() && item->IsKind(STANDARD_TYPE(StepShape_SolidModel))) return true;
    }
    return false;
  }

  void Reach(const Representation& representation) {
    if (representation.IsNull() || IsConstructive(representation)) return;
    const int number = Number(representation);
    if (number > 0 && shape_.insert(number).second) waiting_.push_back(representation);
  }

  void AddProductRepresentations() {
    ForEach<StepShape_ShapeDefinitionRepresentation>([&](const auto& definition) {
      const Handle(StepRepr_PropertyDefinition) property =
          definition->Definition().PropertyDefinition();
      if (property.IsNull()) return;
      const StepRepr_CharacterizedDefinition of = property->Definition();
      if (of.ProductDefinition().IsNull() && of.ProductDefinitionRelationship().IsNull()) return;
      Reach(definition->UsedRepresentation());
      JoinProduct(definition->UsedRepresentation(), property);
      JoinProduct(property, of.ProductDefinition());
    });
  }

  // Reaches what is joined to a representation or mapped into it.
  void Follow(const Representation& representation) {
    bool measured = false;
    for (Interface_EntityIterator user = graph_.Sharings(representation); user.More();
         user.Next()) {
      const auto relation = Handle(StepRepr_RepresentationRelationship)::DownCast(user.Value());
      if (relation.IsNull()) continue;
      if (relation->IsKind(
              STANDARD_TYPE(StepRepr_ConstructiveGeometryRepresentationRelationship)) ||
          IsSupplementalName(relation->Name())) {
        continue;
      }
      const bool placed = relation->IsKind(
          STANDARD_TYPE(StepRepr_ShapeRepresentationRelationshipWithTransformation));
      measured |= placed;
      if (!placed) JoinProduct(relation->Rep1(), relation->Rep2());
      Reach(relation->Rep1());
      Reach(relation->Rep2());
    }
    for (int i = 1; i <= representation->NbItems(); ++i) {
      const Handle(StepRepr_RepresentationItem) item = representation->ItemsValue(i);
      if (IsBody(item)) measured = true;
      const auto mapped = Handle(StepRepr_MappedItem)::DownCast(item);
      if (mapped.IsNull() || mapped->MappingSource().IsNull()) continue;
      measured = true;
      Reach(mapped->MappingSource()->MappedRepresentation());
    }
    if (measured) found_.representations.push_back(representation);
  }

  void AddBodies(const Representation& representation, bool only_solids,
                 std::vector<StepItem>& items, std::set<int>& known) {
    for (int i = 1; i <= representation->NbItems(); ++i) {
      const Handle(StepRepr_RepresentationItem) item = representation->ItemsValue(i);
      if (!IsBody(item)) continue;
      if (only_solids && !item->IsKind(STANDARD_TYPE(StepShape_SolidModel))) continue;
      const int number = Number(item);
      if (part_bodies_.contains(number) || !known.insert(number).second) continue;
      std::string name = TextOf(item->Name());
      if (name.empty()) name = TextOf(representation->Name());
      if (name.empty()) name = EntityText(graph_, item);
      items.push_back({Handle(StepGeom_GeometricRepresentationItem)::DownCast(item), name, false});
    }
  }

  std::set<int> FacesOf(const StepItem& item) const {
    std::set<int> seen, faces;
    std::vector<Handle(Standard_Transient)> waiting;
    waiting.emplace_back(item.entity);
    while (!waiting.empty()) {
      const Handle(Standard_Transient) entity = waiting.back();
      waiting.pop_back();
      const int number = Number(entity);
      if (number == 0 || !seen.insert(number).second) continue;
      if (entity->IsKind(STANDARD_TYPE(StepShape_FaceSurface))) {
        faces.insert(number);
        continue;
      }
      for (Interface_EntityIterator part = graph_.Shareds(entity); part.More(); part.Next()) {
        waiting.push_back(part.Value());
      }
    }
    return faces;
  }

  void SetRepeatedAside() {
    if (found_.construction.empty()) return;
    std::set<int> of_part;
    for (const StepItem& item : found_.part) of_part.merge(FacesOf(item));
    const auto repeated = std::ranges::stable_partition(
        found_.construction,
        [&](const StepItem& item) { return !std::ranges::includes(of_part, FacesOf(item)); });
    found_.repeated.assign(repeated.begin(), repeated.end());
    found_.construction.erase(repeated.begin(), repeated.end());
  }

  const Interface_Graph& graph_;
  DisjointSets products_;  // representations and properties of one product, by number
  PartItems found_;
  std::set<int> shape_;  // numbers of the product's representations
  std::vector<Representation> waiting_;
  std::set<int> part_bodies_, other_bodies_;
};

}  // namespace

std::string EntityText(const Interface_Graph& graph, const Handle(Standard_Transient) & entity) {
  // "StepShape_ShellBasedSurfaceModel" is SHELL_BASED_SURFACE_MODEL.
  std::string_view type = entity->DynamicType()->Name();
  type.remove_prefix(std::min(type.size(), type.find('_') + 1));
  const auto model = Handle(StepData_StepModel)::DownCast(graph.Model());
  std::string text = "#" + std::to_string(model->IdentLabel(entity)) + " ";
  for (size_t i = 0; i < type.size(); ++i) {
    if (i > 0 && std::isupper(static_cast<unsigned char>(type[i]))) text += '_';
    text += static_cast<char>(std::toupper(static_cast<unsigned char>(type[i])));
  }
  return text;
}

PartItems FindPartItems(const Interface_Graph& graph, bool construction_geometry) {
  return PartFinder(graph).Find(construction_geometry);
}

}  // namespace sightline
