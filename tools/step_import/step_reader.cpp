// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/step_reader.h"

#include <BRep_Builder.hxx>
#include <Interface_Check.hxx>
#include <Interface_ReportEntity.hxx>
#include <STEPCAFControl_Reader.hxx>
#include <STEPControl_Reader.hxx>
#include <StepBasic_ConversionBasedUnitAndLengthUnit.hxx>
#include <StepBasic_SiUnitAndLengthUnit.hxx>
#include <StepData_StepModel.hxx>
#include <StepGeom_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx.hxx>
#include <StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext.hxx>
#include <StepGeom_GeometricRepresentationItem.hxx>
#include <StepRepr_GlobalUnitAssignedContext.hxx>
#include <StepShape_TopologicalRepresentationItem.hxx>
#include <TCollection_AsciiString.hxx>
#include <TCollection_HAsciiString.hxx>
#include <TDF_Label.hxx>
#include <TDF_LabelSequence.hxx>
#include <TDataStd_Name.hxx>
#include <TDocStd_Document.hxx>
#include <TopExp_Explorer.hxx>
#include <TopLoc_Location.hxx>
#include <TopoDS_Compound.hxx>
#include <XCAFDoc_DocumentTool.hxx>
#include <XCAFDoc_ShapeTool.hxx>
#include <algorithm>
#include <cctype>
#include <fstream>
#include <optional>
#include <set>
#include <string_view>

#include "tools/step_import/tolerances/step_tolerances.h"

namespace sightline {
namespace {

// OpenCASCADE reads a truncated file as far as it goes and calls that success, so look for the two
// marks every exchange structure must have before handing the file over.
void RequireExchangeStructure(const std::filesystem::path& file) {
  constexpr std::string_view kBegin = "ISO-10303-21;";
  constexpr std::string_view kEnd = "END-ISO-10303-21;";
  constexpr std::streamoff kWindow = 4096;
  std::error_code error;
  if (!std::filesystem::is_regular_file(file, error)) {
    throw StepInputError(file.string() + ": no such file");
  }
  std::ifstream in(file, std::ios::binary);
  if (!in) throw StepInputError(file.string() + ": cannot be opened for reading");
  in.seekg(0, std::ios::end);
  const std::streamoff size = in.tellg();
  const auto window = [&](std::streamoff from) {
    std::string text(static_cast<std::size_t>(std::min(kWindow, size - from)), '\0');
    in.seekg(from);
    in.read(text.data(), static_cast<std::streamsize>(text.size()));
    return text;
  };
  if (window(0).find(kBegin) == std::string::npos) {
    throw StepInputError(file.string() + ": not a STEP file (it does not begin with " +
                         std::string(kBegin) + ")");
  }
  if (window(std::max<std::streamoff>(0, size - kWindow)).find(kEnd) == std::string::npos) {
    throw StepInputError(file.string() + ": truncated (" + std::string(kEnd) +
                         " is missing at the end)");
  }
}

std::string NameOf(const TDF_Label& label) {
  Handle(TDataStd_Name) name;
  if (!label.FindAttribute(TDataStd_Name::GetID(), name)) return {};
  const std::string text = TCollection_AsciiString(name->Get(), '?').ToCString();
  // OpenCASCADE's own words for a shape without a name.
  return text == "SOLID" || text == "COMPOUND" || text == "SHELL" || text == "FACE" ? "" : text;
}

bool HasFaces(const TopoDS_Shape& shape) { return TopExp_Explorer(shape, TopAbs_FACE).More(); }

// A part without a name of its own is called after what it is a part of.
void AppendBodies(const TDF_Label& label, const TopLoc_Location& placement,
                  const std::string& parent_name, std::vector<StepBody>& bodies) {
  std::string name = NameOf(label);
  if (name.empty()) name = parent_name;
  if (XCAFDoc_ShapeTool::IsAssembly(label)) {
    TDF_LabelSequence components;
    XCAFDoc_ShapeTool::GetComponents(label, components);
    for (const TDF_Label& component : components) {
      TDF_Label part;
      if (!XCAFDoc_ShapeTool::GetReferredShape(component, part)) continue;
      AppendBodies(part, placement * XCAFDoc_ShapeTool::GetLocation(component), name, bodies);
    }
    return;
  }
  const TopoDS_Shape shape = XCAFDoc_ShapeTool::GetShape(label).Moved(placement);
  for (TopExp_Explorer solid(shape, TopAbs_SOLID); solid.More(); solid.Next()) {
    if (HasFaces(solid.Current())) bodies.push_back({name, solid.Current()});
  }
  TopoDS_Compound loose;
  BRep_Builder builder;
  builder.MakeCompound(loose);
  for (TopExp_Explorer face(shape, TopAbs_FACE, TopAbs_SOLID); face.More(); face.Next()) {
    builder.Add(loose, face.Current());
  }
  if (HasFaces(loose)) bodies.push_back({name, loose});
}

std::string UnitName(const Handle(StepBasic_NamedUnit) & unit) {
  if (const auto inch = Handle(StepBasic_ConversionBasedUnitAndLengthUnit)::DownCast(unit);
      !inch.IsNull()) {
    std::string name = inch->Name().IsNull() ? "" : inch->Name()->ToCString();
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
    return name;
  }
  const auto metre = Handle(StepBasic_SiUnitAndLengthUnit)::DownCast(unit);
  if (metre.IsNull()) return {};
  if (!metre->HasPrefix()) return "metre";
  switch (metre->Prefix()) {
    case StepBasic_spKilo:
      return "kilometre";
    case StepBasic_spDeci:
      return "decimetre";
    case StepBasic_spCenti:
      return "centimetre";
    case StepBasic_spMilli:
      return "millimetre";
    case StepBasic_spMicro:
      return "micrometre";
    default:
      return "metre with another prefix";
  }
}

Handle(StepRepr_GlobalUnitAssignedContext) UnitContext(const Handle(Standard_Transient) & entity) {
  if (const auto context = Handle(
          StepGeom_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx)::DownCast(entity);
      !context.IsNull()) {
    return context->GlobalUnitAssignedContext();
  }
  if (const auto context = Handle(
          StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext)::DownCast(entity);
      !context.IsNull()) {
    return context->GlobalUnitAssignedContext();
  }
  return Handle(StepRepr_GlobalUnitAssignedContext)::DownCast(entity);
}

// Length units of all geometric contexts. OpenCASCADE's own FileUnits() finds none in some files
// that it converts correctly.
std::string LengthUnits(const Handle(Interface_InterfaceModel) & model) {
  std::set<std::string> names;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const Handle(StepRepr_GlobalUnitAssignedContext) context = UnitContext(model->Value(i));
    if (context.IsNull() || context->Units().IsNull()) continue;
    for (int k = 1; k <= context->NbUnits(); ++k) names.insert(UnitName(context->UnitsValue(k)));
  }
  names.erase("");
  std::string units;
  for (const std::string& name : names) units += (units.empty() ? "" : ", ") + name;
  return units.empty() ? "not stated" : units;
}

// OpenCASCADE skips what it cannot read and carries on. Annotations it does not know do no harm,
// but a body with a lost edge must not pass for a part.
void RequireIntactGeometry(const std::filesystem::path& file,
                           const Handle(StepData_StepModel) & model) {
  const Handle(Interface_Check) syntax = model->GlobalCheck(/*syntactic=*/true);
  if (syntax->HasFailed())
    throw StepInputError(file.string() + ": cannot be parsed: " + syntax->CFail(1));
  for (int i = 1; i <= model->NbEntities(); ++i) {
    if (!model->IsErrorEntity(i)) continue;
    const Handle(Standard_Transient) entity = model->Value(i);
    const std::string_view type = entity->DynamicType()->Name();
    const bool geometry = entity->IsKind(STANDARD_TYPE(StepShape_TopologicalRepresentationItem)) ||
                          (entity->IsKind(STANDARD_TYPE(StepGeom_GeometricRepresentationItem)) &&
                           (type.starts_with("StepGeom_") || type.starts_with("StepShape_")));
    if (!geometry) continue;
    const Handle(Interface_Check) check = model->ReportEntity(i)->Check();
    throw StepInputError(file.string() + ": damaged geometry: #" +
                         std::to_string(model->IdentLabel(entity)) + " " +
                         std::string(type.substr(type.find('_') + 1)) + ": " +
                         (check->HasFailed() ? check->CFail(1) : "cannot be read"));
  }
}

}  // namespace

