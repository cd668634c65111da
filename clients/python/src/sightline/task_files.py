# SPDX-License-Identifier: Apache-2.0
"""Reads inspections and recordings, and finds the files that they name.

A task names its files by paths below a folder of the job. Files keep their places relative to each
other, so that a material file still finds the tables beside it; where some lie outside of the
inspection's folder, paths start at the folder that holds all of them.
"""
from __future__ import annotations

import hashlib
import os
import pathlib
import posixpath
import re
from dataclasses import dataclass
from typing import Any, Callable, Dict, Iterator, List, Mapping, Sequence, Tuple, Union

from google.protobuf import json_format
from google.protobuf.message import Message

from . import errors
from .v1 import inspection_pb2, material_pb2, plan_pb2, recording_pb2

PathLike = Union[str, "os.PathLike[str]"]
# A path, or the bytes themselves.
Content = Union[PathLike, bytes]
# By the names that the task uses; or paths that are named by their last part.
Files = Union[Mapping[str, Content], Sequence[PathLike], None]

_BLOCK_BYTES = 1 << 20
_MAX_FILES = 10000


@dataclass(frozen=True)
class TaskFile:
    """A file that goes with a task."""

    name: str  # as the task names it
    content: Content
    digest: str  # SHA-256, lower-case hex
    size_bytes: int

    def chunks(self) -> Iterator[bytes]:
        """The bytes in pieces of at most 1 MiB."""
        if isinstance(self.content, bytes):
            for start in range(0, len(self.content), _BLOCK_BYTES):
                yield self.content[start:start + _BLOCK_BYTES]
            return
        with open(self.content, "rb") as file:
            while block := file.read(_BLOCK_BYTES):
                yield block


def make_task_file(name: str, content: Content) -> TaskFile:
    """TaskError if the file cannot be read."""
    file = TaskFile(name, content, "", 0)
    digest = hashlib.sha256()
    size_bytes = 0
    try:
        for block in file.chunks():
            digest.update(block)
            size_bytes += len(block)
    except OSError as error:
        raise errors.TaskError(f"{name}: cannot be read: {error}") from None
    return TaskFile(name, content, digest.hexdigest(), size_bytes)


# A string, which ends with its line at the latest, or a comment: from // to the end of the line.
_STRING_OR_COMMENT = re.compile(r'"(?:\\[^\n]|[^"\\\n])*"?|//[^\n]*')


def without_comments(text: str) -> str:
    """JSON as people may write it in files for Sightline, with spaces in place of its comments."""
    def blank(match: "re.Match[str]") -> str:
        found = match.group()
        return " " * len(found) if found.startswith("//") else found
    return _STRING_OR_COMMENT.sub(blank, text)


def parse_message(text: Union[str, Mapping[str, Any]], message: Any, name: str) -> Any:
    """Fills `message` from JSON, which may have // comments. TaskError names the unknown field."""
    try:
        if isinstance(text, str):
            return json_format.Parse(without_comments(text), message)
        return json_format.ParseDict(dict(text), message)
    except (json_format.ParseError, TypeError, ValueError) as error:
        raise errors.TaskError(f"{name}: {error}") from None


