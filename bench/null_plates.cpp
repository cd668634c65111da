// SPDX-License-Identifier: Apache-2.0
// The null model against recordings made by others from the same equations: every recording of a
// set is simulated many times with the calibration deviations its truth.json states, only the
// line's shift is fitted, once per plate position, and statistics are compared by Hotelling's test.
// Block means along the line give the covariances, so speckle's correlation is in them.
#include <CLI/CLI.hpp>
#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/fisher_f.hpp>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "render_worker/image_chain/form_image.h"

// After protobuf, whose byte swaps it undefines.
#include <OpenImageIO/imageio.h>

namespace sightline::bench {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using std::numbers::pi;
using Raw = Image<uint16_t>;

constexpr const char* kName = "null_plates";
constexpr int kBlock_px = 64;  // far more than a speckle

struct Recording {
  std::string file, series;
  bool dark = false;
  int position = -1;  // plate_position_id
  bool same_speckle = false;
  int repeat_group = 0;
  FrameSetup frame;
  Raw raw;
};

struct Set {
  std::string name;
  std::vector<Recording> recordings;
};

struct Options {
  std::vector<std::string> sets = {"null_mono", "null_colour"};
  std::vector<std::string> series;  // empty: all
  int realisations = 12;
  int threads = 2;
  double explain_below = 1e-3;  // deviations are printed for smaller p
  // A wrong simulation shows what the tests would find.
  double power_factor = 1, f_number_factor = 1;
  std::string json;
};

Json ReadJson(const std::string& path) {
  std::ifstream file(path);
  if (!file) Fail(kName, "cannot read " + path);
  return Json::parse(file);
}

Raw ReadRaw(const std::string& path, const RegionOfInterest& roi) {
  const auto input = OIIO::ImageInput::open(path);
  if (!input) Fail(kName, "cannot read " + path + ": " + OIIO::geterror());
  Raw raw(roi.columns_px, roi.rows_px);
  const OIIO::ImageSpec& spec = input->spec();
  if (spec.width != raw.columns_px || spec.height != raw.rows_px || spec.nchannels != 1 ||
      !input->read_image(0, 0, 0, 1, OIIO::TypeDesc::UINT16, raw.values.data())) {
    Fail(kName, path + " is no grey image of the region's size");
  }
  return raw;
}

Set ReadSet(const std::string& folder, const Options& options) {
  const Json json = ReadJson(folder + "/recordings.json");
  const Json nuisance = ReadJson(folder + "/truth.json")["nuisance"];
  const auto off = [&](const char* key) { return nuisance[key].get<double>(); };
  const Json& camera = json["camera"];
  FrameSetup frame;
  Sensor& sensor = frame.sensor;
  sensor.pixel_pitch_m = camera["pixel_pitch_m"];
  sensor.columns_px = camera["sensor_columns_px"];
  sensor.rows_px = camera["sensor_rows_px"];
  sensor.bit_depth_bit = camera["bit_depth_bit"];
  sensor.gain_dn_per_electron =
      camera["gain_dn_per_electron"].get<double>() * (1 + off("gain_relative"));
  sensor.saturation_capacity_electrons = camera["saturation_capacity_electrons"];
  sensor.dark_mean_electrons =
      camera["dark_mean_electrons"].get<double>() + off("dark_mean_electrons");
  sensor.dark_noise_electrons =
      camera["dark_noise_electrons"].get<double>() * (1 + off("dark_noise_relative"));
  const double wavelength = json["laser"]["wavelength_m"];
  const auto efficiency = [&](const char* channel) {
    return QuantumEfficiencyCurve{{wavelength},
                                  {camera["quantum_efficiency"][channel].get<double>() *
                                   (1 + off("quantum_efficiency_relative"))}};
  };
  if (camera["sensor_type"] == "mono") {
    sensor.quantum_efficiency[0] = efficiency("mono");
  } else {
    sensor.colour_filter = ColourFilter::kBayerRggb;
    sensor.quantum_efficiency = {efficiency("red"), efficiency("green"), efficiency("blue")};
  }
  frame.lens.focal_length_m = json["lens"]["focal_length_m"];
  frame.lens.transmission =
      json["lens"]["transmission"].get<double>() * (1 + off("transmission_relative"));
  const Json& laser = json["laser"];
  frame.laser.wavelength_m = wavelength;
  frame.laser.power_w =
      laser["power_w"].get<double>() * (1 + off("power_relative")) * options.power_factor;
  frame.laser.divergence_rad =
      laser["divergence_rad"].get<double>() * (1 + off("divergence_relative"));
  frame.laser.beam_focus_distance_m =
      laser["beam_focus_distance_m"].get<double>() + off("beam_focus_distance_m");
  frame.laser.fan_angle_rad = laser["fan_angle_deg"].get<double>() * pi / 180;
  const Json& surface = json["surface"];
  frame.surface.diffuse_albedo =
      surface["diffuse_albedo"].get<double>() * (1 + off("diffuse_albedo_relative"));
  frame.surface.specular_f0 =
      surface["specular_f0"].get<double>() * (1 + off("specular_f0_relative"));
  frame.surface.ggx_alpha = surface["ggx_alpha"].get<double>() * (1 + off("ggx_alpha_relative"));
  frame.plate.incidence_angle_rad =
      (json["rig"]["incidence_angle_deg"].get<double>() + off("incidence_angle_deg")) * pi / 180;

  Set set;
  set.name = json["set"];
  for (const Json& entry : json["recordings"]) {
    Recording recording;
    recording.file = entry["file"];
    recording.series = entry["series"];
    if (!options.series.empty() && std::find(options.series.begin(), options.series.end(),
                                             recording.series) == options.series.end()) {
      continue;
    }
    recording.dark = entry["kind"] == "dark";
    if (!entry["plate_position_id"].is_null()) recording.position = entry["plate_position_id"];
    recording.same_speckle = entry["same_speckle"];
    recording.repeat_group = entry["repeat_group"];
    recording.frame = frame;
    FrameSetup& own = recording.frame;
    own.shutter_open = !recording.dark;
    own.exposure_time_s = entry["exposure_time_s"];
    own.lens.f_number =
        entry["f_number"].get<double>() * (1 + off("f_number_relative")) * options.f_number_factor;
    own.lens.focus_distance_m =
        entry["focus_distance_m"].get<double>() * (1 + off("focus_distance_relative"));
    own.plate.camera_distance_m =
        entry["camera_distance_m"].get<double>() + off("camera_distance_m");
    own.plate.laser_distance_m = entry["laser_distance_m"].get<double>() + off("laser_distance_m");
    own.plate.line_offset_m = entry["line_offset_m"];
    own.roi = {entry["roi_column_px"], entry["roi_row_px"], entry["roi_columns_px"],
               entry["roi_rows_px"]};
    recording.raw = ReadRaw(folder + "/" + recording.file, own.roi);
    set.recordings.push_back(std::move(recording));
  }
  return set;
}

// Metres on the plate across the line that move the image by a pixel.
double PlateMetresPerPixel(const FrameSetup& frame) {
  return frame.sensor.pixel_pitch_m * frame.plate.camera_distance_m / frame.ImageDistance();
}

Raw Simulate(const Recording& recording, int index, double shift_px, int realisation, int threads) {
  FrameSetup frame = recording.frame;
  frame.plate.line_offset_m += shift_px * PlateMetresPerPixel(frame);
  // One position has one speckle.
  frame.seeds.speckle = 1'000'003ULL * static_cast<uint64_t>(realisation + 1) +
                        static_cast<uint64_t>(recording.position);
  frame.seeds.noise =
      7'000'003ULL * static_cast<uint64_t>(realisation + 1) + static_cast<uint64_t>(index);
  auto formed = RenderPlateFrame(frame, {}, nullptr, threads);
  if (!formed.ok()) Fail(kName, recording.file + ": " + std::string(formed.status().message()));
  return std::move(formed->raw_dn);
}

int ChannelOf(const Recording& recording, int row, int column) {
  return recording.frame.sensor.ChannelAt(recording.frame.roi.row_px + row,
                                          recording.frame.roi.column_px + column);
}

// Mean over a row's pixels of one channel; NaN where it has none.
using Profile = std::vector<double>;
Profile RowMeans(const Recording& recording, const Raw& raw, int channel) {
  Profile profile(static_cast<size_t>(raw.rows_px));
  for (int i = 0; i < raw.rows_px; ++i) {
    double sum = 0;
    int count = 0;
    for (int j = 0; j < raw.columns_px; ++j) {
      if (ChannelOf(recording, i, j) != channel) continue;
      sum += raw.At(i, j);
      ++count;
    }
    profile[i] = count > 0 ? sum / count : NAN;
  }
  return profile;
}

Profile MeanProfile(const std::vector<Profile>& profiles) {
  Profile mean(profiles[0].size());
  for (size_t i = 0; i < mean.size(); ++i) {
    for (const Profile& profile : profiles) mean[i] += profile[i];
    mean[i] /= static_cast<double>(profiles.size());
  }
  return mean;
}

// Derivative by row; between rows of the same channel.
double Slope(const Profile& profile, size_t i) {
  for (size_t step : {1, 2}) {
    if (i < step || i + step >= profile.size()) continue;
    if (std::isnan(profile[i - step]) || std::isnan(profile[i + step])) continue;
    return (profile[i + step] - profile[i - step]) / (2.0 * static_cast<double>(step));
  }
  return 0;
}

// Normal equation of the line's shift in one channel: weights as of speckle and noise.
void AddShift(const Profile& data, const Profile& model, double& numerator, double& denominator) {
  const double peak = *std::max_element(model.begin(), model.end(), [](double a, double b) {
    return (std::isnan(a) ? -1 : a) < (std::isnan(b) ? -1 : b);
  });
  for (size_t i = 0; i < model.size(); ++i) {
    if (std::isnan(model[i])) continue;
    const double slope = -Slope(model, i);
    const double weight = 1 / (model[i] * model[i] + 1e-3 * peak * peak);
    numerator += weight * slope * (data[i] - model[i]);
    denominator += weight * slope * slope;
  }
}

// Rows of one channel in classes by the share of the line's light above them.
std::vector<std::vector<int>> RowClasses(const Profile& model, double dark) {
  std::vector<int> rows;
  double total = 0;
  for (size_t i = 0; i < model.size(); ++i) {
    if (std::isnan(model[i])) continue;
    rows.push_back(static_cast<int>(i));
    total += std::max(0.0, model[i] - dark);
  }
  constexpr double kShares[] = {1e-3, 5e-3, 0.03, 0.15, 0.4, 0.6, 0.85, 0.97, 0.995, 0.999};
  std::vector<std::vector<int>> classes(1);
  double sum = 0;
  size_t next = 0;
  for (const int row : rows) {
    if (next < std::size(kShares) && sum > kShares[next] * total && !classes.back().empty()) {
      classes.emplace_back();
      while (next < std::size(kShares) && sum > kShares[next] * total) ++next;
    }
    classes.back().push_back(row);
    sum += std::max(0.0, model[row] - dark);
  }
  return classes;
}

// A statistic of one image: a vector per block of columns.
using Blocks = std::vector<VectorXd>;

struct View {
  const Recording* recording;
  int channel;
  std::vector<std::vector<int>> classes;
  std::vector<bool> core;                // rows above half the peak
  std::vector<std::array<int, 2>> lags;  // (rows, columns) of the correlation, (0, 0) first
  double dark;
};

template <typename Add>
void ForPixels(const View& view, int block, const std::vector<int>& rows, const Add& add) {
  for (const int i : rows) {
    for (int j = block * kBlock_px; j < (block + 1) * kBlock_px; ++j) {
      if (ChannelOf(*view.recording, i, j) == view.channel) add(i, j);
    }
  }
}

int BlockCount(const Raw& raw) { return raw.columns_px / kBlock_px; }

Blocks ProfileBlocks(const View& view, const Raw& raw) {
  Blocks blocks;
  for (int block = 0; block < BlockCount(raw); ++block) {
    VectorXd values(static_cast<Eigen::Index>(view.classes.size()));
    for (Eigen::Index c = 0; c < values.size(); ++c) {
      double sum = 0;
      int count = 0;
      ForPixels(view, block, view.classes[c], [&](int i, int j) {
        sum += raw.At(i, j);
        ++count;
      });
      values[c] = sum / count;
    }
    blocks.push_back(values);
  }
  return blocks;
}

// Mean square deviation from the image's own row means.
Blocks VarianceBlocks(const View& view, const Raw& raw) {
  const Profile means = RowMeans(*view.recording, raw, view.channel);
  Blocks blocks;
  for (int block = 0; block < BlockCount(raw); ++block) {
    VectorXd values(static_cast<Eigen::Index>(view.classes.size()));
    for (Eigen::Index c = 0; c < values.size(); ++c) {
      double sum = 0;
      int count = 0;
      ForPixels(view, block, view.classes[c], [&](int i, int j) {
        sum += (raw.At(i, j) - means[i]) * (raw.At(i, j) - means[i]);
        ++count;
      });
      values[c] = sum / count;
    }
    blocks.push_back(values);
  }
  return blocks;
}

// Products of relative deviations of pixels in the line's core, at distance 0 and at some distances
// along and across the line (any channels).
Blocks CorrelationBlocks(const View& view, const Raw& raw) {
  Image<double> relative(raw.columns_px, raw.rows_px);
  const int channels = view.recording->frame.sensor.channels();
  for (int channel = 0; channel < channels; ++channel) {
    const Profile means = RowMeans(*view.recording, raw, channel);
    for (int i = 0; i < raw.rows_px; ++i) {
      if (!view.core[i] || std::isnan(means[i])) continue;
      for (int j = 0; j < raw.columns_px; ++j) {
        if (ChannelOf(*view.recording, i, j) != channel) continue;
        relative.At(i, j) = (raw.At(i, j) - means[i]) / (means[i] - view.dark);
      }
    }
  }
  Blocks blocks;
  for (int block = 0; block < BlockCount(raw); ++block) {
    VectorXd values(static_cast<Eigen::Index>(view.lags.size()));
    for (Eigen::Index lag = 0; lag < values.size(); ++lag) {
      double sum = 0;
      int count = 0;
      for (int i = 0; i + view.lags[lag][0] < raw.rows_px; ++i) {
        if (!view.core[i] || !view.core[i + view.lags[lag][0]]) continue;
        for (int j = block * kBlock_px; j + view.lags[lag][1] < (block + 1) * kBlock_px; ++j) {
          sum += relative.At(i, j) * relative.At(i + view.lags[lag][0], j + view.lags[lag][1]);
          ++count;
        }
      }
      values[lag] = count > 0 ? sum / count : 0;
    }
    blocks.push_back(values);
  }
  return blocks;
}

// Mean signal above dark over all rows.
Blocks SignalBlocks(const View& view, const Raw& raw) {
  Blocks blocks;
  for (int block = 0; block < BlockCount(raw); ++block) {
    double sum = 0;
    int count = 0;
    for (const std::vector<int>& rows : view.classes) {
      ForPixels(view, block, rows, [&](int i, int j) {
        sum += raw.At(i, j) - view.dark;
        ++count;
      });
    }
    blocks.push_back(VectorXd::Constant(1, sum / count));
  }
  return blocks;
}

// Squared contrast in the line's core, noise included.
Blocks ContrastBlocks(const View& view, const Raw& raw) {
  Blocks blocks;
  for (const VectorXd& block : CorrelationBlocks(view, raw)) blocks.push_back(block.head(1));
  return blocks;
}

Blocks SaturationBlocks(const View& view, const Raw& raw) {
  const double full = view.recording->frame.sensor.largest_dn();
  Blocks blocks;
  for (int block = 0; block < BlockCount(raw); ++block) {
    double sum = 0;
    int count = 0;
    for (int i = 0; i < raw.rows_px; ++i) {
      for (int j = block * kBlock_px; j < (block + 1) * kBlock_px; ++j) {
        if (ChannelOf(*view.recording, i, j) != view.channel) continue;
        sum += raw.At(i, j) >= full;
        ++count;
      }
    }
    blocks.push_back(VectorXd::Constant(1, sum / count));
  }
  return blocks;
}

VectorXd MeanOf(const Blocks& blocks) {
  VectorXd mean = VectorXd::Zero(blocks[0].size());
  for (const VectorXd& block : blocks) mean += block;
  return mean / static_cast<double>(blocks.size());
}

struct Test {
  double t_squared = 0;
  int dimension = 0;
  double p = NAN;  // NaN: nothing to compare
  VectorXd z;      // each entry's deviation in standard errors
  // First component: recording minus simulation, and its standard error.
  double difference = 0, standard_error = 0;
};

// The compared quantity: a linear map of a block's vector, given the simulated mean.
using Map = std::function<MatrixXd(const VectorXd& simulated_mean)>;

// Hotelling's test of the recording against the simulated images. The covariance of an image's mean
// is that of its block means about the mean of the same block over realisations, by the number of
// blocks.
Test Compare(const Blocks& data, const std::vector<Blocks>& simulated, const Map& map) {
  const size_t block_count = data.size();
  const double realisations = static_cast<double>(simulated.size());
  VectorXd mean = VectorXd::Zero(data[0].size());
  for (const Blocks& blocks : simulated) mean += MeanOf(blocks) / realisations;
  const MatrixXd projection = map(mean);
  Test test;
  test.dimension = static_cast<int>(projection.rows());
  if (test.dimension == 0) return test;
  MatrixXd covariance = MatrixXd::Zero(test.dimension, test.dimension);
  for (size_t b = 0; b < block_count; ++b) {
    VectorXd block_mean = VectorXd::Zero(data[0].size());
    for (const Blocks& blocks : simulated) block_mean += blocks[b] / realisations;
    for (const Blocks& blocks : simulated) {
      const VectorXd deviation = projection * (blocks[b] - block_mean);
      covariance += deviation * deviation.transpose();
    }
  }
  const double freedom = static_cast<double>(block_count) * (realisations - 1);
  covariance /= freedom;
  covariance *= (1 + 1 / realisations) / static_cast<double>(block_count);
  const VectorXd difference = projection * (MeanOf(data) - mean);
  test.z = difference.array() / covariance.diagonal().array().sqrt();
  test.difference = difference[0];
  test.standard_error = std::sqrt(covariance(0, 0));
  const Eigen::LDLT<MatrixXd> solver(covariance);
  if (covariance.diagonal().minCoeff() <= 0 || !solver.isPositive()) return test;
  test.t_squared = difference.dot(solver.solve(difference));
  const double p = test.dimension;
  const double f = test.t_squared * (freedom - p + 1) / (freedom * p);
  test.p = boost::math::cdf(
      boost::math::complement(boost::math::fisher_f(p, freedom - p + 1), std::max(f, 0.0)));
  return test;
}

// Fisher: -2 sum ln p is chi-squared of 2 k degrees of freedom.
double CombinedP(const std::vector<double>& values) {
  if (values.empty()) return NAN;
  double sum = 0;
  for (const double p : values) sum += -2 * std::log(std::max(p, 1e-300));
  return boost::math::cdf(boost::math::complement(
      boost::math::chi_squared(2.0 * static_cast<double>(values.size())), sum));
}

// Mean and variance of dark frames against the closed form of round(K max(e, 0)).
struct DarkTest {
  double mean_z, variance_z, p;
};
DarkTest CompareDark(const Recording& recording) {
  const Sensor& sensor = recording.frame.sensor;
  const boost::math::normal charge(sensor.dark_mean_electrons, sensor.dark_noise_electrons);
  std::vector<double> probability;
  double below = 0;
  for (int y = 0; below < 1 - 1e-14 && y < 1024; ++y) {
    const double up_to = boost::math::cdf(charge, (y + 0.5) / sensor.gain_dn_per_electron);
    probability.push_back(up_to - below);  // negative values read 0
    below = up_to;
  }
  double mean = 0, variance = 0, fourth = 0;
  for (size_t y = 0; y < probability.size(); ++y) mean += static_cast<double>(y) * probability[y];
  for (size_t y = 0; y < probability.size(); ++y) {
    const double square = std::pow(static_cast<double>(y) - mean, 2);
    variance += square * probability[y];
    fourth += square * square * probability[y];
  }
  const double n = static_cast<double>(recording.raw.values.size());
  double sum = 0, squares = 0;
  for (const uint16_t value : recording.raw.values) sum += value;
  for (const uint16_t value : recording.raw.values) squares += std::pow(value - mean, 2);
  DarkTest test;
  test.mean_z = (sum / n - mean) / std::sqrt(variance / n);
  test.variance_z = (squares / n - variance) / std::sqrt((fourth - variance * variance) / n);
  // Third moments are near zero, so the two are nearly independent.
  test.p = boost::math::cdf(boost::math::complement(
      boost::math::chi_squared(2), test.mean_z * test.mean_z + test.variance_z * test.variance_z));
  return test;
}

class SetComparison {
 public:
  SetComparison(const Set& set, const Options& options)
      : set_(set),
        realisations_(options.realisations),
        threads_(options.threads),
        explain_below_(options.explain_below) {}

