// SPDX-License-Identifier: Apache-2.0
// Isotropic BRDF measured by a gonioreflectometer over theta_l (laser), theta_d and phi_d
// (detector), thesis 5.3.1: steps of 2 degrees, phi_d within +-134 degrees because laser and
// detector arms would collide beyond. phi_d = 0 is the plane of mirror reflection, phi_d = 180
// degrees looks back along the laser.
//
// Of the measured values the table keeps the mean over what must be equal: phi_d and -phi_d (a
// surface without preferred direction) and theta_l exchanged with theta_d (Helmholtz). Neither
// reaches phi_d beyond the last measured one: there the value at the last measured phi_d of the
// same inclinations stands in. Pairs of inclinations without any value take the nearest pair's, and
// inclinations beyond the largest measured one its values. Linear between the nodes.
#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "absl/strings/str_cat.h"
#include "core/file/read_file.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "core/text/number_table.h"
#include "core/text/number_text.h"
#include "render_worker/material/measured/tabulated_material.h"
#include "render_worker/material/models.h"

namespace sightline {
namespace {

constexpr float kDegree = std::numbers::pi_v<float> / 180;

constexpr uint64_t kMaxFileBytes = uint64_t{64} << 20;
// Half a degree. The table has a cell for every pair of inclinations and azimuth that occur.
constexpr size_t kMostInclinations = 181, kMostAzimuths = 361;

struct Row {
  double theta_l_deg, theta_d_deg, phi_d_deg, brdf_per_sr;
};

void SortUnique(std::vector<float>& values) {
  std::sort(values.begin(), values.end());
  values.erase(std::unique(values.begin(), values.end()), values.end());
}

struct Bracket {
  size_t below, above;
  float share;

  Bracket(const std::vector<float>& nodes, float value) {
    above =
        static_cast<size_t>(std::upper_bound(nodes.begin(), nodes.end(), value) - nodes.begin());
    if (above == 0 || above == nodes.size()) {
      below = above = above == 0 ? 0 : nodes.size() - 1;
      share = 0;
    } else {
      below = above - 1;
      share = (value - nodes[below]) / (nodes[above] - nodes[below]);
    }
  }
};

class SymmetricTable {
 public:
  explicit SymmetricTable(const std::vector<Row>& rows) {
    for (const Row& row : rows) {
      theta_deg_.push_back(static_cast<float>(row.theta_l_deg));
      theta_deg_.push_back(static_cast<float>(row.theta_d_deg));
      phi_deg_.push_back(static_cast<float>(std::abs(row.phi_d_deg)));
    }
    SortUnique(theta_deg_);
    SortUnique(phi_deg_);
    value_.assign(theta_deg_.size() * theta_deg_.size() * phi_deg_.size(), 0.0F);
    std::vector<double> sum(value_.size(), 0.0);
    std::vector<int> count(value_.size(), 0);
    for (const Row& row : rows) {
      const size_t l = Bracket(theta_deg_, static_cast<float>(row.theta_l_deg)).below;
      const size_t d = Bracket(theta_deg_, static_cast<float>(row.theta_d_deg)).below;
      const size_t p = Bracket(phi_deg_, static_cast<float>(std::abs(row.phi_d_deg))).below;
      for (const size_t place : {Place(l, d, p), Place(d, l, p)}) {
        sum[place] += row.brdf_per_sr;
        ++count[place];
      }
    }
    Fill(sum, count);
  }

  float At(float cos_a, float cos_b, float azimuth_rad) const {
    const Bracket a(theta_deg_, std::acos(std::min(cos_a, 1.0F)) / kDegree);
    const Bracket b(theta_deg_, std::acos(std::min(cos_b, 1.0F)) / kDegree);
    const Bracket p(phi_deg_, 180 - azimuth_rad / kDegree);
    // The two products of shares are added in an order that does not depend on which is a.
    const float mixed = (1 - a.share) * b.share * AtPhi(a.below, b.above, p) +
                        a.share * (1 - b.share) * AtPhi(a.above, b.below, p);
    return (1 - a.share) * (1 - b.share) * AtPhi(a.below, b.below, p) + mixed +
           a.share * b.share * AtPhi(a.above, b.above, p);
  }

 private:
  size_t Place(size_t a, size_t b, size_t p) const {
    return (a * theta_deg_.size() + b) * phi_deg_.size() + p;
  }
  float AtPhi(size_t a, size_t b, const Bracket& p) const {
    return (1 - p.share) * value_[Place(a, b, p.below)] + p.share * value_[Place(a, b, p.above)];
  }

