# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""launch_config/suite.launch.py, run with a stand-in for ROS 2's package launch, which Debian does not have."""

import importlib.util
import subprocess
import sys
import types
import unittest
from unittest import mock

from srfs import ROOT

FILE = ROOT / "launch_config/suite.launch.py"
NAMES = {
    "launch": ("LaunchDescription",),
    "launch.actions": ("DeclareLaunchArgument", "EmitEvent", "ExecuteProcess", "OpaqueFunction", "RegisterEventHandler"),
    "launch.event_handlers": ("OnProcessExit", "OnShutdown"),
    "launch.events": ("Shutdown",),
    "launch.substitutions": ("LaunchConfiguration",),
}


class Noted:
    """Remembers what it was made with."""

    def __init__(self, *values, **named):
        self.values, self.__dict__ = values, {**named, "values": values}

    def perform(self, context):
        return context[self.values[0]]


def stand_ins():
    modules = {}
    for module, names in NAMES.items():
        modules[module] = types.ModuleType(module)
        for name in names:
            setattr(modules[module], name, type(name, (Noted,), {}))
    return modules


class LaunchFile(unittest.TestCase):
    def setUp(self):
        self.enterContext(mock.patch.dict(sys.modules, stand_ins()))
        spec = importlib.util.spec_from_file_location("suite_launch", FILE)
        self.module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(self.module)

    def actions(self, **chosen):
        (description,) = self.module.generate_launch_description().values
        arguments = {a.values[0]: a.default_value for a in description if type(a).__name__ == "DeclareLaunchArgument"}
        (made,) = (a for a in description if type(a).__name__ == "OpaqueFunction")
        return made.function({**arguments, **chosen})

    @staticmethod
    def commands(actions):
        return [[word.rsplit("/", 1)[-1] for word in a.cmd] for a in actions if type(a).__name__ == "ExecuteProcess"]

    @staticmethod
    def handler(actions, kind):
        (found,) = (a.values[0] for a in actions if type(a).__name__ == "RegisterEventHandler" and type(a.values[0]).__name__ == kind)
        return found

    def test_the_simulation_and_the_suite_are_started_then_its_health_is_published(self):
        actions = self.actions()
        options = ["--deployment", "sim.yaml", "--var", "var"]
        self.assertEqual(self.commands(actions), [["hw_sim", *options], ["srfs", "up", *options]])
        after = self.handler(actions, "OnProcessExit").on_exit
        self.assertEqual(self.commands(after(types.SimpleNamespace(returncode=0), None)), [["srfs", "diagnostics", *options]])
        (ended,) = after(types.SimpleNamespace(returncode=3), None)
        self.assertEqual(type(ended).__name__, "EmitEvent")

    def test_a_deployment_of_ones_own_on_real_devices(self):
        actions = self.actions(deployment="/mine/flat_sat.yaml", simulate="false")
        self.assertEqual(self.commands(actions), [["srfs", "up", "--deployment", "flat_sat.yaml", "--var", "var"]])

    def test_the_suite_ends_with_the_launch(self):
        with mock.patch.object(subprocess, "run") as run:
            self.handler(self.actions(), "OnShutdown").on_shutdown(None, None)
        (command,) = run.call_args.args
        self.assertEqual([word.rsplit("/", 1)[-1] for word in command[:2]], ["srfs", "down"])


if __name__ == "__main__":
    unittest.main()