  Json Run() {
    const int channels = set_.recordings[0].frame.sensor.channels();
    std::printf("\n%s\n%-4s %-14s %5s %7s %8s", set_.name.c_str(), "file", "series", "f/", "shift",
                "t [ms]");
    std::printf("  %s\n", channels == 1 ? "p: profile variance correlation saturation (share)"
                                        : "p per channel R G B: profile | variance | "
                                          "correlation | saturation (share)");
    for (size_t index = 0; index < set_.recordings.size(); ++index) {
      const Recording& recording = set_.recordings[index];
      if (recording.dark) {
        const DarkTest test = CompareDark(recording);
        std::printf(
            "%-4s %-14s                        dark: mean %+.2f sigma, variance %+.2f "
            "sigma, p %.3f\n",
            Number(recording).c_str(), recording.series.c_str(), test.mean_z, test.variance_z,
            test.p);
        Note(recording, "dark", 0, test.p, true);
        continue;
      }
      CompareLaser(index);
    }
    return Summary();
  }

 private:
  static std::string Number(const Recording& recording) {
    return recording.file.substr(recording.file.size() - 7, 3);
  }

  void Note(const Recording& recording, const std::string& statistic, int channel, double p,
            bool independent) {
    results_.push_back({{"file", recording.file},
                        {"series", recording.series},
                        {"statistic", statistic},
                        {"channel", channel},
                        {"p", std::isnan(p) ? Json(nullptr) : Json(p)}});
    if (std::isnan(p) || !independent) return;
    by_series_[statistic][recording.series].push_back(p);
    by_series_[statistic]["all"].push_back(p);
  }

