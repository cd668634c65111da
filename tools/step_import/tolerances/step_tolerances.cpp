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
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "tools/step_import/step_input_error.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/step_pmi.h"
#include "tools/step_import/tolerances/xcaf_check.h"

namespace sightline {
namespace {

// Finds the shapes that the reader made of entities of the file.
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

StepTolerances::StepTolerances(const StepText& file)
    : entities_(file.text, file.name), pmi_(ReadStepPmi(entities_)) {
  pmi_.report.file = std::filesystem::path(file.name).filename().string();
}

ToleranceReport StepTolerances::Bind(STEPCAFControl_Reader& reader,
                                     const Handle(TDocStd_Document) & document,
                                     const std::vector<TopoDS_Shape>& bodies) {
  const std::vector<TopoDS_Face> faces = FacesInOrder(bodies);
  FaceNumbers numbers;
  for (size_t i = 0; i < faces.size(); ++i) {
    numbers[faces[i].TShape().get()].push_back(static_cast<int>(i + 1));
  }
  std::set<int64_t> wanted;
  for (const auto* bindings : {&pmi_.read, &pmi_.untoleranced, &pmi_.datums}) {
    for (const PmiBinding& binding : *bindings) {
      wanted.insert(binding.items.begin(), binding.items.end());
    }
  }
  const ShapeFinder finder(reader, wanted);
  size_t bound_faces = 0;
  const auto count = [&](size_t more) {
    bound_faces += more;
    if (bound_faces <= kMostBoundFaces) return;
    throw StepInputError(entities_.name() + ": its tolerances and datums bind more than " +
                         std::to_string(kMostBoundFaces) + " faces, all together");
  };
  std::map<int64_t, std::vector<int>> faces_of_item;
  const auto faces_of = [&](int64_t item) -> const std::vector<int>& {
    const auto [place, is_new] = faces_of_item.try_emplace(item);
    if (is_new) place->second = NumbersOf(finder.Find(item), numbers);
    return place->second;
  };
  const auto bind = [&](const PmiBinding& binding, std::vector<int>& bound,
                        std::vector<std::string>& features) {
    if (binding.whole_part) {
      count(faces.size());
      for (size_t i = 0; i < faces.size(); ++i) bound.push_back(static_cast<int>(i + 1));
      features.emplace_back("the whole part");
    }
    size_t no_faces = 0;
    for (const int64_t item : binding.items) {
      const std::vector<int>& found = faces_of(item);
      count(found.size());
      bound.insert(bound.end(), found.begin(), found.end());
      if (!found.empty() || ++no_faces > kEntitiesNamed) continue;
      const auto types = entities_.Types(item);
      features.push_back((types.empty() ? "missing entity" : std::string(types[0])) + " #" +
                         std::to_string(item));
    }
    if (no_faces > kEntitiesNamed) {
      features.push_back("and " + std::to_string(no_faces - kEntitiesNamed) + " more");
    }
    std::sort(bound.begin(), bound.end());
    bound.erase(std::unique(bound.begin(), bound.end()), bound.end());
    bound.shrink_to_fit();
  };
  ToleranceReport& report = pmi_.report;
  for (size_t i = 0; i < pmi_.read.size(); ++i) {
    bind(pmi_.read[i], report.read[i].faces, report.read[i].features);
  }
  for (size_t i = 0; i < pmi_.untoleranced.size(); ++i) {
    bind(pmi_.untoleranced[i], report.untoleranced[i].faces, report.untoleranced[i].features);
  }
  for (size_t i = 0; i < pmi_.datums.size(); ++i) {
    bind(pmi_.datums[i], report.datums[i].faces, report.datums[i].features);
  }
  const auto faceless = std::ranges::count_if(
      report.read, [](const Tolerance& tolerance) { return tolerance.faces.empty(); });
  if (faceless > 0) {
    report.notes.push_back(std::to_string(faceless) +
                           " tolerances bind no face: no points of the surface are theirs");
  }
  if (!compared()) {
    report.notes.push_back(
        "not compared with OpenCASCADE's own reading: the file's tolerances and what they bind are "
        "too many");
  } else if (report.entity_count > 0) {
    for (std::string& note : CompareWithXcaf(document, numbers, report)) {
      report.notes.push_back(std::move(note));
    }
  }
  return std::move(report);
}

}  // namespace sightline
