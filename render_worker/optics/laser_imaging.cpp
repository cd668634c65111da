// SPDX-License-Identifier: Apache-2.0
#include "render_worker/optics/laser_imaging.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <optional>

#include "core/random/counter_random.h"
#include "render_worker/optics/band_transform.h"
#include "render_worker/optics/clear_fraction_map.h"
#include "render_worker/optics/complex_product.h"
#include "render_worker/optics/fourier.h"
#include "render_worker/optics/parallel_rows.h"
#include "render_worker/optics/pixel_integration.h"
#include "render_worker/optics/pupil_transfer.h"

namespace sightline {
namespace {

// Light below this share of the image's brightest sample counts as none: a billionth of a pixel at
// full well is far less than one electron in the longest of exposures.
constexpr float kDarkShare = 1e-9F;
// Samples of one transform; three quarters of them are held at once, 8 bytes each.
constexpr int64_t kLargestTransform = int64_t{1} << 25;
// Blocks over which a pupil that varies over the field counts as constant; larger where light
// spreads far, that is at small apertures, where aberrations are small.
constexpr int kFieldBlock_px = 96;
constexpr int kTile_px = 8;

// Half-open range of pixels, relative to the grid's first pixel.
struct Range {
  int begin = 0, end = 0;
  int size() const { return std::max(0, end - begin); }
  bool empty() const { return end <= begin; }
};

struct Rectangle {
  Range columns, rows;
  bool empty() const { return columns.empty() || rows.empty(); }
};

Range Grow(Range range, int by, int limit) {
  return {std::max(0, range.begin - by), std::min(limit, range.end + by)};
}

Range Meet(Range a, Range b) { return {std::max(a.begin, b.begin), std::min(a.end, b.end)}; }

// Layers that occur somewhere; none at first.
struct LayerSpan {
  int least = 65535, most = 0;
  void Add(LayerSpan other) {
    least = std::min(least, other.least);
    most = std::max(most, other.most);
  }
  int size() const { return std::max(0, most - least + 1); }
};

// Least period in which no source comes nearer than `reach` to an output by wrapping around, and
// where it starts.
struct Axis {
  int origin_px, length_px;
};
Axis Period(Range source, Range output, int reach) {
  const int origin = std::min(source.begin, output.begin);
  const int span = std::max(source.end, output.end) - origin;
  const int apart = std::max(source.end - output.begin, output.end - source.begin) + reach;
  return {origin, FastLength(std::max(span, apart), 1)};
}

class LaserImaging {
 public:
  LaserImaging(const IdealImage& image, const OpticsModel& optics, const SpeckleModel& speckle,
               int threads)
      : image_(image),
        grid_(image.grid),
        optics_(optics),
        speckle_(speckle),
        threads_(threads),
        clear_(optics, image.grid, threads) {
    assert(image.laser_irradiance_w_m2.columns_px == grid_.columns());
    assert(image.laser_irradiance_w_m2.rows_px == grid_.rows());
  }

  Image<float> Run() {
    result_ = Image<float>(grid_.roi.columns_px, grid_.roi.rows_px);
    for (const Rectangle& block : Prepare()) ImageBlock(block);
    return std::move(result_);
  }

  std::vector<LaserTransform> Transforms() {
    std::vector<LaserTransform> transforms;
    for (const Rectangle& block : Prepare()) {
      if (const std::optional<Geometry> geometry = Plan(block)) {
        transforms.push_back({geometry->columns.origin_px, geometry->rows.origin_px,
                              geometry->columns.length_px, geometry->rows.length_px});
      }
    }
    return transforms;
  }

