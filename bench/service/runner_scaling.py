#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The same jobs on 1, 2 and 4 workers by each runner of the planning service, side by side.

A worker is a job at a time with a processor of its own, as far as the machine has so many: a process
on this machine, or a node of a Slurm on loopback. Says wall time of all jobs, CPU time per job (user
and system, by the control group of whatever starts them, without that itself; where groups cannot be
made, sampled from /proc), and whether results are the bytes of `sightline` alone. Exit code 1 if bytes differ, a job fails, or
the CPU time per job of a runner strays by more than --tolerance from its mean over the numbers of
workers. Slurm is left out, and said so, where its programs are not installed or the user is not
root. Kubernetes needs a cluster and is not measured.

With --starts every job is a plan of so many starts, and the workers are those of one job at a time,
which is split into as many parts. Every part builds the scene of its own, so that CPU time per job
grows with the parts; it is shown, and not held against the tolerance.

  bench/service/runner_scaling.py [--jobs 8] [--workers 1 2 4] [--runners local slurm] [--starts 1]
                                  [--tolerance 0.1] [--json FILE]
"""

import argparse
import atexit
import hashlib
import json
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time

from service import ROOT, HttpClient, Service, binary, block_task, stepped_block_stl

sys.path.insert(0, str(ROOT / "deploy" / "slurm"))
from loopback_cluster import SlurmCluster  # noqa: E402

LIMIT_S = 1800
SAMPLE_S = 0.02
TICKS = os.sysconf("SC_CLK_TCK")


def task_of(number: int, evaluations: int, starts: int) -> dict:
    task = block_task(number)
    task["plan_options"].update(evaluations_per_scan=evaluations, bound_evaluations=evaluations)
    if starts > 1:
        task["plan_options"]["starts"] = starts
    return task


def reference(folder: pathlib.Path, task: dict) -> dict[str, str]:
    folder.mkdir()
    (folder / "block.stl").write_bytes(stepped_block_stl())
    (folder / "inspection.json").write_text(json.dumps(task["inspection"]))
    options = task["plan_options"]
    subprocess.run(
        [binary(), "plan", "inspection.json", "--out", "out", "--seed", str(task["seed"]),
         "--evaluations-per-scan", str(options["evaluations_per_scan"]),
         "--bound-evaluations", str(options["bound_evaluations"]), "--no-pictures",
         *(["--starts", str(options["starts"])] if "starts" in options else [])],
        cwd=folder, check=True, capture_output=True)
    out = folder / "out"
    # The report tells how long things took.
    return {str(path.relative_to(out)): hashlib.sha256(path.read_bytes()).hexdigest()
            for path in out.rglob("*") if path.is_file() and path.suffix != ".html"}


def own_cpu_s(pid: int) -> float:
    """Of a process and its threads, without its children."""
    stat = pathlib.Path("/proc", str(pid), "stat").read_text()
    fields = stat[stat.rindex(")") + 2:].split()
    return (int(fields[11]) + int(fields[12])) / TICKS


class CpuGroup:
    """A control group of the kernel, for the CPU time of processes and all that they start."""

    def __init__(self):
        root = pathlib.Path("/sys/fs/cgroup")
        of_cpu = root / "cpuacct"
        self.file = "cpuacct.usage" if of_cpu.is_dir() else "cpu.stat"
        self.path = pathlib.Path(tempfile.mkdtemp(
            prefix="sightline-scaling-", dir=of_cpu if of_cpu.is_dir() else root))
        self.members: list[int] = []
        atexit.register(self.remove)

    def add(self, pid: int) -> None:
        (self.path / "cgroup.procs").write_text(str(pid))
        self.members.append(pid)

    def started_s(self) -> float:
        """Of what its members have started; they must live."""
        words = (self.path / self.file).read_text().split()
        whole = int(words[0]) / 1e9 if len(words) == 1 else int(words[1]) / 1e6
        return whole - sum(own_cpu_s(pid) for pid in self.members)

    def remove(self) -> None:
        for _ in range(100):  # until its processes have ended
            try:
                self.path.rmdir()
                return
            except OSError:
                time.sleep(0.1)


def make_group(pids: list[int]) -> CpuGroup | None:
    try:
        group = CpuGroup()
        for pid in pids:
            group.add(pid)
        return group
    except OSError:
        return None


class CpuTimes(threading.Thread):
    """CPU seconds of every process whose working folder is a job's, as last seen."""

    def __init__(self, work: pathlib.Path):
        super().__init__(daemon=True)
        self.work, self.ending = str(work) + "/", False
        self.seconds: dict[tuple[str, str, str], float] = {}  # by job, process and its start

    def look(self) -> None:
        for pid in os.listdir("/proc"):
            if not pid.isdigit():
                continue
            try:
                folder = os.readlink(f"/proc/{pid}/cwd")
                if not folder.startswith(self.work):
                    continue
                stat = pathlib.Path("/proc", pid, "stat").read_text()
            except OSError:
                continue
            fields = stat[stat.rindex(")") + 2:].split()
            job = folder[len(self.work):].split("/")[0]
            # Fields 14, 15 and 22 of proc(5), counted behind the name.
            self.seconds[job, pid, fields[19]] = (int(fields[11]) + int(fields[12])) / TICKS

    def run(self) -> None:
        while not self.ending:
            self.look()
            time.sleep(SAMPLE_S)

    def of_job(self, job_id: str) -> float:
        return sum(s for (job, _, _), s in self.seconds.items() if job == job_id)


