// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/step_reader.h"

#include <BRep_Builder.hxx>
#include <Interface_Check.hxx>
#include <NCollection_DataMap.hxx>
#include <STEPCAFControl_ExternFile.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <StepData_StepModel.hxx>
#include <TCollection_AsciiString.hxx>
#include <TDF_Label.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp_Explorer.hxx>
#include <TopLoc_Location.hxx>
#include <TopoDS_Compound.hxx>
#include <TopoDS_TShape.hxx>
#include <TransferBRep.hxx>
#include <Transfer_TransientProcess.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <XSControl_TransferReader.hxx>
#include <XSControl_WorkSession.hxx>
#include <algorithm>
#include <istream>
#include <set>
#include <string_view>
#include <utility>

#include "tools/step_import/model/intact_geometry.h"
#include "tools/step_import/model/length_unit.h"
#include "tools/step_import/model/part_items.h"
#include "tools/step_import/model/tessellation.h"
#include "tools/step_import/tolerances/step_tolerances.h"

namespace sightline {
namespace {

using FaceSet = std::set<const TopoDS_TShape*>;

std::string NameOf(const TDF_Label& label) {
  Handle(TDataStd_Name) name;
  if (!label.FindAttribute(TDataStd_Name::GetID(), name)) return {};
  const std::string text = TCollection_AsciiString(name->Get(), '?').ToCString();
  // OpenCASCADE's own words for a shape without a name.
  return text == "SOLID" || text == "COMPOUND" || text == "SHELL" || text == "FACE" ? "" : text;
}

bool HasFaces(const TopoDS_Shape& shape) { return TopExp_Explorer(shape, TopAbs_FACE).More(); }

FaceSet FacesOf(const TopoDS_Shape& shape) {
  FaceSet faces;
  for (TopExp_Explorer face(shape, TopAbs_FACE); face.More(); face.Next()) {
    faces.insert(face.Current().TShape().get());
  }
  return faces;
}

// Gathers bodies without those faces that are construction geometry.
class BodyCollector {
 public:
  explicit BodyCollector(FaceSet left_out) : left_out_(std::move(left_out)) {}

  // A part without a name of its own is called after what it is a part of.
  void AddProduct(const TDF_Label& label, const TopLoc_Location& placement,
                  const std::string& parent_name) {
    std::string name = NameOf(label);
    if (name.empty()) name = parent_name;
    if (XCAFDoc_ShapeTool::IsAssembly(label)) {
      TDF_LabelSequence components;
      XCAFDoc_ShapeTool::GetComponents(label, components);
      for (const TDF_Label& component : components) {
        TDF_Label part;
        if (!XCAFDoc_ShapeTool::GetReferredShape(component, part)) continue;
        AddProduct(part, placement * XCAFDoc_ShapeTool::GetLocation(component), name);
      }
      return;
    }
    AddShape(XCAFDoc_ShapeTool::GetShape(label).Moved(placement), name);
  }

  void AddShape(const TopoDS_Shape& shape, const std::string& name) {
    for (TopExp_Explorer solid(shape, TopAbs_SOLID); solid.More(); solid.Next()) {
      const FaceSet faces = FacesOf(solid.Current());
      if (std::ranges::includes(left_out_, faces)) continue;
      bodies_.push_back({name, solid.Current(), {}});
      of_solids_.insert(faces.begin(), faces.end());
    }
    TopoDS_Compound loose;
    BRep_Builder builder;
    builder.MakeCompound(loose);
    for (TopExp_Explorer face(shape, TopAbs_FACE, TopAbs_SOLID); face.More(); face.Next()) {
      const TopoDS_TShape* const surface = face.Current().TShape().get();
      if (left_out_.contains(surface) || of_solids_.contains(surface)) continue;
      builder.Add(loose, face.Current());
    }
    if (HasFaces(loose)) bodies_.push_back({name, loose, {}});
  }

  std::vector<StepBody> Take() { return std::move(bodies_); }

