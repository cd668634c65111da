# SPDX-License-Identifier: Apache-2.0
"""Scans that planning strategies need for 90 % and 95 %, on several parts (`sightline compare`)."""

import argparse
import csv
import pathlib
import subprocess
import sys

import bench_support as bench

DEFAULT = "greedy-sa,greedy-ga,greedy-pso,greedy-pso-1,matrix,refined"


def summary(counts, seeds):
    """Median (min-max) over seeds; how many reached the goal if not all did."""
    reached = [c for c in counts if c > 0]
    if not reached:
        return "not reached"
    text = f"{bench.median(reached):g} ({min(reached)}-{max(reached)})"
    return text if len(reached) == seeds else f"{text} {len(reached)}/{seeds}"


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--parts", default=",".join(bench.PARTS), help="comma-separated")
    parser.add_argument("--strategies", default=DEFAULT, help="comma-separated")
    parser.add_argument("--evaluations-per-scan", type=int, default=10000)
    parser.add_argument("--matrix-samples", type=int, default=1500000)
    args = parser.parse_args()
    bench.print_machine()
    base = pathlib.Path(args.json).parent if args.json else bench.SOURCE / "build/bench"
    results = []
    print(f"{'part':<14}{'strategy':<14}{'scans for 90 %':>18}{'scans for 95 %':>18}"
          f"{'evaluations 95 %':>18}{'s to 95 %':>11}")
    for part in args.parts.split(","):
        inspection = bench.inspection_for(part, base / "parts")
        if inspection is None:
            continue
        out = base / f"compare_{part}"
        command = [
            str(bench.SIGHTLINE), "compare", str(inspection), "--out", str(out),
            "--strategies", args.strategies, "--seeds", str(args.seeds), "--goals", "0.9,0.95",
            "--evaluations-per-scan", str(args.evaluations_per_scan),
            "--matrix-samples", str(args.matrix_samples),
        ]
        log = base / f"compare_{part}.log"
        with open(log, "w", encoding="utf-8") as file:
            code = subprocess.run(command, stdout=file, stderr=file, check=False).returncode
        if code != 0:
            sys.exit(f"{' '.join(command)}: exit code {code}, see {log}")
        with open(out / "comparison.csv", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        for strategy in args.strategies.split(","):
            def values(goal, field, of=strategy):
                return [float(r[field]) for r in rows if r["strategy"] == of and float(r["goal"]) == goal]
            counts = {goal: [int(c) for c in values(goal, "scans")] for goal in (0.9, 0.95)}
            evaluations, seconds = values(0.95, "evaluations"), values(0.95, "time_s")
            print(f"{part:<14}{strategy:<14}{summary(counts[0.9], args.seeds):>18}"
                  f"{summary(counts[0.95], args.seeds):>18}{bench.median(evaluations):>18.0f}"
                  f"{bench.median(seconds):>11.1f}", flush=True)
            results.append({
                "part": part, "strategy": strategy, "seeds": args.seeds,
                "scans_90": counts[0.9], "scans_95": counts[0.95],
                "evaluations_95": evaluations, "time_95_s": seconds,
            })
    bench.write_results(args.json, "strategies", results)


if __name__ == "__main__":
    main()
