// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <atomic>
#include <chrono>
#include <thread>

#include "render_worker/light_transport/light_transport.h"
#include "tests/limits/cpu_time.h"
#include "tests/limits/within_limits.h"
#include "tests/render_worker/light_transport/test_scenes.h"

namespace sightline {
namespace {

SceneDescription Room() {
  SceneDescription scene;
  scene.meshes.push_back({InwardBox({0, 0, 0}, {0.2, 0.2, 0.2}), {}});
  scene.materials = {TestLambert(0.7)};
  scene.area_lights = {{{0, 0, 0.19}, {0.05, 0, 0}, {0, -0.05, 0}, EvenSpectrum(10)}};
  return scene;
}

SceneView RoomView() {
  SceneView view;
  view.camera = Look({0, -0.15, 0.1}, {0, 0.2, -0.1}, {1, 0, 0});
  view.image_distance_m = 0.02;
  view.focus_distance_m = 0.3;
  view.pupil_radius_m = 1e-3;
  view.laser = Look({0, 0.05, 0.15}, {0, 0, -1}, {1, 0, 0});
  return view;
}

TEST(LightTransport, SameBytesForAnyNumberOfThreads) {
  auto transport = LightTransport::Make(Room());
  ASSERT_TRUE(transport.ok());
  const SubPixelGrid grid = Grid(37, 29, 0.5e-3, 2);
  TransportSettings settings;
  settings.first_samples_per_px = 8;
  settings.max_samples_per_px = 32;
  settings.laser_light_paths = 4096;
  Spectrum one;
  one.fill(1);
  settings.threads = 1;
  auto laser = (*transport)->TraceLaser(RoomView(), grid, settings, {});
  auto other = (*transport)->TraceIncoherent(RoomView(), grid, {one}, settings, {});
  ASSERT_TRUE(laser.ok() && other.ok());
  for (const int threads : {2, 5}) {
    settings.threads = threads;
    auto laser_again = (*transport)->TraceLaser(RoomView(), grid, settings, {});
    auto other_again = (*transport)->TraceIncoherent(RoomView(), grid, {one}, settings, {});
    ASSERT_TRUE(laser_again.ok() && other_again.ok());
    EXPECT_EQ(laser->radiance_w_m2_sr, laser_again->radiance_w_m2_sr);
    EXPECT_EQ(laser->indirect_radiance_w_m2_sr, laser_again->indirect_radiance_w_m2_sr);
    EXPECT_EQ(other->channel_radiance, other_again->channel_radiance);
    EXPECT_EQ(other->standard_error_w_m2_sr, other_again->standard_error_w_m2_sr);
  }
}

TEST(LightTransport, ReportsProgressUpToOne) {
  auto transport = LightTransport::Make(Room());
  ASSERT_TRUE(transport.ok());
  TransportSettings settings;
  settings.max_samples_per_px = 64;
  double last = 0;
  bool ascending = true;
  TransportProgress progress;
  progress.report = [&](double done) {
    ascending = ascending && done >= last - 1e-12;
    last = done;
  };
  ASSERT_TRUE((*transport)->TraceLaser(RoomView(), Grid(40, 30, 0.4e-3), settings, progress).ok());
  EXPECT_TRUE(ascending);
  EXPECT_NEAR(last, 1, 1e-9);
}

TEST(LightTransport, CancelledWithinATenthOfASecond) {
  auto transport = LightTransport::Make(Room());
  ASSERT_TRUE(transport.ok());
  TransportSettings settings;
  settings.noise_target_relative = 1e-6;
  settings.laser_noise_target_relative = 1e-6;
  settings.max_samples_per_px = settings.laser_max_samples_per_px = 1 << 16;
  for (const bool laser : {true, false}) {
    std::atomic<bool> cancelled = false;
    TransportProgress progress;
    progress.cancelled = &cancelled;
    double asked_s = 0;
    std::jthread canceller([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
      // The flag first: this thread may have to wait between the two while the work goes on.
      cancelled = true;
      asked_s = CpuSeconds();
    });
    absl::Status status;
    if (laser) {
      status =
          (*transport)->TraceLaser(RoomView(), Grid(640, 480, 3e-5), settings, progress).status();
    } else {
      status = (*transport)
                   ->TraceIncoherent(RoomView(), Grid(640, 480, 3e-5), {}, settings, progress)
                   .status();
    }
    EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
    canceller.join();
    // CPU time of all threads.
    EXPECT_LT(CpuSeconds() - asked_s, 0.1 * kSlowness * std::thread::hardware_concurrency());
  }
}

TEST(LightTransport, SaysWhatIsWrongWithAScene) {
  SceneDescription scene = Room();
  scene.meshes[0].triangle_material.assign(12, 3);
  auto made = LightTransport::Make(scene);
  EXPECT_EQ(made.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(made.status().message()), testing::HasSubstr("material index 3"));
  scene = Room();
  scene.meshes.clear();
  made = LightTransport::Make(scene);
  EXPECT_THAT(std::string(made.status().message()), testing::HasSubstr("no triangles"));
  scene = Room();
  scene.area_lights[0].half_edge_v_m = {0.05, 0, 0};
  made = LightTransport::Make(scene);
  EXPECT_THAT(std::string(made.status().message()), testing::HasSubstr("area light 0"));
}

}  // namespace
}  // namespace sightline
