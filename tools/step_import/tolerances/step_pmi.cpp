#include "tools/step_import/tolerances/step_pmi.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>

#include "tools/step_import/step_input_error.h"

namespace sightline {
namespace {

using Kind = Part21Value::Kind;
using Values = std::vector<Part21Value>;

// Aspects that one tolerance leads to; a part has thousands of faces at most, a loop of references
// no end.
constexpr size_t kMaxAspects = 100'000;
constexpr int kMaxUnitDepth = 8;

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

bool IsOneOf(std::string_view type, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), type) != names.end();
}

bool IsGeometricTolerance(std::string_view type) {
  if (type == "GEOMETRIC_TOLERANCE" || type == "MODIFIED_GEOMETRIC_TOLERANCE" ||
      type.starts_with("GEOMETRIC_TOLERANCE_WITH_") ||
      type == "UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE") {
    return true;
  }
  // Kinds that are unknown here count too, so that they are listed.
  return type.ends_with("_TOLERANCE") && type != "PLUS_MINUS_TOLERANCE";
}

bool IsSize(std::string_view type) {
  return type.starts_with("DIMENSIONAL_SIZE") || type == "ANGULAR_SIZE";
}

bool IsLocation(std::string_view type) {
  return type.starts_with("DIMENSIONAL_LOCATION") || type == "ANGULAR_LOCATION" ||
         type == "DIRECTED_DIMENSIONAL_LOCATION";
}

bool IsDatumTarget(std::string_view type) {
  return type == "DATUM_TARGET" || type == "PLACED_DATUM_TARGET_FEATURE";
}

std::string Lower(std::string_view text) {
  std::string out(text);
  for (char& c : out) {
    c = c == '_' ? ' ' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  }
  return out;
}

std::string Label(int64_t id) { return "#" + std::to_string(id); }

std::string Millimetres(double metres) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", metres * 1e3);
  return text.data();
}

std::string Degrees(double radians) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", radians * 180 / std::numbers::pi);
  return text.data();
}

// A reason why an entity is not read.
struct Unreadable {
  std::string reason;
};

const Part21Value& At(const Values& values, size_t i, const char* what) {
  if (i >= values.size()) throw Unreadable{std::string("it has no ") + what};
  return values[i];
}

std::string TextAt(const Values& values, size_t i) {
  return i < values.size() && values[i].kind == Kind::kText ? values[i].text : std::string();
}

int64_t ReferenceAt(const Values& values, size_t i, const char* what) {
  const Part21Value& value = At(values, i, what);
  if (value.kind != Kind::kReference)
    throw Unreadable{std::string("its ") + what + " is not given"};
  return value.reference;
}

// All references in a value, through lists and typed values.
void CollectReferences(const Part21Value& value, std::vector<int64_t>& out) {
  if (value.kind == Kind::kReference) out.push_back(value.reference);
  for (const Part21Value& inner : value.list) CollectReferences(inner, out);
}

struct Measure {
  double value = 0;  // [m] or [rad]
  bool angle = false;
  std::string name;  // of the representation item
};

class PmiReader {
 public:
  explicit PmiReader(const Part21File& file) : file_(file) {}

  StepPmi Read() {
    pmi_.report.standard = Standard();
    IndexAspects();
    IndexAnnotations();
    IndexZones();
    IndexDimensions();
    ReadDatums();
    for (const int64_t id : file_.Find(IsGeometricTolerance)) {
      ReadOne(id, [&] { ReadGeometricTolerance(id); });
    }
    for (const int64_t id : file_.Find([](auto t) { return IsSize(t) || IsLocation(t); })) {
      ReadOne(id, [&] { ReadDimension(id); });
    }
    for (const auto& [id, dimension] : stray_ranges_) {
      Unread(id, "", "it belongs to no dimension that is in the file");
    }
    ToleranceReport& report = pmi_.report;
    if (report.entity_count == 0) NoteGraphicAnnotations();
    const auto targets = std::ranges::count_if(report.datums, &Datum::target);
    if (targets > 0) {
      report.notes.push_back(std::to_string(targets) +
                             " datum targets: their places and sizes are not read");
    }
    return std::move(pmi_);
  }

 private:
  // --- Records ------------------------------------------------------------------------------

  std::vector<Part21Record> Records(int64_t id) const {
    try {
      return file_.Records(id);
    } catch (const StepInputError& error) {
      throw Unreadable{error.what()};
    }
  }

