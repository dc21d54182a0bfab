# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run experiment: the paper's experiments with the real processes; drawings, CSV and summary.json; exit code 0 if they show what it says."""

import argparse
import contextlib
import shutil

from srfs import program
from srfs.experiments.fig12 import Fig12
from srfs.experiments.fig13 import Fig13
from srfs.experiments.fig14 import Fig14
from srfs.experiments.fig15 import Fig15
from srfs.experiments.fig16 import Fig16
from srfs.flight import deployments, mission
from srfs.flight.processes import StopSignals
from srfs.report import show_checks

FIGURES = {name: figure for figure in (Fig12, Fig13, Fig14, Fig15, Fig16) for name in figure.TITLES}


def parse():
    parser = argparse.ArgumentParser(prog="./run experiment", description="Run one of the paper's experiments with the real processes. "
                                     "Exit code 0 only if the recorded shape is the one the paper describes.")  # fmt: skip
    parser.add_argument("name", choices=FIGURES, help="; ".join(f"{name}: {figure.TITLES[name]}" for name, figure in FIGURES.items()))
    parser.add_argument("--phase", type=float, metavar="S", help="fig12, fig13: length of each phase (default: 60)")
    parser.add_argument("--step-deadline", type=float, default=60, metavar="S", help="fig15: longest wait for each step (default: %(default)s)")
    program.add_run_options(parser, "experiments", "that of the figure")
    return parser.parse_args()


@contextlib.contextmanager
def flight_of(figure, options, out, say):
    """The flight that the experiment is made with; None for one that needs none."""
    if figure.DEPLOYMENT is None:
        yield None
        return
    deployment = figure.varied(deployments.find(options.deployment or figure.DEPLOYMENT), out)
    if options.var is None:
        shutil.rmtree(out / "var", ignore_errors=True)  # what an earlier run left: versions, stores
    programs = mission.installed(options.bin) if figure.INSTALLED else options.bin
    with mission.Mission(options.var or out / "var", deployment, programs, say, figure.ONLY) as flight:
        yield flight


def main():
    options = parse()
    signals = StopSignals()  # a Ctrl-C ends it in order
    out, say = program.made_folder(options, "experiments"), program.teller(options.name)
    figure = FIGURES[options.name]
    with flight_of(figure, options, out, say) as flight:
        experiment = figure(options.name, flight, signals, say)
        experiment.step_deadline_s = options.step_deadline
        if options.phase:
            experiment.phase_s = options.phase
        experiment.run()
    summary = experiment.judge()
    experiment.write_csv(out / f"{options.name}.csv")

    def show():
        show_checks(summary["checks"])
        print(experiment.text(summary))
        print(f"  files in {out}")

    return program.finish(options, out, summary, lambda: experiment.draw(out), show, say)


if __name__ == "__main__":
    program.run_program("experiment", main)
