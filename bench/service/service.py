# SPDX-License-Identifier: Apache-2.0
"""A planning service of one's own for the benchmarks: started, killed, started again; and what a
client of its HTTP front end needs. Standard library alone."""

import http.client
import json
import os
import pathlib
import random
import signal
import subprocess
import time
import urllib.parse

ROOT = pathlib.Path(__file__).resolve().parents[2]


def binary() -> str:
    build = pathlib.Path(os.environ.get("SIGHTLINE_BUILD_DIR", ROOT / "build" / "release"))
    return str(build / "bin" / "sightline")


def stepped_block_stl() -> bytes:
    """An ASCII STL of a block of 60 x 40 mm with three steps: a part that is planned in seconds."""
    steps = [(0, 20, 10), (20, 40, 16), (40, 60, 22)]
    quads = []

    def quad(a, b, c, d):
        quads.append((a, b, c))
        quads.append((a, c, d))

    for i, (x0, x1, z) in enumerate(steps):
        quad((x0, 0, z), (x1, 0, z), (x1, 40, z), (x0, 40, z))
        quad((x0, 0, 0), (x0, 40, 0), (x1, 40, 0), (x1, 0, 0))
        quad((x0, 0, 0), (x1, 0, 0), (x1, 0, z), (x0, 0, z))
        quad((x0, 40, 0), (x0, 40, z), (x1, 40, z), (x1, 40, 0))
        below = steps[i - 1][2] if i > 0 else 0
        quad((x0, 0, below), (x0, 0, z), (x0, 40, z), (x0, 40, below))
    x, z = steps[-1][1], steps[-1][2]
    quad((x, 0, 0), (x, 40, 0), (x, 40, z), (x, 0, z))
    lines = ["solid block"]
    for triangle in quads:
        lines.append("facet normal 0 0 0\nouter loop")
        lines += [f"vertex {p[0]} {p[1]} {p[2]}" for p in triangle]
        lines.append("endloop\nendfacet")
    lines.append("endsolid block\n")
    return "\n".join(lines).encode()


def block_task(seed: int) -> dict:
    return {
        "kind": "plan",
        "seed": seed,
        "inspection": {
            "name": "stepped block",
            "part": {"file": "block.stl", "unit": "mm"},
            "targets": {"spacing_m": 0.004, "coverage_radius_m": 0.003},
        },
        "plan_options": {"evaluations_per_scan": 2000, "bound_evaluations": 2000, "no_pictures": True},
    }


def block_images_task(seed: int) -> dict:
    """One small image of the block, rendered in a second. Needs the files of `block_images_files`."""
    return {
        "kind": "render",
        "seed": seed,
        "inspection": {
            "name": "stepped block",
            "part": {"file": "block.stl", "unit": "mm"},
            "materials": [{"file": "paint.json"}],
            "camera": {"sensor_file": "sensor.json", "columns_px": 160, "rows_px": 100},
            "lens": {"focal_length_m": 0.016, "f_number": 8},
            "laser": {"distance_m": 0.6, "fan_angle_deg": 60, "wavelength_m": 661e-9, "power_w": 0.023},
            "lighting": {"ambient": {"radiance_w_m2_sr": 0.1, "spectrum": {"illuminant": "d65"}}},
            "measurement": {
                "camera_distance_m": {"fixed": 0.4}, "triangulation_angle_deg": {"fixed": 25},
                "camera_azimuth_deg": {"fixed": 0}, "camera_polar_deg": {"fixed": 20},
                "part_alpha_deg": {"fixed": 0}, "part_beta_deg": {"fixed": 0},
                "part_gamma_deg": {"fixed": 0}, "offset_y_m": {"fixed": 0}, "offset_z_m": {"fixed": 0},
            },
            "render": {"exposure_time_s": 0.001},
        },
        "render_options": {"frames": {"stage_position_m": 0.1}},
    }


def block_images_files() -> dict[str, bytes]:
    catalogue = ROOT / "examples" / "catalogue"
    return {
        "block.stl": stepped_block_stl(),
        "paint.json": (catalogue / "materials" / "matt_white_paint.json").read_bytes(),
        "sensor.json": (catalogue / "cameras" / "bfly_pge_23s6c.json").read_bytes(),
    }


def descendants(pid: int) -> list[int]:
    """The process and all that descend from it."""
    parents = {}
    for entry in os.listdir("/proc"):
        if entry.isdigit():
            try:
                stat = pathlib.Path("/proc", entry, "stat").read_text()
                parents[int(entry)] = int(stat[stat.rindex(")") + 2 :].split()[1])
            except (OSError, ValueError):
                pass
    found = [pid] if pid in parents else []
    for process in found:
        found += [child for child, parent in parents.items() if parent == process]
    return found


