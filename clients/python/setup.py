# SPDX-License-Identifier: Apache-2.0
"""Generates the messages and stubs of proto/sightline/v1 into the package, then builds it."""
import importlib.util
import os
import pathlib
import shutil
import subprocess
import sys

from setuptools import setup
from setuptools.command.build_py import build_py

HERE = pathlib.Path(__file__).resolve().parent


def proto_root():
    """Folder of the contract: that of the source tree, or SIGHTLINE_PROTO."""
    root = pathlib.Path(os.environ.get("SIGHTLINE_PROTO", HERE.parent.parent / "proto"))
    if not (root / "sightline" / "v1").is_dir():
        raise SystemExit(f"{root}: has no sightline/v1; build in Sightline's source tree, or set "
                         "SIGHTLINE_PROTO to its folder proto")
    return root


def protoc_command():
    """The compiler, without files: grpc_tools if it is there, else protoc with its plugin."""
    if importlib.util.find_spec("grpc_tools"):
        return [sys.executable, "-m", "grpc_tools.protoc"], []
    protoc, plugin = shutil.which("protoc"), shutil.which("grpc_python_plugin")
    if not protoc or not plugin:
        raise SystemExit("protoc and grpc_python_plugin are needed (Debian: protobuf-compiler and "
                         "protobuf-compiler-grpc), or Python's grpc_tools")
    return [protoc], [f"--plugin=protoc-gen-grpc_python={plugin}"]


def generate(output):
    root = proto_root()
    compiler, plugin = protoc_command()
    protos = sorted(p.relative_to(root).as_posix() for p in root.glob("sightline/v1/*.proto"))
    services = [p for p in protos if p.endswith("_service.proto")]
    out = str(output)
    subprocess.check_call([*compiler, f"-I{root}", f"--python_out={out}", f"--pyi_out={out}",
                           *protos])
    subprocess.check_call([*compiler, f"-I{root}", *plugin, f"--grpc_python_out={out}", *services])
    (output / "sightline" / "v1" / "__init__.py").write_text(
        '"""Messages and stubs of sightline.v1, generated from the contract."""\n')
    # As data, not as modules: google.rpc may be installed on its own, and its messages must not be
    # registered twice.
    subprocess.check_call([*compiler, f"-I{root}", "--include_imports",
                           f"--descriptor_set_out={output / 'sightline' / 'google_rpc.desc'}",
                           "google/rpc/status.proto", "google/rpc/error_details.proto"])


class BuildWithStubs(build_py):
    def run(self):
        super().run()
        editable = getattr(self, "editable_mode", False)
        output = HERE / "src" if editable else pathlib.Path(self.build_lib)
        (output / "sightline" / "v1").mkdir(parents=True, exist_ok=True)
        generate(output)


setup(packages=["sightline"], package_dir={"": "src"}, package_data={"sightline": ["py.typed"]},
      cmdclass={"build_py": BuildWithStubs})
