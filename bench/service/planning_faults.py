#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Jobs of the planning service while random processes are killed.

Submits jobs over HTTP, kills (SIGKILL) the server or any of its processes at random moments, starts
the server again when it was the victim, and counts at the end: accepted jobs that are lost, that
failed, whose results differ from those of `sightline plan` without any service, and results that a
reader ever saw incomplete. Exit code 1 if there is one of them.

  bench/service/planning_faults.py [--jobs 200] [--mean-s 2] [--seed 1] [--workers 2]
                                   [--database CONNECTION] [--json FILE]
"""

import argparse
import collections
import hashlib
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import threading
import time

from service import HttpClient, Service, binary, block_task, stepped_block_stl

SEEDS = 4  # different tasks


def reproducible(name: str) -> bool:
    """The report tells how long things took."""
    return not name.endswith(".html")


def reference(folder: pathlib.Path, seed: int) -> dict[str, str]:
    """Digests of what the command makes of the task."""
    folder.mkdir()
    (folder / "block.stl").write_bytes(stepped_block_stl())
    task = block_task(seed)
    (folder / "inspection.json").write_text(json.dumps(task["inspection"]))
    options = task["plan_options"]
    subprocess.run(
        [binary(), "plan", "inspection.json", "--out", "out", "--seed", str(seed),
         "--evaluations-per-scan", str(options["evaluations_per_scan"]),
         "--bound-evaluations", str(options["bound_evaluations"]), "--no-pictures"],
        cwd=folder, check=True, capture_output=True)
    out = folder / "out"
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in out.rglob("*") if path.is_file() and reproducible(path.name)}


class Reader(threading.Thread):
    """Reads results of jobs that are done all the while and checks their digests."""

    def __init__(self, client: HttpClient):
        super().__init__(daemon=True)
        self.client, self.ending, self.read, self.broken = client, False, 0, []

    def run(self):
        generator = random.Random(7)
        while not self.ending:
            try:
                _, page = self.client.json("GET", "/v1/jobs?state=SUCCEEDED&page_size=50")
                if not page.get("jobs"):
                    time.sleep(0.2)
                    continue
                job = generator.choice(page["jobs"])
                result = generator.choice(job["results"])
                status, content, _ = self.client.once(
                    "GET", f"/v1/jobs/{job['job_id']}/results/{result['name']}")
                if status == 200 and hashlib.sha256(content).hexdigest() != result["digest"]:
                    self.broken.append((job["job_id"], result["name"]))
                self.read += status == 200
                time.sleep(0.05)  # the jobs need the processor more
            except Exception:  # the server was just killed: nothing was seen
                time.sleep(0.05)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=200)
    parser.add_argument("--mean-s", type=float, default=2.0, help="mean time between two kills")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--database", default="", help="PostgreSQL connection; default SQLite")
    parser.add_argument("--limit-s", type=float, default=3600)
    parser.add_argument("--json", help="file for the numbers")
    args = parser.parse_args()
    generator = random.Random(args.seed)
    folder = pathlib.Path(tempfile.mkdtemp(prefix="sightline-faults-"))
    references = {seed: reference(folder / f"reference-{seed}", seed) for seed in range(1, SEEDS + 1)}

    options = ["--workers", str(args.workers), "--min-free", "64MB", "--log-level", "warning"]
    if args.database:
        options += ["--database", args.database]
    service = Service(str(folder / "data"), *options)
    service.start()
    client = HttpClient(service)
    part = {"block.stl": stepped_block_stl()}
    accepted: dict[str, str] = {}  # request id to job id
    refused = []

    def submit():
        for i in range(args.jobs):
            status, answer = client.create(block_task(1 + i % SEEDS), part, f"request-{i}")
            if status in (200, 201):
                accepted[f"request-{i}"] = answer["job_id"]
            else:
                refused.append((status, answer))

    start = time.monotonic()
    submitter = threading.Thread(target=submit, daemon=True)
    submitter.start()
    reader = Reader(HttpClient(service))
    reader.start()
    kills = collections.Counter()
    next_kill = start + generator.expovariate(1 / args.mean_s)
    unfinished = args.jobs
    while time.monotonic() - start < args.limit_s:
        time.sleep(0.02)
        now = time.monotonic()
        if now >= next_kill:
            kills[service.kill_random(generator)] += 1
            next_kill = now + generator.expovariate(1 / args.mean_s)
        if not service.alive():
            service.start_patiently()
        if not submitter.is_alive() and int(now * 50) % 50 == 0:
            try:
                _, content, _ = client.once("GET", "/v1/jobs?page_size=1000")
                jobs = json.loads(content)["jobs"]
                unfinished = sum(job["state"] in ("QUEUED", "RUNNING") for job in jobs)
                if unfinished == 0:
                    break
            except Exception:
                pass
    duration = time.monotonic() - start
    reader.ending = True
    if not service.alive():
        service.start_patiently()

    lost, failed, wrong, attempts = [], [], [], collections.Counter()
    for request_id, job_id in accepted.items():
        status, job = client.json("GET", f"/v1/jobs/{job_id}")
        if status != 200:
            lost.append(job_id)
            continue
        attempts[job.get("attempts", 0)] += 1
        if job["state"] != "SUCCEEDED":
            failed.append((job_id, job["state"], job.get("failure")))
            continue
        seed = 1 + int(request_id.split("-")[1]) % SEEDS
        got = {}
        for result in job["results"]:
            if reproducible(result["name"]):
                _, content, _ = client.result(job_id, result["name"])
                got[result["name"]] = hashlib.sha256(content).hexdigest()
        if got != references[seed]:
            wrong.append(job_id)
    _, page = client.json("GET", "/v1/jobs?page_size=1000")
    twice = len(page["jobs"]) - len(accepted)
    service.stop()
    report = {
        "jobs": args.jobs, "accepted": len(accepted), "refused": len(refused), "lost": len(lost),
        "made twice": twice, "failed": len(failed), "wrong bytes": len(wrong), "unfinished": unfinished,
        "results read meanwhile": reader.read, "of these incomplete": len(reader.broken),
        "kills": dict(kills), "attempts per job": dict(sorted(attempts.items())),
        "duration_s": round(duration, 1), "store": "PostgreSQL" if args.database else "SQLite",
    }
    for key, value in report.items():
        print(f"{key:>24}: {value}")
    for entry in (refused + failed + wrong)[:10]:
        print("  ", entry)
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps(report, indent=1))
    bad = len(refused) + len(lost) + len(failed) + len(wrong) + len(reader.broken) + unfinished + twice
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