  // Least squares on the mean profiles of all recordings of a position.
  double Shift(size_t index) {
    const Recording& first = set_.recordings[index];
    const auto known = shifts_.find(first.position);
    if (known != shifts_.end()) return known->second;
    double shift = 0;
    for (int iteration = 0; iteration < 3; ++iteration) {
      double numerator = 0, denominator = 0;
      for (size_t other = index; other < set_.recordings.size(); ++other) {
        const Recording& recording = set_.recordings[other];
        if (recording.position != first.position) continue;
        const int channels = recording.frame.sensor.channels();
        std::vector<std::vector<Profile>> profiles(static_cast<size_t>(channels));
        for (int r = 0; r < std::min(realisations_, 6); ++r) {
          // Other realisations than the test uses.
          const Raw raw = Simulate(recording, static_cast<int>(other), shift, 1000 + r, threads_);
          for (int channel = 0; channel < channels; ++channel) {
            profiles[channel].push_back(RowMeans(recording, raw, channel));
          }
        }
        for (int channel = 0; channel < channels; ++channel) {
          AddShift(RowMeans(recording, recording.raw, channel), MeanProfile(profiles[channel]),
                   numerator, denominator);
        }
      }
      shift += std::clamp(numerator / denominator, -2.0, 2.0);
    }
    shifts_[first.position] = shift;
    return shift;
  }

