#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""docs/leaderboard.md, made from the entries in bench/entries.

    scripts/leaderboard.py                       writes the page
    scripts/leaderboard.py check                 exits 1 if the page is not what the entries give
    scripts/leaderboard.py make PROGRAM METHOD... [-- OPTIONS OF bench-entry]
                                                 makes entries, then the page; `all`: the lab's

`make` draws one seed by chance for all methods that it makes, unless --seed is among the options.
"""

import json
import pathlib
import secrets
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HEAD = """# Leaderboard

Made from the entries in `bench/entries` by `scripts/leaderboard.py`; what an entry is, and how to
make one: [bench-entries.md](bench-entries.md). Shares are in per cent, in brackets what holds them
with 95 % confidence. The *score* is the mean over the families of the share of cases that are
right; *held* the same of those in which the surface is not lost ([pop.md](pop.md)). Methods whose
scores' intervals overlap share a rank: `1-3` is a method that may be the first, second or third.
"""
COLUMNS = ("rank", "method", "score", "held", "real, right", "fidelity, aims met",
           "cases a family", "CPU-min", "cases")


def ranks(intervals):
    """The least and greatest rank that each (low, high) may have; overlapping ones share one."""
    return [(1 + sum(low > mine_high for low, _ in intervals),
             len(intervals) - sum(high < mine_low for _, high in intervals))
            for mine_low, mine_high in intervals]


def interval(score):
    if isinstance(score, str):
        return "-"
    return f"{score['value']:.1f} ({score['low']:.1f}-{score['high']:.1f})"


def table(entries):
    """Rows of entries of one kind, best first. The ruler, which knows the truth, has no rank."""
    entries = sorted(entries, key=lambda e: (-e["scores"]["score"]["value"], e["method"]))
    ranked = [e for e in entries if e["method"] != "ideal"]
    scores = [e["scores"]["score"] for e in ranked]
    places = ranks([(score["low"], score["high"]) for score in scores])
    rank_of = {id(e): f"{first}" if first == last else f"{first}-{last}"
               for e, (first, last) in zip(ranked, places)}
    lines = ["| " + " | ".join(COLUMNS) + " |", "|" + "---|" * len(COLUMNS)]
    for e in entries:
        scores, real = e["scores"], e["scores"]["real"]
        real = real if isinstance(real, str) else real["right"]
        cells = (rank_of.get(id(e), "ruler"), f"`{e['method']}`", interval(scores["score"]),
                 interval(scores["held"]), interval(real),
                 interval(scores["fidelity"]["aims met"]), str(e["cases"]),
                 f"{e['run']['cpu_seconds'] / 60:.1f}", f"`{e['cases_sha256'][:8]}`")
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def page(entries):
    """The page's text. Only entries that were made with the same families are compared."""
    text = HEAD
    for heading, wanted in (("With real recordings", True), ("Without", False)):
        chosen = [e for e in entries if bool(e["recordings"]) == wanted]
        if not chosen:
            continue
        text += f"\n## {heading}\n\n{table(chosen)}\n"
        names = sorted({r["name"] for e in chosen for r in e["recordings"]})
        if names:
            text += "\nRecordings: " + ", ".join(f"`{name}`" for name in names) + ".\n"
        cost = sum(e["run"]["cpu_seconds"] for e in chosen) / 60
        machines = sorted({e["run"]["processor"] for e in chosen})
        text += f"\n{cost:.1f} CPU-minutes in all, on {', '.join(machines)}.\n"
    return text


def read(folder):
    return [json.loads(path.read_text(encoding="utf-8")) for path in sorted(folder.glob("*.json"))]


def file_name(method):
    return "".join(c if c.isalnum() or c in "-_" else "-" for c in method)[:80] + ".json"


def make(program, methods, options, folder):
    if methods == ["all"]:
        listed = subprocess.run([program, "eval", "--list-methods"], check=True, text=True,
                                capture_output=True)
        methods = listed.stdout.split()
    if not any(option.startswith("--seed") for option in options):
        options = [*options, "--seed", str(secrets.randbits(32))]
    folder.mkdir(parents=True, exist_ok=True)
    for method in methods:
        print(f"== {method}", flush=True)
        subprocess.run([program, "bench-entry", method, *options, "--out",
                        str(folder / file_name(method))], check=True)


def main(arguments):
    entries, target = ROOT / "bench" / "entries", ROOT / "docs" / "leaderboard.md"
    if arguments[:1] == ["make"] and len(arguments) > 2:
        cut = arguments.index("--") if "--" in arguments else len(arguments)
        make(arguments[1], arguments[2:cut], arguments[cut + 1:], entries)
    elif arguments not in ([], ["check"]):
        sys.exit(__doc__)
    text = page(read(entries))
    if arguments == ["check"]:
        if not target.exists() or target.read_text(encoding="utf-8") != text:
            sys.exit("docs/leaderboard.md:1: it is not what bench/entries gives; run "
                     "scripts/leaderboard.py")
    else:
        target.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
