#include "core/recordings/check_recordings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "core/recordings/expected_line.h"
#include "core/recordings/linearity.h"
#include "core/recordings/raw_numbers.h"

namespace sightline {
namespace {

double Median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The line as it is seen in the rows' means of the brightest channel.
struct SeenLine {
  bool found = false;
  double row_px = 0;
  double energy_dn = 0;        // of a column, summed across the line
  double energy_error_dn = 0;  // standard error by the scatter of the other rows
};

// First row and column and step of one channel's pixels.
struct Pixels {
  int row = 0, column = 0, step = 1;
};

Pixels BrightestPixels(const Sensor& sensor, double wavelength_m) {
  if (sensor.colour_filter == ColourFilter::kMono) return {};
  int best = 0;
  for (int c = 1; c < 3; ++c) {
    if (sensor.quantum_efficiency[c].At(wavelength_m) >
        sensor.quantum_efficiency[best].At(wavelength_m)) {
      best = c;
    }
  }
  return best == kRed ? Pixels{0, 0, 2} : best == kBlue ? Pixels{1, 1, 2} : Pixels{0, 1, 2};
}

SeenLine FindLine(const Image<uint16_t>& image, const Pixels& pixels, double width_px) {
  std::vector<double> rows;
  for (int row = pixels.row; row < image.rows_px; row += pixels.step) {
    double sum = 0;
    int count = 0;
    for (int column = pixels.column; column < image.columns_px; column += pixels.step) {
      sum += image.At(row, column);
      ++count;
    }
    rows.push_back(sum / std::max(1, count));
  }
  SeenLine line;
  const int size = static_cast<int>(rows.size());
  const int half = std::max(1, static_cast<int>(std::lround(width_px / pixels.step)));
  if (size < 8 * half) return line;
  const double background = Median(rows);
  int peak = 0;
  double highest = -1e300;
  for (int row = 0; row < size; ++row) {
    double sum = 0;
    for (int k = -half; k <= half; ++k) sum += rows[std::clamp(row + k, 0, size - 1)] - background;
    if (sum > highest) {
      highest = sum;
      peak = row;
    }
  }
  const int reach = 4 * half + 8 / pixels.step;
  double energy = 0, moment = 0;
  int inside = 0;
  std::vector<double> steps;
  for (int row = 0; row < size; ++row) {
    if (std::abs(row - peak) <= reach) {
      const double value = rows[row] - background;
      energy += value;
      moment += value * row;
      ++inside;
    } else if (row > 0 && std::abs(row - 1 - peak) > reach) {
      steps.push_back(std::abs(rows[row] - rows[row - 1]));
    }
  }
  // Median of |difference of two| is 0.954 standard deviations; half the rounding step at least.
  const double row_error = std::max(Median(steps) / 0.954, 0.02);
  line.energy_dn = energy * pixels.step;
  line.energy_error_dn = row_error * std::sqrt(static_cast<double>(inside)) * pixels.step;
  line.row_px = energy > 0 ? pixels.row + pixels.step * moment / energy : 0;
  line.found = energy * pixels.step > 8 * line.energy_error_dn &&
               highest / (2 * half + 1) > 5 * row_error / std::sqrt(2.0 * half + 1);
  return line;
}

// Signal of the pixels of even over that of odd columns, in even and in odd rows; 1 on mono
// sensors.
struct ColumnRatios {
  double even_rows = 1, odd_rows = 1;
};

std::optional<ColumnRatios> MeasureColumnRatios(const Image<uint16_t>& image, double dark_dn) {
  // Of the line alone: other light may have other colours. Half of the rows at least are beside it.
  std::vector<double> means(static_cast<size_t>(image.rows_px));
  for (int row = 0; row < image.rows_px; ++row) {
    const uint16_t* values = image.Row(row);
    means[static_cast<size_t>(row)] =
        std::accumulate(values, values + image.columns_px, 0.0) / image.columns_px;
  }
  std::vector<double> sorted = means;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  const double beside_dn = std::max(dark_dn, *middle);
  std::array<std::array<double, 2>, 2> sums{}, background{};
  std::array<double, 2> rows{}, background_rows{};
  for (int row = 0; row < image.rows_px; ++row) {
    const uint16_t* values = image.Row(row);
    const bool on_line = means[static_cast<size_t>(row)] - beside_dn >= 0.25 * dark_dn + 10;
    const bool beside = means[static_cast<size_t>(row)] <= *middle;
    if (!on_line && !beside) continue;
    (on_line ? rows : background_rows)[row % 2] += 1;
    for (int column = 0; column < image.columns_px; ++column) {
      (on_line ? sums : background)[row % 2][column % 2] += values[column];
    }
  }
  for (const int r : {0, 1}) {
    for (const int c : {0, 1}) {
      const double columns = (image.columns_px + 1 - c) / 2;
      const double level_dn =
          background_rows[r] > 0 ? background[r][c] / background_rows[r] : dark_dn * columns;
      sums[r][c] -= rows[r] * level_dn;
    }
  }
  // Faint channels may come out at nothing.
  const auto ratio = [&](int parity) {
    const double least = std::max(1.0, 0.01 * (sums[parity][0] + sums[parity][1]));
    return std::max(sums[parity][0], least) / std::max(sums[parity][1], least);
  };
  if (rows[0] < 1 || rows[1] < 1) return std::nullopt;
  return ColumnRatios{ratio(0), ratio(1)};
}

// Correlation of two recordings' pixels in the rows of the line, relative to their rows' means.
std::optional<double> PatternCorrelation(const Image<uint16_t>& a, const Image<uint16_t>& b,
                                         double dark_dn) {
  double ab = 0, aa = 0, bb = 0;
  for (int row = 0; row < a.rows_px; ++row) {
    const uint16_t* va = a.Row(row);
    const uint16_t* vb = b.Row(row);
    // Alternate columns may have other colours.
    for (int parity = 0; parity < 2; ++parity) {
      double mean_a = 0, mean_b = 0, count = 0;
      for (int j = parity; j < a.columns_px; j += 2) {
        mean_a += va[j];
        mean_b += vb[j];
        ++count;
      }
      mean_a /= count;
      mean_b /= count;
      if (mean_a < 2 * dark_dn + 30 || mean_b < 2 * dark_dn + 30) continue;
      for (int j = parity; j < a.columns_px; j += 2) {
        ab += (va[j] - mean_a) * (vb[j] - mean_b);
        aa += (va[j] - mean_a) * (va[j] - mean_a);
        bb += (vb[j] - mean_b) * (vb[j] - mean_b);
      }
    }
  }
  if (!(aa > 0 && bb > 0)) return std::nullopt;
  return ab / std::sqrt(aa * bb);
}

bool SameOptics(const RecordedImage& a, const RecordedImage& b) {
  return a.f_number == b.f_number && a.camera_distance_m == b.camera_distance_m &&
         a.focus_distance_m == b.focus_distance_m && a.laser_distance_m == b.laser_distance_m &&
         a.line_offset_m == b.line_offset_m && a.roi_column_px == b.roi_column_px &&
         a.roi_row_px == b.roi_row_px && a.roi_columns_px == b.roi_columns_px &&
         a.roi_rows_px == b.roi_rows_px;
}

class Check {
 public:
  Check(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn, const StopCheck& stop)
      : set_(set), raw_(raw_dn), stop_(stop), count_(static_cast<int>(set.recordings.size())) {
    result_.recordings.resize(set.recordings.size());
  }

