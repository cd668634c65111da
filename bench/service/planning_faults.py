#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Jobs of the planning service under kills, backups, restores and damaged results.

Submits jobs over HTTP. At random moments it kills (SIGKILL) the server, any of its processes or a
backup that is being made, starts the server again, damages stored results, makes backups and
restores the service from one. A client asks again for all its jobs after a restore, by the same
request ids. A receiver of webhooks keeps the largest event_id, as docs/clients.md says.

Counted at the end, and exit code 1 if there is one of them:
  lost             a job whose acceptance was answered before the restored backup began, or since
                   the last restore, and that is not there or has another id; or one that the
                   backup had finished and whose results are others. Later jobs may be gone: the
                   client that asks again gets one job
  made twice       more jobs than request ids
  wrong bytes      an answer 200 or 206 with other bytes than the digest of the result says, or
                   results that differ from those of the command without any service
  needlessly refused  DATA_LOSS for a result that is not damaged
  events missed    an event that the receiver left out and never took, or that it never got
  events twice     an event that was taken since the last restore and is not in the store, or a
                   second end of a job

  bench/service/planning_faults.py [--quick] [--jobs 200] [--mean-s 4] [--backup-mean-s 8]
      [--restore-mean-s 40] [--damage-mean-s 5] [--seed 1] [--workers 2] [--backup-folders 2]
      [--database CONNECTION] [--json FILE]

