# SPDX-License-Identifier: Apache-2.0
"""Stands in for the commands of Slurm and Kubernetes: arrays of processes on this machine.

  fake_cluster.py sbatch|squeue|scancel|kubectl ARGUMENTS

State is in the folder $FAKE_CLUSTER. An array is ID.json, kept by a process of its own. Files there
make things go wrong: `unavailable` (nothing is answered), `refuse` (submissions are refused with its
text), `forget` (ended arrays are unknown), `lose-K` (element K loses its machine, once), `state`
(what squeue says of everything that runs), `end-K` (state that element K ends with). `check`: manifests are checked against
the schemas of Kubernetes, in $KUBERNETES_SCHEMA.
"""
import json
import os
import pathlib
import signal
import subprocess
import sys
import time

STATE = pathlib.Path(os.environ["FAKE_CLUSTER"])
ENDED = ("COMPLETED", "FAILED", "NODE_FAIL", "OUT_OF_MEMORY", "TIMEOUT", "CANCELLED")


def fail(message):
    sys.stderr.write(message + "\n")
    sys.exit(1)


def read(array):
    return json.loads((STATE / f"{array}.json").read_text())


def write(array, content):
    new = STATE / f"{array}.new"
    new.write_text(json.dumps(content))
    new.rename(STATE / f"{array}.json")


def option(arguments, name):
    values = [a[len(name) + 1:] for a in arguments if a.startswith(name + "=")]
    return values[-1] if values else ""


def submit(array, content):
    (STATE / "submissions").open("a").write(json.dumps(content) + "\n")
    content["states"] = ["PENDING"] * content["size"]
    write(array, content)
    if os.fork():
        return
    os.setsid()
    null = os.open("/dev/null", os.O_RDWR)
    for fd in (0, 1, 2):
        os.dup2(null, fd)
    keep(array, content)
    os._exit(0)


def may_begin(content):
    if (content["suspended"] and not (STATE / f"{content['id']}.released").exists()) or \
            (STATE / "hold").exists():
        return False
    return not content["after"] or all(s == "COMPLETED" for s in read(content["after"])["states"])


def keep(array, content):
    """Runs the elements; begins as the array's own process, ends with the last of them."""
    cancelled = STATE / f"{array}.cancel"
    while not may_begin(content) and not cancelled.exists():
        if content["after"]:
            before = read(content["after"])["states"]
            if any(s in ENDED and s != "COMPLETED" for s in before):
                cancelled.touch()
        time.sleep(0.02)
    running = {}
    if cancelled.exists():
        content["states"] = ["CANCELLED"] * content["size"]
    else:
        for i in range(content["size"]):
            environment = dict(os.environ, SLURM_ARRAY_TASK_ID=str(i + 1),
                               JOB_COMPLETION_INDEX=str(i))
            running[i] = subprocess.Popen(["/bin/sh", "-c", content["command"]], env=environment,
                                          cwd=content["folder"], start_new_session=True,
                                          stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                          stderr=subprocess.DEVNULL)
            content["states"][i] = "RUNNING"
    write(array, content)
    while running:
        for i, process in list(running.items()):
            lose = STATE / f"lose-{i + 1}"
            forced = STATE / f"end-{i + 1}"
            state = None
            if lose.exists():
                lose.unlink()
                state = "NODE_FAIL"
            elif cancelled.exists():
                state = "CANCELLED"
            elif process.poll() is not None:
                state = "COMPLETED" if process.returncode == 0 else "FAILED"
                if forced.exists():
                    state = forced.read_text().strip()
            if state:
                try:
                    os.killpg(process.pid, signal.SIGKILL)
                except ProcessLookupError:
                    pass
                process.wait()
                content["states"][i] = state
                del running[i]
                write(array, content)
        time.sleep(0.02)


def arrays():
    return sorted(p.stem for p in STATE.glob("*.json"))


def cancel(array):
    (STATE / f"{array}.cancel").touch()


def refuse():
    if (STATE / "refuse").exists():
        fail((STATE / "refuse").read_text())


def sbatch(arguments):
    if arguments == ["--version"]:
        print("slurm-wlm 22.05.8")
        return
    refuse()
    array = str(len(arrays()) + 1)
    first, last = option(arguments, "--array").split("-")
    assert first == "1", arguments
    submit(array, {"id": array, "name": option(arguments, "--job-name"), "size": int(last),
                   "folder": option(arguments, "--chdir"), "suspended": False,
                   "after": option(arguments, "--dependency").removeprefix("afterok:"),
                   "command": option(arguments, "--wrap"), "arguments": arguments})
    print(array)


