# SPDX-License-Identifier: Apache-2.0
"""tools/check_layers finds cycles of includes between folders, and only those."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("check_layers", str(ROOT / "tools" / "check_layers"))
check_layers = importlib.util.module_from_spec(importlib.util.spec_from_loader("check_layers", LOADER))
LOADER.exec_module(check_layers)


class CheckLayersTest(unittest.TestCase):
    def setUp(self):
        self._folder = tempfile.TemporaryDirectory()
        self.root = pathlib.Path(self._folder.name)
        self.addCleanup(self._folder.cleanup)

    def write(self, name, *included):
        path = self.root / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("".join(f'#include "{other}"\n' for other in included), encoding="utf-8")

    def test_one_direction_is_well(self):
        self.write("core/a/a.h")
        self.write("core/b/b.h", "core/a/a.h", "core/b/own.h")
        self.write("core/b/own.h", "core/b/b.h")
        self.write("planner_client/x/x.h", "core/b/b.h")
        self.assertEqual([], check_layers.check(self.root))

    def test_a_cycle_of_three_folders_is_named_with_its_includes(self):
        self.write("core/a/a.h", "core/c/c.h")
        self.write("core/b/b.cpp", "core/a/a.h")
        self.write("core/b/b.h")
        self.write("core/c/c.h", "core/b/b.h")
        lines = check_layers.check(self.root)
        self.assertEqual("cycle between core/a, core/b, core/c", lines[0])
        self.assertIn("  core/b/b.cpp includes core/a/a.h", lines)

    def test_a_cycle_of_programs(self):
        self.write("core/a/a.h", "planner_client/x/x.h")
        self.write("planner_client/x/x.h", "core/b/b.h")
        self.write("core/b/b.h")
        self.assertEqual("cycle between core, planner_client", check_layers.check(self.root)[0])


if __name__ == "__main__":
    unittest.main()