 private:
  // Finds light and depth layers; the blocks, none if all is dark.
  std::vector<Rectangle> Prepare() {
    FindLight();
    if (!(dark_ > 0)) return {};
    SplitDepth();
    const RegionOfInterest& roi = grid_.roi;
    const double p = grid_.pixel_pitch_m;
    const double field_radius =
        std::hypot(std::max(std::abs(roi.column_px), std::abs(roi.column_px + roi.columns_px)) * p,
                   std::max(std::abs(roi.row_px), std::abs(roi.row_px + roi.rows_px)) * p);
    double largest_curvature = 0;
    for (const double curvature : layers_) {
      largest_curvature = std::max(largest_curvature, std::abs(curvature));
    }
    reach_px_ = RequiredMargin(optics_, largest_curvature, p, field_radius);
    return Blocks();
  }

  bool Lit(int row, int column) const {
    return image_.laser_irradiance_w_m2.At(row, column) > dark_;
  }

  // Brightest sample and tiles with light.
  void FindLight() {
    const Image<float>& light = image_.laser_irradiance_w_m2;
    std::vector<float> brightest(static_cast<size_t>(light.rows_px));
    ForIndexRanges(threads_, light.rows_px, [&](int begin, int end) {
      for (int row = begin; row < end; ++row) {
        brightest[row] = *std::max_element(light.Row(row), light.Row(row) + light.columns_px);
      }
    });
    dark_ = kDarkShare * *std::max_element(brightest.begin(), brightest.end());
    if (!(dark_ > 0)) return;
    const int tile = kTile_px * grid_.sub_pixels;
    lit_tiles_ =
        Image<uint8_t>((light.columns_px + tile - 1) / tile, (light.rows_px + tile - 1) / tile);
    ForIndexRanges(threads_, lit_tiles_.rows_px, [&](int begin, int end) {
      for (int row = begin * tile; row < std::min(end * tile, light.rows_px); ++row) {
        for (int column = 0; column < light.columns_px; ++column) {
          if (Lit(row, column)) lit_tiles_.At(row / tile, column / tile) = 1;
        }
      }
    });
    FindNearestLitTiles();
  }

  void FindNearestLitTiles() {
    const int columns = lit_tiles_.columns_px;
    lit_from_ = Image<int>(columns, lit_tiles_.rows_px);
    lit_until_ = lit_from_;
    for (int i = 0; i < lit_tiles_.rows_px; ++i) {
      int until = -1;
      for (int j = 0; j < columns; ++j) {
        if (lit_tiles_.At(i, j) != 0) until = j;
        lit_until_.At(i, j) = until;
      }
      int from = columns;
      for (int j = columns - 1; j >= 0; --j) {
        if (lit_tiles_.At(i, j) != 0) from = j;
        lit_from_.At(i, j) = from;
      }
    }
  }

  double CurvatureAt(int row, int column) const {
    const double depth =
        image_.depth_m.empty() ? image_.constant_depth_m : image_.depth_m.At(row, column);
    return optics_.curvature(depth, grid_.U(column), grid_.V(row));
  }

  // Layers of curvature: the wavefront error at the pupil's rim, 1/2 curvature r^2, differs by less
  // than optics_.layer_step_waves between neighbours.
  void SplitDepth() {
    if (image_.depth_m.empty() && !optics_.field_dependent && !optics_.curvature_varies) {
      layers_ = {optics_.curvature(image_.constant_depth_m, 0, 0)};
      return;
    }
    const int rows = grid_.rows();
    std::vector<std::array<double, 2>> extremes(static_cast<size_t>(rows), {INFINITY, -INFINITY});
    ForIndexRanges(threads_, rows, [&](int begin, int end) {
      for (int row = begin; row < end; ++row) {
        for (int column = 0; column < grid_.columns(); ++column) {
          if (!Lit(row, column)) continue;
          const double curvature = CurvatureAt(row, column);
          extremes[row][0] = std::min(extremes[row][0], curvature);
          extremes[row][1] = std::max(extremes[row][1], curvature);
        }
      }
    });
    double least = INFINITY, most = -INFINITY;
    for (const std::array<double, 2>& row : extremes) {
      least = std::min(least, row[0]);
      most = std::max(most, row[1]);
    }
    const double radius = optics_.pupil(0, 0).OuterRadius();
    const double step = 2 * optics_.layer_step_waves * optics_.wavelength_m / (radius * radius);
    if (most == least) {
      layers_ = {least};
      return;
    }
    // The nearest and the farthest layer hold the extremes.
    const double steps = std::clamp(std::ceil((most - least) / step), 1.0, 65534.0);
    for (int layer = 0; layer <= static_cast<int>(steps); ++layer) {
      layers_.push_back(least + layer / steps * (most - least));
    }
    layer_of_ = Image<uint16_t>(grid_.columns(), rows);
    const int tile = kTile_px * grid_.sub_pixels;
    tile_layers_ = Image<LayerSpan>(lit_tiles_.columns_px, lit_tiles_.rows_px);
    ForIndexRanges(threads_, lit_tiles_.rows_px, [&](int begin, int end) {
      for (int row = begin * tile; row < std::min(end * tile, rows); ++row) {
        for (int column = 0; column < grid_.columns(); ++column) {
          if (!Lit(row, column)) continue;
          const double place = (CurvatureAt(row, column) - least) / (most - least) * steps;
          const auto layer = static_cast<uint16_t>(std::clamp(std::round(place), 0.0, steps));
          layer_of_.At(row, column) = layer;
          tile_layers_.At(row / tile, column / tile).Add({layer, layer});
        }
      }
    });
  }

