// SPDX-License-Identifier: Apache-2.0
// The part as points measured by the first scans of a plan show it: how it lies, where its surface
// deviates from the CAD model, and the mesh that the remaining scans are planned on.
//
// It is supposed that the part lies in its holder in one way during all scans: a scan turns and
// shifts holder and part together.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "core/inspection/inspection.h"
#include "core/part/mesh.h"
#include "core/registration/outliers.h"
#include "core/registration/rigid_registration.h"
#include "core/registration/surface_deviation.h"
#include "sightline/v1/plan.pb.h"

namespace sightline {

// Points of all files together. Each takes some 250 bytes at the most: position and normal (48)
// while the pose is sought, the nearest place of the model (104) while its file is projected onto
// that, what is kept of it there (33 to 66), and its place in the tree (some 25); all of them 5 GB.
// They are a point every 0.1 mm on a fifth of a square metre: finer than what scanners resolve,
// and ten for each target of the largest inspection. The pose is found by 20 000 of them.
inline constexpr int64_t kMostMeasuredPoints = 20'000'000;

// A file of measured points and the scan that measured them, counted from 0.
struct MeasuredFile {
  std::string path;
  int scan = 0;
};

// Assigns each file to a scan, in the order of the scans: by the number in the name if all are
// named scan_NN.ply (from 1; or with the suffix of another format, MeasuredPointFormats), else by
// the order of the files. INVALID_ARGUMENT names the file: some named so and others not, a number
// that the plan does not have, two files of one scan, more files than scans.
absl::StatusOr<std::vector<MeasuredFile>> AssignScans(const std::vector<std::string>& paths,
                                                      int scan_count);

struct MeasuredPartOptions {
  PosePrior prior;
  // Three quarters of the points of every file must be this near to the registered model, in
  // addition to the noise of detection.
  double tolerated_distance_m = 0.002;
  // Points farther from it belong to something else.
  double reach_m = 0.005;
  // Unit of files of points that state none, and the transformation to the coordinates of the
  // model.
  double metres_per_unit = 1;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  int threads = 0;  // 0: all cores; results do not depend on it
};

struct MeasuredPart {
  Registration registration;
  // CAD model as the rig has it: turned and shifted by the registration.
  PartPlacement placement;
  std::shared_ptr<const TriangleMesh> mesh;  // CAD coordinates, deviations included
  std::vector<MeasuredFile> files;
  std::vector<std::unique_ptr<IndexedScan>> scans;  // one per file
  // Points that were read of each file, and those that are not among the points of its scan.
  struct PointCounts {
    int64_t read = 0;  // without repetitions
    int64_t duplicates = 0, without_value = 0;
    int64_t off_model = 0, among_neighbours = 0;  // outliers
    double rms_m = 0;                             // distance of the others from the model
  };
  std::vector<PointCounts> counts;
  std::vector<Eigen::Vector3f> outliers_m;  // among neighbours, of all scans; CAD coordinates
  // Deviation of the surface at a target of the CAD model that points inform about.
  struct TargetDeviation {
    Eigen::Vector3f position_m;
    Eigen::Vector3f normal;
    float mean_m;
    float uncertainty_m;  // with that of the pose
    bool significant;
  };
  std::vector<TargetDeviation> deviations;
  // All of v1::AsMeasured but what plans satisfy.
  v1::AsMeasured message;

  std::vector<const IndexedScan*> ScanPointers() const;
};

// `scans`: of the plan, those that `files` refer to. Errors name the file: INVALID_ARGUMENT for
// points that LoadPoints refuses, more than kMostMeasuredPoints, points that lie too far from the
// part wherever it may lie, and for a part that lies farther off than four standard deviations of
// the prior; more than 1 % of points that repeat others, which would count as measured several
// times; points in another unit, of a mirrored part, or of another scan of the plan, where that can
// be detected. Outliers among neighbours (core/registration/outliers.h) are left out.
absl::StatusOr<MeasuredPart> FindMeasuredPart(const TriangleMesh& model,
                                              const Inspection& inspection,
                                              const std::vector<MeasuredFile>& files,
                                              const std::vector<Measurement>& scans,
                                              const MeasuredPartOptions& options);

// One per target: the uncertainty model's, with the resolution of the target's region.
std::vector<SurfacePrior> PriorsOf(const TargetSet& targets, const TargetSampling& sampling,
                                   const UncertaintyModel& model);

}  // namespace sightline
