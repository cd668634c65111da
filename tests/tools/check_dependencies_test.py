"""tools/check_dependencies finds what is planted in a working tree."""

import copy
import json
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "check_dependencies"

MANIFEST = {"name": "page", "dependencies": {"good": "1.2.3"}}
LOCK = {
    "name": "page",
    "lockfileVersion": 3,
    "packages": {
        "": {"name": "page", "dependencies": {"good": "1.2.3"}},
        "node_modules/good": {
            "version": "1.2.3",
            "integrity": "sha512-" + 86 * "A" + "==",
            "license": "MIT",
        },
    },
}


class CheckDependenciesTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.git("init", "--quiet")
        self.write("deploy/packages.txt", "# Tools\ng++\nlibssl-dev  # TLS\n")
        self.write("page/package.json", json.dumps(MANIFEST))
        self.write("page/package-lock.json", json.dumps(LOCK))

    def git(self, *arguments):
        subprocess.run(["git", "-C", str(self.folder), *arguments], check=True, capture_output=True)

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        self.git("add", name)

    def run_tool(self):
        return subprocess.run([sys.executable, str(TOOL), str(self.folder)], capture_output=True, text=True)

    def expect(self, *texts):
        result = self.run_tool()
        self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
        for text in texts:
            self.assertIn(text, result.stdout)

    def test_good_tree_passes(self):
        result = self.run_tool()
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertIn("1 locks", result.stdout)

    def test_packages(self):
        self.write("deploy/packages.txt", "g++\nlibssl-dev\ng++\n")
        self.expect("packages.txt:3: g++ is in line 1")
        self.write("deploy/packages.txt", "g++; rm -rf\n")
        self.expect("packages.txt:1:")
        self.write("deploy/packages.txt", "# nothing\n")
        self.expect("names no package")

    def test_lock(self):
        for change, text in (
            ({"integrity": None}, "good: has no SHA-512 integrity"),
            ({"integrity": "sha1-AAAAAAAAAAAAAAAAAAAAAAAAAAA="}, "good: has no SHA-512 integrity"),
            ({"version": "1.2.4"}, "good: is not 1.2.3"),
            ({"version": "^1.2.3"}, "good: version ^1.2.3 is not exact"),
            ({"resolved": "http://somewhere/good.tgz"}, "not by https"),
            ({"resolved": "git+ssh://somewhere/good.git"}, "not by https"),
            ({"license": "AGPL-3.0-only"}, "licence AGPL-3.0-only"),
            ({"license": "MIT AND SSPL-1.0"}, "licence MIT AND SSPL-1.0"),
            ({"license": None}, "licence None"),
            ({"link": True}, "is a link"),
        ):
            with self.subTest(text):
                lock = copy.deepcopy(LOCK)
                lock["packages"]["node_modules/good"].update(change)
                self.write("page/package-lock.json", json.dumps(lock))
                self.expect(text)

    def test_choice_of_licences(self):
        lock = copy.deepcopy(LOCK)
        lock["packages"]["node_modules/good"]["license"] = "(GPL-3.0-only OR MIT)"
        self.write("page/package-lock.json", json.dumps(lock))
        self.assertEqual(self.run_tool().returncode, 0)

    def test_manifest_and_lock_belong_together(self):
        self.write("page/package.json", json.dumps({"dependencies": {"good": "^1.2.3"}}))
        self.expect("must be one exact version", "is not the lock of page/package.json")
        self.write("page/package.json", json.dumps(MANIFEST))
        self.git("rm", "--quiet", "--cached", "page/package-lock.json")
        self.expect("page/package-lock.json is not tracked")

    def test_broken_lock_is_an_error(self):
        self.write("page/package-lock.json", "{")
        self.assertEqual(self.run_tool().returncode, 2)


if __name__ == "__main__":
    unittest.main()
