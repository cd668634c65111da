// Which effects the recordings of a set cannot tell from a given one.
#pragma once

#include <Eigen/Core>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "bench/concealed/effect_draw.h"

namespace sightline::bench {

// Ids that count as right for reasons of physics alone, whatever was recorded, besides the effect
// itself: factors that enter only as a product (reflectance, power, transmission, quantum
// efficiency of all colours), bending responses, incoherent sums of speckle patterns.
std::vector<std::string> PhysicallyEquivalent(const ActiveEffect& effect, const Sensor& camera);

// What effects change in the expectation of a set's statistics, whitened.
struct ChangeModel {
  std::function<Eigen::VectorXd(const std::vector<ActiveEffect>&)> change;
  // Symmetric: takes off what refitted deviations explain, so that a . project(b) is the inner
  // product that counts.
  std::function<Eigen::VectorXd(const Eigen::VectorXd&)> project;
};

// Effects of the vocabulary, one at a time: a linear fit of its strengths, for a few shapes; then,
// where that comes near, all its parameters by Gauss and Newton within their bounds.
class Alternatives {
 public:
  Alternatives(ChangeModel model, const Sensor& camera);

  // Share of what `truth` changes that the best of `other` explains. 0 if `truth` changes nothing.
  double Explained(const ActiveEffect& truth, const Effect& other);

 private:
  struct Direction {
    EffectFamily family;
    double scale = 0;
    Eigen::VectorXd change, projected;
  };

  double Gain(const Eigen::VectorXd& change) const;
  Direction Weak(const EffectFamily& family) const;
  // Strengths of one effect, for every shape looked at.
  const std::vector<std::vector<Direction>>& DirectionsOf(const Effect& effect);
  double Refined(ActiveEffect start, const Eigen::VectorXd& truth, double square) const;

  ChangeModel model_;
  const Sensor camera_;
  std::map<const Effect*, std::vector<std::vector<Direction>>> directions_;  // as far as wanted
};

}  // namespace sightline::bench
