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
#include <StepData_StepModel.hxx>
#include <StepGeom_GeomRepContextAndGlobUnitAssCtxAndGlobUncertaintyAssCtx.hxx>
#include <StepGeom_GeometricRepresentationContextAndGlobalUnitAssignedContext.hxx>
#include <StepRepr_GlobalUnitAssignedContext.hxx>
#include <TCollection_HAsciiString.hxx>
#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <set>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "core/text/length_unit.h"
#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

using NamedUnit = Handle(StepBasic_NamedUnit);
using UnitContext = Handle(StepRepr_GlobalUnitAssignedContext);

// --- The units as the file writes them -----------------------------------------------------------

constexpr int kMaxUnitChain = 8;
// Two ways to write a factor may differ by so much, relatively: the US survey foot, which some call
// FOOT, is 2e-6 longer than the foot.
constexpr double kUnitNameRounding = 1e-4;
constexpr double kUnitFactorRounding = 1e-9;

struct NamedFactor {
  std::string_view name;
  double factor;
};

// si_prefix of ISO 10303-41.
constexpr std::array<NamedFactor, 16> kSiPrefixes = {{{"EXA", 1e18},
                                                      {"PETA", 1e15},
                                                      {"TERA", 1e12},
                                                      {"GIGA", 1e9},
                                                      {"MEGA", 1e6},
                                                      {"KILO", 1e3},
                                                      {"HECTO", 1e2},
                                                      {"DECA", 1e1},
                                                      {"DECI", 1e-1},
                                                      {"CENTI", 1e-2},
                                                      {"MILLI", 1e-3},
                                                      {"MICRO", 1e-6},
                                                      {"NANO", 1e-9},
                                                      {"PICO", 1e-12},
                                                      {"FEMTO", 1e-15},
                                                      {"ATTO", 1e-18}}};

// Metres of units that files name and core/text/length_unit.h does not know, in lower case.
constexpr std::array<NamedFactor, 12> kMoreUnitNames = {{{"kilometre", 1e3},
                                                         {"kilometer", 1e3},
                                                         {"decimetre", 0.1},
                                                         {"decimeter", 0.1},
                                                         {"foot", 0.3048},
                                                         {"feet", 0.3048},
                                                         {"ft", 0.3048},
                                                         {"yard", 0.9144},
                                                         {"yd", 0.9144},
                                                         {"mile", 1609.344},
                                                         {"mil", 25.4e-6},
                                                         {"thou", 25.4e-6}}};

[[noreturn]] void FailAtUnit(const Part21File& file, int64_t id, const std::string& reason) {
  throw StepInputError(absl::StrCat(file.name(), ": #", id, ": ", reason));
}

const Part21Record* RecordOfType(const std::vector<Part21Record>& records, std::string_view type) {
  const auto found = std::ranges::find(records, type, &Part21Record::type);
  return found == records.end() ? nullptr : &*found;
}

// A value as it is written, as far as a reader of the message needs it.
std::string AsWritten(const Part21Value& value) {
  switch (value.kind) {
    case Part21Value::Kind::kUnset:
      return "$";
    case Part21Value::Kind::kDerived:
      return "*";
    case Part21Value::Kind::kEnum:
      return "." + value.text + ".";
    case Part21Value::Kind::kText:
      return "'" + value.text + "'";
    default:
      return "no enumeration value";
  }
}

struct UnitFactor {
  std::string name;  // in lower case
  double metres = 0;
};

// Prefix and name are the last two values, both of the partial record of a complex instance and of
// a simple one, which has the dimensions before them.
UnitFactor SiUnitFactor(const Part21File& file, int64_t id, const Part21Record& si) {
  if (si.values.size() < 2) FailAtUnit(file, id, "SI_UNIT lacks its prefix or its name");
  const Part21Value& name = si.values.back();
  const Part21Value& prefix = si.values[si.values.size() - 2];
  if (name.kind != Part21Value::Kind::kEnum || name.text != "METRE") {
    FailAtUnit(file, id,
               "SI_UNIT has the name " + AsWritten(name) + ", must be .METRE. for a length");
  }
  if (prefix.kind == Part21Value::Kind::kUnset) return {"metre", 1};
  const auto* const known = std::ranges::find(kSiPrefixes, prefix.text, &NamedFactor::name);
  if (prefix.kind != Part21Value::Kind::kEnum || known == kSiPrefixes.end()) {
    FailAtUnit(file, id,
               "SI_UNIT has the prefix " + AsWritten(prefix) +
                   ", must be $ or a prefix of the SI, such as .MILLI.");
  }
  return {absl::AsciiStrToLower(prefix.text) + "metre", known->factor};
}

