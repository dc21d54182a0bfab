# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run campaign: long runs of the real processes under faults, with a verdict, figures and a plot. Exit code 0 only if every invariant held."""

import argparse
import random
import shutil

from srfs import program
from srfs.campaign import faults, fencing, overload, rescue, strangers, updates
from srfs.flight import deployments, mission
from srfs.flight.deployments import NODES
from srfs.flight.processes import StopSignals
from srfs.program import Interrupted, MissionError
from srfs.report import show_checks


def shard(text):
    """(K, N) of K/N."""
    number, _, shards = text.partition("/")
    if not (number.isdecimal() and shards.isdecimal() and 1 <= int(number) <= int(shards)):
        raise argparse.ArgumentTypeError(f"{text}: expected K/N, as 3/8")
    return int(number), int(shards)


def parse():
    parser = argparse.ArgumentParser(prog="./run campaign", description="Long runs of the real processes under faults. "
                                     "Exit code 0 only if every invariant held.")  # fmt: skip
    parser.add_argument("name", nargs="?", default="faults", choices=("faults", "fencing", "updates", "overload", "commandability", "strangers", "rescue"),
                        help="faults (default): every class of failure in every node, healed by the ring; "
                        "fencing: processes are stopped and killed at random points of their CAN slots; "
                        "updates: packages of sources in a row, a third of them bad, with processes killed; "
                        "overload: beside programs that take the CPUs: who waits for one is not dead, who is dead is found; "
                        "commandability: every telecommand, parameter and lifecycle order: the satellite can still be commanded; "
                        "strangers: participants outside the suite flood its topics; "
                        "rescue: files damaged at random: suite or srfs_rescue answers, and telecommands bring all nodes back")  # fmt: skip
    parser.add_argument("--seed", type=int, metavar="S", help="of the faults (default: a random one, which is printed)")
    program.add_run_options(parser, "campaign", "sim for faults, fencing for fencing")
    ring = parser.add_argument_group("faults")
    ring.add_argument("--class", dest="classes", metavar="C[,C]", help=f"classes, 'none', or 'all' (default): {', '.join(c.name for c in faults.CLASSES)}")
    ring.add_argument("--nodes", metavar="N[,N]", help="nodes that fail (default: all nine)")
    ring.add_argument("--repeat", type=int, default=1, metavar="N", help="trials of each class and node (default: %(default)s)")
    ring.add_argument("--subsets", metavar="all|N", help="all 510 subsets of the nine nodes, or N random ones, killed at once (default: 0)")
    ring.add_argument("--stops", type=int, default=0, metavar="N", help="the whole suite stopped and continued so often (default: %(default)s)")
    ring.add_argument("--everybody", type=int, default=0, metavar="N", help="all nine killed at once so often; the watchdog raises them (default: %(default)s)")
    ring.add_argument("--soak", type=float, default=0, metavar="S",
                      help="seconds without a fault beside 'stress-ng --cpu 4 --io 2': false restarts, memory, descriptors (default: %(default)s)")  # fmt: skip
    ring.add_argument("--tick-ms", type=int, metavar="T",
                      help="period of the ticks, a divisor of 1000 (default: the deployment's, 100): the 86400 of a day of a board are a soak of 2160 s at 25 ms")  # fmt: skip
    ring.add_argument("--misses", type=int, default=3, metavar="N", help="unanswered checks in a row that are death, 1 to 10 (default: %(default)s)")
    ring.add_argument("--realtime", action="store_true",
                      help="also of strangers: SCHED_FIFO for every node and the simulated devices, which a mission has on a board (needs CAP_SYS_NICE)")  # fmt: skip
    slots = parser.add_argument_group("fencing")
    slots.add_argument("--slots", type=int, default=10_000, metavar="N", help="grants of the bus (default: %(default)s)")
    packages = parser.add_argument_group("updates")
    packages.add_argument("--updates", type=int, default=200, metavar="N", help="packages (default: %(default)s)")
    busy = parser.add_argument_group("overload")
    busy.add_argument("--flood", type=float, default=60, metavar="S", help="length of an overload of 60 processes that burn CPUs (default: %(default)s)")
    busy.add_argument("--calm", type=float, default=60, metavar="S", help="seconds beside the load without a fault (default: %(default)s)")
    busy.add_argument("--sim", type=float, default=0, metavar="S", help="seconds of ./run sim beside the load: restarts (default: %(default)s)")
    busy.add_argument("--demos", type=int, default=0, metavar="N", help="runs of the demo beside the load (default: %(default)s)")
    busy.add_argument("--heavy-demos", type=int, default=0, metavar="N", help="the same beside a heavier load (default: %(default)s)")
    orders = parser.add_argument_group("commandability")
    orders.add_argument("--only", metavar="TEXT[,TEXT]", help="only orders whose kind or text has one of these in it")
    outside = parser.add_argument_group("strangers")
    outside.add_argument("--seconds", type=float, default=60, metavar="S", help="of the calm and of the flood (default: %(default)s)")
    outside.add_argument("--settle", type=float, default=strangers.SETTLE_S, metavar="S", help="afterwards, until memory is read (default: %(default)s)")
    outside.add_argument("--roles", default=",".join(strangers.ROLES), metavar="R[,R]", help="what they send (default: %(default)s)")
    wrecks = parser.add_argument_group("rescue")
    wrecks.add_argument("--trials", type=int, default=20, metavar="N", help="damaged suites, with the seeds S, S + 1... (default: %(default)s)")
    wrecks.add_argument("--shard", type=shard, default=(1, 1), metavar="K/N", help="only each N-th of them from the K-th on: for several machines (with --seed)")
    options = parser.parse_args()
    known = {c.name: c for c in faults.CLASSES}
    wanted = {None: list(known), "all": list(known), "none": []}.get(options.classes, (options.classes or "").split(","))
    if unknown := [name for name in wanted if name not in known]:
        parser.error(f"--class: there is no {', '.join(unknown)}; there are {', '.join(known)}")
    options.classes = [known[name] for name in wanted]
    options.nodes = options.nodes.split(",") if options.nodes else list(NODES)
    if unknown := [name for name in options.nodes if name not in NODES]:
        parser.error(f"--nodes: there is no {', '.join(unknown)}; there are {', '.join(NODES)}")
    try:
        options.subsets = faults.SUBSETS if options.subsets == "all" else int(options.subsets or 0)
    except ValueError:
        parser.error("--subsets: expected 'all' or a number")
    if min(options.slots, options.repeat) < 1 or not 1 <= options.misses <= 10 or (options.tick_ms is not None and (options.tick_ms < 20 or 1000 % options.tick_ms)) or not 0 <= options.subsets <= faults.SUBSETS or min(options.stops, options.everybody, options.soak) < 0:
        parser.error("a number is out of its range")
    return options


