# SPDX-License-Identifier: Apache-2.0
"""Backups of a planning service under faults: `sightline backup` into folders in turn, and restores
of them."""

import pathlib
import random
import shutil
import signal
import subprocess

from service import Service, binary


class Backups:
    """A backup promises what the service had answered before the backup began."""

    def __init__(self, data: pathlib.Path, folders: list[pathlib.Path]):
        self.data, self.folders = data, folders
        self.promised: dict[pathlib.Path, dict] = {}  # by folder with a concluded backup
        self.process = None
        self.made = self.killed = self.refused_as_damaged = 0
        self.failed: list[str] = []
        self.next_folder = 0

    def begin(self, promise: dict) -> None:
        """`promise`: anything that must be there after a restore of this backup."""
        folder = self.folders[self.next_folder % len(self.folders)]
        self.next_folder += 1
        self.running = (folder, promise)
        self.process = subprocess.Popen([binary(), "backup", str(self.data), "--out", str(folder)],
                                        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def poll(self) -> bool:
        """Whether a backup that was running has ended; keeps its promise if it was concluded."""
        if self.process is None or self.process.poll() is None:
            return False
        folder, promise = self.running
        message = self.process.stderr.read()
        self.process.stderr.close()
        code, self.process = self.process.returncode, None
        if code == 0:
            self.made += 1
            self.promised[folder] = promise
        elif code == -signal.SIGKILL:
            self.killed += 1
        elif "is damaged" in message:
            self.refused_as_damaged += 1
        else:
            self.failed.append(f"exit code {code}: {message.strip()[-300:]}")
        return True

    def kill(self) -> bool:
        if self.process is None or self.process.poll() is not None:
            return False
        self.process.kill()
        self.process.wait()
        return True

    def finish(self) -> None:
        if self.process is not None:
            self.process.wait()
            self.poll()

    def restore(self, service: Service, generator: random.Random) -> dict:
        """The service's data folder becomes a copy of a backup; returns its promise. The service
        is down before and after."""
        assert not service.alive()
        self.finish()
        folder = generator.choice(sorted(self.promised))
        # A restored folder is a new one: the database's write-ahead log of the old one stays with it.
        old = self.data.with_name("data-before")
        self.data.rename(old)
        shutil.copytree(folder, self.data)
        shutil.rmtree(old, ignore_errors=True)
        return self.promised[folder]