def squeue(arguments):
    array = option(arguments, "--jobs")
    if not (STATE / f"{array}.json").exists():
        fail("slurm_load_jobs error: Invalid job id specified")
    states = read(array)["states"]
    if (STATE / "forget").exists() and all(s in ENDED for s in states):
        fail("slurm_load_jobs error: Invalid job id specified")
    for i, state in enumerate(states):
        if state == "RUNNING" and (STATE / "state").exists():
            state = (STATE / "state").read_text().strip()
        reason = "None"
        if state == "PENDING":
            reason = "Resources"
        elif state == "CANCELLED" and read(array)["after"]:
            reason = "DependencyNeverSatisfied"
        print(f"{i + 1}|{state}|{reason}")


def scancel(arguments):
    name = option(arguments, "--name")
    for array in arrays():
        if array == arguments[-1] or (name and read(array)["name"] == name):
            cancel(array)


def pod(content, i, state):
    phases = {"PENDING": "Pending", "RUNNING": "Running", "COMPLETED": "Succeeded"}
    status = {"phase": phases.get(state, "Failed")}
    if state == "NODE_FAIL":
        status["reason"] = "NodeLost"
    elif state == "TIMEOUT":
        status["reason"] = "DeadlineExceeded"
    elif state in ("OUT_OF_MEMORY", "FAILED"):
        reason = "OOMKilled" if state == "OUT_OF_MEMORY" else "Error"
        status["containerStatuses"] = [{"state": {"terminated": {"reason": reason}}}]
    return {"kind": "Pod", "metadata": {"annotations": {
        "batch.kubernetes.io/job-completion-index": str(i)}}, "status": status}


def check_manifest(path):
    """Against the schemas of Kubernetes, as its server does."""
    script = pathlib.Path(__file__).parent / "kubernetes_schema" / "check_manifest.cjs"
    checked = subprocess.run(["node", script, path], capture_output=True, text=True,
                             env=dict(os.environ, NODE_PATH=os.environ["KUBERNETES_SCHEMA"]))
    if checked.returncode != 0:
        fail(f"error: error validating data: {checked.stderr}")
    with (STATE / "checked").open("a") as file:
        file.write(f"{path}\n")


def kubectl(arguments):
    arguments = [a for a in arguments if not a.startswith("--namespace=")]
    verb, arguments = arguments[0], arguments[1:]
    selector = option(arguments, "--selector")
    if verb == "version":
        print("Client Version: v1.32")
    elif verb == "create":
        refuse()
        if (STATE / "check").exists():
            check_manifest(option(arguments, "--filename"))
        manifest = json.loads(pathlib.Path(option(arguments, "--filename")).read_text())
        spec = manifest["spec"]
        container = spec["template"]["spec"]["containers"][0]
        assert container["command"][:2] == ["/bin/sh", "-c"], container
        assert spec["completionMode"] == "Indexed" and spec["parallelism"] == spec["completions"]
        submit(manifest["metadata"]["name"], {
            "id": manifest["metadata"]["name"], "name": manifest["metadata"]["labels"]["sightline/job"],
            "size": spec["completions"], "folder": container["workingDir"], "after": "",
            "suspended": spec["suspend"], "command": container["command"][2], "arguments": manifest})
    elif verb == "patch":
        (STATE / f"{arguments[1]}.released").touch()
    elif verb == "get":
        array = selector.split("=")[1]
        items = []
        if (STATE / f"{array}.json").exists() and not (STATE / f"{array}.cancel").exists():
            content = read(array)
            states = content["states"]
            ended = all(s in ENDED for s in states)
            if not ((STATE / "forget").exists() and ended):
                failed = any(s in ENDED and s != "COMPLETED" for s in states)
                conditions = [{"type": "Failed", "status": "True"}] if failed else []
                items = [{"kind": "Job", "status": {"conditions": conditions}}]
                items += [pod(content, i, s) for i, s in enumerate(states)]
        elif (STATE / f"{array}.json").exists():
            # Deleted: its pods are there until they have ended.
            items = [pod(read(array), i, s) for i, s in enumerate(read(array)["states"])
                     if s == "RUNNING"]
        print(json.dumps({"kind": "List", "items": items}))
    elif verb == "delete":
        label, value = selector.split("=")
        for array in arrays():
            if array == value or (label == "sightline/job" and read(array)["name"] == value):
                cancel(array)
    else:
        fail(f"error: unknown command {verb}")


if __name__ == "__main__":
    if (STATE / "unavailable").exists():
        fail("Unable to contact slurm controller (connect failure)" if sys.argv[1] != "kubectl" else
             "Unable to connect to the server: dial tcp: connection refused")
    {"sbatch": sbatch, "squeue": squeue, "scancel": scancel, "kubectl": kubectl}[sys.argv[1]](
        sys.argv[2:])
