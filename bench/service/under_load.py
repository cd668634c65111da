#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Commands on a machine whose cores are busy with other work.

Eight endless loops run while, one after the other, a part with a region of interest is planned, a
set of recordings is diagnosed with --quick, and an example's optics are chosen from few settings.
Each must end with exit code 0 and its report, and must not say that a deadline was exceeded or that
something is missing.

  bench/service/under_load.py [--busy 8] [--recordings FOLDER] [--only plan,diagnose,optics]
                              [--limit-s 1800] [--json FILE]

The recordings are null_mono of the shared data folder (SIGHTLINE_SHARED_DIR); without it the
diagnosis is skipped. Exit code 1 if a command does not end well.
"""

import argparse
import json
import os
import pathlib
import re
import resource
import signal
import subprocess
import sys
import tempfile
import time

from service import ROOT, binary, stepped_block_stl


def plan_command(folder: pathlib.Path) -> list[str]:
    (folder / "block.stl").write_bytes(stepped_block_stl())
    (folder / "inspection.json").write_text(json.dumps({
        "name": "stepped block with a region",
        "part": {"file": "block.stl", "unit": "mm"},
        "targets": {
            "spacing_m": 0.004,
            "regions": [{"name": "middle step", "spacing_m": 0.002,
                         "min_m": {"x": 0.02, "y": 0, "z": 0.0155}, "max_m": {"x": 0.04, "y": 0.04, "z": 0.0165}}],
        },
    }))
    return ["plan", "inspection.json", "--out", "out", "--seed", "1", "--evaluations-per-scan", "5000",
            "--bound-evaluations", "5000"]


def diagnose_command(recordings: pathlib.Path) -> list[str]:
    return ["diagnose", str(recordings), "--quick", "--out", "out"]


def optics_command(folder: pathlib.Path) -> list[str]:
    source = ROOT / "examples/cylinder_head_optics/inspection.json"
    inspection = json.loads(source.read_text(encoding="utf-8"))
    for holder, field in [(inspection["part"], "file"), (inspection["camera"], "sensor_file"),
                          *((material, "file") for material in inspection["materials"])]:
        holder[field] = str((source.parent / holder[field]).resolve())
    # Tracing the light of the lamps takes most of the time, and a rough estimate of it is enough here.
    inspection["render"].update({"noise_target_relative": 0.1, "max_samples_per_px": 8, "max_bounces": 1,
                                 "laser_interreflection": False})
    inspection["optics"] = {"f_numbers": [8, 11], "exposures": 30}
    (folder / "inspection.json").write_text(json.dumps(inspection))
    return ["optics", "inspection.json", "--out", "out", "--seed", "1"]


def busy_processes(count: int, limit_s: float) -> list[subprocess.Popen]:
    """Endless loops; they end by themselves after the limit, whatever happens to this program."""
    return [subprocess.Popen(["timeout", str(limit_s), "sh", "-c", "while :; do :; done"], start_new_session=True)
            for _ in range(count)]


def end(processes: list[subprocess.Popen]) -> None:
    for process in processes:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.wait()


def run(command: list[str], folder: pathlib.Path, limit_s: float) -> dict:
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    process = subprocess.Popen([binary(), *command], cwd=folder, stdout=subprocess.PIPE,
                               stderr=subprocess.STDOUT, text=True, errors="replace", start_new_session=True)
    try:
        output, _ = process.communicate(timeout=limit_s)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output, _ = process.communicate()
    finally:
        end([process])
    wall_s = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    (folder / "output.txt").write_text(output)
    report = folder / "out/report.html"
    said = [line for line in output.splitlines()
            if re.search(r"deadline.?exceeded|warning: missing", line, re.IGNORECASE)]
    return {
        "exit code": process.returncode, "wall_s": round(wall_s, 1), "cpu_s": round(cpu_s, 1),
        "report KiB": report.stat().st_size >> 10 if report.exists() else 0,
        "said": said[:5], "last lines": output.strip().splitlines()[-3:],
        "ended well": process.returncode == 0 and report.exists() and not said,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--busy", type=int, default=8)
    parser.add_argument("--recordings", type=pathlib.Path)
    parser.add_argument("--only", default="plan,diagnose,optics")
    parser.add_argument("--limit-s", type=float, default=1800, help="of each command")
    parser.add_argument("--json", help="file for the numbers")
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    shared = pathlib.Path(os.environ.get("SIGHTLINE_SHARED_DIR", ROOT / "../shared"))
    recordings = (args.recordings or shared / "recordings/open/null_mono").resolve()
    report = {}
    with tempfile.TemporaryDirectory(prefix="sightline-load-") as temporary:
        for name in args.only.split(","):
            folder = pathlib.Path(temporary, name)
            folder.mkdir()
            if name == "diagnose" and not recordings.exists():
                print("diagnose: skipped: no shared data")
                continue
            command = (plan_command(folder) if name == "plan" else
                       optics_command(folder) if name == "optics" else diagnose_command(recordings))
            busy = busy_processes(args.busy, args.limit_s + 60)
            try:
                time.sleep(1)
                report[name] = run(command, folder, args.limit_s)
            finally:
                end(busy)
            if len(report) == 1:
                print(f"{'command':>10}{'exit code':>11}{'wall s':>9}{'CPU s':>8}{'report KiB':>12}  ended well")
            row = report[name]
            print(f"{name:>10}{row['exit code']:>11}{row['wall_s']:>9}{row['cpu_s']:>8}{row['report KiB']:>12}"
                  f"  {'yes' if row['ended well'] else 'no'}", flush=True)
            for line in row["said"] + ([] if row["ended well"] else row["last lines"]):
                print(f"             {line[:200]}", flush=True)
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps({"busy": args.busy, "commands": report}, indent=1))
    return 0 if all(row["ended well"] for row in report.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
