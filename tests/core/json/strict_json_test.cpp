// SPDX-License-Identifier: Apache-2.0
#include "core/json/strict_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <random>
#include <thread>

#include "absl/strings/str_cat.h"
#include "core/file/atomic_write.h"
#include "core/text/number_text.h"
#include "core/text/printable.h"
#include "google/protobuf/util/message_differencer.h"
#include "sightline/v1/inspection.pb.h"
#include "sightline/v1/plan.pb.h"
#include "tests/limits/same_hash.h"
#include "tests/limits/within_limits.h"

namespace sightline {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::string ParseErrorOf(const std::string& json) {
  v1::Inspection message;
  const absl::Status status = ParseStrictJson(json, "bracket.json", &message);
  EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << json;
  return std::string(status.message());
}

TEST(StrictJson, ReadsAFullMessage) {
  v1::Inspection message;
  ASSERT_TRUE(ParseStrictJson(R"({
    "name": "bracket",
    "part": {"file": "a.stl", "unit": "mm"},
    "camera": {"columns_px": 640, "vertical_fov_deg": 30},
    "targets": {"seed": 9007199254740993, "regions": [{"name": "bore", "min_m": {"x": -1e-3}}]},
    "obstacles": [{"frame": "FRAME_STAGE"}],
    "measurement": {"part_beta_deg": {"values": [0, 90.5]}}
  })",
                              "bracket.json", &message)
                  .ok());
  EXPECT_EQ(message.part().unit(), "mm");
  EXPECT_EQ(message.camera().columns_px(), 640);
  EXPECT_EQ(message.targets().seed(), 9007199254740993);
  EXPECT_EQ(message.targets().regions(0).min_m().x(), -1e-3);
  EXPECT_EQ(message.obstacles(0).frame(), v1::Obstacle::FRAME_STAGE);
  EXPECT_EQ(message.measurement().part_beta_deg().values(1), 90.5);
}

TEST(StrictJson, ByteOrderMarksAndEndMarks) {
  const std::string text = R"({"name": "bracket"})";
  for (const std::string& good : {"\xef\xbb\xbf" + text, text + "\r\n\x1a",
                                  text + std::string(3, '\0'), "\xef\xbb\xbf// comment\n" + text}) {
    v1::Inspection message;
    EXPECT_TRUE(ParseStrictJson(good, "bracket.json", &message).ok());
    EXPECT_EQ(message.name(), "bracket");
  }
  EXPECT_THAT(ParseErrorOf(std::string("\xff\xfe{\0}\0", 6)),
              AllOf(HasSubstr("bracket.json"), HasSubstr("byte order mark of UTF-16")));
  // The parser would take NUL for the end and drop what is behind it.
  EXPECT_THAT(ParseErrorOf(text + std::string("\0{}", 3)),
              AllOf(HasSubstr("column 20"), HasSubstr("NUL byte")));
}

TEST(StrictJson, MapsKeepTheirKeysAndComeBackSorted) {
  v1::Inspection message;
  ASSERT_TRUE(ParseStrictJson(R"({"effects": [{"effect": "optics.coma", "parameters":
                                 {"w131_waves": 0.5, "a": -1}}]})",
                              "bracket.json", &message)
                  .ok());
  ASSERT_EQ(message.effects(0).parameters_size(), 2);
  EXPECT_EQ(message.effects(0).parameters().at("w131_waves"), 0.5);
  const std::string text = ToJson(message);
  EXPECT_LT(text.find("\"a\": -1"), text.find("\"w131_waves\": 0.5"));
  v1::Inspection again;
  ASSERT_TRUE(ParseStrictJson(text, "again.json", &again).ok());
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(message, again));
  EXPECT_THAT(ParseErrorOf(R"({"effects": [{"parameters": {"a": 1, "a": 2}}]})"),
              AllOf(HasSubstr("effects[0].parameters.a"), HasSubstr("twice")));
  EXPECT_THAT(ParseErrorOf(R"({"effects": [{"parameters": {"a": "x"}}]})"),
              HasSubstr("effects[0].parameters.a"));
  EXPECT_THAT(ParseErrorOf(R"({"effects": [{"parameters": [1]}]})"),
              HasSubstr("effects[0].parameters"));
}