  // Lit part of a rectangle, to whole tiles.
  Rectangle LitPart(const Rectangle& within) const {
    Rectangle lit = {{within.columns.end, within.columns.begin},
                     {within.rows.end, within.rows.begin}};
    if (within.empty()) return lit;
    const int first_column = within.columns.begin / kTile_px;
    const int last_column = (within.columns.end - 1) / kTile_px;
    for (int i = within.rows.begin / kTile_px; i * kTile_px < within.rows.end; ++i) {
      const int from = lit_from_.At(i, first_column), until = lit_until_.At(i, last_column);
      if (from > until) continue;
      lit.rows.begin = std::min(lit.rows.begin, i * kTile_px);
      lit.rows.end = std::max(lit.rows.end, (i + 1) * kTile_px);
      lit.columns.begin = std::min(lit.columns.begin, from * kTile_px);
      lit.columns.end = std::max(lit.columns.end, (until + 1) * kTile_px);
    }
    return {Meet(lit.columns, within.columns), Meet(lit.rows, within.rows)};
  }

  struct Geometry {
    Rectangle source, output;  // pixels of the grid
    Axis columns, rows;
  };
  // Nothing: no light reaches the block.
  std::optional<Geometry> Plan(const Rectangle& block) const {
    const int columns = grid_.roi.columns_px + 2 * grid_.margin_px;
    const int rows = grid_.roi.rows_px + 2 * grid_.margin_px;
    Geometry geometry;
    geometry.source =
        LitPart({Grow(block.columns, reach_px_, columns), Grow(block.rows, reach_px_, rows)});
    if (geometry.source.empty()) return std::nullopt;
    geometry.output = {Meet(block.columns, Grow(geometry.source.columns, reach_px_, columns)),
                       Meet(block.rows, Grow(geometry.source.rows, reach_px_, rows))};
    if (geometry.output.empty()) return std::nullopt;
    geometry.columns = Period(geometry.source.columns, geometry.output.columns, reach_px_);
    geometry.rows = Period(geometry.source.rows, geometry.output.rows, reach_px_);
    return geometry;
  }

  int CountLayers(const Rectangle& source) const {
    if (tile_layers_.empty()) return 1;
    LayerSpan span;
    for (int i = source.rows.begin / kTile_px; i * kTile_px < source.rows.end; ++i) {
      for (int j = source.columns.begin / kTile_px; j * kTile_px < source.columns.end; ++j) {
        span.Add(tile_layers_.At(i, j));
      }
    }
    return span.size();
  }

  int64_t Samples(const Geometry& geometry) const {
    return static_cast<int64_t>(geometry.columns.length_px) * geometry.rows.length_px *
           grid_.sub_pixels * grid_.sub_pixels;
  }

