// SPDX-License-Identifier: Apache-2.0
#include "core/tolerance/qif/qif_reader.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"
#include "core/tolerance/qif/qif_features.h"
#include "core/tolerance/qif/qif_units.h"
#include "core/tolerance/qif/qif_xml.h"

namespace sightline {
namespace {

// Names of characteristics: those of the definition's element without "CharacteristicDefinition".
struct CharacteristicName {
  const char* qif;
  ToleranceKind kind;
  const char* modifier;
};

constexpr std::array<CharacteristicName, 17> kGeometric = {{
    {"Flatness", ToleranceKind::kFlatness, ""},
    {"Straightness", ToleranceKind::kStraightness, ""},
    {"Circularity", ToleranceKind::kRoundness, ""},
    {"Sphericity", ToleranceKind::kRoundness, "of a sphere"},
    {"Cylindricity", ToleranceKind::kCylindricity, ""},
    {"SurfaceProfile", ToleranceKind::kSurfaceProfile, ""},
    {"PointProfile", ToleranceKind::kSurfaceProfile, "at a point"},
    {"LineProfile", ToleranceKind::kLineProfile, ""},
    {"Position", ToleranceKind::kPosition, ""},
    {"Parallelism", ToleranceKind::kParallelism, ""},
    {"Perpendicularity", ToleranceKind::kPerpendicularity, ""},
    {"Angularity", ToleranceKind::kAngularity, ""},
    {"Concentricity", ToleranceKind::kConcentricity, ""},
    {"Coaxiality", ToleranceKind::kCoaxiality, ""},
    {"Symmetry", ToleranceKind::kSymmetry, ""},
    {"CircularRunout", ToleranceKind::kCircularRunout, ""},
    {"TotalRunout", ToleranceKind::kTotalRunout, ""},
}};

constexpr std::array<CharacteristicName, 18> kDimensional = {{
    {"Diameter", ToleranceKind::kLinearSize, "diameter"},
    {"SphericalDiameter", ToleranceKind::kLinearSize, "spherical diameter"},
    {"Radius", ToleranceKind::kLinearSize, "radius"},
    {"SphericalRadius", ToleranceKind::kLinearSize, "spherical radius"},
    {"Length", ToleranceKind::kLinearSize, "length"},
    {"Width", ToleranceKind::kLinearSize, "width"},
    {"Height", ToleranceKind::kLinearSize, "height"},
    {"Depth", ToleranceKind::kLinearSize, "depth"},
    {"Thickness", ToleranceKind::kLinearSize, "thickness"},
    {"Chord", ToleranceKind::kLinearSize, "chord"},
    {"CurveLength", ToleranceKind::kLinearSize, "curve length"},
    {"DistanceBetween", ToleranceKind::kLinearDistance, "distance"},
    {"DistanceFrom", ToleranceKind::kLinearDistance, "distance"},
    {"LinearCoordinate", ToleranceKind::kLinearDistance, "coordinate"},
    {"Angle", ToleranceKind::kAngularSize, "angle"},
    {"AngleBetween", ToleranceKind::kAngularDistance, "angle"},
    {"AngleFrom", ToleranceKind::kAngularDistance, "angle"},
    {"AngularCoordinate", ToleranceKind::kAngularDistance, "angular coordinate"},
}};

constexpr std::array<const char*, 7> kKept = {"FileUnits",
                                              "DatumDefinitions",
                                              "DatumTargetDefinitions",
                                              "DatumReferenceFrames",
                                              "Features",
                                              "Characteristics",
                                              "Product"};

constexpr const char* kDefinition = "CharacteristicDefinition";

// Elements may refer to the same others as often as they like, so that a short file could ask for
// any amount of text. Elements looked at and bytes of text together: about a second and 100 MB.
constexpr size_t kMostWork = 100'000'000;
// Entities of a feature that its description names.
constexpr size_t kEntitiesNamed = 16;

std::string Number(double value) {
  std::array<char, 32> text;
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return text.data();
}

std::string Signed(double value) { return (value > 0 ? "+" : "") + Number(value); }

// "OppositeParallelPlanes" -> "opposite parallel planes".
std::string Words(const std::string& name) {
  std::string out;
  for (const char c : name) {
    if (absl::ascii_isupper(static_cast<unsigned char>(c)) && !out.empty()) out += ' ';
    out += absl::ascii_tolower(static_cast<unsigned char>(c));
  }
  return out;
}

std::string Id(const QifElement& element) {
  const auto found = element.attributes.find("id");
  return found == element.attributes.end() ? "" : found->second;
}

std::string Tag(const QifElement& element) {
  const std::string id = Id(element);
  return id.empty() ? "<" + element.name + ">" : "<" + element.name + " id=\"" + id + "\">";
}

// Ends reading: the file breaks the rules of QIF.
struct Broken {
  absl::Status status;
};
// One characteristic cannot be read; the file may well be right.
struct Unreadable {
  std::string reason;
};

class QifReader {
 public:
  QifReader(const QifElement& root, std::string file, QifUnits units)
      : root_(root),
        file_(std::move(file)),
        units_(std::move(units)),
        geometry_units_(units_.ForGeometry()) {}

