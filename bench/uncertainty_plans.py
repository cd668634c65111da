# SPDX-License-Identifier: Apache-2.0
"""Scans for the thesis's uncertainty task (Table 6.5) on several parts: this project's strategy and
gain against relaxed admissibility with one long particle swarm per scan (Table 6.6), at equal gain
evaluations per scan, and the lower bound."""

import argparse
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile
import time

import bench_support as bench

# Table 6.5, frames a sixth of the resolution apart.
TASK = {
    "uncertainty": {
        "line_detection": {"standard_deviation_px": 0.2},
        "prior_standard_deviation_m": 0.01,
        "resolution_m": 0.003,
    },
    "tolerances": {"zone_width_m": 0.0002, "relaxed_uncertainty_m": 0.001},
}


def run(command):
    result = subprocess.run(command, capture_output=True, text=True, timeout=7200, check=False)
    if result.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {result.returncode}\n{result.stderr[-2000:]}")
    return result.stdout


def task_for(part, folder, goal, max_scans):
    source = bench.inspection_for(part, folder)
    if source is None:
        return None
    inspection = json.loads(pathlib.Path(source).read_text(encoding="utf-8"))
    file = pathlib.Path(source).parent / inspection["part"]["file"]
    inspection["part"]["file"] = str(file.resolve())
    inspection.update(TASK)
    inspection["goal"] = {"admissible": goal, "max_scans": max_scans}
    path = pathlib.Path(folder) / f"{part}_uncertainty.json"
    path.write_text(json.dumps(inspection), encoding="utf-8")
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--parts", default="head,bracket-262,inline4-head", help="comma-separated")
    parser.add_argument("--goal", type=float, default=0.8)
    parser.add_argument("--max-scans", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--bound-evaluations", type=int, default=100000)
    parser.add_argument("--gains", default="ra:0.4", help="of the peer; as of `sightline compare`")
    args = parser.parse_args()
    bench.print_machine()
    print(f"{'part':<14}{'plan':<24}{'scans':>6}{'admissible':>12}{'fresh':>8}{'relaxed':>9}"
          f"{'bound':>8}{'time s':>8}")
    results = []
    with tempfile.TemporaryDirectory() as folder:
        for part in args.parts.split(","):
            inspection = task_for(part, folder, args.goal, args.max_scans)
            if inspection is None:
                continue
            out = pathlib.Path(folder) / f"{part}_own"
            stdout = run([bench.SIGHTLINE, "plan", inspection, "--out", out, "--seed", str(args.seed),
                          "--bound-evaluations", str(args.bound_evaluations), "--no-pictures",
                          "--no-point-clouds"])
            seconds = float(re.search(r"([\d.]+) s from cold start to plan", stdout).group(1))
            plan = json.loads((out / "plan.json").read_text(encoding="utf-8"))
            u = plan["uncertainty"]
            bound = u.get("bound", {})
            row = {
                "part": part, "plan": "own", "scans": len(plan["scans"]),
                "admissible": u["admissible_fraction"],
                "fresh_admissible": u["fresh_admissible_fraction"],
                "relaxed": u["relaxed_fraction"], "bound": bound.get("scans", 0),
                "bound_converged": bound.get("converged", False), "seconds": seconds,
            }
            results.append(row)
            print(f"{part:<14}{'own':<24}{row['scans']:>6}{100 * row['admissible']:>11.2f}%"
                  f"{100 * row['fresh_admissible']:>7.2f}%{100 * row['relaxed']:>8.2f}%"
                  f"{row['bound']:>7.2f}{'' if row['bound_converged'] else '?'}{seconds:>8.0f}",
                  flush=True)
            start = time.monotonic()
            out = pathlib.Path(folder) / f"{part}_peer"
            run([bench.SIGHTLINE, "compare", inspection, "--out", out, "--strategies",
                 "greedy-pso-1", "--gains", args.gains, "--seeds", "1"])
            with open(out / "curves.csv", encoding="utf-8") as file:
                curves = list(csv.DictReader(file))
            for name in dict.fromkeys(c["strategy"] for c in curves):
                curve = [c for c in curves if c["strategy"] == name]
                reached = [c for c in curve if float(c["settled"]) >= args.goal]
                scans = int(reached[0]["scans"]) if reached else None
                last = reached[0] if reached else curve[-1]
                peer = {"part": part, "plan": name, "scans": scans, "of": len(curve),
                        "admissible": float(last["settled"]), "relaxed": float(last["relaxed"]),
                        "seconds": time.monotonic() - start}
                results.append(peer)
                shown = str(scans) if scans else f">{len(curve)}"
                print(f"{'':<14}{name:<24}{shown:>6}{100 * peer['admissible']:>11.2f}%{'':>8}"
                      f"{100 * peer['relaxed']:>8.2f}%{'':>8}{peer['seconds']:>8.0f}", flush=True)
    print("own: the goal is met on fresh targets too. Other plans: on their own targets only. "
          "bound: scans any plan needs; ?: its search had not converged.")
    bench.write_results(args.json, "uncertainty_plans", results)


if __name__ == "__main__":
    main()