StepModel ReadStep(const std::filesystem::path& file, bool with_tolerances) {
  RequireExchangeStructure(file);
  STEPCAFControl_Reader reader;
  reader.SetNameMode(true);
  reader.SetColorMode(false);
  reader.SetLayerMode(false);
  reader.SetPropsMode(false);
  if (reader.ReadFile(file.c_str()) != IFSelect_RetDone) {
    throw StepInputError(file.string() + ": not a STEP file that can be parsed");
  }
  RequireIntactGeometry(file, reader.Reader().StepModel());
  if (reader.NbRootsForTransfer() == 0) {
    throw StepInputError(file.string() + ": no shape in it");
  }
  std::optional<StepTolerances> tolerances;
  if (with_tolerances) tolerances.emplace(file);
  reader.SetGDTMode(tolerances && tolerances->compared());
  Handle(TDocStd_Document) document = new TDocStd_Document("sightline");
  if (!reader.Transfer(document)) {
    throw StepInputError(file.string() + ": its shapes cannot be translated");
  }
  StepModel model;
  model.length_unit = LengthUnits(reader.Reader().StepModel());
  TDF_LabelSequence roots;
  XCAFDoc_DocumentTool::ShapeTool(document->Main())->GetFreeShapes(roots);
  for (const TDF_Label& root : roots) AppendBodies(root, TopLoc_Location(), "body", model.bodies);
  if (model.bodies.empty()) throw StepInputError(file.string() + ": no solids and no faces in it");
  if (tolerances) {
    std::vector<TopoDS_Shape> bodies;
    for (const StepBody& body : model.bodies) bodies.push_back(body.shape);
    model.tolerances = tolerances->Bind(reader, document, bodies);
  }
  return model;
}

}  // namespace sightline
