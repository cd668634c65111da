// SPDX-License-Identifier: Apache-2.0
#include "render_worker/scene_diagnosis/answer/added_light.h"

#include <Eigen/Core>
#include <cstddef>

#include "render_worker/scene_diagnosis/light/path_names.h"

namespace sightline {

AddedLight FindAddedLight(const RecordedScene& scene, const SceneLight& light,
                          const BlockMeans& blocks, const PathHypothesis& hypothesis,
                          const PathFit& null_fit) {
  AddedLight added;
  Eigen::VectorXd added_electrons = Eigen::VectorXd::Zero(blocks.grid().count());
  for (size_t k = 0; k < hypothesis.best.paths.size(); ++k) {
    const LightPath& path = *hypothesis.best.paths[k];
    const Eigen::VectorXd electrons =
        hypothesis.best.factors[static_cast<Eigen::Index>(k)] * blocks.PathElectrons(path);
    if (path.effect == kLaserFactor) added.laser_sum = electrons.sum();
    if (path.nominal) continue;
    added_electrons += electrons;
    added.sum += electrons.sum();
  }
  if (!hypothesis.effects.empty()) {
    added.region =
        FindExcessRegion(scene, light, blocks.grid(), null_fit.residuals, added_electrons);
  }
  return added;
}

}  // namespace sightline