 private:
  const FaceSet left_out_;
  FaceSet of_solids_;  // a sheet may repeat faces of a solid
  std::vector<StepBody> bodies_;
};

// OpenCASCADE's message about an entity that it could not translate.
std::string FailureText(const Handle(Transfer_TransientProcess) & process,
                        const Handle(Standard_Transient) & entity) {
  const Handle(Transfer_Binder) binder = process->Find(entity);
  if (!binder.IsNull() && binder->Check()->HasFailed()) return binder->Check()->CFail(1);
  const Handle(Interface_Check) check = process->Check(entity);
  if (!check.IsNull() && check->HasFailed()) return check->CFail(1);
  return "OpenCASCADE does not say why";
}

std::string Quoted(const std::vector<std::string>& names) {
  constexpr size_t kMostNamed = 20;
  std::string text;
  for (size_t i = 0; i < std::min(names.size(), kMostNamed); ++i) {
    text += (i > 0 ? ", \"" : "\"") + names[i] + "\"";
  }
  if (names.size() > kMostNamed) {
    text += " and " + std::to_string(names.size() - kMostNamed) + " more";
  }
  return text;
}

bool MayHaveTessellatedBodies(std::string_view text) {
  constexpr auto kNone = std::string_view::npos;
  return text.find("TRIANGULATED_") != kNone || text.find("TESSELLATED_S") != kNone;
}

// The entities of a file, translated by OpenCASCADE.
class StepTranslation {
 public:
  StepTranslation(const StepText& file, const StepReadOptions& options)
      : file_(file), options_(options) {
    reader_.SetNameMode(true);
    reader_.SetColorMode(false);
    reader_.SetLayerMode(false);
    reader_.SetPropsMode(false);
    TextBuffer buffer(file.text);
    std::istream stream(&buffer);
    if (reader_.ChangeReader().ReadStream(file.name.c_str(), stream) != IFSelect_RetDone) {
      throw StepInputError(file.name + ": not a STEP file that can be parsed");
    }
    RequireIntactGeometry(file.name, graph());
    items_ = FindPartItems(graph(), options.construction_geometry);
    const Part21File entities(file.text, file.name);
    RequireThreeCoordinates(entities, graph(), items_);
    SettleLengthUnit(entities, options.unit, graph().Model(), items_.representations);
  }

  // Translates all products into bodies. None if the file has no exact geometry.
  std::vector<StepBody> Translate(bool compare_tolerances) {
    reader_.SetGDTMode(compare_tolerances);
    document_ = new TDocStd_Document("sightline");
    const bool translated = reader_.NbRootsForTransfer() > 0 && reader_.Transfer(document_);
    RequireOwnGeometry();
    RequireTranslatedParts();
    BodyCollector bodies(LeftOutFaces());
    if (translated) {
      TDF_LabelSequence roots;
      XCAFDoc_DocumentTool::ShapeTool(document_->Main())->GetFreeShapes(roots);
      for (const TDF_Label& root : roots) bodies.AddProduct(root, TopLoc_Location(), "body");
    }
    for (const auto& [shape, name] : added_) bodies.AddShape(shape, name);
    return bodies.Take();
  }

  // After Translate. Names of construction geometry that is not in the bodies.
  std::vector<std::string> LeftOut(bool beside_solid) const {
    std::vector<std::string> names;
    for (const StepItem& item : items_.construction) {
      if (item.beside_solid == beside_solid) names.push_back(item.name);
    }
    return names;
  }
  std::string LengthUnit() const {
    const std::string stated = StatedLengthUnits(graph().Model());
    return options_.unit.empty() ? stated : options_.unit;
  }
  ToleranceReport Bind(StepTolerances& tolerances, const std::vector<StepBody>& bodies) {
    std::vector<TopoDS_Shape> shapes;
    for (const StepBody& body : bodies) shapes.push_back(body.shape);
    return tolerances.Bind(reader_, document_, shapes);
  }

 private:
  const Interface_Graph& graph() const { return reader_.Reader().WS()->Graph(); }
  Handle(Transfer_TransientProcess) process() const {
    return reader_.Reader().WS()->TransferReader()->TransientProcess();
  }

  // A file may leave the geometry of its components to other files. Those are not read: the part
  // would depend on files that nobody named.
  void RequireOwnGeometry() const {
    std::vector<std::string> names;
    using Files = NCollection_DataMap<TCollection_AsciiString, Handle(STEPCAFControl_ExternFile)>;
    for (Files::Iterator it(reader_.ExternFiles()); it.More(); it.Next()) {
      names.emplace_back(it.Key().ToCString());
    }
    if (names.empty()) return;
    throw StepInputError(file_.name + ": the geometry of some components is in other files (" +
                         Quoted(names) + "); save the assembly as a single file");
  }