  void CompareLaser(size_t index) {
    const Recording& recording = set_.recordings[index];
    const double shift = Shift(index);
    std::vector<Raw> simulated;
    for (int r = 0; r < realisations_; ++r) {
      simulated.push_back(Simulate(recording, static_cast<int>(index), shift, r, threads_));
    }
    std::printf("%-4s %-14s %5.1f %+7.2f %8.3f ", Number(recording).c_str(),
                recording.series.c_str(), recording.frame.lens.f_number, shift,
                1e3 * recording.frame.exposure_time_s);
    const bool independent = !recording.same_speckle;
    const Sensor& sensor = recording.frame.sensor;
    const double dark = sensor.gain_dn_per_electron * sensor.dark_mean_electrons;
    std::map<std::string, std::vector<double>> row;
    std::vector<double> shares;
    std::vector<View> views;
    for (int channel = 0; channel < sensor.channels(); ++channel) {
      std::vector<Profile> profiles;
      for (const Raw& raw : simulated) profiles.push_back(RowMeans(recording, raw, channel));
      const Profile model = MeanProfile(profiles);
      double peak = 0;
      for (const double value : model) peak = std::max(peak, std::isnan(value) ? 0 : value);
      View view = {&recording, channel, RowClasses(model, dark), {}, {}, dark};
      for (const double value : model) view.core.push_back(value - dark > 0.5 * (peak - dark));
      // Rows without this channel belong to the core between rows that do.
      for (size_t i = 1; i + 1 < model.size(); ++i) {
        if (std::isnan(model[i])) view.core[i] = view.core[i - 1] && view.core[i + 1];
      }
      const auto core_rows = std::count(view.core.begin(), view.core.end(), true);
      for (const std::array<int, 2> lag : {std::array{0, 0},
                                           {0, 1},
                                           {0, 2},
                                           {0, 3},
                                           {0, 4},
                                           {0, 6},
                                           {1, 0},
                                           {2, 0},
                                           {3, 0},
                                           {1, 1}}) {
        if (lag[0] < core_rows) view.lags.push_back(lag);
      }
      views.push_back(view);
      // Means of a class change with a shift by its rows' mean slope: that direction is fitted.
      VectorXd slope(static_cast<Eigen::Index>(view.classes.size()));
      for (Eigen::Index c = 0; c < slope.size(); ++c) {
        double sum = 0;
        for (const int i : view.classes[c]) sum += Slope(model, static_cast<size_t>(i));
        slope[c] = sum / static_cast<double>(view.classes[c].size());
      }
      const Map without_slope = [&](const VectorXd&) {
        const Eigen::HouseholderQR<MatrixXd> qr(slope);
        const MatrixXd basis = qr.householderQ();
        return MatrixXd(basis.rightCols(slope.size() - 1).transpose());
      };
      const Map logarithm = [](const VectorXd& mean) {
        return MatrixXd(mean.cwiseInverse().asDiagonal());
      };
      const Map all = [](const VectorXd& mean) {
        return MatrixXd(MatrixXd::Identity(mean.size(), mean.size()));
      };
      // Correlation coefficients: products over the product at distance 0, to first order.
      const Map coefficient = [](const VectorXd& mean) {
        MatrixXd map = MatrixXd::Zero(mean.size() - 1, mean.size());
        for (Eigen::Index i = 1; i < mean.size(); ++i) {
          map(i - 1, i) = 1 / mean[0];
          map(i - 1, 0) = -mean[i] / (mean[0] * mean[0]);
        }
        return map;
      };
      // One number per recording, relative: many recordings show a common error of a fraction of
      // theirs.
      const auto run_ratio = [&](const char* statistic, auto blocks_of) {
        std::vector<Blocks> blocks;
        for (const Raw& raw : simulated) blocks.push_back(blocks_of(view, raw));
        const Test test = Compare(blocks_of(view, recording.raw), blocks, logarithm);
        Note(recording, statistic, channel, test.p, false);
        if (independent && !std::isnan(test.p)) {
          ratios_[statistic].push_back({test.difference, test.standard_error});
        }
      };
      if (sensor.channels() == 1 || channel == kGreen) {
        run_ratio("signal", SignalBlocks);
        run_ratio("contrast", ContrastBlocks);
      }
      const auto run = [&](const char* statistic, auto blocks_of, const Map& map) {
        std::vector<Blocks> blocks;
        for (const Raw& raw : simulated) blocks.push_back(blocks_of(view, raw));
        const Test test = Compare(blocks_of(view, recording.raw), blocks, map);
        // Channels see the same speckle: green (mono: all) stands for the recording.
        Note(recording, statistic, channel, test.p,
             independent && (sensor.channels() == 1 || channel == kGreen));
        row[statistic].push_back(test.p);
        if (test.p < explain_below_ || test.p > 1 - explain_below_) {
          std::string z;
          for (Eigen::Index i = 0; i < test.z.size(); ++i) {
            char text[16];
            std::snprintf(text, sizeof(text), " %+.1f", test.z[i]);
            z += text;
          }
          outliers_.push_back(Number(recording) + " channel " + std::to_string(channel) + " " +
                              statistic + " z:" + z);
        }
      };
      run("profile", ProfileBlocks, without_slope);
      run("variance", VarianceBlocks, logarithm);
      if (sensor.channels() == 1 || channel == kGreen) {
        run("correlation", CorrelationBlocks, coefficient);
      }
      run("saturation", SaturationBlocks, all);
      double share = 0;
      for (const VectorXd& block : SaturationBlocks(view, recording.raw)) share += block[0];
      shares.push_back(share / BlockCount(recording.raw));
    }
    for (const char* statistic : {"profile", "variance", "correlation", "saturation"}) {
      for (const double p : row[statistic]) std::printf(" %5.3f", p);
      std::printf(" |");
    }
    for (const double share : shares) std::printf(" %.2f%%", 100 * share);
    std::printf("\n");
    ComparePairs(index, shift, views, simulated);
  }