  // The region of interest cut into columns x rows blocks.
  std::vector<Rectangle> Cut(int columns, int rows) const {
    const RegionOfInterest& roi = grid_.roi;
    const auto part = [&](int length, int parts, int i) {
      return Range{
          grid_.margin_px + static_cast<int>(static_cast<int64_t>(length) * i / parts),
          grid_.margin_px + static_cast<int>(static_cast<int64_t>(length) * (i + 1) / parts)};
    };
    std::vector<Rectangle> blocks;
    for (int i = 0; i < rows; ++i) {
      for (int j = 0; j < columns; ++j) {
        blocks.push_back({part(roi.columns_px, columns, j), part(roi.rows_px, rows, i)});
      }
    }
    return blocks;
  }

  // The division that costs least, of those whose transforms are not too large: a transform's
  // samples count about two and a half times (columns of half the band there and back, rows back,
  // pixels), and another 0.8 for every further layer.
  std::vector<Rectangle> Blocks() const {
    const RegionOfInterest& roi = grid_.roi;
    if (optics_.field_dependent) {
      const int block = std::max(kFieldBlock_px, reach_px_ / 2);
      return Cut((roi.columns_px + block - 1) / block, (roi.rows_px + block - 1) / block);
    }
    std::vector<Rectangle> best;
    double least_cost = INFINITY;
    for (const int rows : {1, 2, 3, 4, 6, 8, 12, 16, 24}) {
      for (const int columns : {1, 2, 3, 4, 6, 8, 12, 16, 24}) {
        if (columns > roi.columns_px || rows > roi.rows_px) continue;
        const std::vector<Rectangle> blocks = Cut(columns, rows);
        double cost = 0;
        for (const Rectangle& block : blocks) {
          const std::optional<Geometry> geometry = Plan(block);
          if (!geometry) continue;
          const int64_t samples = Samples(*geometry);
          cost += static_cast<double>(samples) * (1.7 + 0.8 * CountLayers(geometry->source));
          // Still counted, as the smallest of blocks may be too large: then they are taken.
          if (samples > kLargestTransform) cost += 1e6 * static_cast<double>(samples);
        }
        if (cost < least_cost) {
          least_cost = cost;
          best = blocks;
        }
      }
    }
    return best;
  }

  // Writes the field (or irradiance) of a layer's samples in one row of a block.
  struct LayerRow {
    const Geometry* geometry;
    int layer;
    int row;  // of the grid
  };
  template <typename Value>
  void FillRow(const LayerRow& where, std::complex<float>* samples, const Value& value) const {
    const int os = grid_.sub_pixels;
    const Range columns = where.geometry->source.columns;
    const int origin = where.geometry->columns.origin_px * os;
    for (int column = columns.begin * os; column < columns.end * os; ++column) {
      if (!Lit(where.row, column)) continue;
      if (!layer_of_.empty() && layer_of_.At(where.row, column) != where.layer) continue;
      samples[column - origin] = value(where.row, column);
    }
  }

  // Layers with light in a block, and the transform's rows each fills.
  struct LayerRows {
    int layer;
    std::vector<int> rows;
  };
  std::vector<LayerRows> FindLayers(const Geometry& geometry) const {
    const int os = grid_.sub_pixels;
    const int first = geometry.source.rows.begin * os;
    const int count = geometry.source.rows.size() * os;
    // Per row: which layers occur.
    std::vector<std::vector<uint16_t>> present(static_cast<size_t>(count));
    ForIndexRanges(threads_, count, [&](int begin, int end) {
      std::vector<uint8_t> seen(layers_.size());
      for (int r = begin; r < end; ++r) {
        std::fill(seen.begin(), seen.end(), uint8_t{0});
        for (int column = geometry.source.columns.begin * os;
             column < geometry.source.columns.end * os; ++column) {
          if (!Lit(first + r, column)) continue;
          const uint16_t layer = layer_of_.empty() ? uint16_t{0} : layer_of_.At(first + r, column);
          if (seen[layer] != 0) continue;
          seen[layer] = 1;
          present[r].push_back(layer);
        }
      }
    });
    std::vector<std::vector<int>> rows(layers_.size());
    for (int r = 0; r < count; ++r) {
      for (const uint16_t layer : present[r]) {
        rows[layer].push_back(first + r - geometry.rows.origin_px * os);
      }
    }
    std::vector<LayerRows> layers;
    for (size_t layer = 0; layer < rows.size(); ++layer) {
      if (!rows[layer].empty()) layers.push_back({static_cast<int>(layer), std::move(rows[layer])});
    }
    return layers;
  }