def measure(folder: pathlib.Path, runner: str, workers: int, tasks: list[dict],
            references: list[dict[str, str]], nodes: list[int]) -> dict:
    """`nodes`: processes that start the commands; none: the service does."""
    split = "starts" in tasks[0]["plan_options"]
    options = ["--runner", runner, "--workers", str(1 if split else workers), "--min-free", "64MB",
               "--parts", str(workers if split else 1), "--log-level", "warning"]
    if runner == "slurm":
        options += ["--cpus", "1"]
    folder.mkdir()
    service = Service(str(folder / "data"), *options)
    service.start()
    client = HttpClient(service)
    group = make_group(nodes or [service.process.pid])
    atexit.register(service.stop)  # also where this is interrupted, before the group goes
    before_s = group.started_s() if group else 0
    times = CpuTimes(folder / "data" / "work")
    times.start()
    start = time.monotonic()
    ids = []
    for i, task in enumerate(tasks):
        status, answer = client.create(task, {"block.stl": stepped_block_stl()}, f"job-{i}")
        if status not in (200, 201):
            raise RuntimeError(f"not accepted: {answer}")
        ids.append(answer["job_id"])
    states: list[str] = []
    while time.monotonic() - start < LIMIT_S:
        _, page = client.json("GET", "/v1/jobs?page_size=1000")
        states = [job["state"] for job in page["jobs"]]
        if not {"QUEUED", "RUNNING"} & set(states):
            break
        time.sleep(0.05)
    wall_s = time.monotonic() - start
    if group and nodes:
        time.sleep(3)  # the watching processes end by themselves
    cpu_s = group.started_s() - before_s if group else 0
    times.ending = True
    times.join()
    same = 0
    for job_id, expected in zip(ids, references):
        _, job = client.json("GET", f"/v1/jobs/{job_id}")
        got = {r["name"]: hashlib.sha256(client.result(job_id, r["name"])[1]).hexdigest()
               for r in job.get("results", []) if not r["name"].endswith(".html")}
        same += got == expected
    service.stop()
    if not group:
        cpu_s = sum(times.of_job(job_id) for job_id in ids)
    return {"runner": runner, "workers": workers, "jobs": len(ids),
            "succeeded": states.count("SUCCEEDED"), "same_bytes": same,
            "wall_s": round(wall_s, 2), "cpu_s_per_job": round(cpu_s / len(ids), 3),
            "cpu_by": "control group" if group else "samples"}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--jobs", type=int, default=8)
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 4])
    parser.add_argument("--runners", nargs="+", default=["local", "slurm"])
    parser.add_argument("--starts", type=int, default=1, help="of every plan")
    parser.add_argument("--evaluations", type=int, default=20000, help="of every scan of a plan")
    parser.add_argument("--tolerance", type=float, default=0.1)
    parser.add_argument("--json", help="file for the numbers")
    args = parser.parse_args()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="sightline-scaling-"))
    folder.chmod(0o755)
    tasks = [task_of(i + 1, args.evaluations, args.starts) for i in range(args.jobs)]
    processors = sorted(os.sched_getaffinity(0))
    references = [reference(folder / f"reference-{i}", task) for i, task in enumerate(tasks)]
    rows, skipped = [], []
    print(f"{len(processors)} processors, {args.jobs} plans of {args.starts} starts with "
          f"{args.evaluations} evaluations a scan")
    print(f"{'runner':>10} {'workers':>8} {'wall [s]':>9} {'speed-up':>9} {'CPU/job [s]':>12} {'same bytes':>11}")
    for runner in args.runners:
        first = None
        for workers in args.workers:
            at = folder / f"{runner}-{workers}"
            if runner == "slurm":
                try:
                    with SlurmCluster(folder / f"cluster-{workers}", nodes=workers,
                                      pinned=True) as cluster:
                        os.environ["SLURM_CONF"] = str(cluster.configuration)
                        row = measure(at, runner, workers, tasks, references, cluster.node_pids())
                except (FileNotFoundError, PermissionError) as error:
                    skipped.append(f"slurm is left out: {error}")
                    break
            else:
                os.sched_setaffinity(0, processors[:workers])
                row = measure(at, runner, workers, tasks, references, [])
                os.sched_setaffinity(0, processors)
            first = first or row["wall_s"]
            row["speed_up"] = round(first / row["wall_s"], 2)
            rows.append(row)
            print(f"{runner:>10} {workers:>8} {row['wall_s']:>9} {row['speed_up']:>9} "
                  f"{row['cpu_s_per_job']:>12} {row['same_bytes']:>7}/{row['jobs']}", flush=True)
    bad = [row for row in rows if row["same_bytes"] != row["jobs"] or row["succeeded"] != row["jobs"]]
    for runner in args.runners:
        cpu = [row["cpu_s_per_job"] for row in rows if row["runner"] == runner]
        if not cpu:
            continue
        mean = statistics.mean(cpu)
        stray = max(abs(c - mean) for c in cpu) / mean
        print(f"{runner}: CPU time per job strays by {100 * stray:.1f} % from its mean")
        if args.starts == 1 and stray > args.tolerance:
            bad.append({"runner": runner, "stray": stray})
    for line in skipped:
        print(line)
    if args.json:
        pathlib.Path(args.json).write_text(json.dumps({"rows": rows, "skipped": skipped}, indent=1))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
