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
#include <map>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
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

bool IsClosed(const TriangleMesh& mesh) {
  // Every directed edge has its opposite exactly once: then back faces hide nothing that a front
  // face does not hide too.
  std::map<std::pair<uint32_t, uint32_t>, int> edges;
  for (const auto& t : mesh.triangles) {
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

OccluderMesh MakeOccluders(const TriangleMesh& part, std::span<const TriangleMesh* const> obstacles,
                           double simplification_m, float point_spacing_m) {
  OccluderMesh result;
  std::vector<uint32_t> indices;
  std::vector<const TriangleMesh*> meshes = {&part};
  meshes.insert(meshes.end(), obstacles.begin(), obstacles.end());
  for (const TriangleMesh* mesh : meshes) {
    result.closed = result.closed && IsClosed(*mesh);
    const auto base = static_cast<uint32_t>(result.vertices.size() / 3);
    for (const auto& p : mesh->positions_m) {
      result.vertices.insert(result.vertices.end(), {p.x(), p.y(), p.z()});
    }
    for (const auto& t : mesh->triangles) {
      for (uint32_t v : t) indices.push_back(base + v);
    }
  }
  const size_t vertex_count = result.vertices.size() / 3;
  if (simplification_m > 0 && !indices.empty()) {
    const float scale = meshopt_simplifyScale(result.vertices.data(), vertex_count, 12);
    std::vector<uint32_t> simplified(indices.size());
    simplified.resize(meshopt_simplify(simplified.data(), indices.data(), indices.size(),
                                       result.vertices.data(), vertex_count, 12, 0,
                                       static_cast<float>(simplification_m) / scale, 0, nullptr));
    if (!simplified.empty()) indices = std::move(simplified);
  }
  constexpr size_t kMaxVertices = 64, kMaxTriangles = 32;
  std::vector<meshopt_Meshlet> meshlets(
      meshopt_buildMeshletsBound(indices.size(), kMaxVertices, kMaxTriangles));
  std::vector<uint32_t> meshlet_vertices(meshlets.size() * kMaxVertices);
  std::vector<unsigned char> meshlet_triangles(meshlets.size() * kMaxTriangles * 3);
  meshlets.resize(meshopt_buildMeshlets(
      meshlets.data(), meshlet_vertices.data(), meshlet_triangles.data(), indices.data(),
      indices.size(), result.vertices.data(), vertex_count, 12, kMaxVertices, kMaxTriangles, 0.5f));
  for (const meshopt_Meshlet& m : meshlets) {
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
                      size_t begin, size_t end) {
  constexpr float kAbove = 0.05f;    // sine of the elevation from which a cell's answer is its own
  constexpr float kClampTo = 0.08f;  // elevation the direction is lifted to
  constexpr float kBelow = -0.15f;   // no direction in such a cell is above the horizon
  std::vector<Eigen::Vector3f> directions(map.cells());
  for (int c = 0; c < map.cells(); ++c) directions[c] = map.Direction(c);
  std::vector<uint8_t> own(map.cells());
  for (size_t t = begin; t < end; ++t) {
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
                                          kClusterPointSpacingPx * pixel_size_m);
  JobLayout layout;
  const uint64_t vertices = layout.Add(mesh.vertices.size() * 4);
  const uint64_t triangles = layout.Add(mesh.triangles.size() * 4);
  const uint64_t normals = layout.Add(mesh.normals.size() * 4);
  const uint64_t clusters = layout.Add(mesh.clusters.size() * sizeof(FieldCluster));
  const uint64_t cluster_vertices = layout.Add(mesh.cluster_vertices.size() * 4);
  const uint64_t probe_offset = layout.Add(6 * kProbesPerTarget * padded * 4);

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
  for (size_t t = 0; t < targets.size(); ++t) {
    for (int k = 0; k < kProbesPerTarget; ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        probe_data[axis * stride + k * padded + t] =
            probes.positions_m[t * kProbesPerTarget + k][axis];
        probe_data[(3 + axis) * stride + k * padded + t] =
            probes.normals[t * kProbesPerTarget + k][axis];
      }
    }
  }

  const int total = side * side;
  const int processes =
      options.processes > 0 ? options.processes : std::max(1u, std::thread::hardware_concurrency());
  const std::string program = WorkerProgram();
  std::vector<pid_t> workers;
  for (int i = 0; i < processes && !program.empty(); ++i) {
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    // dup2 onto itself drops close-on-exec for the child only.
    posix_spawn_file_actions_adddup2(&actions, job_memory->fd(), job_memory->fd());
    posix_spawn_file_actions_adddup2(&actions, field_memory->fd(), field_memory->fd());
    std::string arguments[] = {program,
                               "--field-worker",
                               absl::StrCat(job_memory->fd()),
                               absl::StrCat(layout.bytes()),
                               absl::StrCat(field_memory->fd()),
                               absl::StrCat(field->bytes())};
    char* argv[] = {arguments[0].data(),
                    arguments[1].data(),
                    arguments[2].data(),
                    arguments[3].data(),
                    arguments[4].data(),
                    arguments[5].data(),
                    nullptr};
    pid_t pid;
    if (posix_spawn(&pid, program.c_str(), &actions, nullptr, argv, environ) == 0)
      workers.push_back(pid);
    posix_spawn_file_actions_destroy(&actions);
  }
  bool worker_failed = false;
  int killed_by = 0;
  while (!workers.empty()) {
    if (options.cancelled != nullptr && options.cancelled->load()) job.cancelled.store(1);
    if (options.on_progress)
      options.on_progress(static_cast<double>(job.directions_done.load()) / total);
    for (size_t i = 0; i < workers.size();) {
      int state = 0;
      if (waitpid(workers[i], &state, WNOHANG) == workers[i]) {
        worker_failed |= !WIFEXITED(state) || WEXITSTATUS(state) != 0;
        if (WIFSIGNALED(state)) killed_by = WTERMSIG(state);
        // What it had taken is lost: stop the others too.
        if (worker_failed) job.cancelled.store(1);
        workers.erase(workers.begin() + static_cast<ptrdiff_t>(i));
      } else {
        ++i;
      }
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  if (program.empty()) {
    if (absl::Status status = RenderFieldTiles(job, field->mutable_data()); !status.ok())
      return status;
  }
  if (!worker_failed && job.cancelled.load()) return absl::CancelledError("visibility field");
  // Whoever killed it may not do so again, while an error of its own comes back.
  if (killed_by != 0) {
    return absl::UnavailableError(absl::StrCat("a visibility field worker was killed by signal ",
                                               killed_by, " after ", job.directions_done.load(),
                                               " of ", total, " directions"));
  }
  if (worker_failed || job.directions_done.load() != total) {
    return absl::InternalError(
        absl::StrCat("a visibility field worker died: ", job.directions_done.load(), " of ", total,
                     " directions rendered"));
  }

  std::vector<std::thread> threads;
  const size_t share = (field->blocks() + processes - 1) / processes * kTargetsPerBlock;
  for (int i = 0; i < processes; ++i) {
    const size_t begin = std::min(targets.size(), i * share),
                 end = std::min(targets.size(), begin + share);
    threads.emplace_back([&, begin, end] {
      FillBelowHorizon(probes, field->map(), field->mutable_data(), begin, end);
    });
  }
  for (auto& thread : threads) thread.join();
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
  if (argc != 6 || std::strcmp(argv[1], "--field-worker") != 0) return std::nullopt;
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  int job_fd = -1, field_fd = -1;
  uint64_t job_bytes = 0, field_bytes = 0;
  if (!absl::SimpleAtoi(argv[2], &job_fd) || !absl::SimpleAtoi(argv[3], &job_bytes) ||
      !absl::SimpleAtoi(argv[4], &field_fd) || !absl::SimpleAtoi(argv[5], &field_bytes)) {
    return 2;
  }
  // OSMesa allocates and frees its buffers every frame: keep them instead of asking the kernel.
  mallopt(M_MMAP_THRESHOLD, 1 << 30);
  mallopt(M_TRIM_THRESHOLD, 1 << 30);
  auto job = Map(job_fd, job_bytes);
  auto field = Map(field_fd, field_bytes);
  if (!job.ok() || !field.ok()) return 2;
  const absl::Status status =
      RenderFieldTiles(*static_cast<FieldJob*>(*job), static_cast<uint8_t*>(*field));
  if (!status.ok()) {
    std::fprintf(stderr, "visibility field: %s\n", status.ToString().c_str());
    return 1;
  }
  return 0;
}

}  // namespace sightline