  static const Values* Partial(const std::vector<Part21Record>& records, std::string_view type) {
    for (const Part21Record& record : records) {
      if (record.type == type) return &record.values;
    }
    return nullptr;
  }

  // Attributes that a simple instance begins with and a complex one has in its record `type`.
  static Values Base(const std::vector<Part21Record>& records, std::string_view type) {
    if (records.size() == 1) return records[0].values;
    const Values* values = Partial(records, type);
    if (values == nullptr) throw Unreadable{"it has no record " + std::string(type)};
    return *values;
  }

  // --- Bookkeeping --------------------------------------------------------------------------

  template <typename Function>
  void ReadOne(int64_t id, const Function& read) {
    ++pmi_.report.entity_count;
    try {
      read();
    } catch (const Unreadable& unreadable) {
      pmi_.report.not_read.push_back({UnreadName(id), unreadable.reason});
    }
  }

  void Unread(int64_t id, const std::string& name, const std::string& reason) {
    ++pmi_.report.entity_count;
    pmi_.report.not_read.push_back({name.empty() ? UnreadName(id) : name, reason});
  }

  std::string TypeText(int64_t id) const {
    std::string text;
    for (const std::string_view type : file_.Types(id)) {
      if (!text.empty()) text += "+";
      text += type;
    }
    return text;
  }

  std::string UnreadName(int64_t id) const {
    std::string name;
    try {
      name = OwnName(id);
    } catch (const Unreadable&) {
      // Nameless then.
    }
    return (name.empty() ? "" : name + " ") + "(" + Label(id) + " " + TypeText(id) + ")";
  }

  std::string Standard() const {
    const std::string schema = file_.schema();
    if (schema.starts_with("AP242")) return "AP242";
    if (schema.starts_with("AUTOMOTIVE_DESIGN")) return "AP214";
    if (schema.starts_with("CONFIG_CONTROL") || schema.starts_with("AP203")) return "AP203";
    return schema.empty() ? "STEP" : "STEP " + schema.substr(0, 40);
  }

  // --- What aspects, annotations, zones and dimensions say of one another ---------------------

