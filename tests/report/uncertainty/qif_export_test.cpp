// SPDX-License-Identifier: Apache-2.0
#include "report/uncertainty/qif_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/json/strict_json.h"
#include "core/tolerance/qif/qif_reader.h"
#include "core/tolerance/qif/qif_results.h"
#include "core/tolerance/qif/qif_xml.h"
#include "tests/report/uncertainty/sample_uncertainty.h"
#include "tests/report/well_formed.h"

namespace sightline {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::UnorderedElementsAre;

std::string Document(const v1::Plan& plan, std::span<const Tolerance> tolerances = {}) {
  const auto document = QifDocument(plan, "plate.glb", tolerances);
  EXPECT_TRUE(document.ok()) << document.status();
  return document.value_or("");
}

std::string WriteTemporary(const std::string& text) {
  std::string path = (std::filesystem::path(::testing::TempDir()) /
                      absl::StrCat("qif_export_test_", getpid(), ".qif"))
                         .string();
  EXPECT_TRUE(WriteFileAtomically(path, text).ok());
  return path;
}

// The program's own reader of QIF, which a real XML parser feeds.
ToleranceReport Read(const std::string& document) {
  const std::string path = WriteTemporary(document);
  const auto report = ReadQif(path);
  std::filesystem::remove(path);
  EXPECT_TRUE(report.ok()) << report.status();
  return report.value_or(ToleranceReport());
}

std::vector<QifMeasurementResults> ReadResults(const std::string& document) {
  const std::string path = WriteTemporary(document);
  auto results = ReadQifResults(path);
  std::filesystem::remove(path);
  EXPECT_TRUE(results.ok()) << results.status();
  return results.ok() ? *std::move(results) : std::vector<QifMeasurementResults>();
}

// Elements of a document of ours: one tag or one leaf a line.
struct Element {
  std::string name, text;
  std::map<std::string, std::string> attributes;
  std::vector<Element> children;
};

void ForEach(const Element& element, const std::function<void(const Element&)>& visit) {
  visit(element);
  for (const Element& child : element.children) ForEach(child, visit);
}

Element Tree(const std::string& document) {
  static const std::regex kTag(
      "<(/?)([A-Za-z0-9]+)((?: [A-Za-z:0-9_]+=\"[^\"<]*\")*) ?(/?)>([^<]*)");
  static const std::regex kAttribute(" ([A-Za-z:0-9_]+)=\"([^\"<]*)\"");
  Element root;
  std::vector<Element*> open = {&root};
  const std::string body = document.substr(document.find("<QIFDocument"));
  for (auto it = std::sregex_iterator(body.begin(), body.end(), kTag); it != std::sregex_iterator();
       ++it) {
    if ((*it)[1].length() > 0) {
      EXPECT_EQ(open.back()->name, (*it)[2]);
      open.pop_back();
      continue;
    }
    Element element;
    element.name = (*it)[2];
    element.text = (*it)[5];
    const std::string attributes = (*it)[3];
    for (auto a = std::sregex_iterator(attributes.begin(), attributes.end(), kAttribute);
         a != std::sregex_iterator(); ++a) {
      element.attributes[(*a)[1]] = (*a)[2];
    }
    open.back()->children.push_back(element);
    if ((*it)[4].length() == 0) open.push_back(&open.back()->children.back());
  }
  EXPECT_EQ(open.size(), 1u);
  return root.children.at(0);
}

const Element& Child(const Element& element, const std::string& name) {
  for (const Element& child : element.children) {
    if (child.name == name) return child;
  }
  ADD_FAILURE() << element.name << " has no " << name;
  return element;
}

TEST(QifExport, ReaderFindsTheTolerancesOfThePlan) {
  const ToleranceReport report = Read(Document(SampleUncertaintyPlan().plan));
  std::map<std::string, const Tolerance*> read;
  for (const Tolerance& tolerance : report.read) read[tolerance.name] = &tolerance;
  ASSERT_EQ(read.size(), 4u);
  EXPECT_EQ(read["top"]->kind, ToleranceKind::kFlatness);
  EXPECT_DOUBLE_EQ(read["top"]->zone_width_m, 100e-6);
  EXPECT_EQ(read["bore"]->kind, ToleranceKind::kPosition);
  EXPECT_DOUBLE_EQ(read["bore"]->zone_width_m, 200e-6);
  EXPECT_EQ(read["pocket"]->kind, ToleranceKind::kCylindricity);
  EXPECT_DOUBLE_EQ(read["pocket"]->zone_width_m, 50e-6);
  EXPECT_EQ(read["edge"]->kind, ToleranceKind::kParallelism);
  EXPECT_THAT(read["edge"]->features, ::testing::ElementsAre(HasSubstr("other surface edge")));
  // The size's nominal value is not in a plan: deviations without one are not read.
  ASSERT_EQ(report.not_read.size(), 1u);
  EXPECT_THAT(report.not_read[0].name, HasSubstr("rail"));
}

// Values, combined uncertainties and statuses of the measurements, by the ids of their items.
TEST(QifExport, ResultsStandBesideTheCharacteristicsOfThePlan) {
  const v1::Plan plan = SampleUncertaintyPlan().plan;
  v1::InspectionResult measured;
  using Feature = v1::InspectedFeature;
  const Feature::Decision decisions[] = {Feature::CONFORMS, Feature::DOES_NOT_CONFORM,
                                         Feature::UNDECIDED, Feature::NOT_EVALUATED};
  for (int i = 0; i < plan.uncertainty().features_size(); ++i) {
    Feature& feature = *measured.add_features();
    feature.set_decision(decisions[i % 4]);
    feature.set_because("because of <this>");
    if (feature.decision() == Feature::NOT_EVALUATED) continue;
    feature.set_value_m(1e-4 + 1e-6 * i);
    feature.set_expanded_uncertainty_m(2e-5);
  }
  const auto document = QifDocument(plan, "plate.glb", {}, &measured);
  ASSERT_TRUE(document.ok()) << document.status();
  const Element root = Tree(*document);
  // The plan's part is as without results.
  const Element bare = Tree(Document(plan));
  const Element& items = Child(Child(root, "Characteristics"), "CharacteristicItems");
  const Element& bare_items = Child(Child(bare, "Characteristics"), "CharacteristicItems");
  const Element& results =
      Child(Child(Child(root, "Results"), "MeasurementResultsSet"), "MeasurementResults");
  const Element& measurements =
      Child(Child(results, "MeasuredCharacteristics"), "CharacteristicMeasurements");
  ASSERT_EQ(measurements.children.size(), items.children.size());
  const std::map<Feature::Decision, std::string> status = {
      {Feature::CONFORMS, "PASS"},
      {Feature::DOES_NOT_CONFORM, "FAIL"},
      {Feature::UNDECIDED, "INDETERMINATE"},
      {Feature::NOT_EVALUATED, "NOT_ANALYZED"}};
  for (size_t i = 0; i < measurements.children.size(); ++i) {
    const Element& m = measurements.children[i];
    EXPECT_EQ(items.children[i].attributes.at("id"), bare_items.children[i].attributes.at("id"));
    EXPECT_EQ(Child(m, "CharacteristicItemId").text, items.children[i].attributes.at("id"));
    EXPECT_EQ(Child(Child(m, "Status"), "CharacteristicStatusEnum").text,
              status.at(decisions[i % 4]));
  }
  const Element& value = Child(measurements.children[0], "Value");
  EXPECT_EQ(value.text, "0.1");
  EXPECT_EQ(value.attributes.at("combinedUncertainty"), "0.01");
  EXPECT_EQ(Child(Child(results, "InspectionStatus"), "InspectionStatusEnum").text, "FAIL");
  measured.mutable_features()->RemoveLast();
  EXPECT_TRUE(absl::IsInvalidArgument(QifDocument(plan, "plate.glb", {}, &measured).status()));
}

TEST(QifExport, LimitsZoneShapeAndModifiersComeFromTheDrawing) {
  std::vector<Tolerance> tolerances(2);
  tolerances[0].id = "#3";
  tolerances[0].kind = ToleranceKind::kLinearSize;
  tolerances[0].zone_width_m = 300e-6;
  tolerances[0].nominal_m = 0.035;
  tolerances[0].lower_m = 0.0349;
  tolerances[0].upper_m = 0.0352;
  tolerances[0].modifiers = {"diameter"};
  tolerances[1].id = "#2";
  tolerances[1].kind = ToleranceKind::kPosition;
  tolerances[1].diameter_zone = true;
  tolerances[1].datums = {"A", "B(M)"};
  tolerances[1].modifiers = {"maximum material requirement"};
  tolerances[1].text = "position diameter 0.2 mm | A | B(M)";
  const std::string document = Document(SampleUncertaintyPlan().plan, tolerances);
  const ToleranceReport report = Read(document);
  ASSERT_EQ(report.read.size(), 5u);
  for (const Tolerance& tolerance : report.read) {
    if (tolerance.name == "rail") {
      EXPECT_EQ(tolerance.kind, ToleranceKind::kLinearSize);
      EXPECT_NEAR(tolerance.zone_width_m, 300e-6, 1e-15);
      EXPECT_DOUBLE_EQ(*tolerance.lower_m, 0.0349);
      EXPECT_DOUBLE_EQ(*tolerance.upper_m, 0.0352);
    } else if (tolerance.name == "bore") {
      EXPECT_TRUE(tolerance.diameter_zone);
      EXPECT_THAT(tolerance.modifiers, ::testing::Contains("maximum material requirement"));
    }
  }
  EXPECT_THAT(document, HasSubstr("<DiameterCharacteristicDefinition"));
  EXPECT_THAT(document, HasSubstr("name=\"datums\" value=\"A | B(M)\""));
}

// Every kind that a plan may have must come back as what it is.
TEST(QifExport, EveryKindComesBack) {
  v1::Plan plan;
  std::map<std::string, ToleranceKind> kinds;
  std::vector<Tolerance> tolerances;
  for (int k = 0; k <= static_cast<int>(ToleranceKind::kAngularDistance); ++k) {
    const auto kind = static_cast<ToleranceKind>(k);
    v1::FeatureVerdict* feature = plan.mutable_uncertainty()->add_features();
    feature->set_id(absl::StrCat("#", k));
    feature->set_name(absl::StrCat("f", k));
    feature->set_kind(ToleranceKindName(kind));
    feature->set_zone_width_m(IsAngular(kind) ? 0 : 1e-5 * (k + 1));
    kinds[feature->name()] = kind;
    Tolerance tolerance;
    tolerance.id = feature->id();
    tolerance.nominal_m = 0.01;
    tolerance.lower_m = 0.01;
    tolerance.upper_m = 0.01 + feature->zone_width_m();
    tolerances.push_back(tolerance);
  }
  const ToleranceReport report = Read(Document(plan, tolerances));
  EXPECT_EQ(report.read.size(), kinds.size() - 3);
  for (const Tolerance& tolerance : report.read) {
    EXPECT_EQ(tolerance.kind, kinds[tolerance.name]) << tolerance.name;
    EXPECT_NEAR(tolerance.zone_width_m, 1e-5 * (static_cast<int>(tolerance.kind) + 1), 1e-12);
  }
  // Angles have no zone in metres, and the plane of a line profile is not known: user-defined
  // characteristics.
  std::vector<std::string> unread;
  for (const UnreadTolerance& tolerance : report.not_read)
    unread.push_back(tolerance.name.substr(0, 3));
  EXPECT_THAT(unread, UnorderedElementsAre("f5 ", "f16", "f18"));
}

TEST(QifExport, PartsComeInTheOrderOfTheSchema) {
  const Element root = Tree(Document(SampleUncertaintyPlan().plan));
  std::vector<std::string> names;
  for (const Element& child : root.children) names.push_back(child.name);
  EXPECT_EQ(names, (std::vector<std::string>{"QPId", "Attributes", "Header", "StandardsDefinitions",
                                             "FileUnits", "Features", "Characteristics", "Plan"}));
  EXPECT_EQ(root.attributes.at("xmlns"), "http://qifstandards.org/xsd/qif3");
  EXPECT_EQ(root.attributes.at("versionQIF"), "3.0.0");
}

TEST(QifExport, CountsIdsAndReferencesAreRight) {
  const Element root = Tree(Document(SampleUncertaintyPlan().plan));
  std::map<std::string, std::string> ids;  // id, name of its element
  int64_t largest = 0;
  ForEach(root, [&](const Element& element) {
    const auto n = element.attributes.find("n");
    if (n != element.attributes.end()) {
      EXPECT_EQ(n->second, absl::StrCat(element.children.size())) << element.name;
    }
    const auto id = element.attributes.find("id");
    if (id == element.attributes.end()) return;
    EXPECT_TRUE(ids.emplace(id->second, element.name).second) << "doubled " << id->second;
    int64_t number = 0;
    ASSERT_TRUE(absl::SimpleAtoi(id->second, &number));
    largest = std::max(largest, number);
  });
  EXPECT_EQ(root.attributes.at("idMax"), absl::StrCat(largest));
  // 5 features and characteristics of three elements each, 2 scans of two, the standard.
  EXPECT_EQ(ids.size(), 5u * 6 + 2 * 2 + 1);
  const std::map<std::string, std::string> kEnds = {
      {"FormalStandardId", "Standard"},
      {"FeatureDefinitionId", "FeatureDefinition"},
      {"FeatureNominalId", "FeatureNominal"},
      {"CharacteristicDefinitionId", "CharacteristicDefinition"},
      {"CharacteristicNominalId", "CharacteristicNominal"},
      {"PreferredActionMethodId", "MeasureFeatureMethod"},
      {"FeatureItemIds", "FeatureItem"},
      {"CharacteristicItemIds", "CharacteristicItem"},
      {"WorkInstructionIds", "TextInstruction"}};
  int references = 0;
  ForEach(root, [&](const Element& element) {
    const auto end = kEnds.find(element.name);
    if (end == kEnds.end()) return;
    std::vector<std::string> targets;
    for (const Element& id : element.children) targets.push_back(id.text);
    if (targets.empty()) targets.push_back(element.text);
    for (const std::string& target : targets) {
      ++references;
      EXPECT_TRUE(absl::EndsWith(ids[target], end->second)) << element.name << " " << target;
    }
  });
  EXPECT_EQ(references, 1 + 5 * 5 + 2 * (1 + 1 + 5) + 5);
}

TEST(QifExport, StepsAreTheScansAndThenTheEvaluation) {
  const Element root = Tree(Document(SampleUncertaintyPlan().plan));
  const Element& plan = Child(root, "Plan");
  const Element& steps = Child(Child(plan, "OrderedPlanRoot"), "Steps");
  ASSERT_EQ(steps.children.size(), 3u);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(Child(steps.children[i], "SequenceNumber").text, absl::StrCat(i + 1));
    EXPECT_EQ(steps.children[i].children[1].name,
              i < 2 ? "MeasureSpecifiedFeatures" : "EvaluateSpecifiedCharacteristics");
  }
  std::map<std::string, std::string> parameters;
  for (const Element& attribute :
       Child(Child(plan, "WorkInstructions").children[1], "Attributes").children) {
    parameters[attribute.attributes.at("name")] = attribute.attributes.at("value");
  }
  EXPECT_EQ(parameters["scan"], "2");
  EXPECT_EQ(parameters["camera_distance_mm"], "300");
  EXPECT_EQ(parameters["triangulation_angle_deg"], "30");
  EXPECT_EQ(parameters["stage_start_mm"], "-11");
  EXPECT_EQ(parameters["camera_pose_m"], "1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1");
}

