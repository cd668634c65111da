#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs `sightline diagnose` over concealed sets; the program sees a set's folder only.

    run_concealed.py OUT ANSWERS [--limit N] [--jobs 1] [--sightline PATH] [--timeout 600]

Answers that exist are kept, so that it can be stopped and started again. Writes
ANSWERS/<set>.json (diagnosis.json, with diagnosis_full.json as "full" and the time in "seconds"),
ANSWERS/leave_one_out/<set>.json for the sets of OUT/leave_one_out.json, and ANSWERS/times.json.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import time

SOURCE = pathlib.Path(__file__).resolve().parent.parent.parent
BIN = pathlib.Path(os.environ.get("SIGHTLINE_BIN_DIR", SOURCE / "build/release/bin"))


def write_json(path, document):
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".part")
    temporary.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    os.replace(temporary, path)


def read_json(path):
    return json.loads(path.read_text(encoding="utf-8"))


def diagnose(sightline, folder, excluded, timeout_s, more):
    """The answer, or what went wrong as {"failed": ...}; with "seconds" in both cases."""
    with tempfile.TemporaryDirectory(prefix="concealed-") as out:
        command = [str(sightline), "diagnose", str(folder), "--out", out, *more]
        for effect in excluded:
            command += ["--exclude", effect]
        start = time.monotonic()
        answer = {"set": folder.name}
        try:
            done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s,
                                  check=False)
            if done.returncode != 0:
                answer["failed"] = f"exit code {done.returncode}: {done.stderr.strip()[-500:]}"
            else:
                answer = read_json(pathlib.Path(out) / "diagnosis.json")
                answer["full"] = read_json(pathlib.Path(out) / "diagnosis_full.json")
                # Pictures of the report are large, and nothing is scored by them.
                for key in ("profiles", "region_maps", "calibrated"):
                    answer["full"].pop(key, None)
        except subprocess.TimeoutExpired:
            answer["failed"] = f"not done within {timeout_s:g} s"
        except (OSError, ValueError) as error:
            answer["failed"] = str(error)
        answer["seconds"] = round(time.monotonic() - start, 3)
        if excluded:
            answer["excluded"] = list(excluded)
        return answer


def main(arguments=None):
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("out", metavar="OUT", type=pathlib.Path)
    parser.add_argument("answers", metavar="ANSWERS", type=pathlib.Path)
    parser.add_argument("--limit", type=int, help="at most this many runs, existing answers apart")
    parser.add_argument("--jobs", type=int, default=1, help="sets at once; default 1")
    parser.add_argument("--sightline", type=pathlib.Path, default=BIN / "sightline")
    parser.add_argument("--timeout", type=float, default=600, help="s for a set; default 600")
    parser.add_argument("--no-leave-one-out", action="store_true")
    parser.add_argument("--option", action="append", default=[],
                        help="passed on to `sightline diagnose`; e.g. --option=--seed=2")
    options = parser.parse_args(arguments)
    if not options.sightline.is_file():
        sys.exit(f"run_concealed: {options.sightline}: no such program; give --sightline")
    folders = sorted(p.parent for p in (options.out / "sets").glob("*/recordings.json"))
    if not folders:
        sys.exit(f"run_concealed: {options.out}/sets: no sets there")
    tasks = [(options.answers / f"{folder.name}.json", folder, []) for folder in folders]
    again = options.out / "leave_one_out.json"
    if again.is_file() and not options.no_leave_one_out:
        for case in read_json(again):
            tasks.append((options.answers / "leave_one_out" / f"{case['set']}.json",
                          options.out / "sets" / case["set"], case["exclude"]))
    tasks = [task for task in tasks if not task[0].exists()]
    if options.limit is not None:
        tasks = tasks[: options.limit]

    def run(task):
        path, folder, excluded = task
        answer = diagnose(options.sightline, folder, excluded, options.timeout, options.option)
        write_json(path, answer)
        return task, answer

    with concurrent.futures.ThreadPoolExecutor(max_workers=max(1, options.jobs)) as pool:
        for k, (task, answer) in enumerate(pool.map(run, tasks)):
            what = "again without its effect, " if task[2] else ""
            # The answer is not printed: it would reveal something about the truth.
            print(f"{k + 1} of {len(tasks)}: {task[1].name}, {what}{answer['seconds']:.1f} s"
                  + (f", FAILED: {answer['failed']}" if "failed" in answer else ""), flush=True)
    times = {}
    for path in sorted(options.answers.glob("**/set_*.json")):
        times[str(path.relative_to(options.answers))] = read_json(path).get("seconds")
    write_json(options.answers / "times.json", times)


if __name__ == "__main__":
    main()
