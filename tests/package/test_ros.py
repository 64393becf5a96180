# SPDX-License-Identifier: Apache-2.0
"""The folder ros/: a package of a colcon workspace, a launch file, and views of the node's topics.

colcon and launch are of ROS; here CMake is called as colcon does, and launch's classes are stubs.
"""

import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile
import types
import unittest
import xml.etree.ElementTree as ElementTree

SOURCES = pathlib.Path(os.environ["PALPATE_SOURCES"])
PROGRAM = os.environ["PALPATE_PROGRAM"]
ROS = SOURCES / "ros"


class Stub:
    def __init__(self, *positional, **named):
        self.positional, self.named = positional, named

    def perform(self, context):
        return context[self.positional[0]]


def launched(**arguments):
    """The command that the launch file starts."""
    launch = types.ModuleType("launch")
    launch.actions = types.ModuleType("launch.actions")
    launch.substitutions = types.ModuleType("launch.substitutions")
    launch.LaunchDescription = lambda actions: actions
    for name in ("DeclareLaunchArgument", "ExecuteProcess", "OpaqueFunction"):
        setattr(launch.actions, name, type(name, (Stub,), {}))
    for name in ("FindExecutable", "LaunchConfiguration"):
        setattr(launch.substitutions, name, type(name, (Stub,), {}))
    for module in (launch, launch.actions, launch.substitutions):
        sys.modules[module.__name__] = module
    space = {}
    exec((ROS / "launch/palpate.launch.py").read_text(), space)
    actions = space["generate_launch_description"]()
    context = {action.positional[0]: action.named["default_value"] for action in actions[:-1]}
    context.update(arguments)
    (process,) = actions[-1].named["function"](context)
    return process.named["cmd"]


class Ros(unittest.TestCase):
    def test_the_package_is_the_projects_and_needs_nothing_of_ros(self):
        package = ElementTree.parse(ROS / "package.xml").getroot()
        version = re.search(r"project\(palpate VERSION (\S+)",
                            (SOURCES / "CMakeLists.txt").read_text())[1]
        self.assertEqual(package.findtext("version"), version)
        self.assertEqual(package.findtext("export/build_type"), "cmake")
        needed = [each.text for each in package if each.tag.endswith("depend")]
        self.assertEqual(needed, ["cmake"])

    def test_a_link_to_it_configures_as_colcon_does(self):
        with tempfile.TemporaryDirectory(prefix="palpate-ros-") as folder:
            workspace = pathlib.Path(folder)
            (workspace / "src").mkdir()
            (workspace / "src/palpate").symlink_to(ROS)
            subprocess.run(["cmake", workspace / "src/palpate",
                            f"-DCMAKE_INSTALL_PREFIX={workspace / 'install'}"],
                           cwd=workspace, check=True, capture_output=True)
            rules = (workspace / "cmake_install.cmake").read_text()
            for place in ("lib/palpate", "share/palpate",
                          "share/ament_index/resource_index/packages"):
                self.assertIn(place, rules)

    def test_what_is_launched_the_program_understands(self):
        command = launched(camera="synthetic:plane", options="--set stiffness=300 --duration 1")
        self.assertEqual(command[0].named, {"name": "palpate"})
        self.assertEqual(command[1:4], ["ros", "--camera", "synthetic:plane"])
        config = subprocess.run([PROGRAM, *command[1:], "--print-config"], check=True,
                                capture_output=True, text=True).stdout
        self.assertRegex(config, r"stiffness = 300\b")

    def test_views_show_topics_that_there_are(self):
        known = set(re.findall(r"`~/(\w+)`", (SOURCES / "docs/ros.md").read_text()))
        for view in ("rviz/palpate.rviz", "foxglove/palpate.json"):
            text = (ROS / view).read_text()
            shown = set(re.findall(r"/palpate/(\w+)", text))
            self.assertIn("markers", shown, view)
            self.assertLessEqual(shown, known, view)
        json.loads((ROS / "foxglove/palpate.json").read_text())


if __name__ == "__main__":
    unittest.main()
