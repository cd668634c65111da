// SPDX-License-Identifier: Apache-2.0
// Effects whose description says that they act on flat plates only are those which the renderer
// refuses for parts.
#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "core/json/strict_json.h"
#include "core/status/status_macros.h"
#include "render_worker/effects/effect.h"
#include "render_worker/render/render_task.h"
#include "tests/render_worker/service/plate_spec.h"

namespace sightline {
namespace {

// Says whether a part is rendered with the effect, without rendering it.
absl::Status TryOnPart(const EffectDescription& description, const std::string& folder) {
  v1::RenderSpec spec;
  SIGHTLINE_RETURN_IF_ERROR(ParseStrictJson(
      absl::StrCat(R"({"part": {"inspection": {"name": "table",
        "part": {"file": "table.obj", "unit": "m"}, "camera": {"sensor": {)",
                   kPlateSpecSensor, R"(}}, "lens": {"focal_length_m": 0.016, "f_number": 16},
        "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.5}}}]},
        "frames": [{"measurement": {"camera_distance_m": 0.3, "triangulation_angle_deg": 30}}]}})"),
      "spec", &spec));
  v1::Effect* effect = spec.mutable_part()->mutable_inspection()->add_effects();
  effect->set_effect(std::string(description.id));
  for (const EffectParameter& p : description.parameters) {
    const double value = p.null_value + p.prior_scale <= p.upper ? p.null_value + p.prior_scale
                                                                 : p.null_value - p.prior_scale;
    (*effect->mutable_parameters())[std::string(p.name)] = value;
  }
  SIGHTLINE_ASSIGN_OR_RETURN(auto task, RenderTask::Parse(spec, int64_t{1} << 30));
  std::atomic<bool> cancelled = false;
  RenderTaskHooks hooks;
  hooks.cancelled = &cancelled;
  // Effects are looked at after the first report, and nothing else.
  hooks.on_progress = [&](double, const std::string&) { cancelled = true; };
  return task->Run(
      folder, [&](const std::string& file) { return absl::StrCat(folder, "/", file); }, hooks);
}

TEST(PlateOnlyEffects, AreThoseTheRendererRefuses) {
  std::string folder = "/tmp/sightline-plate-only-XXXXXX";
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  std::ofstream(folder + "/table.obj")
      << "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n";
  for (const Effect* effect : AllEffects()) {
    const std::string id(effect->description().id);
    const bool plate_only = effect->description().scope == EffectScope::kFlatPlate;
    const absl::Status status = TryOnPart(effect->description(), folder);
    if (absl::IsCancelled(status)) {
      EXPECT_FALSE(plate_only) << id;
    } else {
      EXPECT_TRUE(absl::IsInvalidArgument(status) &&
                  absl::StrContains(status.message(), "acts on a flat plate only"))
          << id << ": " << status;
      EXPECT_TRUE(plate_only) << id;
    }
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace sightline
