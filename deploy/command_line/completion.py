# SPDX-License-Identifier: Apache-2.0
"""Completions of bash and zsh for a program and all its subcommands."""

import shlex

GENERATED = "made from what `{} --help` says"


def function_name(command):
    return "_" + "_".join(word.replace("-", "_") for word in command.words)


def option_names(command):
    return [name for option in command.options for name in option.names]


def bash_completion(program):
    """A file for share/bash-completion/completions. Needs nothing but bash."""
    name = program.words[0]
    commands, values, words = [], [], []
    for command in program.walk():
        path = " ".join(command.words)
        for below in command.subcommands:
            commands.append(f"      {shlex.quote(' '.join(below.words))}) command={shlex.quote(' '.join(below.words))} ;;")
        for option in command.options:
            if option.placeholder:
                pattern = "|".join(shlex.quote(f"{path} {one}") for one in option.names)
                choices = shlex.quote(" ".join(option.choices))
                # Without choices readline completes names of files.
                values.append(f"    {pattern}) choices={choices} is_value=1 ;;")
        options = shlex.quote(" ".join(option_names(command)))
        below = shlex.quote(" ".join(one.words[-1] for one in command.subcommands))
        words.append(f"    {shlex.quote(path)}) options={options} commands={below} ;;")
    return "\n".join([
        f"# bash completion of {name}, " + GENERATED.format(name),
        f"{function_name(program)}() {{",
        "  local current=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}",
        f"  local command={name} choices='' is_value='' options='' commands='' word words",
        "  COMPREPLY=()",
        "  # --option=value comes as three words.",
        "  if [[ $current == = ]]; then",
        "    current=",
        "  elif [[ $previous == = ]]; then",
        "    previous=${COMP_WORDS[COMP_CWORD - 2]}",
        "  fi",
        '  for word in "${COMP_WORDS[@]:1:COMP_CWORD - 1}"; do',
        '    case "$command $word" in',
        *commands,
        "    esac",
        "  done",
        '  case "$command $previous" in',
        *values,
        "  esac",
        '  case "$command" in',
        *words,
        "  esac",
        "  if [[ -n $is_value ]]; then",
        "    words=$choices",
        "  elif [[ $current == -* ]]; then",
        "    words=$options",
        "  else",
        "    words=$commands",
        "  fi",
        '  mapfile -t COMPREPLY < <(compgen -W "$words" -- "$current")',
        "}",
        f"complete -o default -F {function_name(program)} {name}",
        "",
    ])


def zsh_text(text):
    """Inside the brackets of a specification of _arguments."""
    for character in "\\[]:":
        text = text.replace(character, "\\" + character)
    return text


def zsh_value(argument):
    if argument.choices:
        return f":{argument.placeholder}:({' '.join(argument.choices)})"
    # Only free text may name a file.
    return f":{argument.placeholder}:" + ("_files" if argument.placeholder == "TEXT" else " ")


def zsh_specifications(command):
    for option in command.options:
        text = f"[{zsh_text(option.description)}]" + (zsh_value(option) if option.placeholder else "")
        once = "" if option.repeated else "(" + " ".join(option.names) + ")"
        for name in option.names:
            yield f"{'*' if option.repeated else once}{name}{text}"


def zsh_function(command):
    lines = [f"{function_name(command)}() {{"]
    specifications = list(zsh_specifications(command))
    if command.subcommands:
        specifications += ["1:command:->command", "*::argument:->argument"]
        lines.append("  local context state state_descr line")
        lines.append("  typeset -A opt_args")
    else:
        for positional in command.positionals:
            specifications.append(f":{zsh_text(positional.names[0])}:_files")
    lines.append("  _arguments -C -s -S \\" if command.subcommands else "  _arguments -s -S \\")
    lines += [f"    {shlex.quote(one)} \\" for one in specifications[:-1]]
    lines.append(f"    {shlex.quote(specifications[-1])}" + (" && return" if command.subcommands else ""))
    if command.subcommands:
        below = [f"{one.words[-1]}:{zsh_text(one.summary)}" for one in command.subcommands]
        lines += [
            "  case $state in",
            "    command)",
            "      local -a commands=(",
            *(f"        {shlex.quote(one)}" for one in below),
            "      )",
            "      _describe command commands",
            "      ;;",
            "    argument)",
            "      case $line[1] in",
            *(f"        {one.words[-1]}) {function_name(one)} ;;" for one in command.subcommands),
            "      esac",
            "      ;;",
            "  esac",
        ]
    return lines + ["}"]


def zsh_completion(program):
    """A file for share/zsh/site-functions, named _PROGRAM."""
    name = program.words[0]
    lines = [f"#compdef {name}", f"# zsh completion of {name}, " + GENERATED.format(name)]
    # The function of the program last: zsh loads this file as that function.
    for command in reversed(list(program.walk())):
        lines += zsh_function(command)
    return "\n".join(lines + [f'{function_name(program)} "$@"', ""])
