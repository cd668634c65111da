// SPDX-License-Identifier: Apache-2.0
// Decides if the text of a STEP file (ISO 10303-21, clear text encoding) states a length unit, by
// one pass over its bytes without OpenCASCADE and without keeping them.
//
// A file states the unit of its lengths by a GLOBAL_UNIT_ASSIGNED_CONTEXT that refers to an
// instance which is a LENGTH_UNIT, or an SI_UNIT of .METRE. The scan looks for such a pair. Its
// answer "no" is certain: sightline_step_import refuses each such file unless the unit is given.
// After the answer "perhaps" the importer decides, which reads whole instances.
//
// The answer that every shape of the file has a stated unit is certain too: then no unit may be
// given in addition.
//
//   StepLengthUnitScan scan;
//   while (more bytes) scan.Add(bytes);
//   if (!scan.IsStep()) refuse: this is another file;
//   if (scan.StatesNone()) refuse, or ask for the unit;
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace sightline {

class StepLengthUnitScan {
 public:
  // Takes the next bytes of the file.
  void Add(std::string_view bytes);
  // Whether a length unit has been found; the rest of the file then changes nothing.
  bool found() const { return found_; }
  // Whether "ISO-10303-21;" stands in the first 4096 bytes.
  bool IsStep() const { return head_.find("ISO-10303-21;") != std::string::npos; }
  // True if the whole text has instances and none of its contexts has a length unit. False also for
  // damaged text, whose damage must be reported first: it is no STEP file, has no end mark, ends
  // inside a string or comment, refers to an instance that it does not have, or has no instance.
  // False also for more than 100 000 instances of units or of their contexts, or numbers of
  // instances above 2^25.
  bool StatesNone() const;
  // Whether there are contexts of shapes, and every one has a length unit; those of curves in
  // parameter space have none. False as well for damaged text as above.
  bool StatesAll() const;

 private:
  enum class Inside { kText, kString, kBinary, kComment };

  void AddText(char c);
  void EndWord();
  void EndInstance();
  bool IsWhole() const;

  Inside inside_ = Inside::kText;
  char before_ = '\0';  // the character before, for the marks of comments
  // Words and references of the instance that is being read.
  std::string word_;
  bool in_reference_ = false;
  int64_t reference_ = 0;
  std::vector<int64_t> references_;
  bool has_length_ = false, is_context_ = false;
  bool is_shape_context_ = false, is_parametric_ = false;
  // Units of length and instances that the file has had so far.
  std::set<int64_t> lengths_, assigned_;
  bool found_ = false, has_instance_ = false, too_many_ = false;
  // References of the contexts of shapes that have no length unit so far; a unit may follow.
  std::vector<std::vector<int64_t>> open_contexts_;
  bool has_shape_context_ = false;
  std::string head_;  // the beginning of the file
  bool has_end_mark_ = false;
  std::vector<bool> instances_, referred_to_;  // by number of the instance
};

}  // namespace sightline