  // Irradiance between samples, clamped at the rim; only for shifts of a part of a sample.
  float IrradianceAt(double row, double column) const {
    const Image<float>& light = image_.laser_irradiance_w_m2;
    const double r = std::clamp(row, 0.0, light.rows_px - 1.0);
    const double c = std::clamp(column, 0.0, light.columns_px - 1.0);
    const int i = std::min(static_cast<int>(r), light.rows_px - 2);
    const int j = std::min(static_cast<int>(c), light.columns_px - 2);
    const double b = r - i;
    const double a = c - j;
    return static_cast<float>((light.At(i, j) * (1 - a) + light.At(i, j + 1) * a) * (1 - b) +
                              (light.At(i + 1, j) * (1 - a) + light.At(i + 1, j + 1) * a) * b);
  }

  // Adds weight * |field|^2 of one pattern at one moment to `take`'s rows.
  template <typename Take>
  void ImagePattern(const Geometry& geometry, const std::vector<LayerRows>& layers,
                    const TransferGrid& frequencies, const BandTransform& transform,
                    const BandSpectrum& pupil, uint64_t seed, const SpeckleModel::Shift& shift,
                    const Take& take) const {
    const int os = grid_.sub_pixels;
    const double columns_shift = shift.u_m / frequencies.sample_pitch_m;
    const double rows_shift = shift.v_m / frequencies.sample_pitch_m;
    const int whole_columns = static_cast<int>(std::lround(columns_shift));
    const int whole_rows = static_cast<int>(std::lround(rows_shift));
    const double part_columns = columns_shift - whole_columns;
    const double part_rows = rows_shift - whole_rows;
    const bool between = part_columns != 0 || part_rows != 0;
    // Absolute place of the grid's first sample, from the principal point.
    const int first_column = (grid_.roi.column_px - grid_.margin_px) * os - whole_columns;
    const int first_row = (grid_.roi.row_px - grid_.margin_px) * os - whole_rows;
    // Circular Gaussian: sqrt(E) (g1 + i g2) / sqrt(2).
    const auto scatterer = [&](int row, int column) {
      const uint64_t place = static_cast<uint64_t>(static_cast<uint32_t>(first_row + row)) << 32 |
                             static_cast<uint32_t>(first_column + column);
      const std::array<double, 2> g = CounterRandom(seed, place).NormalPair();
      const float irradiance = between ? IrradianceAt(row + part_rows, column + part_columns)
                                       : image_.laser_irradiance_w_m2.At(row, column);
      const float amplitude = std::sqrt(0.5F * irradiance * clear_.At(row, column));
      return std::complex<float>(amplitude * static_cast<float>(g[0]),
                                 amplitude * static_cast<float>(g[1]));
    };
    BandSpectrum field(transform.half_columns(), transform.half_rows());
    for (const LayerRows& layer : layers) {
      const BandSpectrum spectrum = transform.Forward(layer.rows, [&](int row, std::complex<float>*
                                                                                   samples) {
        FillRow({&geometry, layer.layer, row + geometry.rows.origin_px * os}, samples, scatterer);
      });
      AddFiltered(spectrum, pupil,
                  DefocusAndShift(frequencies, field.half_columns, field.half_rows,
                                  layers_[layer.layer], part_columns, part_rows),
                  field);
    }
    transform.Backward(field, [&](int row, std::complex<float>* samples) {
      take(row, [samples](int column) { return SquaredModulus(samples[column]); });
    });
  }