  ToleranceReport Read() {
    report_.file = std::filesystem::path(file_).filename().string();
    report_.standard = "QIF 3.0";
    const QifElement* features = root_.Child("Features");
    const QifElement* characteristics = root_.Child("Characteristics");
    Index(features, "FeatureDefinitions", feature_definitions_);
    Index(features, "FeatureNominals", feature_nominals_);
    Index(features, "FeatureItems", feature_items_);
    Index(&root_, "DatumDefinitions", datum_definitions_);
    Index(&root_, "DatumTargetDefinitions", datum_targets_);
    Index(&root_, "DatumReferenceFrames", frames_);
    Index(characteristics, "CharacteristicDefinitions", definitions_);
    Index(characteristics, "CharacteristicNominals", nominals_);
    Index(characteristics, "CharacteristicItems", items_);
    IndexProduct();
    ReadDatums();
    ReadCharacteristics();
    return std::move(report_);
  }

 private:
  using Elements = std::map<std::string, const QifElement*>;

  [[noreturn]] void Break(const QifElement& element, const std::string& why) const {
    throw Broken{absl::InvalidArgumentError(
        absl::StrCat(file_, ":", element.line, ": ", Tag(element), ": ", why))};
  }

  // --- Ids ----------------------------------------------------------------------------------

  void Index(const QifElement* parent, const std::string& list_name, Elements& index) {
    const QifElement* list = parent == nullptr ? nullptr : parent->Child(list_name);
    if (list == nullptr) return;
    size_t count = 0;
    for (const QifElement& element : list->children) {
      if (element.name == "Attributes") continue;
      ++count;
      const std::string id = Id(element);
      if (id.empty()) Break(element, "attribute id is missing");
      if (!ids_.insert(id).second) Break(element, "another element has the same id");
      index[id] = &element;
      order_[&index].push_back(&element);
    }
    CheckCount(*list, count);
  }

  // Surfaces and faces of the product, by id; later ones of the same id are not looked at.
  void IndexProduct() {
    const QifElement* product = root_.Child("Product");
    if (product == nullptr) return;
    const auto index = [&](const char* set, const char* list, Elements& elements) {
      const QifElement* parent = product->Child(set);
      const QifElement* found = parent == nullptr ? nullptr : parent->Child(list);
      if (found == nullptr) return;
      for (const QifElement& element : found->children) elements.emplace(Id(element), &element);
    };
    index("GeometrySet", "SurfaceSet", product_surfaces_);
    index("TopologySet", "FaceSet", product_faces_);
  }

  const QifElement& Follow(const Elements& index, const QifElement& from, const std::string& id,
                           const char* what) const {
    const auto found = index.find(std::string(id));
    if (found == index.end()) {
      Break(from, absl::StrCat("refers to ", what, " ", id, ", which is not in the file"));
    }
    Count(from, 1 + found->second->children.size());
    return *found->second;
  }

  void Count(const QifElement& from, size_t work) const {
    work_ += work;
    if (work_ > kMostWork) {
      Break(from, "the elements of this file refer to each other so often that it cannot be read");
    }
  }

  // Texts of the <Id> children of `list` of `element`.
  std::vector<std::string> Ids(const QifElement& element, const std::string& list) const {
    std::vector<std::string> ids;
    const QifElement* found = element.Child(list);
    if (found == nullptr) return ids;
    for (const QifElement& id : found->children) {
      if (id.name == "Id") ids.push_back(id.text);
    }
    CheckCount(*found, ids.size());
    return ids;
  }

