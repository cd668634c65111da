// SPDX-License-Identifier: Apache-2.0
// Our side of the comparison with Cycles (cycles.py): the cylinder head in grey Lambert, one lamp
// and constant ambient light, pinhole. Writes the scene for Blender, or the radiance of one
// rendering.
#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numeric>
#include <string>
#include <vector>

#include "bench/common/measure.h"
#include "bench/transport_scene.h"

namespace sightline::bench {
namespace {

constexpr double kAlbedo = 0.5;

// The scene of transport_scene.h with a quarter of the pixels per axis.
TransportScene GreyScene(const std::string& glb) {
  TransportScene scene = CylinderHeadScene(glb);
  scene.columns_px /= 4;
  scene.rows_px /= 4;
  scene.pixel_pitch_m *= 4;
  scene.view.pupil_radius_m = 0;
  v1::Material message;
  message.mutable_lambert()->set_diffuse_albedo(kAlbedo);
  auto material = MakeMaterial(message, 661e-9, nullptr, "bench");
  if (!material.ok()) Fail("material", material.status().ToString());
  scene.scene.materials = {*std::move(material)};
  for (SceneMesh& mesh : scene.scene.meshes) mesh.triangle_material.clear();
  return scene;
}

double Total(const Spectrum& spectrum) {
  return std::accumulate(spectrum.begin(), spectrum.end(), 0.0);
}

Json ToJson(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

void WriteFile(const std::filesystem::path& path, const std::string& bytes) {
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  if (!file.flush()) Fail(path.string(), "cannot be written");
}

template <typename T>
void Append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

// Binary PLY and scene.json, lengths in metres, part coordinates.
void WriteScene(const TransportScene& scene, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  const TriangleMesh& mesh = scene.scene.meshes[0].mesh;
  std::string ply = "ply\nformat binary_little_endian 1.0\nelement vertex " +
                    std::to_string(mesh.positions_m.size()) +
                    "\nproperty float x\nproperty float y\nproperty float z\nelement face " +
                    std::to_string(mesh.triangles.size()) +
                    "\nproperty list uchar int vertex_indices\nend_header\n";
  for (const Eigen::Vector3f& p : mesh.positions_m) {
    for (int k = 0; k < 3; ++k) Append(ply, p[k]);
  }
  for (const auto& triangle : mesh.triangles) {
    Append(ply, uint8_t{3});
    for (const uint32_t corner : triangle) Append(ply, corner);
  }
  WriteFile(folder / "head.ply", ply);

  const EmittingRectangle& lamp = scene.scene.area_lights[0];
  const SensorPose& camera = scene.view.camera;
  const SubPixelGrid grid = scene.Grid(1);
  const Json json = {{"mesh", "head.ply"},
                     {"vertices", mesh.positions_m.size()},
                     {"triangles", mesh.triangles.size()},
                     {"albedo", kAlbedo},
                     {"ambient_radiance_w_m2_sr", Total(scene.scene.ambient_radiance_w_m2_sr)},
                     {"lamp",
                      {{"centre_m", ToJson(lamp.centre_m)},
                       {"half_edge_u_m", ToJson(lamp.half_edge_u_m)},
                       {"half_edge_v_m", ToJson(lamp.half_edge_v_m)},
                       {"radiance_w_m2_sr", Total(lamp.radiance_w_m2_sr)}}},
                     {"camera",
                      {{"origin_m", ToJson(camera.origin_m)},
                       {"right", ToJson(camera.x_axis)},
                       {"down", ToJson(camera.y_axis)},
                       {"forward", ToJson(camera.z_axis)},
                       {"image_distance_m", scene.view.image_distance_m},
                       {"pixel_pitch_m", grid.pixel_pitch_m},
                       // Centre of the top left pixel on the sensor.
                       {"first_u_m", grid.U(0)},
                       {"first_v_m", grid.V(0)}}},
                     {"columns_px", scene.columns_px},
                     {"rows_px", scene.rows_px},
                     {"max_bounces", TransportSettings().max_bounces}};
  WriteFile(folder / "scene.json", json.dump(1) + "\n");
}

// Portable float map: bottom row first.
void WritePfm(const Image<float>& image, const std::string& path) {
  std::string bytes =
      "Pf\n" + std::to_string(image.columns_px) + " " + std::to_string(image.rows_px) + "\n-1.0\n";
  for (int i = image.rows_px - 1; i >= 0; --i) {
    for (int j = 0; j < image.columns_px; ++j) Append(bytes, image.At(i, j));
  }
  WriteFile(path, bytes);
}

double RootMeanSquare(const Image<float>& image) {
  double sum = 0;
  for (const float v : image.values) sum += double{v} * v;
  return std::sqrt(sum / static_cast<double>(image.values.size()));
}

int Main(int argc, char** argv) {
  CLI::App app("Our side of the comparison with Cycles");
  std::string glb = "examples/cylinder_head/cylinder_head.glb", scene_folder, image;
  std::vector<int> crop;
  TransportSettings settings;
  app.add_option("--glb", glb);
  app.add_option("--scene", scene_folder, "write head.ply and scene.json here, render nothing");
  app.add_option("--image", image, "radiance, PFM");
  app.add_option("--crop", crop, "X Y WIDTH HEIGHT in pixels, from the top left corner")
      ->expected(4);
  app.add_option("--noise", settings.noise_target_relative);
  app.add_option("--filter", settings.filter);
  app.add_option("--first-samples", settings.first_samples_per_px);
  app.add_option("--max-samples", settings.max_samples_per_px);
  app.add_option("--seed", settings.seed);
  app.add_option("--threads", settings.threads);
  CLI11_PARSE(app, argc, argv);

  const Stopwatch load;
  const TransportScene scene = GreyScene(glb);
  if (!scene_folder.empty()) {
    WriteScene(scene, scene_folder);
    return 0;
  }
  auto transport = LightTransport::Make(scene.scene);
  if (!transport.ok()) Fail("scene", transport.status().ToString());
  const SubPixelGrid grid =
      crop.empty() ? scene.Grid(1) : scene.Crop(crop[0], crop[1], crop[2], crop[3], 1);
  const double load_s = load.Seconds(), load_cpu_s = OwnCpuSeconds();
  const Stopwatch watch;
  auto traced = (*transport)->TraceIncoherent(scene.view, grid, {}, settings, {});
  const double wall_s = watch.Seconds(), cpu_s = OwnCpuSeconds() - load_cpu_s;
  if (!traced.ok()) Fail("light transport", traced.status().ToString());
  if (!image.empty()) WritePfm(traced->radiance_w_m2_sr, image);
  const Json result = {
      {"load_s", load_s},
      {"load_cpu_s", load_cpu_s},
      {"wall_s", wall_s},
      {"cpu_s", cpu_s},
      {"rays_per_px", static_cast<double>(traced->rays) / (grid.columns() * grid.rows())},
      {"stated_error_w_m2_sr", RootMeanSquare(traced->standard_error_w_m2_sr)}};
  std::printf("%s\n", result.dump().c_str());
  return 0;
}

}  // namespace
}  // namespace sightline::bench

int main(int argc, char** argv) { return sightline::bench::Main(argc, argv); }