  // Temporal variance: half the mean square difference to an earlier frame of the same place and
  // exposure.
  void ComparePairs(size_t index, double shift, const std::vector<View>& views,
                    const std::vector<Raw>& simulated) {
    const Recording& recording = set_.recordings[index];
    for (size_t other = 0; other < index; ++other) {
      const Recording& earlier = set_.recordings[other];
      if (earlier.position != recording.position ||
          earlier.repeat_group != recording.repeat_group) {
        continue;
      }
      for (const View& view : views) {
        const auto blocks_of = [&](const Raw& a, const Raw& b) {
          Blocks blocks;
          for (int block = 0; block < BlockCount(a); ++block) {
            VectorXd values(static_cast<Eigen::Index>(view.classes.size()));
            for (Eigen::Index c = 0; c < values.size(); ++c) {
              double sum = 0;
              int count = 0;
              ForPixels(view, block, view.classes[c], [&](int i, int j) {
                sum += std::pow(static_cast<double>(a.At(i, j)) - b.At(i, j), 2) / 2;
                ++count;
              });
              values[c] = sum / count;
            }
            blocks.push_back(values);
          }
          return blocks;
        };
        std::vector<Blocks> blocks;
        for (int r = 0; r < realisations_; ++r) {
          blocks.push_back(blocks_of(
              simulated[r], Simulate(earlier, static_cast<int>(other), shift, r, threads_)));
        }
        const Test test = Compare(
            blocks_of(recording.raw, earlier.raw), blocks,
            [](const VectorXd& mean) { return MatrixXd(mean.cwiseInverse().asDiagonal()); });
        std::printf("     temporal variance against %s, channel %d: p %.3f\n",
                    Number(earlier).c_str(), view.channel, test.p);
        Note(recording, "temporal variance", view.channel, test.p, true);
      }
    }
  }

