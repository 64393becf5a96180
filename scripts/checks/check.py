# SPDX-License-Identifier: Apache-2.0
"""Checks of the repository's own text: `check.py rooms|text|format...`, in the root.

One or several, one after another. Prints one line for each fault, `FILE:LINE: WHAT`, and exits 1 if
there is one.
"""

import os
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parents[2]


def allowed():
    """Who may know whom, {room: rooms}: the table of docs/design.md."""
    text = (ROOT / "docs/design.md").read_text(encoding="utf-8")
    table = text.partition("| depends on |")[2].partition("\n\n")[0]
    rows = re.findall(r"^\| `(\S+)` \|.*\| (.*) \|$", table, re.M)
    names = [path if path.startswith("app/") else path.rpartition("/")[2] for path, _ in rows]
    library = {name for name, (path, _) in zip(names, rows) if path.startswith("palpate/")}
    knows = {}
    for name, (_, cell) in zip(names, rows):
        listed, _, without = cell.partition(" except ")
        knows[name] = set(re.findall(r"\w+", listed)) & set(names)
        if "all library modules" in listed:
            knows[name] |= library - set(re.findall(r"\w+", without))
        if "the dependencies of app" in listed:
            knows[name] |= knows["app"]
    return knows


KNOWS = allowed()

# Folders of palpate/ that hold rooms.
GROUPS = {"kernel", "io", "net"}

# Methods are pure: neither threads nor clocks nor files, and no library but Eigen.
PURE = {"core", "paper", "sight", "feel", "methods", "fixtures", "tool"}
# Between frame and force they call none of the mathematical library but what rounds exactly: its
# results differ from machine to machine (core/mathematics.hpp).
LIBM = re.compile(r"\bstd::(exp|exp2|expm1|log|log2|log10|log1p|pow|cbrt|hypot|sin|cos|tan|asin"
                  r"|acos|atan|atan2|sinh|cosh|tanh|fma)\(")
MAY_USE_LIBM = {"palpate/servo/placement.cpp"}  # angles for people
CORE_ALLOWS = re.compile(r"Eigen/|[a-z_]+$")
CORE_FORBIDS = {
    "atomic", "barrier", "chrono", "condition_variable", "cstdio", "ctime", "filesystem",
    "fstream", "future", "iostream", "latch", "mutex", "random", "semaphore", "shared_mutex",
    "stop_token", "thread",
}

# A reader of the paper follows these: no function is longer [lines].
SHORT = re.compile(r"^palpate/(servo|kernel/(core|sight|feel|methods|cloud))/.*\.cpp$")
LONGEST = 60
BODY = re.compile(r"\{\n((?:[ #][^\n]*\n|\n)*)\}\n")

# The field set judges what was made with the lab's own scenes and sensors, so it must not reach
# their code, not even by a header of another room (docs/field.md).
FIELD = re.compile(r"^lab/(field/.*|experiments/field)\.[ch]pp$")
NOT_FIELD = re.compile(r"^(palpate/io/sources/|lab/experiments/|lab/grid_cloud\.)")

# Only the last gate writes to a device (docs/safety.md); a wrapper hands on what it was given.
DEVICE_WRITE = re.compile(r"(?i)\b\w*(?:device|hand|arm|pen)\w*(?:\(\))?(?:->|\.)write\(")
GATE = "palpate/servo/last_gate.hpp"
HANDED_ON = re.compile(r"^\s*void write\(const (Vec3& force|Wrench& wrench), double t\) noexcept "
                       r"override \{ (device|hand)_->write\((force|wrench), t\); \}$")

IGNORED = re.compile(r"\.git$|\.cache$|build|out$|node_modules$|__pycache__$|dist$")
CODE = re.compile(r"\.(c|h|cpp|hpp|py|ts|js|cmake|in|sh)$|CMakeLists\.txt$"
                  r"|^scripts/(\w+/)*\w+$|^\.ci/")
TEXT = re.compile(CODE.pattern + r"|\.(md|json|toml|csv|html|css|yaml|yml)$")
MACHINE_PATH = re.compile(r"/(?:home|root|work|tmp|Users)/\w")
CXX = re.compile(r"\.[ch](pp)?$")  # clang-format knows what can be broken
COLUMNS = 100

# Phrases that readers whose second language is English trip over, and what to write instead; in
# the docs and in the strings of the program (help texts, messages).
REPLACEMENTS = {
    r"anew": "again", r"tried (on|against)": "tested with", r"stand-ins?": "simulated ...",
    r"fakes?": "mock ...", r"in trouble": "has a fault", r"lets? go": "releases",
    r"than can be": "out of range (give the range)", r"by chance": "at random",
    r"who(ever|soever)": "the operator, the user", r"bobs": "oscillates vertically",
    r"to and fro": "back and forth", r"foretells?": "predicts", r"knocks?": "force spike",
    r"before an? (exact|noisy|D4xx)": "seen by, in front of", r"is looked for": "is searched for",
    r"places? (is|are) none": "position is not finite", r"looks on": "views only",
    r"good for": "rated for", r"what is (seen|felt|touched)": "the visible surface, the force, ...",
    r"times light": "time-of-flight", r"goes? round": "moves around", r"mend(s|ed)?": "fix",
}
REPLACEMENTS = {phrase.replace(" ", r"\s+"): words for phrase, words in REPLACEMENTS.items()}
BANNED = re.compile("|".join(rf"\b(?:{phrase})\b" for phrase in REPLACEMENTS), re.IGNORECASE)


