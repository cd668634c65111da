// SPDX-License-Identifier: Apache-2.0
#include "planner_client/diagnosis_client/inspection_changes.h"

#include <algorithm>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "core/inspection/inspection.h"
#include "core/json/strict_json.h"

namespace sightline {

namespace fs = std::filesystem;

const google::protobuf::FieldDescriptor* Number::Descriptor() const {
  return message->GetDescriptor()->FindFieldByName(field);
}

double Number::Get() const {
  const auto* reflection = message->GetReflection();
  return reflection->HasField(*message, Descriptor())
             ? reflection->GetDouble(*message, Descriptor())
             : unset;
}

void Number::Set(double value) const {
  message->GetReflection()->SetDouble(message, Descriptor(), value);
}

void InspectionChanges::Change(const Number& number, const std::string& path, double to,
                               const std::string& source) {
  const double from = number.Get();
  const double cut = std::clamp(to, number.lower, number.upper);
  if (cut != to) {
    Warn(absl::StrCat(source, ": ", path, number.field, " would be ", NumberText(to),
                      ", which is out of its range; it is ", NumberText(cut)));
  }
  number.Set(cut);
  Note(absl::StrCat(path, number.field, " ", NumberText(from), " -> ", NumberText(cut), " (",
                    source, ")"));
}

void InspectionChanges::Scale(const Number& number, const std::string& path, double factor,
                              const std::string& source) {
  Change(number, path, number.Get() * factor, source);
}

void InspectionChanges::Shift(const Number& number, const std::string& path, double shift,
                              const std::string& source) {
  Change(number, path, number.Get() + shift, source);
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
