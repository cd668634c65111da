// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/qif_export.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/digest/sha256.h"

namespace sightline {
namespace {

// Bytes of the UTF-8 sequence at the front of `text` that encodes a character XML 1.0 allows; 0:
// there is none.
size_t XmlCharacter(absl::string_view text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  const uint8_t lead = byte(0);
  if (lead < 0x80) return lead >= 0x20 || lead == '\t' || lead == '\n' || lead == '\r' ? 1 : 0;
  const size_t length = lead >= 0xf0 ? 4 : lead >= 0xe0 ? 3 : 2;
  if (lead < 0xc2 || lead > 0xf4 || text.size() < length) return 0;
  uint32_t code = lead & (0xffu >> (length + 1));
  for (size_t i = 1; i < length; ++i) {
    if ((byte(i) & 0xc0) != 0x80) return 0;
    code = (code << 6) | (byte(i) & 0x3fu);
  }
  constexpr std::array<uint32_t, 5> kFirstOfLength = {0, 0, 0x80, 0x800, 0x10000};
  const bool allowed = code >= kFirstOfLength[length] && code <= 0x10ffff &&
                       !(code >= 0xd800 && code <= 0xdfff) && code != 0xfffe && code != 0xffff;
  return allowed ? length : 0;
}

// Safe as text and in quoted attributes; characters that XML cannot contain become U+FFFD.
std::string Escape(absl::string_view text) {
  std::string escaped;
  for (size_t i = 0; i < text.size();) {
    const size_t length = XmlCharacter(text.substr(i));
    if (length == 0) {
      escaped += "\ufffd";
      ++i;
      continue;
    }
    switch (text[i]) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      // In attributes they would be read as spaces.
      case '\t':
      case '\n':
      case '\r':
        absl::StrAppend(&escaped, "&#", static_cast<int>(text[i]), ";");
        break;
      default:
        absl::StrAppend(&escaped, text.substr(i, length));
    }
    i += length;
  }
  return escaped;
}

// Shortest decimal without an exponent (xs:decimal has none) that reads back as the same double.
std::string Decimal(double value) {
  std::array<char, 400> buffer;
  const auto [end, error] = std::to_chars(buffer.data(), buffer.data() + buffer.size(),
                                          value == 0 ? 0.0 : value, std::chars_format::fixed);
  assert(error == std::errc());
  return std::string(buffer.data(), end);
}

// Lengths [mm] below this magnitude are written. With 12 digits after the point they have at most
// 21 digits; XML Schema processors need not take more than 18, and xmllint takes 24.
constexpr double kLargestLength_mm = 1e9;
// Zones narrower than this would be written as 0.
constexpr double kNarrowestZone_mm = 1e-9;

// In millimetres, without the dust of the multiplication: 12 digits.
double RoundedMillimetres(double length_m) {
  if (!std::isfinite(length_m)) return length_m;
  double value = 0;
  const std::string text = absl::StrFormat("%.12g", 1e3 * length_m);
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

bool IsWritable(const std::optional<double>& length_m) {
  return length_m && std::abs(RoundedMillimetres(*length_m)) < kLargestLength_mm;
}

// A length in millimetres as xs:decimal: at most 12 digits after the point. `length_m` is writable.
std::string MillimetreText(double length_m) {
  std::string text = absl::StrFormat("%.12f", RoundedMillimetres(length_m));
  text.erase(text.find_last_not_of('0') + 1);
  if (text.ends_with('.')) text.pop_back();
  return text == "-0" ? "0" : text;
}

// The first 128 bits of the SHA-256 digest as a UUID of version 8 (RFC 9562: made from data in a
// way of one's own).
std::string QpidOf(std::string_view text) {
  Sha256 digest;
  digest.Update(text);
  std::string id = digest.Hex().substr(0, 32);
  id[12] = '8';
  id[16] = "89ab"[absl::ascii_isdigit(static_cast<unsigned char>(id[16])) ? (id[16] - '0') % 4
                                                                          : (id[16] - 'a') % 4];
  for (const size_t at : {20, 16, 12, 8}) id.insert(at, "-");
  return id;
}

// Elements, indented; every one opened is closed.
class XmlWriter {
 public:
  void Open(absl::string_view name, absl::string_view attributes = "") {
    Indent();
    absl::StrAppend(&text_, "<", name, attributes.empty() ? "" : " ", attributes, ">\n");
    open_.emplace_back(name);
  }
  void OpenList(absl::string_view name, size_t n) { Open(name, absl::StrCat("n=\"", n, "\"")); }
  void OpenWithId(absl::string_view name, int64_t id) {
    Open(name, absl::StrCat("id=\"", id, "\""));
  }
  void Close() {
    assert(!open_.empty());
    const std::string name = std::move(open_.back());
    open_.pop_back();
    Indent();
    absl::StrAppend(&text_, "</", name, ">\n");
  }
  // `text` is escaped here.
  void Leaf(absl::string_view name, absl::string_view text) {
    Indent();
    absl::StrAppend(&text_, "<", name, ">", Escape(text), "</", name, ">\n");
  }
  void Leaf(absl::string_view name, int64_t id) { Leaf(name, absl::StrCat(id)); }
  void LeafWith(absl::string_view name, absl::string_view attributes, absl::string_view text) {
    Indent();
    absl::StrAppend(&text_, "<", name, attributes.empty() ? "" : " ", attributes, ">", Escape(text),
                    "</", name, ">\n");
  }
  void Empty(absl::string_view name, absl::string_view attributes = "") {
    Indent();
    absl::StrAppend(&text_, "<", name, attributes.empty() ? "" : " ", attributes, "/>\n");
  }
  // Copies whole elements made by another writer.
  void Append(absl::string_view elements) {
    for (absl::string_view rest = elements; !rest.empty();) {
      const size_t end = rest.find('\n') + 1;
      Indent();
      absl::StrAppend(&text_, rest.substr(0, end));
      rest.remove_prefix(end);
    }
  }
  std::string Take() {
    assert(open_.empty());
    return std::move(text_);
  }

 private:
  void Indent() { text_.append(2 * open_.size(), ' '); }
  std::string text_;
  std::vector<std::string> open_;
};

// Attributes of one element: names are unique within it.
class Attributes {
 public:
  void Text(absl::string_view name, absl::string_view value) {
    if (value.empty()) return;
    items_.push_back({"AttributeStr", std::string(name), Escape(value)});
  }
  void Real(absl::string_view name, double value) {
    if (!std::isfinite(value)) return;
    items_.push_back({"AttributeD1", std::string(name), Decimal(value)});
  }
  void Integer(absl::string_view name, int64_t value) {
    items_.push_back({"AttributeI1", std::string(name), absl::StrCat(value)});
  }
  void Truth(absl::string_view name, bool value) {
    items_.push_back({"AttributeBool", std::string(name), value ? "true" : "false"});
  }
  void Write(XmlWriter& xml) const {
    if (items_.empty()) return;
    xml.OpenList("Attributes", items_.size());
    for (const Item& item : items_) {
      xml.Empty(item.element, absl::StrCat("name=\"", item.name, "\" value=\"", item.value, "\""));
    }
    xml.Close();
  }

 private:
  struct Item {
    const char* element;
    std::string name, value;
  };
  std::vector<Item> items_;
};

// How a kind of tolerance is written.
enum class Form {
  kValue,         // ToleranceValue alone
  kStraightness,  // and ZoneShape
  kOrientation,   // and MaterialCondition, ZoneShape
  kPosition,      // likewise
  kCoaxiality,    // and ZoneShape
  kLimits,        // Tolerance with two limits
  kOther,         // user-defined: no zone, or the schema demands what a plan does not know
};
struct QifKind {
  std::string name;  // of elements, before "CharacteristicDefinition", ...
  Form form;
};

// Kinds by their names, see ToleranceKindName.
constexpr std::array<std::pair<ToleranceKind, std::pair<const char*, Form>>, 15> kKinds = {
    {{ToleranceKind::kFlatness, {"Flatness", Form::kValue}},
     {ToleranceKind::kStraightness, {"Straightness", Form::kStraightness}},
     {ToleranceKind::kRoundness, {"Circularity", Form::kValue}},
     {ToleranceKind::kCylindricity, {"Cylindricity", Form::kValue}},
     {ToleranceKind::kSurfaceProfile, {"SurfaceProfile", Form::kValue}},
     // The nominal of a line profile must have the normal of the profile's plane.
     {ToleranceKind::kLineProfile, {"LineProfile", Form::kOther}},
     {ToleranceKind::kPosition, {"Position", Form::kPosition}},
     {ToleranceKind::kParallelism, {"Parallelism", Form::kOrientation}},
     {ToleranceKind::kPerpendicularity, {"Perpendicularity", Form::kOrientation}},
     {ToleranceKind::kAngularity, {"Angularity", Form::kOrientation}},
     {ToleranceKind::kConcentricity, {"Concentricity", Form::kCoaxiality}},
     {ToleranceKind::kCoaxiality, {"Coaxiality", Form::kCoaxiality}},
     {ToleranceKind::kSymmetry, {"Symmetry", Form::kValue}},
     {ToleranceKind::kCircularRunout, {"CircularRunout", Form::kValue}},
     {ToleranceKind::kTotalRunout, {"TotalRunout", Form::kValue}}}};

bool Has(const Tolerance* tolerance, absl::string_view modifier) {
  return tolerance != nullptr && std::find(tolerance->modifiers.begin(), tolerance->modifiers.end(),
                                           modifier) != tolerance->modifiers.end();
}

QifKind KindOf(const v1::FeatureVerdict& feature, const Tolerance* tolerance) {
  const double width_m = feature.zone_width_m();
  if (IsWritable(width_m) && RoundedMillimetres(width_m) >= kNarrowestZone_mm) {
    for (const auto& [kind, written] : kKinds) {
      if (feature.kind() == ToleranceKindName(kind) && written.second != Form::kOther)
        return {written.first, written.second};
    }
    if (feature.kind() == ToleranceKindName(ToleranceKind::kLinearDistance))
      return {"DistanceBetween", Form::kLimits};
    if (feature.kind() == ToleranceKindName(ToleranceKind::kLinearSize)) {
      // One of the modifiers names the measured size of the feature.
      for (const auto& [modifier, name] :
           {std::pair{"diameter", "Diameter"}, std::pair{"radius", "Radius"},
            std::pair{"thickness", "Thickness"}, std::pair{"width", "Width"}}) {
        if (Has(tolerance, modifier)) return {name, Form::kLimits};
      }
      return {"Length", Form::kLimits};
    }
  }
  return {"UserDefinedAttribute", Form::kOther};
}

struct Characteristic {
  const v1::FeatureVerdict* feature = nullptr;
  const Tolerance* tolerance = nullptr;  // null: the drawing's is not known
  QifKind kind;
  int64_t definition = 0, nominal = 0, item = 0, feature_item = 0;
  std::string persistent_id;
};

bool IsUuid(const std::string& text) {
  constexpr absl::string_view kForm = "xxxxxxxx-xxxx-xxxx-xxxx-xxxxxxxxxxxx";
  return std::equal(text.begin(), text.end(), kForm.begin(), kForm.end(), [](char c, char form) {
    return form == '-' ? c == '-' : absl::ascii_isxdigit(static_cast<unsigned char>(c));
  });
}

// Persistent ids of the characteristics of one part, in the order of the plan: the same in every
// document about it. A drawing in QIF brings its own. Others follow from the part, the tolerance's
// id in its file, its name and kind; the zone may change.
class CharacteristicIds {
 public:
  explicit CharacteristicIds(const v1::Plan& plan) : part_(plan.part_digest()) {}

  std::string Next(const v1::FeatureVerdict& feature, const Tolerance* tolerance) {
    std::string id = tolerance != nullptr ? tolerance->persistent_id : "";
    if (IsUuid(id) && used_.insert(id).second) return id;
    const std::string key = absl::StrCat("characteristic\n", part_, "\n", feature.id(), "\n",
                                         feature.name(), "\n", feature.kind(), "\n");
    for (int repeated = 0;; ++repeated) {
      id = QpidOf(absl::StrCat(key, repeated));
      if (used_.insert(id).second) return id;
    }
  }

 private:
  std::string part_;
  std::set<std::string> used_;
};

const char* MaterialCondition(const Tolerance* tolerance) {
  if (Has(tolerance, "maximum material requirement")) return "MAXIMUM";
  if (Has(tolerance, "least material requirement")) return "LEAST";
  return "REGARDLESS";
}

// Limits of a dimension [m]; deviations from the nominal value if the drawing's are not known.
struct Limits {
  double lower_m, upper_m;
  bool deviations;
};
Limits LimitsOf(const Characteristic& c) {
  if (c.tolerance != nullptr && IsWritable(c.tolerance->lower_m) &&
      IsWritable(c.tolerance->upper_m)) {
    return {*c.tolerance->lower_m, *c.tolerance->upper_m, false};
  }
  return {-0.5 * c.feature->zone_width_m(), 0.5 * c.feature->zone_width_m(), true};
}

void WriteDefinition(const Characteristic& c, XmlWriter& xml) {
  xml.OpenWithId(c.kind.name + "CharacteristicDefinition", c.definition);
  const bool diameter = c.tolerance != nullptr && c.tolerance->diameter_zone;
  const auto zone = [&](absl::string_view other) {
    xml.Open("ZoneShape");
    xml.Empty(diameter ? "DiametricalZone" : other);
    xml.Close();
  };
  if (c.kind.form == Form::kOther) {
    const bool drawn = c.tolerance != nullptr && !c.tolerance->text.empty();
    xml.Leaf("WhatToMeasure",
             drawn ? c.tolerance->text : absl::StrCat(c.feature->kind(), " ", c.feature->name()));
  } else if (c.kind.form == Form::kLimits) {
    const Limits limits = LimitsOf(c);
    xml.Open("Tolerance");
    xml.Leaf("MaxValue", MillimetreText(limits.upper_m));
    xml.Leaf("MinValue", MillimetreText(limits.lower_m));
    xml.Leaf("DefinedAsLimit", limits.deviations ? "false" : "true");
    xml.Close();
  } else {
    xml.Leaf("ToleranceValue", MillimetreText(c.feature->zone_width_m()));
    if (c.kind.form == Form::kPosition || c.kind.form == Form::kOrientation)
      xml.Leaf("MaterialCondition", MaterialCondition(c.tolerance));
    if (c.kind.form == Form::kOrientation) zone("PlanarZone");
    if (c.kind.form == Form::kPosition || c.kind.form == Form::kStraightness ||
        c.kind.form == Form::kCoaxiality) {
      zone("NonDiametricalZone");
    }
  }
  xml.Close();
}

void WriteNominal(const Characteristic& c, XmlWriter& xml) {
  xml.OpenWithId(c.kind.name + "CharacteristicNominal", c.nominal);
  xml.Leaf("CharacteristicDefinitionId", c.definition);
  if (c.kind.form == Form::kLimits) {
    // Deviations without limits have no nominal value. Writing 0 would be wrong, but readers
    // require a nominal value with deviations.
    if (c.tolerance != nullptr && IsWritable(c.tolerance->nominal_m))
      xml.Leaf("TargetValue", MillimetreText(*c.tolerance->nominal_m));
    if (c.kind.name == "DistanceBetween") xml.Leaf("AnalysisMode", "THREEDIMENSIONAL");
  }
  xml.Close();
}

std::string NameOf(const v1::FeatureVerdict& feature) {
  return !feature.name().empty() ? feature.name()
         : !feature.id().empty() ? feature.id()
                                 : feature.kind();
}

// Figures that were evaluated; others are left out.
void WriteFigures(const v1::FeatureVerdict& feature, Attributes& attributes) {
  const auto length = [&](const char* name, bool known, double value_m) {
    if (known) attributes.Real(name, RoundedMillimetres(value_m));
  };
  length("predicted_standard_uncertainty_mm", feature.has_uncertainty_m(), feature.uncertainty_m());
  length("predicted_noise_mm", feature.has_noise_m(), feature.noise_m());
  length("predicted_sampling_mm", feature.has_sampling_m(), feature.sampling_m());
  length("predicted_calibration_mm", feature.has_calibration_m(), feature.calibration_m());
  length("predicted_registration_mm", feature.has_registration_m(), feature.registration_m());
  length("admissible_standard_uncertainty_mm", feature.has_admissible_uncertainty_m(),
         feature.admissible_uncertainty_m());
  length("zone_width_mm", feature.has_zone_width_m(), feature.zone_width_m());
  length("acceptance_zone_mm", feature.has_acceptance_zone_m(), feature.acceptance_zone_m());
  if (feature.has_probability_wrong_acceptance())
    attributes.Real("probability_wrong_acceptance", feature.probability_wrong_acceptance());
  if (feature.has_probability_wrong_rejection())
    attributes.Real("probability_wrong_rejection", feature.probability_wrong_rejection());
  if (feature.verdict() != v1::FeatureVerdict::NOT_EVALUATED)
    attributes.Truth("conformance_can_be_proven", feature.can_be_proven());
  attributes.Text("verdict_state", v1::FeatureVerdict::Verdict_Name(feature.verdict()));
}

void WriteItem(const Characteristic& c, XmlWriter& xml) {
  const v1::FeatureVerdict& feature = *c.feature;
  xml.OpenWithId(c.kind.name + "CharacteristicItem", c.item);
  Attributes attributes;
  WriteFigures(feature, attributes);
  attributes.Text("verdict", feature.because());
  attributes.Integer("targets_count", feature.targets());
  attributes.Integer("measured_targets_count", feature.measured_targets());
  if (feature.has_admissible_targets())
    attributes.Integer("admissible_targets_count", feature.admissible_targets());
  attributes.Text("kind", feature.kind());
  if (c.tolerance != nullptr) {
    std::string datums;
    for (const std::string& datum : c.tolerance->datums)
      absl::StrAppend(&datums, datums.empty() ? "" : " | ", datum);
    attributes.Text("datums", datums);
    std::string modifiers;
    for (const std::string& modifier : c.tolerance->modifiers)
      absl::StrAppend(&modifiers, modifiers.empty() ? "" : ", ", modifier);
    attributes.Text("modifiers", modifiers);
  }
  if (c.tolerance == nullptr && c.kind.form != Form::kValue && c.kind.form != Form::kOther) {
    attributes.Text("assumed", c.kind.form == Form::kLimits
                                   ? "limits symmetrical about the nominal value"
                                   : "material condition and shape of the zone");
  }
  attributes.Write(xml);
  if (c.tolerance != nullptr && !c.tolerance->text.empty())
    xml.Leaf("Description", c.tolerance->text);
  xml.Leaf("Name", NameOf(feature));
  xml.Open("CharacteristicDesignator");
  xml.Leaf("Designator", feature.id().empty() ? NameOf(feature) : feature.id());
  xml.Leaf("UUID", c.persistent_id);
  xml.Close();
  xml.OpenList("FeatureItemIds", 1);
  xml.Leaf("Id", c.feature_item);
  xml.Close();
  xml.Leaf("CharacteristicNominalId", c.nominal);
  xml.Close();
}

struct QifFeature {
  std::string name;
  int64_t definition = 0, nominal = 0, item = 0;
  std::string persistent_id;
};

void WriteFeatures(const std::vector<QifFeature>& features, XmlWriter& xml) {
  xml.Open("Features");
  xml.OpenList("FeatureDefinitions", features.size());
  for (const QifFeature& feature : features)
    xml.Empty("OtherSurfaceFeatureDefinition", absl::StrCat("id=\"", feature.definition, "\""));
  xml.Close();
  xml.OpenList("FeatureNominals", features.size());
  for (const QifFeature& feature : features) {
    xml.OpenWithId("OtherSurfaceFeatureNominal", feature.nominal);
    xml.Leaf("FeatureDefinitionId", feature.definition);
    xml.Close();
  }
  xml.Close();
  xml.OpenList("FeatureItems", features.size());
  for (const QifFeature& feature : features) {
    xml.OpenWithId("OtherSurfaceFeatureItem", feature.item);
    xml.Leaf("FeatureNominalId", feature.nominal);
    xml.Leaf("FeatureName", feature.name);
    xml.Leaf("UUID", feature.persistent_id);
    xml.Open("DeterminationMode");
    xml.Open("Checked");
    xml.Open("CheckDetails");
    xml.Empty("Measured");
    xml.Close();
    xml.Close();
    xml.Close();
    xml.Close();
  }
  xml.Close();
  xml.Close();
}

// The standard by which the plan's verdicts decide. Characteristics must refer to one.
void WriteStandard(int64_t id, XmlWriter& xml) {
  xml.OpenList("StandardsDefinitions", 1);
  xml.OpenWithId("Standard", id);
  xml.Open("Organization");
  xml.Leaf("StandardsOrganizationEnum", "ISO");
  xml.Close();
  xml.Leaf("Designator", "14253-1");
  xml.Leaf("Year", "2017");
  xml.Leaf("Title", "Decision rules for verifying conformity or nonconformity with specifications");
  xml.Close();
  xml.Close();
}

void WriteCharacteristics(const std::vector<Characteristic>& characteristics, int64_t standard,
                          XmlWriter& xml) {
  xml.Open("Characteristics");
  xml.Leaf("FormalStandardId", standard);
  xml.OpenList("CharacteristicDefinitions", characteristics.size());
  for (const Characteristic& c : characteristics) WriteDefinition(c, xml);
  xml.Close();
  xml.OpenList("CharacteristicNominals", characteristics.size());
  for (const Characteristic& c : characteristics) WriteNominal(c, xml);
  xml.Close();
  xml.OpenList("CharacteristicItems", characteristics.size());
  for (const Characteristic& c : characteristics) WriteItem(c, xml);
  xml.Close();
  xml.Close();
}

// Empty if a number is not finite.
std::string MatrixText(const v1::Pose& pose) {
  std::string text;
  for (const double value : pose.matrix()) {
    if (!std::isfinite(value)) return "";
    absl::StrAppend(&text, text.empty() ? "" : " ", absl::StrFormat("%.12g", value));
  }
  return text;
}

void WriteScan(const v1::PlannedScan& scan, int64_t id, XmlWriter& xml) {
  const v1::Measurement& m = scan.measurement();
  xml.OpenWithId("TextInstruction", id);
  Attributes attributes;
  attributes.Integer("scan", scan.index());
  attributes.Real("camera_distance_mm", RoundedMillimetres(m.camera_distance_m()));
  attributes.Real("triangulation_angle_deg", m.triangulation_angle_deg());
  attributes.Real("camera_azimuth_deg", m.camera_azimuth_deg());
  attributes.Real("camera_polar_deg", m.camera_polar_deg());
  attributes.Real("part_alpha_deg", m.part_alpha_deg());
  attributes.Real("part_beta_deg", m.part_beta_deg());
  attributes.Real("part_gamma_deg", m.part_gamma_deg());
  attributes.Real("offset_y_mm", RoundedMillimetres(m.offset_y_m()));
  attributes.Real("offset_z_mm", RoundedMillimetres(m.offset_z_m()));
  attributes.Real("stage_start_mm", RoundedMillimetres(scan.stage_start_m()));
  attributes.Real("stage_end_mm", RoundedMillimetres(scan.stage_end_m()));
  attributes.Integer("frames_count", scan.trigger_positions_m_size());
  attributes.Text("camera_pose_m", MatrixText(scan.camera_pose()));
  attributes.Text("laser_pose_m", MatrixText(scan.laser_pose()));
  attributes.Text("part_pose_m", MatrixText(scan.part_pose()));
  attributes.Write(xml);
  xml.Leaf("TextInstruction",
           absl::StrFormat("Scan %d: laser line triangulation on a linear stage from %.3f mm to "
                           "%.3f mm, %d frames; camera %.3f mm from the part's centre, "
                           "triangulation angle %.3f deg. Poses (row-major 4 x 4): camera and "
                           "laser x_cad = M x_sensor at the start, part x_world = M x_cad with "
                           "the stage at 0.",
                           scan.index(), 1e3 * scan.stage_start_m(), 1e3 * scan.stage_end_m(),
                           scan.trigger_positions_m_size(), 1e3 * m.camera_distance_m(),
                           m.triangulation_angle_deg()));
  xml.Close();
}

void WriteIds(absl::string_view name, const std::vector<int64_t>& ids, XmlWriter& xml) {
  xml.OpenList(name, ids.size());
  for (const int64_t id : ids) xml.Leaf("Id", id);
  xml.Close();
}

void WriteDocumentAttributes(const v1::Plan& plan, const std::string& part_name, XmlWriter& xml) {
  Attributes attributes;
  attributes.Text("inspection", plan.inspection_name());
  attributes.Text("part", part_name);
  attributes.Text("part_digest_sha256", plan.part_digest());
  attributes.Text("scene_digest_sha256", plan.scene_digest());
  attributes.Text("sightline_version", plan.sightline_version());
  attributes.Text("strategy", plan.strategy());
  attributes.Integer("seed", plan.seed());
  attributes.Integer("scans_count", plan.scans_size());
  attributes.Real("coverage_fraction", plan.coverage().coverage());
  if (plan.coverage().has_fresh_coverage())
    attributes.Real("fresh_coverage_fraction", plan.coverage().fresh_coverage());
  if (plan.has_uncertainty()) {
    const v1::PlanUncertainty& uncertainty = plan.uncertainty();
    attributes.Integer("judged_targets_count", uncertainty.judged_targets());
    attributes.Real("admissible_fraction", uncertainty.admissible_fraction());
    attributes.Real("relaxed_fraction", uncertainty.relaxed_fraction());
    if (uncertainty.has_fresh_admissible_fraction())
      attributes.Real("fresh_admissible_fraction", uncertainty.fresh_admissible_fraction());
    attributes.Real("goal_admissible_fraction", uncertainty.goal());
    attributes.Real("relaxed_uncertainty_mm",
                    RoundedMillimetres(uncertainty.relaxed_uncertainty_m()));
    if (uncertainty.has_tolerances()) {
      attributes.Integer("tolerances_read_count", uncertainty.tolerances().read());
      attributes.Integer("tolerances_evaluated_count", uncertainty.tolerances().evaluated());
      attributes.Integer("tolerances_proven_count", uncertainty.tolerances().proven());
    }
    attributes.Real("median_uncertainty_mm",
                    RoundedMillimetres(uncertainty.median_uncertainty_m()));
  }
  attributes.Write(xml);
}

const char* StatusName(v1::InspectedFeature::Decision decision) {
  switch (decision) {
    case v1::InspectedFeature::CONFORMS:
      return "PASS";
    case v1::InspectedFeature::DOES_NOT_CONFORM:
      return "FAIL";
    case v1::InspectedFeature::UNDECIDED:
      return "INDETERMINATE";
    default:
      return "NOT_ANALYZED";
  }
}

void WriteMeasurement(const Characteristic& c, const v1::InspectedFeature& feature, int64_t id,
                      XmlWriter& xml) {
  xml.OpenWithId(c.kind.name + "CharacteristicMeasurement", id);
  Attributes attributes;
  attributes.Text("decision", v1::InspectedFeature::Decision_Name(feature.decision()));
  if (feature.has_expanded_uncertainty_m()) {
    attributes.Real("expanded_uncertainty_mm",
                    RoundedMillimetres(feature.expanded_uncertainty_m()));
  }
  attributes.Integer("measured_targets_count", feature.measured_targets());
  attributes.Write(xml);
  if (!feature.because().empty()) xml.Leaf("Description", feature.because());
  xml.Open("Status");
  xml.Leaf("CharacteristicStatusEnum", StatusName(feature.decision()));
  xml.Close();
  xml.Leaf("CharacteristicItemId", c.item);
  if (feature.has_value_m() && IsWritable(feature.value_m())) {
    const std::string value = MillimetreText(feature.value_m());
    if (c.kind.form == Form::kOther) {
      xml.Leaf("Value", value + " mm");
    } else {
      const double u_m = 0.5 * feature.expanded_uncertainty_m();
      xml.LeafWith(
          "Value",
          IsWritable(u_m) ? absl::StrCat("combinedUncertainty=\"", MillimetreText(u_m), "\"") : "",
          value);
    }
  }
  if (c.kind.name == "SurfaceProfile" && feature.has_largest_deviation_m() &&
      IsWritable(feature.largest_deviation_m()) && IsWritable(feature.smallest_deviation_m())) {
    xml.Leaf("WorstPositiveDeviation", MillimetreText(feature.largest_deviation_m()));
    xml.Leaf("WorstNegativeDeviation", MillimetreText(feature.smallest_deviation_m()));
  }
  xml.Close();
}

// FAIL if a characteristic does not conform, PASS if all conform.
const char* WholeStatus(const v1::InspectionResult& measured) {
  bool all_pass = true;
  for (const v1::InspectedFeature& feature : measured.features()) {
    if (feature.decision() == v1::InspectedFeature::DOES_NOT_CONFORM) return "FAIL";
    all_pass = all_pass && feature.decision() == v1::InspectedFeature::CONFORMS;
  }
  return all_pass ? "PASS" : "UNKNOWN";
}

// The results have the id `first_id`, their measurements those that follow. They name the plan by
// its persistent id.
void WriteResults(const std::vector<Characteristic>& characteristics,
                  const v1::InspectionResult& measured, int64_t first_id,
                  const std::string& plan_id, XmlWriter& xml) {
  XmlWriter values;
  for (size_t i = 0; i < characteristics.size(); ++i) {
    WriteMeasurement(characteristics[i], measured.features(static_cast<int>(i)),
                     first_id + 1 + static_cast<int64_t>(i), values);
  }
  const std::string measurements = values.Take();
  xml.Open("Results");
  xml.OpenList("MeasurementResultsSet", 1);
  xml.OpenWithId("MeasurementResults", first_id);
  if (!plan_id.empty()) {
    xml.Open("InspectionTraceability");
    xml.Open("ReferencedQIFPlanInstance");
    xml.Leaf("ItemQPId", plan_id);
    xml.Close();
    xml.Close();
  }
  xml.Leaf("ThisResultsInstanceQPId", QpidOf(plan_id + measurements));
  xml.Open("MeasuredCharacteristics");
  xml.OpenList("CharacteristicMeasurements", characteristics.size());
  xml.Append(measurements);
  xml.Close();
  xml.Close();
  xml.Open("InspectionStatus");
  xml.Leaf("InspectionStatusEnum", WholeStatus(measured));
  xml.Close();
  xml.Close();
  xml.Close();
  xml.Close();
}

void WriteUnits(XmlWriter& xml) {
  xml.Open("FileUnits");
  xml.Open("PrimaryUnits");
  for (const auto& [element, si, name, factor] :
       {std::array{"AngularUnit", "radian", "degree", "0.017453292519943295"},
        std::array{"LinearUnit", "meter", "mm", "0.001"}}) {
    xml.Open(element);
    xml.Leaf("SIUnitName", si);
    xml.Leaf("UnitName", name);
    xml.Open("UnitConversion");
    xml.Leaf("Factor", factor);
    xml.Close();
    xml.Close();
  }
  xml.Close();
  xml.Close();
}

}  // namespace

absl::StatusOr<std::string> QifDocument(const v1::Plan& plan, const std::string& part_name,
                                        std::span<const Tolerance> tolerances,
                                        const v1::InspectionResult* measured) {
  const auto& verdicts = plan.uncertainty().features();
  if (plan.scans().empty() && verdicts.empty()) {
    return absl::InvalidArgumentError(
        "QIF export: the plan has no scans and no features; one of them is needed");
  }
  int64_t last_id = 0;
  std::vector<QifFeature> features;
  std::vector<Characteristic> characteristics;
  CharacteristicIds ids(plan);
  for (const v1::FeatureVerdict& verdict : verdicts) {
    QifFeature feature;
    feature.name = NameOf(verdict);
    for (int64_t* id : {&feature.definition, &feature.nominal, &feature.item}) *id = ++last_id;
    Characteristic c;
    c.feature = &verdict;
    const auto found =
        std::find_if(tolerances.begin(), tolerances.end(), [&](const Tolerance& tolerance) {
          return !tolerance.id.empty() && tolerance.id == verdict.id();
        });
    if (found != tolerances.end()) c.tolerance = &*found;
    c.kind = KindOf(verdict, c.tolerance);
    c.persistent_id = ids.Next(verdict, c.tolerance);
    feature.persistent_id = QpidOf("feature\n" + c.persistent_id);
    c.feature_item = feature.item;
    for (int64_t* id : {&c.definition, &c.nominal, &c.item}) *id = ++last_id;
    features.push_back(std::move(feature));
    characteristics.push_back(c);
  }
  if (features.empty()) {
    features.push_back({"measurable surface of the part", last_id + 1, last_id + 2, last_id + 3,
                        QpidOf("surface\n" + plan.part_digest())});
    last_id += 3;
  }
  const int64_t standard = characteristics.empty() ? 0 : ++last_id;
  std::vector<int64_t> instructions, methods, feature_items, characteristic_items;
  for (int i = 0; i < plan.scans_size(); ++i) {
    instructions.push_back(++last_id);
    methods.push_back(++last_id);
  }
  if (measured != nullptr && measured->features_size() != verdicts.size()) {
    return absl::InvalidArgumentError(absl::StrCat("QIF export: ", measured->features_size(),
                                                   " measured features for ", verdicts.size(),
                                                   " of the plan"));
  }
  const int64_t results = last_id + 1;
  const bool with_results = measured != nullptr && !characteristics.empty();
  if (with_results) last_id += 1 + static_cast<int64_t>(characteristics.size());
  for (const QifFeature& feature : features) feature_items.push_back(feature.item);
  for (const Characteristic& c : characteristics) characteristic_items.push_back(c.item);

  XmlWriter scan_writer;
  for (int i = 0; i < plan.scans_size(); ++i)
    WriteScan(plan.scans(i), instructions[i], scan_writer);
  const std::string scans = scan_writer.Take();
  // The same scans of the same part are the same plan.
  const std::string plan_id =
      scans.empty() ? "" : QpidOf(absl::StrCat("plan\n", plan.part_digest(), "\n", scans));

  // All but the frame and the document's own identifier, which depends on it.
  XmlWriter xml;
  WriteDocumentAttributes(plan, part_name, xml);
  xml.Open("Header");
  xml.Open("Application");
  xml.Leaf("Name", "Sightline");
  xml.Close();
  xml.Close();
  if (!characteristics.empty()) WriteStandard(standard, xml);
  WriteUnits(xml);
  WriteFeatures(features, xml);
  if (!characteristics.empty()) WriteCharacteristics(characteristics, standard, xml);
  if (!plan.scans().empty()) {
    xml.Open("Plan");
    xml.Open("Version");
    xml.Leaf("ThisInstanceQPId", plan_id);
    xml.Close();
    xml.OpenList("WorkInstructions", instructions.size());
    xml.Append(scans);
    xml.Close();
    xml.OpenList("ActionMethods", methods.size());
    for (size_t i = 0; i < methods.size(); ++i) {
      xml.OpenWithId("OtherMeasureFeatureMethod", methods[i]);
      WriteIds("WorkInstructionIds", {instructions[i]}, xml);
      Attributes attributes;
      attributes.Text("method", "laser line triangulation");
      attributes.Write(xml);
      xml.Close();
    }
    xml.Close();
    xml.Open("OrderedPlanRoot");
    xml.OpenList("Steps", methods.size() + (characteristics.empty() ? 0 : 1));
    int64_t number = 0;
    for (const int64_t method : methods) {
      xml.Open("NumberedPlanElement");
      xml.Leaf("SequenceNumber", ++number);
      xml.Open("MeasureSpecifiedFeatures");
      xml.Leaf("PreferredActionMethodId", method);
      WriteIds("FeatureItemIds", feature_items, xml);
      xml.Close();
      xml.Close();
    }
    if (!characteristics.empty()) {
      xml.Open("NumberedPlanElement");
      xml.Leaf("SequenceNumber", ++number);
      xml.Open("EvaluateSpecifiedCharacteristics");
      WriteIds("CharacteristicItemIds", characteristic_items, xml);
      xml.Close();
      xml.Close();
    }
    xml.Close();
    xml.Close();
    xml.Close();
  }
  if (with_results) WriteResults(characteristics, *measured, results, plan_id, xml);
  const std::string body = xml.Take();
  return absl::StrCat(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<QIFDocument xmlns=\"http://qifstandards.org/xsd/qif3\" "
      "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
      "xsi:schemaLocation=\"http://qifstandards.org/xsd/qif3 QIFApplications/QIFDocument.xsd\" "
      "idMax=\"",
      last_id, "\" versionQIF=\"3.0.0\">\n<QPId>", QpidOf(body), "</QPId>\n", body,
      "</QIFDocument>\n");
}

}  // namespace sightline
