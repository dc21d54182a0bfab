# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The tutorials, word for word: each command and each edit of docs/tutorial, in order, in a copy of the tree with the build that is there.

CONTRIBUTING.md, "Tutorials", has the convention; python/srfs/tutorial.py reads and runs it.
"""

import os
import shutil
import signal
import subprocess
import time

from support import BIN, PROGRAM, ROOT, SystemTest, end_flight, hurried_lane

from srfs import tutorial
from srfs.flight.processes import processes_of
from srfs.tutorial import Commands, TutorialError

# In the order in which they are read; all in one clone, and in one flight.
PAGES = ("first_flight", "ground_script", "node_outside_the_tree", "new_telecommand", "new_imaging_method", "first_payload", "replace_a_protocol", "from_simulation_to_bench")
IN_OPENCV = ("imaging_method_in_opencv",)  # by itself: compilers of OpenCV take long
STEP_PATIENCE_S = 300  # compilers on a machine that others use


class Simulation:
    """`./run sim` of a page without its build, beside the shell, as in another terminal."""

    def __init__(self, tree):
        self.log = tree / "sim.log"
        command = [*PROGRAM, "srfs.sim", "--bin", str(tree / "build-release/bin")]
        environment = {**os.environ, "PYTHONPATH": str(tree / "python")}
        with open(self.log, "w") as log:
            self._process = subprocess.Popen(command, cwd=tree, env=environment, stdin=subprocess.DEVNULL, stdout=log, stderr=subprocess.STDOUT,
                                             start_new_session=True)  # fmt: skip

    def wait_for(self, page, step):
        end = time.monotonic() + STEP_PATIENCE_S
        while missing := tutorial.missing_output(step.expected or [(step.line, "nodes up")], self.log.read_text()):
            if self._process.poll() is not None or time.monotonic() > end:
                raise TutorialError(f"{page}:{missing[0]}: ./run sim does not say '{missing[1]}':\n{self.log.read_text()[-2000:]}")
            time.sleep(0.05)

    def end(self):
        """Ctrl-C. Returns its exit code and its last line."""
        os.killpg(self._process.pid, signal.SIGINT)
        code = self._process.wait(120)
        return code, self.log.read_text().splitlines()[-1]


class PagesTest(SystemTest):
    """In one clone and one flight."""

    def setUp(self):
        super().setUp()
        self.tree, self.home = self.folder, self.folder / "home"
        shutil.copytree(ROOT, self.tree, symlinks=True, dirs_exist_ok=True, ignore=shutil.ignore_patterns("build-*", ".git", "var", "__pycache__"))
        (self.tree / "build-release").symlink_to(BIN.parent)
        self.home.mkdir()
        self.simulation = None
        self.addCleanup(lambda: end_flight(self.home / "my_mission/var"))

    def page(self, shell, name):
        page = f"docs/tutorial/{name}.md"
        text = (ROOT / page).read_text()
        if tutorial.NEEDS_SIMULATION.search(text) and self.simulation is None:
            self.fly(page, Commands(1, "./run sim\n"))
        for step in tutorial.steps_of(page, text):
            if not isinstance(step, Commands):
                tutorial.apply_edit(page, step, self.tree, self.home)
            elif step.stays:
                self.assertEqual(step.text, "./run sim\n", f"{page}:{step.line}: only the simulation is left running")
                self.fly(page, step)
            else:
                shell.do(page, step, STEP_PATIENCE_S)

    def fly(self, page, step):
        self.simulation = Simulation(self.tree)
        self.addCleanup(lambda: self.simulation and self.simulation.end())
        self.simulation.wait_for(page, step)

    def run_pages(self, names):
        # Not optimised: half the time to compile.
        shell = tutorial.Shell(self.tree, {**os.environ, "HOME": str(self.home), "CMAKE_BUILD_TYPE": "None"})
        self.addCleanup(shell.end)
        with hurried_lane(self.var):
            for name in names:
                begin = time.monotonic()
                self.page(shell, name)
                print(f"{name}: {time.monotonic() - begin:.1f} s")
        simulation, self.simulation = self.simulation, None
        self.assertIsNotNone(simulation, "no page flies the simulated spacecraft")
        self.assertEqual(simulation.end(), (0, "stopped; nothing is left running"))
        self.assertEqual(processes_of(self.var), {})


class TutorialsTest(PagesTest):
    def test_every_command_and_edit_does_what_the_page_says(self):
        self.run_pages(PAGES)

    def test_every_page_is_run(self):
        self.assertEqual({page.stem for page in (ROOT / "docs/tutorial").glob("*.md")}, {*PAGES, *IN_OPENCV})


class OpenCvTutorialTest(PagesTest):
    def test_every_command_and_edit_does_what_the_page_says(self):
        self.run_pages(IN_OPENCV)
