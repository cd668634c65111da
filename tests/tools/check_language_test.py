# SPDX-License-Identifier: Apache-2.0
"""tools/check_language finds what is planted in comments, messages and pages."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("check_language", str(ROOT / "tools" / "check_language"))
check_language = importlib.util.module_from_spec(importlib.util.spec_from_loader("check_language", LOADER))
LOADER.exec_module(check_language)


def found(name, text):
    return [(line, rule) for line, rule, _ in check_language.check_file(name, text)]


class CheckLanguageTest(unittest.TestCase):
    def test_headless_comments(self):
        self.assertEqual([(2, "headless")], found("core/a.h", "// SPDX-License-Identifier: Apache-2.0\n// Of a scan.\n"))
        self.assertEqual([(1, "headless")], found("core/a.h", "int a;  // That are left\n"))
        self.assertEqual([(2, "headless")], found("tools/a.py", "x = 1\n# Where it is.\n"))
        self.assertEqual([(1, "headless")], found("web/a.js", "/** Which files are left. */\n"))
        self.assertEqual([], found("core/a.h", "// What is left?\n// A sentence.\nint Of;\n*Of = 2;\n"))
        # Later sentences and lines are not beginnings.
        self.assertEqual([], found("core/a.h", "// The plan. Of its scans\n// What is left.\n"))

    def test_a_comment_behind_code_goes_on_below_it(self):
        self.assertEqual([], found("core/a.h", "int a;  // The plan\n        // Of its scans\n"))

    def test_words_in_comments_and_messages(self):
        self.assertEqual([(1, "words")], found("core/a.cpp", "// All judged targets.\n"))
        self.assertEqual([(1, "words")], found("core/a.cpp", 'Say("it scans " "the fresh targets");\n'))
        self.assertEqual([], found("tests/core/a.cpp", 'Say("it scans the fresh targets");\n'))
        self.assertEqual([], found("core/a.cpp", "// `judged targets` and judged_targets\n#include \"x/gain_model.h\"\n"))

    def test_names_of_code_are_not_words(self):
        self.assertEqual([], found("core/a.cpp", "// GainModel, gain_model/x.h and --no-fresh-targets.\n"))

    def test_long_sentences_of_pages(self):
        long = "One " + "and one more " * 14 + "end.\n"
        self.assertEqual([(3, "long")], found("docs/a.md", "# A\n\n" + long))
        self.assertEqual([(1, "long")], found("README.md", "| short | " + long.strip() + " |\n"))
        self.assertEqual([(1, "long")], found("SECURITY.md", long))
        self.assertEqual([], found("docs/a.md", "One and one more. " * 20))
        self.assertEqual([], found("docs/a.md", "```\n" + long + "```\n"))
        self.assertEqual([], found("docs/api/a.md", long))
        self.assertEqual([], found("CHANGELOG.md", long))

    def test_words_of_pages(self):
        self.assertEqual([(1, "words")], found("docs/a.md", "The gRPC door.\n"))
        self.assertEqual([], found("docs/a.md", "The `gRPC door`.\n"))


if __name__ == "__main__":
    unittest.main()
