# SPDX-License-Identifier: Apache-2.0
"""Man pages and completions say what --help says, and an unknown form of help is an error."""

import os
import stat
import subprocess
import sys
import tempfile
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../deploy/command_line"))
import command_help  # noqa: E402
import completion  # noqa: E402
import man_page  # noqa: E402

HELP = """Sightline does two things.
Usage: two [OPTIONS] SUBCOMMAND

Options:
  -h,--help                   Print this help message and exit
  --form TEXT:{text,json}     form of what is printed

Subcommands:
  draw                        draws .parts
  serve                       for remote clients

Examples:
  two draw part.stl --out x   one
                              more
"""
DRAW = """draws .parts
Usage: two draw [OPTIONS] input

Positionals:
  input TEXT REQUIRED         file of the part

Options:
  -h,--help                   Print this help message and exit
  --out TEXT REQUIRED         folder [of images]: made anew
  --max-bytes INT:SIZE [b, kb(=1024b), ...]:FLOAT in [1 - 1e+15]=536870912
                              Largest image
  --threads INT:INT in [0 - 64]
                              0: one per core
  --no-noise{false}           without noise
  --worker,--server TEXT ...  addresses
  --schema TEXT Needs: --form it's checked by this
"""
SERVE = """for remote clients
Usage: two serve [OPTIONS]

Options:
  -h,--help                   Print this help message and exit
  --level TEXT:{debug,info}=info
                              what is logged
  --trace TEXT (Env:TRACE)    the request
"""


def two():
    command, below = command_help.parse_help(HELP, ["two"])
    assert below == [("draw", "draws .parts"), ("serve", "for remote clients")], below
    for text, (name, summary) in zip([DRAW, SERVE], below):
        subcommand, _ = command_help.parse_help(text, ["two", name])
        subcommand.summary = summary
        command.subcommands.append(subcommand)
    return command


class ParseTest(unittest.TestCase):
    def test_every_form_of_an_argument(self):
        draw = two().subcommands[0]
        self.assertEqual([one.names for one in draw.positionals], [["input"]])
        options = {one.names[-1]: one for one in draw.options}
        self.assertEqual(list(options), [
            "--help", "--out", "--max-bytes", "--threads", "--no-noise", "--server", "--schema"])
        self.assertTrue(options["--out"].required)
        self.assertEqual(options["--out"].description, "folder [of images]: made anew")
        self.assertEqual(
            (options["--max-bytes"].placeholder, options["--max-bytes"].default, options["--max-bytes"].limits),
            ("SIZE", "536870912", ""))
        self.assertEqual(options["--threads"].limits, "0 to 64")
        self.assertEqual(options["--no-noise"].placeholder, "")
        self.assertEqual(options["--server"].names, ["--worker", "--server"])
        self.assertTrue(options["--server"].repeated)
        self.assertEqual(options["--schema"].needs, "--form")
        self.assertEqual(options["--schema"].description, "it's checked by this")

    def test_ranges_say_which_ends_are_excluded(self):
        argument = command_help.parse_argument("--fov-deg FLOAT:in (0, 170)", "")
        self.assertEqual((argument.placeholder, argument.limits), ("FLOAT", "0 (excluded) to 170 (excluded)"))
        argument = command_help.parse_argument("--goal FLOAT:in (0, 1]", "")
        self.assertEqual(argument.limits, "0 (excluded) to 1")

    def test_choices_and_defaults(self):
        level = two().subcommands[1].options[1]
        self.assertEqual((level.choices, level.default), (["debug", "info"], "info"))

    def test_environment(self):
        trace = two().subcommands[1].options[2]
        self.assertEqual((trace.placeholder, trace.environment, trace.description), ("TEXT", "TRACE", "the request"))

    def test_examples(self):
        self.assertEqual([line.split() for line in two().examples],
                         [["two", "draw", "part.stl", "--out", "x", "one"], ["more"]])
        self.assertIn("two draw part.stl", man_page.man_page(two(), "1", ["two"]).replace("\\-", "-"))

    def test_what_it_does_not_know_is_an_error(self):
        for old, new in [("Options:", "Choices:"), ("--out TEXT REQUIRED", "--out TEXT <OUT>"),
                         ("  --threads", " --threads"), ("--no-noise{false}", "--no_noise{false}")]:
            with self.subTest(new), self.assertRaises(command_help.HelpError):
                self.assertIn(old, DRAW)
                command_help.parse_help(DRAW.replace(old, new), ["two", "draw"])

    def test_a_program_that_fails_is_an_error(self):
        with tempfile.TemporaryDirectory() as folder:
            program = os.path.join(folder, "broken")
            with open(program, "w", encoding="utf-8") as file:
                file.write("#!/bin/sh\necho no >&2\nexit 3\n")
            os.chmod(program, stat.S_IRWXU)
            with self.assertRaisesRegex(command_help.HelpError, "broken --help: exit code 3: no"):
                command_help.read_command(program)


class ManPageTest(unittest.TestCase):
    def test_has_every_command_option_and_description(self):
        command = two()
        page = man_page.man_page(command, "1.2.3", ["two", "other"])
        plain = page.replace("\\-", "-").replace("\\fB", "").replace("\\fI", "").replace("\\fR", "")
        for one in command.walk():
            self.assertIn(" ".join(one.words), plain)
            for option in one.options:
                self.assertIn("\n" + ", ".join(option.names), plain)
                self.assertIn(option.description, plain)
        self.assertIn('"Sightline 1.2.3"', plain)
        self.assertIn("From 0 to 64.", plain)
        self.assertIn("two draw --out TEXT [OPTIONS] input", plain)
        self.assertIn("other(1)", plain)
        self.assertNotIn("two(1)", plain)

    def test_text_is_never_a_request(self):
        self.assertEqual(man_page.roff(".so /etc/passwd"), "\\&.so /etc/passwd")
        self.assertEqual(man_page.roff("a\\b"), "a\\eb")


class BashTest(unittest.TestCase):
    def complete(self, *words):
        """What bash offers for the last one of `words`."""
        script = completion.bash_completion(two()) + (
            'COMP_WORDS=("$@"); COMP_CWORD=$(($# - 1)); _two; printf "%s\\n" "${COMPREPLY[@]}"')
        done = subprocess.run(["bash", "-euc", script, "bash", *words], capture_output=True, text=True, check=True)
        return done.stdout.split()

    def test_commands(self):
        self.assertEqual(self.complete("two", ""), ["draw", "serve"])
        self.assertEqual(self.complete("two", "se"), ["serve"])

    def test_options_of_the_command_that_is_there(self):
        self.assertEqual(self.complete("two", "--f"), ["--form"])
        self.assertEqual(self.complete("two", "draw", "--m"), ["--max-bytes"])
        self.assertEqual(self.complete("two", "--form", "json", "serve", "--"), ["--help", "--level", "--trace"])

    def test_values(self):
        self.assertEqual(self.complete("two", "--form", ""), ["text", "json"])
        self.assertEqual(self.complete("two", "serve", "--level", "=", "d"), ["debug"])
        self.assertEqual(self.complete("two", "serve", "--level", "="), ["debug", "info"])

    def test_files_where_nothing_is_known(self):
        # With nothing offered readline completes file names.
        self.assertEqual(self.complete("two", "draw", "--out", ""), [])
        self.assertEqual(self.complete("two", "draw", "--out", "draw", ""), [])


if __name__ == "__main__":
    unittest.main()
