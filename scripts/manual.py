#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The man page and bash's completion, from the program's own help: `manual.py PROGRAM FOLDER`.

Writes FOLDER/palpate.1.gz and FOLDER/palpate.
"""

import gzip
import pathlib
import re
import subprocess
import sys


def said(program, *arguments):
    return subprocess.run([program, *arguments], check=True, capture_output=True, text=True).stdout


def entries(text, heading):
    """(name, meaning) of the lines below a heading of CLI11's help; a long name has its meaning
    in the next line."""
    found, inside = [], False
    for line in text.splitlines():
        if not line.startswith(" "):
            inside = line == heading + ":" if line else False
        elif inside:
            match = re.match(r"  (\S.*?)(?:\s{2,}(.*))?$", line)
            if match:
                found.append([match.group(1), match.group(2) or ""])
            elif found:
                found[-1][1] = f"{found[-1][1]} {line.strip()}".strip()
    return found


def roff(text):
    text = text.replace("\\", r"\(rs").replace("-", r"\-")
    return "\n".join(r"\&" + line if line.startswith((".", "'")) else line
                     for line in text.splitlines())


def listed(rows):
    return "".join(f".TP\n.B {roff(name)}\n{roff(meaning)}\n" for name, meaning in rows)


def manual(version, summary, verbs):
    """verbs: (name, summary, usage, positionals, options)."""
    page = (f'.TH PALPATE 1 "" "{roff(version)}" "User Commands"\n.SH NAME\n'
            f"palpate \\- {roff(summary.rstrip('.'))}\n"
            ".SH SYNOPSIS\n.B palpate\n.I VERB\n[\\fIOPTIONS\\fR]\n.SH VERBS\n")
    for name, meaning, usage, positionals, options in verbs:
        page += f".SS {roff(name)}\n{roff(meaning)}\n.PP\n.B {roff(usage)}\n"
        page += listed(positionals + options)
    return page + (".SH EXIT STATUS\n0: done, 1: failed while running, 2: wrong usage or input; "
                   "128 and a signal's number where that ended the work.\n")


def completion(verbs):
    """Verbs, then a verb's options, then files."""
    cases = "".join(
        f"    {name}) words='{' '.join(word for option, _ in options for word in words(option))}' "
        ";;\n" for name, _, _, _, options in verbs)
    return ("# bash completion of palpate, made from its help\n_palpate() {\n"
            "  local word=${COMP_WORDS[COMP_CWORD]} words=\n  case ${COMP_WORDS[1]} in\n" + cases +
            "  esac\n"
            f"  if ((COMP_CWORD == 1)); then words='{' '.join(verb[0] for verb in verbs)}'; fi\n"
            "  if [[ $word == -* || $COMP_CWORD == 1 ]]; then\n"
            '    mapfile -t COMPREPLY < <(compgen -W "$words" -- "$word")\n'
            "  else\n"
            '    mapfile -t COMPREPLY < <(compgen -f -- "$word")\n'
            "  fi\n}\ncomplete -o filenames -F _palpate palpate palpate-lab\n")


def words(option):
    return re.findall(r"--[a-z][a-z-]*", option.split("(Env:")[0])


def verbs_of(program):
    text = said(program, "--help")
    for name, meaning in entries(text, "Subcommands"):
        of_verb = said(program, name, "--help")
        usage = re.search(r"^Usage: (.*)$", of_verb, re.M).group(1)
        yield (name, meaning, usage, entries(of_verb, "Positionals"), entries(of_verb, "Options"))


def main(program, folder):
    folder = pathlib.Path(folder)
    verbs = list(verbs_of(program))
    summary = said(program, "--help").splitlines()[0]
    page = manual(said(program, "--version").strip(), summary, verbs)
    with gzip.GzipFile(folder / "palpate.1.gz", "wb", mtime=0) as file:
        file.write(page.encode())
    (folder / "palpate").write_text(completion(verbs), encoding="utf-8")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