  // sum += spectrum * filter * phase.
  void AddFiltered(const BandSpectrum& spectrum, const BandSpectrum& filter,
                   const SeparablePhase& phase, BandSpectrum& sum) const {
    ForIndexRanges(threads_, sum.width(), [&](int begin, int end) {
      for (int c = begin; c < end; ++c) {
        const int k = c - sum.half_columns;
        const std::complex<float>* in = spectrum.Column(k);
        const std::complex<float>* h = filter.Column(k);
        std::complex<float>* out = sum.Column(k);
        for (int l = -sum.half_rows; l <= sum.half_rows; ++l) {
          if (h[l] == std::complex<float>()) continue;
          const std::complex<float> turn = Product(phase.columns[c], phase.rows[l + sum.half_rows]);
          out[l] += Product(Product(in[l], h[l]), turn);
        }
      }
    });
  }

  // The mean over all patterns: irradiance convolved with the incoherent point spread of every
  // layer, defocus included.
  template <typename Take>
  void ImageMean(const Geometry& geometry, const std::vector<LayerRows>& layers,
                 const TransferGrid& frequencies, const BandTransform& transform,
                 const BandSpectrum& pupil, const Take& take) const {
    const int os = grid_.sub_pixels;
    const BandTransform wide(frequencies.columns, frequencies.rows, 2 * transform.half_columns(),
                             2 * transform.half_rows(), threads_);
    const SeparablePhase none =
        DefocusAndShift(frequencies, wide.half_columns(), wide.half_rows(), 0, 0, 0);
    const float scale =
        1.0F / (static_cast<float>(frequencies.columns) * static_cast<float>(frequencies.rows));
    BandSpectrum sum(wide.half_columns(), wide.half_rows());
    Image<float> spread(frequencies.columns, frequencies.rows);
    for (const LayerRows& layer : layers) {
      BandSpectrum amplitude(transform.half_columns(), transform.half_rows());
      BandSpectrum ones = amplitude;
      std::fill(ones.values.begin(), ones.values.end(), std::complex<float>(1));
      AddFiltered(ones, pupil,
                  DefocusAndShift(frequencies, amplitude.half_columns, amplitude.half_rows,
                                  layers_[layer.layer], 0, 0),
                  amplitude);
      transform.Backward(amplitude, [&](int row, std::complex<float>* samples) {
        for (int column = 0; column < frequencies.columns; ++column) {
          spread.At(row, column) = SquaredModulus(samples[column]);
        }
      });
      // |h|^2 sums to the mean of |H|^2, which is 1.
      BandSpectrum transfer =
          wide.Forward(AllRows(frequencies.rows), [&](int row, std::complex<float>* samples) {
            std::copy_n(spread.Row(row), frequencies.columns, samples);
          });
      for (std::complex<float>& value : transfer.values) value *= scale;
      const BandSpectrum light =
          wide.Forward(layer.rows, [&](int row, std::complex<float>* samples) {
            FillRow({&geometry, layer.layer, row + geometry.rows.origin_px * os}, samples,
                    [&](int r, int column) {
                      return std::complex<float>(image_.laser_irradiance_w_m2.At(r, column) *
                                                 clear_.At(r, column));
                    });
          });
      AddFiltered(light, transfer, none, sum);
    }
    wide.Backward(sum, [&](int row, std::complex<float>* samples) {
      take(row, [samples](int column) { return std::max(0.0F, samples[column].real()); });
    });
  }

