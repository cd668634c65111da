// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/model/intact_geometry.h"

#include <Interface_Check.hxx>
#include <Interface_EntityIterator.hxx>
#include <Interface_ReportEntity.hxx>
#include <StepData_StepModel.hxx>
#include <StepGeom_CartesianPoint.hxx>
#include <StepGeom_Direction.hxx>
#include <StepGeom_GeometricRepresentationItem.hxx>
#include <StepGeom_Pcurve.hxx>
#include <StepRepr_DefinitionalRepresentation.hxx>
#include <StepShape_TopologicalRepresentationItem.hxx>
#include <string_view>

#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

// OpenCASCADE keeps three of them, so that only the text tells.
void RequireAtMostThreeCoordinates(const Part21File& file) {
  const auto has_coordinates = [](std::string_view type) {
    return type == "CARTESIAN_POINT" || type == "DIRECTION";
  };
  for (const int64_t id : file.Find(has_coordinates)) {
    for (const Part21Record& record : file.Records(id)) {
      if (!has_coordinates(record.type) || record.values.empty()) continue;
      const size_t count = record.values.back().list.size();
      if (count <= 3) continue;
      throw StepInputError(file.name() + ": damaged geometry: #" + std::to_string(id) + " " +
                           record.type + ": has " + std::to_string(count) +
                           " coordinates, must have 3");
    }
  }
}

}  // namespace

void RequireIntactGeometry(const std::string& name, const Interface_Graph& graph) {
  const auto model = Handle(StepData_StepModel)::DownCast(graph.Model());
  const Handle(Interface_Check) syntax = model->GlobalCheck(/*syntactic=*/true);
  if (syntax->HasFailed()) throw StepInputError(name + ": cannot be parsed: " + syntax->CFail(1));
  for (int i = 1; i <= model->NbEntities(); ++i) {
    if (!model->IsErrorEntity(i)) continue;
    const Handle(Standard_Transient) entity = model->Value(i);
    const std::string_view type = entity->DynamicType()->Name();
    const bool geometry = entity->IsKind(STANDARD_TYPE(StepShape_TopologicalRepresentationItem)) ||
                          (entity->IsKind(STANDARD_TYPE(StepGeom_GeometricRepresentationItem)) &&
                           (type.starts_with("StepGeom_") || type.starts_with("StepShape_")));
    if (!geometry) continue;
    const Handle(Interface_Check) check = model->ReportEntity(i)->Check();
    throw StepInputError(name + ": damaged geometry: " + EntityText(graph, entity) + ": " +
                         (check->HasFailed() ? check->CFail(1) : "cannot be read"));
  }
}

void RequireThreeCoordinates(const Part21File& file, const Interface_Graph& graph,
                             const PartItems& items) {
  RequireAtMostThreeCoordinates(file);
  std::vector<bool> seen(static_cast<size_t>(graph.Size()) + 1);
  std::vector<Handle(Standard_Transient)> waiting;
  for (const StepItem& item : items.part) waiting.emplace_back(item.entity);
  for (const StepItem& item : items.construction) waiting.emplace_back(item.entity);
  for (const auto& representation : items.representations) waiting.emplace_back(representation);
  while (!waiting.empty()) {
    const Handle(Standard_Transient) entity = waiting.back();
    waiting.pop_back();
    const auto number = static_cast<size_t>(graph.EntityNumber(entity));
    if (number == 0 || seen[number]) continue;
    seen[number] = true;
    if (entity->IsKind(STANDARD_TYPE(StepGeom_Pcurve)) ||
        entity->IsKind(STANDARD_TYPE(StepRepr_DefinitionalRepresentation))) {
      continue;
    }
    int count = 3;
    if (const auto point = Handle(StepGeom_CartesianPoint)::DownCast(entity); !point.IsNull()) {
      count = point->NbCoordinates();
    } else if (const auto direction = Handle(StepGeom_Direction)::DownCast(entity);
               !direction.IsNull()) {
      count = direction->DirectionRatios().IsNull() ? 0 : direction->NbDirectionRatios();
    }
    if (count != 3) {
      throw StepInputError(file.name() + ": damaged geometry: " + EntityText(graph, entity) +
                           ": has " + std::to_string(count) + " coordinates, must have 3");
    }
    for (Interface_EntityIterator part = graph.Shareds(entity); part.More(); part.Next()) {
      waiting.push_back(part.Value());
    }
  }
}

}  // namespace sightline