std::optional<double> MetresOfUnitName(const std::string& lower_name) {
  const auto* const more = std::ranges::find(kMoreUnitNames, lower_name, &NamedFactor::name);
  if (more != kMoreUnitNames.end()) return more->factor;
  return MetresPerUnit(lower_name);
}

// `depth`: how many conversions lead to it.
UnitFactor FactorOfUnit(const Part21File& file, int64_t id, int depth);

UnitFactor ConvertedUnitFactor(const Part21File& file, int64_t id, const Part21Record& conversion,
                               int depth) {
  using Kind = Part21Value::Kind;
  const auto& values = conversion.values;
  if (values.size() < 2 || values[values.size() - 2].kind != Kind::kText ||
      values.back().kind != Kind::kReference) {
    FailAtUnit(file, id, "CONVERSION_BASED_UNIT lacks its name or its conversion factor");
  }
  const std::string name(absl::StripAsciiWhitespace(values[values.size() - 2].text));
  const int64_t measure_id = values.back().reference;
  const std::vector<Part21Record> measure = file.Records(measure_id);
  const auto with_unit = std::ranges::find_if(
      measure, [](const Part21Record& record) { return record.values.size() == 2; });
  if (with_unit == measure.end() || with_unit->values[1].kind != Kind::kReference) {
    FailAtUnit(file, measure_id, "the factor of unit " + name + " is no measure with a unit");
  }
  const Part21Value* value = &with_unit->values[0];
  if (value->kind == Kind::kTyped && value->list.size() == 1) value = &value->list[0];
  if (value->kind != Kind::kNumber) {
    FailAtUnit(file, measure_id, "the factor of unit " + name + " is no number");
  }
  const double factor = value->number;
  if (!(factor > 0) || !std::isfinite(factor)) {
    FailAtUnit(
        file, measure_id,
        absl::StrCat("the factor of unit ", name, " is ", factor, ", must be a finite number > 0"));
  }
  const double metres =
      factor * FactorOfUnit(file, with_unit->values[1].reference, depth + 1).metres;
  if (!(metres > 0) || !std::isfinite(metres)) {
    FailAtUnit(file, id, "the factor of unit " + name + " is beyond the range of numbers");
  }
  const std::string lower_name = absl::AsciiStrToLower(name);
  const std::optional<double> known = MetresOfUnitName(lower_name);
  if (known && std::abs(metres / *known - 1) > kUnitNameRounding) {
    FailAtUnit(file, id,
               absl::StrCat("the factor of unit ", name, " contradicts its name: it makes ", name,
                            " ", 1e3 * metres, " mm, must be ", 1e3 * *known, " mm"));
  }
  return {lower_name, metres};
}

UnitFactor FactorOfUnit(const Part21File& file, int64_t id, int depth) {
  if (depth > kMaxUnitChain) {
    FailAtUnit(file, id,
               absl::StrCat("a unit is defined by more than ", kMaxUnitChain,
                            " conversions, one of another"));
  }
  const std::vector<Part21Record> records = file.Records(id);
  if (const Part21Record* si = RecordOfType(records, "SI_UNIT"); si != nullptr) {
    return SiUnitFactor(file, id, *si);
  }
  if (const Part21Record* conversion = RecordOfType(records, "CONVERSION_BASED_UNIT");
      conversion != nullptr) {
    return ConvertedUnitFactor(file, id, *conversion, depth);
  }
  std::string name;
  if (const Part21Record* named = RecordOfType(records, "CONTEXT_DEPENDENT_UNIT");
      named != nullptr && !named->values.empty()) {
    name = named->values.back().text + " ";
  }
  FailAtUnit(file, id,
             "unit " + name + "is not read: it is neither SI_UNIT nor CONVERSION_BASED_UNIT");
}

