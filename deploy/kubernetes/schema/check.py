#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Checks what kustomize made of deploy/kubernetes.

    check.py NAME MANIFESTS FOLDER [--programs FOLDER]

MANIFESTS is YAML, FOLDER one that has node_modules of the package.json beside this file. Checks

- every object against the types of the Kubernetes API (unknown fields are errors) and against its
  schema (formats, patterns): by TypeScript and by kubernetes-models
- that pods cannot do more than they need, have limits and probes
- that what refers to something by name refers to something that is there
- with --programs: that the programs know the options that they are given

Exit codes: 0 all is well, 1 something is not.
"""

import argparse
import json
import os
import re
import subprocess
import sys

import yaml

PROGRAMS = {
    "coverage-server": ["coverage_server"],
    "render-worker": ["render_worker"],
    "planning-service": ["sightline", "serve"],
}


def check_types(objects, folder):
    """Objects as literals of their types: TypeScript finds fields that the types do not have."""
    lines = []
    names = {}
    for number, thing in enumerate(objects):
        module = "v1" if thing["apiVersion"] == "v1" else thing["apiVersion"]
        kind = thing["kind"]
        lines.append(f'import {{ {kind} as K{number}, I{kind} as I{number} }} from '
                     f'"kubernetes-models/{module}/{kind}";')
        names[number] = f'{kind} {thing["metadata"]["name"]}'
    for number, thing in enumerate(objects):
        lines.append(f"const o{number}: I{number} = {json.dumps(thing)};")
        lines.append(f"check({json.dumps(names[number])}, new K{number}(o{number}));")
    lines.append("""
