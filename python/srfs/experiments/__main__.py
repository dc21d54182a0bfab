# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run experiment: the paper's experiments with the real processes; drawings, CSV and summary.json; exit code 0 if they show what it says."""

import argparse
import contextlib
import json
import pathlib
import shutil
import sys

from srfs import ROOT
from srfs.experiments import fig12, fig13, fig14, fig15, fig16
from srfs.flight import mission

FIGURES = {name: module for module in (fig12, fig13, fig14, fig15, fig16) for name in module.TITLES}


def parse():
    parser = argparse.ArgumentParser(prog="./run experiment", description="Run one of the paper's experiments with the real processes. "
                                     "Exit code 0 only if the recorded shape is the one the paper describes.")  # fmt: skip
    parser.add_argument("name", choices=FIGURES, help="; ".join(f"{name}: {module.TITLES[name]}" for name, module in FIGURES.items()))
    parser.add_argument("--out", type=pathlib.Path, metavar="DIR", help="folder of the files (default: var/experiments/NAME)")
    parser.add_argument("--var", type=pathlib.Path, metavar="DIR", help="folder of the running deployment (default: DIR of --out + /var)")
    parser.add_argument("--deployment", metavar="NAME", help="launch_config/NAME.yaml, or a file (default: that of the figure)")
    parser.add_argument("--phase", type=float, metavar="S", help="fig12, fig13: length of each phase (default: 60)")
    parser.add_argument("--step-deadline", type=float, default=60, metavar="S", help="fig15: longest wait for each step (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print summary.json instead of lines")
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build-release" / "bin", help=argparse.SUPPRESS)
    return parser.parse_args()


@contextlib.contextmanager
def flight_of(figure, options, out, say):
    """The flight that the experiment is made with; None for one that needs none."""
    if figure.DEPLOYMENT is None:
        yield None
        return
    deployment = options.deployment or figure.DEPLOYMENT
    if hasattr(figure, "varied"):
        deployment = figure.varied(deployment, out)
    if options.var is None:
        shutil.rmtree(out / "var", ignore_errors=True)  # what an earlier run left: versions, stores
    programs = mission.installed(options.bin) if getattr(figure, "INSTALLED", False) else options.bin
    with mission.Mission(options.var or out / "var", deployment, programs, say, figure.ONLY) as flight:
        yield flight


def main():
    options = parse()
    signals = mission.StopSignals()  # a Ctrl-C ends it in order
    out = (options.out or ROOT / "var" / "experiments" / options.name).absolute()
    out.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(f"[{options.name}] {text}", file=sys.stderr, flush=True)

    figure = FIGURES[options.name]
    with flight_of(figure, options, out, say) as flight:
        experiment = figure.Experiment(options.name, flight, signals, say)
        experiment.step_deadline_s = options.step_deadline
        if options.phase:
            experiment.phase_s = options.phase
        experiment.run()
    summary = experiment.judge()
    experiment.write_csv(out / f"{options.name}.csv")
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    try:
        experiment.draw(out)
    except ImportError:
        say("python3-matplotlib is missing: no drawing")
    if options.json:
        print(json.dumps(summary))
    else:
        for result in summary["checks"]:
            print(f"  {'ok    ' if result['ok'] else 'NOT OK'}  {result['what']}")
        print(experiment.text(summary))
        print(f"  files in {out}")
    return 0 if summary["ok"] else 1


if __name__ == "__main__":
    mission.run_program("experiment", main)
