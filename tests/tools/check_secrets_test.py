# SPDX-License-Identifier: Apache-2.0
"""tools/check_secrets finds what is planted in a working tree, and nothing else."""

import base64
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "check_secrets"


def planted(text):
    """Secrets of these tests are written in base64, so that the tool does not find them here."""
    return base64.b64decode(text).decode()


PRIVATE_KEY = planted("LS0tLS1CRUdJTiBFQyBQUklWQVRFIEtFWS0tLS0tCk1IY0NBUUVFSUFBQUFBQUFBQUFB")
SECRETS = {
    "private-key": PRIVATE_KEY,
    "cloud-key": planted("QUtJQUlPU0ZPRE5ON0VYQU1QTEU="),
    "forge-token": planted("Z2hwX0FBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQUFBQQ=="),
    "web-token": planted("ZXlKaGJHY2lPaUpJVXpJMU5pSjkuZXlKemRXSWlPaUl4TWpNMEluMC5BQUFBQUFBQUFBQUFBQQ=="),
    "bearer-token": planted("QXV0aG9yaXphdGlvbjogQmVhcmVyIDAxMjM0NTY3ODlhYmNkZWYwMTIz"),
    "registry-token": planted("Ly9yZWdpc3RyeS5leGFtcGxlLzpfYXV0aFRva2VuPTAxMjM0NTY3ODlhYg=="),
    "url-password": planted("cG9zdGdyZXM6Ly9tZTpodW50ZXIyQGRiLnBsYW50L3g="),
    "assignment": planted("bXF0dF9wYXNzd29yZCA9ICJodW50ZXIyaHVudGVyMiI="),
}
HARMLESS = """
password_file = options.password_file
token = os.environ["SIGHTLINE_TOKEN"]
curl -H "Authorization: Bearer $TOKEN" https://mes.plant/
-----BEGIN CERTIFICATE-----
psql "host=/run/postgresql dbname=sightline"
if (text.find("-----BEGIN PRIVATE KEY-----") != npos)
"""


class CheckSecretsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)
        self.git("init", "--quiet")
        self.write("harmless.txt", HARMLESS)

    def git(self, *arguments):
        subprocess.run(["git", "-C", str(self.folder), *arguments], check=True, capture_output=True)

    def write(self, name, text, track=True):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        if track:
            self.git("add", "--force", name)

    def run_tool(self):
        return subprocess.run([sys.executable, str(TOOL), str(self.folder)], capture_output=True, text=True)

    def test_harmless_text_passes(self):
        result = self.run_tool()
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def test_finds_every_kind_and_never_shows_it(self):
        for rule, secret in SECRETS.items():
            with self.subTest(rule):
                self.write("deep/planted file.txt", f"first\n{secret}\nlast\n")
                result = self.run_tool()
                self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
                self.assertIn(f"deep/planted file.txt:2: {rule} ", result.stdout)
                self.assertNotIn(secret.splitlines()[-1], result.stdout + result.stderr)

    def test_untracked_files_are_not_looked_at(self):
        self.write("planted.txt", PRIVATE_KEY, track=False)
        self.assertEqual(self.run_tool().returncode, 0)

    def test_allowance_is_for_that_secret_alone(self):
        self.write("planted.txt", SECRETS["assignment"])
        digest = self.run_tool().stdout.split("assignment ")[1].split()[0]
        self.write("tools/secrets_allowed.txt", f"planted.txt assignment {digest}  # of a test\n")
        result = self.run_tool()
        self.assertEqual(result.returncode, 0, result.stdout)
        self.write("planted.txt", SECRETS["assignment"].replace("hunter2", "hunter3"))
        result = self.run_tool()
        self.assertEqual(result.returncode, 1)
        self.assertIn("planted.txt:1: assignment", result.stdout)
        self.assertIn("secrets_allowed.txt:1: allows what is not there", result.stdout)

    def test_allowance_needs_a_reason(self):
        self.write("tools/secrets_allowed.txt", "planted.txt assignment 0123456789abcdef\n")
        result = self.run_tool()
        self.assertEqual(result.returncode, 2)
        self.assertIn("secrets_allowed.txt:1", result.stderr)

    def test_folder_without_git_is_an_error(self):
        with tempfile.TemporaryDirectory() as folder:
            environment = {**os.environ, "GIT_CEILING_DIRECTORIES": str(pathlib.Path(folder).parent)}
            result = subprocess.run([sys.executable, str(TOOL), folder], capture_output=True,
                                    text=True, env=environment)
        self.assertEqual(result.returncode, 2, result.stdout)


if __name__ == "__main__":
    unittest.main()