def show_fencing(summary):
    show_checks(summary["checks"])
    print(f"  {summary['slots']} slots, {summary['frames']} frames, {summary['telecommands']['accepted']} telecommands accepted, "
          f"{summary['telecommands']['outcome_unknown']} with an unknown outcome, {summary['restarts']} restarts in {summary['recorded_s']} s")  # fmt: skip
    for kind, figures in summary["faults"].items():
        gap, back = figures["bus_gap"], figures["victim_gap"]
        print(f"  {kind:36} {figures['count']:5}   bus used again after {gap.get('p50_ms', '-')} ms (p50), {gap.get('max_ms', '-')} ms (max)"
              + (f"; victim back after {back['p50_ms']} and {back['max_ms']} ms" if back["count"] else ""))  # fmt: skip
    print(f"  {summary['machine']}")


def run_fencing(options, out, seed, signals, say):
    say(f"{options.slots} slots, seed {seed}")
    with mission.Mission(options.var or out / "var", options.deployment or "fencing", options.bin, say, insist_s=mission.UP_DEADLINE_S) as flight:
        campaign = fencing.Fencing(flight, signals, options.slots, seed, say)
        campaign.run()
    verdict, found = campaign.judge()
    campaign.write(out, found)
    return verdict, lambda: fencing.draw(out, found)


def run_trials(campaign, jobs, say):
    """Runs the jobs, each of which returns a trial. A job that finds the suite not steady is a failure; three in a row end the campaign."""
    unsteady = 0  # in a row
    for number, job in enumerate(jobs, start=1):
        try:
            trial = job()
            unsteady = 0
        except MissionError as error:
            if isinstance(error, Interrupted) or unsteady == 2:
                say(f"{error}: {len(jobs) - number + 1} faults not injected")
                return
            unsteady += 1
            trial = campaign.failed(str(error))
        if trial is None:
            say(f"{number} of {len(jobs)}: not applicable")
        else:
            active = trial.seconds("active")
            say(f"{number} of {len(jobs)}: {trial.kind} {','.join(trial.victims)}: "
                + (f"Active again after {active:.3f} s" if active is not None else trial.note or "nobody restarted")
                + (f"; found as {trial.found_as}" if trial.found_as else "")
                + (f"; FALSE RESTARTS: {', '.join(trial.false_restarts)}" if trial.false_restarts else ""))  # fmt: skip


