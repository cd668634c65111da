#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Writes flange.obj and flange.stl beside itself: a flange with a hub, as CAD systems export meshes.

The OBJ has groups, polygons of four corners with normals, comments and CRLF; the STL is binary with a header that
begins like a text file and colours in the attribute bytes. Millimetres. Both have 12 * 48 triangles of the same
positions.
"""
import math
import pathlib
import struct

SEGMENTS = 48
# Radius and height; the metal is on the left of the way round.
PROFILE_MM = [(10, 0), (30, 0), (30, 8), (18, 8), (18, 20), (10, 20)]
NAMES = ["base", "rim", "shoulder", "hub", "top", "bore"]


def position(corner, segment):
    radius, height = PROFILE_MM[corner % len(PROFILE_MM)]
    angle = 2 * math.pi * (segment % SEGMENTS) / SEGMENTS
    return radius * math.cos(angle), radius * math.sin(angle), height


def quads():
    """Surface by surface; corners (place in the profile, segment), counterclockwise from outside."""
    for k, name in enumerate(NAMES):
        for s in range(SEGMENTS):
            yield name, [(k, s), (k, s + 1), (k + 1, s + 1), (k + 1, s)]


def normal(quad):
    a, b, c = (position(*corner) for corner in quad[:3])
    u, v = [y - x for x, y in zip(a, b)], [y - x for x, y in zip(b, c)]
    n = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    length = math.hypot(*n)
    return [x / length for x in n]


def obj():
    lines = ["# flange, mm", "mtllib flange.mtl"]
    lines += ["v %.6f %.6f %.6f" % position(k, s) for k in range(len(PROFILE_MM)) for s in range(SEGMENTS)]
    faces, group, normals = [], None, 0
    for name, quad in quads():
        lines.append("vn %.6f %.6f %.6f" % tuple(normal(quad)))
        normals += 1
        if name != group:
            faces += [f"g {name}", "usemtl steel", "s off"]
            group = name
        corners = [k % len(PROFILE_MM) * SEGMENTS + s % SEGMENTS + 1 for k, s in quad]
        faces.append("f " + " ".join(f"{corner}//{normals}" for corner in corners))
    return "\r\n".join(lines + faces) + "\r\n"


def stl():
    triangles = []
    for _, quad in quads():
        for triangle in (quad[:3], [quad[0], *quad[2:]]):
            numbers = [*normal(quad), *(x for corner in triangle for x in position(*corner))]
            triangles.append(struct.pack("<12fH", *numbers, 0x7FFF))
    header = b"solid flange COLOR=\xb4\xb4\xb4\xff".ljust(80)
    return header + struct.pack("<I", len(triangles)) + b"".join(triangles)


def main():
    folder = pathlib.Path(__file__).parent
    (folder / "flange.obj").write_text(obj(), newline="")
    (folder / "flange.stl").write_bytes(stl())


if __name__ == "__main__":
    main()