  // Irradiance at the samples -> pixels with transfer functions, which are not separable.
  Image<float> PixelsThroughTransfer(const Image<float>& irradiance,
                                     const TransferGrid& frequencies, int half_columns,
                                     int half_rows) const {
    const int os = grid_.sub_pixels;
    const BandTransform transform(frequencies.columns, frequencies.rows, half_columns, half_rows,
                                  threads_);
    const BandSpectrum spectrum =
        transform.Forward(AllRows(frequencies.rows), [&](int row, std::complex<float>* samples) {
          std::copy_n(irradiance.Row(row), frequencies.columns, samples);
        });
    const PixelIntegration along(frequencies.columns / os, os);
    const PixelIntegration down(frequencies.rows / os, os);
    const int columns = along.pixels();
    const int rows = down.pixels();
    // Column by column: evaluating at the pixels' centres folds the spectrum.
    std::vector<std::complex<float>> folded(static_cast<size_t>(columns) * rows);
    const auto modulo = [](int k, int n) { return ((k % n) + n) % n; };
    for (int k = -spectrum.half_columns; k <= spectrum.half_columns; ++k) {
      for (int l = -spectrum.half_rows; l <= spectrum.half_rows; ++l) {
        std::complex<float> value =
            Product(Product(spectrum.Column(k)[l], along.Kernel(k)), down.Kernel(l));
        for (const TransferFunction& transfer : optics_.transfer) {
          value = Product(value, std::complex<float>(transfer(frequencies.FrequencyU(k),
                                                              frequencies.FrequencyV(l))));
        }
        folded[static_cast<size_t>(modulo(l, rows)) * columns + modulo(k, columns)] += value;
      }
    }
    const FourierPlan along_plan(FourierPlan::Direction::kBackward, columns);
    const FourierPlan down_plan(FourierPlan::Direction::kBackward, rows);
    FourierBuffer<std::complex<float>> line(FourierStride(std::max(columns, rows)));
    for (int j = 0; j < columns; ++j) {
      for (int i = 0; i < rows; ++i) line[i] = folded[static_cast<size_t>(i) * columns + j];
      down_plan.Run(line.data());
      for (int i = 0; i < rows; ++i) folded[static_cast<size_t>(i) * columns + j] = line[i];
    }
    Image<float> pixels(columns, rows);
    const float scale =
        1.0F / (static_cast<float>(frequencies.columns) * static_cast<float>(frequencies.rows));
    for (int i = 0; i < rows; ++i) {
      std::copy_n(folded.data() + static_cast<size_t>(i) * columns, columns, line.data());
      along_plan.Run(line.data());
      for (int j = 0; j < columns; ++j) pixels.At(i, j) = line[j].real() * scale;
    }
    return pixels;
  }

  // Rows of pixel means along the rows -> pixels.
  Image<float> IntegrateColumns(const Image<float>& row_means) const {
    const int os = grid_.sub_pixels;
    const PixelIntegration down(row_means.rows_px / os, os);
    Image<float> pixels(row_means.columns_px, down.pixels());
    ForIndexRanges(threads_, row_means.columns_px, [&](int begin, int end) {
      PixelIntegration::Work work(down);
      for (int j = begin; j < end; ++j) {
        for (int i = 0; i < row_means.rows_px; ++i) work.samples[i] = row_means.At(i, j);
        down.Run(work);
        for (int i = 0; i < down.pixels(); ++i) pixels.At(i, j) = work.pixels[i];
      }
    });
    return pixels;
  }

