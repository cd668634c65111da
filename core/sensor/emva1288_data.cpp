// SPDX-License-Identifier: Apache-2.0
#include "core/sensor/emva1288_data.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "absl/strings/str_split.h"
#include "core/status/status_macros.h"
#include "core/text/number.h"

namespace sightline {
namespace {

constexpr int kMostLines = 100000;
constexpr int kMostSteps = 10000, kMostImagesOfStep = 10000;
constexpr int kLeastSize_px = 8, kLargestSize_px = 65536;
constexpr size_t kShownCharacters = 60;

// Quotes unreadable text for a message.
std::string Quoted(const std::string& text) {
  const bool cut = text.size() > kShownCharacters;
  return absl::StrCat("\"", absl::CHexEscape(text.substr(0, kShownCharacters)), cut ? "..." : "",
                      "\"");
}

// Whether a separator behind one to three digits and before three digits could group thousands:
// "320,000" is 320 or 320 000. Groups begin with no zero.
bool MayGroupThousands(std::string_view number) {
  if (!number.empty() && (number.front() == '-' || number.front() == '+')) number.remove_prefix(1);
  const size_t separator = number.find_first_of(",.");
  return separator >= 1 && separator <= 3 && number.size() == separator + 4 && number[0] != '0' &&
         number.find_first_not_of("0123456789", separator + 1) == std::string_view::npos;
}

class DataFileReader {
 public:
  explicit DataFileReader(std::string context) : context_(std::move(context)) {}

  absl::StatusOr<v1::SensorSet> Read(std::string_view text) {
    // A byte order mark, as Windows editors write it.
    if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
    if (text.starts_with("\xFF\xFE") || text.starts_with("\xFE\xFF")) {
      return absl::InvalidArgumentError(absl::StrCat(
          context_, ": begins with the byte order mark of UTF-16; must be saved as UTF-8"));
    }
    // Lines end as on Unix, Windows or the old Macintosh.
    std::istringstream lines(absl::StrReplaceAll(absl::string_view(text.data(), text.size()),
                                                 {{"\r\n", "\n"}, {"\r", "\n"}}));
    for (std::string line; std::getline(lines, line);) {
      if (++line_ > kMostLines) {
        return Error(absl::StrCat("there are more than ", kMostLines, " lines"));
      }
      absl::StripAsciiWhitespace(&line);
      if (line.empty() || line[0] == '#') continue;
      SIGHTLINE_RETURN_IF_ERROR(ReadLine(line));
    }
    SIGHTLINE_RETURN_IF_ERROR(FinishStep());
    if (!set_.has_bit_depth_bit()) {
      return absl::InvalidArgumentError(absl::StrCat(
          context_, ": has no line \"n BITS COLUMNS ROWS\", which says what the images are"));
    }
    if (decimal_comma_line_ > 0 && grouping_point_line_ > 0) {
      return ErrorAt(
          grouping_point_line_,
          absl::StrCat("a point before three digits can be read in two ways, since line ",
                       decimal_comma_line_,
                       " has a decimal comma; numbers must have a decimal point"));
    }
    SIGHTLINE_RETURN_IF_ERROR(CheckSensorSet(set_, context_));
    SortSteps();
    return std::move(set_);
  }

 private:
  absl::Status ErrorAt(int line, const std::string& reason) const {
    return absl::InvalidArgumentError(absl::StrCat(context_, ":", line, ": ", reason));
  }
  absl::Status Error(const std::string& reason) const { return ErrorAt(line_, reason); }

  absl::Status ReadLine(const std::string& line) {
    const size_t end = line.find_first_of(" \t");
    const std::string kind = line.substr(0, end);
    std::string rest = end == std::string::npos ? "" : line.substr(end);
    absl::StripAsciiWhitespace(&rest);
    const std::vector<std::string> words =
        absl::StrSplit(rest, absl::ByAnyChar(" \t"), absl::SkipEmpty());
    // Text for the test report: the name of a variable and its value.
    if (kind == "l") return absl::OkStatus();
    if (kind == "v") {
      return words.size() == 1 ? absl::OkStatus() : Error("must be \"v VERSION\"");
    }
    if (kind == "n") return ReadFormat(words);
    if (kind == "b" || kind == "d") return StartStep(kind == "d", words);
    if (kind == "i") return AddImage(rest);
    return Error(absl::StrCat("begins with ", Quoted(kind),
                              ", must begin with v, n, b, d, i, l or, for a comment, #"));
  }