  void Fill(const std::vector<double>& sum, const std::vector<int>& count) {
    const size_t angles = theta_deg_.size();
    const size_t azimuths = phi_deg_.size();
    std::vector<char> known(angles * angles, 0);
    for (size_t pair = 0; pair < angles * angles; ++pair) {
      for (size_t p = 0; p < azimuths; ++p) {
        size_t nearest = azimuths;
        for (size_t q = 0; q < azimuths; ++q) {
          if (count[pair * azimuths + q] > 0 &&
              (nearest == azimuths ||
               std::abs(phi_deg_[q] - phi_deg_[p]) < std::abs(phi_deg_[nearest] - phi_deg_[p]))) {
            nearest = q;
          }
        }
        if (nearest == azimuths) break;
        known[pair] = 1;
        const size_t from = pair * azimuths + nearest;
        value_[pair * azimuths + p] = static_cast<float>(sum[from] / count[from]);
      }
    }
    // Symmetric in a and b: of equally near pairs the mean is taken.
    const std::vector<float> measured = value_;
    for (size_t a = 0; a < angles; ++a) {
      for (size_t b = 0; b < angles; ++b) {
        if (known[a * angles + b]) continue;
        float least = INFINITY;
        for (const bool second_pass : {false, true}) {
          int found = 0;
          for (size_t c = 0; c < angles; ++c) {
            for (size_t d = 0; d < angles; ++d) {
              if (!known[c * angles + d]) continue;
              const float distance =
                  std::abs(theta_deg_[a] - theta_deg_[c]) + std::abs(theta_deg_[b] - theta_deg_[d]);
              if (!second_pass) {
                least = std::min(least, distance);
              } else if (distance == least) {
                ++found;
                for (size_t p = 0; p < azimuths; ++p) {
                  float& value = value_[Place(a, b, p)];
                  value += (measured[Place(c, d, p)] - value) / static_cast<float>(found);
                }
              }
            }
          }
        }
      }
    }
  }

  std::vector<float> theta_deg_;
  std::vector<float> phi_deg_;
  std::vector<float> value_;
};

absl::StatusOr<std::vector<Row>> ReadRows(const std::string& path, const std::string& context) {
  const absl::StatusOr<std::string> bytes = ReadRegularFile(path, kMaxFileBytes);
  if (!bytes.ok()) {
    return absl::Status(bytes.status().code(),
                        absl::StrCat(context, ": ", bytes.status().message()));
  }
  std::vector<Row> rows;
  const std::string table = absl::StrCat(context, ": ", path);
  const auto add = [&](int line, const std::vector<double>& values) {
    const auto where = [&] { return absl::StrCat(table, ", line ", line); };
    for (int i = 0; i < 2; ++i) {
      if (!(values[i] >= 0 && values[i] <= 90)) {
        return absl::InvalidArgumentError(
            absl::StrCat(where(), ": ", i == 0 ? "theta_l_deg" : "theta_d_deg", " is ",
                         NumberText(values[i]), ", must be in [0, 90]"));
      }
    }
    if (!(std::abs(values[2]) <= 180)) {
      return absl::InvalidArgumentError(absl::StrCat(
          where(), ": phi_d_deg is ", NumberText(values[2]), ", must be in [-180, 180]"));
    }
    if (!(values[3] >= 0 && values[3] < 1e6)) {
      return absl::InvalidArgumentError(absl::StrCat(
          where(), ": brdf_per_sr is ", NumberText(values[3]), ", must be in [0, 1e6)"));
    }
    rows.push_back({values[0], values[1], values[2], values[3]});
    return absl::OkStatus();
  };
  SIGHTLINE_RETURN_IF_ERROR(ReadNumberTable(
      *bytes,
      {.columns = {"theta_l_deg", "theta_d_deg", "phi_d_deg", "brdf_per_sr"}, .comments = true},
      table, {}, add));
  std::set<float> inclinations, azimuths;
  for (const Row& row : rows) {
    inclinations.insert(static_cast<float>(row.theta_l_deg));
    inclinations.insert(static_cast<float>(row.theta_d_deg));
    azimuths.insert(static_cast<float>(std::abs(row.phi_d_deg)));
    if (inclinations.size() <= kMostInclinations && azimuths.size() <= kMostAzimuths) continue;
    return absl::InvalidArgumentError(absl::StrCat(
        context, ": ", path, " has more than ", kMostInclinations,
        " different inclinations (theta_l_deg, theta_d_deg) or ", kMostAzimuths,
        " different |phi_d_deg|: round them to the steps in which they were measured"));
  }
  return rows;
}

}  // namespace

absl::StatusOr<std::shared_ptr<const Material>> ReadMeasuredTable(
    DetailedMaterial::Common common, const std::string& path, std::optional<double> spot_diameter_m,
    const std::string& context) {
  SIGHTLINE_ASSIGN_OR_RETURN(std::vector<Row> rows, ReadRows(path, context));
  const auto table = std::make_shared<SymmetricTable>(rows);
  TabulatedMaterial::Channel channel;
  channel.brdf = [table](float cos_out, float cos_in, float azimuth_rad) {
    return table->At(cos_out, cos_in, azimuth_rad);
  };
  channel.share.fill(1);
  return std::make_shared<TabulatedMaterial>(std::move(common), std::vector{channel},
                                             spot_diameter_m);
}

}  // namespace sightline