// A metre is one even if the file leaves out the word LENGTH_UNIT.
bool IsLengthUnit(const Part21File& file, int64_t id) {
  if (file.IsA(id, "LENGTH_UNIT")) return true;
  if (!file.IsA(id, "SI_UNIT") || file.IsA(id, "AREA_UNIT") || file.IsA(id, "VOLUME_UNIT")) {
    return false;
  }
  const std::vector<Part21Record> records = file.Records(id);
  const Part21Record* si = RecordOfType(records, "SI_UNIT");
  return si != nullptr && !si->values.empty() && si->values.back().text == "METRE";
}

// --- The units as OpenCASCADE has them -----------------------------------------------------------

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

// OpenCASCADE's own factor, 0 if it finds no length unit.
double LengthFactorOf(const UnitContext& units) {
  if (units.IsNull() || units->Units().IsNull()) return 0;
  STEPConstruct_UnitContext factors;
  factors.ComputeFactors(units);
  return factors.LengthDone() ? factors.LengthFactor() : 0;
}

// Whether OpenCASCADE finds a length unit in it, which it then applies.
bool StatesLength(const UnitContext& units) { return LengthFactorOf(units) > 0; }

NamedUnit SiLength(bool has_prefix, StepBasic_SiPrefix prefix) {
  Handle(StepBasic_SiUnitAndLengthUnit) unit = new StepBasic_SiUnitAndLengthUnit;
  unit->Init(has_prefix, prefix, StepBasic_sunMetre);
  return unit;
}

NamedUnit ConvertedUnit(const std::string& name, double millimetres) {
  StepBasic_Unit millimetre;
  millimetre.SetValue(SiLength(true, StepBasic_spMilli));
  Handle(StepBasic_MeasureValueMember) value = new StepBasic_MeasureValueMember;
  value->SetName("LENGTH_MEASURE");
  value->SetReal(millimetres);
  Handle(StepBasic_LengthMeasureWithUnit) measure = new StepBasic_LengthMeasureWithUnit;
  measure->Init(value, millimetre);
  Handle(StepBasic_DimensionalExponents) length = new StepBasic_DimensionalExponents;
  length->Init(1, 0, 0, 0, 0, 0, 0);
  Handle(StepBasic_ConversionBasedUnitAndLengthUnit) converted =
      new StepBasic_ConversionBasedUnitAndLengthUnit;
  converted->Init(length, new TCollection_HAsciiString(name.c_str()), measure);
  return converted;
}

// `unit`: a name of LengthUnitNamed.
NamedUnit MakeUnit(const std::string& unit) {
  if (unit == "m") return SiLength(false, StepBasic_spMilli);
  if (unit == "cm") return SiLength(true, StepBasic_spCenti);
  if (unit == "mm") return SiLength(true, StepBasic_spMilli);
  if (unit == "um") return SiLength(true, StepBasic_spMicro);
  return ConvertedUnit(unit, MillimetresPer(unit));
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

// The units without those instances of the file; null if none is left.
Handle(StepBasic_HArray1OfNamedUnit)
    Without(const Handle(StepBasic_HArray1OfNamedUnit) & units, const std::vector<int64_t>& ids,
            const Handle(StepData_StepModel) & model) {
  Handle(StepBasic_HArray1OfNamedUnit) others;
  if (units.IsNull()) return others;
  for (int i = units->Lower(); i <= units->Upper(); ++i) {
    const NamedUnit unit = units->Value(i);
    if (unit.IsNull() || std::ranges::count(ids, model->IdentLabel(unit)) > 0) continue;
    others = With(others, unit);
  }
  return others;
}

// Makes OpenCASCADE take the unit that the file states: it passes over conversions of conversions.
void ApplyStatedUnit(const Part21File& file, const ContextLengthUnit& stated,
                     const Handle(StepData_StepModel) & model,
                     const Handle(StepRepr_Representation) & representation) {
  const UnitContext metre = new StepRepr_GlobalUnitAssignedContext;
  metre->SetUnits(With({}, SiLength(false, StepBasic_spMilli)));
  const double one_metre = LengthFactorOf(metre);
  const auto agrees = [&] {
    const double factor = LengthFactorOf(UnitsOf(representation->ContextOfItems()));
    return std::abs(factor / one_metre / stated.metres - 1) < kUnitFactorRounding;
  };
  if (agrees()) return;
  if (const UnitContext units = UnitsOf(representation->ContextOfItems()); !units.IsNull()) {
    units->SetUnits(Without(units->Units(), stated.ids, model));
  }
  StateUnit(representation, ConvertedUnit(stated.name, 1e3 * stated.metres));
  if (!agrees()) {
    FailAtUnit(file, stated.ids.front(), "unit " + stated.name + " is not read by OpenCASCADE");
  }
}

}  // namespace