  // OpenCASCADE leaves out what it cannot translate. Construction geometry that it has passed over
  // is translated here if it was asked for.
  void RequireTranslatedParts() {
    for (const StepItem& item : items_.part) {
      if (!TransferBRep::ShapeResult(process(), item.entity).IsNull()) continue;
      if (options_.construction_geometry) {
        if (items_.has_assembly) {
          throw StepInputError(file_.name + ": " + EntityText(graph(), item.entity) + " \"" +
                               item.name +
                               "\": construction geometry in an assembly has no place that is "
                               "known; leave --construction-geometry out");
        }
        if (reader_.ChangeReader().TransferEntity(item.entity)) {
          const TopoDS_Shape shape = TransferBRep::ShapeResult(process(), item.entity);
          if (!shape.IsNull()) {
            added_.emplace_back(shape, item.name);
            continue;
          }
        }
      }
      throw StepInputError(file_.name + ": " + EntityText(graph(), item.entity) + " \"" +
                           item.name +
                           "\" cannot be translated: " + FailureText(process(), item.entity));
    }
  }

  FaceSet LeftOutFaces() const {
    FaceSet left_out;
    for (const auto* items : {&items_.construction, &items_.repeated}) {
      for (const StepItem& item : *items) {
        left_out.merge(FacesOf(TransferBRep::ShapeResult(process(), item.entity)));
      }
    }
    for (const StepItem& item : items_.part) {
      for (const TopoDS_TShape* face : FacesOf(TransferBRep::ShapeResult(process(), item.entity))) {
        left_out.erase(face);
      }
    }
    return left_out;
  }

  const StepText& file_;
  const StepReadOptions& options_;
  STEPCAFControl_Reader reader_;
  Handle(TDocStd_Document) document_;
  PartItems items_;
  std::vector<std::pair<TopoDS_Shape, std::string>> added_;
};

[[noreturn]] void FailWithoutBodies(const StepText& file,
                                    const std::vector<std::string>& construction,
                                    const std::vector<std::string>& tessellated) {
  if (!construction.empty()) {
    throw StepInputError(file.name + ": no solid and no surface in the product's shape; " +
                         Quoted(construction) +
                         " is construction geometry, which --construction-geometry takes in");
  }
  if (!tessellated.empty()) {
    throw StepInputError(file.name + ": no solid and no surface in the product's shape; " +
                         "tessellated " + Quoted(tessellated) + " is in the shape of no product");
  }
  throw StepInputError(file.name +
                       ": no solid and no surface in it; its shape representations "
                       "hold " +
                       ItemTypesText(Part21File(file.text, file.name)));
}

}  // namespace

StepModel ReadStep(const StepText& file, const StepReadOptions& options) {
  StepTranslation translation(file, options);
  std::optional<StepTolerances> tolerances;
  if (options.with_tolerances) tolerances.emplace(file);
  StepModel model;
  model.bodies = translation.Translate(tolerances && tolerances->compared());
  const std::vector<std::string> beside_solid = translation.LeftOut(true);
  const std::vector<std::string> construction = translation.LeftOut(false);
  if (!beside_solid.empty() && !model.bodies.empty()) {
    model.remarks.push_back("left out as surfaces of a product that has a solid: " +
                            Quoted(beside_solid) + "; --construction-geometry takes them in");
  }
  if (!construction.empty() && !model.bodies.empty()) {
    model.remarks.push_back("left out as construction geometry: " + Quoted(construction) +
                            "; --construction-geometry takes it in");
  }
  std::vector<std::string> of_no_product;
  if (MayHaveTessellatedBodies(file.text)) {
    TessellatedBodies tessellated =
        ReadTessellation(Part21File(file.text, file.name), options.unit);
    for (ShapeMesh& mesh : tessellated.bodies) {
      model.bodies.push_back({mesh.name, {}, std::move(mesh)});
    }
    if (!tessellated.left_out.empty() && !model.bodies.empty()) {
      model.remarks.push_back("left out: tessellated " + Quoted(tessellated.left_out) +
                              ", since the part has exact geometry");
    }
    of_no_product = std::move(tessellated.of_no_product);
    if (!of_no_product.empty() && !model.bodies.empty()) {
      model.remarks.push_back("left out: tessellated " + Quoted(of_no_product) +
                              ", which is in the shape of no product");
    }
  }
  if (model.bodies.empty()) FailWithoutBodies(file, construction, of_no_product);
  model.length_unit = translation.LengthUnit();
  if (tolerances) model.tolerances = translation.Bind(*tolerances, model.bodies);
  return model;
}

StepModel ReadStep(const std::filesystem::path& file, bool with_tolerances) {
  StepReadOptions options;
  options.with_tolerances = with_tolerances;
  return ReadStep(ReadStepText(file), options);
}

}  // namespace sightline
