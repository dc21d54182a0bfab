"""./run experiment: the paper's experiments with the real processes; drawings, CSV and summary.json; exit code 0 if they show what it says."""

import argparse
import json
import pathlib
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "demo"))

import fig14  # noqa: E402
import mission  # noqa: E402

NAMES = tuple(fig14.TITLES)


def parse():
    parser = argparse.ArgumentParser(prog="./run experiment", description="One of the paper's experiments, with the real processes. "
                                     "Exit code 0 only if the recorded shape is the one the paper describes.")  # fmt: skip
    parser.add_argument("name", choices=NAMES, help="; ".join(f"{name}: {title}" for name, title in fig14.TITLES.items()))
    parser.add_argument("--out", type=pathlib.Path, metavar="DIR", help="where the files go (default: var/experiments/NAME)")
    parser.add_argument("--var", type=pathlib.Path, metavar="DIR", help="folder of the running deployment (default: DIR of --out + /var)")
    parser.add_argument("--deployment", default="fig14", metavar="NAME", help="launch_config/NAME.yaml, or a file (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print summary.json instead of lines")
    parser.add_argument("--bin", type=pathlib.Path, default=mission.ROOT / "build-release" / "bin", help=argparse.SUPPRESS)
    return parser.parse_args()


def main():
    options = parse()
    signals = mission.StopSignals()  # a Ctrl-C ends it in order
    out = (options.out or mission.ROOT / "var" / "experiments" / options.name).absolute()
    out.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(f"[{options.name}] {text}", file=sys.stderr, flush=True)

    with mission.Mission(options.var or out / "var", options.deployment, options.bin, say) as flight:
        experiment = fig14.Experiment(options.name, flight, signals, say)
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
        measured = summary.get("strict_sequence_measured")
        print(f"  bus used {100 * summary['bus_utilisation']:.1f} % of the time"
              + (f", {100 * summary['bus_utilisation_sequential']:.1f} % if processing had to end first" if summary["bus_utilisation_sequential"] else "")
              + (f" (measured {100 * measured['bus_utilisation']:.1f} %), parallelism {summary['parallelism']}" if measured else "")
              + f"; heartbeat to bus {summary['heartbeat_to_bus_p50_ms']} ms (p50); files in {out}")  # fmt: skip
    return 0 if summary["ok"] else 1


if __name__ == "__main__":
    mission.run_program("experiment", main)
