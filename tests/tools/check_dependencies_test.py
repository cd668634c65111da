# SPDX-License-Identifier: Apache-2.0
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
        self.write("deploy/packages.txt", "# Tools\n[build]\ng++\n\n[plan]\nlibssl-dev  # TLS\n")
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

    def test_what_is_built_needs_no_package_of_tests(self):
        self.write("deploy/packages.txt", "libssl-dev\nlibpq-dev\nlibgtest-dev\n")
        self.write("deploy/test-packages.txt", "libcpp-httplib-dev\nmosquitto\n")
        self.write("tests/CMakeLists.txt", "pkg_check_modules(HTTP REQUIRED IMPORTED_TARGET cpp-httplib)\n"
                   "find_program(MOSQUITTO mosquitto PATHS /usr/sbin REQUIRED)\n")
        self.write("cmake/Dependencies.cmake", "find_package(OpenSSL REQUIRED COMPONENTS SSL)\n"
                   "# find_package(Nowhere REQUIRED)\npkg_check_modules(LIBPQ REQUIRED IMPORTED_TARGET libpq>=14)\n"
                   "find_program(GIT git)\nif(SIGHTLINE_BUILD_TESTS OR SIGHTLINE_BUILD_BENCH)\n"
                   "  find_package(GTest REQUIRED)\n  pkg_check_modules(HTTP REQUIRED cpp-httplib)\nendif()\n")
        self.assertEqual(self.run_tool().returncode, 0, self.run_tool().stdout)
        # As often as it can come back.
        for text, said in (
            ("pkg_check_modules(HTTP REQUIRED\n  IMPORTED_TARGET cpp-httplib)", "cpp-httplib is in libcpp-httplib-dev, which only"),
            ("find_program(MOSQUITTO NAMES mosquitto REQUIRED)", "mosquitto is in mosquitto, which only"),
            ("if(SIGHTLINE_BUILD_TESTS)\nelse()\nfind_program(M mosquitto REQUIRED)\nendif()", "CMakeLists.txt:3: mosquitto"),
            ("if(SIGHTLINE_BUILD_TESTS)\nendif()\nfind_program(M mosquitto REQUIRED)", "CMakeLists.txt:3: mosquitto"),
            ("if(NOT SIGHTLINE_BUILD_TESTS)\nfind_program(M mosquitto REQUIRED)\nendif()", "mosquitto"),
            ("find_package(PNG REQUIRED)", "PNG is in libpng-dev, which deploy/packages.txt does not name"),
            ("find_package(Nowhere CONFIG REQUIRED)", "Nowhere: FOUND_IN"),
        ):
            with self.subTest(text):
                self.write("core/CMakeLists.txt", text + "\n")
                self.expect(said)

    def test_scripts_configure_for_the_packages_they_install(self):
        off = "-D SIGHTLINE_BUILD_TESTS=OFF -DSIGHTLINE_BUILD_BENCH=OFF"
        for text, good in (
            (f"deploy/install-packages\ncmake --preset release {off}\ncmake --build --preset release\n", True),
            ("deploy/install-packages\ncmake --preset release \\\n  -DX=1 \\\n  " + off + "\n", True),
            ("deploy/install-packages --tests\ncmake --preset release\n", True),
            ("deploy/install-packages\ncmake --preset release --log-level=WARNING\n", False),
            ("deploy/install-packages\n  cmake --preset release -DSIGHTLINE_BUILD_TESTS=OFF\n", False),
        ):
            with self.subTest(text):
                self.write("deploy/quickstart", text)
                if good:
                    self.assertEqual(self.run_tool().returncode, 0)
                else:
                    self.expect("deploy/quickstart: cmake --preset release", "SIGHTLINE_BUILD_BENCH=OFF")

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

    def test_what_only_tests_need_may_have_weak_copyleft(self):
        lock = copy.deepcopy(LOCK)
        good = lock["packages"]["node_modules/good"]
        good.update({"license": "EPL-2.0", "dev": True})
        self.write("page/package-lock.json", json.dumps(lock))
        self.assertEqual(self.run_tool().returncode, 0)
        good["license"] = "AGPL-3.0-only"
        self.write("page/package-lock.json", json.dumps(lock))
        self.expect("good: licence AGPL-3.0-only")
        good.update({"license": "EPL-2.0", "dev": False})
        self.write("page/package-lock.json", json.dumps(lock))
        self.expect("good: licence EPL-2.0")

    def test_licence_in_a_file_counts_for_its_version(self):
        lock = copy.deepcopy(LOCK)
        lock["packages"]["node_modules/good/node_modules/dequeue"] = {
            **lock["packages"]["node_modules/good"], "version": "1.0.5", "license": None}
        self.write("page/package-lock.json", json.dumps(lock))
        self.assertEqual(self.run_tool().returncode, 0)
        lock["packages"]["node_modules/good/node_modules/dequeue"]["version"] = "1.0.6"
        self.write("page/package-lock.json", json.dumps(lock))
        self.expect("dequeue: licence None")

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