TEST(QifExport, PredictionsAreAttributesInMillimetres) {
  const Element root = Tree(Document(SampleUncertaintyPlan().plan));
  std::map<std::string, std::map<std::string, std::string>> items;
  for (const Element& item :
       Child(Child(root, "Characteristics"), "CharacteristicItems").children) {
    for (const Element& attribute : Child(item, "Attributes").children)
      items[Child(item, "Name").text][attribute.attributes.at("name")] =
          attribute.attributes.at("value");
  }
  EXPECT_EQ(items["bore"]["predicted_standard_uncertainty_mm"], "0.071");
  EXPECT_EQ(items["bore"]["admissible_standard_uncertainty_mm"], "0.05");
  EXPECT_EQ(items["bore"]["conformance_can_be_proven"], "false");
  EXPECT_EQ(items["bore"]["verdict"], "u exceeds the admissible 50 um");
  EXPECT_EQ(items["bore"]["assumed"], "material condition and shape of the zone");
  EXPECT_EQ(items["top"].count("assumed"), 0u);
  // Infinite: not said.
  EXPECT_EQ(items["pocket"].count("predicted_standard_uncertainty_mm"), 0u);
}

TEST(QifExport, WhatIsNotEvaluatedHasNoFigures) {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  v1::FeatureVerdict bare;
  bare.set_id("#4");
  bare.set_name("pocket");
  bare.set_verdict(v1::FeatureVerdict::NOT_EVALUATED);
  bare.set_because("not evaluated: its datum H binds no face");
  *plan.mutable_uncertainty()->mutable_features(3) = bare;
  const Element root = Tree(Document(plan));
  std::map<std::string, std::string> attributes;
  for (const Element& item :
       Child(Child(root, "Characteristics"), "CharacteristicItems").children) {
    if (Child(item, "Name").text != "pocket") continue;
    for (const Element& attribute : Child(item, "Attributes").children)
      attributes[attribute.attributes.at("name")] = attribute.attributes.at("value");
  }
  EXPECT_EQ(attributes["verdict_state"], "NOT_EVALUATED");
  EXPECT_EQ(attributes["verdict"], bare.because());
  for (const char* figure : {"predicted_standard_uncertainty_mm", "acceptance_zone_mm",
                             "probability_wrong_acceptance", "conformance_can_be_proven"}) {
    EXPECT_EQ(attributes.count(figure), 0u) << figure;
  }
}

