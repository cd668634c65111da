// SPDX-License-Identifier: Apache-2.0
#include "tools/step_import/model/length_unit.h"

#include <STEPConstruct_UnitContext.hxx>
#include <StepBasic_ConversionBasedUnitAndLengthUnit.hxx>
#include <StepBasic_DimensionalExponents.hxx>
#include <StepBasic_HArray1OfNamedUnit.hxx>
#include <StepBasic_LengthMeasureWithUnit.hxx>
#include <StepBasic_MeasureValueMember.hxx>
#include <StepBasic_SiUnitAndLengthUnit.hxx>
#include <StepBasic_Unit.hxx>
#include <StepGeom_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx.hxx>
#include <StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext.hxx>
#include <StepRepr_GlobalUnitAssignedContext.hxx>
#include <TCollection_HAsciiString.hxx>
#include <algorithm>
#include <cctype>
#include <set>

#include "core/text/length_unit.h"
#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

using NamedUnit = Handle(StepBasic_NamedUnit);
using UnitContext = Handle(StepRepr_GlobalUnitAssignedContext);

std::string UnitName(const NamedUnit& unit) {
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

// Null if the context assigns no units.
UnitContext UnitsOf(const Handle(Standard_Transient) & entity) {
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
  return UnitContext::DownCast(entity);
}

// Whether OpenCASCADE finds a length unit in it, which it then applies.
bool StatesLength(const UnitContext& units) {
  if (units.IsNull() || units->Units().IsNull()) return false;
  STEPConstruct_UnitContext factors;
  factors.ComputeFactors(units);
  return factors.LengthDone() && factors.LengthFactor() > 0;
}

NamedUnit SiLength(bool has_prefix, StepBasic_SiPrefix prefix) {
  Handle(StepBasic_SiUnitAndLengthUnit) unit = new StepBasic_SiUnitAndLengthUnit;
  unit->Init(has_prefix, prefix, StepBasic_sunMetre);
  return unit;
}

// `unit`: a name of LengthUnitNamed.
NamedUnit MakeUnit(const std::string& unit) {
  if (unit == "m") return SiLength(false, StepBasic_spMilli);
  if (unit == "cm") return SiLength(true, StepBasic_spCenti);
  if (unit == "mm") return SiLength(true, StepBasic_spMilli);
  if (unit == "um") return SiLength(true, StepBasic_spMicro);
  StepBasic_Unit millimetre;
  millimetre.SetValue(SiLength(true, StepBasic_spMilli));
  Handle(StepBasic_MeasureValueMember) value = new StepBasic_MeasureValueMember;
  value->SetName("LENGTH_MEASURE");
  value->SetReal(MillimetresPer(unit));
  Handle(StepBasic_LengthMeasureWithUnit) measure = new StepBasic_LengthMeasureWithUnit;
  measure->Init(value, millimetre);
  Handle(StepBasic_DimensionalExponents) length = new StepBasic_DimensionalExponents;
  length->Init(1, 0, 0, 0, 0, 0, 0);
  Handle(StepBasic_ConversionBasedUnitAndLengthUnit) converted =
      new StepBasic_ConversionBasedUnitAndLengthUnit;
  converted->Init(length, new TCollection_HAsciiString(unit.c_str()), measure);
  return converted;
}

// The units with one more.
Handle(StepBasic_HArray1OfNamedUnit)
    With(const Handle(StepBasic_HArray1OfNamedUnit) & units, const NamedUnit& added) {
  const int count = units.IsNull() ? 0 : units->Length();
  Handle(StepBasic_HArray1OfNamedUnit) all = new StepBasic_HArray1OfNamedUnit(1, count + 1);
  for (int i = 0; i < count; ++i) all->SetValue(i + 1, units->Value(units->Lower() + i));
  all->SetValue(count + 1, added);
  return all;
}

void StateUnit(const Handle(StepRepr_Representation) & representation, const NamedUnit& unit) {
  const Handle(StepRepr_RepresentationContext) context = representation->ContextOfItems();
  if (const UnitContext units = UnitsOf(context); !units.IsNull()) {
    units->SetUnits(With(units->Units(), unit));
    return;
  }
  Handle(StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext) with_unit =
      new StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext;
  const Handle(TCollection_HAsciiString) empty = new TCollection_HAsciiString("");
  with_unit->Init(empty, empty, 3, With({}, unit));
  representation->SetContextOfItems(with_unit);
}

}  // namespace

std::string StatedLengthUnits(const Handle(Interface_InterfaceModel) & model) {
  // OpenCASCADE's own FileUnits() finds none in some files that it converts correctly.
  std::set<std::string> names;
  for (int i = 1; i <= model->NbEntities(); ++i) {
    const UnitContext context = UnitsOf(model->Value(i));
    if (context.IsNull() || context->Units().IsNull()) continue;
    for (int k = 1; k <= context->NbUnits(); ++k) names.insert(UnitName(context->UnitsValue(k)));
  }
  names.erase("");
  std::string units;
  for (const std::string& name : names) units += (units.empty() ? "" : ", ") + name;
  return units;
}

double MillimetresPer(const std::string& unit) { return 1e3 * MetresPerUnit(unit).value_or(0); }

void FailWithoutLengthUnit(const std::string& name) {
  throw StepInputError(name +
                       ": part.unit is missing: the file states no length unit; state it with "
                       "--unit (part.unit in an inspection): m, cm, mm, um or inch");
}

void FailWithSecondLengthUnit(const std::string& name, const std::string& stated) {
  throw StepInputError(name + ": unit is given, must be left out: the file says its unit itself (" +
                       stated + ")");
}

void SettleLengthUnit(const std::string& name, const std::string& unit,
                      const Handle(Interface_InterfaceModel) & model,
                      const std::vector<Handle(StepRepr_Representation)>& representations) {
  if (!unit.empty() && MillimetresPer(unit) == 0) {
    throw StepInputError(name + ": unit is \"" + unit + "\", must be m, cm, mm, um or inch");
  }
  std::vector<Handle(StepRepr_Representation)> without;
  for (const auto& representation : representations) {
    if (!StatesLength(UnitsOf(representation->ContextOfItems()))) {
      without.push_back(representation);
    }
  }
  if (without.empty()) {
    if (!unit.empty() && !representations.empty()) {
      FailWithSecondLengthUnit(name, StatedLengthUnits(model));
    }
    return;
  }
  if (unit.empty()) FailWithoutLengthUnit(name);
  const NamedUnit stated = MakeUnit(LengthUnitNamed(unit).value());
  for (const auto& representation : without) {
    // A context that several share has got its unit by the first of them.
    if (!StatesLength(UnitsOf(representation->ContextOfItems()))) {
      StateUnit(representation, stated);
    }
  }
}

}  // namespace sightline
