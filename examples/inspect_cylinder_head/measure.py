# SPDX-License-Identifier: Apache-2.0
"""measure.py PLAN_FOLDER OUT [--defect none|dent|hole] [--noise-px X] [--seed N]

Plays the scanner: what the scans of a plan measure of a part with a concealed defect. It takes the exact
points that `sightline plan` wrote to PLAN_FOLDER/points, moves those of the defect, turns and shifts the
part in its holder, and adds noise of line detection.

  dent   0.3 mm deep, 6 mm wide (standard deviation), in the combustion face
  hole   the first combustion chamber is 0.1 mm off along x
"""

import argparse
import json
import math
import os
import random
import struct

FOCAL_LENGTH_PX = 512 / math.tan(math.radians(22.5))  # 1024 rows over the default of 45 degrees
DENT_M, DENT_WIDTH_M, DENT_PLACE_M = 3e-4, 6e-3, (0.225, 0.05)
HOLE_OFF_M, HOLE_CENTRE_M, HOLE_REACH_M = 1e-4, (0.075, 0.140), 0.044
SHIFT_M, TURN_RAD = (8e-4, -5e-4, 3e-4), 2e-3  # of the part, the turn about z


def read_points(path):
    """Rows x, y, z, nx, ny, nz of a binary PLY file of floats."""
    with open(path, "rb") as stream:
        data = stream.read()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    count = next(int(line.split()[2]) for line in data[:end].decode("ascii").splitlines()
                 if line.startswith("element vertex"))
    return data[:end], [struct.unpack_from("<6f", data, end + 24 * i) for i in range(count)]


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def defect_of(kind, p, n):
    """How far the true surface lies beyond the model along its normal [m]."""
    if kind == "dent" and n[2] < -0.9 and p[2] < 1e-4:
        r = math.hypot(p[0] - DENT_PLACE_M[0], p[1] - DENT_PLACE_M[1]) / DENT_WIDTH_M
        return -DENT_M * math.exp(-0.5 * r * r)
    if kind == "hole" and p[2] < 0.02 and math.hypot(p[0] - HOLE_CENTRE_M[0],
                                                     p[1] - HOLE_CENTRE_M[1]) < HOLE_REACH_M:
        return HOLE_OFF_M * n[0] if p[2] > 2e-4 else 0.0
    return 0.0


class Sensors:
    """Camera and laser of a scan as seen from the part, at the moment a point is lit."""

    def __init__(self, scan):
        camera, laser, part = (scan[key]["matrix"] for key in ("camera_pose", "laser_pose", "part_pose"))
        self.camera = [camera[3], camera[7], camera[11]]
        self.laser = [laser[3], laser[7], laser[11]]
        self.line = [laser[0], laser[4], laser[8]]     # along the laser's line
        self.normal = [laser[1], laser[5], laser[9]]   # of its plane
        self.stage = [part[0], part[1], part[2]]       # direction of the stage, from world to part

    def noisy(self, p, noise_px, rng):
        apart = [p[k] - self.laser[k] for k in range(3)]
        s = -dot(self.normal, apart) / dot(self.normal, self.stage)
        view = [p[k] - (self.camera[k] - s * self.stage[k]) for k in range(3)]
        distance = math.sqrt(dot(view, view))
        view = [v / distance for v in view]
        per_px = distance / FOCAL_LENGTH_PX
        depth = rng.gauss(0, noise_px) * per_px / abs(dot(view, self.normal))
        along = rng.gauss(0, noise_px) * per_px
        # Both stay in the plane of the laser: the line of sight is followed within it.
        in_plane = [view[k] - dot(view, self.normal) * self.normal[k] for k in range(3)]
        return [p[k] + depth * in_plane[k] + along * self.line[k] for k in range(3)]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("plan")
    parser.add_argument("out")
    parser.add_argument("--defect", choices=("none", "dent", "hole"), default="none")
    parser.add_argument("--noise-px", type=float, default=0.05)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    with open(os.path.join(options.plan, "plan.json"), encoding="utf-8") as stream:
        plan = json.load(stream)
    os.makedirs(options.out, exist_ok=True)
    cosine, sine = math.cos(TURN_RAD), math.sin(TURN_RAD)
    for number, scan in enumerate(plan["scans"], 1):
        name = f"scan_{number:02d}.ply"
        header, points = read_points(os.path.join(options.plan, "points", name))
        sensors = Sensors(scan)
        rng = random.Random(1000 * options.seed + number)
        body = bytearray()
        for x, y, z, *n in points:
            moved = defect_of(options.defect, (x, y, z), n)
            p = sensors.noisy([x + moved * n[0], y + moved * n[1], z + moved * n[2]], options.noise_px, rng)
            body += struct.pack("<6f", cosine * p[0] - sine * p[1] + SHIFT_M[0],
                                sine * p[0] + cosine * p[1] + SHIFT_M[1], p[2] + SHIFT_M[2],
                                cosine * n[0] - sine * n[1], sine * n[0] + cosine * n[1], n[2])
        with open(os.path.join(options.out, name), "wb") as stream:
            stream.write(header + body)
        print(f"{options.out}/{name}: {len(points)} points")


if __name__ == "__main__":
    main()
