# SPDX-License-Identifier: Apache-2.0
"""A plan as plain values and numpy arrays."""
from __future__ import annotations

import html
from dataclasses import dataclass, field
from typing import Any, Callable, List, Optional

import numpy as np
from google.protobuf import json_format

from . import errors
from .ply import PointCloud, read_points
from .v1 import plan_pb2


@dataclass(frozen=True)
class Measurement:
    """The nine parameters of one linear scan."""

    camera_distance_m: float
    triangulation_angle_deg: float
    camera_azimuth_deg: float
    camera_polar_deg: float
    part_alpha_deg: float
    part_beta_deg: float
    part_gamma_deg: float
    offset_y_m: float
    offset_z_m: float


@dataclass(frozen=True)
class Scan:
    """One scan of a plan."""

    index: int
    measurement: Measurement
    camera_pose: np.ndarray[Any, Any]  # 4 x 4, x_cad = M x_sensor, stage at its start, metres
    laser_pose: np.ndarray[Any, Any]
    part_pose: np.ndarray[Any, Any]  # 4 x 4, x_world = M x_cad, stage at 0
    stage_start_m: float
    stage_end_m: float
    trigger_positions_m: np.ndarray[Any, Any]
    covered_targets: int  # measurable targets, by this scan alone
    new_targets: int  # of these, not covered by earlier scans
    cumulative_targets: int  # by this and all earlier scans
    measurement_points: int


@dataclass(frozen=True)
class Coverage:
    """Exact numbers of the whole plan."""

    targets: int
    measurable_targets: int
    covered_targets: int
    coverage: float  # covered over measurable, in [0, 1]
    goal: float
    fresh_coverage: Optional[float]  # of targets that the search has not seen


@dataclass(frozen=True)
class Plan:
    """plan.json; `message` has every field of it."""

    inspection_name: str
    strategy: str
    seed: int
    scans: List[Scan]
    coverage: Coverage
    stop_reason: str  # e.g. "GOAL_REACHED"
    message: Any
    _read: Callable[[str], bytes] = field(repr=False, compare=False)

    def point_cloud(self, scan: int) -> PointCloud:
        """What a scan (number from 1) will measure. NotFound: made without point clouds."""
        if not 1 <= scan <= len(self.scans):
            raise IndexError(f"scan {scan}: must be in [1, {len(self.scans)}]")
        name = f"points/scan_{scan:02d}.ply"
        return read_points(self._read(name), name)

    def points(self, scan: Optional[int] = None) -> np.ndarray[Any, Any]:
        """N x 3 metres in part coordinates, of one scan or of all."""
        return np.concatenate([c.points_m for c in self._clouds(scan)] or [np.empty((0, 3))])

    def normals(self, scan: Optional[int] = None) -> np.ndarray[Any, Any]:
        """Normals of points(), in the same order."""
        return np.concatenate([c.normals for c in self._clouds(scan)] or [np.empty((0, 3))])

    def _clouds(self, scan: Optional[int]) -> List[PointCloud]:
        numbers = range(1, len(self.scans) + 1) if scan is None else [scan]
        return [self.point_cloud(n) for n in numbers]

    def _repr_html_(self) -> str:
        rows = "".join(
            f"<tr><td>{s.index}</td><td>{s.measurement.camera_distance_m:.3f}</td>"
            f"<td>{s.measurement.triangulation_angle_deg:.1f}</td><td>{s.new_targets}</td>"
            f"<td>{s.cumulative_targets}</td></tr>" for s in self.scans)
        return (f"<b>{html.escape(self.inspection_name)}</b>: {len(self.scans)} scans cover "
                f"{100 * self.coverage.coverage:.1f} % of {self.coverage.measurable_targets} "
                "measurable targets"
                "<table><tr><th>scan</th><th>camera distance [m]</th>"
                "<th>triangulation angle [°]</th><th>new targets</th><th>targets so far</th></tr>"
                f"{rows}</table>")


def parse_plan(text: str, read: Callable[[str], bytes]) -> Plan:
    """Fields that are newer than this package are left out."""
    message = plan_pb2.Plan()
    try:
        json_format.Parse(text, message, ignore_unknown_fields=True)
    except json_format.ParseError as error:
        raise errors.IncompleteResult(f"plan.json: {error}") from None
    coverage = message.coverage
    reason = plan_pb2.Plan.StopReason.Name(message.stop_reason)
    return Plan(
        message.inspection_name, message.strategy, message.seed, [_scan(s) for s in message.scans],
        Coverage(coverage.targets, coverage.measurable_targets, coverage.covered_targets,
                 coverage.coverage, coverage.goal,
                 coverage.fresh_coverage if coverage.HasField("fresh_coverage") else None),
        reason.replace("STOP_REASON_", "", 1), message, read)


def _pose(pose: Any) -> np.ndarray[Any, Any]:
    if not pose.matrix:
        return np.full((4, 4), np.nan)
    if len(pose.matrix) != 16:
        raise errors.IncompleteResult(f"plan.json: a pose has {len(pose.matrix)} numbers, not 16")
    return np.array(pose.matrix).reshape(4, 4)


def _scan(s: Any) -> Scan:
    m = s.measurement
    return Scan(
        s.index,
        Measurement(m.camera_distance_m, m.triangulation_angle_deg, m.camera_azimuth_deg,
                    m.camera_polar_deg, m.part_alpha_deg, m.part_beta_deg, m.part_gamma_deg,
                    m.offset_y_m, m.offset_z_m),
        _pose(s.camera_pose), _pose(s.laser_pose), _pose(s.part_pose), s.stage_start_m,
        s.stage_end_m, np.array(s.trigger_positions_m), s.covered_targets, s.new_targets,
        s.cumulative_targets, s.measurement_points)