  Json Summary() {
    std::printf("\n%-18s %s\n", "series p", "(number of recordings)");
    Json series = Json::array();
    int outside = 0;
    for (const auto& [statistic, groups] : by_series_) {
      std::printf("%-18s", statistic.c_str());
      for (const auto& [name, values] : groups) {
        const double p = CombinedP(values);
        if (!(p >= 1e-3 && p <= 0.999)) ++outside;
        std::printf(" %s %.3f (%zu)", name.c_str(), p, values.size());
        series.push_back(
            {{"statistic", statistic}, {"series", name}, {"p", p}, {"recordings", values.size()}});
      }
      std::printf("\n");
    }
    for (const auto& [statistic, ratios] : ratios_) {
      double weights = 0, sum = 0, chi_squared = 0;
      for (const auto& [difference, error] : ratios) {
        weights += 1 / (error * error);
        sum += difference / (error * error);
      }
      const double mean = sum / weights, error = 1 / std::sqrt(weights);
      for (const auto& [difference, own] : ratios) {
        chi_squared += std::pow((difference - mean) / own, 2);
      }
      const double p = boost::math::cdf(
          boost::math::complement(boost::math::chi_squared(1), mean * mean / (error * error)));
      const double spread = boost::math::cdf(boost::math::complement(
          boost::math::chi_squared(static_cast<double>(ratios.size()) - 1), chi_squared));
      if (!(p >= 1e-3 && p <= 0.999)) ++outside;
      if (!(spread >= 1e-3 && spread <= 0.999)) ++outside;
      std::printf(
          "%s, recording over simulation: %.4f +- %.4f, p %.3f; spread between recordings p "
          "%.3f (%zu)\n",
          statistic.c_str(), 1 + mean, error, p, spread, ratios.size());
      series.push_back({{"statistic", statistic},
                        {"series", "common ratio"},
                        {"ratio", 1 + mean},
                        {"standard_error", error},
                        {"p", p},
                        {"recordings", ratios.size()}});
      series.push_back({{"statistic", statistic},
                        {"series", "spread"},
                        {"p", spread},
                        {"recordings", ratios.size()}});
    }
    std::printf("series p outside [0.001, 0.999]: %d of %zu\n", outside, series.size());
    for (const std::string& outlier : outliers_) std::printf("outlier: %s\n", outlier.c_str());
    return {{"set", set_.name},
            {"realisations", realisations_},
            {"series", series},
            {"outside", outside},
            {"recordings", results_}};
  }