function check(name: string, model: { validate(): void }) {
  try {
    model.validate();
  } catch (error) {
    console.error(`${name}: ${error}`);
    process.exitCode = 1;
  }
}""")
    path = os.path.join(folder, "objects.ts")
    with open(path, "w", encoding="utf-8") as file:
        file.write("declare const process: { exitCode: number };\n"
                   "declare const console: { error(text: string): void };\n")
        file.write("\n".join(lines))
    compiled = subprocess.run(
        ["node_modules/.bin/tsc", "--strict", "--target", "es2020", "--module", "commonjs",
         "--moduleResolution", "node", "--skipLibCheck", "objects.ts"],
        cwd=folder, stdout=subprocess.PIPE, text=True, check=False)
    if compiled.returncode != 0:
        with open(path, encoding="utf-8") as file:
            source = file.read().splitlines()
        for line in compiled.stdout.splitlines():
            found = re.match(r"objects\.ts\((\d+),", line)
            if not found:  # more about the line before, or an error without a place
                if "error TS" in line:
                    yield line
                continue
            number = re.match(r"const o(\d+):", source[int(found[1]) - 1])
            yield f"{names[int(number[1])] if number else '?'}: {line}"
        return
    run = subprocess.run(["node", "objects.js"], cwd=folder, stderr=subprocess.PIPE, text=True,
                         check=False)
    if run.returncode != 0:
        yield from run.stderr.splitlines()


def check_pod(name, template):
    spec = template["spec"]
    if spec.get("automountServiceAccountToken") is not False:
        yield f"{name}: gets a token of the cluster that it does not need"
    pod = spec.get("securityContext", {})
    if pod.get("runAsNonRoot") is not True or not pod.get("runAsUser"):
        yield f"{name}: may run as root"
    if pod.get("seccompProfile", {}).get("type") != "RuntimeDefault":
        yield f"{name}: has no seccomp profile"
    volumes = {volume["name"] for volume in spec.get("volumes", [])}
    for container in spec["containers"]:
        security = container.get("securityContext", {})
        if security.get("readOnlyRootFilesystem") is not True:
            yield f"{name}: can write to its root"
        if security.get("allowPrivilegeEscalation") is not False:
            yield f"{name}: can gain privileges"
        if security.get("capabilities", {}).get("drop") != ["ALL"]:
            yield f"{name}: keeps capabilities"
        for amount in ("requests", "limits"):
            if set(container.get("resources", {}).get(amount, {})) != {"cpu", "memory"}:
                yield f"{name}: has no {amount} of cpu and memory"
        for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
            ways = {"grpc", "exec"} & set(container.get(probe, {}))
            if len(ways) != 1:
                yield f"{name}: {probe} asks in {len(ways)} ways"
        for mount in container.get("volumeMounts", []):
            if mount["name"] not in volumes:
                yield f"{name}: mounts the volume {mount['name']}, which is not there"


def check_references(objects):
    pods = [thing["spec"]["template"] for thing in objects if thing["kind"] == "Deployment"]
    labels = [pod["metadata"]["labels"] for pod in pods]

    def selected(selector):
        return [pod for pod, own in zip(pods, labels)
                if all(own.get(key) == value for key, value in selector.items())]

    claims = {thing["metadata"]["name"] for thing in objects
              if thing["kind"] == "PersistentVolumeClaim"}
    maps = {thing["metadata"]["name"] for thing in objects if thing["kind"] == "ConfigMap"}
    for thing in objects:
        name = f'{thing["kind"]} {thing["metadata"]["name"]}'
        if thing["kind"] == "Service":
            found = selected(thing["spec"]["selector"])
            if len(found) != 1:
                yield f"{name}: selects {len(found)} deployments"
            for pod in found:
                ports = {port["name"] for port in pod["spec"]["containers"][0]["ports"]}
                for port in thing["spec"]["ports"]:
                    if port["targetPort"] not in ports:
                        yield f"{name}: no port {port['targetPort']}"
        if thing["kind"] in ("PodDisruptionBudget", "Deployment"):
            if not selected(thing["spec"]["selector"]["matchLabels"]):
                yield f"{name}: selects no pod"
        if thing["kind"] == "NetworkPolicy":
            for rule in thing["spec"]["podSelector"].get("matchExpressions", []):
                for value in rule["values"]:
                    if not selected({rule["key"]: value}):
                        yield f"{name}: {value} selects no pod"
        if thing["kind"] != "Deployment":
            continue
        for volume in thing["spec"]["template"]["spec"].get("volumes", []):
            claim = volume.get("persistentVolumeClaim", {}).get("claimName")
            if claim and claim not in claims:
                yield f"{name}: no claim {claim}"
            if "configMap" in volume and volume["configMap"]["name"] not in maps:
                yield f"{name}: no config map {volume['configMap']['name']}"


def check_options(objects, folder):
    for thing in objects:
        if thing["kind"] != "Deployment":
            continue
        for container in thing["spec"]["template"]["spec"]["containers"]:
            program, *words = PROGRAMS[container["name"]]
            text = subprocess.run([os.path.join(folder, program), *words, "--help"],
                                  stdout=subprocess.PIPE, text=True, check=True).stdout
            known = set(re.findall(r"--[a-z0-9-]+", text))
            args = list(container["args"])
            for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
                args += container[probe].get("exec", {}).get("command", [])
            for arg in args:
                option = arg.split("=")[0]
                if option.startswith("--") and option not in known:
                    yield f'{container["name"]}: {program} has no option {option}'


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("manifests")
    parser.add_argument("folder")
    parser.add_argument("--programs")
    given = parser.parse_args()
    with open(given.manifests, encoding="utf-8") as file:
        objects = [thing for thing in yaml.safe_load_all(file) if thing]
    errors = list(check_types(objects, given.folder))
    for thing in objects:
        if thing["kind"] == "Deployment":
            errors += check_pod(thing["metadata"]["name"], thing["spec"]["template"])
    errors += check_references(objects)
    if given.programs:
        errors += check_options(objects, given.programs)
    for error in errors:
        print(f"{given.name}: {error}", file=sys.stderr)
    if errors:
        return 1
    kinds = [thing["kind"] for thing in objects]
    print(f"{given.name}: {len(objects)} objects are well: "
          + ", ".join(f"{kinds.count(kind)} {kind}" for kind in sorted(set(kinds))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