TEST(StrictJson, ReplacesWhatTheMessageHeld) {
  v1::Inspection message;
  message.set_name("old");
  ASSERT_TRUE(ParseStrictJson("{}", "f", &message).ok());
  EXPECT_EQ(message.name(), "");
}

TEST(StrictJson, UnknownFieldNamesFilePathAndNearest) {
  EXPECT_THAT(
      ParseErrorOf(R"({"rig": {"scan_stp_m": 1}})"),
      AllOf(HasSubstr("bracket.json"), HasSubstr("rig.scan_stp_m"), HasSubstr("\"scan_step_m\"")));
  EXPECT_THAT(ParseErrorOf(R"({"obstacles": [{}, {}, {"fraem": "x"}]})"),
              AllOf(HasSubstr("obstacles[2].fraem"), HasSubstr("\"frame\"")));
  // Only the original names: camelCase of proto3 JSON would be a second spelling of every file.
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scanStepM": 1}})"), HasSubstr("\"scan_step_m\""));
}

TEST(StrictJson, WrongTypesNamePathAndWhatIsExpected) {
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scan_step_m": "1"}})"),
              AllOf(HasSubstr("rig.scan_step_m"), HasSubstr("\"1\""), HasSubstr("number")));
  EXPECT_THAT(ParseErrorOf(R"({"rig": 3})"), AllOf(HasSubstr("rig: is 3"), HasSubstr("an object")));
  EXPECT_THAT(ParseErrorOf(R"({"name": true})"), HasSubstr("a string"));
  EXPECT_THAT(ParseErrorOf(R"({"obstacles": {}})"), HasSubstr("an array"));
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"camera_bodies": [5]}})"),
              HasSubstr("rig.camera_bodies[0]"));
  EXPECT_THAT(ParseErrorOf(R"({"name": null})"), HasSubstr("leave the field out"));
  EXPECT_THAT(ParseErrorOf("[]"), HasSubstr("an object"));
}

TEST(StrictJson, PassesOverLineComments) {
  v1::Inspection message;
  ASSERT_TRUE(ParseStrictJson("// An inspection.\n"
                              "{ // of a part\n"
                              "  \"name\": \"a // no \\\" comment\",\n"
                              "  // \"name\": \"b\",\n"
                              "  \"goal\": {\"coverage\": 0.5} //}\n"
                              "}\n//",
                              "bracket.json", &message)
                  .ok());
  EXPECT_EQ(message.name(), "a // no \" comment");
  EXPECT_EQ(message.goal().coverage(), 0.5);
  // Lines and columns are those of the file.
  EXPECT_THAT(ParseErrorOf("{ // a\n  // b\n  \"name\" 3\n}"), HasSubstr("line 3, column 10"));
  // No other comments.
  EXPECT_THAT(ParseErrorOf("{ /* a */ }"), HasSubstr("line 1"));
  EXPECT_THAT(ParseErrorOf("{ # a\n }"), HasSubstr("line 1"));
  EXPECT_THAT(ParseErrorOf("{ \"name\": \"a\" / }"), HasSubstr("line 1"));
}

TEST(StrictJson, SaysAllThatIsWrongAtOnce) {
  const std::string error =
      ParseErrorOf(R"({"nam": "a", "rig": {"scan_step_m": "1", "stage_trvel_m": 1},
                                       "obstacles": [{"frame": "FRAME_PRT"}, 7]})");
  EXPECT_THAT(error, AllOf(HasSubstr("bracket.json: nam: unknown field"),
                           HasSubstr("\nbracket.json: rig.scan_step_m: is \"1\""),
                           HasSubstr("\nbracket.json: rig.stage_trvel_m: unknown field"),
                           HasSubstr("\nbracket.json: obstacles[0].frame: unknown value"),
                           HasSubstr("\nbracket.json: obstacles[1]: is 7")));
  EXPECT_EQ(std::count(error.begin(), error.end(), '\n'), 4);
  // Up to a number, so that a file that is all wrong is not read for ever.
  std::string many = "{\"goal\": {";
  for (int i = 0; i < 100000; ++i) many += (i ? ", \"x" : "\"x") + std::to_string(i) + "\": 1";
  const std::string all = ParseErrorOf(many + "}}");
  EXPECT_EQ(std::count(all.begin(), all.end(), '\n'), 20);
  EXPECT_THAT(all, HasSubstr("\n... there may be more"));
}

