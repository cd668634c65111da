#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Calibrates the real line sensor of examples/etna_line_sensor, and the same frames with mistakes.

The data are not in the repository: SIGHTLINE_SHARED_DIR/data/real/etna_line_sensor. Without them nothing is measured.
With --diagnose, the pieces of the lines that calibrate writes are diagnosed, and the finding is printed.
With --mistakes, copies of the set with one mistake each are calibrated, too, and what was said is printed.
"""

import argparse
import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
import bench_support as bench  # noqa: E402

DATA = bench.SHARED / "data/real/etna_line_sensor"
SET = bench.SOURCE / "examples/etna_line_sensor/calibration_set.json"


def copy_set(folder, change=lambda set_file: None, poses=lambda texts: texts):
    """The frames as links, the poses and the set as they are changed."""
    folder.mkdir(parents=True)
    for file in DATA.iterdir():
        if file.suffix in (".png", ".yaml"):
            (folder / file.name).symlink_to(file)
    names = sorted(file.name for file in DATA.glob("pose*.txt"))
    for name, text in zip(names, poses([(DATA / name).read_text(encoding="utf-8") for name in names])):
        (folder / name).write_text(text, encoding="utf-8")
    set_file = json.loads(SET.read_text(encoding="utf-8"))
    change(set_file)
    (folder / "calibration_set.json").write_text(json.dumps(set_file), encoding="utf-8")


def calibrate(folder, out):
    run = subprocess.run([str(bench.SIGHTLINE), "calibrate", str(folder), "--out", str(out)],
                         capture_output=True, text=True, timeout=3600, check=False)
    if run.returncode != 0:
        return run.returncode, run.stderr.strip(), None
    return 0, run.stdout, json.loads((out / "calibration.json").read_text(encoding="utf-8"))


def diagnose(recordings, out):
    """The answer of sightline diagnose; a run that fails is one of finding and no more."""
    run = subprocess.run([str(bench.SIGHTLINE), "diagnose", str(recordings), "--out", str(out)],
                         capture_output=True, text=True, timeout=7200, check=False)
    if run.returncode != 0:
        return {"finding": f"exit code {run.returncode}: {run.stderr.strip()}", "warnings": []}
    answer = json.loads((out / "diagnosis_full.json").read_text(encoding="utf-8"))
    return {
        "finding": answer["finding"],
        "ranked": [{"effect": e["effect"], "probability": e["probability"],
                    "log_evidence": e.get("log_evidence")} for e in answer["ranked"][:6]],
        "same_class": answer.get("same_class", []),
        "warnings": answer.get("warnings", []),
    }


def print_diagnosis(answer):
    print(f"\ndiagnosis: {answer['finding']}")
    for explanation in answer.get("ranked", []):
        print(f"{explanation['probability']:>9.3f}  {explanation['effect']}")
    for line in answer["warnings"]:
        print("-", line)


def square(length_m):
    def change(set_file):
        set_file["checkerboard"]["square_m"] = length_m
    return change


def without_poses(set_file):
    del set_file["frames"]["poses"], set_file["frames"]["pose_layout"]


def exchanged(texts):
    return [texts[0], texts[5], *texts[2:5], texts[1], *texts[6:]]


MISTAKES = {
    "poses of frames 2 and 6 exchanged": {"poses": exchanged},
    "poses in reverse order": {"poses": lambda texts: texts[::-1]},
    "poses one frame late": {"poses": lambda texts: texts[-1:] + texts[:-1]},
    "squares 2 % too long": {"change": square(0.0102)},
    "squares 2 % too long, no poses": {"change": lambda s: (square(0.0102)(s), without_poses(s))},
}


def print_frames(result):
    print(f"{'frame':<16}{'real mm':>9}{'predicted mm':>14}{'ratio':>7}{'corners px':>12}")
    for frame in result["frames"]:
        if not frame["used"]:
            print(f"{frame['name']:<16}not used: {frame['because']}")
            continue
        print(f"{frame['name']:<16}{1e3 * frame['rms_m']:>9.3f}{1e3 * frame['predicted_rms_m']:>14.3f}"
              f"{frame['rms_m'] / frame['predicted_rms_m']:>7.2f}{frame['corner_rms_px']:>12.2f}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--json")
    parser.add_argument("--mistakes", action="store_true")
    parser.add_argument("--diagnose", action="store_true")
    args = parser.parse_args()
    if not DATA.is_dir():
        print(f"skipped: no data at {DATA}")
        return
    with tempfile.TemporaryDirectory() as temporary:
        folder = pathlib.Path(temporary)
        copy_set(folder / "set")
        code, text, result = calibrate(folder / "set", folder / "out")
        if code != 0:
            sys.exit(f"line_sensor: exit code {code}\n{text}")
        print_frames(result)
        ratio = result["real_over_predicted"]
        print(f"real over predicted {ratio['value']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})")
        for line in [*result["warnings"], *result["light"]["findings"], *result["light"]["not_determined"]]:
            print("-", line)
        result["frames_used"] = sum(frame["used"] for frame in result["frames"])
        result["frame_count"] = len(result["frames"])
        if args.diagnose:
            result["diagnosis"] = diagnose(folder / "out/recordings", folder / "diagnosis")
            print_diagnosis(result["diagnosis"])
        shutil.rmtree(folder / "out")
        for name, mistake in MISTAKES.items() if args.mistakes else ():
            copy_set(folder / name, **mistake)
            code, text, wrong = calibrate(folder / name, folder / "out")
            print(f"\n{name}: exit code {code}")
            print("\n".join(wrong["warnings"]) if wrong else text)
        bench.write_results(args.json, "line_sensor", result)


if __name__ == "__main__":
    main()
