#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Writes the API reference from the contract: one Markdown page per service, and an index.

A proto file without a service is on the page of the only service that imports it, directly or through
others. Files that several services import are on the page shared.md, all others on files.md.

Needs python3-protobuf. The descriptor set is made by
  protoc -I proto --include_source_info --descriptor_set_out=FILE sightline/v1/*.proto
`run` beside this program does both.
"""
import argparse
import pathlib
import re
import sys

from google.protobuf import descriptor_pb2

FieldProto = descriptor_pb2.FieldDescriptorProto
SCALARS = {number: name[5:].lower() for name, number in FieldProto.Type.items()}
# Field numbers in descriptor.proto, of which the paths of comments consist.
IN_FILE = {"message": 4, "enum": 5, "service": 6}
IN_MESSAGE = {"field": 2, "message": 3, "enum": 4}


class Source:
    """A proto file with the comments of its parts."""

    def __init__(self, file):
        self.file = file
        self.name = pathlib.PurePosixPath(file.name).stem
        self._comments = {}
        for location in file.source_code_info.location:
            text = location.leading_comments or location.trailing_comments
            self._comments[tuple(location.path)] = text
        # Comment of the whole file: before the package, detached from it or not.
        self.comment = self._file_comment()

    def _file_comment(self):
        for location in self.file.source_code_info.location:
            if list(location.path) in ([12], [2]):
                texts = [*location.leading_detached_comments, location.leading_comments]
                # The line that states the licence says nothing about the file.
                text = re.sub(r"^ *SPDX-.*\n", "", "\n".join(t for t in texts if t), flags=re.MULTILINE)
                if text.strip():
                    return paragraphs(text)
        return ""

    def comment_of(self, *path):
        return paragraphs(self._comments.get(tuple(path), ""))

    def services(self):
        for i, service in enumerate(self.file.service):
            yield service, (IN_FILE["service"], i)

    def types(self):
        """All messages and enumerations in the order of the file: name below the package,
        descriptor, path."""
        def inside(message, prefix, path):
            yield prefix, message, path
            for i, inner in enumerate(message.nested_type):
                if not inner.options.map_entry:
                    yield from inside(inner, f"{prefix}.{inner.name}",
                                      (*path, IN_MESSAGE["message"], i))
            for i, inner in enumerate(message.enum_type):
                yield f"{prefix}.{inner.name}", inner, (*path, IN_MESSAGE["enum"], i)

        for i, message in enumerate(self.file.message_type):
            yield from inside(message, message.name, (IN_FILE["message"], i))
        for i, enum in enumerate(self.file.enum_type):
            yield enum.name, enum, (IN_FILE["enum"], i)


def paragraphs(comment):
    """A comment as running text; blank lines stay."""
    lines = [line.strip() for line in comment.strip().split("\n")]
    parts = re.split(r"\n\s*\n", "\n".join(lines))
    return "\n\n".join(escape(" ".join(part.split("\n"))) for part in parts if part)


def escape(text):
    """Comments are plain text: what would be markup is not, and names read better as code."""
    parts = []
    for i, part in enumerate(re.split(r"(`[^`]+`|[A-Za-z][\w./-]*_[\w./-]*\w)", text)):
        if i % 2 == 0:
            parts.append(re.sub(r"([\\*_`<>\[\]|])", r"\\\1", part))
        else:
            parts.append("`" + part.strip("`").replace("|", "\\|") + "`")
    return "".join(parts)


def cell(text):
    return text.replace("\n\n", "<br>").replace("\n", " ")


def anchor(title):
    """As GitHub makes them of headings."""
    return re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-")


def page_names(sources):
    """The page of every source, by its file's name."""
    imports = {source.file.name: set(source.file.dependency) for source in sources}

    def reached(name, seen):
        for other in imports.get(name, ()):
            if other in imports and other not in seen:
                seen.add(other)
                reached(other, seen)
        return seen

    importers = {}
    for source in sources:
        if source.file.service:
            for name in reached(source.file.name, set()):
                importers.setdefault(name, []).append(source.name)
    pages = {}
    for source in sources:
        by = importers.get(source.file.name, [])
        if source.file.service:
            pages[source.file.name] = source.name
        elif len(by) == 1:
            pages[source.file.name] = by[0]
        else:
            pages[source.file.name] = "shared" if by else "files"
    return pages


class Reference:
    def __init__(self, files):
        self.sources = [Source(f) for f in sorted(files, key=lambda f: f.name)
                        if f.name.startswith("sightline/")]
        self._pages = page_names(self.sources)
        self._source_of = {}
        for source in self.sources:
            for name, _, _ in source.types():
                self._source_of[f".{source.file.package}.{name}"] = (source, name)

    def page_of(self, source):
        return self._pages[source.file.name]

    def _link(self, type_name, here):
        """To the heading of a message or enumeration."""
        if type_name not in self._source_of:
            return f"`{type_name.lstrip('.')}`"
        source, name = self._source_of[type_name]
        target = "" if self.page_of(source) == self.page_of(here) else f"{self.page_of(source)}.md"
        return f"[{name}]({target}#{anchor(name)})"

    def _type(self, field, owner, here):
        if field.type not in (FieldProto.TYPE_MESSAGE, FieldProto.TYPE_ENUM):
            text = SCALARS[field.type]
        else:
            entry = next((n for n in owner.nested_type if n.options.map_entry
                          and field.type_name.endswith(f".{owner.name}.{n.name}")), None)
            if entry is not None:
                key, value = (self._type(f, entry, here) for f in entry.field)
                return f"map of {key} to {value}"
            text = self._link(field.type_name, here)
        if field.label == FieldProto.LABEL_REPEATED:
            return f"list of {text}"
        return f"optional {text}" if field.proto3_optional else text

    def _message(self, page, name, message, path):
        lines = [f"### {name}", ""]
        if comment := page.comment_of(*path):
            lines += [comment, ""]
        if not message.field:
            return lines + ["No fields.", ""]
        lines += ["| field | type | |", "|---|---|---|"]
        for i, field in enumerate(message.field):
            text = cell(page.comment_of(*path, IN_MESSAGE["field"], i))
            if field.HasField("oneof_index") and not field.proto3_optional:
                one_of = message.oneof_decl[field.oneof_index].name
                text = f"*one of `{one_of}`* {text}".rstrip()
            lines.append(f"| `{field.name}` = {field.number} | {self._type(field, message, page)} "
                         f"| {text} |")
        return lines + [""]

    @staticmethod
    def _enum(page, name, enum, path):
        lines = [f"### {name}", ""]
        if comment := page.comment_of(*path):
            lines += [comment, ""]
        lines += ["| value | |", "|---|---|"]
        for i, value in enumerate(enum.value):
            text = cell(page.comment_of(*path, 2, i))
            lines.append(f"| `{value.name}` = {value.number} | {text} |")
        return lines + [""]

    def _service(self, page, service, path):
        lines = [f"### {service.name}", ""]
        if comment := page.comment_of(*path):
            lines += [comment, ""]
        lines += ["| method | request | answer | |", "|---|---|---|---|"]
        for i, method in enumerate(service.method):
            asks, answers = (("stream of " if stream else "") + self._link(kind, page)
                             for stream, kind in ((method.client_streaming, method.input_type),
                                                  (method.server_streaming, method.output_type)))
            text = cell(page.comment_of(*path, 2, i))
            lines.append(f"| `{method.name}` | {asks} | {answers} | {text} |")
        return lines + [""]

    def section(self, source):
        """All of a proto file: its comment, services, messages."""
        lines = [f"## {source.file.name}", "",
                 f"Package `{source.file.package}`; generated from "
                 f"[{source.file.name}](../../proto/{source.file.name}).", ""]
        if source.comment:
            lines += [source.comment, ""]
        for service, path in source.services():
            lines += self._service(source, service, path)
        for name, kind, path in source.types():
            if isinstance(kind, descriptor_pb2.EnumDescriptorProto):
                lines += self._enum(source, name, kind, path)
            else:
                lines += self._message(source, name, kind, path)
        return lines

    def page(self, name, sources):
        title = {"shared": "Messages that several services share", "files": "Messages of files"}.get(
            name) or ", ".join(s.name for source in sources for s in source.file.service)
        # The file with the service comes first.
        sources = sorted(sources, key=lambda source: not source.file.service)
        lines = [f"# {title}", ""]
        for source in sources:
            lines += self.section(source)
        return "\n".join(lines)

    def index(self):
        lines = ["# API reference", "",
                 "Generated from the contract by `tools/api_reference/run`; do not edit. Files and "
                 "HTTP bodies are the JSON form of these messages with the names as they stand "
                 "here. How to use it: [from an MES](../clients.md#from-an-mes), [from Python]"
                 "(../clients.md#from-python); what errors mean: [errors](../errors-and-limits.md).", "",
                 "| service | methods |", "|---|---|"]
        for source in self.sources:
            for service, _ in source.services():
                methods = ", ".join(f"`{m.name}`" for m in service.method)
                lines.append(f"| [{service.name}]({self.page_of(source)}.md#{anchor(service.name)}) | "
                             f"{methods} |")
        lines += ["", "| messages of | |", "|---|---|"]
        for source in self.sources:
            if not source.file.service:
                first = source.file.message_type[0].name if source.file.message_type else ""
                first_comment = source.comment_of(IN_FILE["message"], 0).split("\n\n")[0]
                about = source.comment.split("\n\n")[0] or (
                    f"{first}: {first_comment}" if first_comment else first)
                lines.append(f"| [{source.name}]({self.page_of(source)}.md#{anchor(source.file.name)}) | "
                             f"{cell(about)} |")
        return "\n".join(lines) + "\n"

    def files(self):
        """Contents by names of files."""
        pages = {}
        for source in self.sources:
            pages.setdefault(self.page_of(source), []).append(source)
        return {"README.md": self.index(),
                **{f"{name}.md": self.page(name, sources) for name, sources in pages.items()}}


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("descriptor_set", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, required=True, help="folder of the pages")
    parser.add_argument("--check", action="store_true",
                        help="write nothing; fail if a page there differs")
    options = parser.parse_args()
    descriptors = descriptor_pb2.FileDescriptorSet.FromString(options.descriptor_set.read_bytes())
    files = Reference(descriptors.file).files()
    there = {p.name for p in options.out.glob("*.md")} if options.out.is_dir() else set()
    stale = sorted(there - set(files))
    for name, text in files.items():
        path = options.out / name
        if not path.is_file() or path.read_text(encoding="utf-8") != text:
            stale.append(name)
    if options.check:
        if stale:
            sys.exit(f"{options.out}: stale: {', '.join(sorted(stale))}; run "
                     "tools/api_reference/run")
        return
    options.out.mkdir(parents=True, exist_ok=True)
    for name in stale:
        if name in files:
            (options.out / name).write_text(files[name], encoding="utf-8")
        else:
            (options.out / name).unlink()


if __name__ == "__main__":
    main()
