// SPDX-License-Identifier: Apache-2.0
// Geometric tolerances with their zones and modifiers.
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_reader.h"
#include "tools/step_import/tolerances/pmi_values.h"
#include "tools/step_import/tolerances/step_pmi.h"

namespace sightline::step_pmi {
namespace {

constexpr std::array<std::pair<std::string_view, ToleranceKind>, 15> kGeometricTolerances = {{
    {"FLATNESS_TOLERANCE", ToleranceKind::kFlatness},
    {"STRAIGHTNESS_TOLERANCE", ToleranceKind::kStraightness},
    {"ROUNDNESS_TOLERANCE", ToleranceKind::kRoundness},
    {"CYLINDRICITY_TOLERANCE", ToleranceKind::kCylindricity},
    {"SURFACE_PROFILE_TOLERANCE", ToleranceKind::kSurfaceProfile},
    {"LINE_PROFILE_TOLERANCE", ToleranceKind::kLineProfile},
    {"POSITION_TOLERANCE", ToleranceKind::kPosition},
    {"PARALLELISM_TOLERANCE", ToleranceKind::kParallelism},
    {"PERPENDICULARITY_TOLERANCE", ToleranceKind::kPerpendicularity},
    {"ANGULARITY_TOLERANCE", ToleranceKind::kAngularity},
    {"CONCENTRICITY_TOLERANCE", ToleranceKind::kConcentricity},
    {"COAXIALITY_TOLERANCE", ToleranceKind::kCoaxiality},
    {"SYMMETRY_TOLERANCE", ToleranceKind::kSymmetry},
    {"CIRCULAR_RUNOUT_TOLERANCE", ToleranceKind::kCircularRunout},
    {"TOTAL_RUNOUT_TOLERANCE", ToleranceKind::kTotalRunout},
}};

}  // namespace

void PmiReader::ReadGeometricTolerance(int64_t id) {
  const std::vector<Part21Record> records = Records(id);
  Tolerance tolerance;
  tolerance.id = Label(id);
  bool known = false;
  for (const Part21Record& record : records) {
    for (const auto& [type, kind] : kGeometricTolerances) {
      if (record.type != type) continue;
      tolerance.kind = kind;
      known = true;
    }
  }
  if (!known) throw Unreadable{"the kind of tolerance " + TypeText(id) + " is unknown"};
  const Values base = Base(records, "GEOMETRIC_TOLERANCE");
  tolerance.name = OwnName(id);
  // First, so that what it binds counts even where it turns out that it cannot be read: OpenCASCADE
  // binds it all the same.
  PmiBinding binding;
  if (base.size() > 3 && base[3].kind == Kind::kReference) binding = Resolve({base[3].reference});
  const std::string kind_name(ToleranceKindName(tolerance.kind));
  if (tolerance.name.empty()) tolerance.name = kind_name;

  const auto [first_zone, last_zone] = zones_.equal_range(id);
  for (auto it = first_zone; it != last_zone; ++it) ReadZone(it->second, tolerance);
  tolerance.zone_width_m = LengthOf(ReferenceAt(base, 2, "magnitude"));
  if (!(tolerance.zone_width_m > 0)) {
    throw Unreadable{"its zone width is " + Millimetres(tolerance.zone_width_m) +
                     " mm (0 is meant to grow with the departure from maximum material)"};
  }
  if (base.size() <= 3 || base[3].kind != Kind::kReference) {
    throw Unreadable{"its toleranced aspect is not given"};
  }

  if (records.size() == 1 && base.size() > 4) {
    if (base[4].kind == Kind::kList) tolerance.datums = DatumSystem(base[4]);
    if (base[4].kind == Kind::kEnum) tolerance.modifiers.push_back(Lower(base[4].text));
  }
  if (const Values* datums = Partial(records, "GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE")) {
    tolerance.datums = DatumSystem(At(*datums, 0, "datum"));
  }
  if (records.size() > 1) ReadModifiers(records, tolerance);

  const auto [first, last] = zone_forms_.equal_range(id);
  for (auto it = first; it != last; ++it) {
    const std::string& form = it->second;
    if (form.find("cylind") != std::string::npos || form.find("circ") != std::string::npos ||
        form.find("spher") != std::string::npos) {
      tolerance.diameter_zone = true;
    }
    if (form.find("spher") != std::string::npos) tolerance.modifiers.push_back("spherical zone");
  }
  tolerance.text = kind_name + (tolerance.diameter_zone ? " diameter " : " ") +
                   Millimetres(tolerance.zone_width_m) + " mm";
  for (const std::string& modifier : tolerance.modifiers) tolerance.text += " " + modifier;
  for (const std::string& datum : tolerance.datums) tolerance.text += " | " + datum;
  pmi_.report.read.push_back(std::move(tolerance));
  pmi_.read.push_back(std::move(binding));
}

void PmiReader::ReadModifiers(const std::vector<Part21Record>& records,
                              Tolerance& tolerance) const {
  if (const Values* list = Partial(records, "GEOMETRIC_TOLERANCE_WITH_MODIFIERS")) {
    for (const Part21Value& value : At(*list, 0, "modifier").list) {
      tolerance.modifiers.push_back(Lower(value.text));
    }
  }
  if (const Values* value = Partial(records, "MODIFIED_GEOMETRIC_TOLERANCE")) {
    tolerance.modifiers.push_back(Lower(At(*value, 0, "modifier").text));
  }
  if (const Values* value = Partial(records, "GEOMETRIC_TOLERANCE_WITH_MAXIMUM_TOLERANCE")) {
    tolerance.modifiers.push_back("at most " +
                                  Millimetres(LengthOf(ReferenceAt(*value, 0, "maximum"))) + " mm");
  }
  if (const Values* value = Partial(records, "UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE")) {
    tolerance.modifiers.push_back("unequally disposed by " +
                                  Millimetres(LengthOf(ReferenceAt(*value, 0, "displacement"))) +
                                  " mm");
  }
  if (const Values* value = Partial(records, "GEOMETRIC_TOLERANCE_WITH_DEFINED_UNIT")) {
    std::string text = "per " + Millimetres(LengthOf(ReferenceAt(*value, 0, "unit")));
    if (const Values* area = Partial(records, "GEOMETRIC_TOLERANCE_WITH_DEFINED_AREA_UNIT")) {
      const bool second = area->size() > 1 && (*area)[1].kind == Kind::kReference;
      const std::string shape = Lower(At(*area, 0, "shape of area").text);
      text += second ? " x " + Millimetres(LengthOf((*area)[1].reference)) + " mm" : " mm";
      if (shape != "rectangular") text += " " + shape;
    } else {
      text += " mm";
    }
    tolerance.modifiers.push_back(text);
  }
}

void PmiReader::ReadZone(int64_t zone, Tolerance& tolerance) const {
  const auto [first, last] = zone_definitions_.equal_range(zone);
  for (auto it = first; it != last; ++it) {
    Count(it->second, kBytesOfLink);
    if (file_.IsA(it->second, "NON_UNIFORM_ZONE_DEFINITION")) {
      throw Unreadable{"its zone is not of one width"};
    }
    if (file_.IsA(it->second, "PROJECTED_ZONE_DEFINITION")) {
      const std::vector<Part21Record> records = Records(it->second);
      const Values& values = records[0].values;
      std::string length;
      if (values.size() > 3 && values[3].kind == Kind::kReference) {
        length = " by " + Millimetres(LengthOf(values[3].reference)) + " mm";
      }
      tolerance.modifiers.push_back("projected zone" + length);
    }
  }
}

}  // namespace sightline::step_pmi
