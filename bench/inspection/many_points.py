#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Time and memory of `sightline inspect` for many measured points.

    bench/inspection/many_points.py [--points N ...] [--json FILE]

The exact points of a plan of examples/inspect_cylinder_head are repeated until there are N, each moved by up to
0.1 mm along the surface and by Gaussian noise of 20 um along its normal. One binary PLY holds them. The first N is the
reference: time in proportion to the points would give the ratio of the numbers. Targets: 5 million points in 60 s and
2 GB. Memory is the largest resident set of one process.
"""

import argparse
import array
import pathlib
import random
import resource
import struct
import subprocess
import sys
import tempfile
import time

HERE = pathlib.Path(__file__).resolve().parent
sys.dont_write_bytecode = True
sys.path.insert(0, str(HERE.parent))
import bench_support as bench  # noqa: E402

INSPECTION = bench.SOURCE / "examples/inspect_cylinder_head/inspection.json"
NOISE_M, MOVE_M = 20e-6, 1e-4


def run(words):
    """Seconds; ends the benchmark if the command fails."""
    start = time.monotonic()
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=3600, check=False)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, words))}: exit code {done.returncode}: {done.stderr.strip()[-800:]}")
    return time.monotonic() - start


def exact_points(path):
    """Rows x, y, z, nx, ny, nz of a binary PLY file of floats."""
    data = path.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    count = next(int(line.split()[2]) for line in data[:end].decode("ascii").splitlines()
                 if line.startswith("element vertex"))
    return [struct.unpack_from("<6f", data, end + 24 * i) for i in range(count)]


def write_points(path, exact, count):
    rng = random.Random(1)
    values = array.array("f")
    for i in range(count):
        x, y, z, nx, ny, nz = exact[i % len(exact)]
        # A direction in the surface: what is left of a random one without its part along the normal.
        a, b, c = (MOVE_M * (2 * rng.random() - 1) for _ in range(3))
        along = a * nx + b * ny + c * nz - rng.gauss(0, NOISE_M)
        values.extend((x + a - along * nx, y + b - along * ny, z + c - along * nz, nx, ny, nz))
    if sys.byteorder == "big":
        values.byteswap()
    with open(path, "wb") as file:
        names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
        file.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {count}\n{names}end_header\n".encode())
        values.tofile(file)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--points", type=int, nargs="+", default=[500_000, 5_000_000])
    parser.add_argument("--json")
    args = parser.parse_args()
    bench.print_machine()
    rows = []
    print(f"{'points':>10} {'s':>8} {'of the first':>13} {'largest MB so far':>18}")
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        run([bench.SIGHTLINE, "plan", INSPECTION, "--bound-evaluations", 0, "--evaluations-per-scan", 500, "--no-pictures",
             "--no-fresh-targets", "--out", folder / "plan"])
        exact = []
        for scan in sorted((folder / "plan/points").glob("*.ply")):
            exact += exact_points(scan)
        for count in args.points:
            write_points(folder / "scan_01.ply", exact, count)
            seconds = run([bench.SIGHTLINE, "inspect", INSPECTION, "--plan", folder / "plan/plan.json",
                           "--measured", folder / "scan_01.ply", "--out", folder / f"verdict_{count}"])
            memory_mb = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1000
            rows.append({"points": count, "seconds": seconds, "memory_mb": memory_mb,
                         "time_over_first": seconds / (rows[0]["seconds"] if rows else seconds)})
            print(f"{count:>10} {seconds:>8.1f} {rows[-1]['time_over_first']:>13.2f} {memory_mb:>18.0f}", flush=True)
    bench.write_results(args.json, "many_points", rows)
    return 0


if __name__ == "__main__":
    sys.exit(main())
