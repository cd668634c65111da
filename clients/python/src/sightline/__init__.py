# SPDX-License-Identifier: Apache-2.0
"""Client of Sightline's planning service: `Client(address).plan("inspection.json").wait()`."""
from .client import Client
from .errors import (AlreadyExists, DeadlineExceeded, FailedPrecondition, FieldViolation,
                     IncompleteResult, InvalidArgument, JobCancelled, JobFailed, NotFound,
                     PermissionDenied, ResourceExhausted, ServiceError, SightlineError, TaskError,
                     Unauthenticated, Unavailable, WaitTimeout)
from .images import Image
from .job import Failure, Job, JobStatus, ResultFile
from .plan import Coverage, Measurement, Plan, Scan
from .ply import Mesh, PointCloud

__all__ = [
    "AlreadyExists", "Client", "Coverage", "DeadlineExceeded", "FailedPrecondition", "Failure",
    "FieldViolation", "Image", "IncompleteResult", "InvalidArgument", "Job", "JobCancelled",
    "JobFailed", "JobStatus", "Measurement", "Mesh", "NotFound", "PermissionDenied", "Plan",
    "PointCloud", "ResourceExhausted", "ResultFile", "Scan", "ServiceError", "SightlineError",
    "TaskError", "Unauthenticated", "Unavailable", "WaitTimeout",
]