TEST(QifExport, AnyTextAndNumberGivesAReadableDocument) {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  SetAllTexts(&plan, "<a href=\"x\">&amp;]]>'\n\t\x01\x1f\xc3\xa4 \xef\xbf\xbf");
  EXPECT_EQ(Read(Document(plan)).not_read.size(), 5u);
  // A plan holds UTF-8 only, but the name of a file may differ.
  const auto odd = QifDocument(plan, "\xff\xc0\x80\xed\xa0\x80 \xf5.glb");
  ASSERT_TRUE(odd.ok());
  EXPECT_EQ(Read(*odd).not_read.size(), 5u);
  for (const double value :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity(), 0.0,
        -1.0, 1e-300, 1e300, std::numeric_limits<double>::denorm_min()}) {
    v1::Plan numbers = SampleUncertaintyPlan().plan;
    SetAllNumbers(&numbers, value);
    const std::string document = Document(numbers);
    const ToleranceReport report = Read(document);
    EXPECT_EQ(report.read.size() + report.not_read.size(), 5u) << value;
    EXPECT_FALSE(std::regex_search(document, std::regex("value=\"-?(nan|inf)")));
  }
}

TEST(QifExport, SamePlanSameBytesAndAnotherPlanAnotherIdentifier) {
  const v1::Plan plan = SampleUncertaintyPlan().plan;
  EXPECT_EQ(Document(plan), Document(plan));
  v1::Plan other = plan;
  other.mutable_scans(0)->mutable_measurement()->set_part_alpha_deg(1e-9);
  const std::string id = Child(Tree(Document(plan)), "QPId").text;
  EXPECT_TRUE(std::regex_match(
      id, std::regex("[0-9a-f]{8}-[0-9a-f]{4}-8[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}")))
      << id;
  EXPECT_NE(id, Child(Tree(Document(other)), "QPId").text);
}