  RecordingCheck Run() {
    std::vector<void (Check::*)()> steps = {&Check::CollectNumbers, &Check::CheckNumbers,
                                            &Check::CheckBlankAndClipped, &Check::CheckDuplicates,
                                            &Check::CheckBlocks};
    if (set_.format_version == 1) {
      steps.insert(steps.end(),
                   {&Check::FindLines, &Check::CheckLight, &Check::CheckBrightness,
                    &Check::CheckPlace, &Check::CheckColours, &Check::CheckDarkFrames,
                    &Check::CheckLinearity, &Check::CheckSpeckle, &Check::CheckContents});
    }
    for (const auto step : steps) {
      if (!CheckStop(stop_).ok()) return {};
      (this->*step)();
    }
    Report();
    return std::move(result_);
  }

 private:
  enum class Severity { kError, kWarning };
  struct Finding {
    Severity severity;
    std::string reason, remark;
    std::vector<int> recordings;  // empty: the set as a whole
  };

  const std::string& File(int i) const { return set_.recordings[i].file; }
  bool IsLaser(int i) const { return set_.recordings[i].kind == RecordingKind::kLaser; }
  bool IsDark(int i) const { return set_.recordings[i].kind == RecordingKind::kDark; }
  bool Has(int i) const { return !raw_[i].empty(); }
  int Largest() const { return static_cast<int>(set_.camera.largest_dn()); }

  // Findings with the same reason become one.
  void Find(Severity severity, const std::string& reason, const std::string& remark,
            std::vector<int> recordings) {
    const auto [known, is_new] = finding_of_.try_emplace({severity, reason}, findings_.size());
    if (!is_new) {
      std::vector<int>& same = findings_[known->second].recordings;
      same.insert(same.end(), recordings.begin(), recordings.end());
      return;
    }
    findings_.push_back({severity, reason, remark, std::move(recordings)});
  }
  void Error(const std::string& reason, const std::string& remark, std::vector<int> recordings) {
    Find(Severity::kError, reason, remark, std::move(recordings));
  }
  void Warning(const std::string& reason, const std::string& remark, std::vector<int> recordings) {
    Find(Severity::kWarning, reason, remark, std::move(recordings));
  }

