# SPDX-License-Identifier: Apache-2.0
"""Starts the node: `ros2 launch palpate palpate.launch.py camera:=ros2:/camera/depth/image_raw`.

Whatever else `palpate ros --help` lists goes into `options`: options:='--set stiffness=300'.
"""

import shlex

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess, OpaqueFunction
from launch.substitutions import FindExecutable, LaunchConfiguration

ARGUMENTS = {
    "camera": ("ros2:/camera/camera/depth/image_rect_raw", "what is touched, as --camera has it"),
    "device": ("hand:", "what touches it, as --device has it; hand: is a simulated hand"),
    "name": ("palpate", "of the node, with its namespace if it has one: cell_3/palpate"),
    "frame": ("world", "frame_id of what it publishes"),
    "options": ("", "further options of palpate ros"),
}


def start(context):
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    command = [FindExecutable(name="palpate"), "ros"]
    for name in ("camera", "device", "name", "frame"):
        command += [f"--{name}", value[name]]
    command += shlex.split(value["options"])
    # SIGINT and SIGTERM take the force off before anything else; five seconds for a recording.
    return [ExecuteProcess(cmd=command, output="screen", sigterm_timeout="5", sigkill_timeout="10")]


def generate_launch_description():
    declared = [DeclareLaunchArgument(name, default_value=default, description=meaning)
                for name, (default, meaning) in ARGUMENTS.items()]
    return LaunchDescription(declared + [OpaqueFunction(function=start)])