// Persistent ids of the tolerances by name.
std::map<std::string, std::string> PersistentIds(const std::string& document) {
  std::map<std::string, std::string> ids;
  for (const Tolerance& tolerance : Read(document).read)
    ids[tolerance.name] = tolerance.persistent_id;
  return ids;
}

v1::InspectionResult MeasuredAll(const v1::Plan& plan) {
  v1::InspectionResult measured;
  for (int i = 0; i < plan.uncertainty().features_size(); ++i) {
    v1::InspectedFeature& feature = *measured.add_features();
    feature.set_decision(v1::InspectedFeature::CONFORMS);
    feature.set_value_m(1e-5 * (i + 1));
    feature.set_expanded_uncertainty_m(4e-6);
  }
  return measured;
}

TEST(QifExport, ResultsComeBackToThePlansCharacteristics) {
  const v1::Plan plan = SampleUncertaintyPlan().plan;
  const std::map<std::string, std::string> planned = PersistentIds(Document(plan));
  const v1::InspectionResult measured = MeasuredAll(plan);
  const auto document = QifDocument(plan, "plate.glb", {}, &measured);
  ASSERT_TRUE(document.ok());
  EXPECT_EQ(PersistentIds(*document), planned);
  const std::vector<QifMeasurementResults> results = ReadResults(*document);
  ASSERT_EQ(results.size(), 1u);
  const Element root = Tree(Document(plan));
  EXPECT_EQ(results[0].plan_persistent_id,
            Child(Child(Child(root, "Plan"), "Version"), "ThisInstanceQPId").text);
  EXPECT_EQ(results[0].persistent_id.size(), 36u);
  ASSERT_EQ(results[0].characteristics.size(), plan.uncertainty().features_size());
  int found = 0;
  for (int i = 0; i < plan.uncertainty().features_size(); ++i) {
    const MeasuredCharacteristic& back = results[0].characteristics[i];
    EXPECT_EQ(back.name, plan.uncertainty().features(i).name());
    EXPECT_EQ(back.status, "PASS");
    const auto id = planned.find(back.name);
    if (id == planned.end()) continue;  // of a kind that is no QIF tolerance
    ++found;
    EXPECT_EQ(back.persistent_id, id->second);
    EXPECT_NEAR(back.value_m.value_or(0), 1e-5 * (i + 1), 1e-15);
    EXPECT_NEAR(back.standard_uncertainty_m.value_or(0), 2e-6, 1e-15);
  }
  EXPECT_EQ(found, planned.size());
  EXPECT_GT(found, 0);
}

