# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run sim: the simulated spacecraft and the suite, up until Ctrl-C or SIGTERM."""

import argparse
import sys

from srfs import ROOT
from srfs.flight import mission


def parse():
    parser = argparse.ArgumentParser(prog="./run sim", description="Flies the simulated spacecraft until Ctrl-C or SIGTERM.")
    parser.add_argument("--var", default=ROOT / "var", metavar="DIR", help="folder of the running deployment (default: %(default)s); "
                        "two simulations run side by side with different folders")  # fmt: skip
    parser.add_argument("--deployment", default="sim", metavar="NAME", help="launch_config/NAME.yaml, or a file (default: %(default)s)")
    parser.add_argument("--bin", default=ROOT / "build-release" / "bin", metavar="DIR", help=argparse.SUPPRESS)
    return parser.parse_args()


def say(text):
    print(text, flush=True)


def greeting(flight):
    var, bin_dir, nodes = flight.var, flight.bin_dir, flight.up_report["nodes"]
    option = "" if flight.deployment.stem == "sim" else f" --deployment {flight.deployment}"
    coming = f"; still starting, not needed for flight: {', '.join(flight.coming)}" if flight.coming else ""
    return f"""{len(nodes) - len(flight.coming)} nodes up in {flight.up_report['took_ms']} ms, DDS domain {flight.domain}{coming}
  operator's port  {var}/rs422
  logs             {var}/log/
Try, in another terminal:
  {bin_dir}/srfs-ground --port {var}/rs422{option} ping
  {bin_dir}/srfs-ground --port {var}/rs422{option} tc eps.switch_load load=2 state=on --wait
  {bin_dir}/srfs-ground --port {var}/rs422{option} listen
  {bin_dir}/srfs --var {var} --deployment {flight.deployment} status
  {bin_dir}/srfs --var {var} --deployment {flight.deployment} record
  ROS_DOMAIN_ID={flight.domain} ROS_LOCALHOST_ONLY=1 ros2 topic echo /timing/tick
Ctrl-C ends it."""


def fly(flight, signals):
    """Watches until the end is asked for. Returns whether the simulation was still whole then."""
    while not signals.wait(0.5):
        news, gone = flight.news_of_processes()
        for line in news:
            say(line if "has come" in line else f"! {line}")
        if gone:
            return False
    return True


def main():
    arguments = parse()
    signals = mission.StopSignals()
    flight = mission.Mission(arguments.var, arguments.deployment, arguments.bin, say, wait_for_all=False)
    flight.start()
    say(greeting(flight))
    whole = fly(flight, signals)
    say("stopping")
    left = flight.stop()
    for line in left:
        print(f"left behind: {line}", file=sys.stderr)
    if not left:
        say("stopped; nothing is left running")
    return 0 if whole and not left else 1


if __name__ == "__main__":
    mission.run_program("sim", main)