def files(root, wanted):
    """Paths below root, relative to it and sorted, whose name matches `wanted`."""
    found = []
    for folder, folders, names in os.walk(root):
        folders[:] = [name for name in folders if not IGNORED.match(name)]
        for name in names:
            path = (pathlib.Path(folder) / name).relative_to(root).as_posix()
            if wanted.search(path):
                found.append(path)
    return sorted(found)


def lines(root, path):
    """The file's lines, counted from 1."""
    return enumerate((root / path).read_text(encoding="utf-8").splitlines(), 1)


def room_of(path):
    """The room that a path from the root belongs to, or None."""
    parts = path.split("/")
    if "/".join(parts[:2]) in ("app/lab", "app/bench", "app/robot"):
        return "/".join(parts[:2])
    if len(parts) > 1 and parts[0] in ("search", "lab", "bench", "robot", "app", "python", "site"):
        return parts[0]
    if parts[0] != "palpate" or len(parts) < 3:
        return None
    return parts[2] if parts[1] in GROUPS and len(parts) > 3 else parts[1]


def check_rooms(root):
    """Includes and CMake links that point up or sideways."""
    faults = []
    of_a_room = re.compile(r"^(palpate|site|search|lab|bench|robot|app|python)/.*"
                           r"(\.[ch]pp|CMakeLists\.txt)$")
    for path in files(root, of_a_room):
        room = room_of(path)
        if room is None:
            continue
        if room not in KNOWS:
            faults.append(f"{path}:1: room {room} is not in docs/design.md's order of rooms")
            continue
        for number, line in lines(root, path):
            if path.endswith("CMakeLists.txt"):
                known = re.findall(r"\bpalpate::(\w+)", line.split("#")[0])
            else:
                if room in PURE | {"servo"} and path not in MAY_USE_LIBM and LIBM.search(line):
                    faults.append(f"{path}:{number}: calls the mathematical library; take "
                                  "core/mathematics.hpp, which is the same everywhere")
                include = re.match(r'\s*#\s*include\s*[<"]([^>"]+)[>"]', line)
                if not include:
                    continue
                name = include.group(1)
                other = room_of(name)
                known = [other] if other else []
                pure = CORE_ALLOWS.match(name) and name not in CORE_FORBIDS
                if room in PURE and not other and not pure:
                    faults.append(f"{path}:{number}: {room} includes {name}, but is to stay pure")
            for other in known:
                if other != room and other not in KNOWS[room]:
                    faults.append(f"{path}:{number}: {room} must not know {other}")
    return faults + check_field(root) + check_gate(root) + check_length(root)


def check_length(root):
    """Functions that are too long to be followed."""
    return [f"{path}:{text[:body.start()].count(chr(10)) + 1}: over {LONGEST} lines in a function"
            for path in files(root, SHORT) for text in [(root / path).read_text(encoding="utf-8")]
            for body in BODY.finditer(text) if body.group(1).count("\n") > LONGEST]


def check_gate(root):
    """Writes to a device that do not pass the last gate. The lab's rigs have simulated hands."""
    return [f"{path}:{number}: writes to a device past {GATE}"
            for path in files(root, re.compile(r"^(palpate|app|python|robot|ros)/.*\.[ch]pp$"))
            if path != GATE for number, line in lines(root, path)
            if DEVICE_WRITE.search(line) and not HANDED_ON.match(line)]


def includes(root, path):
    """The project's headers that a file includes, with their lines."""
    for number, line in lines(root, path):
        include = re.match(r'\s*#\s*include\s*[<"]([^>"]+)[>"]', line)
        if include and room_of(include.group(1)):
            yield number, include.group(1)


def check_field(root):
    """What the field set includes, directly or by other headers, of the code that it judges."""
    faults = []
    for path in files(root, FIELD):
        for number, first in includes(root, path):
            reached, waiting = set(), [first]
            while waiting:
                header = waiting.pop()
                if header in reached:
                    continue
                reached.add(header)
                if (root / header).exists():
                    waiting += [other for _, other in includes(root, header)]
            faults += [f"{path}:{number}: the field set must not reach {header}"
                       for header in sorted(reached) if NOT_FIELD.match(header)]
    return faults


def anchors(text):
    """The anchors that a Markdown text's headings get, as GitHub makes them."""
    headings = re.findall(r"^#+\s+(.*?)\s*$", without_code(text), re.M)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def without_code(text):
    """The text with its code blocks emptied; line numbers stay."""
    return re.sub(r"^```.*?^```", lambda code: "\n" * code.group().count("\n"), text,
                  flags=re.M | re.S)