TEST(QifExport, PersistentIdsFollowTheDrawingAndThePart) {
  const v1::Plan plan = SampleUncertaintyPlan().plan;
  const std::map<std::string, std::string> first = PersistentIds(Document(plan));
  std::set<std::string> different;
  for (const auto& [name, id] : first) different.insert(id);
  EXPECT_EQ(different.size(), first.size());
  // More scans and another zone: the same characteristics.
  v1::Plan longer = plan;
  *longer.add_scans() = plan.scans(0);
  longer.mutable_uncertainty()->mutable_features(0)->set_zone_width_m(9e-4);
  EXPECT_EQ(PersistentIds(Document(longer)), first);
  v1::Plan other = plan;
  other.set_part_digest("another part");
  for (const auto& [name, id] : PersistentIds(Document(other))) EXPECT_NE(id, first.at(name));
  // The drawing's own id, unless it is none.
  const v1::FeatureVerdict& feature = plan.uncertainty().features(0);
  Tolerance drawn;
  drawn.id = feature.id();
  drawn.persistent_id = "fd43400a-29bf-4ec6-b96c-e2f846eb6ff6";
  ASSERT_FALSE(drawn.id.empty());
  EXPECT_EQ(PersistentIds(Document(plan, {&drawn, 1})).at(feature.name()), drawn.persistent_id);
  drawn.persistent_id = "no uuid";
  EXPECT_EQ(PersistentIds(Document(plan, {&drawn, 1})), first);
}