  void CheckCount(const QifElement& list, size_t count) const {
    const auto n = list.attributes.find("n");
    size_t stated = 0;
    if (n != list.attributes.end() && (!absl::SimpleAtoi(n->second, &stated) || stated != count)) {
      Break(list, absl::StrCat("attribute n is ", n->second, "; it has ", count, " elements"));
    }
  }

  // --- Values -------------------------------------------------------------------------------

  // Value in metres or radians.
  double ValueOf(const QifElement* element, const QifElement& parent, const char* name,
                 bool angle) const {
    if (element == nullptr) Break(parent, absl::StrCat("<", name, "> is missing"));
    const auto value = ParseReal(element->text);
    if (!value.ok()) Break(*element, std::string(value.status().message()));
    if (*value == 0) return 0;  // in any unit
    const auto scale = units_.Scale(*element, angle);
    if (!scale.ok()) throw Broken{scale.status()};
    return *value * *scale;
  }

  // --- Features and datums ------------------------------------------------------------------

  std::string FeatureText(const QifElement& nominal) const {
    std::string text = Words(std::string(absl::StripSuffix(nominal.name, "FeatureNominal")));
    std::string name(nominal.ChildText("Name"));
    const auto item_name = feature_names_.find(Id(nominal));
    if (item_name != feature_names_.end()) name = item_name->second;
    if (!name.empty()) absl::StrAppend(&text, " ", name);
    absl::StrAppend(&text, " (feature ", Id(nominal));
    size_t entities = 0;
    if (const QifElement* list = nominal.Child("EntityInternalIds")) {
      Count(nominal, list->children.size());
      for (const QifElement& id : list->children) {
        if (id.name != "Id" || ++entities > kEntitiesNamed) continue;
        absl::StrAppend(&text, entities == 1 ? ", entities " : ", ", id.text);
      }
    }
    if (entities > kEntitiesNamed) {
      absl::StrAppend(&text, " and ", entities - kEntitiesNamed, " more");
    }
    Count(nominal, text.size());
    return text + ")";
  }

  std::vector<NominalFace> Checked(absl::StatusOr<std::vector<NominalFace>> faces) const {
    if (faces.ok()) return *std::move(faces);
    throw Broken{absl::InvalidArgumentError(absl::StrCat(file_, ":", faces.status().message()))};
  }

  // The faces of the product that a feature names. None if the surface of one of them is not known.
  std::vector<NominalFace> ProductFacesOf(const QifElement& nominal) const {
    std::vector<NominalFace> all;
    for (const std::string& id : Ids(nominal, "EntityInternalIds")) {
      Count(nominal, 1);
      const auto face = product_faces_.find(id);
      if (face == product_faces_.end()) return {};
      const QifElement* reference = face->second->Child("Surface");
      if (reference == nullptr) return {};
      const auto surface = product_surfaces_.find(reference->ChildText("Id"));
      if (surface == product_surfaces_.end()) return {};
      std::vector<NominalFace> found = Checked(FaceOnQifSurface(*surface->second, geometry_units_));
      if (found.empty()) return {};
      // Halves of a bore are one surface.
      const bool known = std::any_of(all.begin(), all.end(), [&](const NominalFace& other) {
        return other.surface.kind != SurfaceKind::kPlane &&
               SameSurface(other.surface, found.front().surface);
      });
      if (!known) all.push_back(std::move(found.front()));
    }
    return all;
  }

  // Numbers of the nominal faces of a feature; they are read when it is bound for the first time.
  const std::vector<int>& FacesOf(const QifElement& nominal) {
    const auto [entry, fresh] = faces_of_.try_emplace(Id(nominal));
    if (!fresh) return entry->second;
    const std::string& id = nominal.ChildText("FeatureDefinitionId");
    static const QifElement kNone;
    const QifElement& definition =
        id.empty() ? kNone : Follow(feature_definitions_, nominal, id, "feature definition");
    std::vector<NominalFace> faces =
        Checked(FacesOfQifFeature(nominal, definition, geometry_units_));
    if (faces.empty()) faces = ProductFacesOf(nominal);
    // A feature without a surface has a face that is found on no part, so that what it belongs to
    // is not evaluated on its other features alone.
    if (faces.empty()) faces.emplace_back();
    for (NominalFace& face : faces) {
      face.face = static_cast<int>(report_.nominal_faces.size()) + 1;
      face.feature = FeatureText(nominal);
      entry->second.push_back(face.face);
      report_.nominal_faces.push_back(std::move(face));
    }
    return entry->second;
  }

