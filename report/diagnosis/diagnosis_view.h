// SPDX-License-Identifier: Apache-2.0
// Common data of the sections of a diagnosis report: the diagnosis itself and its wording.
#pragma once

#include <set>
#include <string>

#include "sightline/v1/diagnosis.pb.h"

namespace sightline {

// Holds references: its sources must outlive it.
struct DiagnosisView {
  DiagnosisView(const v1::Diagnosis& of, const std::string& folder);

  // Null if the index names none.
  const v1::Recording* RecordingAt(int index) const;

  // Title of a recording, and its setup; the latter is empty if it is not known.
  std::string CaptionTitle(int index, const std::string& title_suffix = "") const;
  std::string CaptionSetup(int index) const;

  // Description of the model with the added effects.
  std::string ModelName() const;

  // The most probable model that `named_check` names; empty: the null model.
  std::string NamedModel() const;

  const v1::Diagnosis& diagnosis;
  const std::string& set_folder;  // holds the images; empty: none
  bool has_model = false;         // something was added to the nominal description
  bool of_part = false;           // recordings of a part, not of a plate
  std::set<int> held_out;         // recordings that no fit has used; empty if all were, in turn
};

}  // namespace sightline
