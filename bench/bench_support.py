# SPDX-License-Identifier: Apache-2.0
"""What the benchmark scripts share: programs, parts, inspections, results."""

import datetime
import json
import os
import pathlib
import struct
import sys

SOURCE = pathlib.Path(
    os.environ.get("SIGHTLINE_SOURCE_DIR", pathlib.Path(__file__).resolve().parent.parent)
).resolve()
BIN = pathlib.Path(os.environ.get("SIGHTLINE_BIN_DIR", SOURCE / "build/release/bin"))
SHARED = pathlib.Path(os.environ.get("SIGHTLINE_SHARED_DIR", SOURCE / "../shared"))
SIGHTLINE = BIN / "sightline"
SERVER = BIN / "coverage_server"
PARTS = ["head", "bracket-262", "bracket-320", "inline4-head"]


def machine():
    model = "unknown CPU"
    with open("/proc/cpuinfo", encoding="ascii", errors="replace") as file:
        for line in file:
            if line.startswith("model name"):
                model = line.split(":", 1)[1].strip()
                break
    now = datetime.datetime.now(datetime.timezone.utc)
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "load_average_1min": os.getloadavg()[0],
        "date": now.strftime("%Y-%m-%dT%H:%M:%SZ"),
    }


def print_machine():
    m = machine()
    print(f"machine: {m['cpu']}, {m['cores']} cores, load average {m['load_average_1min']:.2f} at the start")


def write_results(path, benchmark, results):
    if not path:
        return
    path = pathlib.Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    document = {"benchmark": benchmark, "machine": machine(), "results": results}
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(f"results: {path}")


def median(values):
    values = sorted(values)
    n = len(values)
    return values[n // 2] if n % 2 else (values[n // 2 - 1] + values[n // 2]) / 2


def read_binary_stl(path):
    """Triangles as lists of nine numbers."""
    data = pathlib.Path(path).read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    if len(data) != 84 + 50 * count:
        raise ValueError(f"{path}: not a binary STL")
    return [list(struct.unpack_from("<9f", data, 84 + 50 * i + 12)) for i in range(count)]


def write_binary_stl(path, triangles):
    with open(path, "wb") as file:
        file.write(b"\0" * 80 + struct.pack("<I", len(triangles)))
        for corners in triangles:
            file.write(struct.pack("<12f", 0, 0, 0, *corners) + b"\0\0")


def inspection_for(part, folder):
    """Writes an inspection of the part into the folder; its path, or None without shared data."""
    folder = pathlib.Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    if part == "head":
        source = SOURCE / "examples/cylinder_head/cylinder_head.glb"
    elif part.startswith("bracket-"):
        source = SHARED / f"data/cad/brackets/{part.removeprefix('bracket-')}.obj"
    elif part == "inline4-head":
        source = SHARED / "data/cad/inline4_engine/Cylinder Head.STL"
    else:
        sys.exit(f"part \"{part}\" is none of {' '.join(PARTS)}")
    if not source.exists():
        print(f"{part}: skipped: no shared data")
        return None
    file = source.resolve()
    if part == "inline4-head":
        # A scale model, 137 mm long: brought to the size of a real one.
        triangles = read_binary_stl(source)
        spans = [
            max(max(t[k::3]) for t in triangles) - min(min(t[k::3]) for t in triangles)
            for k in range(3)
        ]
        scale = 450 / max(spans)
        file = (folder / "inline4_head_450mm.stl").resolve()
        write_binary_stl(file, [[scale * x for x in t] for t in triangles])
    path = folder / f"{part}.json"
    # The thesis's task: the part floats in any orientation, and every point counts.
    inspection = {
        "name": part,
        "part": {"file": str(file)} if part == "head" else {"file": str(file), "unit": "mm"},
        "rig": {"part_holding": "PART_HOLDING_FREE"},
        "targets": {"required_resolution_m": 0},
        "goal": {"coverage": 0.95},
    }
    path.write_text(json.dumps(inspection, indent=1) + "\n", encoding="utf-8")
    return path