TEST(StrictJson, ANumberInPlaceOfADomainIsToldHowToBeFixed) {
  EXPECT_THAT(ParseErrorOf(R"({"measurement": {"camera_distance_m": 0.4}})"),
              HasSubstr("measurement.camera_distance_m: is 0.4, must be an object: write "
                        "{\"fixed\": 0.4}"));
  EXPECT_THAT(ParseErrorOf(R"({"measurement": {"camera_distance_m": [0.4, 0.5]}})"),
              HasSubstr("{\"values\": [...]}"));
}

TEST(StrictJson, IntegersAreIntegersInRange) {
  EXPECT_THAT(ParseErrorOf(R"({"camera": {"rows_px": 512.5}})"),
              AllOf(HasSubstr("camera.rows_px"), HasSubstr("512.5"), HasSubstr("integer")));
  EXPECT_THAT(ParseErrorOf(R"({"camera": {"rows_px": 2147483648}})"), HasSubstr("2147483647"));
  EXPECT_THAT(ParseErrorOf(R"({"camera": {"rows_px": -2147483649}})"), HasSubstr("-2147483648"));
  EXPECT_THAT(ParseErrorOf(R"({"targets": {"seed": 9223372036854775808}})"),
              HasSubstr("targets.seed"));
  EXPECT_THAT(ParseErrorOf(R"({"targets": {"seed": 1e300}})"), HasSubstr("targets.seed"));
  v1::Inspection message;
  EXPECT_TRUE(ParseStrictJson(R"({"camera": {"rows_px": 512.0}})", "f", &message).ok());
  EXPECT_EQ(message.camera().rows_px(), 512);
  EXPECT_TRUE(
      ParseStrictJson(R"({"targets": {"seed": -9223372036854775808}})", "f", &message).ok());
  EXPECT_EQ(message.targets().seed(), std::numeric_limits<int64_t>::min());
}

TEST(StrictJson, NumbersAreFinite) {
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scan_step_m": "NaN"}})"), HasSubstr("a finite number"));
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scan_step_m": "Infinity"}})"),
              HasSubstr("a finite number"));
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scan_step_m": NaN}})"), HasSubstr("line 1"));
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scan_step_m": 1e999}})"), HasSubstr("1e999"));
}

TEST(StrictJson, UnknownEnumValueNamesTheNearest) {
  EXPECT_THAT(ParseErrorOf(R"({"obstacles": [{"frame": "FRAME_PRAT"}]})"),
              AllOf(HasSubstr("obstacles[0].frame"), HasSubstr("\"FRAME_PRAT\""),
                    HasSubstr("nearest known name is \"FRAME_PART\"")));
  EXPECT_THAT(ParseErrorOf(R"({"obstacles": [{"frame": 1}]})"), HasSubstr("FRAME_STAGE"));
}

TEST(StrictJson, FieldGivenTwiceIsAnError) {
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"scan_step_m": 1, "scan_step_m": 2}})"),
              AllOf(HasSubstr("rig.scan_step_m"), HasSubstr("twice")));
}

TEST(StrictJson, TwoShapesOfOneBodyAreAnError) {
  EXPECT_THAT(ParseErrorOf(R"({"rig": {"laser_bodies": [{"box": {}, "cylinder": {}}]}})"),
              AllOf(HasSubstr("rig.laser_bodies[0].cylinder"), HasSubstr("box")));
}

TEST(StrictJson, SyntaxErrorNamesLineAndColumn) {
  EXPECT_THAT(ParseErrorOf("{\n  \"name\": \"a\",\n  \"rig\" 3\n}"),
              AllOf(HasSubstr("bracket.json"), HasSubstr("line 3, column 9")));
  EXPECT_THAT(ParseErrorOf("{\"name\": \"a\""), HasSubstr("line 1, column 13"));
  EXPECT_THAT(ParseErrorOf(""), HasSubstr("line 1, column 1"));
  EXPECT_THAT(ParseErrorOf("{} {}"), HasSubstr("line 1"));
  EXPECT_THAT(ParseErrorOf(std::string("{\"name\": \"\xff\xfe\"}")), HasSubstr("line 1"));
}

