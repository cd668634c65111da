// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/tolerances/step_tolerances.h"

#include <Interface_InterfaceModel.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <StepData_StepModel.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp_Explorer.hxx>
#include <TopoDS.hxx>
#include <TopoDS_TShape.hxx>
#include <TransferBRep.hxx>
#include <Transfer_TransientProcess.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/step_pmi.h"
#include "tools/step_import/tolerances/xcaf_check.h"

namespace sightline {
namespace {

// What the reader made of entities of the file.
class ShapeFinder {
 public:
  ShapeFinder(STEPCAFControl_Reader& reader, const std::set<int64_t>& wanted)
      : process_(reader.ChangeReader().WS()->TransferReader()->TransientProcess()) {
    const Handle(StepData_StepModel) model = reader.ChangeReader().StepModel();
    for (int i = 1; i <= model->NbEntities(); ++i) {
      const Handle(Standard_Transient) entity = model->Value(i);
      const int64_t id = model->IdentLabel(entity);
      if (wanted.contains(id)) entities_.emplace(id, entity);
    }
  }

  // Null if the entity was not translated.
  TopoDS_Shape Find(int64_t id) const {
    const auto found = entities_.find(id);
    if (found == entities_.end()) return {};
    return TransferBRep::ShapeResult(process_, found->second);
  }

 private:
  Handle(Transfer_TransientProcess) process_;
  std::map<int64_t, Handle(Standard_Transient)> entities_;
};

}  // namespace

std::vector<TopoDS_Face> FacesInOrder(const std::vector<TopoDS_Shape>& bodies) {
  std::vector<TopoDS_Face> faces;
  for (const TopoDS_Shape& body : bodies) {
    for (TopExp_Explorer it(body, TopAbs_FACE); it.More(); it.Next()) {
      faces.push_back(TopoDS::Face(it.Current()));
    }
  }
  return faces;
}

ToleranceReport ReadStepTolerances(const std::filesystem::path& file, STEPCAFControl_Reader& reader,
                                   const Handle(TDocStd_Document) & document,
                                   const std::vector<TopoDS_Shape>& bodies) {
  const Part21File entities = Part21File::Read(file);
  StepPmi pmi = ReadStepPmi(entities);
  pmi.report.file = file.filename().string();

  const std::vector<TopoDS_Face> faces = FacesInOrder(bodies);
  FaceNumbers numbers;
  for (size_t i = 0; i < faces.size(); ++i) {
    numbers[faces[i].TShape().get()].insert(static_cast<int>(i + 1));
  }
  std::set<int64_t> wanted;
  for (const auto* bindings : {&pmi.read, &pmi.untoleranced, &pmi.datums}) {
    for (const PmiBinding& binding : *bindings) {
      wanted.insert(binding.items.begin(), binding.items.end());
    }
  }
  const ShapeFinder finder(reader, wanted);
  const auto bind = [&](const PmiBinding& binding, std::vector<int>& bound,
                        std::vector<std::string>& features) {
    std::set<int> all;
    if (binding.whole_part) {
      for (size_t i = 0; i < faces.size(); ++i) all.insert(static_cast<int>(i + 1));
      features.emplace_back("the whole part");
    }
    for (const int64_t item : binding.items) {
      const std::set<int> found = NumbersOf(finder.Find(item), numbers);
      all.insert(found.begin(), found.end());
      if (!found.empty()) continue;
      const auto types = entities.Types(item);
      features.push_back((types.empty() ? "missing entity" : std::string(types[0])) + " #" +
                         std::to_string(item));
    }
    bound.assign(all.begin(), all.end());
  };
  for (size_t i = 0; i < pmi.read.size(); ++i) {
    bind(pmi.read[i], pmi.report.read[i].faces, pmi.report.read[i].features);
  }
  for (size_t i = 0; i < pmi.untoleranced.size(); ++i) {
    Tolerance& tolerance = pmi.report.untoleranced[i];
    bind(pmi.untoleranced[i], tolerance.faces, tolerance.features);
  }
  for (size_t i = 0; i < pmi.datums.size(); ++i) {
    bind(pmi.datums[i], pmi.report.datums[i].faces, pmi.report.datums[i].features);
  }
  const auto faceless = std::ranges::count_if(
      pmi.report.read, [](const Tolerance& tolerance) { return tolerance.faces.empty(); });
  if (faceless > 0) {
    pmi.report.notes.push_back(std::to_string(faceless) +
                               " tolerances bind no face: no points of the surface are theirs");
  }
  if (pmi.report.entity_count > 0) {
    for (std::string& note : CompareWithXcaf(document, numbers, pmi.report)) {
      pmi.report.notes.push_back(std::move(note));
    }
  }
  return std::move(pmi.report);
}

}  // namespace sightline
