# SPDX-License-Identifier: Apache-2.0
"""tools/check_docs finds what is planted in pages."""

import importlib.machinery
import importlib.util
import pathlib
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.dont_write_bytecode = True
LOADER = importlib.machinery.SourceFileLoader("check_docs", str(ROOT / "tools" / "check_docs"))
check_docs = importlib.util.module_from_spec(importlib.util.spec_from_loader("check_docs", LOADER))
LOADER.exec_module(check_docs)


class CheckDocsTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.messages = check_docs.Messages()
        options = [check_docs.command_help.Argument(["-h", "--help"]), check_docs.command_help.Argument(["--out"])]
        plan = check_docs.command_help.Command(["sightline", "plan"], options=options)
        cls.programs = {"sightline": check_docs.command_help.Command(["sightline"], subcommands=[plan])}

    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def page(self, text, name="page.md"):
        path = self.folder / name
        path.write_text(text, encoding="utf-8")
        return check_docs.Page(path)

    def finds(self, check, text, *arguments):
        return list(check(self.page(text), *arguments))

    def test_links(self):
        other = self.page("# A heading: `with` code\n", "other.md")
        pages = {other.path: other}
        good = "[a](other.md#a-heading-with-code) [b](https://example.org/x) `[c](none.md)`\n"
        self.assertEqual([], self.finds(check_docs.check_links, good, pages))
        self.assertEqual([(1, "there is no none.md")], self.finds(check_docs.check_links, "[a](none.md)", pages))
        self.assertEqual([(3, "other.md has no heading #else")],
                         self.finds(check_docs.check_links, "\n\n[`a`](other.md#else)", pages))

    def test_paths_of_the_tree(self):
        good = "`core/rig/rig.h`, `core/rig/`, `optics/lens.h`, `build/release/bin`"
        self.assertEqual([], self.finds(check_docs.check_paths, good, {"core"}))
        self.assertEqual([(1, "there is no core/rgi/rig.h")],
                         self.finds(check_docs.check_paths, "`core/rgi/rig.h`", {"core"}))

    def test_tables_of_fields(self):
        table = "`goal`: when to stop\n\n| field | allowed |\n|---|---|\n| `{}` | |\n"
        self.assertEqual([], self.finds(check_docs.check_fields, table.format("max_scans"), self.messages))
        # A field of another message is none of the goal's.
        self.assertEqual([(5, "`scan_step_m` is no field of `goal`")],
                         self.finds(check_docs.check_fields, table.format("scan_step_m"), self.messages))
        dotted = "| field |\n|---|\n| `camera.columns_px`, `{}` |\n"
        self.assertEqual([], self.finds(check_docs.check_fields, dotted.format("rows_px"), self.messages))
        self.assertEqual([(3, "`camera.f_number` is no field")],
                         self.finds(check_docs.check_fields, dotted.format("f_number"), self.messages))

    def test_paths_in_text(self):
        good = "`goal.coverage` in `plan.json`, `optics.veiling_glare`, `Table.1`"
        self.assertEqual([], self.finds(check_docs.check_fields, good, self.messages))
        self.assertEqual([(1, "`goal.covrage` is no path of fields")],
                         self.finds(check_docs.check_fields, "`goal.covrage`", self.messages))

    def test_examples(self):
        text = '```json\n"goal": { "coverage": 0.9, "effects": [{ "parameters": { "glare_fraction": 1 } }] }\n```\n'
        self.assertEqual([], self.finds(check_docs.check_examples, text, self.messages))
        self.assertEqual([(2, '"covrage" is no field of any message')],
                         self.finds(check_docs.check_examples, text.replace("coverage", "covrage"), self.messages))
        self.assertRegex(self.finds(check_docs.check_examples, "```json\n{,}\n```\n", self.messages)[0][1], "no JSON")

    def test_commands(self):
        good = "```\nbuild/release/bin/sightline plan a.json \\\n    --out=x  # --comment\ndeploy/quickstart\n```\n"
        self.assertEqual([], self.finds(check_docs.check_commands, good, self.programs))
        for planted, message in (("sightline plan --oot x", "`sightline plan` has no option --oot"),
                                 ("cd x && sightline paln a.json", "`sightline` has no command paln"),
                                 ("deploy/quickstrat", "there is no deploy/quickstrat")):
            self.assertEqual([(2, message)],
                             self.finds(check_docs.check_commands, f"```\n{planted}\n```\n", self.programs))
        self.assertEqual([], self.finds(check_docs.check_commands, "`sightline plan … --out x`", self.programs))
        self.assertEqual([(1, "`sightline plan` has no option --oot")],
                         self.finds(check_docs.check_commands, "`sightline plan … --oot x`", self.programs))
        table = "| option | does |\n|---|---|\n| `--out DIR` | |\n| `--oot` | |\n"
        self.assertEqual([(4, "no program has an option --oot")],
                         self.finds(check_docs.check_commands, table, self.programs))

    def test_folders(self):
        row = "| folder | holds | may use |\n|---|---|---|\n| `rpc_server/` | | {} |\n| `core/` | `rig/` `nowhere/` | proto |\n"
        files = check_docs.files_of_the_tree()
        finds = [text for _, text in self.finds(check_docs.check_architecture, row.format("proto"), files)]
        self.assertIn("there is no core/nowhere", finds)
        self.assertIn("leaves out core/part", finds)
        self.assertTrue(any(text.startswith("rpc_server/") and "uses core/" in text for text in finds))
        finds = [text for _, text in self.finds(check_docs.check_architecture, row.format("core, proto"), files)]
        self.assertFalse(any("uses core/" in text for text in finds))


if __name__ == "__main__":
    unittest.main()
