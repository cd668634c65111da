# SPDX-License-Identifier: Apache-2.0
"""unity_build_test.py BUILD SOURCE: functions with instruction sets of their own are compiled alone.

A function compiled for AVX2 must not be joined with other sources, whose inline functions could then be
compiled for AVX2 as well and crash processors without it.
"""

import json
import pathlib
import sys
import unittest

BUILD, SOURCE = map(pathlib.Path, sys.argv[1:3])
MARK = '"core/cpu/function_clones.h"'


def sources_with_clones():
    found = [path for folder in ("core", "coverage_server", "planner_client", "planning", "render_worker")
             for path in (SOURCE / folder).rglob("*.cpp") if MARK in path.read_text(encoding="utf-8")]
    return sorted(found)


class UnityBuildTest(unittest.TestCase):
    def test_sources_with_clones_are_compiled_alone(self):
        commands = json.loads((BUILD / "compile_commands.json").read_text(encoding="utf-8"))
        compiled = {pathlib.Path(entry["file"]) for entry in commands}
        clones = sources_with_clones()
        self.assertGreaterEqual(len(clones), 5)
        for path in clones:
            self.assertTrue(path in compiled, f"{path} is not compiled by itself")
        joined = [file for file in compiled if file.parent.name == "Unity"]
        for file in joined:
            text = file.read_text(encoding="utf-8")
            for path in clones:
                self.assertFalse(str(path) in text, f"{path} is part of {file}")


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
