# SPDX-License-Identifier: Apache-2.0
"""Damage to stored results, as a failing disk or a careless person does it."""

import os
import pathlib
import random


def flip_byte(path: pathlib.Path, generator: random.Random) -> None:
    place = generator.randrange(path.stat().st_size)
    with open(path, "r+b") as file:
        file.seek(place)
        byte = file.read(1)[0]
        file.seek(place)
        file.write(bytes([byte ^ (1 << generator.randrange(8))]))


def truncate(path: pathlib.Path, generator: random.Random) -> None:
    os.truncate(path, generator.randrange(path.stat().st_size))


def replace(path: pathlib.Path, generator: random.Random) -> None:
    """Another content of the same size, as another file."""
    other = path.with_name("other")
    other.write_bytes(generator.randbytes(path.stat().st_size))
    other.rename(path)


KINDS = {"flipped byte": flip_byte, "truncated": truncate, "other content": replace}


def damage(path: pathlib.Path, generator: random.Random, keep_time: bool) -> str:
    """Damages a file; says how. With `keep_time` the time of change stays, so that only the bytes
    tell; a service remembers files that it has checked, so this is for a service that is down."""
    before = path.stat()
    if before.st_size == 0:
        return ""
    kind = generator.choice(sorted(KINDS))
    path.chmod(0o600)
    KINDS[kind](path, generator)
    path.chmod(0o400)
    if keep_time:
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns))
    return kind + (", same time" if keep_time else "")
