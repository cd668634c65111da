# SPDX-License-Identifier: Apache-2.0
"""Tests of the API reference on a contract of their own, and of the list of reasons."""
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
PROTO = '''syntax = "proto3";
package sightline.v1;
// Does things; see `plan.json`.
service Doer {
  // NOT_FOUND, reason JOB_UNKNOWN.
  rpc Do(Request) returns (stream Inner.Answer);
}
message Request {
  // In [0, 1] | half_width_m * 2.
  optional double share = 1;
  repeated Inner inners = 2;
  oneof kind {
    string name = 3;
    Inner.Mood mood = 4;
  }
  map<string, Inner> by_name = 5;
}
message Inner {
  message Answer {}
  enum Mood {
    // Not said.
    UNKNOWN = 0;
  }
}
'''


class ApiReferenceTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)
        (self.root / "sightline" / "v1").mkdir(parents=True)
        self.write(PROTO)

    def write(self, proto):
        (self.root / "sightline" / "v1" / "doer.proto").write_text(proto)
        subprocess.run(["protoc", "-I", self.root, "--include_source_info",
                        f"--descriptor_set_out={self.root / 'set'}", "sightline/v1/doer.proto"],
                       check=True)

    def generate(self, *options):
        return subprocess.run(
            [sys.executable, HERE / "api_reference.py", self.root / "set", "--out",
             self.root / "api", *options], stderr=subprocess.PIPE, text=True)

    def test_pages(self):
        self.assertEqual(0, self.generate().returncode)
        page = (self.root / "api" / "doer.md").read_text()
        for line in (
                "Does things; see `plan.json`.",
                "| `Do` | [Request](#request) | stream of [Inner.Answer](#inneranswer) | "
                "`NOT_FOUND`, reason `JOB_UNKNOWN`. |",
                "| `share` = 1 | optional double | In \\[0, 1\\] \\| `half_width_m` \\* 2. |",
                "| `inners` = 2 | list of [Inner](#inner) |  |",
                "| `name` = 3 | string | *one of `kind`* |",
                "| `mood` = 4 | [Inner.Mood](#innermood) | *one of `kind`* |",
                "| `by_name` = 5 | map of string to [Inner](#inner) |  |",
                "### Inner.Mood", "| `UNKNOWN` = 0 | Not said. |"):
            self.assertIn(line + "\n", page)
        self.assertNotIn("ByNameEntry", page)
        self.assertIn("| [Doer](doer.md#doer) | `Do` |",
                      (self.root / "api" / "README.md").read_text())

    def test_files_without_a_service_are_on_the_page_of_their_service(self):
        folder = self.root / "sightline" / "v1"
        head = 'syntax = "proto3";\npackage sightline.v1;\n'
        service = "service {0} {{ rpc Do({1}) returns ({1}); }}\n"
        (folder / "own.proto").write_text(head + "message Own {}\n")
        (folder / "both.proto").write_text(head + "message Both { Deep deep = 1; }\n"
                                           .replace("message", 'import "sightline/v1/deep.proto";\nmessage'))
        (folder / "deep.proto").write_text(head + "message Deep {}\n")
        (folder / "none.proto").write_text(head + "message None {}\n")
        (folder / "one.proto").write_text(
            head + 'import "sightline/v1/own.proto";\nimport "sightline/v1/both.proto";\n'
            "message A { Own own = 1; Both both = 2; }\n" + service.format("One", "A"))
        (folder / "two.proto").write_text(
            head + 'import "sightline/v1/both.proto";\nmessage B { Both both = 1; }\n'
            + service.format("Two", "B"))
        (folder / "doer.proto").unlink()
        subprocess.run(["protoc", "-I", self.root, "--include_source_info",
                        f"--descriptor_set_out={self.root / 'set'}",
                        *(f"sightline/v1/{path.name}" for path in folder.iterdir())], check=True)
        self.assertEqual(0, self.generate().returncode)
        api = self.root / "api"
        self.assertEqual({"README.md", "one.md", "two.md", "shared.md", "files.md"},
                         {path.name for path in api.iterdir()})
        one = (api / "one.md").read_text()
        self.assertTrue(one.startswith("# One\n"))
        self.assertIn("## sightline/v1/own.proto\n", one)
        self.assertIn("[Own](#own)", one)
        self.assertIn("[Both](shared.md#both)", one)
        self.assertIn("[Deep](#deep)", (api / "shared.md").read_text())
        self.assertIn("### None\n", (api / "files.md").read_text())
        self.assertIn("| [deep](shared.md#sightlinev1deepproto) |", (api / "README.md").read_text())

    def test_check_finds_what_is_stale(self):
        self.assertIn("README.md, doer.md", self.generate("--check").stderr)
        self.generate()
        self.assertEqual(0, self.generate("--check").returncode)
        (self.root / "api" / "gone.md").write_text("")
        self.assertIn("stale: gone.md;", self.generate("--check").stderr)
        self.write(PROTO.replace("Not said", "Unsaid"))
        run = self.generate("--check")
        self.assertEqual(1, run.returncode)
        self.assertIn("stale: doer.md, gone.md;", run.stderr)
        self.generate()
        self.assertEqual(0, self.generate("--check").returncode)
        self.assertFalse((self.root / "api" / "gone.md").exists())


class CheckReasonsTest(unittest.TestCase):
    def test_names_what_is_missing_on_either_side(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "core").mkdir()
            (root / "docs").mkdir()
            (root / "core" / "a.cpp").write_text(
                'return WithErrorInfo(Error(Text("NOT (ME")), \n  "FIRST_ONE", {{"x", "y"}});\n'
                'Fail({StatusCode::kInternal, "SECOND_ONE", "text"});\n'
                'constexpr char kReasonThird[] = "THIRD_ONE";\nDo("NO_REASON");\n')
            page = root / "docs" / "errors-and-limits.md"
            page.write_text("`FIRST_ONE`\n| `SECOND_ONE` | |\n| `OLD_ONE` | |\n")

            def check():
                return subprocess.run([sys.executable, HERE / "check_reasons.py", root],
                                      stdout=subprocess.PIPE, text=True)

            self.assertEqual((1, "core/a.cpp: THIRD_ONE is not in docs/errors-and-limits.md\n"
                                 "docs/errors-and-limits.md: OLD_ONE is nowhere in the code\n"),
                             (check().returncode, check().stdout))
            page.write_text("`FIRST_ONE`\n| `SECOND_ONE`, `THIRD_ONE` | |\n")
            self.assertEqual(0, check().returncode)


if __name__ == "__main__":
    unittest.main()
