# SPDX-License-Identifier: Apache-2.0
"""A job of the service: its state, its end, its results."""
from __future__ import annotations

import datetime
import hashlib
import html
import json
import os
import pathlib
import tempfile
import time
from dataclasses import dataclass
from typing import Any, BinaryIO, Callable, Dict, Iterator, List, Optional

import grpc

from . import errors
from .connection import Backoff, Connection
from .images import Image, decode_image
from .plan import Plan, parse_plan
from .task_files import PathLike
from .v1 import planning_service_pb2 as pb

# A watch is asked anew this often, so that a connection that died in silence is noticed.
_WATCH_S = 60.0
_IMAGE_SUFFIXES = (".png", ".tif", ".tiff")
FINISHED_STATES = ("SUCCEEDED", "FAILED", "CANCELLED")


@dataclass(frozen=True)
class ResultFile:
    """A result's name, e.g. "plan.json" or "points/scan_01.ply", and what its bytes are."""

    name: str
    digest: str  # SHA-256, lower-case hex
    size_bytes: int


@dataclass(frozen=True)
class Failure:
    """Why a job failed."""

    code: str
    reason: str
    message: str


@dataclass(frozen=True)
class JobStatus:
    """A job at one moment."""

    job_id: str
    kind: str
    state: str  # "QUEUED", "RUNNING", "SUCCEEDED", "FAILED" or "CANCELLED"
    progress: float  # in [0, 1]
    message: str
    client: str
    request_id: str
    priority: int
    attempts: int
    failure: Optional[Failure]
    results: List[ResultFile]
    created_at: Optional[datetime.datetime]
    started_at: Optional[datetime.datetime]
    finished_at: Optional[datetime.datetime]
    revision: int

    @property
    def finished(self) -> bool:
        return self.state in FINISHED_STATES

    def _repr_html_(self) -> str:
        text = html.escape(self.failure.message if self.failure else self.message)
        return (f"<div><b>{html.escape(self.kind)}</b> <code>{html.escape(self.job_id)}</code> "
                f"{html.escape(self.state)} <progress max='1' value='{self.progress:.4f}'>"
                f"</progress> {100 * self.progress:.0f} % {text}</div>")


