# SPDX-License-Identifier: Apache-2.0
"""Feeds bad input to the real programs and shows what they answer."""

import argparse
import concurrent.futures
import json
import math
import os
import pathlib
import re
import signal
import struct
import subprocess
import sys
import tempfile
import time

import bench_support as bench

GIB = 1 << 30
HEAD_PLAN = ["--goal", "0.9", "--bound-evaluations", "0", "--no-pictures", "--no-point-clouds"]

# ---------------------------------------------------------------------------------------------
# Parts and inspections


def box_triangles(x, y, z):
    """A closed box, outward normals."""
    corner = [(i & 1) * x * 1.0 for i in range(8)], [(i >> 1 & 1) * y * 1.0 for i in range(8)], [
        (i >> 2) * z * 1.0 for i in range(8)]
    quads = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    point = lambda i: [corner[0][i], corner[1][i], corner[2][i]]
    return [point(q[0]) + point(q[i]) + point(q[i + 1]) for q in quads for i in (1, 2)]


def read_glb(path):
    data = pathlib.Path(path).read_bytes()
    json_bytes, _ = struct.unpack_from("<II", data, 12)
    document = json.loads(data[20:20 + json_bytes])
    return document, bytearray(data[20 + json_bytes + 8:])


def write_glb(path, document, binary=b""):
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if binary:
        chunks += struct.pack("<II", len(binary), 0x004E4942) + bytes(binary)
    pathlib.Path(path).write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def glb_with_nan(source, path):
    document, binary = read_glb(source)
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]]
    view = document["bufferViews"][accessor["bufferView"]]
    offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    struct.pack_into("<f", binary, offset + 12 * 100 + 4, math.nan)
    write_glb(path, document, binary)


# ---------------------------------------------------------------------------------------------
# Running programs


class Outcome:
    def __init__(self, code, text, seconds, hung=False):
        self.code, self.text, self.seconds, self.hung = code, text, seconds, hung

    def message(self):
        lines = [line.strip() for line in self.text.splitlines() if line.strip()]
        lines = [line for line in lines if not line.startswith("Run with --help")]
        own = [line for line in lines if line.startswith("sightline:")]
        return own[-1].removeprefix("sightline: ") if own else (lines[-1] if lines else "")


def start(command):
    return subprocess.Popen(
        [str(c) for c in command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True)


def finish(process, timeout_s, began, text=""):
    try:
        out, err = process.communicate(timeout=timeout_s)
        return Outcome(process.returncode, text + out + err, time.monotonic() - began)
    except subprocess.TimeoutExpired:
        process.kill()
        out, err = process.communicate()
        return Outcome(process.returncode, text + out + err, time.monotonic() - began, hung=True)


def run(command, timeout_s=60):
    began = time.monotonic()
    return finish(start(command), timeout_s, began)


def read_until(process, pattern):
    """What stderr said up to the line that matches; None if it ended before."""
    text = ""
    for line in process.stderr:
        text += line
        if re.search(pattern, line):
            return text
    return None


def children(pid, word, without=None):
    found = []
    for task in pathlib.Path(f"/proc/{pid}/task").glob("*/children"):
        try:
            pids = task.read_text().split()
        except OSError:
            continue
        for child in pids:
            try:
                line = pathlib.Path(f"/proc/{child}/cmdline").read_bytes().decode().replace("\0", " ")
            except OSError:
                continue
            if word in line and not (without and without in line):
                found.append(int(child))
    return found


def wait_for(condition, timeout_s=30):
    end = time.monotonic() + timeout_s
    while time.monotonic() < end:
        value = condition()
        if value:
            return value
        time.sleep(0.02)
    return None


class Server:
    def __init__(self, folder, *options):
        self.process = subprocess.Popen(
            [str(bench.SERVER), "--listen", f"unix:{folder}/server.sock", "--log-level", "error", *options],
            stdout=subprocess.PIPE, text=True, start_new_session=True)
        line = self.process.stdout.readline().strip()
        self.address = line.removeprefix("listening on ")

    def peak_mib(self):
        status = pathlib.Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+) kB", status).group(1)) / 1024

    def stop(self):
        self.process.terminate()
        try:
            self.process.wait(timeout=40)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return self.process.returncode


