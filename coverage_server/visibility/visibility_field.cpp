// SPDX-License-Identifier: Apache-2.0
#include "coverage_server/visibility/visibility_field.h"

#include <malloc.h>
#include <sys/mman.h>
#include <sys/wait.h>

#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/parallel/worker_threads.h"
#include "core/process/start_process.h"
#include "core/status/status_macros.h"
#include "core/status/stop_check.h"
#include "coverage_server/occlusion/occluder_mesh.h"
#include "coverage_server/visibility/field_renderer.h"
#include "coverage_server/visibility/field_worker.h"
#include "coverage_server/worker_process/shared_memory.h"
#include "coverage_server/worker_process/worker_process.h"

namespace sightline {
namespace {

constexpr char kWorkerFlag[] = "--field-worker";

// Lays the job's arrays out one after the other.
class JobLayout {
 public:
  uint64_t Add(size_t bytes) {
    const uint64_t offset = bytes_;
    bytes_ = (bytes_ + bytes + 63) / 64 * 64;
    return offset;
  }
  size_t bytes() const { return bytes_; }

 private:
  uint64_t bytes_ = (sizeof(FieldJob) + 63) / 64 * 64;
};

// Directions just below a probe's horizon: the sensor may still be above it, so the cell takes over
// the probe's result from the nearest cell above.
void FillBelowHorizon(const SurfaceProbes& probes, const OctahedralMap& map, uint8_t* data,
                      size_t begin, size_t end, const std::atomic<bool>* cancelled) {
  constexpr float kAbove = 0.05f;    // sine of the elevation from which a cell's answer is its own
  constexpr float kClampTo = 0.08f;  // elevation the direction is lifted to
  constexpr float kBelow = -0.15f;   // no direction in such a cell is above the horizon
  std::vector<Eigen::Vector3f> directions(map.cells());
  for (int c = 0; c < map.cells(); ++c) directions[c] = map.Direction(c);
  std::vector<uint8_t> own(map.cells());
  for (size_t t = begin; t < end && !IsCancelled(cancelled); ++t) {
    uint8_t* column =
        data + t / kTargetsPerBlock * map.cells() * kTargetsPerBlock + t % kTargetsPerBlock;
    for (int c = 0; c < map.cells(); ++c)
      own[c] = column[static_cast<size_t>(c) * kTargetsPerBlock];
    // Probes with one normal, as on flat faces, are lifted together.
    uint8_t waiting = 0xff;
    while (waiting != 0) {
      const Eigen::Vector3f n = probes.normals[t * kProbesPerTarget + std::countr_zero(waiting)];
      uint8_t same = 0;
      for (int k = 0; k < kProbesPerTarget; ++k) {
        if (((waiting >> k) & 1) && probes.normals[t * kProbesPerTarget + k] == n)
          same |= static_cast<uint8_t>(1 << k);
      }
      waiting &= static_cast<uint8_t>(~same);
      for (int c = 0; c < map.cells(); ++c) {
        const float elevation = n.dot(directions[c]);
        if (elevation >= kAbove || elevation < kBelow) continue;
        for (float lift = kClampTo; lift < 0.4f; lift += 0.04f) {
          const int above = map.Cell(directions[c] + (lift - elevation) * n);
          if (n.dot(directions[above]) < kAbove) continue;
          uint8_t& byte = column[static_cast<size_t>(c) * kTargetsPerBlock];
          byte = static_cast<uint8_t>((byte & ~same) | (own[above] & same));
          break;
        }
      }
    }
  }
}

// The memory that a worker process maps.
struct WorkerMemory {
  int job_fd;
  size_t job_bytes;
  int field_fd;
  size_t field_bytes;
};

struct Worker {
  WorkerProcess process;
  int32_t number;
};

// Returns the unfinished tiles of a killed worker to the queue.
void GiveTilesBack(FieldJob& job, int32_t worker) {
  for (int tile = 0; tile < TileCount(job); ++tile) {
    int32_t taken = worker;
    TileStates(job)[tile].compare_exchange_strong(taken, kTileWaiting);
  }
}

// Renders all tiles in `processes` processes. A process that is killed is replaced, at most
// kMostReplacements times, because a tile may be what kills its renderers.
absl::Status RenderInProcesses(const std::string& program, const WorkerMemory& memory,
                               int processes, const FieldBuildOptions& options, FieldJob& job) {
  constexpr int kMostReplacements = 16;
  const int total = job.map_side * job.map_side;
  std::vector<Worker> workers;
  int32_t next_number = 1;
  const auto start = [&]() -> absl::Status {
    const int32_t number = next_number++;
    SIGHTLINE_ASSIGN_OR_RETURN(
        WorkerProcess process,
        WorkerProcess::Start(
            program,
            {kWorkerFlag, absl::StrCat(memory.job_fd), absl::StrCat(memory.job_bytes),
             absl::StrCat(memory.field_fd), absl::StrCat(memory.field_bytes), absl::StrCat(number)},
            std::array{memory.job_fd, memory.field_fd}));
    workers.push_back({std::move(process), number});
    return absl::OkStatus();
  };
  for (int i = 0; i < processes; ++i) {
    // With fewer processes the work takes longer, but does not fail.
    if (absl::Status started = start(); !started.ok() && workers.empty()) return started;
  }
  const auto all_done = [&job] {
    for (int tile = 0; tile < TileCount(job); ++tile) {
      if (TileStates(job)[tile].load() != kTileDone) return false;
    }
    return true;
  };
  int killed = 0;
  while (!workers.empty()) {
    // The destructor of `workers` kills them; their results are not needed any more.
    if (IsCancelled(options.cancelled)) return absl::CancelledError("visibility field");
    if (options.on_progress) {
      options.on_progress(std::min(1.0, static_cast<double>(job.directions_done.load()) / total));
    }
    for (size_t i = 0; i < workers.size();) {
      const std::optional<int> state = workers[i].process.Ended();
      if (!state) {
        ++i;
        continue;
      }
      const int32_t number = workers[i].number;
      workers.erase(workers.begin() + static_cast<ptrdiff_t>(i));
      if (WIFEXITED(*state) && WEXITSTATUS(*state) == 0) continue;
      if (!WIFSIGNALED(*state)) {
        // A retry would fail again. The destructor of `workers` ends the other processes.
        return absl::InternalError("a visibility field worker failed");
      }
      GiveTilesBack(job, number);
      if (++killed > kMostReplacements) {
        return absl::UnavailableError(absl::StrCat("visibility field workers were killed ", killed,
                                                   " times, at last by signal ", WTERMSIG(*state)));
      }
      start().IgnoreError();  // the others continue; without any, see below
    }
    if (workers.empty() && killed > 0 && !all_done()) {
      SIGHTLINE_RETURN_IF_ERROR(start());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (!all_done()) return absl::InternalError("visibility field workers left a tile out");
  return absl::OkStatus();
}

}  // namespace

VisibilityField::VisibilityField(OctahedralMap map, size_t targets)
    : map_(map),
      blocks_((targets + kTargetsPerBlock - 1) / kTargetsPerBlock),
      data_(nullptr, Unmap{0}) {}

void VisibilityField::Unmap::operator()(uint8_t* data) const { munmap(data, bytes); }

absl::StatusOr<std::unique_ptr<VisibilityField>> BuildVisibilityField(
    const TriangleMesh& part, std::span<const TriangleMesh* const> obstacles,
    const TargetSet& targets, const SurfaceProbes& probes, const FieldBuildOptions& options) {
  int side = static_cast<int>(std::ceil(std::sqrt(options.directions)));
  side = std::max(kTileSide, (side + kTileSide - 1) / kTileSide * kTileSide);
  auto field = std::make_unique<VisibilityField>(OctahedralMap{side}, targets.size());
  const size_t padded = field->blocks() * kTargetsPerBlock;
  if (padded == 0) return absl::InvalidArgumentError("no targets");

  Eigen::AlignedBox3d box = part.BoundingBox();
  for (const TriangleMesh* obstacle : obstacles) box.extend(obstacle->BoundingBox());
  constexpr double kPixelsPerDiagonal = 768;
  const auto pixel_size_m = static_cast<float>(
      options.pixel_size_m > 0 ? options.pixel_size_m : box.sizes().norm() / kPixelsPerDiagonal);
  constexpr float kClusterPointSpacingPx = 8;
  SIGHTLINE_ASSIGN_OR_RETURN(
      const OccluderMesh made,
      MakeOccluderMesh(part, obstacles,
                       {.simplification_m = options.simplification_m,
                        .point_spacing_m = kClusterPointSpacingPx * pixel_size_m},
                       options.cancelled));
  const OccluderMesh& mesh = made;
  JobLayout layout;
  const uint64_t vertices = layout.Add(mesh.vertices.size() * 4);
  const uint64_t triangles = layout.Add(mesh.triangles.size() * 4);
  const uint64_t normals = layout.Add(mesh.normals.size() * 4);
  const uint64_t clusters = layout.Add(mesh.clusters.size() * sizeof(OccluderCluster));
  const uint64_t cluster_vertices = layout.Add(mesh.cluster_vertices.size() * 4);
  const uint64_t probe_offset = layout.Add(size_t{6} * kProbesPerTarget * padded * sizeof(float));
  const uint64_t tiles =
      layout.Add(static_cast<size_t>(side / kTileSide) * (side / kTileSide) * sizeof(int32_t));

  SIGHTLINE_ASSIGN_OR_RETURN(auto job_memory,
                             SharedMemory::Make("sightline-field-job", layout.bytes()));
  SIGHTLINE_ASSIGN_OR_RETURN(auto field_memory,
                             SharedMemory::Make("sightline-field", field->bytes()));
  SIGHTLINE_ASSIGN_OR_RETURN(auto field_data, MapShared(field_memory.fd(), field->bytes()));
  field->data_ = {static_cast<uint8_t*>(field_data), VisibilityField::Unmap{field->bytes()}};
  SIGHTLINE_ASSIGN_OR_RETURN(auto job_data, MapShared(job_memory.fd(), layout.bytes()));
  const std::unique_ptr<void, std::function<void(void*)>> job_mapping(
      job_data, [&](void* data) { munmap(data, layout.bytes()); });

  FieldJob& job = *new (job_data) FieldJob{};
  job.map_side = side;
  job.cull_back_faces = mesh.closed;
  job.coherent_occlusion = options.coherent_occlusion;
  job.pixel_size_m = pixel_size_m;
  for (int k = 0; k < 3; ++k) {
    job.box_min[k] = static_cast<float>(box.min()[k]);
    job.box_max[k] = static_cast<float>(box.max()[k]);
  }
  job.vertex_count = static_cast<uint32_t>(mesh.vertices.size() / 3);
  job.triangle_count = static_cast<uint32_t>(mesh.triangles.size() / 3);
  job.cluster_count = static_cast<uint32_t>(mesh.clusters.size());
  job.cluster_vertex_count = static_cast<uint32_t>(mesh.cluster_vertices.size() / 3);
  job.target_count = static_cast<uint32_t>(padded);
  job.vertices = vertices;
  job.triangles = triangles;
  job.triangle_normals = normals;
  job.clusters = clusters;
  job.cluster_vertices = cluster_vertices;
  job.probes = probe_offset;
  job.tiles = tiles;  // the new mapping is all zeros: kTileWaiting
  char* base = static_cast<char*>(job_data);
  const auto copy = [&](uint64_t offset, const auto& values) {
    if (!values.empty() && !IsCancelled(options.cancelled))
      std::memcpy(base + offset, values.data(), values.size() * sizeof(values[0]));
  };
  copy(vertices, mesh.vertices);
  copy(triangles, mesh.triangles);
  copy(normals, mesh.normals);
  copy(clusters, mesh.clusters);
  copy(cluster_vertices, mesh.cluster_vertices);
  auto* probe_data = reinterpret_cast<float*>(base + probe_offset);
  const size_t stride = kProbesPerTarget * padded;
  for (size_t t = 0; t < targets.size() && !IsCancelled(options.cancelled); ++t) {
    for (int k = 0; k < kProbesPerTarget; ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        probe_data[axis * stride + k * padded + t] =
            probes.positions_m[t * kProbesPerTarget + k][axis];
        probe_data[(3 + axis) * stride + k * padded + t] =
            probes.normals[t * kProbesPerTarget + k][axis];
      }
    }
  }

  const int processes =
      options.processes > 0 ? options.processes : std::max(1u, std::thread::hardware_concurrency());
  if (const std::string program = WorkerProgram(); !program.empty()) {
    SIGHTLINE_RETURN_IF_ERROR(RenderInProcesses(
        program, {job_memory.fd(), layout.bytes(), field_memory.fd(), field->bytes()}, processes,
        options, job));
  } else {
    SIGHTLINE_RETURN_IF_ERROR(RenderFieldTiles(job, field->mutable_data(), 1));
  }

  WorkerThreads threads;
  const size_t share = (field->blocks() + processes - 1) / processes * kTargetsPerBlock;
  for (int i = 0; i < processes; ++i) {
    const size_t begin = std::min(targets.size(), i * share),
                 end = std::min(targets.size(), begin + share);
    threads.Start([&, begin, end] {
      FillBelowHorizon(probes, field->map(), field->mutable_data(), begin, end, options.cancelled);
    });
  }
  threads.Join();
  if (IsCancelled(options.cancelled)) return absl::CancelledError("visibility field");
  // Queries access this memory at random, so huge pages save most TLB misses. Anonymous memory gets
  // huge pages; a shared mapping does not.
  void* huge =
      mmap(nullptr, field->bytes(), PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (huge != MAP_FAILED) {
    madvise(huge, field->bytes(), MADV_HUGEPAGE);
    std::memcpy(huge, field->data_.get(), field->bytes());
    field->data_ = {static_cast<uint8_t*>(huge), VisibilityField::Unmap{field->bytes()}};
  }
  if (options.on_progress) options.on_progress(1);
  return field;
}

std::optional<int> MaybeRunFieldWorker(int argc, char** argv) {
  if (argc != 7 || std::strcmp(argv[1], kWorkerFlag) != 0) return std::nullopt;
  EndWithParent();
  int job_fd = -1, field_fd = -1;
  uint64_t job_bytes = 0, field_bytes = 0;
  int32_t number = 0;
  if (!absl::SimpleAtoi(argv[2], &job_fd) || !absl::SimpleAtoi(argv[3], &job_bytes) ||
      !absl::SimpleAtoi(argv[4], &field_fd) || !absl::SimpleAtoi(argv[5], &field_bytes) ||
      !absl::SimpleAtoi(argv[6], &number) || number < 1) {
    return 2;
  }
  // OSMesa allocates and frees its buffers every frame: malloc keeps the memory of freed buffers.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  auto job = MapShared(job_fd, job_bytes);
  auto field = MapShared(field_fd, field_bytes);
  if (!job.ok() || !field.ok()) return 2;
  const absl::Status status =
      RenderFieldTiles(*static_cast<FieldJob*>(*job), static_cast<uint8_t*>(*field), number);
  if (!status.ok()) {
    std::fprintf(stderr, "visibility field: %s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}

}  // namespace sightline