  void Report() {
    for (const Finding& finding : findings_) {
      std::string where;
      constexpr size_t kNamed = 4;
      const size_t files = finding.recordings.size();
      for (size_t k = 0; k < files && k < (files <= kNamed + 1 ? files : kNamed); ++k) {
        absl::StrAppend(&where, k > 0 ? ", " : "", File(finding.recordings[k]));
      }
      if (files > kNamed + 1) absl::StrAppend(&where, " and ", files - kNamed, " more");
      const std::string message =
          where.empty() ? finding.reason : absl::StrCat(where, ": ", finding.reason);
      (finding.severity == Severity::kError ? result_.errors : result_.warnings).push_back(message);
      for (const int i : finding.recordings) {
        result_.recordings[i].remarks.push_back(finding.remark);
      }
    }
  }

  void CollectNumbers() {
    all_ = Histogram(65536);
    largest_seen_ = 0;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i)) continue;
      const Histogram counts = CountValues(raw_[i]);
      RecordingState& state = result_.recordings[i];
      double sum = 0;
      int64_t saturated = 0;
      for (int value = 0; value < 65536; ++value) {
        if (counts[value] == 0) continue;
        all_[value] += counts[value];
        sum += static_cast<double>(counts[value]) * value;
        state.largest_dn = value;
        if (value >= Largest()) saturated += counts[value];
      }
      const double pixels = static_cast<double>(raw_[i].values.size());
      state.mean_dn = sum / pixels;
      state.saturated_fraction = static_cast<double>(saturated) / pixels;
      largest_seen_ = std::max(largest_seen_, static_cast<int>(state.largest_dn));
    }
  }

  // Half of an image's pixels are at or below it.
  int MedianValue(int i) const {
    const Histogram counts = CountValues(raw_[i]);
    int64_t below = 0;
    int value = 0;
    while (2 * (below += counts[value]) < static_cast<int64_t>(raw_[i].values.size())) ++value;
    return value;
  }

  // Nominal mean of a dark pixel at zero exposure time.
  double NominalDark() const {
    return set_.camera.black_level_dn +
           set_.camera.gain_dn_per_electron * set_.camera.dark_mean_electrons;
  }
  double NominalDarkNoise() const {
    return std::hypot(set_.camera.gain_dn_per_electron * set_.camera.dark_noise_electrons,
                      std::sqrt(1 / 12.0));
  }
  // Seen: median of the dark frames, else of the laser recordings' (mostly dark) pixels.
  double DarkLevel() const {
    std::vector<double> dark, other;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i)) continue;
      if (IsDark(i)) {
        dark.push_back(result_.recordings[i].mean_dn);
      } else {
        other.push_back(MedianValue(i));
      }
    }
    return dark.empty() ? Median(other) : Median(dark);
  }

  void CheckNumbers() {
    const int bits = set_.camera.bit_depth_bit;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || result_.recordings[i].largest_dn <= Largest()) continue;
      const int step = CommonPowerOfTwo(CountValues(raw_[i]));
      std::string reason =
          absl::StrCat("has values above 2^camera.bit_depth_bit - 1 = ", Largest());
      if (step > 1) {
        absl::StrAppend(&reason, ", all of them multiples of ", step,
                        ": the numbers are left-justified in 16 bits; store them as read out");
      } else {
        absl::StrAppend(&reason,
                        ": the numbers are scaled, or the camera has more bits than is said");
      }
      Error(reason, absl::StrCat("values above ", Largest()), {i});
      out_of_range_ = true;
    }
    if (out_of_range_ || bits <= 8 || largest_seen_ == 0) return;

    // 8-bit data in a wider file: clipped at 255.
    for (int narrow = 8; narrow < bits; ++narrow) {
      const int top = (1 << narrow) - 1;
      if (largest_seen_ != top) continue;
      int64_t next = 0;
      for (int value = top - 4; value < top; ++value) next += all_[value];
      if (all_[top] < 20 || all_[top] < 2 * next) continue;
      std::vector<int> files;
      for (int i = 0; i < count_; ++i) {
        if (Has(i) && result_.recordings[i].largest_dn == top) files.push_back(i);
      }
      Error(absl::StrCat("is clipped at ", top, ": ", narrow,
                         "-bit data, but camera.bit_depth_bit is ", bits, "; record raw numbers"),
            absl::StrCat(narrow, "-bit data"), files);
      result_.narrow = {narrow, 0, std::pow(2.0, narrow - bits)};
      narrow_ = true;
      return;
    }
    for (int narrow = 8; narrow < bits; ++narrow) {
      if (!IsBitReplicated(all_, narrow, bits)) continue;
      Error(absl::StrCat("camera.bit_depth_bit is ", bits, ", but all images hold only the ",
                         1 << narrow, " values of ", narrow,
                         "-bit data stretched to it: record raw numbers"),
            "", {});
      result_.narrow = {narrow, bits - narrow, std::pow(2.0, narrow - bits)};
      narrow_ = true;
      return;
    }
    const int step = CommonPowerOfTwo(all_);
    if (step > 1) {
      Warning(absl::StrCat("all values are multiples of ", step,
                           ": the lowest bits of the converter are stuck, or the images were made "
                           "from data of fewer bits than camera.bit_depth_bit = ",
                           bits),
              "", {});
      return;
    }
    constexpr double kComb = 0.4;
    if (const double missing = MissingValueShare(all_, Largest()); missing > kComb) {
      Error(
          absl::StrFormat("camera.bit_depth_bit is %d, but %.0f %% of the values in between never "
                          "occur: the images were stretched from fewer values (8-bit data such "
                          "as JPEG, a contrast curve); record raw numbers",
                          bits, 100 * missing),
          "", {});
      narrow_ = true;
      return;
    }
    // Some images only.
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || MissingValueShare(CountValues(raw_[i]), Largest()) <= kComb) continue;
      Error(
          "most of the values in between never occur, unlike in the other images: stretched from "
          "fewer values (8-bit data such as JPEG, a contrast curve); record raw numbers",
          "stretched numbers", {i});
    }
  }

  void CheckBlankAndClipped() {
    for (int i = 0; i < count_; ++i) {
      if (!Has(i)) continue;
      const RecordingState& state = result_.recordings[i];
      const Histogram counts = CountValues(raw_[i]);
      const bool blank = counts[static_cast<size_t>(state.largest_dn)] ==
                         static_cast<int64_t>(raw_[i].values.size());
      // A quiet sensor's dark frame may well be nothing but zeros.
      if (blank && !(IsDark(i) && state.largest_dn == 0 && NominalDark() < 0.2 &&
                     NominalDarkNoise() < 0.4)) {
        blank_.insert(i);
        Error(absl::StrCat("is blank: all pixels are ", state.largest_dn,
                           IsDark(i) ? ", though camera.dark_noise_electrons makes them vary" : "",
                           "; record it again"),
              "blank", {i});
      } else if (state.saturated_fraction > 0.5) {
        blank_.insert(i);
        Error("most pixels are saturated: record it again with a shorter exposure_time_s",
              "saturated", {i});
      }
    }
  }

  void CheckDuplicates() {
    std::map<std::vector<uint16_t>, int> first;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || blank_.count(i) > 0) continue;
      const RecordingState& state = result_.recordings[i];
      // Two dark frames of a quiet sensor with few values can be equal by chance.
      if (CountValues(raw_[i])[static_cast<size_t>(std::lround(state.mean_dn))] >
          static_cast<int64_t>(raw_[i].values.size()) * 99 / 100) {
        continue;
      }
      const auto [place, is_new] = first.emplace(raw_[i].values, i);
      if (is_new) continue;
      Error(absl::StrCat("has the same pixels as ", File(place->second),
                         ": noise never repeats, one of the two is a copy; record it again"),
            absl::StrCat("copy of ", File(place->second)), {i});
    }
  }

  void CheckBlocks() {
    std::vector<const Image<uint16_t>*> all;
    for (int i = 0; i < count_; ++i) {
      if (Has(i) && blank_.count(i) == 0) all.push_back(&raw_[i]);
    }
    const std::string reason =
        "steps every eight columns: the image was JPEG-compressed, which has changed its numbers; "
        "record raw numbers";
    const BlockEdges together = FindBlockEdges(all);
    const bool together_found = together.score > 8 && together.ratio > 1.06;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || blank_.count(i) > 0) continue;
      const BlockEdges own = FindBlockEdges({&raw_[i]});
      const bool own_found = own.score > 8 && own.ratio > 1.12;
      if (own_found || (together_found && own.score > 5 && own.phase == together.phase)) {
        Error(reason, "JPEG blocks", {i});
      }
    }
  }

  void FindLines() {
    const Pixels pixels = BrightestPixels(set_.camera, set_.laser.wavelength_m);
    for (int i = 0; i < count_; ++i) {
      expected_.push_back(ExpectLine(set_, set_.recordings[i]));
      lines_.push_back(Has(i) && blank_.count(i) == 0
                           ? FindLine(raw_[i], pixels, expected_[i].width_px)
                           : SeenLine{});
      result_.recordings[i].line_found = lines_[i].found;
    }
  }

  double ExpectedEnergyDn(int i) const {
    const auto& electrons = expected_[i].electrons_per_column;
    return set_.camera.gain_dn_per_electron * *std::max_element(electrons.begin(), electrons.end());
  }

  void CheckLight() {
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || blank_.count(i) > 0) continue;
      const SeenLine& line = lines_[i];
      if (IsLaser(i) && !line.found && ExpectedEnergyDn(i) > 30 * line.energy_error_dn) {
        Error(
            "kind is \"laser\", but there is no line: the laser was off, the shutter closed, or "
            "the line outside the region of interest; record it again",
            "no line", {i});
        no_line_.insert(i);
        result_.without_line.push_back(i);
      }
      if (!IsDark(i) || !line.found) continue;
      // A trace of the frame before is the sensor's (image lag), not a mistake.
      const bool burst = set_.recordings[i].burst_frame_index > 0 && i > 0;
      const double trace = burst ? 0.5 * lines_[i - 1].energy_dn : 0;
      if (line.energy_dn > std::max(trace, 0.2 * ExpectedEnergyDn(i))) {
        Error("kind is \"dark\", but the laser line shows: close the shutter and record it again",
              "line in a dark frame", {i});
      }
    }
  }

  void CheckBrightness() {
    std::vector<double> ratio(static_cast<size_t>(count_), 0), known;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || !IsLaser(i) || !lines_[i].found) continue;
      if (lines_[i].energy_dn < 20 * lines_[i].energy_error_dn) continue;
      // Clipped light cannot be compared.
      if (result_.recordings[i].saturated_fraction > 0.001) continue;
      if (ExpectedEnergyDn(i) <= 0) continue;
      ratio[i] = lines_[i].energy_dn / ExpectedEnergyDn(i);
      known.push_back(ratio[i]);
    }
    if (known.empty()) return;
    median_ratio_ = Median(known);
    const int bits = set_.camera.bit_depth_bit;
    // Lower bits clipped above rather than upper bits: the light is as bright as described.
    if (result_.narrow && result_.narrow->repeated_bit == 0 &&
        std::abs(std::log(median_ratio_)) <
            std::abs(std::log(median_ratio_ / result_.narrow->gain_factor))) {
      result_.narrow->gain_factor = 1;
    }
    // 8-bit data that is clipped nowhere: light and dark level both too small by the same factor.
    for (int narrow = 8; narrow < bits && !narrow_ && !out_of_range_; ++narrow) {
      const double factor = std::pow(2.0, narrow - bits);
      const double dark = DarkLevel();
      if (largest_seen_ >= (1 << narrow) || NominalDark() < 2) continue;
      if (std::abs(std::log(median_ratio_ / factor)) > 0.35) continue;
      if (std::abs(dark - factor * NominalDark()) > 0.3 * factor * NominalDark() + 0.3) continue;
      Error(absl::StrFormat("light and dark level are both %.2g times what camera describes, and "
                            "no value is above %d: %d-bit data, but camera.bit_depth_bit is %d; "
                            "record raw numbers",
                            median_ratio_, (1 << narrow) - 1, narrow, bits),
            "", {});
      result_.narrow = {narrow, 0, factor};
      narrow_ = true;
    }
    if (narrow_ || out_of_range_) return;
    if (median_ratio_ > 4 || median_ratio_ < 0.25) {
      Warning(absl::StrFormat("the line is %.2g times as bright as described: laser.power_w, "
                              "surface, lens.transmission or camera.gain_dn_per_electron are "
                              "probably wrong",
                              median_ratio_),
              "", {});
    }
    if (known.size() < 3) return;
    for (int i = 0; i < count_; ++i) {
      if (ratio[i] == 0) continue;
      const double relative = ratio[i] / median_ratio_;
      if (relative < 2.5 && relative > 0.4) continue;
      Warning(absl::StrFormat("is %.2g times as bright as its exposure_time_s, f_number and "
                              "distances say, compared with the others: were they set and written "
                              "down right?",
                              relative),
              absl::StrFormat("%.2g times too bright", relative), {i});
    }
  }

  void CheckPlace() {
    // Known within the stated uncertainties; else to some pixels.
    const double sigma_px = std::hypot(std::max(1.0, set_.uncertainty.line_position_common_px),
                                       std::max(0.5, set_.uncertainty.line_position_each_px));
    std::vector<double> offsets;
    std::vector<int> seen;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || !IsLaser(i) || !lines_[i].found) continue;
      offsets.push_back(lines_[i].row_px - expected_[i].row_px);
      seen.push_back(i);
    }
    if (offsets.empty()) return;
    const double common = Median(offsets);
    const auto allowed = [&](int i) {
      // A wrong camera distance moves a line that is off the axis.
      const double off_axis = std::abs(expected_[i].row_px + set_.recordings[i].roi_row_px);
      return 20 + 10 * sigma_px + 0.05 * off_axis + expected_[i].width_px;
    };
    for (size_t k = 0; k < seen.size(); ++k) {
      const int i = seen[k];
      const double offset = offsets[k] - (offsets.size() >= 3 ? common : 0);
      if (std::abs(offset) <= allowed(i)) continue;
      Error(
          "the line is not where line_offset_m and roi_row_px put it (the others are): wrong "
          "region of interest; read it out again or correct the numbers",
          absl::StrFormat("line %.0f px off", offset), {i});
    }
    if (offsets.size() >= 3 && std::abs(common) > 20 + 10 * sigma_px) {
      Warning(
          absl::StrFormat("the line is some %.0f px from where line_offset_m and roi_row_px put "
                          "it: wrong region of interest, or the rig is not aligned",
                          common),
          "", {});
    }
  }

  void CheckColours() {
    const Sensor& sensor = set_.camera;
    const bool bayer = sensor.colour_filter == ColourFilter::kBayerRggb;
    const double dark = DarkLevel();
    double expected_even = 1, expected_odd = 1;
    if (bayer) {
      const auto efficiency = [&](int c) {
        return std::max(1e-3, sensor.quantum_efficiency[c].At(set_.laser.wavelength_m));
      };
      expected_even = efficiency(kRed) / efficiency(kGreen);
      expected_odd = efficiency(kGreen) / efficiency(kBlue);
    }
    std::vector<int> flat;  // recordings without the pattern
    size_t compared = 0;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || !IsLaser(i) || !lines_[i].found) continue;
      if (result_.recordings[i].saturated_fraction > 0.002) continue;
      const auto ratios = MeasureColumnRatios(raw_[i], dark);
      if (!ratios) continue;
      const double even = std::log(ratios->even_rows), odd = std::log(ratios->odd_rows);
      if (!bayer) {
        // Speckle of some hundred columns averages to some per cent.
        if (std::abs(even) > 0.45 || std::abs(odd) > 0.45) {
          Error(
              "alternate pixels differ like those of a colour sensor, but camera.sensor_type is "
              "mono: another sensor",
              "colour pattern", {i});
        }
        continue;
      }
      // Compared in the rows where the colours differ most.
      const bool use_even = std::abs(std::log(expected_even)) >= std::abs(std::log(expected_odd));
      const double expected = std::log(use_even ? expected_even : expected_odd);
      const double seen = use_even ? even : odd;
      if (std::abs(expected) < 0.8) continue;
      ++compared;
      if (std::abs(seen) < 0.25 * std::abs(expected)) {
        flat.push_back(i);
      } else if (seen * expected < 0) {
        Error(
            "the colour pattern is shifted: roi_row_px and roi_column_px must start on a red "
            "pixel, the image does not",
            "colour pattern shifted", {i});
      }
    }
    if (flat.empty()) return;
    if (flat.size() < compared) {
      for (const int i : flat) {
        Error(
            "alternate pixels do not differ, but camera.sensor_type is bayer_rggb: another "
            "sensor, or no raw numbers",
            "no colour pattern", {i});
      }
      return;
    }
    // All alike: the sensor itself may be far from its description, which is for a diagnosis to
    // say.
    Warning(
        "alternate pixels do not differ in any recording, but camera.sensor_type is bayer_rggb: "
        "another sensor, no raw numbers, or quantum efficiencies far from the stated ones",
        "no colour pattern", flat);
  }

  void CheckDarkFrames() {
    std::vector<double> noise;
    std::vector<int> frames;
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || !IsDark(i) || blank_.count(i) > 0) continue;
      frames.push_back(i);
      const std::vector<uint16_t>& values = raw_[i].values;
      const double zeros = static_cast<double>(std::count(values.begin(), values.end(), 0)) /
                           static_cast<double>(values.size());
      if (zeros > 0.2 && NominalDark() > 3 * NominalDarkNoise()) {
        Warning(
            "many dark pixels are 0 although camera.dark_mean_electrons keeps them above it: "
            "black was subtracted, or the dark level is not as stated",
            "clipped at 0", {i});
      }
    }
    // Frames of about the same exposure differ by noise and drift only.
    for (size_t k = 0; k < frames.size(); ++k) {
      std::vector<double> others;
      for (size_t l = 0; l < frames.size(); ++l) {
        if (l != k) others.push_back(result_.recordings[frames[l]].mean_dn);
      }
      if (others.size() < 2) break;
      const double mean = result_.recordings[frames[k]].mean_dn;
      const auto [least, most] = std::minmax_element(others.begin(), others.end());
      const double tolerance = 2 * (*most - *least) + 3 * NominalDarkNoise() + 1;
      const bool longest = std::all_of(frames.begin(), frames.end(), [&](int i) {
        return set_.recordings[i].exposure_time_s <= set_.recordings[frames[k]].exposure_time_s;
      });
      // Dark current makes the longest exposure the brightest.
      if (mean < *least - tolerance || (mean > *most + tolerance && !longest)) {
        Warning(absl::StrFormat("its dark level of %.1f DN is far from that of the other dark "
                                "frames: another sensor, another setting of the camera, or stray "
                                "light",
                                mean),
                "dark level differs", {frames[k]});
      }
    }
    // Laser recordings cannot be darker than dark.
    if (frames.empty()) return;
    double darkest = 1e300;
    for (const int i : frames) darkest = std::min(darkest, result_.recordings[i].mean_dn);
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || !IsLaser(i) || blank_.count(i) > 0) continue;
      const int value = MedianValue(i);
      if (value < darkest - 3 * NominalDarkNoise() - 1) {
        Warning(absl::StrFormat("half of its pixels are at or below %d DN, darker than the dark "
                                "frames: another sensor, or another black level",
                                value),
                "darker than dark", {i});
      }
    }
  }

  void CheckLinearity() {
    if (out_of_range_) return;
    // A plateau below the largest number is a full well.
    const double full = all_[largest_seen_] >= 20 ? largest_seen_ : set_.camera.largest_dn();
    const Linearity linear = MeasureLinearity(set_, raw_, DarkLevel(), full);
    const bool noise_bent =
        linear.noise_exponent && *linear.noise_exponent + 4 * linear.noise_exponent_error < 0.5;
    const bool exposure_bent = linear.exposure_exponent && *linear.exposure_exponent < 0.75;
    if (!(noise_bent && (exposure_bent || !linear.exposure_exponent)) &&
        !(exposure_bent && !linear.noise_exponent)) {
      return;
    }
    std::string reason = "the numbers are not proportional to light:";
    if (linear.noise_exponent) {
      absl::StrAppend(&reason, absl::StrFormat(" their noise variance grows as signal^%.2f (raw: "
                                               "^0.75 to ^1)",
                                               *linear.noise_exponent));
    }
    if (linear.exposure_exponent) {
      absl::StrAppend(&reason, linear.noise_exponent ? " and" : "",
                      absl::StrFormat(" the signal as exposure_time_s^%.2f (raw: ^1)",
                                      *linear.exposure_exponent));
    }
    Error(absl::StrCat(reason, "; gamma or another curve was applied, record raw numbers"), "", {});
  }

  void CheckSpeckle() {
    const double dark = DarkLevel();
    for (int i = 0; i < count_; ++i) {
      if (!Has(i) || !IsLaser(i) || !lines_[i].found || no_line_.count(i) > 0) continue;
      for (int j = i + 1; j < count_ && j < i + 12; ++j) {
        if (!Has(j) || !IsLaser(j) || !lines_[j].found) continue;
        const RecordedImage& a = set_.recordings[i];
        const RecordedImage& b = set_.recordings[j];
        if (!SameOptics(a, b) || a.exposure_time_s != b.exposure_time_s) continue;
        const auto correlation = PatternCorrelation(raw_[i], raw_[j], dark);
        if (!correlation) continue;
        const bool same = a.plate_position_id == b.plate_position_id;
        if (same && *correlation < 0.3 && lines_[i].energy_dn > 100 * lines_[i].energy_error_dn) {
          Warning(absl::StrCat("has another speckle pattern than ", File(i),
                               " with the same plate_position_id: the plate was moved in between, "
                               "or the files are mixed up"),
                  "speckle differs", {j});
        } else if (!same && *correlation > 0.8) {
          Warning(absl::StrCat("has the speckle pattern of ", File(i),
                               " under another plate_position_id: the plate was not moved"),
                  "speckle repeats", {j});
        }
      }
    }
  }

  // What the set is too small to say.
  void CheckContents() {
    std::set<int> positions;
    std::set<double> exposures, f_numbers, distances;
    int lasers = 0, darks = 0, repeats = 0;
    std::set<std::pair<int, double>> taken;
    std::map<int, std::set<double>> sweep;
    for (const RecordedImage& image : set_.recordings) {
      if (image.kind == RecordingKind::kDark) {
        ++darks;
        continue;
      }
      if (image.kind != RecordingKind::kLaser) continue;
      ++lasers;
      const int position = image.plate_position_id.value_or(-1);
      positions.insert(position);
      f_numbers.insert(image.f_number);
      distances.insert(image.camera_distance_m);
      sweep[position].insert(image.exposure_time_s);
      if (!taken.insert({position, image.exposure_time_s}).second) ++repeats;
    }
    if (lasers == 0) {
      Error("recordings: none has kind \"laser\"; without a line there is nothing to compare", "",
            {});
      return;
    }
    const auto lack = [&](const std::string& what, const std::string& means) {
      Warning(absl::StrCat("recordings: ", what, "; ", means), "", {});
    };
    if (lasers < 6) {
      lack(absl::StrCat("only ", lasers, " of kind \"laser\""),
           "too few to say anything but gross differences");
    }
    if (darks == 0) {
      lack("none has kind \"dark\"",
           "dark level, dark current and other light cannot be told apart");
    }
    if (positions.size() < 3) {
      lack(absl::StrCat("only ", positions.size(), " different plate_position_id"),
           "speckle does not average out, so brightness and line position stay uncertain");
    }
    if (repeats == 0) {
      lack("no two with the same plate_position_id and exposure_time_s",
           "temporal noise cannot be told from speckle");
    }
    const bool swept =
        std::any_of(sweep.begin(), sweep.end(), [](const auto& s) { return s.second.size() >= 3; });
    if (!swept) {
      lack("no plate_position_id has three different exposure_time_s",
           "the sensor's response cannot be told from the optics");
    }
    if (f_numbers.size() < 2) {
      lack("all have the same f_number",
           "aperture, aberrations and transmission cannot be told "
           "from power and reflectance");
    }
    if (distances.size() < 2) {
      lack("all have the same camera_distance_m", "focus and distance errors stay hidden");
    }
  }

  const RecordingSet& set_;
  const std::vector<Image<uint16_t>>& raw_;
  const StopCheck& stop_;
  const int count_;
  RecordingCheck result_;
  std::vector<Finding> findings_;
  std::map<std::pair<Severity, std::string>, size_t> finding_of_;
  Histogram all_;
  int largest_seen_ = 0;
  bool out_of_range_ = false, narrow_ = false;
  std::set<int> blank_, no_line_;
  std::vector<ExpectedLine> expected_;
  std::vector<SeenLine> lines_;
  double median_ratio_ = 1;
};

}  // namespace

