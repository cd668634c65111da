# SPDX-License-Identifier: Apache-2.0
"""tools/add-spdx puts the licence where it belongs, once."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("add_spdx", str(ROOT / "tools" / "add-spdx"))
add_spdx = importlib.util.module_from_spec(importlib.util.spec_from_loader("add_spdx", LOADER))
LOADER.exec_module(add_spdx)
LICENCE = add_spdx.LICENCE


class AddSpdxTest(unittest.TestCase):
    def added(self, name, text):
        return add_spdx.with_licence(pathlib.Path(name), text)

    def test_every_kind_of_source(self):
        self.assertEqual(f"// {LICENCE}\n#pragma once\n", self.added("a/b.h", "#pragma once\n"))
        self.assertEqual(f"# {LICENCE}\nproject(x)\n", self.added("CMakeLists.txt", "project(x)\n"))
        self.assertEqual(f"/* {LICENCE} */\nb {{}}\n", self.added("a.css", "b {}\n"))
        self.assertEqual(f"// {LICENCE}\nint a;\n", self.added("version.cpp.in", "int a;\n"))

    def test_after_the_line_that_names_the_program(self):
        self.assertEqual(f"#!/bin/bash\n# {LICENCE}\nset -e\n", self.added("tests/run", "#!/bin/bash\nset -e\n"))
        self.assertEqual(f"#!/usr/bin/env python3\n# {LICENCE}\n", self.added("x.py", "#!/usr/bin/env python3\n"))

    def test_once(self):
        for name, text in (("a.cpp", "int a;\n"), ("run", "#!/bin/sh\n:\n")):
            once = self.added(name, text)
            self.assertEqual(once, self.added(name, once))

    def test_files_without_comments(self):
        for name in ("a.json", "README.md", "part.ply", "packages.txt"):
            self.assertEqual("x\n", self.added(name, "x\n"))


if __name__ == "__main__":
    unittest.main()
