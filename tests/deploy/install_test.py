# SPDX-License-Identifier: Apache-2.0
"""install_test.py CMAKE BUILD SOURCE: what `cmake --install` puts into a prefix works from there."""

import gzip
import os
import re
import subprocess
import sys
import tempfile
import unittest

CMAKE, BUILD, SOURCE = sys.argv[1:4]
PROGRAMS = ["sightline", "coverage_server", "render_worker"]
SERVICES = {
    "sightline-coverage-server": "coverage_server",
    "sightline-render-worker": "render_worker",
    "sightline-serve": "sightline serve",
}


def run(*words):
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(words)}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


class InstallTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory()
        cls.prefix = os.path.join(cls.folder.name, "prefix")
        run(CMAKE, "--install", BUILD, "--prefix", cls.prefix)

    @classmethod
    def tearDownClass(cls):
        cls.folder.cleanup()

    def path(self, *parts):
        return os.path.join(self.prefix, *parts)

    def read(self, *parts):
        with open(self.path(*parts), encoding="utf-8") as file:
            return file.read()

    def test_programs_tell_version_and_commit(self):
        with open(os.path.join(SOURCE, "CMakeLists.txt"), encoding="utf-8") as file:
            version = re.search(r"project\(sightline VERSION (\S+)", file.read())[1]
        commits = set()
        for program in PROGRAMS:
            found = re.fullmatch(rf"{program} {version} \((\S+)\)\n", run(self.path("bin", program), "--version"))
            self.assertIsNotNone(found, program)
            commits.add(found[1])
        self.assertEqual(len(commits), 1, commits)
        self.assertRegex(commits.pop(), r"[0-9a-f]{7,40}(-dirty)?|unknown")

    def test_programs_of_commands_are_found_from_the_prefix(self):
        for group, command in (("plan", "evaluate"), ("render", "verify"), ("serve", "backup")):
            self.assertTrue(os.access(self.path("libexec", "sightline", f"sightline-{group}"), os.X_OK))
            self.assertIn(f"sightline {command}", run(self.path("bin", "sightline"), command, "--help"))

    def test_examples_are_whole(self):
        examples = self.path("share", "sightline", "examples")
        out = run(self.path("bin", "sightline"), "part", os.path.join(examples, "cylinder_head", "cylinder_head.glb"))
        self.assertRegex(out, r"open edges +0\n")
        self.assertTrue(os.listdir(os.path.join(examples, "catalogue", "cameras")))
        self.assertFalse(os.path.exists(os.path.join(examples, "cylinder_head", "generate.cpp")))

    def test_manual_and_completions(self):
        for program in PROGRAMS:
            with gzip.open(self.path("share", "man", "man1", f"{program}.1.gz"), "rt") as file:
                self.assertIn(".SH SYNOPSIS", file.read())
            run("bash", "-n", self.path("share", "bash-completion", "completions", program))
            self.assertIn(f"#compdef {program}", self.read("share", "zsh", "site-functions", f"_{program}"))
        self.assertIn("Sightline", self.read("share", "doc", "sightline", "README.md"))
        self.assertTrue(os.path.exists(self.path("share", "doc", "sightline", "docs", "getting-started.md")))

    def test_units_are_of_this_prefix(self):
        for service, program in SERVICES.items():
            unit = self.read("lib", "systemd", "system", f"{service}.service")
            self.assertIn(f"\nExecStart={self.prefix}/bin/{program}", unit)
            self.assertIn(f"\nEnvironmentFile={self.prefix}/etc/default/{service}\n", unit)
            self.assertIn("\nDynamicUser=yes\n", unit)
            self.assertNotIn("@BINDIR@", unit)
            self.assertIn("\nOPTIONS=", self.read("etc", "default", service))

    def test_options_that_somebody_changed_stay(self):
        service = "sightline-serve"
        with open(self.path("etc", "default", service), "a", encoding="utf-8") as file:
            file.write("MEMORY_MAX=1G\n")
        run(CMAKE, "--install", BUILD, "--prefix", self.prefix)
        self.assertTrue(self.read("etc", "default", service).endswith("MEMORY_MAX=1G\n"))


if __name__ == "__main__":
    unittest.main(argv=sys.argv[:1])
