# SPDX-License-Identifier: Apache-2.0
"""The command line of a program as its own --help describes it (the form of CLI11).

Man pages and completions are made from this, so that they say what the program says. A line that
does not have the known form is an error: better no page than one that leaves something out.
"""

import dataclasses
import os
import re
import subprocess

DESCRIPTION_COLUMN = 30  # of CLI11's formatter
MAX_DEPTH = 3  # of subcommands
HELP_TIMEOUT_S = 60


class HelpError(Exception):
    """A program gave no help, or help of an unknown form."""


@dataclasses.dataclass
class Argument:
    """An option or a positional argument."""

    names: list  # ["-h", "--help"]; a positional has one without dashes
    placeholder: str = ""  # "" for flags
    choices: list = dataclasses.field(default_factory=list)
    limits: str = ""  # "1 to 64"
    default: str = ""
    needs: str = ""
    environment: str = ""  # variable that gives it as well
    required: bool = False
    repeated: bool = False
    description: str = ""


@dataclasses.dataclass
class Command:
    """A program or one of its subcommands, with those below it."""

    words: list  # ["sightline", "recordings", "new"]
    summary: str = ""  # the parent's line about it; of a program its description
    positionals: list = dataclasses.field(default_factory=list)
    options: list = dataclasses.field(default_factory=list)
    examples: list = dataclasses.field(default_factory=list)  # lines as they are printed
    subcommands: list = dataclasses.field(default_factory=list)

    def walk(self):
        """This command and all below it, parents first."""
        yield self
        for subcommand in self.subcommands:
            yield from subcommand.walk()


def parse_argument(left, description):
    """Of the left column, e.g. `--workers INT:INT in [0 - 256]=1`. Raises HelpError."""
    names, _, kind = left.strip().partition(" ")
    # The value of a flag, `--no-pictures{false}`, is not typed.
    argument = Argument([re.sub(r"\{[^}]*\}$", "", name) for name in names.split(",")], description=description)
    for name in argument.names:
        if not re.fullmatch(r"-[A-Za-z]|--[a-z0-9][a-z0-9-]*|[A-Za-z][A-Za-z0-9_-]*", name):
            raise HelpError(f'"{left}": {name} is no name of an option')
    if found := re.search(r" ?Needs: (.+)$", kind):
        argument.needs = found[1]
        kind = kind[:found.start()]
    if found := re.search(r" ?\(Env:(\w+)\)$", kind):
        argument.environment = found[1]
        kind = kind[:found.start()]
    if kind.endswith("REQUIRED"):
        argument.required = True
        kind = kind.removesuffix("REQUIRED").rstrip()
    if kind.endswith("..."):
        argument.repeated = True
        kind = kind.removesuffix("...").rstrip()
    if found := re.search(r"=(\S+)$", kind):
        argument.default = found[1]
        kind = kind[:found.start()]
    if not kind:
        return argument
    form = re.fullmatch(r"([A-Z]+)((?::[A-Z]+(?: in)?(?: \[[^\]]*\])?|:in [\[(][^\])]*[\])]|:\{[^}]*\})*)", kind)
    if not form:
        raise HelpError(f'"{left}": the value "{kind}" has no known form')
    is_size = ":SIZE " in kind
    argument.placeholder = "SIZE" if is_size else form[1]
    if found := re.search(r":\{([^}]*)\}", kind):
        argument.choices = found[1].split(",")
    # The limits of sizes are those of the arithmetic, so they are left out.
    if not is_size and (found := re.search(r" in \[(\S+) - (\S+)\]", kind)):
        argument.limits = f"{found[1]} to {found[2]}"
    elif found := re.search(r":in ([\[(])(\S+), (\S+)([\])])", kind):
        least = found[2] + (" (excluded)" if found[1] == "(" else "")
        most = found[3] + (" (excluded)" if found[4] == ")" else "")
        argument.limits = f"{least} to {most}"
    return argument


