// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/inspection_changes.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"
#include "core/text/number_text.h"

namespace sightline {

namespace fs = std::filesystem;

namespace {

// Relative difference of wavelengths that count as one.
constexpr double kSameWavelength = 1e-3;
// Deviation from 1 that a factor of reflected light may have without a warning.
constexpr double kFactorTolerance = 0.05;

bool SameSpectrum(const v1::SourceSpectrum& a, const v1::SourceSpectrum& b) {
  if (a.has_line() && b.has_line()) {
    return std::abs(a.line().wavelength_m() - b.line().wavelength_m()) <=
           kSameWavelength * std::abs(b.line().wavelength_m());
  }
  return !b.illuminant().empty() && a.illuminant() == b.illuminant();
}

// Empty: nothing that people need to know.
std::string TextOfReason(const v1::InspectionChange& change) {
  switch (change.reason()) {
    case v1::InspectionChange::REASON_RECORDING_SET_UP:
      return absl::StrCat(change.source(), kOfSetUp);
    case v1::InspectionChange::REASON_FLAT_PLATE:
      if (!change.parameter().empty()) {
        return absl::StrCat(change.source(), ": its ", change.parameter(), " of ",
                            NumberText(change.value()), " cannot be said for a part: left out");
      }
      return absl::StrCat(change.source(),
                          ": acts on a flat plate only, an inspection cannot say it: left out");
    case v1::InspectionChange::REASON_STATED_MATERIALS:
      if (std::abs(change.value() - 1) <= kFactorTolerance) return "";
      return absl::StrCat(change.source(), ": there is ", NumberText(change.value()),
                          " times the light that the materials lead to expect; this factor is left "
                          "out, their reflectance may be wrong");
    default:
      return absl::StrCat(change.source(), ": an inspection cannot say it: left out");
  }
}

// The spectrum of the light whose radiance the number is; nullptr if it has none.
v1::SourceSpectrum* SpectrumBeside(const InspectionNumber& radiance) {
  const auto* field = radiance.message->GetDescriptor()->FindFieldByName("spectrum");
  if (field == nullptr || field->is_repeated() ||
      field->message_type() != v1::SourceSpectrum::descriptor()) {
    return nullptr;
  }
  return static_cast<v1::SourceSpectrum*>(
      radiance.message->GetReflection()->MutableMessage(radiance.message, field));
}

}  // namespace

void InspectionChanges::Change(const InspectionNumber& number, double to,
                               const std::string& source) {
  const double from = number.Get();
  const double cut = std::clamp(to, number.range->lower, number.range->upper);
  if (cut != to) {
    Warn(absl::StrCat(source, ": ", number.path, " would be ", NumberText(to),
                      ", which is out of its range; it is ", NumberText(cut)));
  }
  number.Set(cut);
  Note(
      absl::StrCat(number.path, " ", NumberText(from), " -> ", NumberText(cut), " (", source, ")"));
}

void InspectionChanges::Scale(const std::string& path, double factor, const std::string& source) {
  v1::InspectionChange change;
  change.set_source(source);
  change.set_field(path);
  change.set_operation(v1::InspectionChange::OPERATION_FACTOR);
  change.set_value(factor);
  (void)Apply(change);
}

void InspectionChanges::Shift(const std::string& path, double summand, const std::string& source) {
  v1::InspectionChange change;
  change.set_source(source);
  change.set_field(path);
  change.set_operation(v1::InspectionChange::OPERATION_SHIFT);
  change.set_value(summand);
  (void)Apply(change);
}

InspectionChanges::Outcome InspectionChanges::ApplyToNumber(const InspectionNumber& number,
                                                            const v1::InspectionChange& change) {
  if (!number.IsStated() && !number.range->unset) {
    if (change.effect_instead()) return Outcome::kKeepEffect;
    if (!number.range->meaning_of_unset.empty()) {
      Warn(absl::StrCat(change.source(), ": ", number.path, " is not given (",
                        std::string(number.range->meaning_of_unset), "): left as it is"));
    }
    return Outcome::kDone;
  }
  double to = change.value();
  switch (change.operation()) {
    case v1::InspectionChange::OPERATION_FACTOR:
      // One of several colours often stays as it is.
      if (change.value() == 1 && !number.range->unset) return Outcome::kDone;
      to = number.Get() * change.value();
      break;
    case v1::InspectionChange::OPERATION_SHIFT:
      to = number.Get() + change.value();
      break;
    case v1::InspectionChange::OPERATION_INSTEAD_OF_ZERO:
      if (number.Get() != 0) return Outcome::kDone;
      break;
    default:
      break;
  }
  if (change.effect_instead() && !(to >= number.range->lower && to <= number.range->upper)) {
    return Outcome::kKeepEffect;
  }
  if (change.has_spectrum()) {
    v1::SourceSpectrum* spectrum = SpectrumBeside(number);
    if (spectrum == nullptr) return Outcome::kKeepEffect;
    if (number.Get() > 0 && !SameSpectrum(*spectrum, change.spectrum())) {
      Warn(absl::StrCat(change.source(), ": ", number.path.substr(0, number.path.rfind('.')),
                        " is given with another spectrum: left as it is"));
      return Outcome::kStop;
    }
    *spectrum = change.spectrum();
  }
  if (number.field->cpp_type() == google::protobuf::FieldDescriptor::CPPTYPE_BOOL) {
    number.Set(to);
    Note(absl::StrCat(number.path, to != 0 ? " true (" : " false (", change.source(), ")"));
  } else {
    Change(number, to, change.source());
  }
  return Outcome::kDone;
}

InspectionChanges::Outcome InspectionChanges::Apply(const v1::InspectionChange& change) {
  if (change.field().empty() && change.reason() != v1::InspectionChange::REASON_UNSPECIFIED) {
    const std::string text = TextOfReason(change);
    if (!text.empty()) Warn(text);
    return Outcome::kDone;
  }
  if (change.field() == "effects") return Outcome::kKeepEffect;
  const NumberRange* range = FindNumberRange(change.field());
  const bool known = v1::InspectionChange::Operation_IsValid(change.operation()) &&
                     change.operation() != v1::InspectionChange::OPERATION_UNSPECIFIED;
  if (range == nullptr || !known) {
    Warn(absl::StrCat(change.source(), ": the change of \"", change.field(),
                      "\" is not known to this version of the program: the effect is kept as one "
                      "of the inspection's effects"));
    return Outcome::kKeepEffect;
  }
  for (const InspectionNumber& number : NumbersAt(*range, plate_materials_, &result_.inspection)) {
    const Outcome outcome = ApplyToNumber(number, change);
    if (outcome != Outcome::kDone) return outcome;
  }
  return Outcome::kDone;
}

void InspectionChanges::Carry(const v1::Effect& effect,
                              const std::vector<v1::InspectionChange>& changes) {
  if (changes.empty()) {
    Warn(absl::StrCat(effect.effect(),
                      ": the render worker does not say how an inspection expresses it: the effect "
                      "is kept as one of the inspection's effects"));
    AddEffect(effect);
    return;
  }
  for (const v1::InspectionChange& change : changes) {
    const Outcome outcome = Apply(change);
    if (outcome == Outcome::kKeepEffect) AddEffect(effect);
    if (outcome != Outcome::kDone) return;
  }
}

std::vector<v1::InspectionChange> ChangesOf(const v1::Effect& effect,
                                            const v1::Diagnosis& diagnosis) {
  std::vector<v1::InspectionChange> changes;
  for (const v1::InspectionChange& change : diagnosis.inspection_changes()) {
    if (change.source() == effect.effect()) changes.push_back(change);
  }
  return changes;
}

void InspectionChanges::AddEffect(const v1::Effect& effect) {
  auto* effects = result_.inspection.mutable_effects();
  const auto same = std::find_if(effects->begin(), effects->end(), [&](const v1::Effect& e) {
    return e.effect() == effect.effect();
  });
  if (same == effects->end()) {
    *effects->Add() = effect;
  } else {
    Warn(absl::StrCat(effect.effect(),
                      ": stood in the inspection before; the fitted one takes its place"));
    *same = effect;
  }
  Note(absl::StrCat("effects: ", effect.effect()));
}

void NameFilesFrom(const std::string& folder, v1::Inspection* inspection) {
  const fs::path base = fs::absolute(folder).lexically_normal();
  const auto relative = [&base](const std::string& file) {
    return fs::proximate(fs::absolute(file).lexically_normal(), base).string();
  };
  if (!inspection->part().file().empty()) {
    inspection->mutable_part()->set_file(relative(inspection->part().file()));
  }
  for (v1::Obstacle& obstacle : *inspection->mutable_obstacles()) {
    obstacle.set_file(relative(obstacle.file()));
  }
  for (v1::MaterialAssignment& assignment : *inspection->mutable_materials()) {
    for (std::string* file : MutableMaterialFiles(assignment.mutable_material())) {
      *file = relative(*file);
    }
  }
}

}  // namespace sightline
