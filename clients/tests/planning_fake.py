# SPDX-License-Identifier: Apache-2.0
"""A planning service in memory, to test clients against.

Names, checks and errors are those of proto/sightline/v1/planning_service.proto. It plans nothing:
every job has the same results.
"""
import hashlib
import re
import struct
import threading
from concurrent import futures

import grpc
from google.protobuf import json_format

from sightline import errors
from sightline.task_files import file_references
from sightline.v1 import material_pb2, plan_pb2
from sightline.v1 import planning_service_pb2 as pb
from sightline.v1 import planning_service_pb2_grpc as pb_grpc

CHUNK_BYTES = 1 << 10  # Small, so that results have several chunks.
MAX_CHUNK_BYTES = 1 << 20
FINISHED = (pb.PlanningJob.SUCCEEDED, pb.PlanningJob.FAILED, pb.PlanningJob.CANCELLED)
OWN_NAMES = ("inspection.json", "recordings.json", "plan.json")


class Refusal(Exception):
    """What a call ends with."""

    def __init__(self, code, reason, message, metadata=None, violations=(), retry_delay_s=None):
        super().__init__(message)
        self.code, self.reason, self.message = code, reason, message
        self.metadata, self.violations = metadata or {}, violations
        self.retry_delay_s = retry_delay_s

    def details(self):
        """Bytes of google.rpc.Status."""
        classes = errors._DETAILS
        status = classes["Status"](code=self.code.value[0], message=self.message)
        parts = [classes["ErrorInfo"](reason=self.reason, domain="sightline",
                                      metadata=self.metadata)]
        if self.violations:
            bad = classes["BadRequest"]()
            for field, description in self.violations:
                bad.field_violations.add(field=field, description=description)
            parts.append(bad)
        if self.retry_delay_s is not None:
            info = classes["RetryInfo"]()
            info.retry_delay.nanos = int(self.retry_delay_s * 1e9)
            parts.append(info)
        for part in parts:
            status.details.add(type_url=f"type.googleapis.com/{part.DESCRIPTOR.full_name}",
                               value=part.SerializeToString())
        return status.SerializeToString()


def away():
    return Refusal(grpc.StatusCode.UNAVAILABLE, "DRAINING", "the server is shutting down",
                   retry_delay_s=0.01)


def points_ply(points, normals):
    """The form that `sightline plan` writes."""
    header = ("ply\nformat binary_little_endian 1.0\ncomment unit: metre\n"
              f"element vertex {len(points)}\nproperty float x\nproperty float y\n"
              "property float z\nproperty float nx\nproperty float ny\nproperty float nz\n"
              "end_header\n")
    rows = [struct.pack("<6f", *p, *n) for p, n in zip(points, normals)]
    return header.encode() + b"".join(rows)


def plan_results():
    plan = plan_pb2.Plan(inspection_name="cylinder head", strategy="greedy", seed=1,
                         stop_reason=plan_pb2.Plan.STOP_REASON_GOAL_REACHED)
    results = {}
    for index in (1, 2):
        scan = plan.scans.add(index=index, new_targets=100 * index, covered_targets=200,
                              cumulative_targets=100 * index * (index + 1) // 2,
                              measurement_points=60, stage_end_m=0.1,
                              trigger_positions_m=[0.0, 0.05, 0.1])
        scan.measurement.camera_distance_m = 0.3
        scan.measurement.triangulation_angle_deg = -20
        for pose in (scan.camera_pose, scan.laser_pose, scan.part_pose):
            pose.matrix.extend([1, 0, 0, index, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])
        results[f"points/scan_{index:02d}.ply"] = points_ply(
            [(0.001 * i, index, 0) for i in range(60)], [(0, 0, 1)] * 60)
    plan.coverage.targets, plan.coverage.measurable_targets = 400, 320
    plan.coverage.covered_targets, plan.coverage.coverage, plan.coverage.goal = 304, 0.95, 0.95
    results["plan.json"] = json_format.MessageToJson(
        plan, preserving_proto_field_name=True).encode()
    results["report.html"] = b"<!doctype html><title>plan</title>" + b"<p>scan</p>" * 500
    return results


