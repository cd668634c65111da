# SPDX-License-Identifier: Apache-2.0
"""Geometry and optics planned together against geometry first and its optics then, on the example head
with the same number of scans. Both plans are judged by fresh frames that neither was planned on: rendered,
their lines detected, u over distance and angle learned from them, and the surface that each plan makes
known with its own u computed exactly."""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import bench_support as bench

FRESH = bench.SIGHTLINE.parent / "bench_fresh_frames"


def run(*command):
    start = time.monotonic()
    command = [str(word) for word in command]
    result = subprocess.run(command, capture_output=True, text=True, timeout=7200, check=False)
    if result.returncode != 0:
        sys.exit(f"{' '.join(command)}: exit code {result.returncode}\n{result.stderr[-2000:]}")
    return time.monotonic() - start, result.stdout + result.stderr


def resolved(source):
    inspection = json.loads(source.read_text(encoding="utf-8"))
    for holder, field in [(inspection["part"], "file"), (inspection["camera"], "sensor_file"),
                          *((material, "file") for material in inspection["materials"])]:
        holder[field] = str((source.parent / holder[field]).resolve())
    return inspection


def admissible(folder, inspection, plan, table, factor):
    """Share of the targets that the plan makes known admissibly with `factor` times the table's u."""
    changed = json.loads(json.dumps(inspection))
    scaled = dict(table)
    scaled["standard_deviations_px"] = [factor * u for u in table["standard_deviations_px"]]
    changed["uncertainty"]["line_detection"] = {"table": scaled}
    path = folder / "judged.json"
    path.write_text(json.dumps(changed), encoding="utf-8")
    run(bench.SIGHTLINE, "evaluate", path, plan, "--out", folder / "judged", "--no-pictures", "--no-point-clouds")
    answer = json.loads((folder / "judged/plan.json").read_text(encoding="utf-8"))["uncertainty"]
    return answer["admissible_fraction"], answer.get("fresh_admissible_fraction")


def judge(folder, inspection, inspection_file, plan, frames, seed):
    result_file = folder / "fresh.json"
    run(FRESH, "--inspection", inspection_file, "--plan", plan, "--frames", frames, "--seed", seed,
        "--json", result_file)
    fresh = json.loads(result_file.read_text(encoding="utf-8"))["results"]
    learned = fresh["detection"]
    errors = learned["relative_standard_errors"]
    error = (sum(e * e for e in errors) / len(errors)) ** 0.5
    shares = [admissible(folder, inspection, plan, learned["table"], factor)
              for factor in (1, 1 - 2 * error, 1 + 2 * error)]
    return fresh, shares


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--scans", type=int, default=8)
    parser.add_argument("--frames", type=int, default=60)
    parser.add_argument("--f-numbers", help="to choose from, e.g. 5.6,11; default: the example's")
    parser.add_argument("--frames-per-scan", type=int, help="frames that settings are judged by; default: the example's")
    parser.add_argument("--realisations", type=int, help="of speckle and noise; default: the example's")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", help="folder to keep; default: a temporary one")
    args = parser.parse_args()
    bench.print_machine()
    results = {}
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(args.out or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        inspection = resolved(bench.SOURCE / "examples/cylinder_head_joint/inspection.json")
        # Beyond reach: as much as so many scans can.
        inspection["goal"] = {"admissible": 0.999, "max_scans": args.scans}
        if args.f_numbers:
            inspection["optics"]["f_numbers"] = [float(number) for number in args.f_numbers.split(",")]
        if args.frames_per_scan:
            inspection["optics"]["frames_per_scan"] = args.frames_per_scan
        if args.realisations:
            inspection["optics"]["realisations"] = args.realisations
        task = folder / "inspection.json"
        task.write_text(json.dumps(inspection), encoding="utf-8")
        common = ["--seed", args.seed, "--bound-evaluations", 0, "--no-pictures", "--no-point-clouds"]
        joint_s, _ = run(bench.SIGHTLINE, "plan", task, "--out", folder / "joint", "--optics", *common)
        geometry_s, _ = run(bench.SIGHTLINE, "plan", task, "--out", folder / "geometry", *common)
        optics_s, _ = run(bench.SIGHTLINE, "optics", task, "--plan", folder / "geometry/plan.json",
                          "--out", folder / "then_optics")
        optics = json.loads((folder / "joint/optics.json").read_text(encoding="utf-8"))
        print(f"joint {joint_s:.0f} s; geometry {geometry_s:.0f} s, then optics {optics_s:.0f} s")
        for number, step in enumerate(optics["rounds"], 1):
            setting = step["setting"]
            print(f"round {number}: {step['scans']} scans, f/{setting['f_number']:.3g}, "
                  f"{1e3 * setting['exposure_time_s']:.4g} ms, change of u {100 * step['change_of_u']:.1f} % "
                  f"({step['change_in_standard_errors']:.1f} standard errors), admissible "
                  f"{100 * step['settled_for']:.1f} % as planned, {100 * step['settled_with']:.1f} % with it")
        print("come to rest" if optics.get("rounds_converged") else "not come to rest")
        print(f"{'plan':>16}{'scans':>7}{'frames':>8}{'u px':>8}{'u um':>8}{'found':>8}"
              f"{'admissible (2 s.e. of u)':>28}{'fresh targets':>15}")
        for name, plan in [("joint", folder / "joint/plan.json"), ("one after other", folder / "then_optics/plan.json")]:
            scans = len(json.loads(plan.read_text(encoding="utf-8"))["scans"])
            fresh, shares = judge(folder, inspection, task, plan, args.frames, 1000 + args.seed)
            (own, targets), (high, _), (low, _) = shares
            print(f"{name:>16}{scans:>7}{len(fresh['frames']):>8}{fresh['mean_u_px']:>8.3f}"
                  f"{fresh['mean_u_height_um']:>8.1f}{100 * fresh['mean_found']:>7.1f}%"
                  f"{100 * own:>12.1f} % ({100 * low:.1f} to {100 * high:.1f}){100 * (targets or 0):>13.1f} %")
            results[name] = {"scans": scans, "fresh": fresh, "admissible": shares}
        results["rounds"] = optics["rounds"]
    bench.write_results(args.json, "joint_plan", results)


if __name__ == "__main__":
    main()