def program_of(pid: int) -> str:
    """Name of the program, of `sightline` with its subcommand."""
    try:
        words = pathlib.Path("/proc", str(pid), "cmdline").read_bytes().split(b"\0")
    except OSError:
        return "gone"
    name = os.path.basename(words[0].decode(errors="replace"))
    # `sightline` becomes the program of the command's group, such as sightline-plan.
    if name == "sightline" or name.startswith("sightline-"):
        commands = [w.decode() for w in words[1:] if w and not w.startswith(b"-")]
        return f"sightline {commands[0]}" if commands else name
    return name


class Service:
    def __init__(self, folder: str, *options: str):
        self.folder = folder
        self.options = options
        self.process = None
        self.address = None  # of the HTTP front end, the same over restarts
        self.grpc_address = None

    def start(self) -> None:
        http_at = self.address or "127.0.0.1:0"
        grpc_at = self.grpc_address or "127.0.0.1:0"
        log = open(os.path.join(os.path.dirname(self.folder), "serve.log"), "ab")
        self.process = subprocess.Popen(
            [binary(), "serve", "--data", self.folder, "--listen", grpc_at, "--http", http_at,
             *self.options],
            stdout=subprocess.PIPE, stderr=log, text=True)
        log.close()
        for line in self.process.stdout:
            if line.startswith("http://"):
                self.address = line.strip()[len("http://") :]
            if line.startswith("listening on "):
                self.grpc_address = line.strip()[len("listening on ") :]
                return
        raise RuntimeError("sightline serve ended: see serve.log")

    def start_patiently(self, tries: int = 50) -> None:
        """The port or the data folder may be held for a moment by what was killed."""
        for attempt in range(tries):
            try:
                self.start()
                return
            except RuntimeError:
                if attempt == tries - 1:
                    raise
                time.sleep(0.2)

    def kill_random(self, generator: random.Random) -> str:
        """kill -9 of the server or of any process that descends from it; says which."""
        pid = generator.choice(descendants(self.process.pid))
        name = program_of(pid)
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            return "gone"
        if pid == self.process.pid:
            self.process.wait()
            self.process.stdout.close()
        return name

    def kill_all(self) -> None:
        """kill -9 of the server and of all that descends from it, as when the machine fails."""
        for pid in descendants(self.process.pid):
            try:
                os.kill(pid, signal.SIGKILL)
            except ProcessLookupError:
                pass
        self.process.wait()
        self.process.stdout.close()

    def alive(self) -> bool:
        return self.process is not None and self.process.poll() is None

    def stop(self) -> None:
        if self.alive():
            self.process.send_signal(signal.SIGTERM)
            try:
                self.process.wait(60)
            except subprocess.TimeoutExpired:
                self.process.kill()
                self.process.wait()


class HttpClient:
    """Tries again for a while what could not be sent or answered, as a client of a service that may
    be restarted does."""

    def __init__(self, service: Service, patience_s: float = 120):
        self.service = service
        self.patience_s = patience_s

    def once(self, method, path, body=None, headers=None):
        connection = http.client.HTTPConnection(self.service.address, timeout=60)
        try:
            connection.request(method, path, body, headers or {})
            response = connection.getresponse()
            return response.status, response.read(), dict(response.getheaders())
        finally:
            connection.close()

    def request(self, method, path, body=None, headers=None):
        deadline = time.monotonic() + self.patience_s
        while True:
            try:
                status, bytes_, headers_back = self.once(method, path, body, headers)
                if status != 503:
                    return status, bytes_, headers_back
            except (OSError, http.client.HTTPException):
                pass
            if time.monotonic() > deadline:
                raise TimeoutError(f"{method} {path}: no answer in {self.patience_s} s")
            time.sleep(0.1)

    def json(self, method, path, body=None, headers=None):
        status, bytes_, _ = self.request(method, path, body, headers)
        return status, json.loads(bytes_)

    @staticmethod
    def form(task: dict, files: dict[str, bytes], key: str) -> tuple[bytes, dict[str, str]]:
        """Body and headers of a request for a job."""
        boundary = "----sightline-benchmark-7b1f"
        parts = [b'--%s\r\nContent-Disposition: form-data; name="task"\r\n\r\n%s\r\n'
                 % (boundary.encode(), json.dumps(task).encode())]
        for name, content in files.items():
            parts.append((f'--{boundary}\r\nContent-Disposition: form-data; name="file"; '
                          f'filename="{name}"\r\nContent-Type: application/octet-stream\r\n\r\n').encode()
                         + content + b"\r\n")
        body = b"".join(parts) + f"--{boundary}--\r\n".encode()
        return body, {"Content-Type": f"multipart/form-data; boundary={boundary}", "Idempotency-Key": key}

    def create(self, task: dict, files: dict[str, bytes], key: str):
        return self.json("POST", "/v1/jobs", *self.form(task, files, key))

    def result(self, job_id: str, name: str):
        return self.request("GET", f"/v1/jobs/{job_id}/results/{urllib.parse.quote(name)}")
