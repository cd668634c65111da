#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How long builds take: the quick start from nothing, and rebuilds after a change.

    bench/run build_time [-- OPTIONS]

The tree as it is and, with --base COMMIT, the tree of that commit are copied into temporary folders and built one
after the other without the compiler cache. Packages must be installed. For each: processor seconds and wall time
of configuring and building, number of build steps, size of the programs, time of `sightline --help`, and the
rebuild of the daily preset after a change of a header and of a source. --no-rebuild leaves that out, which takes
most of the time.
"""

import argparse
import json
import os
import pathlib
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time

import bench_support

HEADER = "core/inspection/inspection.h"
SOURCE = "planning/strategy/planner.cpp"


def timed(words, folder, environment=None):
    """Runs a command; its processor seconds with all its children, wall seconds, and what it printed."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    start = time.monotonic()
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False,
                          env={**os.environ, "CCACHE_DISABLE": "1", **(environment or {})})
    wall_s = time.monotonic() - start
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode != 0:
        sys.exit(f"{' '.join(words)} in {folder}: exit code {done.returncode}\n{done.stdout[-4000:]}{done.stderr[-2000:]}")
    cpu_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"cpu_s": round(cpu_s, 1), "wall_s": round(wall_s, 1)}, done.stdout


def copy_tree(base, folder):
    """The tracked files of this working tree, or those of the commit `base`."""
    folder.mkdir()
    if base:
        files = subprocess.run(["git", "archive", base], cwd=bench_support.SOURCE, check=True, capture_output=True).stdout
    else:
        names = subprocess.run(["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
                               cwd=bench_support.SOURCE, check=True, capture_output=True).stdout
        files = subprocess.run(["tar", "--create", "--null", "--ignore-failed-read", "--files-from", "-"],
                               cwd=bench_support.SOURCE, check=True, capture_output=True, input=names).stdout
    subprocess.run(["tar", "--extract"], cwd=folder, check=True, input=files)


def quickstart(tree):
    """What deploy/quickstart configures and builds in this tree."""
    script = (tree / "deploy/add-program")
    if script.exists():
        return ["-DSIGHTLINE_PROGRAMS=plan"], ["sightline", "sightline-plan", "coverage_server"]
    return [], ["sightline", "coverage_server"]


def steps(output):
    counts = re.findall(r"^\[\d+/(\d+)\]", output, re.MULTILINE)
    return int(counts[-1]) if counts else 0


def touch(path):
    """A change that no compiler can overlook."""
    path.write_text(path.read_text(encoding="utf-8") + "\n// changed\n", encoding="utf-8")


def measure(base, work, rebuild):
    tree = work / (base or "this")
    copy_tree(base, tree)
    options, targets = quickstart(tree)
    row = {"tree": base or "this tree", "targets": " ".join(targets)}
    row["configure"], _ = timed(["cmake", "--preset", "release", "--log-level=WARNING", "-DSIGHTLINE_BUILD_TESTS=OFF",
                                 "-DSIGHTLINE_BUILD_BENCH=OFF", *options], tree)
    row["build"], output = timed(["cmake", "--build", "--preset", "release", "--parallel", str(os.cpu_count()),
                                  "--target", *targets], tree)
    row["build"]["steps"] = steps(output)
    programs = tree / "build/release/bin"
    row["program_bytes"] = {path.name: path.stat().st_size for path in sorted(programs.iterdir()) if path.is_file()}
    start = time.monotonic()
    for _ in range(20):
        subprocess.run([programs / "sightline", "--help"], stdout=subprocess.DEVNULL, check=True)
    row["help_s"] = round((time.monotonic() - start) / 20, 4)
    if rebuild:
        presets = json.loads((tree / "CMakePresets.json").read_text())["configurePresets"]
        preset = "incremental" if any(p["name"] == "incremental" for p in presets) else "release"
        if preset != "release":
            timed(["cmake", "--preset", preset, "--log-level=WARNING", "-DSIGHTLINE_BUILD_TESTS=OFF",
                   "-DSIGHTLINE_BUILD_BENCH=OFF", *options], tree)
            row["daily_build"], _ = timed(["cmake", "--build", "--preset", preset, "--target", *targets], tree)
        for name, file in (("rebuild_header", HEADER), ("rebuild_source", SOURCE)):
            touch(tree / file)
            row[name], _ = timed(["cmake", "--build", "--preset", preset, "--target", *targets], tree)
            row[name]["file"] = file
    shutil.rmtree(tree)
    return row


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--base", help="a commit to compare with")
    parser.add_argument("--no-rebuild", action="store_true", help="only builds from nothing")
    parser.add_argument("--json", help="output file")
    arguments = parser.parse_args()
    bench_support.print_machine()
    rows = []
    with tempfile.TemporaryDirectory(prefix="sightline_build_") as folder:
        for base in [arguments.base, None] if arguments.base else [None]:
            rows.append(measure(base, pathlib.Path(folder), not arguments.no_rebuild))
            row = rows[-1]
            print(f"{row['tree']}: configure {row['configure']['cpu_s']} CPU s, build {row['build']['cpu_s']} CPU s, "
                  f"{row['build']['wall_s']} s, {row['build']['steps']} steps; sightline --help {1e3 * row['help_s']:.0f} ms",
                  flush=True)
            for name in ("rebuild_header", "rebuild_source"):
                if name in row:
                    print(f"  after a change of {row[name]['file']}: {row[name]['cpu_s']} CPU s, {row[name]['wall_s']} s",
                          flush=True)
    if len(rows) == 2:
        print(f"ratio of processor time, base / this tree: {rows[0]['build']['cpu_s'] / rows[1]['build']['cpu_s']:.2f}")
    bench_support.write_results(arguments.json, "build_time", rows)


if __name__ == "__main__":
    main()