class PlanningFake(pb_grpc.PlanningServiceServicer):
    """Jobs stay QUEUED until `update` is called, or, with `finish_jobs`, succeed at once."""

    def __init__(self, finish_jobs=True, token=None):
        self.finish_jobs, self.token = finish_jobs, token
        self.files, self.jobs, self.tasks, self.by_request_id = {}, {}, {}, {}
        self.results = plan_results()
        self.calls, self.uploads = [], []
        self.held = {}  # Events by methods: calls wait for them.
        self._faults = []
        self._changed = threading.Condition()

    # --- what tests ask of it

    def fail_next(self, method, refusal, after=False, chunks=0):
        """The next call of `method` ends so: before anything was done, after all was done (its
        answer is lost), or after so many chunks or states."""
        self._faults.append((method, refusal, after, chunks))

    def update(self, job_id, **fields):
        with self._changed:
            job = self.jobs[job_id]
            failure = fields.pop("failure", None)
            for name, value in fields.items():
                setattr(job, name, value)
            if failure:
                job.failure.CopyFrom(failure)
            if job.state == pb.PlanningJob.SUCCEEDED and not job.results:
                job.progress = 1
                for name, data in sorted(self.results.items()):
                    job.results.add(name=name, digest=hashlib.sha256(data).hexdigest(),
                                    size_bytes=len(data))
            job.revision += 1
            self._changed.notify_all()

    # --- service

    def _fault(self, method, after):
        for fault in self._faults:
            if fault[0] == method and fault[2] == after and not fault[3]:
                self._faults.remove(fault)
                raise fault[1]

    def _chunk_fault(self, method):
        for fault in self._faults:
            if fault[0] == method and fault[3]:
                self._faults.remove(fault)
                return fault[1], fault[3]
        return None, 0

    def _begin(self, method, context):
        self.calls.append(method)
        sent = dict(context.invocation_metadata()).get("authorization")
        if self.token and sent != f"Bearer {self.token}":
            raise Refusal(grpc.StatusCode.UNAUTHENTICATED, "CREDENTIALS_UNKNOWN", "who are you?")
        if method in self.held:
            self.held[method].wait()
        self._fault(method, after=False)

    def _job(self, job_id):
        if job_id not in self.jobs:
            raise Refusal(grpc.StatusCode.NOT_FOUND, "JOB_UNKNOWN", f"no job {job_id}")
        return self.jobs[job_id]

    def upload_file(self, messages):
        header = next(messages).header
        data = b""
        for message in messages:
            if message.WhichOneof("content") != "chunk" or len(message.chunk) > MAX_CHUNK_BYTES:
                raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, "INVALID_FIELD", "not a chunk")
            data += message.chunk
        digest = hashlib.sha256(data).hexdigest()
        if header.digest not in ("", digest):
            raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, "DIGEST_MISMATCH", "other bytes")
        self.files[digest] = data
        self.uploads.append(digest)
        return pb.UploadFileResponse(digest=digest, size_bytes=len(data))

    def create(self, request):
        names = self._check(request)
        fingerprint = request.task.SerializeToString() + repr(sorted(names.items())).encode()
        with self._changed:
            known = self.by_request_id.get(request.request_id)
            if request.request_id and known:
                if known[1] != fingerprint:
                    raise Refusal(grpc.StatusCode.ALREADY_EXISTS, "REQUEST_ID_REUSED",
                                  "that request_id asked for something else")
                return known[0]
            job = pb.PlanningJob(job_id=f"job-{len(self.jobs) + 1}", kind=request.task.kind,
                                 state=pb.PlanningJob.QUEUED, client="local", revision=1,
                                 request_id=request.request_id, priority=request.priority)
            job.created_at.seconds = 1_700_000_000
            self.jobs[job.job_id], self.tasks[job.job_id] = job, request
            self.by_request_id[request.request_id] = (job, fingerprint)
        if self.finish_jobs:
            self.update(job.job_id, state=pb.PlanningJob.SUCCEEDED, message="done")
        return job

    def _check(self, request):
        names = {}
        for i, file in enumerate(request.files):
            if file.digest not in self.files:
                raise Refusal(grpc.StatusCode.NOT_FOUND, "FILE_UNKNOWN",
                              f"files[{i}]: no file of digest {file.digest} was uploaded",
                              {"digest": file.digest})
            parts = file.name.split("/")
            if any(p in ("", ".", "..") for p in parts) or file.name in OWN_NAMES:
                self._invalid(f"files[{i}].name", f"file name '{file.name}' is not allowed")
            names[file.name] = file.digest
        if request.task.kind not in ("plan", "evaluate", "inspect", "accept", "optics", "render", "verify",
                                     "diagnose"):
            self._invalid("kind", f"is '{request.task.kind}'")
        goal = request.task.plan_options
        if goal.HasField("goal") and not 0 < goal.goal <= 1:
            self._invalid("plan_options.goal", f"is {goal.goal}, must be in (0, 1]")
        wanted = list(file_references(request.task))
        if request.task.kind == "render":
            wanted = [r for r in wanted if not r.path.startswith("recordings.recordings[")]
        for reference in wanted:
            self._require(reference.value, reference.path, names)
            if reference.message.DESCRIPTOR.name == "MaterialAssignment":
                material = json_format.Parse(self.files[names[reference.value]],
                                             material_pb2.Material())
                folder = reference.value.rpartition("/")[0]
                for inner in file_references(material):
                    name = re.sub(r"[^/]+/\.\./", "", f"{folder}/{inner.value}".lstrip("/"))
                    self._require(name, reference.path, names)
        return names

    @staticmethod
    def _require(name, field, names):
        if name not in names:
            raise Refusal(grpc.StatusCode.NOT_FOUND, "FILE_UNKNOWN",
                          f"{field}: no file '{name}' came with the task",
                          {"field": field, "file": name})

    @staticmethod
    def _invalid(field, description):
        raise Refusal(grpc.StatusCode.INVALID_ARGUMENT, "INVALID_FIELD", f"{field}: {description}",
                      violations=[(field, description)])

    def cancel(self, job_id):
        if self._job(job_id).state not in FINISHED:
            self.update(job_id, state=pb.PlanningJob.CANCELLED)
        return self.jobs[job_id]

    def result(self, job_id, name):
        job = self._job(job_id)
        if job.state not in FINISHED:
            raise Refusal(grpc.StatusCode.FAILED_PRECONDITION, "JOB_NOT_FINISHED", "not finished")
        for result in job.results:
            if result.name == name:
                return result, self.results[name]
        raise Refusal(grpc.StatusCode.NOT_FOUND, "RESULT_UNKNOWN", f"no result {name}")

    def wait_for_change(self, job_id, revision, timeout_s):
        with self._changed:
            self._changed.wait_for(lambda: self._job(job_id).revision > revision, timeout_s)
            copy = pb.PlanningJob()
            copy.CopyFrom(self._job(job_id))
            return copy

    def _unary(self, method, context, answer):
        try:
            self._begin(method, context)
            result = answer()
            self._fault(method, after=True)
            return result
        except Refusal as refusal:
            abort(context, refusal)

    def UploadFile(self, messages, context):
        return self._unary("UploadFile", context, lambda: self.upload_file(messages))

    def CreatePlanningJob(self, request, context):
        return self._unary("CreatePlanningJob", context,
                           lambda: pb.CreatePlanningJobResponse(job=self.create(request)))

    def GetPlanningJob(self, request, context):
        return self._unary("GetPlanningJob", context,
                           lambda: pb.GetPlanningJobResponse(job=self._job(request.job_id)))

    def CancelPlanningJob(self, request, context):
        return self._unary("CancelPlanningJob", context,
                           lambda: pb.CancelPlanningJobResponse(job=self.cancel(request.job_id)))

    def ListPlanningJobs(self, request, context):
        def answer():
            jobs = [j for j in reversed(list(self.jobs.values()))
                    if (not request.states or j.state in request.states)
                    and (not request.kinds or j.kind in request.kinds)]
            start, size = int(request.page_token or 0), request.page_size or 2
            token = str(start + size) if start + size < len(jobs) else ""
            return pb.ListPlanningJobsResponse(jobs=jobs[start:start + size],
                                               next_page_token=token)
        return self._unary("ListPlanningJobs", context, answer)

    def WatchPlanningJob(self, request, context):
        try:
            self._begin("WatchPlanningJob", context)
            fault, after = self._chunk_fault("WatchPlanningJob")
            sent, revision = 0, -1
            while context.is_active():
                job = self.wait_for_change(request.job_id, revision, 0.05)
                if job.revision > revision:
                    revision, sent = job.revision, sent + 1
                    yield pb.WatchPlanningJobResponse(job=job)
                    if fault and sent == after:
                        raise fault
                    if job.state in FINISHED:
                        return
        except Refusal as refusal:
            abort(context, refusal)

    def StreamResult(self, request, context):
        try:
            self._begin("StreamResult", context)
            fault, after = self._chunk_fault("StreamResult")
            header, data = self.result(request.job_id, request.name)
            yield pb.StreamResultResponse(header=header)
            for sent, start in enumerate(range(request.offset, len(data), CHUNK_BYTES)):
                if fault and sent == after:
                    raise fault
                yield pb.StreamResultResponse(chunk=data[start:start + CHUNK_BYTES])
        except Refusal as refusal:
            abort(context, refusal)


def abort(context, refusal):
    context.set_trailing_metadata((("grpc-status-details-bin", refusal.details()),))
    context.abort(refusal.code, refusal.message)


def serve(fake, address, services=()):
    """Starts a server; returns it with its port. `services` add themselves to it."""
    server = grpc.server(futures.ThreadPoolExecutor(16))
    pb_grpc.add_PlanningServiceServicer_to_server(fake, server)
    for add in services:
        add(server)
    port = server.add_insecure_port(address)
    server.start()
    return server, port
