#include "coverage_server/visibility/visibility_field.h"

#include <fcntl.h>
#include <malloc.h>
#include <meshoptimizer.h>
#include <signal.h>
#include <spawn.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <bit>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <map>
#include <new>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "core/parallel/worker_threads.h"
#include "coverage_server/visibility/field_renderer.h"
#include "coverage_server/visibility/field_worker.h"

extern char** environ;

namespace sightline {
namespace {

// A file in memory that worker processes map too.
class SharedMemory {
 public:
  static absl::StatusOr<SharedMemory> Make(const char* name, size_t bytes) {
    SharedMemory memory;
    memory.fd_ = memfd_create(name, MFD_CLOEXEC);
    if (memory.fd_ < 0 || ftruncate(memory.fd_, static_cast<off_t>(bytes)) != 0) {
      return absl::ResourceExhaustedError(
          absl::StrCat("no shared memory of ", bytes, " bytes: ", std::strerror(errno)));
    }
    return memory;
  }
  SharedMemory(SharedMemory&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  SharedMemory& operator=(SharedMemory&&) = delete;
  ~SharedMemory() {
    if (fd_ >= 0) close(fd_);
  }
  int fd() const { return fd_; }

 private:
  SharedMemory() = default;
  int fd_ = -1;
};

absl::StatusOr<void*> Map(int fd, size_t bytes) {
  void* data = mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
  if (data == MAP_FAILED) {
    return absl::ResourceExhaustedError(
        absl::StrCat("cannot map ", bytes, " bytes: ", std::strerror(errno)));
  }
  return data;
}

// Triangles of part and obstacles, simplified and grouped into clusters.
struct OccluderMesh {
  std::vector<float> vertices;
  std::vector<uint32_t> triangles;
  std::vector<float> normals;
  std::vector<FieldCluster> clusters;
  std::vector<float> cluster_vertices;
  bool closed = true;
};

bool IsSet(const std::atomic<bool>* flag) {
  return flag != nullptr && flag->load(std::memory_order_relaxed);
}

bool IsClosed(const TriangleMesh& mesh, const std::atomic<bool>* cancelled) {
  // Every directed edge has its opposite exactly once: then back faces hide nothing that a front
  // face does not hide too.
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const auto& t : mesh.triangles) {
    if (IsSet(cancelled)) return false;
    for (int k = 0; k < 3; ++k) {
      const uint32_t a = t[k], b = t[(k + 1) % 3];
      if (a < b) {
        ++edges[{a, b}];
      } else {
        --edges[{b, a}];
      }
    }
  }
  for (const auto& [edge, balance] : edges) {
    if (balance != 0) return false;
  }
  return true;
}

// Points inside a triangle and on its edges, `spacing_m` apart: the middle of a large triangle may
// be seen while its corners are hidden.
template <typename AddPoint>
void AddInnerPoints(const Eigen::Vector3f* corner, float spacing_m, const AddPoint& add_point) {
  int longest = 0;
  float length = 0;
  for (int k = 0; k < 3; ++k) {
    const float edge = (corner[(k + 1) % 3] - corner[k]).norm();
    if (edge > length) longest = k, length = edge;
  }
  if (length <= spacing_m) return;
  const Eigen::Vector3f a = corner[longest], b = corner[(longest + 1) % 3],
                        apex = corner[(longest + 2) % 3];
  const float height = (b - a).cross(apex - a).norm() / length;
  constexpr int kMaxSteps = 64;
  const int columns = std::min(kMaxSteps, static_cast<int>(std::ceil(length / spacing_m)));
  const int rows = std::min(kMaxSteps, static_cast<int>(std::ceil(height / spacing_m)));
  for (int j = 0; j < rows; ++j) {
    const float up = static_cast<float>(j) / static_cast<float>(rows);
    const int steps =
        std::max(1, static_cast<int>(std::ceil(static_cast<float>(columns) * (1 - up))));
    for (int i = j == 0 ? 1 : 0; i <= steps - (j == 0 ? 1 : 0); ++i) {
      const float along = static_cast<float>(i) / static_cast<float>(steps);
      add_point((1 - up) * (a + along * (b - a)) + up * apex);
    }
  }
}

// Stops early, with what is of no use, when *cancelled.
OccluderMesh MakeOccluders(const TriangleMesh& part, std::span<const TriangleMesh* const> obstacles,
                           double simplification_m, float point_spacing_m,
                           const std::atomic<bool>* cancelled) {
  OccluderMesh result;
  std::vector<uint32_t> indices;
  std::vector<const TriangleMesh*> meshes = {&part};
  meshes.insert(meshes.end(), obstacles.begin(), obstacles.end());
  for (const TriangleMesh* mesh : meshes) {
    result.closed = result.closed && IsClosed(*mesh, cancelled);
    const auto base = static_cast<uint32_t>(result.vertices.size() / 3);
    for (const auto& p : mesh->positions_m) {
      result.vertices.insert(result.vertices.end(), {p.x(), p.y(), p.z()});
    }
    for (const auto& t : mesh->triangles) {
      for (uint32_t v : t) indices.push_back(base + v);
    }
  }
  const size_t vertex_count = result.vertices.size() / 3;
  if (IsSet(cancelled)) return result;
  if (simplification_m > 0 && !indices.empty()) {
    const float scale = meshopt_simplifyScale(result.vertices.data(), vertex_count, 12);
    std::vector<uint32_t> simplified(indices.size());
    simplified.resize(meshopt_simplify(simplified.data(), indices.data(), indices.size(),
                                       result.vertices.data(), vertex_count, 12, 0,
                                       static_cast<float>(simplification_m) / scale, 0, nullptr));
    if (!simplified.empty()) indices = std::move(simplified);
  }
  if (IsSet(cancelled)) return result;
  constexpr size_t kMaxVertices = 64, kMaxTriangles = 32;
  std::vector<meshopt_Meshlet> meshlets(
      meshopt_buildMeshletsBound(indices.size(), kMaxVertices, kMaxTriangles));
  std::vector<uint32_t> meshlet_vertices(meshlets.size() * kMaxVertices);
  std::vector<unsigned char> meshlet_triangles(meshlets.size() * kMaxTriangles * 3);
  meshlets.resize(meshopt_buildMeshlets(
      meshlets.data(), meshlet_vertices.data(), meshlet_triangles.data(), indices.data(),
      indices.size(), result.vertices.data(), vertex_count, 12, kMaxVertices, kMaxTriangles, 0.5f));
  for (const meshopt_Meshlet& m : meshlets) {
    if (IsSet(cancelled)) return result;
    FieldCluster cluster{};
    cluster.first_triangle = static_cast<uint32_t>(result.triangles.size() / 3);
    cluster.triangle_count = m.triangle_count;
    cluster.first_vertex = static_cast<uint32_t>(result.cluster_vertices.size() / 3);
    const auto add_point = [&](const Eigen::Vector3f& p) {
      result.cluster_vertices.insert(result.cluster_vertices.end(), {p.x(), p.y(), p.z()});
    };
    for (unsigned v = 0; v < m.vertex_count; ++v) {
      add_point(Eigen::Map<const Eigen::Vector3f>(
          &result.vertices[3 * meshlet_vertices[m.vertex_offset + v]]));
    }
    for (unsigned t = 0; t < m.triangle_count; ++t) {
      Eigen::Vector3f corner[3];
      for (int k = 0; k < 3; ++k) {
        const uint32_t v =
            meshlet_vertices[m.vertex_offset + meshlet_triangles[m.triangle_offset + 3 * t + k]];
        result.triangles.push_back(v);
        corner[k] = Eigen::Map<const Eigen::Vector3f>(&result.vertices[3 * v]);
      }
      const Eigen::Vector3f n = (corner[1] - corner[0]).cross(corner[2] - corner[0]);
      result.normals.insert(result.normals.end(), {n.x(), n.y(), n.z()});
      AddInnerPoints(corner, point_spacing_m, add_point);
    }
    cluster.vertex_count =
        static_cast<uint32_t>(result.cluster_vertices.size() / 3) - cluster.first_vertex;
    const meshopt_Bounds bounds = meshopt_computeMeshletBounds(
        &meshlet_vertices[m.vertex_offset], &meshlet_triangles[m.triangle_offset], m.triangle_count,
        result.vertices.data(), vertex_count, 12);
    for (int k = 0; k < 3; ++k) cluster.cone_axis[k] = bounds.cone_axis[k];
    cluster.cone_cutoff = bounds.cone_cutoff >= 1 ? 2.0f : bounds.cone_cutoff;
    result.clusters.push_back(cluster);
  }
  return result;
}

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

std::string WorkerProgram() {
  std::error_code ignored;
  std::vector<std::filesystem::path> folders = {
      std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path()};
  if (const char* folder = std::getenv("SIGHTLINE_BIN_DIR")) folders.emplace_back(folder);
  for (const auto& folder : folders) {
    const auto program = folder / "coverage_server";
    if (access(program.c_str(), X_OK) == 0) return program.string();
  }
  return "";
}

// Directions just below a probe's horizon: the sensor may still be above it, so the cell takes over
// what the probe sees from the nearest cell above.
void FillBelowHorizon(const SurfaceProbes& probes, const OctahedralMap& map, uint8_t* data,
                      size_t begin, size_t end, const std::atomic<bool>* cancelled) {
  constexpr float kAbove = 0.05f;    // sine of the elevation from which a cell's answer is its own
  constexpr float kClampTo = 0.08f;  // elevation the direction is lifted to
  constexpr float kBelow = -0.15f;   // no direction in such a cell is above the horizon
  std::vector<Eigen::Vector3f> directions(map.cells());
  for (int c = 0; c < map.cells(); ++c) directions[c] = map.Direction(c);
  std::vector<uint8_t> own(map.cells());
  for (size_t t = begin; t < end && !IsSet(cancelled); ++t) {
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

// What a worker process maps.
struct WorkerMemory {
  int job_fd;
  size_t job_bytes;
  int field_fd;
  size_t field_bytes;
};

// One worker process, killed if it still runs when this goes.
class Worker {
 public:
  // RESOURCE_EXHAUSTED: the system gives no more processes.
  static absl::StatusOr<Worker> Start(const std::string& program, const WorkerMemory& memory,
                                      int32_t number) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    // dup2 onto itself drops close-on-exec for the child only.
    posix_spawn_file_actions_adddup2(&actions, memory.job_fd, memory.job_fd);
    posix_spawn_file_actions_adddup2(&actions, memory.field_fd, memory.field_fd);
    std::string arguments[] = {program,
                               "--field-worker",
                               absl::StrCat(memory.job_fd),
                               absl::StrCat(memory.job_bytes),
                               absl::StrCat(memory.field_fd),
                               absl::StrCat(memory.field_bytes),
                               absl::StrCat(number)};
    char* argv[std::size(arguments) + 1] = {};
    for (size_t i = 0; i < std::size(arguments); ++i) argv[i] = arguments[i].data();
    pid_t pid = 0;
    const int error = posix_spawn(&pid, program.c_str(), &actions, nullptr, argv, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (error != 0) {
      return absl::ResourceExhaustedError(
          absl::StrCat("a visibility field worker cannot be started: ", std::strerror(error)));
    }
    return Worker(pid, number);
  }
  Worker(Worker&& other) noexcept : pid_(std::exchange(other.pid_, 0)), number_(other.number_) {}
  Worker& operator=(Worker&& other) noexcept {
    std::swap(pid_, other.pid_);
    number_ = other.number_;
    return *this;
  }
  ~Worker() {
    if (pid_ <= 0) return;
    kill(pid_, SIGKILL);
    waitpid(pid_, nullptr, 0);
  }

  int32_t number() const { return number_; }
  // How it ended, as of waitpid(); nothing while it runs.
  std::optional<int> Ended() {
    int state = 0;
    if (waitpid(pid_, &state, WNOHANG) != pid_) return std::nullopt;
    pid_ = 0;
    return state;
  }

 private:
  Worker(pid_t pid, int32_t number) : pid_(pid), number_(number) {}
  pid_t pid_;
  int32_t number_;
};

// What a worker that was killed had taken and not finished waits again.
void GiveTilesBack(FieldJob& job, int32_t worker) {
  for (int tile = 0; tile < TileCount(job); ++tile) {
    int32_t taken = worker;
    TileStates(job)[tile].compare_exchange_strong(taken, kTileWaiting);
  }
}

// Renders all tiles in `processes` processes. One that is killed from outside is replaced, as often
// as kMostReplacements: a tile that kills whoever renders it must not do so for ever.
absl::Status RenderInProcesses(const std::string& program, const WorkerMemory& memory,
                               int processes, const FieldBuildOptions& options, FieldJob& job) {
  constexpr int kMostReplacements = 16;
  const int total = job.map_side * job.map_side;
  std::vector<Worker> workers;
  int32_t next_number = 1;
  const auto start = [&]() -> absl::Status {
    absl::StatusOr<Worker> worker = Worker::Start(program, memory, next_number++);
    if (worker.ok()) workers.push_back(*std::move(worker));
    return worker.status();
  };
  for (int i = 0; i < processes; ++i) {
    // With fewer it takes longer.
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
    // The workers are killed with `workers`: nobody wants what they would still finish.
    if (IsSet(options.cancelled)) return absl::CancelledError("visibility field");
    if (options.on_progress) {
      options.on_progress(std::min(1.0, static_cast<double>(job.directions_done.load()) / total));
    }
    for (size_t i = 0; i < workers.size();) {
      const std::optional<int> state = workers[i].Ended();
      if (!state) {
        ++i;
        continue;
      }
      const int32_t number = workers[i].number();
      workers.erase(workers.begin() + static_cast<ptrdiff_t>(i));
      if (WIFEXITED(*state) && WEXITSTATUS(*state) == 0) continue;
      if (!WIFSIGNALED(*state)) {
        // The mistake would come back. The others end with `workers`.
        return absl::InternalError("a visibility field worker failed");
      }
      GiveTilesBack(job, number);
      if (++killed > kMostReplacements) {
        return absl::UnavailableError(absl::StrCat("visibility field workers were killed ", killed,
                                                   " times, at last by signal ", WTERMSIG(*state)));
      }
      start().IgnoreError();  // the others go on; if there are none, see below
    }
    if (workers.empty() && killed > 0 && !all_done()) {
      if (absl::Status started = start(); !started.ok()) return started;
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
  const OccluderMesh mesh = MakeOccluders(part, obstacles, options.simplification_m,
                                          kClusterPointSpacingPx * pixel_size_m, options.cancelled);
  if (IsSet(options.cancelled)) return absl::CancelledError("visibility field");
  JobLayout layout;
  const uint64_t vertices = layout.Add(mesh.vertices.size() * 4);
  const uint64_t triangles = layout.Add(mesh.triangles.size() * 4);
  const uint64_t normals = layout.Add(mesh.normals.size() * 4);
  const uint64_t clusters = layout.Add(mesh.clusters.size() * sizeof(FieldCluster));
  const uint64_t cluster_vertices = layout.Add(mesh.cluster_vertices.size() * 4);
  const uint64_t probe_offset = layout.Add(6 * kProbesPerTarget * padded * 4);
  const uint64_t tiles =
      layout.Add(static_cast<size_t>(side) * side / (kTileSide * kTileSide) * sizeof(int32_t));

  auto job_memory = SharedMemory::Make("sightline-field-job", layout.bytes());
  if (!job_memory.ok()) return job_memory.status();
  auto field_memory = SharedMemory::Make("sightline-field", field->bytes());
  if (!field_memory.ok()) return field_memory.status();
  auto field_data = Map(field_memory->fd(), field->bytes());
  if (!field_data.ok()) return field_data.status();
  field->data_ = {static_cast<uint8_t*>(*field_data), VisibilityField::Unmap{field->bytes()}};
  auto job_data = Map(job_memory->fd(), layout.bytes());
  if (!job_data.ok()) return job_data.status();
  const std::unique_ptr<void, std::function<void(void*)>> job_mapping(
      *job_data, [&](void* data) { munmap(data, layout.bytes()); });

  FieldJob& job = *new (*job_data) FieldJob{};
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
  char* base = static_cast<char*>(*job_data);
  const auto copy = [&](uint64_t offset, const auto& values) {
    if (!values.empty())
      std::memcpy(base + offset, values.data(), values.size() * sizeof(values[0]));
  };
  copy(vertices, mesh.vertices);
  copy(triangles, mesh.triangles);
  copy(normals, mesh.normals);
  copy(clusters, mesh.clusters);
  copy(cluster_vertices, mesh.cluster_vertices);
  auto* probe_data = reinterpret_cast<float*>(base + probe_offset);
  const size_t stride = kProbesPerTarget * padded;
  for (size_t t = 0; t < targets.size() && !IsSet(options.cancelled); ++t) {
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
    absl::Status rendered = RenderInProcesses(
        program, {job_memory->fd(), layout.bytes(), field_memory->fd(), field->bytes()}, processes,
        options, job);
    if (!rendered.ok()) return rendered;
  } else {
    absl::Status rendered = RenderFieldTiles(job, field->mutable_data(), 1);
    if (!rendered.ok()) return rendered;
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
  if (IsSet(options.cancelled)) return absl::CancelledError("visibility field");
  // Queries jump about in this memory: huge pages save most of their TLB misses, and anonymous
  // memory gets them where a shared mapping does not.
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
  if (argc != 7 || std::strcmp(argv[1], "--field-worker") != 0) return std::nullopt;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  int job_fd = -1, field_fd = -1;
  uint64_t job_bytes = 0, field_bytes = 0;
  int32_t number = 0;
  if (!absl::SimpleAtoi(argv[2], &job_fd) || !absl::SimpleAtoi(argv[3], &job_bytes) ||
      !absl::SimpleAtoi(argv[4], &field_fd) || !absl::SimpleAtoi(argv[5], &field_bytes) ||
      !absl::SimpleAtoi(argv[6], &number) || number < 1) {
    return 2;
  }
  // OSMesa allocates and frees its buffers every frame: keep them instead of asking the kernel.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  auto job = Map(job_fd, job_bytes);
  auto field = Map(field_fd, field_bytes);
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