  void ImageBlock(const Rectangle& block) {
    const std::optional<Geometry> plan = Plan(block);
    if (!plan) return;
    const Geometry& geometry = *plan;
    const int os = grid_.sub_pixels;
    const double p = grid_.pixel_pitch_m;
    const TransferGrid frequencies = {optics_.wavelength_m, optics_.image_distance_m, p / os,
                                      geometry.columns.length_px * os,
                                      geometry.rows.length_px * os};
    const double centre_column = 0.5 * (block.columns.begin + block.columns.end) - 0.5;
    const double centre_row = 0.5 * (block.rows.begin + block.rows.end) - 0.5;
    const Pupil pupil =
        optics_.field_dependent
            ? optics_.pupil((grid_.roi.column_px - grid_.margin_px + centre_column) * p,
                            (grid_.roi.row_px - grid_.margin_px + centre_row) * p)
            : optics_.pupil(0, 0);
    BandSpectrum transfer = PupilTransfer(pupil, frequencies, threads_);
    const float scale =
        1.0F / (static_cast<float>(frequencies.columns) * static_cast<float>(frequencies.rows));
    for (std::complex<float>& value : transfer.values) value *= scale;
    const BandTransform transform(frequencies.columns, frequencies.rows, transfer.half_columns,
                                  transfer.half_rows, threads_);
    const std::vector<LayerRows> layers = FindLayers(geometry);

    const bool through_transfer = !optics_.transfer.empty();
    const PixelIntegration along(frequencies.columns / os, os);
    Image<float> row_means(through_transfer ? frequencies.columns : along.pixels(),
                           frequencies.rows);
    const auto image_with = [&](float weight, const auto& image_all) {
      image_all([&](int row, const auto& irradiance) {
        float* out = row_means.Row(row);
        if (through_transfer) {
          for (int j = 0; j < frequencies.columns; ++j) out[j] += weight * irradiance(j);
          return;
        }
        PixelIntegration::Work work(along);
        for (int j = 0; j < frequencies.columns; ++j) work.samples[j] = irradiance(j);
        along.Run(work);
        for (int j = 0; j < along.pixels(); ++j) out[j] += weight * work.pixels[j];
      });
    };
    if (speckle_.on) {
      const float share = 1.0F / static_cast<float>(speckle_.shifts.size());
      for (size_t pattern = 0; pattern < speckle_.pattern_weights.size(); ++pattern) {
        const uint64_t seed = DeriveSeed(speckle_.seed, "speckle pattern", pattern);
        for (const SpeckleModel::Shift& shift : speckle_.shifts) {
          image_with(
              share * static_cast<float>(speckle_.pattern_weights[pattern]), [&](const auto& take) {
                ImagePattern(geometry, layers, frequencies, transform, transfer, seed, shift, take);
              });
        }
      }
    } else {
      image_with(1, [&](const auto& take) {
        ImageMean(geometry, layers, frequencies, transform, transfer, take);
      });
    }
    const Image<float> pixels =
        through_transfer ? PixelsThroughTransfer(row_means, frequencies, 2 * transfer.half_columns,
                                                 2 * transfer.half_rows)
                         : IntegrateColumns(row_means);
    for (int i = geometry.output.rows.begin; i < geometry.output.rows.end; ++i) {
      for (int j = geometry.output.columns.begin; j < geometry.output.columns.end; ++j) {
        // Rounding of the transforms may leave a dark pixel a hair below zero.
        result_.At(i - grid_.margin_px, j - grid_.margin_px) =
            std::max(0.0F, pixels.At(i - geometry.rows.origin_px, j - geometry.columns.origin_px));
      }
    }
  }

  const IdealImage& image_;
  const SubPixelGrid& grid_;
  const OpticsModel& optics_;
  const SpeckleModel& speckle_;
  const int threads_;
  const ClearFractionMap clear_;
  float dark_ = 0;
  Image<uint8_t> lit_tiles_;
  // Column of the nearest tile with light in a tile's row: from the tile on to the right (the
  // number of columns if there is none), and up to the tile (-1). A division of the image into
  // blocks asks for the lit part of thousands of rectangles.
  Image<int> lit_from_, lit_until_;
  std::vector<double> layers_;  // curvature of each
  Image<uint16_t> layer_of_;    // empty: one layer
  Image<LayerSpan> tile_layers_;
  int reach_px_ = 0;
  Image<float> result_;
};

}  // namespace

Image<float> ImageLaser(const IdealImage& image, const OpticsModel& optics,
                        const SpeckleModel& speckle, int threads) {
  return LaserImaging(image, optics, speckle, threads).Run();
}

std::vector<LaserTransform> PlanLaserTransforms(const IdealImage& image, const OpticsModel& optics,
                                                int threads) {
  const SpeckleModel speckle;
  return LaserImaging(image, optics, speckle, threads).Transforms();
}

}  // namespace sightline
