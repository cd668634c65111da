# SPDX-License-Identifier: Apache-2.0
"""Asks a planning service for jobs."""
from __future__ import annotations

import difflib
import os
import pathlib
import uuid
from typing import Any, Dict, Iterator, Optional, Sequence, Tuple, Union

from . import errors
from .connection import Connection, Pem
from .job import Job
from .plan import Plan
from .ply import Mesh
from .task_files import (Files, PathLike, TaskFile, TaskFiles, make_task_file, read_inspection,
                         read_plan, read_recordings)
from .v1 import planning_service_pb2 as pb
from .v1 import planning_service_pb2_grpc as pb_grpc
from .v1 import planning_task_pb2 as task_pb

# A plan: that of a job, itself, or where it is.
PlanSource = Union[Job, Plan, PathLike, Dict[str, Any], Any]
# An inspection or recordings: a path, a dict in the form of the file, or the message.
Document = Union[PathLike, Dict[str, Any], Any]


class Client:
    """A planning service. Thread-safe.

    `address`: "unix:PATH" or "HOST:PORT". `root_certificates` (path or bytes of a PEM file; True:
    those that gRPC brings) turn on TLS; `certificate` and `key` show who this client is, `token`
    does the same. `timeout_s` is the deadline of one try of one call, apart from the time that
    bytes take; `retry_for_s` is how long calls are tried again while the service is away.
    """

    def __init__(self, address: str, token: Optional[str] = None,
                 root_certificates: Union[Pem, bool, None] = None,
                 certificate: Optional[Pem] = None, key: Optional[Pem] = None, *,
                 timeout_s: float = 30.0, retry_for_s: float = 60.0,
                 allow_plaintext: bool = False) -> None:
        self._connection = Connection(address, token, root_certificates, certificate, key,
                                      timeout_s, retry_for_s, allow_plaintext)
        self._stub = pb_grpc.PlanningServiceStub(self._connection.channel)

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_: Any) -> None:
        self.close()

    def close(self) -> None:
        self._connection.close()

    @property
    def channel(self) -> Any:
        """The gRPC channel, for stubs of `sightline.v1`."""
        return self._connection.channel

    # Jobs. `files` gives files by the names that the document uses, where they are not on disk
    # beside it; `folder` is where a dict or message would lie. `request_id`: the same id gives the
    # same job; default: a new one. TaskError: the task is wrong before it is sent.

    def plan(self, inspection: Document, *, part: Optional[Mesh] = None, files: Files = None,
             folder: PathLike = ".", seed: Optional[int] = None, request_id: Optional[str] = None,
             priority: int = 0, **options: Any) -> Job:
        """Few scans that measure the part. `part`: instead of the inspection's file. Options: those
        of v1.PlanJobOptions, e.g. goal, max_scans, no_pictures."""
        task, found = self._inspection_task("plan", inspection, part, files, folder)
        _set_options(task.plan_options, options)
        return self._start(task, found, seed, request_id, priority)

    def evaluate(self, inspection: Document, plan: PlanSource, *, part: Optional[Mesh] = None,
                 files: Files = None, folder: PathLike = ".", other_part: bool = False,
                 request_id: Optional[str] = None, priority: int = 0) -> Job:
        """What the scans of a plan measure. `other_part`: take a plan that states another part than
        the inspection's."""
        task, found = self._inspection_task("evaluate", inspection, part, files, folder)
        _set_plan(task, plan, folder, other_part)
        return self._start(task, found, None, request_id, priority)

    def inspect(self, inspection: Document, plan: PlanSource, measured: Sequence[PathLike], *,
                part: Optional[Mesh] = None, files: Files = None, folder: PathLike = ".",
                other_part: bool = False, seed: Optional[int] = None,
                request_id: Optional[str] = None, priority: int = 0, **options: Any) -> Job:
        """Whether a measured part conforms, feature by feature. `measured`: a file of points for
        each scan of the plan, named scan_NN.ply (PCD, CSV, PNG, TIFF) or in their order; a depth
        raster has its description beside it. `other_part`: as of evaluate. Options: those of
        v1.InspectJobOptions, e.g. measured_unit, no_next_scan; pose_file is a path."""
        task, found = self._inspection_task("inspect", inspection, part, files, folder)
        _set_plan(task, plan, folder, other_part)
        if isinstance(measured, (str, os.PathLike)):
            raise errors.TaskError("inspect: measured must be a list of files, one for each scan")
        for path in map(pathlib.Path, measured):
            name = found.give(f"measured/{path.name}", path)
            task.inspect_options.measured.add(file=name)
            if path.suffix.lower() in (".png", ".tif", ".tiff"):
                description = path.with_suffix(".json")
                found.give(f"measured/{description.name}", description)
        if options.get("pose_file"):
            pose = pathlib.Path(options["pose_file"])
            options["pose_file"] = found.give(f"measured/{pose.name}", pose)
        _set_options(task.inspect_options, options, also=("measured",))
        return self._start(task, found, seed, request_id, priority)

    def accept(self, inspection: Document, *, part: Optional[Mesh] = None, files: Files = None,
               folder: PathLike = ".", seed: Optional[int] = None, request_id: Optional[str] = None,
               priority: int = 0, **options: Any) -> Job:
        """Acceptance test of the rig by simulated artefacts. Options: no_images; the number of
        tests is acceptance.runs of the inspection."""
        task, found = self._inspection_task("accept", inspection, part, files, folder)
        _set_options(task.accept_options, options)
        return self._start(task, found, seed, request_id, priority)

    def optics(self, inspection: Document, plan: Optional[PlanSource] = None, *,
               part: Optional[Mesh] = None, files: Files = None, folder: PathLike = ".",
               other_part: bool = False, seed: Optional[int] = None,
               request_id: Optional[str] = None, priority: int = 0, **options: Any) -> Job:
        """F-number, exposure and focus. `other_part`: as of evaluate. Options: scan, frame,
        stage_position_m."""
        task, found = self._inspection_task("optics", inspection, part, files, folder)
        if plan is not None:
            _set_plan(task, plan, folder, other_part)
        _set_options(task.optics_options, options)
        return self._start(task, found, seed, request_id, priority)

    def render(self, inspection: Optional[Document] = None, plan: Optional[PlanSource] = None, *,
               recordings: Optional[Document] = None, part: Optional[Mesh] = None,
               files: Files = None, folder: PathLike = ".", other_part: bool = False,
               seed: Optional[int] = None, request_id: Optional[str] = None, priority: int = 0,
               **options: Any) -> Job:
        """Images of frames of an inspection, or of a flat plate's `recordings`. `other_part`: as of
        evaluate. Options: those of v1.RenderJobOptions; scan, frame, stage_position_m."""
        if (inspection is None) == (recordings is None):
            raise errors.TaskError("render: give inspection or recordings")
        if inspection is not None:
            task, found = self._inspection_task("render", inspection, part, files, folder)
        else:
            task, found = task_pb.PlanningTask(kind="render"), TaskFiles(files)
            # A shot list: its images are what is to be made.
            task.recordings.CopyFrom(read_recordings(recordings, folder)[0])
        if plan is not None:
            _set_plan(task, plan, folder, other_part)
        frames = {name: options.pop(name) for name in ("scan", "frame", "stage_position_m")
                  if name in options}
        if frames:
            _set_options(task.render_options.frames, frames)
        _set_options(task.render_options, options, also=("scan", "frame", "stage_position_m"))
        return self._start(task, found, seed, request_id, priority)

    def verify(self, recordings: Document, *, files: Files = None, folder: PathLike = ".",
               seed: Optional[int] = None, request_id: Optional[str] = None,
               priority: int = 0) -> Job:
        """Recordings of a plate next to their simulation. `recordings`: the set's folder, its
        recordings.json, a dict or the message."""
        task, found = self._recordings_task("verify", recordings, files, folder)
        return self._start(task, found, seed, request_id, priority)

    def diagnose(self, recordings: Document, *, inspection: Optional[Document] = None,
                 part: Union[Mesh, PathLike, None] = None, files: Files = None,
                 folder: PathLike = ".", seed: Optional[int] = None,
                 request_id: Optional[str] = None, priority: int = 0, **options: Any) -> Job:
        """Which physics recordings show that their description lacks. `part`: the mesh of
        recordings of a part. Options: those of v1.DiagnoseJobOptions."""
        task, found = self._recordings_task("diagnose", recordings, files, folder)
        if inspection is not None:
            message, base = read_inspection(inspection, folder)
            task.inspection.CopyFrom(message)
            found.add(task.inspection, base, "inspection")
        if isinstance(part, Mesh):
            options["part_file"] = found.give("part.ply", part.to_ply())
            options.setdefault("part_unit", "m")
        elif part is not None:
            options["part_file"] = found.give(f"part/{pathlib.Path(part).name}", part)
        _set_options(task.diagnose_options, options)
        return self._start(task, found, seed, request_id, priority)

    def job(self, job_id: str) -> Job:
        """A job by its id. NotFound: never was, was removed, or is another client's."""
        answer = self._connection.call(self._stub.GetPlanningJob,
                                       lambda: pb.GetPlanningJobRequest(job_id=job_id))
        return self._job(answer.job)

    def jobs(self, states: Sequence[str] = (), kinds: Sequence[str] = (), *,
             all_clients: bool = False) -> Iterator[Job]:
        """This client's jobs, newest first; of all clients for operators. Names of states:
        "QUEUED", ..."""
        request = pb.ListPlanningJobsRequest(
            states=[pb.PlanningJob.State.Value(s) for s in states], kinds=kinds,
            all_clients=all_clients)
        while True:
            answer = self._connection.call(self._stub.ListPlanningJobs, lambda: request)
            for job in answer.jobs:
                yield self._job(job)
            if not answer.next_page_token:
                return
            request.page_token = answer.next_page_token

    def upload(self, content: Union[PathLike, bytes]) -> str:
        """Uploads a file; returns its SHA-256."""
        file = make_task_file("upload", content)
        self._upload(file)
        return file.digest

    def _job(self, message: pb.PlanningJob) -> Job:
        return Job(self._connection, self._stub, message)

    def _inspection_task(self, kind: str, inspection: Document, part: Optional[Mesh],
                         files: Files, folder: PathLike) -> Tuple[Any, TaskFiles]:
        message, base = read_inspection(inspection, folder)
        task = task_pb.PlanningTask(kind=kind, inspection=message)
        found = TaskFiles(files)
        if part is not None:
            task.inspection.part.file = found.give("part.ply", part.to_ply())
            task.inspection.part.unit = "m"
        found.add(task.inspection, base, "inspection")
        return task, found

    def _recordings_task(self, kind: str, recordings: Document, files: Files,
                         folder: PathLike) -> Tuple[Any, TaskFiles]:
        message, base = read_recordings(recordings, folder)
        task = task_pb.PlanningTask(kind=kind, recordings=message)
        found = TaskFiles(files)
        found.add(task.recordings, base, "recordings")
        return task, found

    def _start(self, task: Any, found: TaskFiles, seed: Optional[int], request_id: Optional[str],
               priority: int) -> Job:
        if seed is not None:
            task.seed = seed
        files = found.finish()
        # Never without an id: a call whose answer got lost must not make a second job.
        request = pb.CreatePlanningJobRequest(
            request_id=request_id or uuid.uuid4().hex, task=task, priority=priority,
            files=[pb.JobFile(name=f.name, digest=f.digest, size_bytes=f.size_bytes)
                   for f in files])
        missing = {f.digest: f for f in files}
        while True:
            try:
                answer = self._connection.call(self._stub.CreatePlanningJob, lambda: request)
                return self._job(answer.job)
            except errors.NotFound as error:
                unknown = missing.pop(error.metadata.get("digest", ""), None)
                if error.reason != "FILE_UNKNOWN" or unknown is None:
                    raise
                self._upload(unknown)

    def _upload(self, file: TaskFile) -> None:
        def messages() -> Iterator[pb.UploadFileRequest]:
            yield pb.UploadFileRequest(header=pb.UploadFileRequest.Header(
                size_bytes=file.size_bytes, digest=file.digest))
            for chunk in file.chunks():
                yield pb.UploadFileRequest(chunk=chunk)

        # 1 MB/s at the least.
        self._connection.call(self._stub.UploadFile, messages,
                              self._connection.timeout_s + file.size_bytes / 1e6)


def _set_plan(task: Any, plan: PlanSource, folder: PathLike, other_part: bool) -> None:
    task.other_part = other_part
    if isinstance(plan, Job):
        task.plan_job_id = plan.job_id
    elif isinstance(plan, Plan):
        task.plan.CopyFrom(plan.message)
    else:
        task.plan.CopyFrom(read_plan(plan, folder))


def _set_options(message: Any, options: Dict[str, Any], also: Sequence[str] = ()) -> None:
    """TaskError names an option that there is not, and one that has the wrong type."""
    names = [f.name for f in message.DESCRIPTOR.fields if f.message_type is None]
    for name, value in options.items():
        if name not in names:
            near = difflib.get_close_matches(name, [*names, *also], 1)
            hint = f", did you mean '{near[0]}'?" if near else ""
            raise errors.TaskError(f"no option '{name}'{hint}")
        try:
            if isinstance(value, (list, tuple)):
                getattr(message, name).extend(value)
            else:
                setattr(message, name, value)
        except (TypeError, ValueError, AttributeError) as error:
            raise errors.TaskError(f"option '{name}': {error}") from None
    if options:
        message.SetInParent()
