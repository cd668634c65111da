# SPDX-License-Identifier: Apache-2.0
"""Feeds bad input to `sightline render` and the real render worker and shows what they answer."""

import argparse
import copy
import json
import os
import pathlib
import re
import signal
import sys
import tempfile
import time

import bench_support as bench
from bad_input import children, finish, run, start, wait_for


SENSOR = {
    "sensor_type": "mono", "pixel_pitch_m": 5.3e-6, "sensor_columns_px": 96, "sensor_rows_px": 64,
    "bit_depth_bit": 10, "quantum_efficiency": {"mono": 0.53}, "gain_dn_per_electron": 0.16,
    "saturation_capacity_electrons": 9893, "dark_mean_electrons": 27.57, "dark_noise_electrons": 6.5,
    "dark_current_electrons_per_s": 0}

INSPECTION = {
    "name": "table",
    "part": {"file": "table.obj", "unit": "m"},
    "camera": {"sensor": SENSOR},
    "lens": {"focal_length_m": 0.016, "f_number": 16},
    "laser": {"power_w": 0.005, "fan_angle_deg": 40},
    "materials": [{"material": {"name": "grey", "lambert": {"diffuse_albedo": 0.5}}}],
    "render": {"exposure_time_s": 0.005},
}

MEASUREMENT = "0.3,30,0,0,0,0,0,0,0"

RECORDING = {
    "file": "images/000.png", "kind": "laser", "timestamp_s": 50, "series": "test",
    "plate_position_id": 1, "same_speckle": False, "burst_frame_index": 0, "exposure_time_s": 0.002,
    "f_number": 16, "camera_distance_m": 0.331, "focus_distance_m": 0.331, "laser_distance_m": 0.416,
    "line_offset_m": 0, "roi_column_px": -48, "roi_row_px": -32, "roi_columns_px": 96,
    "roi_rows_px": 64, "repeat_group": 0}

RECORDINGS = {
    "format": "laser-line-recordings", "format_version": 1, "set": "test", "camera": SENSOR,
    "lens": {"focal_length_m": 0.016, "transmission": 0.92},
    "laser": {"wavelength_m": 661e-9, "power_w": 0.00058, "divergence_rad": 0.00105,
              "beam_focus_distance_m": 0.44, "fan_angle_deg": 36.8},
    "surface": {"diffuse_albedo": 0.35, "specular_f0": 0.66, "ggx_alpha": 0.43},
    "rig": {"incidence_angle_deg": 45},
    "recordings": [RECORDING],
}

DELETE = object()


def changed(document, changes):
    """A copy with {"a.0.b": value}; DELETE takes the member away."""
    document = copy.deepcopy(document)
    for path, value in changes.items():
        *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
        place = document
        for key in parents:
            place = place[key] if isinstance(place, list) else place.setdefault(key, {})
        if value is DELETE:
            del place[last]
        else:
            place[last] = value
    return document