def _read_text(path: pathlib.Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise errors.TaskError(f"{path}: cannot be read: {error}") from None


def read_document(source: Any, message: Message, file_in_folder: str,
                  folder: PathLike) -> Tuple[Any, pathlib.Path]:
    """A copy of the document, and the folder that its paths are relative to.

    `source`: a dict, a message, a path, or a folder that holds `file_in_folder`. `folder` is that
    of dicts and messages.
    """
    if isinstance(source, type(message)):
        message.CopyFrom(source)
        return message, pathlib.Path(folder)
    if isinstance(source, Mapping):
        return parse_message(source, message, file_in_folder), pathlib.Path(folder)
    if isinstance(source, (str, os.PathLike)):
        path = pathlib.Path(source)
        if path.is_dir():
            path = path / file_in_folder
        return parse_message(_read_text(path), message, str(path)), path.parent
    raise errors.TaskError(f"{file_in_folder}: must be a path, a dict or a "
                           f"{type(message).__name__}, not {type(source).__name__}")


def read_inspection(source: Any, folder: PathLike) -> Tuple[Any, pathlib.Path]:
    return read_document(source, inspection_pb2.Inspection(), "inspection.json", folder)


def read_recordings(source: Any, folder: PathLike) -> Tuple[Any, pathlib.Path]:
    return read_document(source, recording_pb2.Recordings(), "recordings.json", folder)


def read_plan(source: Any, folder: PathLike) -> Any:
    return read_document(source, plan_pb2.Plan(), "plan.json", folder)[0]


@dataclass(frozen=True)
class _Reference:
    """A field that names a file."""

    message: Any
    field: str
    path: str  # e.g. "materials[0].file"

    @property
    def value(self) -> str:
        return str(getattr(self.message, self.field))


def file_references(message: Any, path: str = "") -> Iterator[_Reference]:
    """All fields `file` and `..._file` of a message that are set."""
    for field, value in message.ListFields():
        here = f"{path}.{field.name}" if path else field.name
        if field.type == field.TYPE_STRING and re.fullmatch(r"(.*_)?file", field.name):
            # The mesh of recordings is only described: it comes with the task by another field.
            if message.DESCRIPTOR.full_name != "sightline.v1.Recordings.RecordedPart":
                yield _Reference(message, field.name, here)
        elif field.type == field.TYPE_MESSAGE and not isinstance(value, Mapping):
            many = not isinstance(value, Message)
            for i, part in enumerate(value if many else [value]):
                yield from file_references(part, f"{here}[{i}]" if many else here)


class TaskFiles:
    """Collects the files of a task and gives every one of them a name."""

    def __init__(self, given: Files) -> None:
        # Files that the caller gave keep the names they were given by.
        self._given: Dict[str, Content] = {}
        if isinstance(given, Mapping):
            self._given = {str(name): content for name, content in given.items()}
        elif given is not None:
            for path in given:
                self._given[pathlib.Path(path).name] = path
        for name in self._given:
            if posixpath.normpath(name) != name or name.startswith(("/", "..")) or "\\" in name:
                raise errors.TaskError(f"files: '{name}' must be a path below the inspection")
        self._found: Dict[pathlib.Path, None] = {}
        self._references: List[Tuple[_Reference, pathlib.Path]] = []
        self._folders: List[pathlib.Path] = []

    def give(self, name: str, content: Content) -> str:
        """Adds a file that is not on disk under this name; returns the name."""
        if name in self._given:
            raise errors.TaskError(f"files: '{name}' is given twice")
        self._given[name] = content
        return name

    def add(self, message: Any, folder: pathlib.Path, context: str) -> None:
        """Finds the files that `message` names, and those that these name. TaskError: not there."""
        folder = pathlib.Path(os.path.abspath(folder))
        self._folders.append(folder)
        for reference in file_references(message):
            if reference.value in self._given:
                self._follow_given(reference, context)
                continue
            path = self._find(folder, reference.value)
            if not path.is_file():
                raise errors.TaskError(f"{context}: {reference.path}: no file {path}")
            self._add_path(path)
            self._references.append((reference, path))
            self._follow(reference, path)

    def finish(self) -> List[TaskFile]:
        """Writes the files' names into the messages; all files in the order of their names."""
        root = self._root()
        named: Dict[str, Content] = dict(self._given)
        for path in self._found:
            name = path.relative_to(root).as_posix()
            if name in named and named[name] != path:
                raise errors.TaskError(f"files: '{name}' is given, and is also {path}")
            named[name] = path
        for reference, path in self._references:
            setattr(reference.message, reference.field, path.relative_to(root).as_posix())
        return [make_task_file(name, named[name]) for name in sorted(named)]

    def _root(self) -> pathlib.Path:
        folder = self._folders[0] if self._folders else pathlib.Path(os.path.abspath("."))
        outside = [p for p in self._found if folder not in p.parents]
        if not outside:
            return folder
        try:
            return pathlib.Path(os.path.commonpath([p.parent for p in self._found]))
        except ValueError:
            raise errors.TaskError("files: lie on different drives; give them by `files`") from None

    @staticmethod
    def _find(folder: pathlib.Path, name: str) -> pathlib.Path:
        return pathlib.Path(os.path.normpath(folder / name))

    def _add_path(self, path: pathlib.Path) -> None:
        self._found[path] = None
        if len(self._found) > _MAX_FILES:
            raise errors.TaskError(f"files: more than {_MAX_FILES}")

    def _follow(self, reference: _Reference, path: pathlib.Path) -> None:
        for name in _names_inside(reference, lambda: _read_text(path), str(path)):
            inner = self._find(path.parent, name)
            if os.path.isabs(name):
                raise errors.TaskError(f"{path}: '{name}' must be relative to this file")
            if not inner.is_file():
                raise errors.TaskError(f"{path}: no file {inner}")
            self._add_path(inner)

    def _follow_given(self, reference: _Reference, context: str) -> None:
        outer = reference.value

        def read() -> str:
            content = self._given[outer]
            if isinstance(content, bytes):
                return content.decode("utf-8", "replace")
            return _read_text(pathlib.Path(content))

        for name in _names_inside(reference, read, outer):
            inner = posixpath.normpath(posixpath.join(posixpath.dirname(outer), name))
            if inner in self._given:
                continue
            content = self._given[outer]
            beside = (None if isinstance(content, bytes)
                      else self._find(pathlib.Path(content).parent, name))
            if beside is None or not beside.is_file() or inner.startswith(("..", "/")):
                raise errors.TaskError(f"{context}: {outer} names '{name}': give it by `files`")
            self._given[inner] = beside


def _names_inside(reference: _Reference, read: Callable[[], str], context: str) -> List[str]:
    """Files that a file names in itself: tables and height fields of materials."""
    if reference.message.DESCRIPTOR.name != "MaterialAssignment":
        return []
    material = parse_message(read(), material_pb2.Material(), context)
    return [inner.value for inner in file_references(material)]
