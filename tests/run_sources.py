#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests of a GoogleTest program that are defined in the given sources.

    run_sources.py PROGRAM SOURCE... [-- OPTIONS]

OPTIONS go to PROGRAM. The program lists its tests with the file of each; this process then becomes
the program with a filter, so that signals and time limits of CTest reach it. Exit code 1 if none of
the sources defines a test.
"""
import json
import os
import subprocess
import sys
import tempfile


def tests_of(listing, sources, build):
    """Names "Suite.Test" of the tests in `listing` (GoogleTest's JSON) that `sources` define.

    The compiler cache makes some paths relative to the build folder `build`.
    """
    wanted = {os.path.realpath(source) for source in sources}
    return [
        f"{suite['name']}.{test['name']}"
        for suite in listing["testsuites"]
        for test in suite["testsuite"]
        if os.path.realpath(os.path.join(build, test["file"])) in wanted
    ]


def list_tests(program):
    with tempfile.TemporaryDirectory() as folder:
        listing = os.path.join(folder, "tests.json")
        subprocess.run([program, "--gtest_list_tests", f"--gtest_output=json:{listing}"],
                       stdout=subprocess.DEVNULL, check=True)
        with open(listing, encoding="utf-8") as file:
            return json.load(file)


def main(words):
    options = []
    if "--" in words:
        options = words[words.index("--") + 1:]
        words = words[:words.index("--")]
    program, *sources = words
    # Programs are in the folder bin of the build folder.
    names = tests_of(list_tests(program), sources, os.path.dirname(os.path.dirname(os.path.abspath(program))))
    if not names:
        print(f"run_sources.py: {program} has no test of {' '.join(sources)}", file=sys.stderr)
        return 1
    # A filter on the command line could be longer than a command line may be.
    os.environ["GTEST_FILTER"] = ":".join(names)
    os.execv(program, [program, *options])


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
