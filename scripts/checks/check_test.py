# SPDX-License-Identifier: Apache-2.0
"""Each check must find the faults that it is there for, in a made-up tree, and nothing else."""

import os
import pathlib
import sys
import tempfile
import unittest

import check

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent))
import leaderboard  # noqa: E402

SPDX = "// SPDX-License-Identifier: Apache-2.0\n"


class Tree(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.root = pathlib.Path(folder.name)

    def write(self, path, text):
        (self.root / path).parent.mkdir(parents=True, exist_ok=True)
        (self.root / path).write_text(text, encoding="utf-8")

    def include(self, path, header):
        self.write(path, f"{SPDX}#include {header}\n")


class Rooms(Tree):
    def test_an_arrow_down_is_fine(self):
        self.include("palpate/kernel/cloud/a.hpp", '"palpate/kernel/core/patch.hpp"')
        self.include("palpate/io/sources/a.cpp", "<palpate/kernel/core/patch.hpp>")
        self.include("palpate/io/sources/b.cpp", '"palpate/io/sources/b.hpp"')
        self.include("app/main.cpp", '"palpate/net/viewer/server.hpp"')
        self.write("palpate/kernel/cloud/CMakeLists.txt",
                   "palpate_room(cloud LINKS palpate::core)\n")
        self.assertEqual(check.check_rooms(self.root), [])

    def test_an_arrow_up_is_found(self):
        self.include("palpate/kernel/core/a.cpp", '"palpate/kernel/cloud/depth_image.hpp"')
        self.assertEqual(check.check_rooms(self.root),
                         ["palpate/kernel/core/a.cpp:2: core must not know cloud"])

    def test_an_arrow_sideways_is_found(self):
        self.include("palpate/servo/a.hpp", "<palpate/kernel/cloud/frame.hpp>")
        self.assertEqual(check.check_rooms(self.root),
                         ["palpate/servo/a.hpp:2: servo must not know cloud"])

    def test_the_library_does_not_know_the_program(self):
        self.include("palpate/io/sources/a.cpp", '"app/options.hpp"')
        self.include("palpate/kernel/cloud/a.cpp", '"lab/metrics.hpp"')
        self.assertEqual(check.check_rooms(self.root),
                         ["palpate/io/sources/a.cpp:2: sources must not know app",
                          "palpate/kernel/cloud/a.cpp:2: cloud must not know lab"])

    def test_a_link_up_is_found(self):
        self.write("palpate/kernel/core/CMakeLists.txt",
                   "palpate_room(core LINKS palpate::sources)\n")
        self.assertEqual(check.check_rooms(self.root),
                         ["palpate/kernel/core/CMakeLists.txt:1: core must not know sources"])

    def test_core_is_pure(self):
        self.include("palpate/kernel/core/a.cpp", "<Eigen/Core>")
        self.include("palpate/kernel/core/b.cpp", "<cmath>")
        self.include("palpate/kernel/core/c.cpp", "<thread>")
        self.include("palpate/kernel/core/d.cpp", "<nlohmann/json.hpp>")
        self.assertEqual([fault.split(",")[0] for fault in check.check_rooms(self.root)],
                         ["palpate/kernel/core/c.cpp:2: core includes thread",
                          "palpate/kernel/core/d.cpp:2: core includes nlohmann/json.hpp"])

    def test_forces_are_the_same_on_every_machine(self):
        self.write("palpate/kernel/sight/a.cpp", SPDX + "double a = std::exp(1.0);\n")
        self.write("palpate/kernel/sight/b.cpp", SPDX + "double a = std::sqrt(math::exp(1.0));\n")
        self.write("palpate/io/sources/c.cpp", SPDX + "double a = std::exp(1.0);\n")
        self.assertEqual([fault.split(";")[0] for fault in check.check_rooms(self.root)],
                         ["palpate/kernel/sight/a.cpp:2: calls the mathematical library"])

    def test_the_field_set_stays_apart_from_what_it_judges(self):
        self.include("lab/field/a.cpp", '"palpate/kernel/cloud/frame.hpp"')
        self.include("lab/field/b.cpp", '"palpate/io/sources/shapes.hpp"')
        self.include("lab/field/c.cpp", '"lab/method.hpp"')
        self.include("lab/method.hpp", '"palpate/io/sources/scene.hpp"')
        self.include("lab/experiments/field.cpp", '"lab/experiments/pop_cases.hpp"')
        self.include("lab/experiments/pop.cpp", '"palpate/io/sources/scene.hpp"')
        self.assertEqual(check.check_rooms(self.root),
                         ["lab/experiments/field.cpp:2: the field set must not reach"
                          " lab/experiments/pop_cases.hpp",
                          "lab/field/b.cpp:2: the field set must not reach"
                          " palpate/io/sources/shapes.hpp",
                          "lab/field/c.cpp:2: the field set must not reach"
                          " palpate/io/sources/scene.hpp"])

    def test_only_the_gate_writes_to_a_device(self):
        self.write("palpate/servo/last_gate.hpp", SPDX + "device.write(sent, t);\n")
        self.write("palpate/servo/wrapper.hpp", SPDX + "  void write(const Vec3& force, double t) "
                   "noexcept override { device_->write(force, t); }\n")
        self.write("palpate/servo/a.cpp", SPDX + "device_.write(force, t);\n")
        self.write("app/b.cpp", SPDX + "hand->device().write(Vec3::Zero(), t);\n"
                   "file.write(text);\n")
        self.assertEqual(check.check_rooms(self.root),
                         ["app/b.cpp:2: writes to a device past palpate/servo/last_gate.hpp",
                          "palpate/servo/a.cpp:2: writes to a device past "
                          "palpate/servo/last_gate.hpp"])

    def test_a_long_function_is_found(self):
        for lines in (60, 61):
            body = "  ++i;\n" * lines
            self.write(f"palpate/kernel/sight/a{lines}.cpp",
                       f"{SPDX}namespace palpate {{\nvoid f(int i) {{\n{body}}}\n}}\n")
        self.assertEqual(check.check_rooms(self.root),
                         ["palpate/kernel/sight/a61.cpp:3: over 60 lines in a function"])

    def test_a_room_nobody_planned_is_found(self):
        self.include("palpate/kitchen/a.cpp", "<cmath>")
        self.assertEqual(len(check.check_rooms(self.root)), 1)


class Text(Tree):
    def faults(self):
        return check.check_text(self.root)

    def test_a_banned_phrase_is_found_in_docs_and_strings_and_not_in_code(self):
        self.write("docs/a.md", "It lets\ngo.\n\n```\nbegin anew\n```\n`anew` is code.\n")
        self.write("app/a.cpp", SPDX + 'say("it begins "\n    "anew");  // "anew" is a comment\n')
        self.assertEqual(check.banned_phrases(self.root),
                         ["app/a.cpp:3: 'anew': write 'again'",
                          "docs/a.md:1: 'lets\ngo': write 'releases'"])

    def test_a_clean_tree_is_fine(self):
        self.write("palpate/kernel/core/a.cpp", SPDX + "x" * check.COLUMNS + "\n")
        self.write("docs/a.md", "# Some `title` here\n[b](b.md#part-2-more) [c](#some-title-here)"
                                " [d](https://example.org)\n```\n[no](link.md)\n```\n")
        self.write("docs/b.md", "## Part 2: more\n")
        self.assertEqual(self.faults(), [])

    def test_a_file_without_spdx_is_found(self):
        self.write("scripts/run", "#!/bin/sh\n")
        self.assertEqual(self.faults(), ["scripts/run:1: no SPDX line"])

    def test_a_long_line_is_found(self):
        self.write("a.py", SPDX + "x" * (check.COLUMNS + 1))
        self.assertEqual(self.faults(), ["a.py:2: 101 columns, more than 100"])

    def test_a_machine_path_is_found(self):
        self.write("docs/a.md", "see /" + "home/me/data\n")
        self.assertEqual(self.faults(), ["docs/a.md:1: a path of somebody's machine"])

    def test_dead_links_are_found(self):
        self.write("docs/a.md", "# A\n[b](b.md) [a](a.md#c)\n")
        self.assertEqual(self.faults(), ["docs/a.md:2: link to b.md, which is not there",
                                         "docs/a.md:2: a.md has no heading #c"])

    def test_a_readme_that_left_its_example_behind_is_found(self):
        self.write("examples/touch_a_plane.cpp", SPDX + "int main() {}\n")
        self.write("README.md", "```cpp\nint main() {}\n```\n")
        self.assertEqual(self.faults(), [])
        self.write("README.md", "```cpp\nint main() { return 1; }\n```\n")
        self.assertEqual(len(self.faults()), 1)

    def test_a_message_that_nothing_says_is_found(self):
        self.write("palpate/a.cpp", SPDX + 'f("the loop "\n  "is late");\n')
        self.write("docs/troubleshooting.md", "| `the loop is late` | | |\n| a word | | |\n")
        self.assertEqual(check.check_text(self.root), [])
        self.write("docs/troubleshooting.md", "| `the loop is early` | | |\n")
        self.assertIn("troubleshooting.md:1", check.check_text(self.root)[0])

    def test_a_quotation_that_left_its_example_behind_is_found(self):
        self.write("examples/session.cpp", SPDX + "int main() {\n  run();\n}\n")
        self.write("docs/library.md", "```cpp\n  run();\n```\n")
        self.assertEqual(self.faults(), [])
        self.write("docs/library.md", "```cpp\n  run(1);\n```\n")
        self.assertEqual(len(self.faults()), 1)


class Format(Tree):
    def test_bad_format_is_found(self):
        self.write(".clang-format", "BasedOnStyle: Google\n")
        self.write("a.cpp", "int main() {}\n")
        self.assertEqual(check.check_format(self.root), [])
        self.write("a.cpp", "int main( ){ }\n")
        self.assertNotEqual(check.check_format(self.root), [])


class Chosen(Tree):
    def test_several_checks_are_all_made(self):
        self.addCleanup(os.chdir, pathlib.Path.cwd())
        os.chdir(self.root)
        self.write("palpate/nowhere/a.cpp", SPDX)
        self.write("a.py", "# " + 100 * "x" + "\n")
        rooms, text = check.chosen(["rooms"]), check.chosen(["text"])
        self.assertTrue(rooms and text)
        self.assertEqual(check.chosen(["rooms", "text"]), rooms + text)

    def test_a_check_that_there_is_not_is_refused(self):
        for names in [], ["rooms", "txet"]:
            with self.assertRaises(SystemExit):
                check.chosen(names)


class Leaderboard(Tree):
    def entry(self, method, value, low, high, recordings=()):
        score = {"value": value, "low": low, "high": high}
        return {"method": method, "cases": 5, "cases_sha256": "0123456789abcdef",
                "recordings": [{"name": name} for name in recordings],
                "run": {"cpu_seconds": 6.0, "processor": "a processor"},
                "scores": {"score": score, "held": score, "fidelity": {"aims met": score},
                           "real": {"right": score} if recordings else "not played"}}

    def test_intervals_that_overlap_share_a_rank(self):
        self.assertEqual(leaderboard.ranks([(90, 95), (80, 91), (70, 85), (10, 20)]),
                         [(1, 2), (1, 3), (2, 3), (4, 4)])
        self.assertEqual(leaderboard.ranks([(5, 5), (5, 5)]), [(1, 2), (1, 2)])

    def test_a_page_ranks_like_with_like_and_not_the_ruler(self):
        text = leaderboard.page([self.entry("a", 50, 40, 60), self.entry("b", 70, 65, 75),
                                 self.entry("ideal", 100, 90, 100),
                                 self.entry("c", 90, 85, 95, ["depth:table"])])
        rows = [line.split(" | ")[:2] for line in text.splitlines() if "`" in line and "|" in line]
        self.assertEqual(rows, [["| 1", "`c`"], ["| reference", "`ideal`"], ["| 1", "`b`"],
                                ["| 2", "`a`"]])


if __name__ == "__main__":
    unittest.main()