  absl::Status ReadFormat(const std::vector<std::string>& words) {
    if (set_.has_bit_depth_bit()) return Error("is a second line of kind n");
    constexpr char kForm[] = "must be \"n BITS COLUMNS ROWS\" with whole numbers";
    if (words.size() != 3) return Error(kForm);
    std::array<int, 3> numbers{};
    for (size_t i = 0; i < numbers.size(); ++i) {
      const auto read = ParseWhole(words[i]);
      if (!read.ok()) return Error(absl::StrCat(kForm, "; one ", read.status().message()));
      if (*read < 0 || *read > std::numeric_limits<int>::max()) {
        return Error(absl::StrCat(kForm, "; one is ", *read));
      }
      numbers[i] = static_cast<int>(*read);
    }
    set_.set_bit_depth_bit(numbers[0]);
    set_.set_columns_px(numbers[1]);
    set_.set_rows_px(numbers[2]);
    return absl::OkStatus();
  }

  // A finite number with a decimal point or a decimal comma, if it can be read in one way only.
  absl::StatusOr<double> ParseNumber(const char* what, std::string text) {
    const auto refused = [&](const std::string& reason) {
      return Error(absl::StrCat(what, " is ", Quoted(text), ", ", reason));
    };
    const auto separators =
        std::count_if(text.begin(), text.end(), [](char c) { return c == ',' || c == '.'; });
    if (separators > 1) return refused("must be a number with at most one separator, a point");
    const bool comma = absl::StrContains(text, ',');
    if (MayGroupThousands(text)) {
      if (comma) {
        return refused(
            "which can be read in two ways: its comma may be decimal or group thousands; must have "
            "a decimal point or none");
      }
      if (grouping_point_line_ == 0) grouping_point_line_ = line_;
    } else if (comma && decimal_comma_line_ == 0) {
      decimal_comma_line_ = line_;
    }
    const auto value = ParseReal(absl::StrReplaceAll(text, {{",", "."}}));
    if (!value.ok()) return refused("must be a finite number");
    return *value;
  }

  absl::Status StartStep(bool dark, const std::vector<std::string>& words) {
    SIGHTLINE_RETURN_IF_ERROR(FinishStep());
    if (words.empty() || words.size() > (dark ? 1 : 2)) {
      return Error(dark ? "must be \"d EXPOSURE_TIME_NS\""
                        : "must be \"b EXPOSURE_TIME_NS PHOTONS\"");
    }
    SIGHTLINE_ASSIGN_OR_RETURN(const auto exposure_time_ns,
                               ParseNumber("the exposure time", words[0]));
    std::optional<double> photons;
    if (words.size() == 2) {
      SIGHTLINE_ASSIGN_OR_RETURN(photons, ParseNumber("the number of photons", words[1]));
    }
    v1::FlatFieldStep* step = set_.add_steps();
    step->set_dark(dark);
    step->set_exposure_time_s(1e-9 * exposure_time_ns);
    if (photons) step->set_photons(*photons);
    step_line_.push_back(line_);
    return absl::OkStatus();
  }

  absl::Status AddImage(const std::string& file) {
    if (set_.steps().empty()) return Error("an image must stand below a line of kind b or d");
    if (file.empty()) return Error("names no image");
    std::string path(file);
    std::replace(path.begin(), path.end(), '\\', '/');
    if (!files_.insert(path).second) {
      return Error(absl::StrCat("image ", Quoted(path), " is listed a second time"));
    }
    set_.mutable_steps(set_.steps_size() - 1)->add_files(std::move(path));
    return absl::OkStatus();
  }

  absl::Status FinishStep() const {
    if (set_.steps().empty()) return absl::OkStatus();
    const int images = set_.steps(set_.steps_size() - 1).files_size();
    if (images >= 2) return absl::OkStatus();
    return ErrorAt(step_line_.back(),
                   absl::StrCat("the step has ", images, images == 1 ? " image" : " images",
                                ", must have at least two: noise is measured from their "
                                "difference (EMVA 1288, clause 6.6)"));
  }

