// SPDX-License-Identifier: Apache-2.0
// Interface of the coverage engine to the service. Tests replace the engine by a formula.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "coverage_server/scene/coverage_scene.h"
#include "coverage_server/view/render_view.h"

namespace sightline {

struct CoverageBackend {
  // As CoverageScene::Build.
  std::function<absl::StatusOr<std::unique_ptr<CoverageScene>>(SceneDefinition definition,
                                                               const SceneBuildOptions& options)>
      build_scene;
  // As RenderView.
  std::function<absl::StatusOr<std::string>(const CoverageScene& scene, const ViewRequest& request)>
      render_view;
};

}  // namespace sightline