TEST(StrictJson, DeepNestingIsRefusedNotFatal) {
  std::string deep;
  for (int i = 0; i < 200000; ++i) deep += "[";
  EXPECT_THAT(ParseErrorOf(deep), HasSubstr("nested"));
}

TEST(StrictJson, NoPrefixOfAFileIsAccepted) {
  const std::string json = R"({"part": {"file": "a.stl", "unit": "mm"}, "targets": {"seed": 12}})";
  for (size_t length = 0; length < json.size(); ++length) {
    v1::Inspection message;
    EXPECT_FALSE(ParseStrictJson(json.substr(0, length), "f", &message).ok()) << length;
  }
}

TEST(StrictJson, WritesStableReadableText) {
  v1::Inspection message;
  message.set_name("a \"b\"\n");
  message.mutable_rig()->set_scan_step_m(0.001);
  message.mutable_targets()->set_seed(9007199254740993);
  message.mutable_measurement()->mutable_part_beta_deg()->add_values(0);
  message.mutable_measurement()->mutable_part_beta_deg()->add_values(0.1);
  message.add_obstacles()->set_frame(v1::Obstacle::FRAME_WORLD);
  message.add_obstacles();
  EXPECT_EQ(ToJson(message), R"({
  "name": "a \"b\"\n",
  "rig": {
    "scan_step_m": 0.001
  },
  "targets": {
    "seed": 9007199254740993
  },
  "measurement": {
    "part_beta_deg": {
      "values": [0, 0.1]
    }
  },
  "obstacles": [
    {
      "frame": "FRAME_WORLD"
    },
    {}
  ]
}
)");
  EXPECT_EQ(ToJson(v1::Inspection()), "{}\n");
}

TEST(StrictJson, EveryDoubleSurvivesTheRoundTrip) {
  std::mt19937_64 random(3);
  v1::PlannedScan scan;
  for (double value : {0.0, -0.0, 1.0, -1.5, 1e300, 5e-324, 1.0 / 3, 123456789012345680.0,
                       std::numeric_limits<double>::max(), std::numeric_limits<double>::min()}) {
    scan.add_trigger_positions_m(value);
  }
  while (scan.trigger_positions_m_size() < 5000) {
    const double value = std::bit_cast<double>(random());
    if (std::isfinite(value)) scan.add_trigger_positions_m(value);
  }
  const std::string json = ToJson(scan);
  v1::PlannedScan back;
  const absl::Status status = ParseStrictJson(json, "f", &back);
  ASSERT_TRUE(status.ok()) << status;
  ASSERT_EQ(back.trigger_positions_m_size(), scan.trigger_positions_m_size());
  for (int i = 0; i < scan.trigger_positions_m_size(); ++i) {
    EXPECT_EQ(std::bit_cast<uint64_t>(back.trigger_positions_m(i)),
              std::bit_cast<uint64_t>(scan.trigger_positions_m(i)))
        << scan.trigger_positions_m(i);
  }
  EXPECT_EQ(ToJson(back), json);
}

TEST(NumberText, IsShortAndReadable) {
  EXPECT_EQ(NumberText(0.0001), "0.0001");
  EXPECT_EQ(NumberText(0.1), "0.1");
  EXPECT_EQ(NumberText(-100000), "-100000");
  EXPECT_EQ(NumberText(1e-9), "1e-09");
  EXPECT_EQ(NumberText(1e300), "1e+300");
  EXPECT_EQ(NumberText(1.0 / 3), "0.3333333333333333");
}

class StrictJsonFileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::path(::testing::TempDir()) /
              ("strict_json_" + std::to_string(std::random_device()()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::filesystem::path folder_;
};

TEST_F(StrictJsonFileTest, WritesAndReadsBack) {
  v1::Inspection message, back;
  message.set_name("über");
  const std::string path = (folder_ / "a.json").string();
  ASSERT_TRUE(WriteFileAtomically(path, ToJson(message)).ok());
  ASSERT_TRUE(WriteFileAtomically(path, ToJson(message)).ok());  // over an old file
  ASSERT_TRUE(ReadStrictJsonFile(path, &back).ok());
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(message, back));
}