  // Adds a feature in words, and its faces.
  void Bind(const QifElement& nominal, std::vector<std::string>* features,
            std::vector<int>* faces) {
    features->push_back(FeatureText(nominal));
    const std::vector<int>& of = FacesOf(nominal);
    faces->insert(faces->end(), of.begin(), of.end());
  }

  void ReadDatums() {
    for (const QifElement* item : order_[&feature_items_]) {
      const std::string& nominal = item->ChildText("FeatureNominalId");
      if (nominal.empty()) continue;
      const QifElement& found = Follow(feature_nominals_, *item, nominal, "feature nominal");
      const std::string& name = item->ChildText("FeatureName");
      if (!name.empty()) feature_names_.emplace(Id(found), name);
    }
    for (const QifElement* definition : order_[&datum_definitions_]) {
      ++report_.entity_count;
      const std::string& label = definition->ChildText("DatumLabel");
      if (label.empty()) Break(*definition, "<DatumLabel> is missing");
      Datum datum;
      datum.id = Id(*definition);
      datum.letter = label;
      for (const std::string& id : Ids(*definition, "FeatureNominalIds")) {
        Bind(Follow(feature_nominals_, *definition, id, "feature nominal"), &datum.features,
             &datum.faces);
      }
      for (const std::string& id : Ids(*definition, "FeatureItemIds")) {
        const QifElement& item = Follow(feature_items_, *definition, id, "feature item");
        const std::string& nominal = item.ChildText("FeatureNominalId");
        Bind(Follow(feature_nominals_, item, nominal, "feature nominal"), &datum.features,
             &datum.faces);
      }
      report_.datums.push_back(std::move(datum));
    }
    for (const QifElement* target : order_[&datum_targets_]) {
      ++report_.entity_count;
      report_.not_read.push_back(
          {"datum target " + Id(*target) + " (line " + std::to_string(target->line) + ")",
           "datum targets are not read"});
    }
  }

  // All texts of elements `name` anywhere below.
  void Collect(const QifElement& element, const std::string& name,
               std::vector<std::string>& out) const {
    Count(element, element.children.size());
    for (const QifElement& child : element.children) {
      if (child.name == name) out.push_back(child.text);
      Collect(child, name, out);
    }
  }

