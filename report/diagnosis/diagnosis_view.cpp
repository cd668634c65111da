// SPDX-License-Identifier: Apache-2.0
#include "report/diagnosis/diagnosis_view.h"

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "report/diagnosis/diagnosis_text.h"
#include "report/page/number_text.h"
#include "report/recordings/recording_text.h"

namespace sightline {

DiagnosisView::DiagnosisView(const v1::Diagnosis& of, const std::string& folder)
    : diagnosis(of), set_folder(folder) {
  const std::string first = diagnosis.ranked().empty() ? "" : diagnosis.ranked(0).effect();
  has_model = diagnosis.ranked().empty() ? diagnosis.verdict() == "effect" : first != "none";
  for (const int32_t recording : diagnosis.held_out_improvement().recordings())
    held_out.insert(recording);
  for (const v1::ModelFit* fit : {&diagnosis.null_fit(), &diagnosis.model_fit()}) {
    for (const v1::RecordingFit& recording : fit->recordings()) {
      if (recording.held_out()) held_out.insert(recording.recording());
    }
  }
  // For parts, tiles of every recording are held out, but no whole recording. For plates, each
  // recording is held out once.
  of_part = diagnosis.calibrated().format_version() == 2;
  if (of_part || static_cast<int>(held_out.size()) >= diagnosis.model_fit().recordings_size()) {
    held_out.clear();
  }
}

const v1::Recording* DiagnosisView::RecordingAt(int index) const {
  return index >= 0 && index < diagnosis.calibrated().recordings_size()
             ? &diagnosis.calibrated().recordings(index)
             : nullptr;
}

std::string DiagnosisView::CaptionTitle(int index, const std::string& title_suffix) const {
  return absl::StrCat(RecordingTitle(index, RecordingAt(index)), title_suffix,
                      held_out.count(index) > 0 ? ", not used in fitting" : "");
}

std::string DiagnosisView::CaptionSetup(int index) const {
  const v1::Recording* recording = RecordingAt(index);
  return recording == nullptr ? "" : RecordingSetup(*recording);
}

std::string DiagnosisView::ModelName() const {
  if (diagnosis.ranked().empty() || diagnosis.ranked(0).effect() == "unknown")
    return "with the missing term";
  return absl::StrCat("with ", ExplanationTitle(diagnosis.ranked(0)));
}

std::string DiagnosisView::NamedModel() const {
  if (!diagnosis.part_of_it().empty()) {
    std::vector<std::string> names;
    for (const v1::FittedEffect& effect : diagnosis.part_of_it()) {
      names.push_back(EffectTitle(effect.effect()));
    }
    return absl::StrJoin(names, " + ");
  }
  for (const v1::Explanation& explanation : diagnosis.ranked()) {
    if (explanation.effect() == "none") return "";
    if (explanation.effect() != "unknown" && !explanation.effects().empty())
      return ExplanationTitle(explanation);
  }
  return "";
}

}  // namespace sightline
