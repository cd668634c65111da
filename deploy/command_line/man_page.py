# SPDX-License-Identifier: Apache-2.0
"""A man page, section 1, of a program and all its subcommands."""

EXIT_CODES = [
    ("0", "done, or ended as asked"),
    ("1", "failed"),
    ("2", "the input or the arguments are wrong"),
]
INTERRUPTED = ("130", "interrupted")


def roff(text):
    """Plain text as roff: no character of it commands anything."""
    text = text.replace("\\", "\\e").replace("-", "\\-").replace("~", "\\(ti").replace("^", "\\(ha")
    return "\n".join("\\&" + line if line[:1] in (".", "'") else line for line in text.split("\n"))


def sentence(text):
    """With a full stop. Its first word stays as it is: it may be the name of a file or a value."""
    return text if text.endswith(".") or not text else text + "."


def value(argument):
    if not argument.placeholder:
        return ""
    return " \\fI" + roff(argument.placeholder) + "\\fR" + ("..." if argument.repeated else "")


def entry(argument):
    names = ", ".join(
        ("\\fB" if name.startswith("-") else "\\fI") + roff(name) + "\\fR" for name in argument.names)
    is_option = argument.names[0].startswith("-")
    facts = [sentence(argument.description)]
    if argument.choices:
        facts.append("One of " + ", ".join(argument.choices) + ".")
    if argument.limits:
        facts.append(f"From {argument.limits}.")
    if argument.default:
        facts.append(f"Default: {argument.default}.")
    if argument.environment:
        facts.append(f"Also taken from the environment, {argument.environment}.")
    if argument.needs:
        facts.append(f"Only with {argument.needs}.")
    if argument.required and is_option:
        facts.append("Required.")
    return [".TP", names + (value(argument) if is_option else ""), roff(" ".join(filter(None, facts)))]


def synopsis(command):
    words = "\\fB" + roff(" ".join(command.words)) + "\\fR"
    for option in command.options:
        if option.required:
            words += f" \\fB{roff(option.names[-1])}\\fR{value(option)}"
    words += " [\\fIOPTIONS\\fR]"
    for positional in command.positionals:
        words += f" \\fI{roff(positional.names[0])}\\fR"
    if command.subcommands:
        words += " \\fICOMMAND\\fR ..."
    return words


def arguments(command):
    lines = []
    for argument in [*command.positionals, *command.options]:
        if argument.names[-1] != "--help" or len(command.words) == 1:
            lines += entry(argument)
    return lines


def man_page(command, version, programs):
    """Roff of `command`, a program; `programs` are the names of all that have a page."""
    name = command.words[0]
    commands = [below for below in command.walk() if below is not command]
    summary = command.summary.rstrip(".").removeprefix("Sightline ")
    lines = [
        f'.TH {roff(name.upper())} 1 "" "Sightline {roff(version)}" "Sightline"',
        ".SH NAME",
        f"{roff(name)} \\- {roff(summary[:1].lower() + summary[1:])}",
        ".SH SYNOPSIS",
    ]
    for shown in [command, *commands]:
        if shown is command or not shown.subcommands:
            lines += [".nf", synopsis(shown), ".fi"]
    lines += [".SH DESCRIPTION", roff(sentence(command.summary)), ".SH OPTIONS", *arguments(command)]
    if commands:
        lines.append(".SH COMMANDS")
    for below in commands:
        lines += [f".SS {roff(' '.join(below.words))}", roff(sentence(below.summary)), *arguments(below)]
    if command.examples:
        lines += [".SH EXAMPLES", ".nf", *(roff(line) for line in command.examples), ".fi"]
    lines.append(".SH EXIT STATUS")
    for code, meaning in EXIT_CODES + ([INTERRUPTED] if commands else []):
        lines += [".TP", f"\\fB{code}\\fR", meaning]
    lines.append(".SH SEE ALSO")
    others = [f"\\fB{roff(other)}\\fR(1)" for other in programs if other != name]
    lines.append(",\n".join(others))
    lines += [".PP", "The documentation is in the folder share/doc/sightline of where this is installed."]
    return "\n".join(lines) + "\n"