def run_faults(options, out, seed, signals, say):
    injector = options.bin.absolute().parent / "lib" / "libsrfs_fault_injector.so"
    if not injector.exists():
        raise MissionError(f"{injector} is missing: build first (./run build)", code=2)
    wrappers = faults.Wrappers(out / "bin", options.bin.absolute(), injector)
    deployment = wrappers.deployment(deployments.find(options.deployment or "sim"), out / "deployment.yaml", options.misses, options.realtime, options.tick_ms)
    order = random.Random(seed)
    trials = [(fault, node) for fault in options.classes for node in options.nodes for _ in range(options.repeat)]
    order.shuffle(trials)
    subsets = [[n for bit, n in enumerate(NODES) if mask >> bit & 1] for mask in order.sample(range(1, faults.SUBSETS + 1), options.subsets)]
    say(f"{len(trials)} faults, {len(subsets)} subsets, {options.stops} stops, {options.everybody} times everybody, seed {seed}")
    with mission.Mission(options.var or out / "var", deployment, options.bin, say) as flight:
        if options.realtime:
            faults.make_realtime(flight.hw_sim.pid)
        with faults.FaultCampaign(flight, wrappers, signals, seed, say) as campaign:
            jobs = [lambda f=f, n=n: campaign.trial(f, n) for f, n in trials] + [lambda s=s: campaign.subset(s) for s in subsets]
            jobs += [lambda: campaign.stop_everybody(order.choice((0.05, 0.2, 0.5, 1.0, 3.0)))] * options.stops
            jobs += [lambda: campaign.subset(NODES)] * options.everybody
            run_trials(campaign, jobs, say)
            if options.soak:
                campaign.soak(options.soak, faults.tick_ms(deployment))
        faults.write(out, campaign)
    summary = {"misses": options.misses, "realtime": options.realtime, **faults.summarize(campaign)}
    (out / "report.md").write_text(faults.report(summary))
    return summary, lambda: faults.draw(out, campaign)


def run_overload(options, out, seed, signals, say):
    """Runs the faults of --class and a CPU hog in --nodes, an overload that ends, and the demo, all beside programs that take the CPUs."""
    wrappers = faults.Wrappers(out / "bin", options.bin.absolute(), options.bin.absolute().parent / "lib" / "libsrfs_fault_injector.so")
    deployment = wrappers.deployment(deployments.find(options.deployment or "sim"), out / "deployment.yaml", options.misses)
    names = {fault.name for fault in options.classes}
    trials = [(fault, node) for fault in overload.CLASSES if fault.name in names or (names and fault is faults.HOG_CLASS)
              for node in options.nodes for _ in range(options.repeat)]
    random.Random(seed).shuffle(trials)
    say(f"{len(trials)} faults beside {overload.LOAD}, seed {seed}")
    with overload.busy(overload.LOAD), mission.Mission(options.var or out / "var", deployment, options.bin, say) as flight:
        say(f"the suite is up beside the load after {flight.up_report['took_ms'] / 1000:.1f} s")
        with overload.Overload(flight, wrappers, signals, seed, say) as campaign:
            jobs = [lambda f=fault, n=node: campaign.trial(f, n) for fault, node in trials]
            jobs += [lambda: campaign.calm(options.calm)] * bool(options.calm) + [lambda: campaign.flood(options.flood)] * bool(options.flood)
            run_trials(campaign, jobs, say)
            if campaign.back_s is not None:
                say(f"overload of {options.flood:.0f} s: as before {campaign.back_s:.1f} s after its end")
        faults.write(out, campaign)
    sim = overload.fly_sim(options, out, options.sim, signals, say) if options.sim else None
    demos = [run for load, count in ((overload.LOAD, options.demos), (overload.HEAVY_LOAD, options.heavy_demos))
             for run in overload.fly_demos(options, out, load, count, signals, say)]  # fmt: skip
    summary = {"misses": options.misses, "realtime": False, **overload.summarize(campaign, demos, sim)}
    (out / "report.md").write_text(faults.report(summary))
    return summary, lambda: faults.draw(out, campaign)


