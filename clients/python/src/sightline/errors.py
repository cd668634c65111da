# SPDX-License-Identifier: Apache-2.0
"""What can go wrong, as exceptions with code, reason and fields."""
from __future__ import annotations

import pathlib
from dataclasses import dataclass, field
from typing import Any, Dict, List, Optional, Type

import grpc
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory


@dataclass(frozen=True)
class FieldViolation:
    """A field of the request that is wrong."""

    field: str  # path, e.g. "inspection.goal.coverage"
    description: str  # value and allowed range


class SightlineError(Exception):
    """Base of everything that this package raises on purpose."""


class TaskError(SightlineError, ValueError):
    """The task is wrong before it was sent: a file is missing, or a field is unknown."""


class IncompleteResult(SightlineError):
    """The bytes of a result are not those that the service promised."""


@dataclass
class ServiceError(SightlineError):
    """An error that the service answered, or that a call ended with."""

    code: str  # name of the gRPC code, e.g. "INVALID_ARGUMENT"
    reason: str  # for programs, e.g. "QUOTA_EXCEEDED"; may be empty
    message: str
    violations: List[FieldViolation] = field(default_factory=list)
    metadata: Dict[str, str] = field(default_factory=dict)
    retry_delay_s: Optional[float] = None

    def __post_init__(self) -> None:
        super().__init__(self.code, self.reason, self.message)

    def __str__(self) -> str:
        name = f"{self.code} ({self.reason})" if self.reason else self.code
        lines = [f"{name}: {self.message}"]
        lines += [f"  {v.field}: {v.description}" for v in self.violations]
        return "\n".join(lines)


class InvalidArgument(ServiceError):
    """A field of the request is wrong; `violations` names it."""


class NotFound(ServiceError):
    """No such job, result or recipe."""


class AlreadyExists(ServiceError):
    """The request_id was used for another task."""


class PermissionDenied(ServiceError):
    """The client may not ask for this."""


class Unauthenticated(ServiceError):
    """The service does not know the token or certificate."""


class ResourceExhausted(ServiceError):
    """A quota, the disk, or a limit on sizes."""


class FailedPrecondition(ServiceError):
    """Not now, e.g. the job is not finished."""


class Unavailable(ServiceError):
    """The service could not be reached for as long as calls are tried again."""


class DeadlineExceeded(ServiceError, TimeoutError):
    """The call took longer than its deadline."""


class JobFailed(ServiceError):
    """The job failed; `job` has its state."""

    job: Any = None


class JobCancelled(SightlineError):
    """The job was cancelled; `job` has its state."""

    def __init__(self, job: Any) -> None:
        super().__init__(f"job {job.job_id} was cancelled")
        self.job = job


class WaitTimeout(SightlineError, TimeoutError):
    """The job was not finished in the time given; it goes on."""


_BY_CODE: Dict[str, Type[ServiceError]] = {
    "INVALID_ARGUMENT": InvalidArgument,
    "NOT_FOUND": NotFound,
    "ALREADY_EXISTS": AlreadyExists,
    "PERMISSION_DENIED": PermissionDenied,
    "UNAUTHENTICATED": Unauthenticated,
    "RESOURCE_EXHAUSTED": ResourceExhausted,
    "FAILED_PRECONDITION": FailedPrecondition,
    "UNAVAILABLE": Unavailable,
    "DEADLINE_EXCEEDED": DeadlineExceeded,
}


def _detail_classes() -> Dict[str, Any]:
    """Messages of google.rpc, in a pool of their own: the same names may be registered elsewhere."""
    files = descriptor_pb2.FileDescriptorSet()
    files.ParseFromString((pathlib.Path(__file__).parent / "google_rpc.desc").read_bytes())
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    classes = {}
    for name in ("Status", "ErrorInfo", "BadRequest", "RetryInfo"):
        descriptor = pool.FindMessageTypeByName(f"google.rpc.{name}")
        if hasattr(message_factory, "GetMessageClass"):
            classes[name] = message_factory.GetMessageClass(descriptor)
        else:
            classes[name] = message_factory.MessageFactory(pool).GetPrototype(descriptor)
    return classes


_DETAILS = _detail_classes()


def from_rpc_error(error: grpc.RpcError) -> ServiceError:
    """The exception for a failed call; details that cannot be read are left out."""
    code = error.code().name
    result = _BY_CODE.get(code, ServiceError)(code, "", error.details() or "")
    for key, value in error.trailing_metadata() or ():
        if key != "grpc-status-details-bin":
            continue
        status = _DETAILS["Status"]()
        try:
            status.ParseFromString(value)
            for detail in status.details:
                _add_detail(detail, result)
        except Exception:  # The decoder's own error: its class depends on the implementation.
            break
    return result


def _add_detail(detail: Any, result: ServiceError) -> None:
    name = detail.type_url.rpartition("google.rpc.")[2]
    if name not in ("ErrorInfo", "BadRequest", "RetryInfo"):
        return
    message = _DETAILS[name]()
    message.ParseFromString(detail.value)
    if name == "ErrorInfo":
        result.reason = message.reason
        result.metadata = dict(message.metadata)
    elif name == "BadRequest":
        result.violations = [FieldViolation(v.field, v.description)
                             for v in message.field_violations]
    else:
        result.retry_delay_s = message.retry_delay.seconds + message.retry_delay.nanos * 1e-9