def split_entries(lines):
    """Pairs of left column and description, of the lines of one section."""
    blank = " " * DESCRIPTION_COLUMN
    entries = []
    for line in lines:
        if line.startswith(blank):
            if not entries:
                raise HelpError(f'"{line}" describes nothing')
            entries[-1][1].append(line.strip())
        elif re.match(r"  \S", line):
            entries.append((line, []))
        else:
            raise HelpError(f'"{line}" has no known form')
    for left, description in entries:
        # A long left column has its whole description on the next lines.
        if not description or begins_on_the_line(left):
            left, description = left[:DESCRIPTION_COLUMN], [left[DESCRIPTION_COLUMN:].strip(), *description]
        yield left.strip(), " ".join(description)


def begins_on_the_line(line):
    """Whether the description of an entry, which goes on on the next lines, begins on its first one."""
    left, right = line[:DESCRIPTION_COLUMN], line[DESCRIPTION_COLUMN:]
    if not left.endswith(" ") or not right.strip() or right.startswith(" "):
        return False
    try:
        parse_argument(left, "")
    except HelpError:
        return False
    return True


def parse_help(text, words):
    """The Command that `text` describes, and the names and summaries of its subcommands."""
    command = Command(words)
    subcommands = []
    sections = {}
    title = "description"
    for line in text.splitlines():
        if line.startswith("Usage: "):
            title = "usage"
        elif re.fullmatch(r"\S.*:", line):
            title = line[:-1]
        elif line.strip():
            sections.setdefault(title, []).append(line)
    command.summary = " ".join(line.strip() for line in sections.pop("description", []))
    sections.pop("usage", None)
    command.examples = [line[2:] for line in sections.pop("Examples", [])]
    for title, lines in sections.items():
        entries = list(split_entries(lines))
        if title == "Positionals":
            command.positionals = [parse_argument(*entry) for entry in entries]
        elif title == "Options":
            command.options = [parse_argument(*entry) for entry in entries]
        elif title == "Subcommands":
            subcommands = entries
        else:
            raise HelpError(f'the section "{title}" is not known')
    if not command.options:
        raise HelpError("it lists no options")
    return command, subcommands


def run(program, arguments):
    """What `program` prints, under its plain name whatever folder it is in. Raises HelpError."""
    command = " ".join([os.path.basename(program), *arguments])
    try:
        done = subprocess.run([os.path.basename(program), *arguments], executable=program,
                              capture_output=True, text=True, timeout=HELP_TIMEOUT_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise HelpError(f"{command}: {error}") from error
    if done.returncode != 0:
        raise HelpError(f"{command}: exit code {done.returncode}: {done.stderr.strip()}")
    return done.stdout


def command_names(program):
    """Names of the commands that the help of `program` lists. Raises HelpError."""
    name = os.path.basename(program)
    try:
        return [below for below, _ in parse_help(run(program, ["--help"]), [name])[1]]
    except HelpError as error:
        raise HelpError(f"{name} --help: {error}") from error


def read_command(program, words=None, summary="", chosen=None):
    """Asks `program` for the help of all its commands, or of those that are `chosen`. Raises HelpError."""
    words = words or [os.path.basename(program)]
    if len(words) > MAX_DEPTH:
        raise HelpError(f"{' '.join(words)}: more than {MAX_DEPTH} levels of commands")
    try:
        command, subcommands = parse_help(run(program, [*words[1:], "--help"]), words)
    except HelpError as error:
        raise HelpError(f"{' '.join(words)} --help: {error}") from error
    command.summary = summary or command.summary
    for name, description in subcommands:
        if chosen is not None and name not in chosen:
            continue
        command.subcommands.append(read_command(program, [*words, name], description))
    return command


def read_version(program):
    """The version that `program` prints, without name and commit. Raises HelpError."""
    text = run(program, ["--version"])
    found = re.fullmatch(r"\S+ (\S+) \(\S+\)\n", text)
    if not found:
        raise HelpError(f'{program} --version: "{text.strip()}" has no known form')
    return found[1]