# ---------------------------------------------------------------------------------------------


class Cases:
    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.rows = []
        self.head = bench.SOURCE / "examples/cylinder_head/cylinder_head.glb"
        self.head_inspection = bench.SOURCE / "examples/cylinder_head/inspection.json"
        bench.write_binary_stl(self.folder / "box.stl", box_triangles(100, 60, 40))
        self.box_inspection = self.inspection("box", {"part": {"file": "box.stl", "unit": "mm"}})

    def inspection(self, name, content):
        path = self.folder / f"{name}.json"
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return path

    def plan_command(self, inspection, *options):
        out = self.folder / "out" / re.sub(r"\W", "_", f"{pathlib.Path(inspection).stem}{len(self.rows)}")
        return [bench.SIGHTLINE, "plan", inspection, "--out", out, *options]

    def add(self, name, outcome, code, pattern, extra_error="", note=""):
        problems = []
        if outcome.hung:
            problems.append("hangs")
        elif outcome.code != code:
            problems.append(f"expected exit code {code}")
        if pattern and not re.search(pattern, outcome.text, re.IGNORECASE | re.DOTALL):
            problems.append(f"message does not say /{pattern}/")
        # A check of what was written, made only if the program did its work.
        if callable(extra_error):
            extra_error = "" if problems else extra_error()
        if extra_error:
            problems.append(extra_error)
        message = note if note and not problems else outcome.message()
        message = message.replace(str(self.folder) + "/", "").replace(str(bench.SOURCE) + "/", "")
        self.rows.append({
            "input": name, "exit_code": outcome.code, "seconds": round(outcome.seconds, 2),
            "message": message, "problems": problems})
        mark = "ok  " if not problems else "FAIL"
        print(f"{mark} {name:<50}{outcome.code:>5}{outcome.seconds:>8.1f}  {message[:150]}", flush=True)
        for problem in problems:
            print(f"     -> {problem}")

    def wrong_plan(self, name, inspection, pattern, *options):
        self.add(name, run(self.plan_command(inspection, *options)), 2, pattern)

    # -- files ----------------------------------------------------------------------------------

    def files(self):
        folder = self.folder
        glb = self.head.read_bytes()
        (folder / "half.glb").write_bytes(glb[:len(glb) // 2])
        self.wrong_plan("truncated GLB", self.inspection("half", {"part": {"file": "half.glb"}}),
                        r"half\.glb.*(truncat|size|length|bytes)")
        glb_with_nan(self.head, folder / "nan.glb")
        self.wrong_plan("NaN vertex in GLB", self.inspection("nan", {"part": {"file": "nan.glb"}}),
                        r"nan\.glb.*(nan|finite)")
        triangles = box_triangles(100, 60, 40)
        triangles[3][4] = math.nan
        bench.write_binary_stl(folder / "nan.stl", triangles)
        self.wrong_plan("NaN vertex in STL",
                        self.inspection("nan_stl", {"part": {"file": "nan.stl", "unit": "mm"}}),
                        r"nan\.stl.*(nan|finite)")
        bench.write_binary_stl(folder / "empty.stl", [])
        self.wrong_plan("0 triangles, STL",
                        self.inspection("empty", {"part": {"file": "empty.stl", "unit": "mm"}}),
                        r"empty\.stl.*no triangles")
        write_glb(folder / "empty.glb", {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{}]})
        self.wrong_plan("0 triangles, GLB", self.inspection("empty_glb", {"part": {"file": "empty.glb"}}),
                        r"empty\.glb.*no (triangles|meshes)")
        self.wrong_plan("millimetres read as metres",
                        self.inspection("metres", {"part": {"file": "box.stl", "unit": "m"}}),
                        r"looks like millimetres read as metres")
        self.wrong_plan("STL without unit", self.inspection("unitless", {"part": {"file": "box.stl"}}),
                        r"unit")
        self.wrong_plan("unknown unit",
                        self.inspection("furlong", {"part": {"file": "box.stl", "unit": "furlong"}}),
                        r"furlong")
        self.wrong_plan("part file missing",
                        self.inspection("missing", {"part": {"file": "nowhere.glb"}}), r"nowhere\.glb")
        self.wrong_plan("inspection missing", folder / "nowhere.json", r"nowhere\.json")
        with open(folder / "huge.stl", "wb") as file:
            file.truncate(3 * GIB)
        self.wrong_plan("STL of 3 GiB of zeros",
                        self.inspection("huge", {"part": {"file": "huge.stl", "unit": "mm"}}),
                        r"huge\.stl")
        (folder / "huge.stl").unlink()

    # -- files of other makers ------------------------------------------------------------------

    def other_makers(self):
        """Files that say something else than a hasty reader takes from them."""
        folder = self.folder

        def part(name, pattern, unit="mm"):
            source = {"file": name} if unit is None else {"file": name, "unit": unit}
            self.wrong_plan(name, self.inspection(name.replace(".", "_"), {"part": source}), pattern)

        far = [[c + 400_000 for c in triangle] for triangle in box_triangles(100, 60, 40)]
        bench.write_binary_stl(folder / "far.stl", far)
        part("far.stl", r"from the origin of its file.*um")
        header = "ply\nformat ascii 1.0\nelement vertex 3\n" + "".join(f"property float {c}\n" for c in "xyz")
        header += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        (folder / "more_points.ply").write_text(
            header + "0 0 0\n90 0 0\n0 90 0\n3 0 1 2\n3 0 1 2\n", encoding="utf-8")
        part("more_points.ply", r"more_points\.ply")
        document, binary = read_glb(self.head)
        node = next(node for node in document["nodes"] if "mesh" in node)
        node["extensions"] = {"ACME_bends_surfaces": {}}
        document["extensionsUsed"] = ["ACME_bends_surfaces"]
        write_glb(folder / "extension.glb", document, binary)
        part("extension.glb", r"ACME_bends_surfaces", None)
        (folder / "no_area.obj").write_text("v 0 0 0\nv 10 0 0\nv 20 0 0\nf 1 2 3\n", encoding="utf-8")
        part("no_area.obj", r"no (triangles with area|surface)")
        plan = folder / "other_plan.json"
        plan.write_text(json.dumps({"part_digest": "2:" + 64 * "0", "scans": [{"measurement": {
            "camera_distance_m": 0.4, "triangulation_angle_deg": 30}}]}), encoding="utf-8")
        self.add("plan of another part", run([bench.SIGHTLINE, "evaluate", self.box_inspection, plan,
                                              "--out", folder / "other_out", "--no-pictures"]),
                 2, r"another part.*--other-part")

    def numbers(self):
        """Numbers that a program could read otherwise than its user."""
        for option, value in [("--seed", "010"), ("--seed", "0x8"), ("--seed", "1e3"), ("--seed", str(2 ** 64 + 1)),
                              ("--seed", "nan"), ("--goal", "nan"), ("--goal", "inf")]:
            self.wrong_plan(f"{option} {value}", self.box_inspection, option, option, value)

    # -- inspection.json ------------------------------------------------------------------------

    def inspections(self):
        box = {"file": "box.stl", "unit": "mm"}
        self.wrong_plan("misspelt field", self.inspection("misspelt", {"part": box, "rig": {"scan_setp_m": 0.001}}),
                        r"rig\.scan_setp_m.*scan_step_m")
        self.wrong_plan("not JSON", self.inspection("broken", '{"part": {"file": "box.stl",}'), r"broken\.json")
        self.wrong_plan("camera distance beyond its bounds",
                        self.inspection("bounds", {"part": box, "measurement": {
                            "camera_distance_m": {"ranges": [{"min": 0.05, "max": 2}]}}}),
                        r"camera_distance_m.*0\.1.*0\.8")
        self.wrong_plan("scan step negative", self.inspection("step", {"part": box, "rig": {"scan_step_m": -1}}),
                        r"rig\.scan_step_m.*-1")
        self.wrong_plan("--goal 1.5", self.box_inspection, r"goal", "--goal", "1.5")
        self.wrong_plan("--strategy gredy-pso", self.box_inspection, r"greedy-pso", "--strategy", "gredy-pso")
        self.add("no server at the address given",
                 run(self.plan_command(self.box_inspection, "--coverage-server", f"unix:{self.folder}/none.sock")),
                 1, r"none\.sock")
        hand = self.folder / "hand.json"
        hand.write_text(json.dumps({"scans": [{"measurement": {
            "camera_distance_m": 0.4, "triangulation_angle_deg": 5}}]}), encoding="utf-8")
        outcome = run([bench.SIGHTLINE, "evaluate", self.box_inspection, hand, "--out", self.folder / "hand_out",
                       "--no-pictures"])
        self.add("evaluate: triangulation angle of 5 degrees", outcome, outcome.code if outcome.code in (0, 2) else 2,
                 r"out of bounds|triangulation_angle_deg", note=next(
                     (line for line in outcome.text.splitlines() if "bounds" in line), outcome.message()))

    # -- uncertainty and tolerances ----------------------------------------------------------------

    def uncertainty(self):
        def task(name, tolerances, uncertainty=None):
            return self.inspection(name, {
                "part": {"file": "box.stl", "unit": "mm"}, "uncertainty": uncertainty or {},
                "tolerances": tolerances, "goal": {"admissible": 0.8}})
        zone = {"zone_width_m": 0.0002}
        self.wrong_plan("tolerance of 0", task("zone0", {"zone_width_m": 0}), r"tolerances\.zone_width_m is 0")
        self.wrong_plan("tolerance wider than the part", task("zone_wide", {"zone_width_m": 0.9}),
                        r"zone_width_m is 0\.9 m, must be below the part's size")
        began = time.monotonic()
        self.wrong_plan("tolerance finer than any scan can reach", task("zone_fine", {"zone_width_m": 1e-7}),
                        r"out of reach of this rig")
        if time.monotonic() - began > 5:
            self.rows[-1]["problems"].append("not said at once")
        self.wrong_plan("detection noise of -0.2 px",
                        task("noise", zone, {"line_detection": {"standard_deviation_px": -0.2}}),
                        r"standard_deviation_px is -0\.2")
        covariance = [1e-6 if i % 13 == 0 else 0 for i in range(144)]
        covariance[1] = covariance[12] = 5e-6
        self.wrong_plan("covariance that is not positive",
                        task("covariance", zone, {"calibration": {"covariance": covariance}}),
                        r"calibration\.covariance")
        (self.folder / "broken.qif").write_text(
            '<QIFDocument xmlns="http://qifstandards.org/xsd/qif3" versionQIF="3.0.0"><Characteristics></QIFDocument>',
            encoding="utf-8")
        self.wrong_plan("QIF that is not well formed", task("qif", {"file": "broken.qif"}), r"broken\.qif:1")
        self.wrong_plan("tolerances of a file that is missing", task("nofile", {"file": "nowhere.stp"}),
                        r"nowhere\.stp")
        self.wrong_plan("STEP without tolerances",
                        task("no_pmi", {"file": str(self.head.with_suffix(".step"))}),
                        r"cylinder_head\.step: holds no tolerance")
        self.wrong_plan("goal of uncertainty without tolerances",
                        self.inspection("none", {"part": {"file": "box.stl", "unit": "mm"}, "uncertainty": {},
                                                 "goal": {"admissible": 0.8}}),
                        r"tolerances is missing")
        self.wrong_plan("material that the part has not",
                        task("material", {"regions": [{"name": "a", "zone_width_m": 1e-4, "materials": ["gold"]}]}),
                        r"no material \"gold\"")

    # -- servers --------------------------------------------------------------------------------

    def uploads(self):
        server = Server(self.folder)
        upload = [bench.BIN / "bench_upload", server.address]
        refused = run([*upload, "--announce-bytes", 3 * GIB, "--send-bytes", 3 * GIB])
        # By the clock of the call.
        after = re.search(r"after ([\d.]+) s", refused.text)
        late = "" if after and float(after.group(1)) < 2 else "not refused at once"
        self.add("upload of 3 GiB to a server", refused, 2, r"code 8: .*limit|code 8: .*largest|code 8: .*bytes", late)
        refused = run([*upload, "--announce-bytes", 1 << 20, "--send-bytes", 3 * GIB])
        self.add("upload announces 1 MiB, sends 3 GiB", refused, 2, r"code (3|8): ")
        refused = run([*upload, "--announce-bytes", 1 << 20, "--send-bytes", 1 << 20])
        self.add("upload of 1 MiB of zeros as STL", refused, 2, r"code 3: ")
        peak = server.peak_mib()
        self.add("the same server afterwards plans a box",
                 run(self.plan_command(self.box_inspection, "--coverage-server", server.address, *HEAD_PLAN), 120), 0,
                 r"cold start to plan", "" if peak < 1024 else f"server peaked at {peak:.0f} MiB",
                 f"plan made; server peaked at {peak:.0f} MiB by the uploads")
        code = server.stop()
        if code != 0:
            self.rows[-1]["problems"].append(f"server ended with {code}")

    def reference(self):
        """An undisturbed plan of the head; its bytes."""
        command = self.plan_command(self.head_inspection, *HEAD_PLAN)
        outcome = run(command, 600)
        self.add("undisturbed plan, for comparison", outcome, 0, r"cold start to plan", note="plan made")
        return (pathlib.Path(command[4]) / "plan.json").read_bytes()

    def killed_server(self, reference):
        # While the scene is built.
        command = self.plan_command(self.head_inspection, *HEAD_PLAN)
        began = time.monotonic()
        process = start(command)
        pids = wait_for(lambda: children(process.pid, "coverage_server"))
        time.sleep(2)
        os.kill(pids[0], signal.SIGKILL)
        self.add("server killed (-9) while it builds the scene", finish(process, 600, began), 0,
                 r"killed by signal 9.*restarted", self.differs(command, reference), "says so, restarts it, same plan")

        # A worker process of the server.
        command = self.plan_command(self.head_inspection, *HEAD_PLAN)
        began = time.monotonic()
        process = start(command)
        pids = wait_for(lambda: children(process.pid, "coverage_server"))
        workers = wait_for(lambda: children(pids[0], "--field-worker"))
        time.sleep(1)
        os.kill(workers[0], signal.SIGKILL)
        self.add("worker of the server killed (-9)", finish(process, 600, began), 0, r"cold start to plan",
                 self.differs(command, reference), "the server replaces it, same plan")

        # While the plan is made, once and twice.
        for kills in (1, 2):
            command = self.plan_command(self.head_inspection, *HEAD_PLAN)
            began = time.monotonic()
            process = start(command)
            text = read_until(process, r"ready after") or ""
            killed = set()
            for _ in range(kills):
                time.sleep(1.5)
                pids = wait_for(lambda: [p for p in children(process.pid, "coverage_server") if p not in killed]
                                or process.poll() is not None)
                if not isinstance(pids, list):
                    break
                os.kill(pids[0], signal.SIGKILL)
                killed.add(pids[0])
            outcome = finish(process, 600, began, text)
            if kills == 1:
                self.add("server killed (-9) mid-plan", outcome, 0, r"killed by signal 9.*restarted",
                         self.differs(command, reference), "says so, restarts it, same plan")
            else:
                self.add("server killed (-9) mid-plan twice", outcome, 1,
                         r"killed by signal 9.*restarted once before")

    @staticmethod
    def differs(command, reference):
        """A check that the command made the same plan."""
        return lambda: "" if (pathlib.Path(command[4]) / "plan.json").read_bytes() == reference else "another plan"

    def interrupted(self):
        command = self.plan_command(self.head_inspection, *HEAD_PLAN)
        began = time.monotonic()
        process = start(command)
        wait_for(lambda: children(process.pid, "coverage_server"))
        time.sleep(2)
        process.send_signal(signal.SIGINT)
        sent = time.monotonic()
        outcome = finish(process, 60, began)
        took = time.monotonic() - sent
        self.add("Ctrl-C while the scene is built", outcome, 130, "", "" if took < 5 else f"took {took:.1f} s")

        command = self.plan_command(self.head_inspection, *HEAD_PLAN[2:])
        folder = pathlib.Path(command[4])
        began = time.monotonic()
        process = start(command)
        text = read_until(process, r"\b([3-9]|\d\d) scans, ") or ""
        process.send_signal(signal.SIGINT)
        sent = time.monotonic()
        outcome = finish(process, 120, began, text)
        took = time.monotonic() - sent
        problem = "" if took < 10 else f"took {took:.1f} s"
        scans = 0
        try:
            plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
            scans = len(plan.get("scans", []))
            if scans == 0 or plan["stop_reason"] != "STOP_REASON_INTERRUPTED":
                problem = f"plan.json has {scans} scans and stop reason {plan['stop_reason']}"
        except (OSError, ValueError) as error:
            problem = f"plan.json: {error}"
        self.add("Ctrl-C mid-plan", outcome, 130, "", problem,
                 f"ends {took:.1f} s later, plan.json keeps {scans} scans")
        outcome = run([*command, "--resume", "--goal", "0.9"], 600)
        plan = json.loads((folder / "plan.json").read_text(encoding="utf-8"))
        reached = plan["stop_reason"] == "STOP_REASON_GOAL_REACHED"
        self.add("... and --resume", outcome, 0, r"cold start to plan", "" if reached else plan["stop_reason"],
                 f"goes on to {100 * plan['coverage']['coverage']:.1f} % with {len(plan['scans'])} scans")

    def two_clients(self, reference):
        box = self.plan_command(self.box_inspection, *HEAD_PLAN)
        box[4] = self.folder / "out/box_alone"
        alone = run(box, 300)
        self.add("a box alone, for comparison", alone, 0, r"cold start to plan", note="plan made")
        server = Server(self.folder)
        commands = []
        for name, inspection in (("head", self.head_inspection), ("box", self.box_inspection)):
            command = self.plan_command(inspection, "--coverage-server", server.address, *HEAD_PLAN)
            command[4] = self.folder / f"out/together_{name}"
            commands.append(command)
        began = time.monotonic()
        processes = [start(c) for c in commands]
        with concurrent.futures.ThreadPoolExecutor() as pool:
            outcomes = list(pool.map(lambda p: finish(p, 600, began), processes))
        self.add("two clients at once: head", outcomes[0], 0, r"cold start to plan",
                 self.differs(commands[0], reference), "same plan as alone")
        self.add("two clients at once: box", outcomes[1], 0, r"cold start to plan",
                 self.differs(commands[1], (self.folder / "out/box_alone/plan.json").read_bytes()),
                 "same plan as alone")
        server.stop()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--json")
    parser.add_argument("--quick", action="store_true", help="only what needs no plan of the head")
    args = parser.parse_args()
    bench.print_machine()
    print(f"     {'input':<50}{'exit':>5}{'s':>8}  message")
    with tempfile.TemporaryDirectory(prefix="sightline-bad-input-") as folder:
        cases = Cases(folder)
        cases.files()
        cases.other_makers()
        cases.numbers()
        cases.inspections()
        cases.uncertainty()
        cases.uploads()
        if not args.quick:
            reference = cases.reference()
            cases.killed_server(reference)
            cases.interrupted()
            cases.two_clients(reference)
    bench.write_results(args.json, "bad_input", cases.rows)
    failed = [row["input"] for row in cases.rows if row["problems"]]
    if failed:
        print(f"{len(failed)} of {len(cases.rows)} not as expected: {', '.join(failed)}", file=sys.stderr)
        sys.exit(1)
    print(f"all {len(cases.rows)} as expected")


if __name__ == "__main__":
    main()
