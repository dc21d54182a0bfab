# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""For ROS 2: `ros2 launch srfs suite.launch.py` flies a deployment until Ctrl-C, with its health on /diagnostics.

`srfs up` starts the nodes and the liveness ring restarts them, as without ROS 2: this file does not respawn any.
"""

import subprocess
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, EmitEvent, ExecuteProcess, OpaqueFunction, RegisterEventHandler
from launch.event_handlers import OnProcessExit, OnShutdown
from launch.events import Shutdown
from launch.substitutions import LaunchConfiguration

HERE = Path(__file__).resolve()
# Installed as PREFIX/share/srfs/launch_config/suite.launch.py; in the tree beside the build folder.
PLACES = (HERE.parents[3] / "bin", HERE.parents[1] / "build-release" / "bin")


def program(name):
    return str(next((place / name for place in PLACES if (place / name).exists()), name))


def deployment_file(named):
    """"sim" is the file beside this one."""
    beside = HERE.parent / f"{named}.yaml"
    return str(beside) if beside.exists() else named


def actions_of(context):
    chosen = {name: LaunchConfiguration(name).perform(context) for name in ("deployment", "var", "simulate")}
    options = ["--deployment", deployment_file(chosen["deployment"]), "--var", chosen["var"]]
    up = ExecuteProcess(cmd=[program("srfs"), "up", *options], output="screen")
    diagnostics = ExecuteProcess(cmd=[program("srfs"), "diagnostics", *options], output="screen")

    def after_up(event, _):
        return [diagnostics] if event.returncode == 0 else [EmitEvent(event=Shutdown(reason="srfs up failed"))]

    def down(*_):
        subprocess.run([program("srfs"), "down", *options], stdin=subprocess.DEVNULL, check=False)

    actions = [RegisterEventHandler(OnProcessExit(target_action=up, on_exit=after_up)), RegisterEventHandler(OnShutdown(on_shutdown=down)), up]
    if chosen["simulate"] == "true":
        actions.insert(0, ExecuteProcess(cmd=[program("hw_sim"), *options], output="screen"))
    return actions


def generate_launch_description():
    return LaunchDescription([
        DeclareLaunchArgument("deployment", default_value="sim", description="Name or file of the deployment"),
        DeclareLaunchArgument("var", default_value="var", description="Folder of the running deployment"),
        DeclareLaunchArgument("simulate", default_value="true", choices=["true", "false"], description="Start hw_sim, too"),
        OpaqueFunction(function=actions_of),
    ])  # fmt: skip
