#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Memory and answers of the planning service while many clients send the largest permitted bodies.

Starts `sightline serve` with a clients file. Clients in processes of their own send JSON bodies of
16 MiB, the most that is allowed, one after the other and without a pause: a plan of numbers, a plan
of many scans, a long text. One ordinary client asks for its state, its jobs and small renderings
meanwhile. Resident memory of the server and of all its processes is read every second from /proc.

  bench/service/soak.py [--minutes 10] [--clients 24] [--workers 1] [--json FILE]

Targets: resident memory of all processes below 1 GiB, every answer to the ordinary client within a
second and none of them an error. Exit code 1 if one is missed.
"""

import argparse
import collections
import hashlib
import http.client
import json
import multiprocessing
import os
import pathlib
import shutil
import signal
import socket
import sys
import tempfile
import threading
import time

from service import HttpClient, Service, block_images_files, block_images_task, descendants, program_of

BODY_BYTES = 16 << 20
MEMORY_TARGET_BYTES = 1 << 30
ANSWER_TARGET_S = 1.0
CLIENTS_A_PROCESS = 6


def filled(begin: bytes, entry: bytes, end: bytes, separator: bytes = b",") -> bytes:
    """A body of as many entries as fit into the largest one."""
    count = (BODY_BYTES - len(begin) - len(end) + len(separator)) // (len(entry) + len(separator))
    return begin + separator.join([entry] * count) + end


def bodies() -> list[bytes]:
    """The largest bodies of three shapes. None becomes a job: each that is taken in is read whole and then refused."""
    task = b'{"task":{"kind":"evaluate","inspection":{"name":"soak","part":{"file":"a.stl","unit":"mm"}},"plan":'
    scan = b'{"measurement":{"camera_distance_m":0.41234567,"triangulation_angle_deg":25.1,"camera_polar_deg":20.5}}'
    return [
        filled(task + b'{"scans":[{"trigger_positions_m":[', b"0.1234567", b"]}]}}}"),
        filled(task + b'{"scans":[', scan, b"]}}}"),
        filled(b'{"task":{"kind":"plan","inspection":{"name":"', b"soak", b'"}}}', b""),
    ]


def send_body(address: str, token: str, body: bytes) -> str:
    """Sends one body; the status of the answer and its reason."""
    connection = http.client.HTTPConnection(address, timeout=60)
    try:
        try:
            connection.request("POST", "/v1/jobs", body, {
                "Content-Type": "application/json", "Authorization": f"Bearer {token}"})
        except (BrokenPipeError, ConnectionResetError):
            pass  # refused before all was sent: the answer may be there
        response = connection.getresponse()
        content = response.read()
        reason = json.loads(content)["error"]["reason"] if response.status >= 400 else ""
        return f"{response.status} {reason}".strip()
    except socket.timeout:
        return "no answer in 60 s"
    except (OSError, http.client.HTTPException):
        return "connection closed"
    finally:
        connection.close()


def send_all_the_while(address: str, tokens: list[str], ending, counts) -> None:
    """Process of some clients, a thread each."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    texts = bodies()
    found = collections.Counter()

    def client(number: int, token: str):
        turn = number
        while not ending.is_set():
            found[send_body(address, token, texts[turn % len(texts)])] += 1
            turn += 1

    threads = [threading.Thread(target=client, args=(i, token)) for i, token in enumerate(tokens)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    counts.put(dict(found))


class Memory(threading.Thread):
    """Resident memory of a process and of its descendants, every second."""

    def __init__(self, pid: int):
        super().__init__(daemon=True)
        self.pid, self.ending = pid, threading.Event()
        self.samples: list[int] = []  # bytes, of all together
        self.peaks: dict[str, int] = {}  # bytes, of one process of each program

    def run(self):
        while not self.ending.wait(1):
            total = 0
            for pid in descendants(self.pid):
                try:
                    text = pathlib.Path("/proc", str(pid), "status").read_text()
                except OSError:
                    continue
                fields = dict(line.split(":", 1) for line in text.splitlines())
                now, most = (int(fields[key].split()[0]) << 10 if key in fields else 0
                             for key in ("VmRSS", "VmHWM"))
                total += now
                name = program_of(pid)
                if name not in ("", "gone"):  # it has just ended
                    self.peaks[name] = max(self.peaks.get(name, 0), most)
            self.samples.append(total)


class Ordinary:
    """A client with small requests. A rendering is asked for again until it is accepted, as the
    docs say for UNAVAILABLE."""

    def __init__(self, client: HttpClient, token: str):
        self.client, self.headers = client, {"Authorization": f"Bearer {token}"}
        self.answers_s: list[float] = []
        self.accepted_s: list[float] = []  # from asking for a rendering to its acceptance
        self.statuses = collections.Counter()
        self.unfinished: list[str] = []
        self.finished = 0
        self.asked = 0

    def ask(self, what: str, method: str, path: str, body=None, headers=None) -> tuple[int, bytes]:
        start = time.monotonic()
        try:
            status, content, _ = self.client.once(method, path, body, {**self.headers, **(headers or {})})
        except (OSError, http.client.HTTPException):
            status, content = 0, b""
        self.answers_s.append(time.monotonic() - start)
        self.statuses[f"{what}: {status or 'no answer'}"] += 1
        return status, content

    def order(self) -> None:
        """Asks for a rendering: for a new one if few wait, else once more for the last one, which
        gives the same job."""
        is_new = len(self.unfinished) < 2
        self.asked += is_new
        body, headers = self.client.form(block_images_task(self.asked), block_images_files(), f"soak-{self.asked}")
        start = time.monotonic()
        while time.monotonic() - start < 60:
            status, content = self.ask("rendering", "POST", "/v1/jobs", body, headers)
            if status in (200, 201):
                self.accepted_s.append(time.monotonic() - start)
                if is_new:
                    self.unfinished.append(json.loads(content)["job_id"])
                return
            time.sleep(0.1)

    def go_on(self) -> None:
        self.ask("state", "GET", "/v1/state")
        self.ask("jobs", "GET", "/v1/jobs?page_size=20")
        self.order()
        for job_id in list(self.unfinished):
            status, content = self.ask("job", "GET", f"/v1/jobs/{job_id}")
            if status == 200 and json.loads(content)["state"] == "SUCCEEDED":
                self.unfinished.remove(job_id)
                self.ask("result", "GET", f"/v1/jobs/{job_id}/results/recordings.json")
                self.finished += 1


def percentile(values: list[float], fraction: float) -> float:
    ordered = sorted(values) or [0.0]
    return ordered[min(len(ordered) - 1, int(fraction * len(ordered)))]


def measure(args, service: Service, tokens: list[str]) -> dict:
    ending, counts = multiprocessing.Event(), multiprocessing.Queue()
    memory = Memory(service.process.pid)
    memory.start()
    ordinary = Ordinary(HttpClient(service), tokens[0])
    groups = [tokens[i : i + CLIENTS_A_PROCESS] for i in range(1, len(tokens), CLIENTS_A_PROCESS)]
    senders = [multiprocessing.Process(target=send_all_the_while, daemon=True,
                                       args=(service.address, group, ending, counts)) for group in groups]
    for sender in senders:
        sender.start()
    sent = collections.Counter()
    try:
        end = time.monotonic() + 60 * args.minutes
        while time.monotonic() < end and service.alive():
            ordinary.go_on()
            time.sleep(0.1)
        ending.set()
        for _ in senders:
            sent.update(counts.get(timeout=90))
    finally:
        for sender in senders:
            sender.kill()
    memory.ending.set()
    memory.join()
    bad = {status: count for status, count in ordinary.statuses.items()
           if status.split(": ")[1] not in ("200", "201")}
    return {
        "minutes": args.minutes, "clients": len(tokens) - 1,
        "server alive": service.alive(),
        "peak memory MiB": round(max(memory.samples, default=0) / 2**20),
        "median memory MiB": round(percentile(memory.samples, 0.5) / 2**20),
        "peak of one process MiB": {name: round(size / 2**20) for name, size in sorted(memory.peaks.items())},
        "answers": len(ordinary.answers_s),
        "median answer ms": round(1e3 * percentile(ordinary.answers_s, 0.5), 1),
        "99th percentile answer ms": round(1e3 * percentile(ordinary.answers_s, 0.99), 1),
        "worst answer ms": round(1e3 * max(ordinary.answers_s, default=0), 1),
        "worst time to acceptance ms": round(1e3 * max(ordinary.accepted_s, default=0), 1),
        "renderings asked for": ordinary.asked, "renderings finished": ordinary.finished,
        "answers by status": dict(sorted(ordinary.statuses.items())), "refused answers": sum(bad.values()),
        "largest bodies by status": dict(sorted(sent.items())),
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=10)
    parser.add_argument("--clients", type=int, default=24)
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--json", help="file for the numbers")
    args = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    folder = pathlib.Path(tempfile.mkdtemp(prefix="sightline-soak-"))
    tokens = [f"token-{i}-{os.urandom(8).hex()}" for i in range(args.clients + 1)]
    (folder / "clients.json").write_text(json.dumps({"clients": [
        {"name": f"client-{i}", "token_sha256": hashlib.sha256(token.encode()).hexdigest()}
        for i, token in enumerate(tokens)]}))
    service = Service(str(folder / "data"), "--workers", str(args.workers), "--min-free", "64MB",
                      "--log-level", "error", "--clients", str(folder / "clients.json"))
    try:
        service.start()
        report = measure(args, service, tokens)
    finally:
        if service.alive():
            service.kill_all()
        shutil.rmtree(folder, ignore_errors=True)
    for key, value in report.items():
        print(f"{key:>27}: {value}")
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps(report, indent=1))
    missed = [name for name, is_met in {
        "memory": report["peak memory MiB"] * 2**20 < MEMORY_TARGET_BYTES,
        "time of answers": report["worst answer ms"] < 1e3 * ANSWER_TARGET_S,
        "no refused answers": report["refused answers"] == 0,
        "server alive": report["server alive"],
    }.items() if not is_met]
    print("targets missed: " + (", ".join(missed) or "none"))
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
