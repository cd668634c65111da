# SPDX-License-Identifier: Apache-2.0
"""What `sightline part FILE --tolerances` reads of the NIST AP242 models, and what it does not."""

import argparse
import json
import subprocess
import sys
import time

import bench_support as bench


def read(path):
    start = time.monotonic()
    run = subprocess.run(
        [str(bench.SIGHTLINE), "part", str(path), "--tolerances", "--json"],
        capture_output=True, text=True, timeout=600, check=False,
    )
    if run.returncode != 0:
        sys.exit(f"{path}: exit code {run.returncode}\n{run.stderr[-2000:]}")
    return json.loads(run.stdout), time.monotonic() - start


def row(path):
    report, seconds = read(path)
    tolerances = report.get("read", [])
    faces = {face for t in tolerances for face in t.get("faces", [])}
    lists = ("read", "untoleranced", "datums", "not_read")
    return {
        "file": report["file"],
        "in_file": report["entity_count"],
        "with_zone": len(tolerances),
        "without_limits": len(report.get("untoleranced", [])),
        "datums": len(report.get("datums", [])),
        "not_read": len(report.get("not_read", [])),
        "accounted": sum(len(report.get(name, [])) for name in lists) == report["entity_count"],
        "bound_to_faces": sum(1 for t in tolerances if t.get("faces")),
        "faces": len(faces),
        "seconds": seconds,
        "not_read_names": [f"{u['name']}: {u['reason']}" for u in report.get("not_read", [])],
        "without_face": [
            f"{t['text']} ({t['name']}): {', '.join(t.get('features', [])) or 'nothing'}"
            for t in tolerances if not t.get("faces")
        ],
        "notes": report.get("notes", []),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("files", nargs="*", help="STEP or QIF files; default: the NIST models")
    arguments = parser.parse_args()
    bench.print_machine()
    files = arguments.files or sorted((bench.SHARED / "data/cad/nist_ap242").glob("*.stp"))
    if not files:
        print("skipped: no shared data")
        return
    rows = [row(path) for path in files]
    print(f"{'file':34} {'in file':>7} {'with zone':>9} {'no limits':>9} {'datums':>6} "
          f"{'not read':>8} {'on faces':>8} {'faces':>5} {'s':>5}")
    for r in rows:
        print(f"{r['file']:34} {r['in_file']:7} {r['with_zone']:9} {r['without_limits']:9} "
              f"{r['datums']:6} {r['not_read']:8} {r['bound_to_faces']:8} {r['faces']:5} "
              f"{r['seconds']:5.1f}")
    for r in rows:
        for title, lines in (("not read", r["not_read_names"]), ("on no face", r["without_face"]),
                             ("note", r["notes"])):
            for line in lines:
                print(f"{r['file']}: {title}: {line}")
    bench.write_results(arguments.json, "tolerances_read", rows)
    if not all(r["accounted"] for r in rows):
        sys.exit("something of a file is in none of the lists")


if __name__ == "__main__":
    main()
