"""./run campaign: long runs of the real processes under faults; verdict, figures and drawing; exit code 0 only if every invariant held."""

import argparse
import json
import pathlib
import random
import sys

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "tools" / "demo"))

import fencing  # noqa: E402
import mission  # noqa: E402


def parse():
    parser = argparse.ArgumentParser(prog="./run campaign", description="Long runs of the real processes under faults. "
                                     "Exit code 0 only if every invariant held.")  # fmt: skip
    parser.add_argument("name", choices=("fencing",), help="fencing: processes are stopped and killed at random points of their CAN slots")
    parser.add_argument("--slots", type=int, default=10_000, metavar="N", help="grants of the bus (default: %(default)s)")
    parser.add_argument("--seed", type=int, metavar="S", help="of the faults (default: a random one, which is printed)")
    parser.add_argument("--out", type=pathlib.Path, metavar="DIR", help="where the files go (default: var/campaign/NAME)")
    parser.add_argument("--var", type=pathlib.Path, metavar="DIR", help="folder of the running deployment (default: DIR of --out + /var)")
    parser.add_argument("--deployment", default="fencing", metavar="NAME", help="launch_config/NAME.yaml, or a file (default: %(default)s)")
    parser.add_argument("--json", action="store_true", help="print summary.json instead of lines")
    parser.add_argument("--bin", type=pathlib.Path, default=mission.ROOT / "build-release" / "bin", help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.slots < 1:
        parser.error("--slots: expected at least 1")
    return options


def show(summary, out):
    for result in summary["checks"]:
        count = f" ({result['of']})" if "of" in result else ""
        print(f"  {'ok    ' if result['ok'] else 'NOT OK'}  {result['what']}{count}")
        for line in result["shown"]:
            print(f"            {line}")
    print(f"  {summary['slots']} slots, {summary['frames']} frames, {summary['telecommands']['accepted']} telecommands accepted, "
          f"{summary['telecommands']['outcome_unknown']} with an unknown outcome, {summary['restarts']} restarts in {summary['recorded_s']} s")  # fmt: skip
    for kind, figures in summary["faults"].items():
        gap, back = figures["bus_gap"], figures["victim_gap"]
        print(f"  {kind:36} {figures['count']:5}   bus used again after {gap.get('p50_ms', '-')} ms (p50), {gap.get('max_ms', '-')} ms (max)"
              + (f"; victim back after {back['p50_ms']} and {back['max_ms']} ms" if back["count"] else ""))  # fmt: skip
    print(f"  seed {summary['seed']}; files in {out}")


def main():
    options = parse()
    signals = mission.StopSignals()
    seed = random.randrange(1 << 32) if options.seed is None else options.seed
    out = (options.out or mission.ROOT / "var" / "campaign" / options.name).absolute()
    out.mkdir(parents=True, exist_ok=True)

    def say(text):
        print(f"[{options.name}] {text}", file=sys.stderr, flush=True)

    say(f"{options.slots} slots, seed {seed}")
    with mission.Mission(options.var or out / "var", options.deployment, options.bin, say) as flight:
        campaign = fencing.Campaign(flight, signals, options.slots, seed, say)
        campaign.run()
    verdict, found = campaign.judge()
    summary = {"campaign": options.name, "seed": seed, **verdict}
    campaign.write(out, found)
    (out / "summary.json").write_text(json.dumps(summary, indent=2) + "\n")
    try:
        fencing.draw(out, found)
    except ImportError:
        say("python3-matplotlib is missing: no drawing")
    if options.json:
        print(json.dumps(summary))
    else:
        show(summary, out)
    return 0 if summary["ok"] else 1


if __name__ == "__main__":
    mission.run_program("campaign", main)