  void IndexAspects() {
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

  void IndexAnnotations() {
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

  void IndexZones() {
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

  void IndexDimensions() {
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

  // First text of an entity: its name. Empty if it has none.
  std::string FirstText(int64_t id) const {
    for (const Part21Record& record : Records(id)) {
      for (const Part21Value& value : record.values) {
        if (value.kind == Kind::kText && !value.text.empty()) return value.text;
        if (value.kind == Kind::kText && record.type != "REPRESENTATION_ITEM") break;
      }
    }
    return {};
  }

  // Name of a tolerance or dimension: its own or its annotation's.
  std::string OwnName(int64_t id) const {
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

  // Everything that the aspect, or what it consists of or is derived from, is identified with.
  PmiBinding Resolve(int64_t aspect) const {
    PmiBinding binding;
    std::set<int64_t> items, seen = {aspect};
    std::vector<int64_t> open = {aspect};
    while (!open.empty()) {
      const int64_t next = open.back();
      open.pop_back();
      if (file_.IsA(next, "PRODUCT_DEFINITION_SHAPE")) binding.whole_part = true;
      const auto [first, last] = items_.equal_range(next);
      for (auto it = first; it != last; ++it) Flatten(it->second, items);
      const auto follow = [&](int64_t to) {
        // A datum is what its feature establishes, not a part of it.
        if (file_.IsA(to, "DATUM") || seen.size() > kMaxAspects) return;
        if (seen.insert(to).second) open.push_back(to);
      };
      const auto [from, to] = parts_.equal_range(next);
      for (auto it = from; it != to; ++it) follow(it->second);
      // A tolerance may be stated of a dimension: it holds for what is dimensioned.
      if (std::ranges::any_of(file_.Types(next),
                              [](auto t) { return IsSize(t) || IsLocation(t); })) {
        for (const int64_t dimensioned : DimensionedAspects(next)) follow(dimensioned);
      }
    }
    binding.items.assign(items.begin(), items.end());
    return binding;
  }

  // An item may be a set of items.
  void Flatten(int64_t item, std::set<int64_t>& items) const {
    if (file_.IsA(item, "COMPOUND_REPRESENTATION_ITEM")) {
      try {
        std::vector<int64_t> inner;
        for (const Part21Record& record : Records(item)) {
          for (const Part21Value& value : record.values) CollectReferences(value, inner);
        }
        items.insert(inner.begin(), inner.end());
        return;
      } catch (const Unreadable&) {
        // Kept as it is.
      }
    }
    items.insert(item);
  }

  std::vector<int64_t> DimensionedAspects(int64_t id) const {
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

  static void Merge(const PmiBinding& from, PmiBinding& into) {
    std::set<int64_t> all(into.items.begin(), into.items.end());
    all.insert(from.items.begin(), from.items.end());
    into.items.assign(all.begin(), all.end());
    into.whole_part = into.whole_part || from.whole_part;
  }

  // --- Measures -----------------------------------------------------------------------------

  struct Unit {
    double to_si = 1;
    bool angle = false;
  };

  Unit UnitOf(int64_t id, int depth) const {
    if (depth > kMaxUnitDepth) throw Unreadable{"its unit refers to itself"};
    const std::vector<Part21Record> records = Records(id);
    if (const Values* conversion = Partial(records, "CONVERSION_BASED_UNIT")) {
      const int64_t factor = ReferenceAt(*conversion, records.size() == 1 ? 2 : 1, "factor");
      const Measure measure = MeasureOf(factor, depth + 1);
      return {measure.value, measure.angle};
    }
    const Values* si = Partial(records, "SI_UNIT");
    if (si == nullptr || si->size() < 2) throw Unreadable{"its unit " + Label(id) + " is unknown"};
    const Part21Value& prefix = (*si)[si->size() - 2];
    const std::string& name = si->back().text;
    Unit unit;
    if (prefix.kind == Kind::kEnum) {
      constexpr std::array<std::pair<std::string_view, double>, 10> kPrefixes = {{{"KILO", 1e3},
                                                                                  {"HECTO", 1e2},
                                                                                  {"DECA", 1e1},
                                                                                  {"DECI", 1e-1},
                                                                                  {"CENTI", 1e-2},
                                                                                  {"MILLI", 1e-3},
                                                                                  {"MICRO", 1e-6},
                                                                                  {"NANO", 1e-9},
                                                                                  {"PICO", 1e-12},
                                                                                  {"MEGA", 1e6}}};
      const auto found = std::ranges::find(kPrefixes, std::string_view(prefix.text),
                                           [](const auto& entry) { return entry.first; });
      if (found == kPrefixes.end()) throw Unreadable{"its unit has prefix " + prefix.text};
      unit.to_si = found->second;
    }
    if (name == "RADIAN") {
      unit.angle = true;
    } else if (name != "METRE") {
      throw Unreadable{"its unit is " + Lower(name) + ", neither a length nor an angle"};
    }
    return unit;
  }

  Measure MeasureOf(int64_t id, int depth = 0) const {
    const std::vector<Part21Record> records = Records(id);
    const Values* values = Partial(records, "MEASURE_WITH_UNIT");
    if (values == nullptr) values = &records[0].values;
    Measure measure;
    for (const Part21Record& record : records) {
      // Its name stands in a record of its own or comes first.
      if ((record.type == "REPRESENTATION_ITEM" || records.size() == 1) &&
          !TextAt(record.values, 0).empty()) {
        measure.name = Lower(TextAt(record.values, 0));
      }
    }
    std::optional<double> number;
    std::optional<int64_t> unit;
    for (const Part21Value& value : *values) {
      const bool typed = value.kind == Kind::kTyped && value.list.size() == 1 &&
                         value.list[0].kind == Kind::kNumber;
      if (!number && typed) number = value.list[0].number;
      if (!number && value.kind == Kind::kNumber) number = value.number;
      if (!unit && value.kind == Kind::kReference) unit = value.reference;
    }
    if (!number) throw Unreadable{"its value " + Label(id) + " is no number"};
    if (!unit) throw Unreadable{"its value " + Label(id) + " has no unit"};
    const Unit of = UnitOf(*unit, depth);
    measure.value = *number * of.to_si;
    measure.angle = of.angle;
    if (!std::isfinite(measure.value)) throw Unreadable{"its value is not finite"};
    return measure;
  }

  double LengthOf(int64_t id) const {
    const Measure measure = MeasureOf(id);
    if (measure.angle) throw Unreadable{"its value is an angle where a length is meant"};
    return measure.value;
  }

  // --- Datums -------------------------------------------------------------------------------

  void ReadDatums() {
    std::set<int64_t> established;  // features of datums
    for (const int64_t id : file_.Find([](std::string_view t) { return t == "DATUM"; })) {
      ReadOne(id, [&] {
        Datum datum;
        datum.id = Label(id);
        datum.letter = DatumLetter(id);
        PmiBinding binding;
        const auto [first, last] = wholes_.equal_range(id);
        for (auto it = first; it != last; ++it) {
          established.insert(it->second);
          if (std::ranges::any_of(file_.Types(it->second), IsDatumTarget)) continue;
          Merge(Resolve(it->second), binding);
        }
        // Some programs identify the datum itself with the faces.
        Merge(Resolve(id), binding);
        pmi_.report.datums.push_back(std::move(datum));
        pmi_.datums.push_back(std::move(binding));
      });
    }
    for (const int64_t id : file_.Find(IsDatumTarget)) {
      ReadOne(id, [&] {
        const std::vector<Part21Record> records = Records(id);
        const Values* base = Partial(records, "DATUM_TARGET");
        std::string number =
            base != nullptr && records.size() > 1 ? TextAt(*base, 0) : TextAt(records[0].values, 4);
        std::string letter;
        const auto [first, last] = parts_.equal_range(id);
        for (auto it = first; it != last; ++it) {
          if (file_.IsA(it->second, "DATUM")) letter = DatumLetter(it->second);
        }
        Datum datum;
        datum.id = Label(id);
        datum.letter = letter + number;
        datum.target = true;
        PmiBinding binding = Resolve(id);
        // The feature on which it lies refers to it.
        const auto [from, to] = wholes_.equal_range(id);
        for (auto it = from; it != to; ++it) Merge(ResolveOnly(it->second), binding);
        pmi_.report.datums.push_back(std::move(datum));
        pmi_.datums.push_back(std::move(binding));
      });
    }
    for (const int64_t id : file_.Find([](std::string_view t) { return t == "DATUM_FEATURE"; })) {
      if (established.contains(id)) continue;
      const auto [first, last] = parts_.equal_range(id);
      const bool leads_to_datum = std::any_of(
          first, last, [&](const auto& part) { return file_.IsA(part.second, "DATUM"); });
      if (!leads_to_datum) Unread(id, "", "a datum feature that no datum refers to");
    }
  }

  // The aspect's own items, without those of its parts.
  PmiBinding ResolveOnly(int64_t aspect) const {
    std::set<int64_t> items;
    const auto [first, last] = items_.equal_range(aspect);
    for (auto it = first; it != last; ++it) Flatten(it->second, items);
    PmiBinding binding;
    binding.items.assign(items.begin(), items.end());
    return binding;
  }

  std::string DatumLetter(int64_t id) const {
    const std::vector<Part21Record> records = Records(id);
    const std::string letter =
        records.size() == 1 ? TextAt(records[0].values, 4) : TextAt(Base(records, "DATUM"), 0);
    if (letter.empty()) throw Unreadable{"the datum " + Label(id) + " has no letter"};
    return letter;
  }

  // "A", "C-D" with modifiers: "B(M)". `values`: of a datum, compartment, element or reference.
  std::string DatumText(const Part21Value& value, int depth) const {
    if (depth > kMaxUnitDepth) throw Unreadable{"its datum system refers to itself"};
    if (value.kind == Kind::kList || value.kind == Kind::kTyped) {
      std::string text;
      for (const Part21Value& inner : value.list) {
        const std::string part = DatumText(inner, depth + 1);
        text += (text.empty() || part.empty() ? "" : "-") + part;
      }
      return text;
    }
    if (value.kind != Kind::kReference) return {};
    const int64_t id = value.reference;
    if (file_.IsA(id, "DATUM")) return DatumLetter(id);
    const std::vector<Part21Record> records = Records(id);
    const std::string& type = records[0].type;
    if (records.size() == 1 &&
        IsOneOf(type, {"DATUM_REFERENCE_COMPARTMENT", "DATUM_REFERENCE_ELEMENT"})) {
      const Values& values = records[0].values;
      return DatumText(At(values, 4, "datum"), depth + 1) +
             (values.size() > 5 ? DatumModifiers(values[5]) : "");
    }
    if (const Values* general = Partial(records, "GENERAL_DATUM_REFERENCE")) {
      return DatumText(At(*general, 0, "datum"), depth + 1) +
             (general->size() > 1 ? DatumModifiers((*general)[1]) : "");
    }
    if (type == "DATUM_REFERENCE" || type == "REFERENCED_MODIFIED_DATUM") {
      const Values& values = records[0].values;
      return DatumText(At(values, 1, "datum"), depth + 1) +
             (values.size() > 2 ? DatumModifiers(values[2]) : "");
    }
    throw Unreadable{"its datum system has " + Label(id) + " " + TypeText(id) +
                     ", which is unknown"};
  }

  std::string DatumModifiers(const Part21Value& value) const {
    std::string text;
    if (value.kind == Kind::kEnum) {
      if (value.text.starts_with("MAXIMUM_MATERIAL")) return "(M)";
      if (value.text.starts_with("LEAST_MATERIAL")) return "(L)";
      if (value.text == "REGARDLESS_OF_FEATURE_SIZE") return "";
      return "[" + Lower(value.text) + "]";
    }
    if (value.kind == Kind::kReference) {
      for (const Part21Record& record : Records(value.reference)) {
        for (const Part21Value& inner : record.values) {
          if (inner.kind == Kind::kEnum) text += DatumModifiers(inner);
          if (inner.kind == Kind::kReference) {
            text += "[" + Millimetres(LengthOf(inner.reference)) + " mm]";
          }
        }
      }
    }
    for (const Part21Value& inner : value.list) text += DatumModifiers(inner);
    return text;
  }

  std::vector<std::string> DatumSystem(const Part21Value& list) const {
    std::vector<int64_t> references;
    CollectReferences(list, references);
    std::vector<std::pair<double, std::string>> ordered;
    for (const int64_t id : references) {
      if (file_.IsA(id, "DATUM_SYSTEM")) {
        const std::vector<Part21Record> records = Records(id);
        const Values values = Base(records, "DATUM_SYSTEM");
        for (const Part21Value& part :
             At(values, records.size() == 1 ? 4 : 0, "compartment").list) {
          ordered.emplace_back(0, DatumText(part, 0));
        }
        continue;
      }
      Part21Value value;
      value.kind = Kind::kReference;
      value.reference = id;
      double precedence = 0;
      const std::vector<Part21Record> records = Records(id);
      if (records[0].type == "DATUM_REFERENCE" || records[0].type == "REFERENCED_MODIFIED_DATUM") {
        const Part21Value& first = At(records[0].values, 0, "precedence");
        if (first.kind == Kind::kNumber) precedence = first.number;
      }
      ordered.emplace_back(precedence, DatumText(value, 0));
    }
    std::stable_sort(ordered.begin(), ordered.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<std::string> datums;
    for (auto& [precedence, text] : ordered) datums.push_back(std::move(text));
    return datums;
  }

  // --- Geometric tolerances -----------------------------------------------------------------

  void ReadGeometricTolerance(int64_t id) {
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
    const std::string kind_name(ToleranceKindName(tolerance.kind));
    if (tolerance.name.empty()) tolerance.name = kind_name;

    const auto [first_zone, last_zone] = zones_.equal_range(id);
    for (auto it = first_zone; it != last_zone; ++it) ReadZone(it->second, tolerance);
    tolerance.zone_width_m = LengthOf(ReferenceAt(base, 2, "magnitude"));
    if (!(tolerance.zone_width_m > 0)) {
      throw Unreadable{"its zone width is " + Millimetres(tolerance.zone_width_m) +
                       " mm (0 is meant to grow with the departure from maximum material)"};
    }
    const PmiBinding binding = Resolve(ReferenceAt(base, 3, "toleranced aspect"));

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
    pmi_.read.push_back(binding);
  }

  void ReadModifiers(const std::vector<Part21Record>& records, Tolerance& tolerance) const {
    if (const Values* list = Partial(records, "GEOMETRIC_TOLERANCE_WITH_MODIFIERS")) {
      for (const Part21Value& value : At(*list, 0, "modifier").list) {
        tolerance.modifiers.push_back(Lower(value.text));
      }
    }
    if (const Values* value = Partial(records, "MODIFIED_GEOMETRIC_TOLERANCE")) {
      tolerance.modifiers.push_back(Lower(At(*value, 0, "modifier").text));
    }
    if (const Values* value = Partial(records, "GEOMETRIC_TOLERANCE_WITH_MAXIMUM_TOLERANCE")) {
      tolerance.modifiers.push_back(
          "at most " + Millimetres(LengthOf(ReferenceAt(*value, 0, "maximum"))) + " mm");
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

  // Zones that are no plain band of one width.
  void ReadZone(int64_t zone, Tolerance& tolerance) const {
    const auto [first, last] = zone_definitions_.equal_range(zone);
    for (auto it = first; it != last; ++it) {
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

  // --- Dimensions ---------------------------------------------------------------------------

  void ReadDimension(int64_t id) {
    const std::vector<std::string_view> types = file_.Types(id);
    const bool size = std::ranges::any_of(types, IsSize);
    Tolerance tolerance;
    tolerance.id = Label(id);
    const std::string own = OwnName(id);
    PmiBinding binding;
    const std::vector<int64_t> aspects = DimensionedAspects(id);
    if (aspects.empty()) throw Unreadable{"it does not say what it dimensions"};
    for (const int64_t aspect : aspects) Merge(Resolve(aspect), binding);

    std::optional<Measure> nominal, lower, upper;
    std::vector<std::string> notes;
    ReadValues(id, nominal, lower, upper, notes);
    const auto [first, last] = ranges_.equal_range(id);
    if (std::distance(first, last) > 1) throw Unreadable{"it has more than one pair of limits"};
    if (first != last) ReadRange(first->second, nominal, lower, upper);

    const std::optional<Measure>& any = nominal ? nominal : lower ? lower : upper;
    if (!any) throw Unreadable{"the file gives no value for it"};
    const bool angle = any->angle;
    for (const auto& measure : {nominal, lower, upper}) {
      if (measure && measure->angle != angle) {
        throw Unreadable{"its values mix lengths and angles"};
      }
    }
    tolerance.kind =
        size ? (angle ? ToleranceKind::kAngularSize : ToleranceKind::kLinearSize)
             : (angle ? ToleranceKind::kAngularDistance : ToleranceKind::kLinearDistance);
    tolerance.name = own.empty() ? std::string(ToleranceKindName(tolerance.kind)) : own;
    const auto value = [](const std::optional<Measure>& measure) {
      return measure ? std::optional<double>(measure->value) : std::nullopt;
    };
    (angle ? tolerance.nominal_rad : tolerance.nominal_m) = value(nominal);
    (angle ? tolerance.lower_rad : tolerance.lower_m) = value(lower);
    (angle ? tolerance.upper_rad : tolerance.upper_m) = value(upper);
    tolerance.modifiers = notes;
    tolerance.text = DimensionText(id, tolerance, nominal, lower, upper);

    if (!lower || !upper) {
      if (lower || upper) {
        throw Unreadable{"it has one limit only (" + tolerance.text + "): no zone"};
      }
      pmi_.report.untoleranced.push_back(std::move(tolerance));
      pmi_.untoleranced.push_back(binding);
      return;
    }
    const double width = upper->value - lower->value;
    if (!(width > 0)) {
      throw Unreadable{"its lower limit is not below its upper one (" + tolerance.text + ")"};
    }
    (angle ? tolerance.zone_width_rad : tolerance.zone_width_m) = width;
    pmi_.report.read.push_back(std::move(tolerance));
    pmi_.read.push_back(binding);
  }

  void ReadValues(int64_t id, std::optional<Measure>& nominal, std::optional<Measure>& lower,
                  std::optional<Measure>& upper, std::vector<std::string>& notes) const {
    const auto [first, last] = representations_.equal_range(id);
    for (auto it = first; it != last; ++it) {
      const Values values = Base(Records(it->second), "REPRESENTATION");
      std::vector<int64_t> items;
      CollectReferences(At(values, 1, "item"), items);
      for (const int64_t item : items) {
        if (file_.IsA(item, "DESCRIPTIVE_REPRESENTATION_ITEM")) {
          const Values text = Base(Records(item), "DESCRIPTIVE_REPRESENTATION_ITEM");
          if (!TextAt(text, 1).empty()) notes.push_back(TextAt(text, 1));
          continue;
        }
        const auto types = file_.Types(item);
        const bool measure_like = std::ranges::any_of(types, [](std::string_view type) {
          return type.find("MEASURE") != std::string_view::npos;
        });
        if (!measure_like) continue;  // decimal places, placements
        const Measure measure = MeasureOf(item);
        const bool low = measure.name.find("lower") != std::string::npos;
        const bool high = measure.name.find("upper") != std::string::npos;
        std::optional<Measure>& slot = low ? lower : high ? upper : nominal;
        // The same value may be given in several units.
        if (slot && std::abs(slot->value - measure.value) > 1e-3 * std::abs(slot->value)) {
          throw Unreadable{"it has two values that differ, " + std::to_string(slot->value) +
                           " and " + std::to_string(measure.value) + " (SI)"};
        }
        if (!slot) slot = measure;
      }
    }
  }

  void ReadRange(int64_t range, const std::optional<Measure>& nominal,
                 std::optional<Measure>& lower, std::optional<Measure>& upper) const {
    if (file_.IsA(range, "LIMITS_AND_FITS")) {
      const Values values = Base(Records(range), "LIMITS_AND_FITS");
      throw Unreadable{"its limits are the tolerance class " + TextAt(values, 0) +
                       TextAt(values, 2) + " (" + TextAt(values, 3) +
                       "), whose table is not built in; give its zone width by hand"};
    }
    if (!file_.IsA(range, "TOLERANCE_VALUE")) {
      throw Unreadable{"its limits are " + Label(range) + " " + TypeText(range) +
                       ", which is unknown"};
    }
    const Values values = Base(Records(range), "TOLERANCE_VALUE");
    const Measure low = MeasureOf(ReferenceAt(values, 0, "lower deviation"));
    const Measure high = MeasureOf(ReferenceAt(values, 1, "upper deviation"));
    if (low.angle != high.angle) throw Unreadable{"its deviations mix lengths and angles"};
    // Deviations from the nominal value, with their signs.
    lower = low;
    upper = high;
    if (!nominal) throw Unreadable{"it has deviations but no nominal value"};
    lower->value += nominal->value;
    upper->value += nominal->value;
  }

  std::string DimensionText(int64_t id, const Tolerance& tolerance,
                            const std::optional<Measure>& nominal,
                            const std::optional<Measure>& lower,
                            const std::optional<Measure>& upper) const {
    const bool angle = IsAngular(tolerance.kind);
    const auto number = [&](double value) { return angle ? Degrees(value) : Millimetres(value); };
    std::string own;
    if (std::ranges::any_of(file_.Types(id), IsSize)) {
      const std::vector<Part21Record> records = Records(id);
      const Values* base = Partial(records, "DIMENSIONAL_SIZE");
      const Values& values = base != nullptr ? *base : records[0].values;
      const bool aspect_first = !values.empty() && values[0].kind == Kind::kText;
      own = TextAt(values, aspect_first ? 5 : 1);
    } else {
      own = FirstText(id);
    }
    std::string text = own.empty() ? std::string(ToleranceKindName(tolerance.kind)) : own;
    if (nominal) text += " " + number(nominal->value);
    if (nominal && lower && upper) {
      const double down = lower->value - nominal->value, up = upper->value - nominal->value;
      if (std::abs(up + down) <= 1e-9 * std::abs(up - down)) {
        text += " +-" + number(up);
      } else {
        text += " " + std::string(up < 0 ? "" : "+") + number(up) + "/" + (down > 0 ? "+" : "") +
                number(down);
      }
    } else if (lower && upper) {
      text += " " + number(lower->value) + " to " + number(upper->value);
    } else if (lower || upper) {
      text += lower ? " least " + number(lower->value) : " at most " + number(upper->value);
    }
    text += angle ? " deg" : " mm";
    for (const std::string& modifier : tolerance.modifiers) text += ", " + modifier;
    return text;
  }

  // --- Nothing semantic ---------------------------------------------------------------------

  void NoteGraphicAnnotations() {
    const auto graphic = [](std::string_view type) {
      return type == "DRAUGHTING_CALLOUT" || type.ends_with("ANNOTATION_OCCURRENCE");
    };
    const size_t count = file_.Find(graphic).size();
    if (count == 0) return;
    pmi_.report.notes.push_back(
        std::to_string(count) +
        " annotations are in the file as graphics only, without values that could be read; export "
        "it with semantic PMI (AP242)");
  }

  const Part21File& file_;
  StepPmi pmi_;
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

}  // namespace

StepPmi ReadStepPmi(const Part21File& file) { return PmiReader(file).Read(); }

}  // namespace sightline