Of all jobs one in five is a plan and the others are small images. A mean time of 0 switches a fault
off. With --database (PostgreSQL) there are no backups and no restores.
"""

import argparse
import collections
import hashlib
import json
import pathlib
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import threading
import time

from backups import Backups
from damage import damage
from event_receiver import EventReceiver
from service import (HttpClient, Service, binary, block_images_files, block_images_task, block_task,
                     stepped_block_stl)

PLAN_SEEDS = 2  # different tasks of each kind
IMAGE_SEEDS = 6
SECRET = b"secret of this benchmark"


def task_of(number: int) -> tuple[dict, dict[str, bytes]]:
    if number % 5 == 0:
        return block_task(1 + number // 5 % PLAN_SEEDS), {"block.stl": stepped_block_stl()}
    return block_images_task(1 + number % IMAGE_SEEDS), block_images_files()


def number_of(request_id: str) -> int:
    return int(request_id.split("-")[1])


def is_reproducible(name: str) -> bool:
    """Reports tell how long things took, and so does the data beside them."""
    return not name.endswith((".html", "report.json"))


class References:
    """What the commands make of the tasks without any service."""

    def __init__(self, folder: pathlib.Path):
        self.folder = folder
        self.digests: dict[tuple, dict[str, str]] = {}  # by kind and seed
        self.bytes: dict[str, bytes] = {}  # by digest

    def of(self, task: dict, files: dict[str, bytes]) -> dict[str, str]:
        """Digests by name of result."""
        key = (task["kind"], task["seed"])
        if key in self.digests:
            return self.digests[key]
        folder = self.folder / "-".join(map(str, key))
        folder.mkdir(parents=True)
        for name, content in files.items():
            (folder / name).write_bytes(content)
        (folder / "inspection.json").write_text(json.dumps(task["inspection"]))
        command = [binary(), task["kind"], "inspection.json", "--out", "out", "--seed", str(task["seed"])]
        if task["kind"] == "plan":
            options = task["plan_options"]
            command += ["--evaluations-per-scan", str(options["evaluations_per_scan"]),
                        "--bound-evaluations", str(options["bound_evaluations"]), "--no-pictures"]
        else:
            command += ["--stage-position", str(task["render_options"]["frames"]["stage_position_m"])]
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=600)
        found = {}
        out = folder / "out"
        for path in out.rglob("*"):
            if path.is_file() and is_reproducible(path.name):
                content = path.read_bytes()
                digest = hashlib.sha256(content).hexdigest()
                found[str(path.relative_to(out))] = digest
                self.bytes[digest] = content
        self.digests[key] = found
        return found


class Orders(threading.Thread):
    """A client with orders: asks for a job of each, and for all of them again after a restore."""

    def __init__(self, client: HttpClient, count: int):
        super().__init__(daemon=True)
        self.client = client
        self.lock = threading.Lock()
        self.ids = [f"request-{i}" for i in range(count)]
        self.epoch = 0  # restores so far
        self.promised: dict[str, str] = {}  # request id to job id, by the restored backup
        self.accepted: dict[str, str] = {}  # since the last restore
        self.refused: list[tuple] = []
        self.lost: list[str] = []

    def run(self):
        while True:
            with self.lock:
                epoch = self.epoch
                waiting = [i for i in self.ids if i not in self.accepted]
            if not waiting:
                time.sleep(0.1)
                continue
            task, files = task_of(number_of(waiting[0]))
            try:
                status, answer = self.client.create(task, files, waiting[0])
            except TimeoutError:
                continue
            with self.lock:
                if epoch == self.epoch:
                    self._note(waiting[0], status, answer)

    def _note(self, request_id: str, status: int, answer: dict) -> None:
        if status not in (200, 201):
            self.refused.append((request_id, status, answer))
            self.accepted[request_id] = ""
            return
        self.accepted[request_id] = answer["job_id"]
        if self.promised.get(request_id, answer["job_id"]) != answer["job_id"]:
            self.lost.append(f"{request_id}: promised as {self.promised[request_id]}")

    def present(self) -> tuple[int, dict[str, str]]:
        """Restores so far, and all jobs that must be there."""
        with self.lock:
            present = {**self.promised, **self.accepted}
            return self.epoch, {order: job for order, job in present.items() if job}

    def begin_again(self, promised: dict[str, str]) -> None:
        with self.lock:
            self.epoch += 1
            self.promised, self.accepted = dict(promised), {}

    def is_done(self) -> bool:
        with self.lock:
            return len(self.accepted) == len(self.ids)


class Reader(threading.Thread):
    """Reads results all the while, whole and in ranges, and compares their bytes with their digests."""

    def __init__(self, client: HttpClient, orders: Orders, references: References, damaged: dict):
        super().__init__(daemon=True)
        self.client, self.orders, self.references, self.damaged = client, orders, references, damaged
        self.generator = random.Random(7)
        self.ending = False
        self.counts = collections.Counter()
        self.wrong: list[tuple] = []
        self.needless: list[tuple] = []

    def run(self):
        while not self.ending:
            try:
                _, page = self.client.json("GET", "/v1/jobs?state=SUCCEEDED&page_size=1000")
                results = [(job["job_id"], result) for job in page.get("jobs", [])
                           for result in job["results"]]
                if not results:
                    time.sleep(0.2)
                    continue
                chosen = self.generator.sample(results, min(10, len(results)))
                hurt = [r for r in results if r[1]["digest"] in self.damaged]
                if hurt:
                    chosen.append(self.generator.choice(hurt))
                for job_id, result in chosen:
                    self.read(job_id, result)
                    time.sleep(0.05)  # the jobs need the processor more
            except Exception:  # the server was just killed: nothing was seen
                time.sleep(0.05)

    def read(self, job_id: str, result: dict, whole: bool = False) -> None:
        digest, size = result["digest"], result.get("size_bytes", 0)
        known = self.references.bytes.get(digest)
        headers, begin, end = {}, 0, size
        if known and not whole and self.generator.random() < 0.3:
            begin = self.generator.randrange(size)
            end = self.generator.randrange(begin, size) + 1
            headers = {"Range": f"bytes={begin}-{end - 1}"}
        epoch = self.orders.epoch
        path = f"/v1/jobs/{job_id}/results/{result['name']}"
        status, content, _ = self.client.once("GET", path, headers=headers)
        if epoch != self.orders.epoch:
            return  # of a service that is no more
        place = (job_id, result["name"], status, self.damaged.get(digest))
        if status in (200, 206):
            right = (content == known[begin:end] if status == 206
                     else hashlib.sha256(content).hexdigest() == digest)
            self.counts["right" if right else "wrong"] += 1
            if not right:
                self.wrong.append(place)
        elif status == 500 and json.loads(content)["error"]["code"] == "DATA_LOSS":
            self.counts["refused as damaged"] += 1
            if digest not in self.damaged:
                self.needless.append(place)
        else:
            self.counts[f"status {status}"] += 1


class Run:
    def __init__(self, args, folder: pathlib.Path):
        self.args, self.folder = args, folder
        self.generator = random.Random(args.seed)
        self.references = References(folder / "references")
        for i in range(5 * PLAN_SEEDS * IMAGE_SEEDS):
            if i < args.jobs:
                self.references.of(*task_of(i))
        (folder / "secret").write_bytes(SECRET)
        self.receiver = EventReceiver(SECRET, args.seed)
        options = ["--workers", str(args.workers), "--min-free", "64MB", "--log-level", "warning",
                   "--webhook", self.receiver.url, "--webhook-secret", str(folder / "secret")]
        if args.database:
            options += ["--database", args.database]
        self.data = folder / "data"
        self.service = Service(str(self.data), *options)
        self.client = HttpClient(self.service)
        self.orders = Orders(HttpClient(self.service), args.jobs)
        self.backups = Backups(self.data, [folder / f"backup-{i}" for i in range(args.backup_folders)])
        self.damaged: dict[str, str] = {}  # digest to kind of damage, of the present data folder
        self.reader = Reader(HttpClient(self.service), self.orders, self.references, self.damaged)
        self.kills = collections.Counter()
        self.damages = collections.Counter()
        self.restores = 0
        self.lost: list[str] = []
        self.finished: dict[str, tuple] = {}  # as last seen
        self.largest_at_the_restore = 0  # event_id that the receiver had

    def finished_jobs(self) -> dict[str, tuple]:
        """State and digests of results by job; empty while the service is down."""
        try:
            _, content, _ = self.client.once("GET", "/v1/jobs?page_size=1000")
            jobs = json.loads(content)["jobs"]
        except Exception:
            return {}
        self.finished = {
            job["job_id"]: (job["state"], {r["name"]: r["digest"] for r in job.get("results", [])})
            for job in jobs if job["state"] not in ("QUEUED", "RUNNING")}
        return self.finished

    def begin_backup(self) -> None:
        if self.backups.process is None:
            finished = self.finished_jobs()
            _, accepted = self.orders.present()
            self.backups.begin({"accepted": accepted, "finished": finished})

    def kill_something(self) -> None:
        if self.generator.random() < 0.15 and self.backups.kill():
            self.kills["sightline backup"] += 1
        elif self.service.alive():
            self.kills[self.service.kill_random(self.generator)] += 1
            if not self.service.alive() and self.args.damage_mean_s > 0:
                self.damage_something()

    def damage_something(self) -> None:
        """Damages a result of a job that has succeeded. Without a backup nothing would mend it."""
        if not self.backups.promised:
            return
        self.finished_jobs()
        fresh = {d for _, results in self.finished.values() for d in results.values()} - set(self.damaged)
        if not fresh:
            return
        digest = self.generator.choice(sorted(fresh))
        path = self.data / "artefacts" / digest[:2] / digest
        self.damaged[digest] = "being damaged"
        try:
            kind = damage(path, self.generator, keep_time=not self.service.alive())
        except OSError:
            kind = ""
        self.damaged[digest] = kind
        self.damages[kind] += 1

    def restore(self) -> None:
        """The machine fails, and the service is restored from a backup."""
        if not self.backups.promised:
            return
        if self.service.alive() and self.generator.random() < 0.3:
            self.service.stop()
        elif self.service.alive():
            self.service.kill_all()
        self.largest_at_the_restore = self.receiver.largest
        promise = self.backups.restore(self.service, self.generator)
        self.orders.begin_again(promise["accepted"])
        self.damaged.clear()
        self.finished = {}
        self.restores += 1
        self.service.start_patiently()
        _, page = self.client.json("GET", "/v1/jobs?page_size=1000")
        there = {job["job_id"] for job in page.get("jobs", [])}
        self.lost += [f"{i}: {job} is not in the restored service"
                      for i, job in promise["accepted"].items() if job not in there]
        now = self.finished_jobs()
        self.lost += [f"{job}: was finished, and is not so in the restored service"
                      for job, end in promise["finished"].items() if now.get(job, end) != end]

    def all_finished(self) -> bool:
        return self.orders.is_done() and len(self.finished_jobs()) >= len(self.orders.ids)

    def under_faults(self) -> bool:
        """Runs until all jobs are finished; false if the time is up before."""
        args, start = self.args, time.monotonic()
        faults = {self.kill_something: args.mean_s, self.damage_something: args.damage_mean_s,
                  self.begin_backup: args.backup_mean_s, self.restore: args.restore_mean_s}
        if args.database:
            faults = {self.kill_something: args.mean_s}
        due = {fault: start + self.generator.expovariate(1 / mean) for fault, mean in faults.items() if mean > 0}
        looked = start
        while time.monotonic() - start < args.limit_s:
            time.sleep(0.02)
            now = time.monotonic()
            for fault, moment in due.items():
                if now >= moment:
                    fault()
                    due[fault] = time.monotonic() + self.generator.expovariate(1 / faults[fault])
            refused = self.backups.refused_as_damaged
            if self.backups.poll() and self.backups.refused_as_damaged > refused:
                # The docs say: restore the backup.
                due[self.restore] = min(due.get(self.restore, now), now + self.generator.uniform(0, 5))
            if not self.service.alive():
                self.service.start_patiently()
            if now - looked > 1:
                looked = now
                self.show_progress(now - start)
                if self.all_finished() and (self.restores > 0 or args.restore_mean_s == 0 or args.database):
                    return True
        return False

    def show_progress(self, time_s: float) -> None:
        if sys.stderr.isatty() or int(time_s) % 10 == 0:
            print(f"{time_s:.0f} s: {len(self.finished)} of {len(self.orders.ids)} jobs finished, "
                  f"{sum(self.kills.values())} kills, {self.backups.made} backups, {self.restores} restores, "
                  f"{sum(self.damages.values())} damaged results", file=sys.stderr, flush=True)

    def until_finished(self, limit_s: float) -> None:
        deadline = time.monotonic() + limit_s
        while not self.all_finished() and time.monotonic() < deadline:
            time.sleep(0.5)
            if not self.service.alive():
                self.service.start_patiently()


def check_jobs(run: Run) -> dict[str, list]:
    """Reads all results of all jobs."""
    found = {"failed": [], "wrong": []}
    _, page = run.client.json("GET", "/v1/jobs?page_size=1000")
    by_id = {job["job_id"]: job for job in page.get("jobs", [])}
    _, present = run.orders.present()
    for request_id, job_id in present.items():
        job = by_id.get(job_id)
        if job is None:
            run.lost.append(f"{request_id}: {job_id} is gone")
            continue
        if job["state"] != "SUCCEEDED":
            found["failed"].append((request_id, job["state"], job.get("failure")))
            continue
        for result in job["results"]:
            run.reader.read(job_id, result, whole=True)
        got = {r["name"]: r["digest"] for r in job["results"] if is_reproducible(r["name"])}
        if got != run.references.of(*task_of(number_of(request_id))):
            found["wrong"].append((request_id, job_id, "other results than the command's"))
    found["twice"] = [None] * (len(by_id) - len(run.orders.ids))
    found["attempts"] = [job.get("attempts", 0) for job in by_id.values()]
    return found


def stored_events(run: Run) -> list[tuple]:
    """Id, type, job and state; of SQLite alone."""
    if run.args.database:
        return []
    store = sqlite3.connect(run.data / "jobs.sqlite")
    try:
        return store.execute("SELECT sequence, type, job_id, state FROM event ORDER BY sequence").fetchall()
    finally:
        store.close()


def check_events(run: Run) -> tuple[list, list]:
    """Events missed and events twice. The service is stopped, and has delivered all."""
    receiver, events = run.receiver, stored_events(run)
    missed = list(receiver.missed)
    for event_id, *event in events:
        if receiver.taken.get(event_id) != tuple(event):
            missed.append((event_id, *event))
    stored = {event[0] for event in events}
    if run.args.database:
        return missed, []
    # Events of a service before the last restore were taken too, and are not in the store.
    twice = [(i, *event) for i, event in receiver.taken.items()
             if i > run.largest_at_the_restore and i not in stored]
    ends = collections.Counter(job_id for _, kind, job_id, _ in events if kind in ("done", "failed", "cancelled"))
    twice += [(job_id, "ended", count) for job_id, count in ends.items() if count > 1]
    return sorted(set(missed)), twice


def read_arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="24 jobs and more faults, in about two minutes")
    parser.add_argument("--jobs", type=int)
    parser.add_argument("--mean-s", type=float, help="mean time between two kills")
    parser.add_argument("--backup-mean-s", type=float)
    parser.add_argument("--restore-mean-s", type=float)
    parser.add_argument("--damage-mean-s", type=float)
    parser.add_argument("--backup-folders", type=int, default=2, help="backups go there in turn")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--database", default="", help="PostgreSQL connection; default SQLite")
    parser.add_argument("--limit-s", type=float, default=3600)
    parser.add_argument("--keep", action="store_true", help="keep the folder, and say where it is")
    parser.add_argument("--json", help="file for the numbers")
    args = parser.parse_args()
    defaults = ({"jobs": 24, "mean_s": 4, "backup_mean_s": 4, "restore_mean_s": 15, "damage_mean_s": 3}
                if args.quick else
                {"jobs": 200, "mean_s": 4, "backup_mean_s": 8, "restore_mean_s": 40, "damage_mean_s": 5})
    for name, value in defaults.items():
        if getattr(args, name) is None:
            setattr(args, name, value)
    return args


def main() -> int:
    args = read_arguments()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    folder = pathlib.Path(tempfile.mkdtemp(prefix="sightline-faults-"))
    run = Run(args, folder)
    try:
        return measure(args, run)
    finally:
        if run.service.alive():
            run.service.kill_all()
        run.backups.kill()
        run.receiver.close()
        if args.keep:
            print(f"folder: {folder}")
        else:
            shutil.rmtree(folder, ignore_errors=True)


def measure(args, run: Run) -> int:
    start = time.monotonic()
    run.service.start()
    run.orders.start()
    run.reader.start()
    in_time = run.under_faults()
    run.reader.ending = True
    run.reader.join(70)
    run.backups.finish()
    if run.damaged and run.backups.promised:
        run.restore()  # the way back from damage
    if in_time:
        run.until_finished(600)
    unfinished = not (in_time and run.all_finished())
    found = check_jobs(run)
    last = time.monotonic() + 60
    while run.receiver.largest < max([0, *(event[0] for event in stored_events(run))]) and time.monotonic() < last:
        time.sleep(0.5)
    run.service.stop()
    missed, twice = check_events(run)
    lost = run.lost + run.orders.lost
    _, accepted = run.orders.present()
    report = {
        "jobs": args.jobs, "accepted": len(accepted), "refused": len(run.orders.refused), "lost": len(lost),
        "made twice": len(found["twice"]), "failed": len(found["failed"]),
        "wrong bytes": len(found["wrong"]) + len(run.reader.wrong),
        "needlessly refused": len(run.reader.needless),
        "unfinished": int(unfinished),
        "events missed": len(missed), "events twice": len(twice),
        "failed backups": len(run.backups.failed),
        "results read": dict(run.reader.counts), "damaged results": dict(run.damages),
        "backups": {"made": run.backups.made, "killed": run.backups.killed,
                    "refused as damaged": run.backups.refused_as_damaged,
                    "refused as another branch's": run.backups.refused_as_other_branch},
        "restores": run.restores, "kills": dict(run.kills),
        "events taken": len(run.receiver.taken), "deliveries repeated": run.receiver.repeated,
        "attempts per job": dict(sorted(collections.Counter(found["attempts"]).items())),
        "duration_s": round(time.monotonic() - start, 1),
        "store": "PostgreSQL" if args.database else "SQLite",
    }
    for key, value in report.items():
        print(f"{key:>24}: {value}")
    for entry in (lost + run.orders.refused + found["failed"] + found["wrong"] + run.reader.wrong
                  + run.reader.needless + missed + twice + run.backups.failed)[:20]:
        print("  ", entry)
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps(report, indent=1))
    bad = ["refused", "lost", "made twice", "failed", "wrong bytes", "needlessly refused", "unfinished",
           "events missed", "events twice", "failed backups"]
    return 1 if any(report[key] for key in bad) else 0


if __name__ == "__main__":
    sys.exit(main())