def unsaid_messages(root):
    """Messages in docs/troubleshooting.md that nothing in the sources says."""
    page = root / "docs/troubleshooting.md"
    if not page.exists():
        return []
    sources = [path for folder in ("app", "palpate", "lab", "python", "web/src", "scripts")
               for path in sorted((root / folder).rglob("*")) if path.is_file()]
    said = "\n".join(path.read_text(encoding="utf-8", errors="replace") for path in sources)
    said = re.sub(r"[\"`]\s*\+?\s*[\"`]", "", said)  # literals that go on in the next line
    faults = []
    for number, line in enumerate(page.read_text(encoding="utf-8").split("\n"), 1):
        message = re.match(r"\| `([^`]+)`", line)
        if message and message.group(1) not in said:
            faults.append(f"docs/troubleshooting.md:{number}: nothing says '{message.group(1)}'")
    return faults


def check_text(root):
    """SPDX lines, length of lines, machine paths, links, quoted C++ and messages."""
    faults = []
    for path in files(root, TEXT):
        is_code = CODE.search(path)
        if is_code and not any("SPDX-License-Identifier: Apache-2.0" in line
                               for number, line in lines(root, path) if number <= 3):
            faults.append(f"{path}:1: no SPDX line")
        for number, line in lines(root, path):
            if is_code and not CXX.search(path) and len(line) > COLUMNS:
                faults.append(f"{path}:{number}: {len(line)} columns, more than {COLUMNS}")
            if MACHINE_PATH.search(line):
                faults.append(f"{path}:{number}: a path of somebody's machine")
    for path in files(root, re.compile(r"\.md$")):
        text = (root / path).read_text(encoding="utf-8")
        for link in re.finditer(r"\]\(([^)\s]+)\)", without_code(text)):
            place, _, anchor = link.group(1).partition("#")
            if re.match(r"[a-z]+:", place):
                continue
            number = without_code(text)[:link.start()].count("\n") + 1
            target = (root / path).parent / place if place else root / path
            if not target.exists():
                faults.append(f"{path}:{number}: link to {place}, which is not there")
            elif anchor and anchor not in anchors(target.read_text(encoding="utf-8")):
                faults.append(f"{path}:{number}: {target.name} has no heading #{anchor}")
    faults += unsaid_messages(root) + banned_phrases(root)
    readme, example = root / "README.md", root / "examples/touch_a_plane.cpp"
    if readme.exists():
        quoted = re.findall(r"^```cpp\n(.*?)^```", readme.read_text(encoding="utf-8"), re.M | re.S)
        code = example.read_text(encoding="utf-8").split("\n", 1)[1]  # without the SPDX line
        if quoted != [code]:
            faults.append("README.md:1: its C++ is not examples/touch_a_plane.cpp, to the letter")
    library = root / "docs/library.md"
    if library.exists():
        programs = [path.read_text(encoding="utf-8") for path in (root / "examples").glob("*.cpp")]
        text = library.read_text(encoding="utf-8")
        for block in re.finditer(r"^```cpp\n(.*?)^```", text, re.M | re.S):
            if not any(block.group(1) in program for program in programs):
                number = text[:block.start()].count("\n") + 1
                faults.append(f"docs/library.md:{number}: its C++ is in no example, to the letter")
    return faults


def banned_phrases(root):
    """Phrases of REPLACEMENTS in the docs (without code) and in the program's strings."""
    faults = []
    for path in files(root, re.compile(r"^(docs/.*|[^/]*)\.md$|^app/.*\.cpp$")):
        text = (root / path).read_text(encoding="utf-8")
        said = re.sub(r"`[^`\n]*`", "", without_code(text)) if path.endswith(".md") else \
            "\n".join(" ".join(re.findall(r'"((?:[^"\\]|\\.)*)"', line.split("//")[0]))
                      for line in text.split("\n"))
        for found in BANNED.finditer(said):
            better = next(words for phrase, words in REPLACEMENTS.items()
                          if re.fullmatch(phrase, found.group(), re.IGNORECASE))
            number = said[:found.start()].count("\n") + 1
            faults.append(f"{path}:{number}: '{found.group()}': write '{better}'")
    return faults


def check_format(root):
    """clang-format's opinion."""
    program = shutil.which("clang-format-14")
    if program is None:
        return ["clang-format-14: not found; run scripts/setup lint"]
    found = files(root, CXX)
    done = subprocess.run([program, "--dry-run", "-Werror", *found], cwd=root, check=False,
                          capture_output=True, text=True)
    return re.findall(r"^\S+: error: .*$", done.stderr, re.M) or \
        ([done.stderr] if done.returncode else [])


CHECKS = {"rooms": check_rooms, "text": check_text, "format": check_format}


def chosen(names):
    """All faults that the checks of these names find; exits if there is none of a name."""
    if not names or not set(names) <= set(CHECKS):
        sys.exit(f"check.py: {' '.join(names) or 'nothing'}: give one or more of "
                 + ", ".join(CHECKS))
    return [fault for name in names for fault in CHECKS[name](pathlib.Path.cwd())]


if __name__ == "__main__":
    FAULTS = chosen(sys.argv[1:])
    print("\n".join(FAULTS))
    sys.exit(1 if FAULTS else 0)
