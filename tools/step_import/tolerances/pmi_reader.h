// SPDX-License-Identifier: Apache-2.0
// Reads PMI entity by entity; what an entity says of others is indexed first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/tolerance/tolerance.h"
#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_values.h"
#include "tools/step_import/tolerances/step_pmi.h"

namespace sightline::step_pmi {

class PmiReader {
 public:
  explicit PmiReader(const Part21File& file) : file_(file) {}

  StepPmi Read();

 private:
  // Looking up an instance and parsing the shortest takes as long as so many bytes of it.
  static constexpr size_t kBytesOfLook = 16;

  // StepInputError, naming the entity, once all that was counted is more than kMostWork.
  void Count(int64_t id, size_t work) const;

  // Records of an instance.
  std::vector<Part21Record> Records(int64_t id) const;
  static const Values* Partial(const std::vector<Part21Record>& records, std::string_view type);

  // Attributes that a simple instance begins with and a complex one has in its record `type`.
  static Values Base(const std::vector<Part21Record>& records, std::string_view type);

  // Bookkeeping.
  template <typename Function>
  void ReadOne(int64_t id, const Function& read) {
    ++pmi_.report.entity_count;
    try {
      read();
    } catch (const Unreadable& unreadable) {
      pmi_.report.not_read.push_back({UnreadName(id), unreadable.reason});
    }
  }

  void Unread(int64_t id, const std::string& name, const std::string& reason);
  std::string TypeText(int64_t id) const;
  std::string UnreadName(int64_t id) const;
  std::string Standard() const;

  // Index the references between aspects, annotations, zones and dimensions: pmi_links.cpp.
  void IndexAspects();
  void IndexAnnotations();
  void IndexZones();
  void IndexDimensions();

  // First text of an entity: its name. Empty if it has none.
  std::string FirstText(int64_t id) const;

  // Name of a tolerance or dimension: its own or its annotation's.
  std::string OwnName(int64_t id) const;

  // Everything that the aspects, or what they consist of or are derived from, are identified with.
  PmiBinding Resolve(const std::vector<int64_t>& aspects) const;

  // Adds the aspect's own items, without those of its parts, in any order.
  void AddItems(int64_t aspect, std::vector<int64_t>& items) const;

  // An item may be a set of items.
  void Flatten(int64_t item, std::vector<int64_t>& items) const;

  std::vector<int64_t> DimensionedAspects(int64_t id) const;
  static void EachOnce(std::vector<int64_t>& items);

  // Measures: pmi_measures.cpp.
  struct Unit {
    double to_si = 1;
    bool angle = false;
  };
  Unit UnitOf(int64_t id, int depth) const;
  Measure MeasureOf(int64_t id, int depth = 0) const;
  double LengthOf(int64_t id) const;

  // Datums: pmi_datums.cpp.
  void ReadDatums();

  std::string DatumLetter(int64_t id) const;

  // "A", "C-D" with modifiers: "B(M)". `values`: of a datum, compartment, element or reference.
  std::string DatumText(const Part21Value& value, int depth) const;
  std::string DatumModifiers(const Part21Value& value) const;

  std::vector<std::string> DatumSystem(const Part21Value& list) const;

  // Geometric tolerances: pmi_geometric_tolerances.cpp.
  void ReadGeometricTolerance(int64_t id);
  void ReadModifiers(const std::vector<Part21Record>& records, Tolerance& tolerance) const;

  // Zones that are no plain band of one width.
  void ReadZone(int64_t zone, Tolerance& tolerance) const;

  // Dimensions: pmi_dimensions.cpp.
  void ReadDimension(int64_t id);
  void ReadValues(int64_t id, std::optional<Measure>& nominal, std::optional<Measure>& lower,
                  std::optional<Measure>& upper, std::vector<std::string>& notes) const;
  void ReadRange(int64_t range, const std::optional<Measure>& nominal,
                 std::optional<Measure>& lower, std::optional<Measure>& upper) const;
  std::string DimensionText(int64_t id, const Tolerance& tolerance,
                            const std::optional<Measure>& nominal,
                            const std::optional<Measure>& lower,
                            const std::optional<Measure>& upper) const;

  // Files without semantic PMI.
  void NoteGraphicAnnotations();

  const Part21File& file_;
  StepPmi pmi_;
  mutable size_t work_ = 0;  // of kMostWork
  int broken_links_ = 0;
  std::multimap<int64_t, int64_t> parts_, wholes_;  // aspect to its parts, and back
  std::multimap<int64_t, int64_t> items_;           // aspect to identified items
  std::map<int64_t, std::string> callout_names_;
  std::multimap<int64_t, std::string> zone_forms_;    // of a tolerance
  std::multimap<int64_t, int64_t> zones_;             // of a tolerance
  std::multimap<int64_t, int64_t> zone_definitions_;  // of a zone
  std::multimap<int64_t, int64_t> representations_;   // of a dimension
  std::multimap<int64_t, int64_t> ranges_;            // limits of a dimension
  std::map<int64_t, int64_t> stray_ranges_;
};

}  // namespace sightline::step_pmi
