# SPDX-License-Identifier: Apache-2.0
"""Programs with variants of their sources: compiled all at once, each behind a switch.

A list of variants, such as tests/servo/mutants.txt:

  @ FILE       whose variants follow
  original     a piece of an expression, a statement or a constant; " @2" behind it: the second one
               in the file; "[Vec3] " before it: its type, where variants have others
  => variant   what stands in its place; behind a last " # " a note
  =~ variant   the same, marked
"""
import functools
import pathlib
import re
import subprocess
import sys
import typing

ROOT = pathlib.Path(__file__).resolve().parent.parent
VARIABLE = "PALPATE_VARIANT"  # of the environment: the number of the variant in force, from 1
USERS = {"palpate/servo/last_gate.hpp": ["palpate/servo/cycle.cpp",
                                         "tests/servo/test_last_gate.cpp"]}
SWITCH = f"""#pragma once
#include <cstdlib>
inline int palpate_variant() {{
  static const char* const text = std::getenv("{VARIABLE}");
  static const int number = text ? std::atoi(text) : 0;
  return number;
}}
"""


class Variant(typing.NamedTuple):
    file: str
    original: str
    kind: str  # its type, or None
    nth: int  # which of several, or None
    text: str
    marked: bool
    note: str  # or empty


class Piece(typing.NamedTuple):
    """A place in the sources, with [(number, text)] of its variants."""
    file: str
    at: int
    original: str
    kind: str
    variants: list


def read_list(path):
    """[Variant], numbered from 1 by position."""
    variants, file, original = [], None, None
    for line in path.read_text().splitlines():
        if not line or line.startswith("#"):
            continue
        if line.startswith("@ "):
            file = line[2:]
        elif line.startswith(("=> ", "=~ ")):
            text, _, note = line[3:].rpartition(" # ") if " # " in line else (line[3:], "", "")
            variants.append(Variant(file, *original, text.strip(), line[1] == "~", note))
        else:
            kind, text, nth = re.fullmatch(r"(?:\[(\w+)\] )?(.*?)(?: @(\d+))?", line).groups()
            original = (text, kind, int(nth) if nth else None)
    return variants


@functools.cache
def source_of(file):
    return (ROOT / file).read_text()


def position(source, variant):
    places = [m.start() for m in re.finditer(re.escape(variant.original), source)]
    nth = variant.nth
    if nth is None and len(places) != 1 or nth is not None and len(places) < nth:
        sys.exit(f"{variant.file}: '{variant.original}' is there {len(places)} times; say which "
                 "by ' @N'")
    return places[(nth or 1) - 1]


def numbers_of(arguments, most):
    """{number} of what "12" and "274-293" name."""
    chosen = set()
    for argument in arguments:
        match = re.fullmatch(r"(\d+)(?:-(\d+))?", argument)
        first, last = (int(n) for n in (match[1], match[2] or match[1])) if match else (0, 0)
        if not 1 <= first <= last <= most:
            sys.exit(f"{argument}: no such variants; there are 1-{most}")
        chosen.update(range(first, last + 1))
    return chosen


def switched(original, kind, variants):
    """The original with its variants behind switches. variants: [(number, text)]."""
    if original.startswith("constexpr "):
        head, _, value = original.partition(" = ")
        for number, text in variants:
            value = f"palpate_variant() == {number} ? {text.partition(' = ')[2]} : {value}"
        return head.replace("constexpr", "const") + " = " + value
    if original.endswith(";"):
        chain = "".join(f"if (palpate_variant() == {n}) {{ {t} }} else " for n, t in variants)
        return f"{{ {chain}{{ {original} }} }}"
    wrap = kind or ""
    result = f"{wrap}({original})"
    for number, text in variants:
        result = f"(palpate_variant() == {number} ? {wrap}({text}) : {result})"
    return result


def batches(variants):
    """[[Piece]]. Variants of one piece belong together; pieces that overlap, to two batches."""
    pieces = {}
    for number, v in enumerate(variants, 1):
        at = position(source_of(v.file), v)
        pieces.setdefault((v.file, at, v.original, v.kind), []).append((number, v.text))
    result = []
    for key, texts in sorted(pieces.items(), key=lambda p: p[0][:3]):
        piece = Piece(*key, texts)
        end = piece.at + len(piece.original)
        for batch in result:
            if all(p.file != piece.file or end <= p.at or p.at + len(p.original) <= piece.at
                   for p in batch):
                batch.append(piece)
                break
        else:
            result.append([piece])
    return result


def build(batch, build_folder, folder, target, flags=()):
    """Links ninja's `target` with the switched sources before the libraries. @return its path.
    A header's variants are in what USERS names; a test that it names is there twice, then."""
    (folder / "switch.hpp").write_text(SWITCH)
    objects = []
    files = {piece.file for piece in batch}
    for file in sorted(files, key=lambda name: (name not in USERS, name)):
        source = source_of(file)
        for piece in sorted((p for p in batch if p.file == file), key=lambda p: p.at, reverse=True):
            source = (source[:piece.at] + switched(piece.original, piece.kind, piece.variants) +
                      source[piece.at + len(piece.original):])
        copy = folder / (file if file in USERS else pathlib.Path(file).name)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_text(source)
        users = USERS.get(file)
        for source in [ROOT / user for user in users if user not in files] if users else [copy]:
            objects.append(folder / f"{len(objects)}.o")
            subprocess.run(["c++", "-std=c++20", "-O2", "-w", *flags, f"-I{folder}", f"-I{ROOT}",
                            "-isystem", "/usr/include/eigen3", "-include", folder / "switch.hpp",
                            "-c", source, "-o", objects[-1]], check=True)
    command = subprocess.run(["ninja", "-C", build_folder, "-t", "commands", "-s", target],
                             check=True, capture_output=True, text=True).stdout
    link = command.partition("&& ")[2].partition(" && ")[0]
    program = folder / pathlib.Path(target).name
    first = re.search(r"\S+\.c(pp|xx)\.o", link).group()  # of a room's files, or all as one
    link = link.replace(first, " ".join(map(str, objects)) + " " + first, 1)
    # A library of a unity build has all of a room in one object: what comes first counts.
    link = re.sub(rf"-o \S*{program.name}(?= |$)", f"-Wl,-z,muldefs -o {program}", link)
    subprocess.run(link, shell=True, check=True, cwd=build_folder)
    return program
