#!/usr/bin/python3
# SPDX-License-Identifier: Apache-2.0
"""Lists the error reasons of the code that docs/errors-and-limits.md leaves out, and those of the
page that the code does not have.

Reasons are the texts in capitals in calls of WithErrorInfo, in constants kReason..., and where
JobFailure is filled in.
"""
import argparse
import pathlib
import re
import sys

PAGE = "docs/errors-and-limits.md"
SOURCES = ("proto", "core", "rpc_server", "coverage_server", "render_worker", "planner_client",
           "planning", "planning_service", "report")
NAME = re.compile(r'"([A-Z][A-Z0-9]*(?:_[A-Z0-9]+)*)"')
# Reasons of job failures, which do not pass through WithErrorInfo.
OTHER = re.compile(r'(?:kReason\w*\[\] = |(?:StatusCode::k\w+|code\(\)),\s*)"([A-Z][A-Z0-9_]+)"')


def call_text(text, start):
    """From an opening parenthesis to its end, texts in quotes left whole."""
    depth, at, quoted = 0, start, False
    while at < len(text):
        c = text[at]
        if quoted:
            if c == "\\":
                at += 1
            quoted = c != '"'
        elif c == '"':
            quoted = True
        elif c in "()":
            depth += 1 if c == "(" else -1
            if depth == 0:
                return text[start:at]
        at += 1
    return text[start:]


def reasons_in(text):
    found = set(OTHER.findall(text))
    for call in re.finditer(r"\bWithErrorInfo\(", text):
        found.update(NAME.findall(call_text(text, call.end() - 1)))
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", type=pathlib.Path, nargs="?",
                        default=pathlib.Path(__file__).resolve().parents[2])
    root = parser.parse_args().root
    code = {}
    for folder in SOURCES:
        for path in sorted((root / folder).rglob("*")):
            if path.suffix in (".cpp", ".h"):
                for reason in reasons_in(path.read_text(encoding="utf-8")):
                    code.setdefault(reason, path.relative_to(root))
    table = re.compile(r"`([A-Z][A-Z0-9_]+)`")
    errors = (root / PAGE).read_text(encoding="utf-8")
    known = set(table.findall(errors))
    rows = {reason for line in errors.split("\n") if line.startswith("| `")
            for reason in table.findall(line.split("|")[1])}
    missing = sorted(set(code) - known)
    gone = sorted(rows - set(code))
    for reason in missing:
        print(f"{code[reason]}: {reason} is not in {PAGE}")
    for reason in gone:
        print(f"{PAGE}: {reason} is nowhere in the code")
    sys.exit(1 if missing or gone else 0)


if __name__ == "__main__":
    main()