  std::vector<std::string> FrameDatums(const QifElement& frame) const {
    std::vector<std::pair<int, std::string>> ordered;
    const QifElement* datums = frame.Child("Datums");
    if (datums == nullptr) return {};
    for (const QifElement& datum : datums->children) {
      if (datum.name != "Datum") continue;
      std::vector<std::string> ids, materials, precedence;
      Collect(datum, "DatumDefinitionId", ids);
      Collect(datum, "MaterialModifier", materials);
      Collect(datum, "PrecedenceEnum", precedence);
      if (precedence.size() > 1) Break(datum, "<PrecedenceEnum> stands in it twice");
      if (std::any_of(materials.begin(), materials.end(),
                      [&](const std::string& material) { return material != materials[0]; })) {
        throw Unreadable{absl::StrCat("a datum (line ", datum.line,
                                      ") has different values of <MaterialModifier>")};
      }
      std::string text;
      for (const std::string& id : ids) {
        const QifElement& definition = Follow(datum_definitions_, datum, id, "datum definition");
        absl::StrAppend(&text, text.empty() ? "" : "-", definition.ChildText("DatumLabel"));
      }
      Count(datum, text.size());
      if (!materials.empty() && materials[0] == "MAXIMUM") text += "(M)";
      if (!materials.empty() && materials[0] == "LEAST") text += "(L)";
      const std::string first = precedence.empty() ? "" : precedence[0];
      const int rank = first == "PRIMARY"     ? 1
                       : first == "SECONDARY" ? 2
                       : first == "TERTIARY"  ? 3
                                              : 4;
      ordered.emplace_back(rank, text);
    }
    std::stable_sort(ordered.begin(), ordered.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<std::string> texts;
    for (auto& [rank, text] : ordered) texts.push_back(std::move(text));
    return texts;
  }

  // --- Characteristics ----------------------------------------------------------------------

  void ReadCharacteristics() {
    std::multimap<std::string, const QifElement*> items_of;  // of a nominal
    for (const QifElement* item : order_[&items_]) {
      const std::string& nominal = item->ChildText("CharacteristicNominalId");
      if (nominal.empty()) Break(*item, "<CharacteristicNominalId> is missing");
      Follow(nominals_, *item, nominal, "characteristic nominal");
      items_of.emplace(std::string(nominal), item);
    }
    std::set<const QifElement*> used;
    for (const QifElement* nominal : order_[&nominals_]) {
      ++report_.entity_count;
      const std::string& id = nominal->ChildText("CharacteristicDefinitionId");
      if (id.empty()) Break(*nominal, "<CharacteristicDefinitionId> is missing");
      const QifElement& definition =
          Follow(definitions_, *nominal, id, "characteristic definition");
      used.insert(&definition);
      const auto [first, last] = items_of.equal_range(Id(*nominal));
      std::vector<const QifElement*> items;
      for (auto it = first; it != last; ++it) items.push_back(it->second);
      ReadCharacteristic(*nominal, definition, items);
    }
    for (const QifElement* definition : order_[&definitions_]) {
      if (used.contains(definition)) continue;
      ++report_.entity_count;
      report_.not_read.push_back({UnreadName("", *definition), "no characteristic refers to it"});
    }
  }

  static std::string UnreadName(const std::string& name, const QifElement& element) {
    return absl::StrCat(name, name.empty() ? "" : " ", "(", element.name, " ", Id(element),
                        ", line ", element.line, ")");
  }

  static std::string NameOf(const QifElement& element) {
    std::string name(element.ChildText("Name"));
    const QifElement* designator = element.Child("CharacteristicDesignator");
    if (name.empty() && designator != nullptr) name = designator->ChildText("Designator");
    return name;
  }

  void ReadCharacteristic(const QifElement& nominal, const QifElement& definition,
                          const std::vector<const QifElement*>& items) {
    Tolerance tolerance;
    tolerance.id = Id(nominal);
    tolerance.name = NameOf(nominal);
    tolerance.persistent_id = QifPersistentId(nominal);
    std::set<std::string> features;
    for (const std::string& id : Ids(nominal, "FeatureNominalIds")) {
      const QifElement& feature = Follow(feature_nominals_, nominal, id, "feature nominal");
      if (features.insert(id).second) Bind(feature, &tolerance.features, &tolerance.faces);
    }
    for (const QifElement* item : items) {
      if (tolerance.name.empty()) tolerance.name = NameOf(*item);
      if (tolerance.persistent_id.empty()) tolerance.persistent_id = QifPersistentId(*item);
      for (const std::string& id : Ids(*item, "FeatureItemIds")) {
        const QifElement& feature_item = Follow(feature_items_, *item, id, "feature item");
        const std::string& of = feature_item.ChildText("FeatureNominalId");
        const QifElement& feature = Follow(feature_nominals_, feature_item, of, "feature nominal");
        if (features.insert(Id(feature)).second) {
          Bind(feature, &tolerance.features, &tolerance.faces);
        }
      }
    }
    if (!absl::EndsWith(definition.name, kDefinition)) {
      Break(definition, "is no characteristic definition");
    }
    const std::string type(absl::StripSuffix(definition.name, kDefinition));
    if (tolerance.name.empty()) tolerance.name = Words(type);
    try {
      const auto same = [&](const CharacteristicName& entry) { return type == entry.qif; };
      if (const auto* found = std::find_if(kGeometric.begin(), kGeometric.end(), same);
          found != kGeometric.end()) {
        ReadGeometric(*found, definition, tolerance);
        ReadSegments(*found, definition, tolerance, 2);
      } else if (const auto* dimension =
                     std::find_if(kDimensional.begin(), kDimensional.end(), same);
                 dimension != kDimensional.end()) {
        ReadDimension(*dimension, nominal, definition, tolerance);
      } else {
        throw Unreadable{"the kind of characteristic " + type + " is not read"};
      }
    } catch (const Unreadable& unreadable) {
      report_.not_read.push_back({UnreadName(tolerance.name, nominal), unreadable.reason});
    }
  }

  void ReadGeometric(const CharacteristicName& name, const QifElement& definition,
                     Tolerance tolerance) {
    tolerance.kind = name.kind;
    if (*name.modifier != '\0') tolerance.modifiers.emplace_back(name.modifier);
    const QifElement* value = definition.Child("ToleranceValue");
    if (value == nullptr) {
      throw Unreadable{
          absl::StrCat("it has no <ToleranceValue> of its own (line ", definition.line, ")")};
    }
    tolerance.zone_width_m = ValueOf(value, definition, "ToleranceValue", /*angle=*/false);
    if (!(tolerance.zone_width_m > 0)) {
      throw Unreadable{"its zone width is " + Number(1e3 * tolerance.zone_width_m) +
                       " mm (0 is meant to grow with the departure from maximum material)"};
    }
    const std::string& frame = definition.ChildText("DatumReferenceFrameId");
    if (!frame.empty()) {
      tolerance.datums = FrameDatums(Follow(frames_, definition, frame, "datum reference frame"));
    }
    const std::string& material = definition.ChildText("MaterialCondition");
    if (material == "MAXIMUM") tolerance.modifiers.emplace_back("maximum material requirement");
    if (material == "LEAST") tolerance.modifiers.emplace_back("least material requirement");
    if (const QifElement* shape = definition.Child("ZoneShape")) {
      for (const QifElement& zone : shape->children) {
        const bool sphere = absl::StartsWith(zone.name, "Spherical");
        if (sphere || absl::StartsWith(zone.name, "Diametrical") ||
            absl::StartsWith(zone.name, "Cylindrical")) {
          tolerance.diameter_zone = true;
        }
        if (sphere) tolerance.modifiers.emplace_back("spherical zone");
      }
    }
    if (const QifElement* outer = definition.Child("OuterDisposition")) {
      tolerance.modifiers.push_back(
          "unequally disposed, " +
          Number(1e3 * ValueOf(outer, definition, "OuterDisposition", false)) + " mm outside");
    }
    tolerance.text = absl::StrCat(ToleranceKindName(tolerance.kind),
                                  tolerance.diameter_zone ? " diameter " : " ",
                                  Number(1e3 * tolerance.zone_width_m), " mm");
    for (const std::string& modifier : tolerance.modifiers) {
      absl::StrAppend(&tolerance.text, " ", modifier);
    }
    for (const std::string& datum : tolerance.datums) {
      absl::StrAppend(&tolerance.text, " | ", datum);
    }
    report_.read.push_back(std::move(tolerance));
  }

  // Further segments of a composite tolerance, each a tolerance of its own: narrower zones with
  // fewer datums (ASME Y14.5-2018, 10.5.1 and 11.6.2).
  void ReadSegments(const CharacteristicName& name, const QifElement& definition,
                    const Tolerance& first, int number) {
    for (const QifElement& segment : definition.children) {
      if (!absl::StrContains(segment.name, "CompositeSegment")) continue;
      Count(segment, 1);
      ++report_.entity_count;
      Tolerance tolerance = first;
      tolerance.id = absl::StrCat(first.id, ".", number);
      tolerance.name = absl::StrCat(first.name, ", segment ", number);
      tolerance.persistent_id.clear();
      try {
        ReadGeometric(name, segment, tolerance);
      } catch (const Unreadable& unreadable) {
        report_.not_read.push_back(
            {absl::StrCat(tolerance.name, " (line ", segment.line, ")"), unreadable.reason});
      }
      ReadSegments(name, segment, first, ++number);
    }
  }

  void ReadDimension(const CharacteristicName& name, const QifElement& nominal,
                     const QifElement& definition, Tolerance tolerance) {
    tolerance.kind = name.kind;
    const bool angle = IsAngular(name.kind);
    std::optional<double> target, lower, upper;
    if (const QifElement* value = nominal.Child("TargetValue")) {
      target = ValueOf(value, nominal, "TargetValue", angle);
    }
    const QifElement* limits = definition.Child("Tolerance");
    if (limits != nullptr) {
      const QifElement* max = limits->Child("MaxValue");
      const QifElement* min = limits->Child("MinValue");
      if (max == nullptr && min == nullptr) {
        throw Unreadable{absl::StrCat("its <Tolerance> (line ", limits->line,
                                      ") has no <MaxValue> and <MinValue>")};
      }
      if (max == nullptr || min == nullptr) {
        throw Unreadable{absl::StrCat("it has one limit only (line ", limits->line, "): no zone")};
      }
      const std::string& as_limit = limits->ChildText("DefinedAsLimit");
      if (as_limit != "true" && as_limit != "false" && as_limit != "1" && as_limit != "0") {
        Break(*limits,
              absl::StrCat("<DefinedAsLimit> is \"", as_limit, "\"; must be true or false"));
      }
      upper = ValueOf(max, *limits, "MaxValue", angle);
      lower = ValueOf(min, *limits, "MinValue", angle);
      // Deviations from the nominal value; without one their difference is still the zone.
      if (as_limit == "false" || as_limit == "0") {
        if (!target) {
          throw Unreadable{
              absl::StrCat("it has deviations (line ", limits->line, ") but no <TargetValue>")};
        }
        *upper += *target;
        *lower += *target;
      }
    } else if (!target) {
      throw Unreadable{"the file gives no value for it"};
    }
    (angle ? tolerance.nominal_rad : tolerance.nominal_m) = target;
    (angle ? tolerance.lower_rad : tolerance.lower_m) = lower;
    (angle ? tolerance.upper_rad : tolerance.upper_m) = upper;
    const double shown = angle ? 180 / std::numbers::pi : 1e3;
    tolerance.text = name.modifier;
    if (target) absl::StrAppend(&tolerance.text, " ", Number(shown * *target));
    if (lower && target) {
      absl::StrAppend(&tolerance.text, " ", Signed(shown * (*upper - *target)), "/",
                      Signed(shown * (*lower - *target)));
    } else if (lower) {
      absl::StrAppend(&tolerance.text, " ", Number(shown * *lower), " to ", Number(shown * *upper));
    }
    absl::StrAppend(&tolerance.text, angle ? " deg" : " mm");
    if (!lower) {
      const std::string& without = definition.ChildText("NonTolerance");
      if (!without.empty()) {
        tolerance.modifiers.push_back(absl::AsciiStrToLower(without));
        absl::StrAppend(&tolerance.text, ", ", tolerance.modifiers.back());
      }
      report_.untoleranced.push_back(std::move(tolerance));
      return;
    }
    const double width = *upper - *lower;
    if (!(width > 0)) {
      throw Unreadable{"its lower limit is not below its upper one (" + tolerance.text + ")"};
    }
    (angle ? tolerance.zone_width_rad : tolerance.zone_width_m) = width;
    report_.read.push_back(std::move(tolerance));
  }

  const QifElement& root_;
  std::string file_;
  QifUnits units_, geometry_units_;
  ToleranceReport report_;
  std::set<std::string> ids_;
  Elements product_surfaces_, product_faces_;
  Elements feature_definitions_, feature_nominals_, feature_items_, datum_definitions_,
      datum_targets_, frames_, definitions_, nominals_, items_;
  std::map<const Elements*, std::vector<const QifElement*>> order_;  // as in the file
  std::map<std::string, std::string> feature_names_;                 // of a nominal, by its item
  std::map<std::string, std::vector<int>> faces_of_;                 // of a nominal
  mutable size_t work_ = 0;                                          // of kMostWork
};

}  // namespace

absl::StatusOr<ToleranceReport> ReadQif(const std::string& file, const std::string& schema_folder,
                                        const std::string& length_unit) {
  SIGHTLINE_ASSIGN_OR_RETURN(const auto root, ReadQifXml(file, schema_folder, kKept));
  try {
    SIGHTLINE_ASSIGN_OR_RETURN(auto units, QifUnits::Read(root, file, length_unit));
    ToleranceReport report = QifReader(root, file, std::move(units)).Read();
    report.notes.push_back(
        schema_folder.empty()
            ? "checked: XML, namespace, version and the structure of what is read; not validated "
              "against the QIF schema, for which its folder must be given"
            : "validated against the QIF schema in " + schema_folder);
    if (report.entity_count > 0) {
      report.notes.emplace_back(
          "features are bound to the surface of the part by their nominal geometry, within 10 um");
    }
    return report;
  } catch (const Broken& broken) {
    return broken.status;
  } catch (const QifRepeated& repeated) {
    return absl::InvalidArgumentError(absl::StrCat(
        file, ":", repeated.line, ": <", repeated.name, "> stands twice in <", repeated.parent,
        ">, must stand once; the first is in line ", repeated.first_line));
  }
}

}  // namespace sightline