def run_updates(options, out, seed, signals, say):
    deployment = deployments.read("fig16")
    del deployment["ring"]["members"]  # all nodes, so that the ring restarts maintenance
    deployments.write(deployment, out / "deployment.yaml")
    shutil.rmtree(out / "var", ignore_errors=True)
    say(f"{options.updates} updates, seed {seed}")
    with mission.Mission(options.var or out / "var", options.deployment or out / "deployment.yaml", mission.installed(options.bin), say) as flight:
        campaign = updates.Updates(flight, signals, options.updates, seed, say)
        campaign.run()
    return campaign.judge(), lambda: None


def run_commandability(options, out, seed, signals, say):
    from srfs.campaign import commandability  # which needs the reader of the dictionary, msgs/generator

    wanted = options.only.split(",") if options.only else [""]
    orders = [order for order in commandability.all_orders() if any(text in f"{order.kind} {order.name}" for text in wanted)]
    random.Random(seed).shuffle(orders)
    say(f"{len(orders)} orders, seed {seed}")
    shutil.rmtree(options.var or out / "var", ignore_errors=True)
    deployment = options.deployment or deployments.copy(deployments.FOLDER / "sim.yaml", out / "deployment.yaml", [commandability.LIMIT])
    with commandability.Trials(options.var or out / "var", deployment, options.bin, say, out / "deaf") as trials:
        trials.give_all(orders, lambda: signals.wait(0))
    trials.write(out)
    return trials.judge(), lambda: None


def run_strangers(options, out, seed, signals, say):
    shutil.rmtree(options.var or out / "var", ignore_errors=True)
    deployment = options.deployment or "sim"
    if options.realtime:
        deployment = faults.realtime_deployment(deployments.find(deployment), out / "deployment.yaml")
    with mission.Mission(options.var or out / "var", deployment, options.bin, say) as flight:
        if options.realtime:
            faults.make_realtime(flight.hw_sim.pid)
        campaign = strangers.Strangers(flight, signals, options.bin.absolute(), say)
        campaign.run(options.seconds, options.settle, options.roles.split(","))
        summary = campaign.judge()
    campaign.write(out, summary)
    return summary, lambda: None


def run_rescue(options, out, seed, signals, say):
    campaign = rescue.Campaign(out, options.bin, say)
    number, shards = options.shard
    for trial_seed in range(seed + number - 1, seed + options.trials, shards):
        if signals.wait(0):
            break
        trial = campaign.trial(trial_seed)
        say(f"seed {trial_seed}: {len(trial['damaged'])} files damaged, {trial['answered']} answers after {trial['starts']} starts, "
            + (trial["problem"][:200] or f"all nodes Active after {trial['took_s']:.0f} s"))  # fmt: skip
    return campaign.judge(), lambda: None


def show_commandability(summary):
    for kind, count in summary["kinds"].items():
        print(f"  {count:5} {kind}")
    for result in summary["deaf"]:
        print(f"  DEAF  {result['kind']} {result['order']}: {'; '.join(result['said'])}")
    if summary["not_sent"]:
        print(f"  {summary['not_sent']} lines were refused by the ground tool and not sent: their orders are not tested")
    print(f"  {summary['orders'] - len(summary['deaf'])} of {summary['orders']} orders leave the satellite commandable within {summary['limit_s']} s "
          f"(slowest: {summary['slowest_s']} s)")  # fmt: skip


RUNS = {"faults": (run_faults, faults.show), "fencing": (run_fencing, show_fencing), "updates": (run_updates, updates.show), "overload": (run_overload, faults.show),
        "commandability": (run_commandability, show_commandability), "strangers": (run_strangers, strangers.show), "rescue": (run_rescue, rescue.show)}  # fmt: skip


def main():
    options = parse()
    signals = StopSignals()
    seed = random.randrange(1 << 32) if options.seed is None else options.seed
    out, say = program.made_folder(options, "campaign"), program.teller(options.name)
    run, show = RUNS[options.name]
    verdict, draw = run(options, out, seed, signals, say)
    summary = {"campaign": options.name, "seed": seed, **verdict}

    def show_all():
        show(summary)
        print(f"  seed {seed}; files in {out}")

    return program.finish(options, out, summary, draw, show_all, say)


if __name__ == "__main__":
    program.run_program("campaign", main)