TEST_F(StrictJsonFileTest, MissingFileOrFolderIsNotFound) {
  v1::Inspection message;
  const std::string path = (folder_ / "none" / "a.json").string();
  const absl::Status status = ReadStrictJsonFile(path, &message);
  EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
  EXPECT_THAT(std::string(status.message()), HasSubstr(path));
  EXPECT_EQ(WriteFileAtomically(path, "x").code(), absl::StatusCode::kNotFound);
}

TEST_F(StrictJsonFileTest, ReadersNeverSeeHalfAFile) {
  const std::string path = (folder_ / "a.json").string();
  const std::string a(1 << 20, 'a'), b(1 << 20, 'b');
  ASSERT_TRUE(WriteFileAtomically(path, a).ok());
  std::atomic<bool> done{false};
  std::thread writer([&] {
    for (int i = 0; i < 20; ++i) EXPECT_TRUE(WriteFileAtomically(path, i % 2 ? a : b).ok());
    done = true;
  });
  int reads = 0;
  while (!done) {
    std::ifstream stream(path, std::ios::binary);
    const std::string seen((std::istreambuf_iterator<char>(stream)), {});
    EXPECT_TRUE(seen == a || seen == b) << seen.size();
    ++reads;
  }
  writer.join();
  EXPECT_GT(reads, 0);
  // Nothing is left lying about.
  int files = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder_)) ++files;
  EXPECT_EQ(files, 1);
}

// --- made to be expensive or misleading ---------------------------------------------------------

