// SPDX-License-Identifier: Apache-2.0
// Indexes the references between aspects, annotations, zones and dimensions.
#include <algorithm>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "tools/step_import/tolerances/part21.h"
#include "tools/step_import/tolerances/pmi_reader.h"
#include "tools/step_import/tolerances/pmi_values.h"
#include "tools/step_import/tolerances/step_pmi.h"

namespace sightline::step_pmi {
namespace {

// Aspects that one tolerance leads to; a part has thousands of faces at most, a loop of references
// no end.
constexpr size_t kMaxAspects = 100'000;

}  // namespace

void PmiReader::IndexAspects() {
  const auto relates = [](std::string_view type) {
    return IsOneOf(type, {"SHAPE_ASPECT_RELATIONSHIP", "SHAPE_ASPECT_DERIVING_RELATIONSHIP",
                          "FEATURE_FOR_DATUM_TARGET_RELATIONSHIP", "SHAPE_ASPECT_ASSOCIATIVITY"});
  };
  for (const int64_t id : file_.Find(relates)) {
    // A dimension between two aspects is a relationship, but not one of whole and part.
    if (std::ranges::any_of(file_.Types(id), IsLocation)) continue;
    try {
      const Values values = Base(Records(id), "SHAPE_ASPECT_RELATIONSHIP");
      const int64_t from = ReferenceAt(values, 2, "relating aspect");
      const int64_t to = ReferenceAt(values, 3, "related aspect");
      parts_.emplace(from, to);
      wholes_.emplace(to, from);
    } catch (const Unreadable&) {
      ++broken_links_;
    }
  }
  const auto uses = [](std::string_view type) {
    return type == "GEOMETRIC_ITEM_SPECIFIC_USAGE" ||
           type == "ITEM_IDENTIFIED_REPRESENTATION_USAGE";
  };
  for (const int64_t id : file_.Find(uses)) {
    try {
      const Values values = Base(Records(id), "ITEM_IDENTIFIED_REPRESENTATION_USAGE");
      const int64_t aspect = ReferenceAt(values, 2, "definition");
      std::vector<int64_t> items;
      CollectReferences(At(values, 4, "item"), items);
      Count(id, kBytesOfLink * items.size());
      for (const int64_t item : items) items_.emplace(aspect, item);
    } catch (const Unreadable&) {
      ++broken_links_;
    }
  }
  if (broken_links_ > 0) {
    pmi_.report.notes.push_back(std::to_string(broken_links_) +
                                " links between tolerances and geometry are malformed");
  }
}

void PmiReader::IndexAnnotations() {
  const auto annotates = [](std::string_view type) {
    return type.starts_with("DRAUGHTING_MODEL_ITEM_ASSOCIATION");
  };
  for (const int64_t id : file_.Find(annotates)) {
    try {
      const std::vector<Part21Record> records = Records(id);
      const Values* base = Partial(records, "ITEM_IDENTIFIED_REPRESENTATION_USAGE");
      const Values& values = base != nullptr ? *base : records[0].values;
      std::vector<int64_t> callouts;
      CollectReferences(At(values, 4, "callout"), callouts);
      for (const int64_t callout : callouts) {
        const std::string name = FirstText(callout);
        if (!name.empty()) callout_names_.emplace(ReferenceAt(values, 2, "definition"), name);
      }
    } catch (const Unreadable&) {
      continue;  // names only
    }
  }
}

void PmiReader::IndexZones() {
  for (const int64_t id :
       file_.Find([](std::string_view type) { return type.ends_with("TOLERANCE_ZONE"); })) {
    try {
      const std::vector<Part21Record> records = Records(id);
      const bool simple = records.size() == 1;
      const Values values = Base(records, "TOLERANCE_ZONE");
      std::vector<int64_t> tolerances;
      CollectReferences(At(values, simple ? 4 : 0, "tolerance"), tolerances);
      const int64_t form = ReferenceAt(values, simple ? 5 : 1, "form");
      for (const int64_t tolerance : tolerances) {
        zone_forms_.emplace(tolerance, Lower(FirstText(form)));
        zones_.emplace(tolerance, id);
      }
    } catch (const Unreadable&) {
      pmi_.report.notes.push_back("tolerance zone " + Label(id) + " is malformed");
    }
  }
  const auto defines = [](std::string_view type) { return type.ends_with("_ZONE_DEFINITION"); };
  for (const int64_t id : file_.Find(defines)) {
    try {
      for (const Part21Record& record : Records(id)) {
        if (record.values.empty() || record.values[0].kind != Kind::kReference) continue;
        zone_definitions_.emplace(record.values[0].reference, id);
      }
    } catch (const Unreadable&) {
      pmi_.report.notes.push_back("zone definition " + Label(id) + " is malformed");
    }
  }
}

void PmiReader::IndexDimensions() {
  const auto shows = [](std::string_view type) {
    return type == "DIMENSIONAL_CHARACTERISTIC_REPRESENTATION";
  };
  for (const int64_t id : file_.Find(shows)) {
    try {
      const Values values = Base(Records(id), "DIMENSIONAL_CHARACTERISTIC_REPRESENTATION");
      representations_.emplace(ReferenceAt(values, 0, "dimension"),
                               ReferenceAt(values, 1, "representation"));
    } catch (const Unreadable&) {
      pmi_.report.notes.push_back("value " + Label(id) + " of a dimension is malformed");
    }
  }
  for (const int64_t id :
       file_.Find([](std::string_view type) { return type == "PLUS_MINUS_TOLERANCE"; })) {
    try {
      const Values values = Base(Records(id), "PLUS_MINUS_TOLERANCE");
      const int64_t dimension = ReferenceAt(values, 1, "dimension");
      const auto types = file_.Types(dimension);
      if (std::ranges::any_of(types, [](auto t) { return IsSize(t) || IsLocation(t); })) {
        ranges_.emplace(dimension, ReferenceAt(values, 0, "range"));
      } else {
        stray_ranges_.emplace(id, dimension);
      }
    } catch (const Unreadable&) {
      stray_ranges_.emplace(id, 0);
    }
  }
}

std::string PmiReader::FirstText(int64_t id) const {
  for (const Part21Record& record : Records(id)) {
    for (const Part21Value& value : record.values) {
      if (value.kind == Kind::kText && !value.text.empty()) return value.text;
      if (value.kind == Kind::kText && record.type != "REPRESENTATION_ITEM") break;
    }
  }
  return {};
}

std::string PmiReader::OwnName(int64_t id) const {
  std::string own;
  const auto types = file_.Types(id);
  if (std::ranges::any_of(types, IsSize)) {
    const std::vector<Part21Record> records = Records(id);
    const Values* base = Partial(records, "DIMENSIONAL_SIZE");
    // DIMENSIONAL_SIZE_WITH_DATUM_FEATURE has the four attributes of a shape aspect before.
    const Values& values = base != nullptr ? *base : records[0].values;
    const bool aspect_first = !values.empty() && values[0].kind == Kind::kText;
    own = TextAt(values, aspect_first ? 5 : 1);
  } else {
    own = FirstText(id);
  }
  const auto callout = callout_names_.find(id);
  if (callout == callout_names_.end() || callout->second == own) return own;
  return own.empty() ? callout->second : callout->second + " (" + own + ")";
}

PmiBinding PmiReader::Resolve(const std::vector<int64_t>& aspects) const {
  PmiBinding binding;
  std::set<int64_t> seen(aspects.begin(), aspects.end());
  std::vector<int64_t> open(seen.begin(), seen.end());
  while (!open.empty()) {
    const int64_t next = open.back();
    open.pop_back();
    Count(next, kBytesOfLink);
    if (file_.IsA(next, "PRODUCT_DEFINITION_SHAPE")) binding.whole_part = true;
    AddItems(next, binding.items);
    const auto follow = [&](int64_t to) {
      Count(next, kBytesOfLink);
      // A datum is what its feature establishes, not a part of it.
      if (file_.IsA(to, "DATUM") || seen.size() > kMaxAspects) return;
      if (seen.insert(to).second) open.push_back(to);
    };
    const auto [from, to] = parts_.equal_range(next);
    for (auto it = from; it != to; ++it) follow(it->second);
    // A tolerance may be stated of a dimension: it holds for what is dimensioned.
    if (std::ranges::any_of(file_.Types(next), [](auto t) { return IsSize(t) || IsLocation(t); })) {
      for (const int64_t dimensioned : DimensionedAspects(next)) follow(dimensioned);
    }
  }
  EachOnce(binding.items);
  return binding;
}

void PmiReader::AddItems(int64_t aspect, std::vector<int64_t>& items) const {
  const auto [first, last] = items_.equal_range(aspect);
  for (auto it = first; it != last; ++it) Flatten(it->second, items);
}

void PmiReader::Flatten(int64_t item, std::vector<int64_t>& items) const {
  if (file_.IsA(item, "COMPOUND_REPRESENTATION_ITEM")) {
    try {
      std::vector<int64_t> inner;
      for (const Part21Record& record : Records(item)) {
        for (const Part21Value& value : record.values) CollectReferences(value, inner);
      }
      Count(item, kBytesOfLink * inner.size());
      items.insert(items.end(), inner.begin(), inner.end());
      return;
    } catch (const Unreadable&) {
      // Kept as it is.
    }
  }
  Count(item, kBytesOfLink);
  items.push_back(item);
}

std::vector<int64_t> PmiReader::DimensionedAspects(int64_t id) const {
  std::vector<int64_t> aspects;
  try {
    const std::vector<Part21Record> records = Records(id);
    if (std::ranges::any_of(file_.Types(id), IsSize)) {
      const Values* base = Partial(records, "DIMENSIONAL_SIZE");
      const Values& values = base != nullptr ? *base : records[0].values;
      const bool aspect_first = !values.empty() && values[0].kind == Kind::kText;
      aspects.push_back(ReferenceAt(values, aspect_first ? 4 : 0, "aspect"));
    } else {
      const Values values = Base(records, "SHAPE_ASPECT_RELATIONSHIP");
      aspects.push_back(ReferenceAt(values, 2, "first aspect"));
      aspects.push_back(ReferenceAt(values, 3, "second aspect"));
    }
  } catch (const Unreadable&) {
    aspects.clear();
  }
  return aspects;
}

void PmiReader::EachOnce(std::vector<int64_t>& items) {
  std::sort(items.begin(), items.end());
  items.erase(std::unique(items.begin(), items.end()), items.end());
}

}  // namespace sightline::step_pmi
