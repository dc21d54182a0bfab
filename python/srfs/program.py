# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the programs of this package share: how they fail, their options, and where their summaries go."""

import argparse
import json
import pathlib
import sys

from srfs import ROOT


class MissionError(Exception):
    """The simulation cannot start or did not end cleanly. The text is ready to print; code is the exit code."""

    def __init__(self, message, code=1):
        super().__init__(message)
        self.code = code


class Interrupted(MissionError):
    """The user asked for the end."""

    def __init__(self):
        super().__init__("interrupted", code=130)


class MissingProgram(MissionError):
    """A program of Debian that is not installed."""

    def __init__(self, name, package=None):
        super().__init__(f"{name} is missing: apt-get install {package or name}", code=2)


def run_program(name, main):
    """Ends this process with what main() returns; a MissionError is one readable line and its own exit code."""
    try:
        sys.exit(main())
    except MissionError as error:
        print(f"{name}: {error}", file=sys.stderr)
        sys.exit(error.code)


def add_bin(parser):
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build-release" / "bin", metavar="DIR", help=argparse.SUPPRESS)


def add_flight_options(parser, more=""):
    """--var, --deployment and --bin of a program that flies `sim` in the tree's own folder."""
    parser.add_argument("--var", type=pathlib.Path, default=ROOT / "var", metavar="DIR", help=f"folder of the running deployment (default: %(default)s){more}")
    parser.add_argument("--deployment", default="sim", metavar="NAME", help="launch_config/NAME.yaml, or a file (default: %(default)s)")
    add_bin(parser)


def add_run_options(parser, kind, deployment):
    """Those of a program whose runs have names and a folder each, var/KIND/NAME."""
    parser.add_argument("--out", type=pathlib.Path, metavar="DIR", help=f"folder of the files (default: var/{kind}/NAME)")
    parser.add_argument("--var", type=pathlib.Path, metavar="DIR", help="folder of the running deployment (default: DIR of --out + /var)")
    parser.add_argument("--deployment", metavar="NAME", help=f"launch_config/NAME.yaml, or a file (default: {deployment})")
    parser.add_argument("--json", action="store_true", help="print summary.json instead of a table")
    add_bin(parser)


def made_folder(options, kind):
    """The folder of a run's files, made."""
    out = (options.out or ROOT / "var" / kind / options.name).absolute()
    out.mkdir(parents=True, exist_ok=True)
    return out


def teller(name):
    """say(text): progress on standard error."""
    return lambda text: print(f"[{name}] {text}", file=sys.stderr, flush=True)


def finish(options, out, summary, draw, show, say):
    """Writes summary.json, draws, and prints the summary: as JSON, or by show(). @return exit code"""
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    try:
        draw()
    except ImportError:
        say("python3-matplotlib is missing: no drawing")
    if options.json:
        print(json.dumps(summary))
    else:
        show()
    return 0 if summary["ok"] else 1
