# SPDX-License-Identifier: Apache-2.0
"""Points and meshes as PLY, to and from numpy arrays."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Dict, List, Tuple

import numpy as np

from . import errors

_TYPES = {"char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1", "short": "<i2", "int16": "<i2",
          "ushort": "<u2", "uint16": "<u2", "int": "<i4", "int32": "<i4", "uint": "<u4",
          "uint32": "<u4", "float": "<f4", "float32": "<f4", "double": "<f8", "float64": "<f8"}
_MAX_HEADER_BYTES = 1 << 16


@dataclass(frozen=True)
class PointCloud:
    """Measurement points of one scan."""

    points_m: np.ndarray[Any, Any]  # N x 3, part coordinates
    normals: np.ndarray[Any, Any]  # N x 3, unit length, out of the part


@dataclass(frozen=True)
class Mesh:
    """A part as arrays: vertices N x 3 in metres, triangles M x 3 of indices, counter-clockwise
    seen from outside."""

    vertices_m: Any
    triangles: Any

    def to_ply(self) -> bytes:
        """Binary PLY in metres, single precision. TaskError if an index or a number is wrong."""
        vertices = np.asarray(self.vertices_m, dtype="<f4")
        triangles = np.asarray(self.triangles)
        if vertices.ndim != 2 or vertices.shape[1] != 3 or len(vertices) == 0:
            raise errors.TaskError(f"vertices_m: shape is {vertices.shape}, must be (N, 3), N > 0")
        if triangles.ndim != 2 or triangles.shape[1] != 3 or len(triangles) == 0:
            raise errors.TaskError(f"triangles: shape is {triangles.shape}, must be (M, 3), M > 0")
        if triangles.dtype.kind not in "iu":
            raise errors.TaskError(f"triangles: are {triangles.dtype}, must be integers")
        if not np.isfinite(vertices).all():
            raise errors.TaskError("vertices_m: some are not finite")
        if triangles.min() < 0 or triangles.max() >= len(vertices):
            raise errors.TaskError(f"triangles: indices must be in [0, {len(vertices) - 1}]")
        header = ("ply\nformat binary_little_endian 1.0\ncomment unit: metre\n"
                  f"element vertex {len(vertices)}\n"
                  "property float x\nproperty float y\nproperty float z\n"
                  f"element face {len(triangles)}\n"
                  "property list uchar int vertex_indices\nend_header\n")
        faces = np.empty(len(triangles), dtype=[("count", "u1"), ("index", "<i4", 3)])
        faces["count"] = 3
        faces["index"] = triangles
        return header.encode("ascii") + np.ascontiguousarray(vertices).tobytes() + faces.tobytes()


def read_points(data: bytes, name: str = "PLY") -> PointCloud:
    """Points and normals of a binary little-endian PLY whose first element is `vertex`.

    IncompleteResult if the bytes are something else.
    """
    count, fields, start = _vertex_header(data, name)
    layout = np.dtype(fields)
    if count * layout.itemsize > len(data) - start:
        raise errors.IncompleteResult(f"{name}: has {len(data)} bytes, too few for {count} points")
    table = np.frombuffer(data, layout, count, start)
    names = layout.names or ()
    missing = [axis for axis in ("x", "y", "z", "nx", "ny", "nz") if axis not in names]
    if missing:
        raise errors.IncompleteResult(f"{name}: has no property {', '.join(missing)}")
    return PointCloud(np.stack([table[a] for a in "xyz"], axis=1).astype(np.float64),
                      np.stack([table["n" + a] for a in "xyz"], axis=1).astype(np.float64))


def _vertex_header(data: bytes, name: str) -> Tuple[int, List[Tuple[str, str]], int]:
    end = data.find(b"end_header\n", 0, _MAX_HEADER_BYTES)
    lines = data[:max(end, 0)].decode("ascii", "replace").split("\n")
    if end < 0 or lines[0] != "ply" or "format binary_little_endian 1.0" not in lines:
        raise errors.IncompleteResult(f"{name}: is no binary little-endian PLY")
    elements: Dict[str, int] = {}
    fields: List[Tuple[str, str]] = []
    for line in lines:
        words = line.split()
        if words[:1] == ["element"] and len(words) == 3 and words[2].isdigit():
            elements[words[1]] = int(words[2])
        elif words[:1] == ["property"] and list(elements) == ["vertex"]:
            if len(words) != 3 or words[1] not in _TYPES:
                raise errors.IncompleteResult(f"{name}: cannot read '{line}'")
            fields.append((words[2], _TYPES[words[1]]))
    if not elements or next(iter(elements)) != "vertex":
        raise errors.IncompleteResult(f"{name}: has no points")
    return elements["vertex"], fields, end + len(b"end_header\n")