std::optional<ContextLengthUnit> LengthUnitOfContext(const Part21File& file, int64_t context) {
  std::optional<ContextLengthUnit> stated;
  for (const Part21Record& record : file.Records(context)) {
    if (record.type != "GLOBAL_UNIT_ASSIGNED_CONTEXT" || record.values.empty()) continue;
    for (const Part21Value& value : record.values.back().list) {
      if (value.kind != Part21Value::Kind::kReference) continue;
      const int64_t id = value.reference;
      if (!file.Has(id)) FailAtUnit(file, context, absl::StrCat("its unit #", id, " is missing"));
      if (!IsLengthUnit(file, id)) continue;
      const UnitFactor unit = FactorOfUnit(file, id, 0);
      if (!stated) {
        stated = ContextLengthUnit{unit.name, unit.metres, {id}};
        continue;
      }
      if (std::abs(unit.metres / stated->metres - 1) > kUnitFactorRounding) {
        FailAtUnit(file, context,
                   absl::StrCat("GLOBAL_UNIT_ASSIGNED_CONTEXT states two length units, ",
                                stated->name, " (#", stated->ids.front(), ") and ", unit.name,
                                " (#", id, "), must state one"));
      }
      stated->ids.push_back(id);
    }
  }
  return stated;
}

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
  throw StepInputError(
      name +
      ": part.unit is missing: the file states no length unit; state it in "
      "the inspection (--unit of `sightline part` and `sightline new`): m, cm, mm, "
      "um or inch");
}

void FailWithSecondLengthUnit(const std::string& name, const std::string& stated) {
  throw StepInputError(name + ": unit is given, must be left out: the file says its unit itself (" +
                       stated + ")");
}

void SettleLengthUnit(const Part21File& file, const std::string& unit,
                      const Handle(Interface_InterfaceModel) & model,
                      const std::vector<Handle(StepRepr_Representation)>& representations) {
  const std::string& name = file.name();
  if (!unit.empty() && MillimetresPer(unit) == 0) {
    throw StepInputError(name + ": unit is \"" + unit + "\", must be m, cm, mm, um or inch");
  }
  // Also those that OpenCASCADE does not translate, such as the contexts of tessellated bodies.
  for (const int64_t id : file.Find(
           [](std::string_view type) { return type == "GEOMETRIC_REPRESENTATION_CONTEXT"; })) {
    LengthUnitOfContext(file, id);
  }
  const auto entities = Handle(StepData_StepModel)::DownCast(model);
  std::vector<Handle(StepRepr_Representation)> without;
  for (const auto& representation : representations) {
    const Handle(StepRepr_RepresentationContext) context = representation->ContextOfItems();
    const int64_t id = context.IsNull() ? 0 : entities->IdentLabel(context);
    const auto stated = file.Has(id) ? LengthUnitOfContext(file, id) : std::nullopt;
    if (stated) {
      ApplyStatedUnit(file, *stated, entities, representation);
    } else if (!StatesLength(UnitsOf(context))) {
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