class Cases:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.rows = []
        self.count = 0
        (self.folder / "table.obj").write_text(
            "v -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
        (self.folder / "broken.obj").write_text("v 0 0\nf 1 2 3\n", encoding="utf-8")
        (self.folder / "empty.obj").write_text("", encoding="utf-8")
        (self.folder / "broken.csv").write_text("wavelength_nm,n,k\n600,x,7\n", encoding="utf-8")
        (self.folder / "text.png").write_text("this is no image", encoding="utf-8")

    def write(self, content):
        self.count += 1
        path = self.folder / f"input{self.count}.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return path

    def command(self, content, *options):
        source = self.write(content)
        return [bench.SIGHTLINE, "render", source, "--out", self.folder / f"out{self.count}", *options]

    @staticmethod
    def leftovers(command):
        """Half-written files, or a recordings.json that promises images that are not there."""
        out = pathlib.Path(command[4])
        if not out.exists():
            return ""
        files = [str(p.relative_to(out)) for p in out.rglob("*") if p.is_file()]
        partial = [f for f in files if ".part-" in f or ".tmp" in f]
        if partial:
            return f"half-written: {partial}"
        broken = [f for f in files if f.endswith(".png")
                  and not (out / f).read_bytes().endswith(b"IEND\xaeB`\x82")]
        if broken:
            return f"cut off: {broken}"
        return "recordings.json was written" if "recordings.json" in files else ""

    def add(self, name, command, outcome, code, pattern, extra="", note=""):
        problems = []
        if outcome.hung:
            problems.append("hangs")
        elif outcome.code != code:
            problems.append(f"expected exit code {code}")
        if pattern and not re.search(pattern, outcome.text, re.IGNORECASE | re.DOTALL):
            problems.append(f"message does not say /{pattern}/")
        if code != 0:
            extra = extra or self.leftovers(command)
        if extra:
            problems.append(extra)
        message = note if note and not problems else outcome.message()
        message = message.replace(str(self.folder) + "/", "")
        self.rows.append({"input": name, "exit_code": outcome.code, "seconds": round(outcome.seconds, 2),
                          "message": message, "problems": problems})
        mark = "ok  " if not problems else "FAIL"
        print(f"{mark} {name:<46}{outcome.code:>5}{outcome.seconds:>8.1f}  {message[:170]}", flush=True)
        for problem in problems:
            print(f"     -> {problem}")

    def part(self, name, changes, pattern, *options, code=2):
        if "--measurement" not in options:
            options = ("--measurement", MEASUREMENT, *options)
        command = self.command(changed(INSPECTION, changes), *options)
        self.add(name, command, run(command), code, pattern)

    def plate(self, name, changes, pattern, *options, code=2):
        command = self.command(changed(RECORDINGS, changes), *options)
        self.add(name, command, run(command), code, pattern)

    def good(self):
        command = self.command(INSPECTION, "--measurement", MEASUREMENT, "--layers")
        self.add("nothing wrong: a part", command, run(command), 0, "3 files", note="3 files")
        command = self.command(RECORDINGS)
        self.add("nothing wrong: a plate", command, run(command), 0, "2 files", note="2 files")

    def cameras(self):
        self.part("camera without a sensor", {"camera": {}}, "camera.sensor_file is missing")
        self.part("camera file missing", {"camera": {"sensor_file": "none.json"}}, "none.json")
        sensor = "camera.sensor"
        self.part("gain 0", {f"{sensor}.gain_dn_per_electron": 0}, "gain_dn_per_electron is 0")
        self.part("quantum efficiency 1.1", {f"{sensor}.quantum_efficiency.mono": 1.1},
                  r"quantum_efficiency.mono is 1.1, must be in \[0, 1\]")
        self.part("quantum efficiency missing", {f"{sensor}.quantum_efficiency": DELETE}, "quantum_efficiency")
        self.part("17 bits", {f"{sensor}.bit_depth_bit": 17}, "bit_depth_bit is 17")
        self.part("colour sensor with mono efficiency", {f"{sensor}.sensor_type": "bayer_rggb"},
                  "quantum_efficiency")
        self.part("gain misspelt", {f"{sensor}.gain_dn_per_elektron": 1}, "nearest known name")
        self.part("no lens", {"lens": DELETE}, "lens is missing")
        self.part("field of view against sensor and lens", {"camera.vertical_fov_deg": 45}, "agree within 10 %")
        self.part("focused nearer than the focal length", {"lens.focus_distance_m": 0.01},
                  "lens.focus_distance_m is 0.01")

    def materials(self):
        self.part("no materials", {"materials": []}, "materials is missing")
        self.part("material without data", {"materials.0.material": {"name": "grey"}}, "grey")
        self.part("material file missing", {"materials": [{"file": "none.json"}]}, "none.json")
        self.part("albedo 1.2", {"materials.0.material.lambert.diffuse_albedo": 1.2}, "diffuse_albedo is 1.2")
        table = {"name": "steel", "conductor": {"refractive_index_file": "none.csv", "ggx_alpha_x": 0.2,
                                                "ggx_alpha_y": 0.2}}
        self.part("table of a material missing", {"materials.0.material": table}, "none.csv")
        self.part("table of a material broken",
                  {"materials.0.material": changed(table, {"conductor.refractive_index_file": "broken.csv"})},
                  "broken.csv")
        height = {"file": "none.png", "sample_pitch_m": 1e-5}
        self.part("texture missing", {"materials.0.material.height_field": height}, "none.png")
        self.part("texture is no image",
                  {"materials.0.material.height_field": changed(height, {"file": "text.png"})}, "text.png")
        self.part("material for a surface that is not there", {"materials.0.part_material": "gold"}, "gold")

    def parts(self):
        self.part("part missing", {"part.file": "none.obj"}, "none.obj")
        self.part("part broken", {"part.file": "broken.obj"}, "broken.obj")
        self.part("part empty", {"part.file": "empty.obj"}, "empty.obj")
        self.part("obstacle missing", {"obstacles": [
            {"name": "clamp", "file": "clamp.obj", "unit": "m", "frame": "FRAME_PART"}]}, "clamp.obj")
        self.part("lamp without radiance", {"lighting": {"ambient": {}}}, "radiance_w_m2_sr is missing")
        self.part("lamp of unknown spectrum", {"lighting": {"ambient": {
            "radiance_w_m2_sr": 1, "spectrum": {"illuminant": "d66"}}}}, "d66")
        self.part("effect misspelt", {"effects": [{"effect": "optics.veiling_glre"}]},
                  "veiling_glre.*veiling_glare")
        self.part("effect that only plates have",
                  {"effects": [{"effect": "surface.albedo_error", "parameters": {"amplitude_factor": 1.1}}]},
                  "surface.albedo_error")
        self.part("exposure time 0", {"render.exposure_time_s": 0}, "exposure_time_s is 0")
        self.part("measurement outside Table 2.1", {}, "camera_distance_m is 9", "--measurement",
                  "9,30,0,0,0,0,0,0,0")
        command = self.command(INSPECTION)
        self.add("measurement left open", command, run(command), 2, "does not fix.*--plan")
        self.part("--scan without a plan", {}, "--scan needs a plan", "--scan", "3")
        self.part("plan missing", {}, "exclude", "--plan", "none.json")
        command = self.command(INSPECTION, "--plan", self.folder / "none.json")
        self.add("plan file missing", command, run(command), 2, "none.json")

    def sizes(self):
        huge = {"camera.sensor.sensor_columns_px": 16384, "camera.sensor.sensor_rows_px": 16384,
                "camera.sensor.pixel_pitch_m": 1e-6, "lens.f_number": 1.4, "lens.focal_length_m": 0.016}
        self.part("an image of hundreds of GB", huge, r"16384 x 16384 px.*GiB.*limit is 8.0 GiB")
        self.plate("a plate image of hundreds of GB", {
            "camera.sensor_columns_px": 65536, "camera.sensor_rows_px": 65536,
            "recordings.0.roi_column_px": -32768, "recordings.0.roi_row_px": -32768,
            "recordings.0.roi_columns_px": 65536, "recordings.0.roi_rows_px": 65536}, "65536 x 65536 px.*GiB")

    def plates(self):
        self.plate("recordings: unknown field", {"cammera": {}}, "cammera.*nearest known name")
        self.plate("recordings: field missing", {"laser.power_w": DELETE}, "laser.power_w is missing")
        self.plate("recordings: region outside the sensor", {"recordings.0.roi_column_px": 40},
                   r"recordings\[0\].roi_column_px")
        self.plate("recordings: file outside the folder", {"recordings.0.file": "../../x.png"},
                   "must stay in the set's folder")
        self.plate("recordings: --scan", {}, "--scan is for parts", "--scan", "1")
        command = self.command("{ not json")
        self.add("no JSON", command, run(command), 2, "line 1")
        command = [bench.SIGHTLINE, "render", self.folder / "none.json", "--out", self.folder / "out"]
        self.add("input missing", command, run(command), 2, "none.json")
        command = self.command(RECORDINGS, "--render-worker", f"unix:{self.folder}/nobody")
        self.add("no worker there", command, run(command), 1, "nobody")
        command = self.command(RECORDINGS)
        (self.folder / "file").write_text("", encoding="utf-8")
        command[4] = self.folder / "file" / "out"
        self.add("folder cannot be made", command, run(command), 2, "cannot make folder")

    def long_command(self):
        """Many images: time to interfere."""
        recordings = changed(RECORDINGS, {})
        recordings["recordings"] = [
            {**RECORDING, "file": f"images/{i:04}.png", "timestamp_s": i, "plate_position_id": i}
            for i in range(3000)]
        return self.command(recordings)

    def killed(self):
        command = self.long_command()
        out = pathlib.Path(command[4])
        began = time.monotonic()
        process = start(command)
        wait_for(lambda: (out / "images").exists() and len(list((out / "images").iterdir())) > 3)
        worker = wait_for(lambda: children(process.pid, "render_worker"))
        os.kill(worker[0], signal.SIGKILL)
        outcome = finish(process, 60, began)
        kept = len(list((out / "images").glob("*.png")))
        self.add("worker killed (-9) mid-image", command, outcome, 1, "killed by signal 9",
                 note=f"says so; {kept} finished images are kept, no recordings.json")
        command = self.long_command()
        out = pathlib.Path(command[4])
        began = time.monotonic()
        process = start(command)
        wait_for(lambda: (out / "images").exists() and len(list((out / "images").iterdir())) > 3)
        process.send_signal(signal.SIGINT)
        sent = time.monotonic()
        outcome = finish(process, 60, began)
        took = time.monotonic() - sent
        self.add("Ctrl-C mid-image", command, outcome, 130, "interrupted",
                 "" if took < 2 else f"took {took:.1f} s", note=f"ends {took:.2f} s later")

    def late_trouble(self):
        """The worker's memory limit stops what only the margin of the grid makes too large."""
        command = self.command(INSPECTION, "--measurement", MEASUREMENT, "--max-image-bytes", "100KB")
        self.add("worker's own memory limit", command, run(command), 2, "KiB.*max-image-bytes")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    args = parser.parse_args()
    bench.print_machine()
    print(f"     {'input':<46}{'exit':>5}{'s':>8}  message")
    with tempfile.TemporaryDirectory(prefix="sightline-bad-render-input-") as folder:
        cases = Cases(folder)
        cases.good()
        cases.cameras()
        cases.materials()
        cases.parts()
        cases.sizes()
        cases.plates()
        cases.late_trouble()
        cases.killed()
    bench.write_results(args.json, "bad_render_input", cases.rows)
    failed = [row["input"] for row in cases.rows if row["problems"]]
    if failed:
        print(f"{len(failed)} of {len(cases.rows)} not as expected: {', '.join(failed)}", file=sys.stderr)
        sys.exit(1)
    print(f"all {len(cases.rows)} as expected")


if __name__ == "__main__":
    main()
