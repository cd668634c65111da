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
        # The restores that lie behind the service, and behind the backup of each folder: a service
        # replaces a backup only if the backup's restores are the first ones of its own. A backup
        # that is killed leaves the earlier one or its own, so each has a set of possible restores.
        self.restores: set[tuple[int, ...]] = {()}
        self.restores_behind: dict[pathlib.Path, set[tuple[int, ...]]] = {}
        self.restore_count = 0
        self.process = None
        self.made = self.killed = self.refused_as_damaged = self.refused_as_other_branch = 0
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
            self.restores_behind[folder] = self.restores
        elif code == -signal.SIGKILL:
            self.killed += 1
            self.restores_behind.setdefault(folder, set()).update(self.restores)
        elif "is damaged" in message:
            self.refused_as_damaged += 1
        elif "holds the backup of another service" in message and self.is_other_branch(folder):
            self.refused_as_other_branch += 1
            self.choose_another(folder)
        else:
            self.failed.append(f"exit code {code}: {message.strip()[-300:]}")
        return True

    def is_other_branch(self, folder: pathlib.Path) -> bool:
        """Whether the service was restored from a backup that is older than a restore behind the
        backup in `folder`: the two then have different jobs, and neither may replace the other."""
        return any(ours[:len(theirs)] != theirs
                   for ours in self.restores for theirs in self.restores_behind.get(folder, ()))

    def choose_another(self, folder: pathlib.Path) -> None:
        """The next backup in place of `folder` goes to a new folder, as the message advises."""
        place = self.folders.index(folder)
        self.folders[place] = folder.with_name(f"backup-{self.refused_as_other_branch}-{place}")
        self.promised.pop(folder, None)
        self.restores_behind.pop(folder, None)
        shutil.rmtree(folder, ignore_errors=True)

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
        self.restore_count += 1
        self.restores = {(*behind, self.restore_count) for behind in self.restores_behind[folder]}
        return self.promised[folder]
