# SPDX-License-Identifier: Apache-2.0
"""A Slurm cluster on this machine: munged, slurmctld and several slurmd on loopback, each with the
processors it is told. Needs root, and Debian's munge, slurmctld, slurmd and slurm-client."""

import os
import pathlib
import shutil
import signal
import socket
import subprocess
import time

FIRST_PORT = 16817
CONFIGURATION = """\
ClusterName=loopback
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={port}
SlurmUser=root
SlurmdUser=root
AuthType=auth/munge
AuthInfo=socket={folder}/munge.sock
CredType=cred/munge
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool-%n
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/%n.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/%n.log
# No control groups: they need an init system.
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
SwitchType=switch/none
MpiDefault=none
SelectType=select/cons_tres
SelectTypeParameters=CR_CPU_Memory
# Every slurmd says it has what stands here, not what the machine has.
SlurmdParameters=config_overrides
ReturnToService=2
SlurmdTimeout={node_timeout_s}
SchedulerParameters=sched_interval=2
KillWait=5
MinJobAge=60
NodeName=node[1-{nodes}] NodeHostname={host} NodeAddr=127.0.0.1 Port=[{first}-{last}] CPUs=1 RealMemory=8000
PartitionName=loopback Nodes=ALL Default=YES MaxTime=INFINITE State=UP
"""


def is_running(pid: int) -> bool:
    try:
        return ") Z" not in pathlib.Path(f"/proc/{pid}/stat").read_text()
    except OSError:
        return False


def end(pid: int, number: int = signal.SIGTERM) -> None:
    try:
        os.kill(pid, number)
    except ProcessLookupError:
        pass


class SlurmCluster:
    """As a context manager: up inside, all of its processes ended after it."""

    def __init__(self, folder: pathlib.Path, nodes: int = 3, node_timeout_s: int = 10,
                 pinned: bool = False):
        for program in ("munged", "slurmctld", "slurmd", "sbatch"):
            if not shutil.which(program):
                raise FileNotFoundError(
                    f"{program} is missing: apt-get install munge slurmctld slurmd slurm-client")
        if os.geteuid() != 0:
            raise PermissionError("slurmctld and slurmd need root")
        self.folder = folder
        self.nodes = nodes
        self.node_timeout_s = node_timeout_s
        # Every node has one of the processors to itself, as far as there are so many.
        self.processors = sorted(os.sched_getaffinity(0)) if pinned else []
        self.configuration = folder / "slurm.conf"
        self.pids: list[int] = []

    def environment(self) -> dict[str, str]:
        return {**os.environ, "SLURM_CONF": str(self.configuration)}

    def run(self, *words: str) -> str:
        return subprocess.run(words, env=self.environment(), check=True, text=True,
                              capture_output=True).stdout

    def pid_of(self, name: str) -> int:
        """Programs go into the background and leave their number in a file."""
        path = self.folder / f"{name}.pid"
        for _ in range(100):
            try:
                return int(path.read_text())
            except (OSError, ValueError):
                time.sleep(0.1)
        raise TimeoutError(f"{name} did not start: see {self.folder}")

    def start_node(self, number: int) -> None:
        (self.folder / f"node{number}.pid").unlink(missing_ok=True)
        words = ["slurmd", "-f", str(self.configuration), "-N", f"node{number}"]
        if self.processors:
            processor = self.processors[(number - 1) % len(self.processors)]
            words = ["taskset", "--cpu-list", str(processor), *words]
        self.run(*words)
        self.pids.append(self.pid_of(f"node{number}"))

    def __enter__(self):
        # Munge wants folders that nobody else can write to.
        self.folder.mkdir(parents=True, exist_ok=True, mode=0o755)
        self.folder.chmod(0o755)
        (self.folder / "state").mkdir()
        host = socket.gethostname().split(".")[0]
        self.configuration.write_text(CONFIGURATION.format(
            folder=self.folder, host=host, port=FIRST_PORT, first=FIRST_PORT + 1,
            last=FIRST_PORT + self.nodes, nodes=self.nodes, node_timeout_s=self.node_timeout_s))
        key = self.folder / "munge.key"
        key.touch(mode=0o600)
        key.write_bytes(os.urandom(64))
        try:
            self.run("munged", "--key-file", str(key), "--socket", f"{self.folder}/munge.sock",
                     "--pid-file", f"{self.folder}/munged.pid", "--log-file",
                     f"{self.folder}/munged.log", "--seed-file", f"{self.folder}/munged.seed",
                     "--force")
            self.pids.append(self.pid_of("munged"))
            self.run("slurmctld", "-f", str(self.configuration))
            self.pids.append(self.pid_of("slurmctld"))
            for number in range(1, self.nodes + 1):
                (self.folder / f"spool-node{number}").mkdir()
                self.start_node(number)
            self.wait_until_idle()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_):
        if (self.folder / "slurmctld.pid").exists():
            subprocess.run(["scancel", "--user=root"], env=self.environment(), capture_output=True)
        # munged last: the others speak by it.
        for pid in reversed(self.pids):
            end(pid)
            for _ in range(100):
                if not is_running(pid):
                    break
                time.sleep(0.1)
            else:
                end(pid, signal.SIGKILL)

    def states(self) -> dict[str, str]:
        lines = self.run("sinfo", "--noheader", "--Node", "--format=%N %t").split("\n")
        return dict(line.split() for line in lines if line)

    def wait_until_idle(self) -> None:
        for _ in range(300):
            if list(self.states().values()) == ["idle"] * self.nodes:
                return
            time.sleep(0.1)
        raise TimeoutError(f"nodes are not idle: {self.states()}")

    def busy_nodes(self) -> list[int]:
        """Numbers of nodes that run something."""
        lines = self.run("squeue", "--noheader", "--states=RUNNING", "--format=%N").split()
        return sorted({int(name.removeprefix("node")) for name in lines})

    def node_pids(self) -> list[int]:
        """Of the slurmd of every node, which starts what runs there."""
        return [self.pid_of(f"node{number}") for number in range(1, self.nodes + 1)]

    def steps_of(self, number: int) -> list[int]:
        """Processes of the jobs on a node: slurmstepd of each, and all that descend from it."""
        jobs = self.run("squeue", "--noheader", "--states=RUNNING", f"--nodelist=node{number}",
                        "--format=%A").split()
        titles = {f"slurmstepd: [{job}.batch]" for job in jobs}
        children: dict[int, list[int]] = {}
        steps = []
        for entry in os.listdir("/proc"):
            if not entry.isdigit():
                continue
            try:
                stat = pathlib.Path("/proc", entry, "stat").read_text()
                words = pathlib.Path("/proc", entry, "cmdline").read_bytes()
            except OSError:
                continue
            children.setdefault(int(stat[stat.rindex(")") + 2:].split()[1]), []).append(int(entry))
            if words.decode(errors="replace").strip("\0 ") in titles:
                steps.append(int(entry))
        for pid in steps:
            steps += children.get(pid, [])
        return steps

    def kill_node(self, number: int) -> None:
        """As a machine whose power goes: slurmd and all that it runs, at once."""
        pid = self.pid_of(f"node{number}")
        for victim in [pid, *self.steps_of(number)]:
            end(victim, signal.SIGKILL)
        self.pids.remove(pid)