  // In the order of light, exposure time, photons and first image, so that the order of lines in
  // the file is without effect. Images of a step stay in their order, which is that of time.
  void SortSteps() {
    const auto key = [](const v1::FlatFieldStep& step) {
      return std::make_tuple(step.dark(), step.exposure_time_s(), step.photons(), step.files(0));
    };
    std::sort(
        set_.mutable_steps()->begin(), set_.mutable_steps()->end(),
        [&](const v1::FlatFieldStep& a, const v1::FlatFieldStep& b) { return key(a) < key(b); });
  }

  const std::string context_;
  v1::SensorSet set_;
  std::vector<int> step_line_;
  std::set<std::string> files_;
  int line_ = 0;
  // First lines with a decimal comma, and with a point that may group thousands; 0: none.
  int decimal_comma_line_ = 0, grouping_point_line_ = 0;
};

constexpr double kSameLight = 1e-9;  // relative

}  // namespace

std::vector<std::string> SensorSetRemarks(const v1::SensorSet& set) {
  double shortest_s = std::numeric_limits<double>::infinity(), longest_s = 0;
  double least = std::numeric_limits<double>::infinity(), most = 0;
  for (const v1::FlatFieldStep& step : set.steps()) {
    if (step.dark() || !step.has_photons()) continue;
    shortest_s = std::min(shortest_s, step.exposure_time_s());
    longest_s = std::max(longest_s, step.exposure_time_s());
    least = std::min(least, step.photons());
    most = std::max(most, step.photons());
  }
  if (!(longest_s > shortest_s) || most - least > kSameLight * most) return {};
  return {
      absl::StrCat("all steps with light state the same ", most, " photons, at exposure times of ",
                   1e9 * shortest_s, " to ", 1e9 * longest_s,
                   " ns: a response to light cannot be measured; if the light was constant, the "
                   "photons of each step are proportional to its exposure time")};
}

absl::StatusOr<v1::SensorSet> ParseEmva1288Data(std::string_view text, const std::string& context) {
  return DataFileReader(context).Read(text);
}

absl::Status CheckSensorSet(const v1::SensorSet& set, const std::string& context) {
  const auto error = [&](const std::string& field, const auto& value, const std::string& rule) {
    return absl::InvalidArgumentError(
        absl::StrCat(context, ": ", field, " is ", value, ", must be ", rule));
  };
  if (set.bit_depth_bit() < 1 || set.bit_depth_bit() > 16) {
    return error("bit_depth_bit", set.bit_depth_bit(), "in [1, 16]");
  }
  for (const auto& [field, size] :
       {std::pair("columns_px", set.columns_px()), std::pair("rows_px", set.rows_px())}) {
    if (size < kLeastSize_px || size > kLargestSize_px) {
      return error(field, size, absl::StrCat("in [", kLeastSize_px, ", ", kLargestSize_px, "]"));
    }
  }
  if (set.steps_size() < 1 || set.steps_size() > kMostSteps) {
    return error("number of steps", set.steps_size(), absl::StrCat("in [1, ", kMostSteps, "]"));
  }
  std::optional<bool> with_photons;
  for (int i = 0; i < set.steps_size(); ++i) {
    const v1::FlatFieldStep& step = set.steps(i);
    const std::string field = absl::StrCat("steps[", i, "].");
    if (!(step.exposure_time_s() >= 0) || !std::isfinite(step.exposure_time_s())) {
      return error(field + "exposure_time_s", step.exposure_time_s(), "at least 0 and finite");
    }
    if (step.files_size() < 2 || step.files_size() > kMostImagesOfStep) {
      return error(absl::StrCat("number of ", field, "files"), step.files_size(),
                   absl::StrCat("in [2, ", kMostImagesOfStep, "]"));
    }
    for (const std::string& file : step.files()) {
      if (file.empty()) return error(field + "files", "empty", "a name");
    }
    if (step.dark()) continue;
    if (step.has_photons() && (!(step.photons() >= 0) || !std::isfinite(step.photons()))) {
      return error(field + "photons", step.photons(), "at least 0 and finite");
    }
    if (with_photons && *with_photons != step.has_photons()) {
      return absl::InvalidArgumentError(absl::StrCat(
          context, ": ", field, "photons must be given in all steps with light or in none"));
    }
    with_photons = step.has_photons();
  }
  return absl::OkStatus();
}

}  // namespace sightline