def _time(message: Any, name: str) -> Optional[datetime.datetime]:
    if not message.HasField(name):
        return None
    stamp = getattr(message, name)
    epoch = datetime.datetime(1970, 1, 1, tzinfo=datetime.timezone.utc)
    return epoch + datetime.timedelta(seconds=stamp.seconds, microseconds=stamp.nanos // 1000)


def _status(job: pb.PlanningJob) -> JobStatus:
    known = job.state in pb.PlanningJob.State.values()
    return JobStatus(
        job.job_id, job.kind,
        pb.PlanningJob.State.Name(job.state) if known else str(job.state), job.progress,
        job.message, job.client, job.request_id, job.priority, job.attempts,
        Failure(job.failure.code, job.failure.reason, job.failure.message)
        if job.HasField("failure") else None,
        [ResultFile(r.name, r.digest, r.size_bytes) for r in job.results],
        _time(job, "created_at"), _time(job, "started_at"), _time(job, "finished_at"),
        job.revision)


class Job:
    """A job and the connection to ask about it. `status` is what was heard last."""

    def __init__(self, connection: Connection, stub: Any, job: pb.PlanningJob) -> None:
        self._connection = connection
        self._stub = stub
        self._read_results: Dict[str, bytes] = {}
        self.status = _status(job)

    @property
    def job_id(self) -> str:
        return self.status.job_id

    @property
    def kind(self) -> str:
        return self.status.kind

    @property
    def state(self) -> str:
        return self.status.state

    @property
    def progress(self) -> float:
        return self.status.progress

    @property
    def results(self) -> List[ResultFile]:
        """Empty until the job succeeded."""
        return self.status.results

    def __repr__(self) -> str:
        return f"<sightline.Job {self.job_id} {self.kind} {self.state} {self.progress:.0%}>"

    def _repr_html_(self) -> str:
        return self.status._repr_html_()

    def refresh(self) -> JobStatus:
        """Asks how it is now."""
        answer = self._connection.call(self._stub.GetPlanningJob,
                                       lambda: pb.GetPlanningJobRequest(job_id=self.job_id))
        self.status = _status(answer.job)
        return self.status

    def cancel(self) -> JobStatus:
        """Asks it to stop; a finished job stays as it is."""
        answer = self._connection.call(self._stub.CancelPlanningJob,
                                       lambda: pb.CancelPlanningJobRequest(job_id=self.job_id))
        self.status = _status(answer.job)
        return self.status

    def watch(self, timeout_s: Optional[float] = None) -> Iterator[JobStatus]:
        """Its state now and after every change until it is finished.

        Goes on after the service restarted. WaitTimeout after `timeout_s`; the job goes on then.
        """
        end = None if timeout_s is None else time.monotonic() + timeout_s
        backoff = Backoff(self._connection.retry_for_s)
        revision = -1
        while True:
            left_s = _WATCH_S if end is None else min(_WATCH_S, end - time.monotonic())
            if left_s <= 0:
                raise errors.WaitTimeout(f"job {self.job_id} is {self.state} after {timeout_s} s")
            try:
                stream = self._connection.stream(
                    self._stub.WatchPlanningJob, pb.WatchPlanningJobRequest(job_id=self.job_id),
                    left_s)
                try:
                    for answer in stream:
                        backoff.reset()
                        status = _status(answer.job)
                        if status.revision <= revision and not status.finished:
                            continue  # Known from before the watch was asked anew.
                        revision = status.revision
                        self.status = status
                        yield status
                        if status.finished:
                            return
                finally:
                    stream.cancel()
                error: errors.ServiceError = errors.Unavailable(
                    "UNAVAILABLE", "", "the watch ended before the job")
            except grpc.RpcError as rpc_error:
                error = errors.from_rpc_error(rpc_error)
            if isinstance(error, errors.DeadlineExceeded):
                continue
            if not self._connection.waits_after(error, backoff):
                raise error

    def wait(self, on_progress: Optional[Callable[[JobStatus], None]] = None,
             timeout_s: Optional[float] = None) -> "Job":
        """Waits until it succeeded. JobFailed, JobCancelled, or WaitTimeout otherwise.

        `on_progress` gets every change.
        """
        for status in self.watch(timeout_s):
            if on_progress:
                on_progress(status)
        if self.state == "CANCELLED":
            raise errors.JobCancelled(self)
        if self.state == "FAILED":
            failure = self.status.failure or Failure("UNKNOWN", "", "no reason given")
            failed = errors.JobFailed(failure.code, failure.reason, failure.message)
            failed.job = self
            raise failed
        return self

    def _result(self, name: str) -> ResultFile:
        if not self.status.finished:
            self.refresh()
        for result in self.results:
            if result.name == name:
                return result
        if not self.status.finished:
            raise errors.FailedPrecondition("FAILED_PRECONDITION", "JOB_NOT_FINISHED",
                                            f"job {self.job_id} is {self.state}")
        raise errors.NotFound("NOT_FOUND", "RESULT_UNKNOWN",
                              f"job {self.job_id} has no result '{name}'")

    def _stream_into(self, result: ResultFile, out: BinaryIO) -> None:
        """Goes on where a stream broke. IncompleteResult: other bytes than were promised."""
        digest = hashlib.sha256()
        offset = 0
        backoff = Backoff(self._connection.retry_for_s)
        while True:
            try:
                request = pb.StreamResultRequest(job_id=self.job_id, name=result.name,
                                                 offset=offset)
                # 1 MB/s at the least.
                timeout_s = self._connection.timeout_s + (result.size_bytes - offset) / 1e6
                stream = self._connection.stream(self._stub.StreamResult, request, timeout_s)
                for answer in stream:
                    if answer.WhichOneof("content") == "chunk":
                        out.write(answer.chunk)
                        digest.update(answer.chunk)
                        offset += len(answer.chunk)
                        backoff.reset()
                    if offset > result.size_bytes:
                        stream.cancel()
                        break
                break
            except grpc.RpcError as rpc_error:
                error = errors.from_rpc_error(rpc_error)
                if not self._connection.waits_after(error, backoff):
                    raise error from None
        if offset != result.size_bytes or digest.hexdigest() != result.digest:
            raise errors.IncompleteResult(
                f"{result.name}: got {offset} bytes with digest {digest.hexdigest()[:12]}, not "
                f"{result.size_bytes} with {result.digest[:12]}")

    def read(self, name: str) -> bytes:
        """The bytes of a result, checked against its digest; kept for the next time."""
        if name not in self._read_results:
            result = self._result(name)
            with tempfile.SpooledTemporaryFile() as buffer:
                self._stream_into(result, buffer)  # type: ignore[arg-type]
                buffer.seek(0)
                self._read_results[name] = buffer.read()
        return self._read_results[name]

    def read_json(self, name: str) -> Any:
        """A result that is JSON, e.g. "optics.json"."""
        return json.loads(self.read(name))

    def download(self, folder: PathLike) -> List[pathlib.Path]:
        """Saves all results below `folder`; a file is complete or not there.

        A file that is there already with the same bytes stays.
        """
        root = pathlib.Path(folder)
        if not self.status.finished:
            self.refresh()
        if not self.status.finished:
            self._result("")  # Says that the job is not finished.
        paths = []
        for result in self.results:
            parts = pathlib.PurePosixPath(result.name).parts
            if not parts or ".." in parts or parts[0] == "/" or "\\" in result.name:
                raise errors.IncompleteResult(f"'{result.name}' is no path below a folder")
            path = root.joinpath(*parts)
            if not _has_digest(path, result):
                self._save(result, path)
            paths.append(path)
        return paths

    def _save(self, result: ResultFile, path: pathlib.Path) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        part = path.with_name(path.name + ".part")
        try:
            with open(part, "wb") as out:
                self._stream_into(result, out)
            os.replace(part, path)
        finally:
            part.unlink(missing_ok=True)

    def plan(self) -> Plan:
        """Of plan and evaluate: plan.json, with the points of its scans."""
        return parse_plan(self.read("plan.json").decode("utf-8"), self.read)

    @property
    def image_names(self) -> List[str]:
        """Of render: names of the images, for image()."""
        return [r.name for r in self.results if r.name.lower().endswith(_IMAGE_SUFFIXES)]

    def image(self, name: str) -> Image:
        """An image as a numpy array of uint16."""
        return decode_image(self.read(name), name)


def _has_digest(path: pathlib.Path, result: ResultFile) -> bool:
    if not path.is_file() or path.stat().st_size != result.size_bytes:
        return False
    digest = hashlib.sha256()
    with open(path, "rb") as file:
        while block := file.read(1 << 20):
            digest.update(block)
    return digest.hexdigest() == result.digest