TEST(StrictJson, KeysWithTheSameHashTakeNoTime) {
  const auto effect = [](const std::vector<std::string>& keys) {
    std::string parameters;
    for (const std::string& key : keys) {
      // The digits keep the text within what a text of its size may take in memory.
      absl::StrAppend(&parameters, parameters.empty() ? "\"" : ", \"", key, "\": 1.00000000000000");
    }
    return absl::StrCat(R"({"effect": "optics.coma", "parameters": {)", parameters, "}}");
  };
  const std::vector<std::string> keys = SameHash(101);
  ASSERT_EQ(std::hash<std::string>()(keys.front()), std::hash<std::string>()(keys.back()));
  EXPECT_EQ(WithinLimits(
                {.cpu_time_s = 2},
                [&] { return ParseErrorOf(absl::StrCat(R"({"effects": [)", effect(keys), "]}")); }),
            "bracket.json: effects[0].parameters: has 101 entries, must have at most 100");

  const std::string full = effect({keys.begin(), keys.begin() + 100});
  std::string effects = full;
  for (int i = 1; i < 4'000; ++i) absl::StrAppend(&effects, ", ", full);
  EXPECT_EQ(WithinLimits({.cpu_time_s = 10},
                         [&] {
                           v1::Inspection message;
                           const absl::Status status = ParseStrictJson(
                               absl::StrCat(R"({"effects": [)", effects, "]}"), "a.json", &message);
                           return absl::StrCat(status.ToString(), " ", message.effects_size());
                         }),
            "OK 4000");
}

TEST(StrictJson, ValuesAreCounted) {
  std::string zeros = "0";
  for (int i = 0; i < 40'000'000; ++i) zeros += ",0";
  const std::string json = absl::StrCat(R"({"rig": [)", zeros, "]}");
  EXPECT_EQ(WithinLimits({.cpu_time_s = 5, .memory_bytes = int64_t{800} << 20},
                         [&] { return ParseErrorOf(json); }),
            "bracket.json: has more than 2000000 values");
}

// Texts of 4 MiB that repeat what makes most of a byte; a further one joins with a line.
std::vector<std::string> DenseTexts() {
  const auto repeat = [](absl::string_view begin, absl::string_view item, absl::string_view end) {
    // Fewer than the most values that a text may have.
    const size_t count = std::min<size_t>((size_t{4} << 20) / item.size(), 600'000);
    std::string text(begin);
    for (size_t i = 0; i < count; ++i) absl::StrAppend(&text, i == 0 ? "" : ",", item);
    return absl::StrCat(text, end);
  };
  const std::string x(4 << 20, 'x');
  return {repeat(R"({"obstacles": [)", "{}", "]}"),
          repeat(R"({"obstacles": [)", R"({"frame":"FRAME_PART"})", "]}"),
          repeat(R"({"effects": [)", "{}", "]}"),
          repeat(R"({"effects": [)", R"({"parameters":{"a":1,"b":2}})", "]}"),
          repeat(R"({"measurement": {"part_beta_deg": {"values": [)", "1", "]}}}"),
          repeat(R"({"measurement": {"part_beta_deg": {"values": [)", "0.12345", "]}}}"),
          repeat("{", R"("x":1)", "}"),
          repeat(R"({"name": [)", "[]", "]}"),
          repeat("{", R"("name":null)", "}"),
          absl::StrCat(R"({"name": ")", x, "\"}"),
          absl::StrCat(R"({")", x, R"(": 1})"),
          absl::StrCat(R"({"name": ")", x)};
}

TEST(StrictJson, TakesNoMoreThanSomeTenBytesOfMemoryAByte) {
  for (const std::string& json : DenseTexts()) {
    SCOPED_TRACE(json.substr(0, 60));
    const auto text_bytes = static_cast<int64_t>(json.size());
    const std::string outcome =
        WithinLimits({.cpu_time_s = 10, .memory_bytes = 13 * text_bytes + (int64_t{8} << 20)}, [&] {
          v1::Inspection message;
          const absl::Status status = ParseStrictJson(json, "a.json", &message);
          if (!status.ok()) return std::string(status.message().substr(0, 1000));
          return message.SpaceUsedLong() <= MostMessageBytes(json.size())
                     ? std::string("as large as announced")
                     : absl::StrCat(message.SpaceUsedLong(), " bytes");
        });
    EXPECT_THAT(outcome, testing::AnyOf("as large as announced", testing::StartsWith("a.json: ")));
  }
}

TEST(StrictJson, TextsWithMuchToSayAreNotRefused) {
  // The densest text that ToJson makes of such messages is far from the limit.
  v1::Inspection message;
  for (int i = 0; i < 20'000; ++i) {
    message.add_obstacles()->set_frame(v1::Obstacle::FRAME_PART);
    message.mutable_measurement()->mutable_part_beta_deg()->add_values(i % 10);
    (*message.add_effects()->mutable_parameters())["w131_waves"] = 0.5;
  }
  v1::Inspection back;
  const absl::Status status = ParseStrictJson(ToJson(message), "a.json", &back);
  ASSERT_TRUE(status.ok()) << status;
  EXPECT_TRUE(google::protobuf::util::MessageDifferencer::Equals(message, back));
}

TEST(StrictJson, ControlCharactersInKeysAreShownAsEscapes) {
  const std::string error = ParseErrorOf(R"({"\u001b[31mred\u0007\u009b": 1})");
  EXPECT_THAT(error, HasSubstr("\\x1b[31mred\\x07\\x9b"));
  EXPECT_THAT(ParseErrorOf(R"({"name": "a", "rig": {"\u001b]0;x\u0007": 1}})"),
              HasSubstr("rig.\\x1b]0;x\\x07: unknown field"));
  EXPECT_EQ(Printable("\x1b a\tb\nc \x7f ä \xc2\x85"), "\\x1b a\tb\nc \\x7f ä \\x85");
  // Characters that turn the writing direction, and neighbours that do not.
  EXPECT_EQ(Printable("a\u202egnp.exe \u2066b\u2069 \u200f \u061c"),
            "a\\u202egnp.exe \\u2066b\\u2069 \\u200f \\u061c");
  EXPECT_EQ(Printable("\u200d \u2029 \u202f \u2065 \u206a \u061b"),
            "\u200d \u2029 \u202f \u2065 \u206a \u061b");
  EXPECT_EQ(Printable("cut off \xe2\x80"), "cut off \xe2\x80");
}

TEST(StrictJson, FilesAreRegularAndOfBoundedSize) {
  const std::string folder = ::testing::TempDir() + absl::StrCat("json_", getpid());
  std::filesystem::create_directories(folder);
  const std::string pipe = folder + "/pipe.json", large = folder + "/large.json";
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  std::ofstream(large).put('{');
  std::filesystem::resize_file(large, uint64_t{1} << 33);
  for (const std::string& path : {pipe, large, folder, std::string("/dev/zero")}) {
    EXPECT_THAT(WithinLimits({.cpu_time_s = 2, .memory_bytes = int64_t{300} << 20},
                             [&] {
                               v1::Inspection message;
                               return ReadStrictJsonFile(path, &message).ToString();
                             }),
                testing::StartsWith("INVALID_ARGUMENT: " + path));
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sightline
