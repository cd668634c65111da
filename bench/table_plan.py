# SPDX-License-Identifier: Apache-2.0
"""Scans and time of examples/cylinder_head as deploy/quickstart plans it: on its table, with limits on pixels and
depth and room for camera and laser."""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import bench_support as bench

INSPECTION = bench.SOURCE / "examples/cylinder_head/inspection.json"


def plan(seed, out):
    command = [str(bench.SIGHTLINE), "plan", str(INSPECTION), "--out", str(out), "--seed", str(seed)]
    start = time.monotonic()
    run = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=False)
    seconds = time.monotonic() - start
    if run.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {run.returncode}\n{run.stderr[-2000:]}")
    document = json.loads((out / "plan.json").read_text(encoding="utf-8"))
    return {
        "seed": seed,
        "scans": len(document["scans"]),
        "coverage": document["coverage"]["coverage"],
        "bound": document["bound"].get("scans", 0),
        "converged": document["bound"].get("converged", False),
        "all_rest": all("resting_face" in scan for scan in document["scans"]),
        "seconds": seconds,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--seeds", type=int, default=3)
    args = parser.parse_args()
    bench.print_machine()
    print(f"{'seed':>5}{'scans':>7}{'covered %':>11}{'bound':>7}{'converged':>11}{'on a face':>11}{'s':>6}")
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(1, args.seeds + 1):
            row = plan(seed, pathlib.Path(folder) / str(seed))
            rows.append(row)
            print(f"{seed:>5}{row['scans']:>7}{100 * row['coverage']:>11.2f}{row['bound']:>7.1f}"
                  f"{'yes' if row['converged'] else 'no':>11}{'all' if row['all_rest'] else 'NOT ALL':>11}"
                  f"{row['seconds']:>6.0f}", flush=True)
    bench.write_results(args.json, "table_plan", rows)


if __name__ == "__main__":
    main()
