# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run sim: the simulated spacecraft and the suite, up until Ctrl-C or SIGTERM."""

import argparse
import contextlib
import sys

from srfs.flight import mission
from srfs.flight.processes import StopSignals
from srfs.flight.serving import GroundServer
from srfs.program import MissionError, add_flight_options, run_program


WEB_PORT = 8190


def parse():
    parser = argparse.ArgumentParser(prog="./run sim", description="Flies the simulated spacecraft until Ctrl-C or SIGTERM.")
    add_flight_options(parser, "; two simulations run side by side with different folders")
    parser.add_argument("--web", nargs="?", type=int, const=WEB_PORT, metavar="PORT",
                        help="also serve the operator's page (srfs-ground serve --web); prints its address (default of PORT: %(const)s; 0: a free one)")
    return parser.parse_args()


def say(text):
    print(text, flush=True)


def greeting(flight, page):
    var, bin_dir, nodes = flight.var, flight.bin_dir, flight.up_report["nodes"]
    option = "" if flight.deployment.stem == "sim" else f" --deployment {flight.deployment}"
    coming = f"; still starting, not needed for flight: {', '.join(flight.coming)}" if flight.coming else ""
    return f"""{len(nodes) - len(flight.coming)} nodes up in {flight.up_report['took_ms']} ms, DDS domain {flight.domain}{coming}
  operator's port  {var}/rs422
  logs             {var}/log/{page}
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


@contextlib.contextmanager
def served_page(flight, port):
    """The lines of the greeting about the page, which is served meanwhile. Without a port there is none."""
    if port is None:
        yield "\n  operator's page  ./run sim --web"
        return
    server = GroundServer(flight.bin_dir, flight.var, flight.deployment, f"127.0.0.1:{port}", flight.var / "log" / "serve.log")
    try:
        yield f"\n  operator's page  {server.url}"
    finally:
        server.stop()


def main():
    arguments = parse()
    signals = StopSignals()
    flight = mission.Mission(arguments.var, arguments.deployment, arguments.bin, say, wait_for_all=False)
    flight.start()
    try:
        with served_page(flight, arguments.web) as page:
            say(greeting(flight, page))
            whole = fly(flight, signals)
            say("stopping")
    except MissionError as error:
        print(f"sim: {error}", file=sys.stderr)
        whole = False
    left = flight.stop()
    for line in left:
        print(f"left behind: {line}", file=sys.stderr)
    if not left:
        say("stopped; nothing is left running")
    return 0 if whole and not left else 1


if __name__ == "__main__":
    run_program("sim", main)