RecordingCheck CheckRecordings(const RecordingSet& set, const std::vector<Image<uint16_t>>& raw_dn,
                               const StopCheck& stop) {
  return Check(set, raw_dn, stop).Run();
}

NarrowNumbers EightBitNumbers(const Sensor& camera) {
  return {8, 0, std::pow(2.0, 8 - camera.bit_depth_bit)};
}

std::string TakeNarrowNumbers(const NarrowNumbers& narrow, RecordingSet* set,
                              std::vector<Image<uint16_t>>* raw_dn) {
  Sensor& camera = set->camera;
  const std::string warning = absl::StrFormat(
      "camera.bit_depth_bit is %d, but all images hold %d-bit numbers: they are taken as such, "
      "gain "
      "and black level %s; their rounding hides what changes less than a step",
      camera.bit_depth_bit, narrow.bit_depth_bit,
      narrow.gain_factor == 1 ? "as described" : absl::StrFormat("times %.4g", narrow.gain_factor));
  camera.bit_depth_bit = narrow.bit_depth_bit;
  camera.gain_dn_per_electron *= narrow.gain_factor;
  camera.black_level_dn *= narrow.gain_factor;
  for (Image<uint16_t>& image : *raw_dn) {
    for (uint16_t& value : image.values) value >>= narrow.repeated_bit;
  }
  return warning;
}

std::vector<std::string> LeaveOutWithoutLine(const RecordingCheck& check, RecordingSet* set,
                                             std::vector<Image<uint16_t>>* raw_dn) {
  constexpr size_t kMostShare = 10;  // one in
  std::vector<RecordedImage>& recordings = set->recordings;
  const auto lasers =
      static_cast<size_t>(std::count_if(recordings.begin(), recordings.end(), [](const auto& r) {
        return r.kind == RecordingKind::kLaser;
      }));
  if (check.without_line.size() * kMostShare > lasers) return {};
  for (const int i : check.without_line) {
    const bool followed =
        i + 1 < static_cast<int>(recordings.size()) && recordings[i + 1].burst_frame_index > 0;
    if (recordings[i].burst_frame_index > 0 || followed) return {};
  }
  std::vector<std::string> left_out;
  for (auto i = check.without_line.rbegin(); i != check.without_line.rend(); ++i) {
    left_out.insert(left_out.begin(),
                    absl::StrCat(recordings[*i].file,
                                 ": kind is \"laser\", but there is no line; it was left out"));
    recordings.erase(recordings.begin() + *i);
    raw_dn->erase(raw_dn->begin() + *i);
  }
  return left_out;
}

}  // namespace sightline
