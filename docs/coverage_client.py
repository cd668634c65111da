# SPDX-License-Identifier: Apache-2.0
"""Asks a coverage server how many targets some random scans measure.

Usage: coverage_client.py ADDRESS PART.glb
Stubs: protoc -I proto --python_out=stubs --grpc_python_out=stubs \
         --plugin=protoc-gen-grpc_python=$(which grpc_python_plugin) proto/sightline/v1/*.proto
"""
import os
import random
import sys

import grpc

from sightline.v1 import coverage_service_pb2 as cs
from sightline.v1 import coverage_service_pb2_grpc as cs_grpc
from sightline.v1 import job_service_pb2 as jobs
from sightline.v1 import job_service_pb2_grpc as jobs_grpc
from sightline.v1 import measurement_pb2

MIB = 1 << 20


def upload(path):
    """Header first, then chunks of at most 1 MiB."""
    yield cs.UploadPartRequest(header=cs.UploadPartRequest.Header(
        format=os.path.splitext(path)[1][1:], size_bytes=os.path.getsize(path),
        file_name=os.path.basename(path)))
    with open(path, "rb") as file:
        while chunk := file.read(MIB):
            yield cs.UploadPartRequest(chunk=chunk)


def random_scan(rng):
    return measurement_pb2.Measurement(
        camera_distance_m=rng.uniform(0.1, 0.8),
        triangulation_angle_deg=rng.choice([-1, 1]) * rng.uniform(10, 80),
        camera_azimuth_deg=rng.uniform(0, 360), camera_polar_deg=rng.uniform(0, 90),
        part_alpha_deg=rng.uniform(0, 360), part_beta_deg=rng.uniform(0, 360),
        part_gamma_deg=rng.uniform(0, 360), offset_y_m=rng.uniform(-0.1, 0.1),
        offset_z_m=rng.uniform(-0.1, 0.1))


def main(address, part):
    # Replies are up to 64 MiB; Python's default limit is 4 MiB.
    # Calls wait for as long as the server answers pings: how long it computes says nothing.
    channel = grpc.insecure_channel(address, options=[
        ("grpc.max_receive_message_length", 64 * MIB),
        ("grpc.keepalive_time_ms", 60_000), ("grpc.keepalive_timeout_ms", 60_000)])
    coverage = cs_grpc.CoverageServiceStub(channel)
    job_service = jobs_grpc.JobServiceStub(channel)

    uploaded = coverage.UploadPart(upload(part))
    print("part", uploaded.part_digest[:12], uploaded.health.triangle_count, "triangles")

    # Anything left out of the spec has its default; the same spec is built once.
    job = coverage.CreateScene(
        cs.CreateSceneRequest(spec=cs.SceneSpec(part_digest=uploaded.part_digest))).job
    for update in job_service.WatchJob(jobs.WatchJobRequest(job_id=job.job_id)):
        job = update.job
    if job.state != jobs.Job.STATE_SUCCEEDED:
        sys.exit(f"scene: {job.error_message}")
    scene = coverage.GetScene(cs.GetSceneRequest(scene_digest=job.result_key))
    print(scene.target_count, "targets,", scene.measurable_count, "measurable")

    rng = random.Random(1)
    scans = [random_scan(rng) for _ in range(200)]
    fast = coverage.EvaluateGains(cs.EvaluateGainsRequest(
        scene_digest=scene.scene_digest, evaluator=cs.EVALUATOR_FAST, measurements=scans)).gains
    best = max(range(len(scans)), key=lambda i: fast[i].new_targets)
    exact = coverage.EvaluateGains(cs.EvaluateGainsRequest(
        scene_digest=scene.scene_digest, evaluator=cs.EVALUATOR_EXACT, measurements=[scans[best]])).gains[0]
    feasible = sum(g.feasibility == cs.FEASIBILITY_FEASIBLE for g in fast)
    print(f"{feasible} of {len(scans)} scans are feasible; the best measures "
          f"{fast[best].new_targets} targets by the fast estimate, {exact.new_targets} exactly")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except grpc.RpcError as error:
        sys.exit(f"{error.code().name}: {error.details()}")
