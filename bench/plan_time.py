# SPDX-License-Identifier: Apache-2.0
"""Wall time of `sightline plan` from process start, and scans it needs."""

import argparse
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import bench_support as bench


def plan(inspection, goal, seed, out):
    command = [
        str(bench.SIGHTLINE), "plan", str(inspection), "--out", str(out),
        "--goal", str(goal), "--seed", str(seed), "--bound-evaluations", "0",
        "--no-pictures", "--no-point-clouds",
    ]
    start = time.monotonic()
    run = subprocess.run(command, capture_output=True, text=True, timeout=3600, check=False)
    wall_s = time.monotonic() - start
    if run.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {run.returncode}\n{run.stderr[-2000:]}")
    to_plan = re.search(r"([\d.]+) s from cold start to plan", run.stdout)
    ready = re.search(r"ready after ([\d.]+) s", run.stderr)
    document = json.loads((pathlib.Path(out) / "plan.json").read_text(encoding="utf-8"))
    targets = document["coverage"]
    return {
        "goal": goal,
        "seed": seed,
        "scene_ready_s": float(ready.group(1)),
        "to_plan_s": float(to_plan.group(1)),
        "process_s": wall_s,
        "scans": len(document["scans"]),
        "coverage": targets["coverage"],
        "gain_evaluations": document["gain_evaluations"],
        "fast_mean_absolute_error": targets.get("fast_mean_absolute_error", 0),
        "stop_reason": document["stop_reason"],
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--parts", default="head", help="comma-separated")
    parser.add_argument("--goals", default="0.9,0.95")
    args = parser.parse_args()
    bench.print_machine()
    print("scene: from process start to the first possible query. plan: from process start to the "
          "finished plan. process: with report, without bound and pictures.")
    print(f"{'part':<14}{'goal':>6}{'seed':>6}{'scene s':>9}{'plan s':>9}{'process s':>11}{'scans':>7}"
          f"{'coverage':>10}{'evaluations':>13}")
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for part in args.parts.split(","):
            inspection = bench.inspection_for(part, folder)
            if inspection is None:
                continue
            for goal in (float(g) for g in args.goals.split(",")):
                rows = []
                for seed in range(1, args.seeds + 1):
                    r = plan(inspection, goal, seed, pathlib.Path(folder) / f"{part}_{goal}_{seed}")
                    r["part"] = part
                    rows.append(r)
                    print(f"{part:<14}{goal:>6}{seed:>6}{r['scene_ready_s']:>9.1f}{r['to_plan_s']:>9.1f}"
                          f"{r['process_s']:>11.1f}{r['scans']:>7}{r['coverage']:>10.4f}"
                          f"{r['gain_evaluations']:>13}", flush=True)
                print(f"{part:<14}{goal:>6}{'median':>6}"
                      f"{bench.median([r['scene_ready_s'] for r in rows]):>9.1f}"
                      f"{bench.median([r['to_plan_s'] for r in rows]):>9.1f}"
                      f"{bench.median([r['process_s'] for r in rows]):>11.1f}"
                      f"{bench.median([r['scans'] for r in rows]):>7g}", flush=True)
                results += rows
    bench.write_results(args.json, "plan_time", results)


if __name__ == "__main__":
    main()
