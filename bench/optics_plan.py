# SPDX-License-Identifier: Apache-2.0
"""Optics of a whole plan: `sightline plan` on the example head with the example's camera, then
`sightline optics --plan` on all its scans. Time, and settings per scan."""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import bench_support as bench


def run(command):
    start = time.monotonic()
    result = subprocess.run(command, capture_output=True, text=True, timeout=7200, check=False)
    if result.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))}: exit code {result.returncode}\n{result.stderr[-2000:]}")
    return time.monotonic() - start


def task(folder, scans):
    source = bench.SOURCE / "examples/cylinder_head_image/inspection.json"
    inspection = json.loads(source.read_text(encoding="utf-8"))
    for holder, field in [(inspection["part"], "file"), (inspection["camera"], "sensor_file")]:
        holder[field] = str((source.parent / holder[field]).resolve())
    for material in inspection["materials"]:
        material["file"] = str((source.parent / material["file"]).resolve())
    # Free to move; what scans are like is the planner's business.
    del inspection["measurement"]
    inspection["rig"] = {**inspection.get("rig", {}), "part_holding": "PART_HOLDING_FREE"}
    inspection["render"] = {"seed": 1}
    inspection["goal"] = {"coverage": 0.99, "max_scans": scans}
    inspection["lens"].pop("focus_distance_m")
    path = pathlib.Path(folder) / "inspection.json"
    path.write_text(json.dumps(inspection), encoding="utf-8")
    return path


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--scans", type=int, default=12)
    parser.add_argument("--out", help="folder to keep; default: a temporary one")
    args = parser.parse_args()
    bench.print_machine()
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(args.out or temporary)
        folder.mkdir(parents=True, exist_ok=True)
        inspection = task(folder, args.scans)
        plan_s = run([bench.SIGHTLINE, "plan", inspection, "--out", folder / "plan", "--seed", "1"])
        optics_s = run([bench.SIGHTLINE, "optics", inspection, "--plan", folder / "plan/plan.json",
                        "--out", folder / "optics"])
        optics = json.loads((folder / "optics/optics.json").read_text(encoding="utf-8"))
    print(f"plan {plan_s:.0f} s, optics of {len(optics['scans'])} scans {optics_s:.0f} s, "
          f"{optics['evaluated_images']} images judged")
    print(f"{'scan':>6}{'f':>6}{'ms':>9}{'u_px':>8}{'coverage':>10}{'cost':>8}{'frames':>8}{'represented':>13}")
    for choice in [optics["common"], *optics["scans"]]:
        best = choice["best"]
        print(f"{choice.get('scan', 'all'):>6}{best['f_number']:>6.3g}{1e3 * best['exposure_time_s']:>9.4g}"
              f"{best['u_px']:>8.3f}{100 * best['profile_coverage']:>9.1f}%{best['cost']:>8.3f}"
              f"{len(choice['frames']):>8}{choice.get('represented_fraction', 0):>13.2f}")
    if args.json:
        bench.write_results(args.json, "optics_plan", {"plan_s": plan_s, "optics_s": optics_s, "optics": optics})


if __name__ == "__main__":
    main()
