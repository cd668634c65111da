# SPDX-License-Identifier: Apache-2.0
"""Time to execute plans of eight parts with a free and a rigid rig, beside that of the plans of fewest scans from the
same searches. CAD files that are not there are left out."""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import bench_support as bench
import default_plans

RIGS = {
    "free": ["--rig", "free"],
    "rigid": ["--rig", "rigid", "--triangulation-angle-deg", "30", "--stand-off-mm", "250"],
}


def write_inspection(part, rig, folder):
    file, unit = default_plans.PARTS[part]
    task = folder / f"{part} {rig}.json".replace(" ", "_")
    command = [str(bench.SIGHTLINE), "new", str(file), "--no-questions", "--name", f"{part}, {rig}", "--out", str(task)]
    run = subprocess.run(command + (["--unit", unit] if unit else []) + RIGS[rig], capture_output=True, text=True,
                         check=False, timeout=600)
    if run.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {run.returncode}\n{run.stderr[-2000:]}")
    return task


def measure(task, program, options, folder):
    results = folder / "results.json"
    command = [str(program), str(task), "--json", str(results), *options]
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, check=False,
                         timeout=3600)
    if run.returncode != 0:
        return {"failed": run.stdout.strip()[-300:]}
    return json.loads(results.read_text(encoding="utf-8"))["results"][0]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--parts", help="comma-separated; default: all")
    parser.add_argument("--rigs", default=",".join(RIGS))
    parser.add_argument("--bound-evaluations", type=int, default=100000)
    args = parser.parse_args()
    program = bench.BIN / "bench_least_time"
    options = ["--bound-evaluations", str(args.bound_evaluations)]
    bench.print_machine()
    print("scans, set-ups and minutes of the plan of fewest scans, and of the plan of least time; seconds of planning")
    print(f"{'part':>15}{'rig':>7}{'scans':>7}{'setups':>8}{'min':>8}{'scans':>8}{'setups':>8}{'min':>8}{'less %':>8}"
          f"{'s':>6}")
    rows, before, after = [], 0, 0
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        for part in args.parts.split(",") if args.parts else default_plans.PARTS:
            if not default_plans.PARTS[part][0].exists():
                print(f"{part:>15}  left out: no CAD file")
                continue
            for rig in args.rigs.split(","):
                row = measure(write_inspection(part, rig, folder), program, options, folder)
                rows.append({"part": part, "rig": rig, **row})
                if "failed" in row:
                    print(f"{part:>15}{rig:>7}  {row['failed']}", flush=True)
                    continue
                few, fast = row["fewest_scans"], row["least_time"]
                before += few["time_s"]
                after += fast["time_s"]
                print(f"{part:>15}{rig:>7}{few['scans']:>7}{few['setups']:>8}{few['time_s'] / 60:>8.1f}"
                      f"{fast['scans']:>8}{fast['setups']:>8}{fast['time_s'] / 60:>8.1f}"
                      f"{100 * row['time_saved']:>8.1f}{row['planning_s'] + row['least_time_planning_s']:>6.0f}",
                      flush=True)
    if before > 0:
        print(f"all: {before / 60:.0f} min and {after / 60:.0f} min, {100 * (1 - after / before):.1f} % less")
    bench.write_results(args.json, "least_time_plans", rows)


if __name__ == "__main__":
    main()
