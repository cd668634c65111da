// SPDX-License-Identifier: Apache-2.0
// Embree doing the fast evaluator's work with rays: the peer in benchmarks.
#pragma once

#include <embree3/rtcore.h>

#include <vector>

#include "core/part/mesh.h"
#include "core/targets/target_set.h"
#include "coverage_server/scan/scan_in_part.h"
#include "coverage_server/visibility/surface_probes.h"

namespace sightline::bench {

// Any-hit queries against one mesh. Immutable; queries may run in parallel.
class EmbreeMesh {
 public:
  // Builds the tree with `threads` threads, quality RTC_BUILD_QUALITY_HIGH.
  EmbreeMesh(const TriangleMesh& mesh, int threads);
  ~EmbreeMesh();
  EmbreeMesh(const EmbreeMesh&) = delete;
  EmbreeMesh& operator=(const EmbreeMesh&) = delete;

  // Eight rays at a time. `active`: -1 or 0 per lane; occluded lanes have ray.tfar < 0 afterwards.
  void Occluded(const int* active, RTCRay8& rays) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    context.flags = RTC_INTERSECT_CONTEXT_FLAG_COHERENT;
    rtcOccluded8(active, scene_, &context, &rays);
  }

 private:
  RTCDevice device_;
  RTCScene scene_;
};

// Targets of a scan that face camera and laser, lie in field of view, fan and range at their lit
// moment, and of which one of the first `probes` (1: the target alone; 8) is seen from both. No
// collision check, no test of the sampling grid: less work than the fast evaluator does. Targets
// are in Morton order, so that the packets are coherent.
class EmbreeCoverage {
 public:
  EmbreeCoverage(const EmbreeMesh& mesh, const TargetSet& targets, const SurfaceProbes& probes)
      : mesh_(mesh), targets_(targets), probes_(probes) {}

  TargetBits Covered(const ScanInPart& scan, int probes) const;

 private:
  const EmbreeMesh& mesh_;
  const TargetSet& targets_;
  const SurfaceProbes& probes_;
};

}  // namespace sightline::bench