  const Set& set_;
  const int realisations_;
  const int threads_;
  const double explain_below_;
  std::map<int, double> shifts_;
  std::map<std::string, std::map<std::string, std::vector<double>>> by_series_;
  std::map<std::string, std::vector<std::pair<double, double>>> ratios_;  // and standard errors
  std::vector<std::string> outliers_;
  Json results_ = Json::array();
};

int Run(const Options& options) {
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  const char* root = std::getenv("SIGHTLINE_SOURCE_DIR");
  const char* shared = std::getenv("SIGHTLINE_SHARED_DIR");
  const std::string folder =
      (shared != nullptr ? std::string(shared)
                         : std::string(root != nullptr ? root : ".") + "/../shared") +
      "/recordings/open/";
  if (!std::ifstream(folder + options.sets[0] + "/recordings.json")) {
    std::printf("skipped: no shared data\n");
    return 0;
  }
  PrintMachine();
  Json results = Json::array();
  for (const std::string& name : options.sets) {
    const Set set = ReadSet(folder + name, options);
    results.push_back(SetComparison(set, options).Run());
  }
  WriteResults(options.json, kName, results);
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) {
  CLI::App app("Null plates: simulation against recordings");
  sightline::bench::Options options;
  app.add_option("--sets", options.sets)->delimiter(',');
  app.add_option("--series", options.series, "default: all")->delimiter(',');
  app.add_option("--realisations", options.realisations)->check(CLI::Range(4, 1000));
  app.add_option("--threads", options.threads)->check(CLI::PositiveNumber);
  app.add_option("--explain-below", options.explain_below, "print deviations for smaller p");
  app.add_option("--power-factor", options.power_factor, "simulate with a wrong laser power");
  app.add_option("--f-number-factor", options.f_number_factor, "simulate with a wrong aperture");
  app.add_option("--json", options.json);
  CLI11_PARSE(app, argc, argv);
  return sightline::bench::Run(options);
}
