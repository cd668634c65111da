# SPDX-License-Identifier: Apache-2.0
"""Plans that `sightline new` and `sightline plan` make of eight parts without another word: whether a person
can set them up (resting faces), scans, what the rig can measure and what is measured, whether the reasons of
what is not add up, and time. CAD files that are not there are left out."""

import argparse
import json
import pathlib
import subprocess
import tempfile
import time

import bench_support as bench

CAD = bench.SHARED / "data/cad"
PARTS = {
    "cylinder head": (bench.SOURCE / "examples/cylinder_head/cylinder_head.glb", None),
    "bracket 262": (CAD / "brackets/262.obj", "mm"),
    "bracket 320": (CAD / "brackets/320.obj", "mm"),
    "inline-4 head": (CAD / "inline4_engine/Cylinder Head.STL", "mm"),
    "crankshaft": (CAD / "inline4_engine/Crankshaft.STL", "mm"),
    "NIST CTC 01": (CAD / "nist_ap242/nist_ctc_01_asme1_ap242-e1.stp", None),
    "NIST CTC 03": (CAD / "nist_ap242/nist_ctc_03_asme1_ap242-e2.stp", None),
    "NIST FTC 06": (CAD / "nist_ap242/nist_ftc_06_asme1_ap242-e2.stp", None),
}


def run(*command):
    result = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, capture_output=True,
                            text=True, timeout=1200, check=False)
    return result.returncode, result.stderr


def measure(file, unit, folder):
    """What the plan of one part says, or why there is none."""
    task = folder / "inspection.json"
    code, errors = run(bench.SIGHTLINE, "new", file, *(["--unit", unit] if unit else []), "--out", task)
    if code != 0:
        return {"failed": errors.strip()}
    start = time.monotonic()
    code, errors = run(bench.SIGHTLINE, "plan", task, "--out", folder / "plan")
    seconds = time.monotonic() - start
    if code != 0:
        return {"failed": errors.strip()[-300:]}
    plan = json.loads((folder / "plan/plan.json").read_text(encoding="utf-8"))
    coverage = plan["coverage"]
    targets, covered = int(coverage["targets"]), int(coverage["covered_targets"])
    reasons = sum(int(kind["targets"]) for kind in coverage.get("uncovered", []))
    return {
        "scans": len(plan["scans"]),
        "bound": plan["bound"].get("scans", 0),
        "faces": [face["name"] for face in plan.get("resting_faces", [])],
        "all_rest": all("resting_face" in scan for scan in plan["scans"]),
        "targets": targets,
        "measurable_in_free_space": int(coverage["measurable_in_free_space_targets"]),
        "measurable": int(coverage["measurable_targets"]),
        "coverage": coverage["coverage"],
        "fresh_coverage": coverage.get("fresh_coverage"),
        "reasons_add_up": reasons == targets - covered,
        "stop_reason": plan["stop_reason"],
        "seconds": seconds,
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    args = parser.parse_args()
    bench.print_machine()
    print(f"{'part':>15}{'scans':>7}{'bound':>7}{'faces':>8}{'free %':>8}{'rig %':>8}{'covered %':>11}{'fresh %':>9}"
          f"{'reasons':>9}{'s':>6}")
    results = {}
    with tempfile.TemporaryDirectory() as temporary:
        for number, (name, (file, unit)) in enumerate(PARTS.items()):
            if not file.exists():
                print(f"{name:>15}  left out: no CAD file")
                continue
            folder = pathlib.Path(temporary) / str(number)
            folder.mkdir()
            row = measure(file, unit, folder)
            results[name] = row
            if "failed" in row:
                print(f"{name:>15}  {row['failed']}")
                continue
            share = 100 / row["targets"]
            print(f"{name:>15}{row['scans']:>7}{row['bound']:>7.1f}{''.join(row['faces']) if row['all_rest'] else 'none':>8}"
                  f"{share * row['measurable_in_free_space']:>8.1f}{share * row['measurable']:>8.1f}"
                  f"{100 * row['coverage']:>11.2f}{100 * (row['fresh_coverage'] or 0):>9.2f}"
                  f"{'add up' if row['reasons_add_up'] else 'DO NOT':>9}{row['seconds']:>6.0f}", flush=True)
    bench.write_results(args.json, "default_plans", results)


if __name__ == "__main__":
    main()
