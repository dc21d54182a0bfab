"""The paper's Fig. 14 with the real processes: who occupied the CAN bus when, who processed, who took a telecommand."""

import csv
import time

import can_frames
import mission
import timeline
from rotation import percentile
from timeline import MS

PAYLOADS = ("payload_adcs", "payload_eps", "payload_thermal")  # the paper's payload1, 2, 3
SETTLE_S = 2.0  # the slots before the recording are over, their processing too
LATE_MS = 300  # what payload2's peripheral takes longer in fig14b: more than the heartbeat of 250 ms, less than the allotted time
TELECOMMANDS = ("adcs.set_mode mode=point", "adcs.set_mode mode=detumble")
DEPLOYMENT = "fig14"
ONLY = ()
DURATION_S = {"fig14a": 6.0, "fig14b": 8.0, "fig14c": 6.0, "fig14d": 8.0}
TITLES = {
    "fig14a": "normal",
    "fig14b": "CAN bus blocked: payload2 uses it for longer than anticipated",
    "fig14c": "processing goes on while the next payload has the bus",
    "fig14d": "telecommands to payload1",
}


class Experiment:
    """One run. Everything on CLOCK_MONOTONIC in ns."""

    def __init__(self, name, flight, signals, say):
        self.name = name
        self.flight = flight
        self.signals = signals
        self.say = say
        self.line = timeline.Timeline(PAYLOADS)
        self.frames = {}

    def wait_until(self, end):
        """Waits until time.monotonic() is end. Raises MissionError when the user asks for the end before."""
        left = end - time.monotonic()
        if self.signals.asked or (left > 0 and self.signals.wait(left)):
            raise mission.MissionError("interrupted", code=130)

    def switcher(self, transition):
        result = self.flight.srfs("lifecycle", "can_switcher", transition)
        if result.returncode != 0:
            raise mission.MissionError(f"can_switcher {transition}: {result.stdout.strip() or result.stderr.strip()}")

    def run(self):
        self.switcher("deactivate")
        self.wait_until(time.monotonic() + SETTLE_S)
        if self.name == "fig14b":
            self.flight.control({"peripheral": "eps", "fault": "late", "delay_ms": LATE_MS})
        recorder = self.flight.recorder()
        recorder.on_message(self.line.on_message)
        ground = self.flight.ground() if self.name == "fig14d" else None
        self.begin = time.monotonic_ns()
        self.say(f"recording {DURATION_S[self.name]:g} s")
        self.switcher("activate")
        end = time.monotonic() + DURATION_S[self.name]
        for k, text in enumerate(TELECOMMANDS if ground else ()):
            self.wait_until(end - DURATION_S[self.name] + 2 + 2.5 * k)
            self.say(f"telecommand {text}")
            ground.send(f"tc {text}")
        self.wait_until(end)
        self.end = time.monotonic_ns()
        if ground:
            self.frames = self.frames_of_telecommands()

    def frames_of_telecommands(self):
        """{id: when its first frame was on the bus} from the record of the simulated bus."""
        frames = can_frames.command_frames(self.flight.can_log(until_ns=self.end - 500 * MS))
        found = {}
        for number, (target, at) in self.line.telecommands.items():
            times = [t for t in frames.get((target, number & 0xFFFFFFFF), []) if t >= at - timeline.PULSE_BOUND_NS]
            if times:
                found[number] = times[0]
        return found

    def judge(self):
        intervals = self.line.intervals(self.begin, self.end)
        beats = self.line.heartbeats(self.begin, self.end)
        if self.name == "fig14b":
            checks = timeline.fig14b(intervals, beats, PAYLOADS, self.end, "payload_eps")
        elif self.name == "fig14d":
            checks = timeline.fig14d(intervals, beats, PAYLOADS, self.end, "payload_adcs", self.line.telecommands, self.line.completed,
                                     self.frames)  # fmt: skip
        else:
            checks = getattr(timeline, self.name)(intervals, beats, PAYLOADS, self.end)
        delays = [(slot.begin - beat) / MS for slot, beat, _ in timeline.switched_at(intervals, beats) if beat]
        return {
            "experiment": self.name,
            "title": TITLES[self.name],
            "deployment": self.flight.deployment.stem,
            "recorded_s": round((self.end - self.begin) / 1e9, 3),
            "heartbeats": len(beats),
            "heartbeat_ms": round(timeline.heartbeat_period(beats) / MS, 1),
            "heartbeat_to_bus_p50_ms": round(percentile(delays, 0.5) or 0, 3),
            **timeline.use_of_the_bus(intervals, beats, self.begin, self.end),
            "checks": checks,
            "ok": all(c["ok"] for c in checks),
        }

    @staticmethod
    def text(summary):
        sequential = summary["bus_utilisation_sequential"]
        return (f"  bus used {100 * summary['bus_utilisation']:.1f} % of the time"
                + (f", {100 * sequential:.1f} % if processing had to end first" if sequential else "")
                + f"; heartbeat to bus {summary['heartbeat_to_bus_p50_ms']} ms (p50)")  # fmt: skip

    # --- files --------------------------------------------------------------------------------------------------------

    def write_csv(self, path):
        with open(path, "w", newline="") as file:
            rows = csv.writer(file)
            rows.writerow(["payload", "state", "begin_s", "end_s"])
            for i in self.line.intervals(self.begin, self.end):
                rows.writerow([i.payload, i.state, f"{(i.begin - self.begin) / 1e9:.6f}", f"{(i.end - self.begin) / 1e9:.6f}"])

    def draw(self, folder):
        """SVG and PNG like the paper's figure: a panel a payload, its four states over time, the heartbeats dotted."""
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot

        def seconds(t):
            return (t - self.begin) / 1e9

        intervals = self.line.intervals(self.begin, self.end)
        figure, axes = pyplot.subplots(len(PAYLOADS), 1, figsize=(10, 6), sharex=True)
        for number, (axis, payload) in enumerate(zip(axes, PAYLOADS), 1):
            own = [i for i in intervals if i.payload == payload]
            levels = [timeline.STATES.index(i.state) for i in own]
            axis.step([seconds(i.begin) for i in own] + [seconds(self.end)], levels + levels[-1:], where="post", color=f"C{number - 1}")
            for i in own:
                if i.state == timeline.OCCUPYING:
                    axis.axvspan(seconds(i.begin), seconds(i.end), color=f"C{number - 1}", alpha=0.15, linewidth=0)
            for beat in self.line.heartbeats(self.begin, self.end):
                axis.axvline(seconds(beat), color="grey", linewidth=0.5, linestyle=":")
            for target, at in self.line.telecommands.values():
                if target == payload:
                    axis.axvline(seconds(at), color="red", linewidth=0.8, linestyle="--")
            axis.set_yticks(range(len(timeline.STATES)), ["off", "occupying CAN", "data processing", "other async command"], fontsize=8)
            axis.set_ylim(-0.3, len(timeline.STATES) - 0.7)
            axis.set_title(f"payload{number} ({payload})", fontsize=9, loc="left")
        axes[-1].set_xlabel("time [s]; dotted: heartbeats" + ("; red: telecommand" if self.line.telecommands else ""))
        figure.suptitle(f"Fig. 14{self.name[-1]}: {TITLES[self.name]}", fontsize=11)
        figure.tight_layout()
        for kind in ("svg", "png"):
            figure.savefig(folder / f"{self.name}.{kind}", dpi=130)
        pyplot.close(figure)