TEST(QifExport, ResultsOfOthersThatAreWrongAreRefused) {
  const v1::Plan plan = SampleUncertaintyPlan().plan;
  const v1::InspectionResult measured = MeasuredAll(plan);
  const std::string document = *QifDocument(plan, "plate.glb", {}, &measured);
  const auto refused = [&](const std::string& from, const std::string& to) {
    std::string changed = document;
    const size_t at = changed.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    changed.replace(at, from.size(), to);
    const std::string path = WriteTemporary(changed);
    const auto results = ReadQifResults(path);
    std::filesystem::remove(path);
    EXPECT_EQ(results.status().code(), absl::StatusCode::kInvalidArgument) << to;
    return std::string(results.status().message());
  };
  EXPECT_THAT(refused("<CharacteristicItemId>", "<CharacteristicItemId>9"),
              HasSubstr("is no characteristic item of the file"));
  EXPECT_THAT(refused("combinedUncertainty=\"", "combinedUncertainty=\"-"),
              HasSubstr("must be >= 0"));
  EXPECT_THAT(refused("combinedUncertainty=\"", "combinedUncertainty=\"x"), HasSubstr("<Value>"));
  const std::string path = WriteTemporary(Document(plan));
  EXPECT_THAT(ReadQifResults(path).status().message(), HasSubstr("has no <Results>"));
  std::filesystem::remove(path);
}

TEST(QifExport, APlanForCoverageMeasuresTheWholeSurface) {
  v1::Plan plan = SampleUncertaintyPlan().plan;
  plan.clear_uncertainty();
  const std::string document = Document(plan);
  EXPECT_THAT(document, Not(HasSubstr("<Characteristics>")));
  EXPECT_THAT(document, Not(HasSubstr("EvaluateSpecifiedCharacteristics")));
  EXPECT_THAT(document, HasSubstr("<FeatureName>measurable surface of the part</FeatureName>"));
  EXPECT_EQ(Child(Child(Child(Tree(document), "Plan"), "OrderedPlanRoot"), "Steps").children.size(),
            2u);
  plan.clear_scans();
  EXPECT_EQ(QifDocument(plan, "plate.glb").status().code(), absl::StatusCode::kInvalidArgument);
}

}  // namespace
}  // namespace sightline
