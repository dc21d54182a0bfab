# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run demo: the simulated spacecraft, the suite and a scripted operator; says live what happens, checks it, sums it up."""

import argparse
import datetime
import json
import shutil
import subprocess
import sys
import time

from srfs.flight import deployments, mission
from srfs.flight.deployments import PAYLOADS
from srfs.flight.ground import ANSWER_DEADLINE_S
from srfs.flight.lateness import Excuses, Lateness, Waiting, describe_lateness, describe_waiting
from srfs.flight.processes import StopSignals
from srfs.program import Interrupted, MissionError, add_flight_options
from srfs.record import can_frames
from srfs.record.rotation import Rotation
from srfs.report import Display, percentile, quantiles, table

PAYLOAD_OF_COMMAND = {"adcs": "payload_adcs", "eps": "payload_eps", "thermal": "payload_thermal"}
SHORTEST_S = 20
SCRIPT_S = 10  # what the script needs without its two watching phases
# Waits end with what they wait for: these are for a machine that others use, too.
ANSWER_DEADLINE_S = ANSWER_DEADLINE_S
BEACON_DEADLINE_S = 150  # one is sent every 30 s
PICTURE_DEADLINE_S = 300
COMMAND_TRIES = 3
LANE_SOON_S = 2  # the image lane is usually there by then; else its picture is taken later
BUS_NODES = ("timing", "can_switcher", "hw_sim")  # what a slot needs beside its payload
SLOT_MARGIN_NS = 100_000_000  # the tick before it, and what was begun in the slot before
RESTART_NS = 5_000_000_000  # before a restart is seen: in this time lies its cause
EXCUSES_SHOWN = 20
SLOTS_UNDER_WAY = 2  # one at each of the two times at which the slots are counted
INTERVAL_PACKETS = 7  # two seconds of them
PICTURE_METHOD = "tracklet"
PICTURE_TRIES = 3
IMAGE_NODES = ("image_acquisition", "image_processing", "hw_sim", "ttc", "srfs-ground")


def describe(packet):
    """What one telemetry packet of a payload says, in a few words."""
    f = packet["fields"]
    if packet["structure"] == "payload_adcs":
        return f"attitude {f['pointing_error_deg']:5.1f} deg off, {f['rate_deg_s']:.2f} deg/s, {f['mode']}"
    if packet["structure"] == "payload_eps":
        return (f"battery {f['battery_voltage_v']:.2f} V {100 * f['state_of_charge']:.1f} %, {f['battery_power_w']:+.2f} W, "
                f"loads {f['load_switches']}")  # fmt: skip
    return f"{f['temperature_min_k']:.1f} to {f['temperature_max_k']:.1f} K, setpoints {f['setpoint_k[0]']:g} and {f['setpoint_k[1]']:g} K"


class Demo:
    """The script. Every expectation that does not come true is a line in `failures`."""

    def __init__(self, flight, display, signals, duration_s, witness, waiting):
        self.flight = flight
        self.witness = witness
        self.waiting = waiting
        self.display = display
        self.signals = signals
        self.watch_s = max(2.0, (duration_s - SCRIPT_S) / 2)
        self.failures = []
        self.questioned = []  # (what, processes, begin, end in ns) of what did not come as expected, and may be excused
        self.excused = []
        self.lane = None  # `srfs up` that waits for the image lane
        self.slots_before = {}
        self.rotation = Rotation()
        self.latest = {}
        self.stages = {}  # line of the session -> its stage messages
        self.sent_to_payloads = []  # (line of the session, payload) of the telecommands that completed
        self.picture_line = None
        self.picture_task = None
        self.picture = None
        self.noise = {"bad_frames": 0, "lost_frames": 0, "corrected_octets": 0}

    def expect(self, good, what, needs=(), since_ns=None):
        """@param needs, since_ns  processes that it needed, since when: what is missing then is judged at the end, by what they waited"""
        self.display.result(bool(good), what)
        if not good and needs:
            self.question(what, needs, since_ns)
        elif not good:
            self.failures.append(what)
        return good

    def question(self, what, needs, begin_ns, end_ns=None):
        self.questioned.append((what, needs, begin_ns, end_ns or time.monotonic_ns()))

    def connect(self):
        self.ground = self.flight.ground()
        self.ground.on_message(self.on_downlink)
        self.recorder = self.flight.recorder()
        self.recorder.on_message(self.on_record)

    # --- what is shown while it happens (called in the reading threads) -----------------------------------------------

    def on_record(self, message):
        self.rotation.on_message(message)
        if message["type"] == "bus" and message["status"] != "taken":
            slot = self.rotation.last_slot
            if slot:
                self.display.live(f"  cycle {slot['cycle']:6}  {slot['holder']:16} held the bus {slot['used_us'] / 1000:5.1f} ms")

    def on_downlink(self, message):
        kind = message["type"]
        if kind == "tc_stage":
            self.on_stage(message)
        elif message.get("structure") in PAYLOADS and message["vc"] == 0:
            self.latest[message["structure"]] = message
        elif kind == "event":
            self.display.note(self.display.colour(f"event {message['severity']:6} {message['source']}: {message.get('text', '')}", "35"))

    def on_stage(self, message):
        self.stages.setdefault(message["line"], []).append(message)
        self.display.live(f"  {message['command']}: {message['stage']} after {message['elapsed_ms']:.1f} ms")

    def story(self, line):
        """"accepted after 4.5 ms, completed after 249.6 ms": what became of the telecommand of a line."""
        words = []
        for stage in self.stages.get(line, []):
            if stage["stage"] != "sent":
                words.append(f"{stage['stage']} {stage['elapsed_ms']:.1f} ms" + (f" ({stage['text']})" if stage.get("text") else ""))
        return ", ".join(words)

    # --- steps --------------------------------------------------------------------------------------------------------

    def check_running(self):
        self.signals.check()
        news, gone = self.flight.news_of_processes()
        if gone:
            raise MissionError(news[0])
        for line in news:
            if "has come" in line:
                self.display.note(line)
                continue
            self.display.note(self.display.colour(f"! {line}", "31;1"))
            self.question(line, [line.split()[0]], time.monotonic_ns() - RESTART_NS)

    def wait_until(self, condition, deadline_s):
        """Until it is true or the time is up, with an eye on the processes."""
        end = time.monotonic() + deadline_s
        while not condition() and time.monotonic() < end:
            self.signals.pause(0.2)
            self.check_running()

    def command(self, text):
        """Sends a telecommand and expects that it is completed; one that the machine was too busy for is sent again."""
        payload = PAYLOAD_OF_COMMAND.get(text.removeprefix("tc ").split(".")[0])
        for further in range(COMMAND_TRIES - 1, -1, -1):
            self.check_running()
            begin_ns = time.monotonic_ns()
            line = self.ground.send(text)
            outcome = self.ground.outcome(line, ANSWER_DEADLINE_S) or {"type": "error", "message": "no answer"}
            said = self.story(line) or outcome.get("message")
            needs = ("ttc", "srfs-ground", *BUS_NODES, *([payload] if payload else []))
            if self.expect(outcome.get("stage") == "completed", f"{text.removeprefix('tc ')}: {said}", needs, begin_ns):
                if payload:
                    self.sent_to_payloads.append((line, payload))
                break
            if further:
                self.display.note("once more")
        return outcome

    def ping(self, timeout_s=ANSWER_DEADLINE_S):
        """Whether one ping is answered."""
        self.check_running()
        since = self.ground.position()
        self.ground.command(f"ping --timeout {timeout_s}", timeout_s + ANSWER_DEADLINE_S)
        return self.ground.wait_for(lambda m: m["type"] == "pong", 0.5, since) is not None

    def first_contact(self):
        self.display.step("Contact: is it alive?")
        self.expect(self.ping(), "the ping is answered")
        for payload in PAYLOADS:
            self.expect(self.ground.housekeeping(payload, since=0), f"telemetry of {payload} comes down")
        self.slots_before = self.slot_counters()

    def slot_counters(self):
        """{payload: {granted, used, handed_back}} since each began."""
        fields = {p: self.ground.fresh(p) or {} for p in PAYLOADS}
        return {p: {name: f.get(f"slots_{name}", 0) for name in ("granted", "used", "handed_back")} for p, f in fields.items()}

    def watch(self, duration_s, title):
        """Shows the rotation and what the payloads say; a line a second."""
        self.display.step(f"{title} ({duration_s:.0f} s)")
        end = time.monotonic() + duration_s
        while time.monotonic() < end:
            self.signals.pause(min(1.0, end - time.monotonic()))
            self.check_running()
            slots = self.rotation.slots()
            used = "  ".join(f"{p.removeprefix('payload_')} {slots.get(p, {}).get('used', 0):4}" for p in PAYLOADS)
            said = " | ".join(describe(self.latest[p]) for p in PAYLOADS if p in self.latest)
            self.display.note(f"slots used {used}  {said}")

    def switch_a_load(self):
        self.display.step("A telecommand changes what the next telemetry says: switch load 2")
        before = self.ground.fresh("payload_eps")
        if not self.expect(before, "telemetry of payload_eps on request"):
            return
        was_on = bool(int(str(before["load_switches"]), 0) & 4)
        self.display.note(f"load 2 is {'on' if was_on else 'off'} and takes {before['load_current_a[2]']:.3f} A")
        for state in (not was_on, was_on):
            since = self.ground.position()
            self.command(f"tc eps.switch_load load=2 state={'on' if state else 'off'}")
            after = self.ground.housekeeping("payload_eps", since=since, matches=lambda f, s=state: bool(int(str(f["load_switches"]), 0) & 4) == s)
            self.expect(after, f"telemetry says load 2 is {'on' if state else 'off'}")
            if after:
                self.display.note(f"load 2 takes {after['fields']['load_current_a[2]']:.3f} A")

    def refuse_an_argument(self):
        self.display.step("An argument out of its range")
        line = self.ground.send("tc eps.switch_load load=7 state=on")
        outcome = self.ground.outcome(line, ANSWER_DEADLINE_S)
        message = (outcome or {}).get("message") or (outcome or {}).get("text") or "no answer"
        self.display.note(message)
        self.expect(outcome and outcome.get("stage") != "completed" and "load" in message, "refused, naming the argument")

    def set_setpoint(self):
        self.display.step("Thermal: a new setpoint")
        since = self.ground.position()
        self.command("tc thermal.set_setpoint heater=1 setpoint_k=291.5")
        self.expect(self.ground.housekeeping("payload_thermal", since=since, matches=lambda f: f["setpoint_k[1]"] == 291.5), "telemetry says 291.5 K")

    def set_mode(self):
        self.display.step("Attitude control: detumble, then point")
        for mode in ("detumble", "point"):
            since = self.ground.position()
            self.command(f"tc adcs.set_mode mode={mode}")
            self.expect(self.ground.housekeeping("payload_adcs", since=since, matches=lambda f, m=mode: f["mode"] == m), f"telemetry says {mode}")

    def noise_on_the_line(self):
        self.display.step("Noise: one bit in 500 of the RS422 line flips, both ways")
        before = self.ground.stats()
        self.flight.control({"rs422": {"flip_probability": 0.002}})
        sent, answered = 0, 0
        while sent < 8 or not answered and sent < 12:
            answered += self.ping(timeout_s=0.5 if sent < 8 else 5)  # longer when none came: the machine may be slow
            sent += 1
        self.flight.control({"rs422": {"flip_probability": 0}})
        self.expect(answered, f"{answered} of {sent} pings come through the noise")
        self.expect(self.ping(), "without noise the next ping is answered")
        after = self.ground.stats()
        if before and after:
            self.noise = {key: after[key] - before[key] for key in self.noise}
            self.display.note("Reed-Solomon corrected {corrected_octets} octets; {lost_frames} TM frames were lost".format(**self.noise))

    def change_interval(self):
        self.display.step("Housekeeping of payload_eps from each of its slots instead of each second")
        self.command("tc housekeeping.set_interval structure=payload_eps interval_ms=300")
        since, begin_ns = self.ground.position(), time.monotonic_ns()
        packets = lambda: self.ground.select(lambda m: m.get("structure") == "payload_eps" and m["vc"] == 0, since)  # noqa: E731
        self.wait_until(lambda: len(packets()) >= INTERVAL_PACKETS, ANSWER_DEADLINE_S)
        times = [datetime.datetime.fromisoformat(m["time"]) for m in packets()]
        distances_s = [(after - before).total_seconds() for before, after in zip(times, times[1:])]
        distance_s = percentile(distances_s, 0.5)
        # A slot that failed on a busy machine leaves a gap: not the middle one.
        self.expect(distance_s is not None and len(times) >= INTERVAL_PACKETS and 0.25 <= distance_s <= 0.35,
                    f"{len(times)} packets, {distance_s or 0:.2f} s apart", ("payload_eps", "ttc", *BUS_NODES), begin_ns)  # fmt: skip
        self.command("tc housekeeping.set_interval structure=payload_eps interval_ms=1000")

    def retrieve(self, since):
        """The payload telemetry that came live from position `since` on, once more from the packet store."""
        # The store writes once a second: the last moments are not past yet.
        until = time.monotonic() - 2
        live = self.ground.select(lambda m: m.get("structure") in PAYLOADS and m["vc"] == 0 and m["arrived"] < until, since)
        if not self.expect(len(live) >= 3, "live telemetry was seen"):
            return
        first = min(m["time"] for m in live)
        # Times are shown cut to milliseconds: the last packet lies in the millisecond that starts at its time.
        last = datetime.datetime.fromisoformat(max(m["time"] for m in live)) + datetime.timedelta(milliseconds=1)
        last = last.isoformat(timespec="milliseconds").replace("+00:00", "Z")
        self.display.step(f"Downlink of the past: stored telemetry from {first} to {last}")
        before = self.ground.position()
        line = self.ground.send(f"retrieve {first} {last}")
        done = self.ground.wait_for(lambda m: m["type"] == "retrieval_done" and m["line"] == line, 2 * ANSWER_DEADLINE_S, before)
        self.display.note(f"retrieve: {self.story(line)}")
        self.expect(done and done["complete"], f"retrieval complete: {done['received'] if done else 0} packets")
        stored = self.ground.select(lambda m: m.get("vc") == 1, before)
        name = lambda m: (m["apid"], m["sequence"], m["time"])  # noqa: E731
        missing = {name(m) for m in live} - {name(m) for m in stored}
        self.expect(not missing, f"all {len(live)} packets that were seen live are in the store ({len(missing)} missing)")
        rows = [["time", "from", "what it says"]]
        payload_packets = [m for m in stored if m.get("structure") in PAYLOADS]
        shown = sorted(payload_packets, key=lambda m: (m["time"], m["apid"]))[:6]
        rows += [[m["time"], m["source"], describe(m)] for m in shown]
        for text in table(rows, indent="          "):
            self.display.line(text)
        if len(payload_packets) > len(shown):
            self.display.note(f"and {len(payload_packets) - len(shown)} more")

    def has_lane(self):
        return any(node["name"] == "image_processing" for node in self.flight.up_report["nodes"])

    def begin_lane(self):
        """Flight does not wait for the image lane: `srfs up` does, as long as it makes progress."""
        self.wait_until(lambda: not self.flight.coming, LANE_SOON_S)
        if self.flight.coming:
            self.display.note(f"{', '.join(self.flight.coming)} will join later; the picture is taken then")
            self.lane = self.flight.start_rest()
        else:
            self.begin_picture()

    def await_lane(self):
        """Until the nodes that were not waited for are there, or make no more progress."""
        if self.lane is None:
            return
        self.display.step(f"Waiting for {', '.join(self.flight.coming) or 'the image lane'}")
        begin_ns = time.monotonic_ns()
        while self.lane.poll() is None:
            self.signals.pause(0.2)
            self.check_running()
        self.check_running()
        needs = [node["name"] for node in self.flight.up_report["nodes"] if node["name"].startswith("image_")]
        if self.expect(not self.flight.coming, "all nodes are up", needs, begin_ns):
            self.begin_picture()

    def begin_picture(self):
        """A task that is captured, processed and sent down beside everything else; show_picture() looks what became of it."""
        self.picture_line = None
        if not self.has_lane() or "camera" not in deployments.read(self.flight.deployment)["devices"]:
            return  # this deployment takes no pictures
        self.display.step("A picture: frames of the sky, searched for debris on board while the rest goes on")
        self.picture_task = int(time.time())  # a new one, also in a folder that has flown before
        self.flight.control({"camera": {"pass": True}})  # debris crosses the field
        # It turns while it flies this script: a short exposure, and room for what the stars' trails look like.
        settings = f"exposure_us=10000 gain_db=20 frames=8 interval_ms=100 method={PICTURE_METHOD} budget_octets=400000"
        self.picture_begin_ns = time.monotonic_ns()
        self.picture_line = self.ground.send(f"tc image.capture task={self.picture_task} {settings}")
        accepted = self.ground.wait_for(lambda m: m["type"] == "tc_stage" and m["line"] == self.picture_line and m["stage"] == "accepted", ANSWER_DEADLINE_S)
        self.expect(accepted, f"task {self.picture_task} is accepted")

    def product(self, name):
        """A product of the picture's task on the ground, None until it is there."""
        found = sorted((self.flight.var / "ground" / "files").glob(f"image_*_{self.picture_task:010}_{name}"))
        return found[0] if found else None

    def show_picture(self):
        if self.picture_line is None:
            self.await_lane()
        if self.picture_line is None:
            return
        self.display.step("The picture's products, the most important first")
        for further in range(PICTURE_TRIES - 1, -1, -1):
            counts = self.await_products()
            if counts is None:
                return
            if counts["tracklets"] or not further:
                break
            # On a machine that is too busy the frames come late, and the debris is out of the field, or the field has turned away.
            self.display.note("the debris was not in enough of the frames: another pass")
            self.begin_picture()
        self.expect(counts["tracklets"], "the debris that crossed the field was found on board", IMAGE_NODES, self.picture_begin_ns)
        self.picture = self.draw_picture(self.product("thumbnail.png"))
        self.display.note(f"picture: {self.picture}")

    def await_products(self):
        """How many streaks and tracklets the findings of the task list; None when its products did not come."""
        outcome = self.ground.outcome(self.picture_line, PICTURE_DEADLINE_S) or {}
        said = f"image.capture: {self.story(self.picture_line)}"
        if not self.expect(outcome.get("stage") == "completed", said, IMAGE_NODES, self.picture_begin_ns):
            return None
        self.wait_until(lambda: self.product("findings.json") and self.product("thumbnail.png"), PICTURE_DEADLINE_S)
        findings, thumbnail = self.product("findings.json"), self.product("thumbnail.png")
        if not self.expect(findings and thumbnail, "findings and thumbnail are on the ground", IMAGE_NODES, self.picture_begin_ns):
            return None
        found = json.loads(findings.read_text())
        counts = {name: len(found.get(name) or []) for name in ("streaks", "tracklets")}
        self.display.note(f"{len(found.get('frames') or [])} frames; streaks: {counts['streaks']}, tracklets: {counts['tracklets']}")
        return counts

    def draw_picture(self, thumbnail):
        """The frames with what was found drawn over them, as the simulated disk has them; else the thumbnail that came down."""
        folder = self.flight.var / "demo"
        folder.mkdir(exist_ok=True)
        picture = folder / f"task_{self.picture_task}.png"
        frames = sorted((self.flight.var / "images" / "frames" / f"{self.picture_task:010}").glob("*.fits"))
        detect = self.flight.bin_dir / "srfs-detect"
        if frames and detect.exists():
            command = [str(detect), "--method", PICTURE_METHOD, "--draw", str(picture), *map(str, frames)]
            drawn = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=PICTURE_DEADLINE_S, check=False)
            if drawn.returncode == 0 and picture.exists():
                return picture
        shutil.copyfile(thumbnail, picture)
        return picture

    def show_beacon(self):
        self.display.step("The beacon, sent unasked every 30 s")
        needed = {node["name"] for node in self.flight.up_report["nodes"]} - set(self.flight.coming)
        active = lambda m: {key.removeprefix("node_state.") for key, value in m["fields"].items() if key.startswith("node_state.") and value == "active"}  # noqa: E731
        # A node that has just joined, or come back, stands in the next one.
        beacon = (self.ground.wait_for(lambda m: m["type"] == "beacon" and needed <= active(m), BEACON_DEADLINE_S)
                  or self.ground.find(lambda m: m["type"] == "beacon"))  # fmt: skip
        if not self.expect(beacon, "a beacon comes"):
            return
        f = beacon["fields"]
        states = {key.removeprefix("node_state."): value for key, value in f.items() if key.startswith("node_state.")}
        self.display.note(f"mode {f['mode']} ({f['mode_reason']}), boot {f['boot_count']}, reset cause {f['reset_cause']}, "
                          f"time {'valid' if f['time_valid'] else 'not valid'}")  # fmt: skip
        self.display.note(f"battery {f['battery_voltage_v']:.2f} V, {f['battery_charge']:.1f} %; {f['temperature_min_k']:.1f} to {f['temperature_max_k']:.1f} K")
        self.display.note("nodes: " + ", ".join(f"{node} {state}" for node, state in states.items() if state != "absent"))
        self.expect(needed <= active(beacon), f"{len(active(beacon))} nodes are active")

    def fly(self):
        self.first_contact()
        self.begin_lane()
        self.watch(self.watch_s, "Watching the rotation: every tick another payload has the CAN bus")
        self.switch_a_load()
        self.refuse_an_argument()
        self.set_setpoint()
        self.set_mode()
        self.noise_on_the_line()
        noise_ended = self.ground.position()
        self.change_interval()
        self.watch(self.watch_s, "Watching on")
        self.retrieve(noise_ended)  # what came live during the noise may be incomplete
        self.show_picture()
        self.show_beacon()

    def next_slots(self):
        """Of each telecommand to a payload: did its CAN frame come within the payload's next slot, and when was it sent? None without a record."""
        lines = self.flight.can_log(until_ns=time.monotonic_ns())
        if not lines:
            return None
        frames = can_frames.command_frames(lines)
        return [
            can_frames.next_slot_fact(self.ground.sent_ns[line], payload, dict(self.rotation.telecommands), self.rotation.slots_of(payload), frames)
            | {"sent_ns": self.ground.sent_ns[line]}
            for line, payload in self.sent_to_payloads
        ]

    # --- the end --------------------------------------------------------------------------------------------------------

    def summarise(self):
        """Asks for the last counters and returns the summary as one JSON object."""
        counters = {name: self.ground.fresh(name) or {} for name in ("timing", "can_switcher", "ttc")}
        slots = self.slot_counters()
        status = self.settled_status()
        stats = self.ground.stats() or {}
        finals = self.ground.select(lambda m: m["type"] == "tc_stage")
        stage_count = lambda *stages: sum(1 for m in finals if m["stage"] in stages)  # noqa: E731
        slot_facts = self.next_slots()
        blocked, unexplained = self.rotation.skipped()
        switcher, ttc = counters["can_switcher"], counters["ttc"]
        latencies = self.rotation.flag_latencies_us
        summary = {
            "ticks": counters["timing"].get("ticks", 0),
            "slots": slots,
            "telecommands": {
                "sent": stats.get("telecommands_sent", 0),
                "accepted": stage_count("accepted"),
                "completed": stage_count("completed"),
                "rejected": stage_count("rejected"),
                "failed": stage_count("start_failed", "progress_failed", "failed"),
                "unanswered": stage_count("timed_out"),  # in the noise
            },
            "tm_frames": stats.get("frames", 0),
            "tm_packets": stats.get("packets", 0),
            "bad_frames": stats.get("bad_frames", 0) - self.noise["bad_frames"],
            "lost_frames": stats.get("lost_frames", 0) - self.noise["lost_frames"],
            "during_noise": self.noise,
            "node_restarts": self.flight.restarts(),
            "picture": self.picture and str(self.picture),
            "machine": self.witness.end(),
            "waited_s": {name: round(seen["waited_s"], 3) for name, seen in self.waiting.end().items()},
            "measures": {
                "all_active_ms": self.flight.up_report["took_ms"],
                "flag_latency_us": {"p50": switcher.get("flag_latency_p50_us"), "p99": switcher.get("flag_latency_p99_us"),
                                    "max": switcher.get("flag_latency_max_us")},
                "tick_to_flag_at_recorder_us": {**quantiles(latencies), "samples": len(latencies)},
                "acceptance_latency_us": {"p50": ttc.get("acceptance_latency_p50_us"), "p99": ttc.get("acceptance_latency_p99_us"),
                                          "max": ttc.get("acceptance_latency_max_us")},
                "next_slot_by_can_frame": self.next_slot_measure(slot_facts),
                "overlapping_grants": self.rotation.overlaps(),
                "ends_lost_by_the_recorder": self.rotation.undecided(),
                "skipped_slots": {"bus_held": blocked, "unexplained": unexplained},
                "recorded": {"ticks": len(self.rotation.ticks), "missed_ticks": self.rotation.missed_ticks(), "slots": self.rotation.slots()},
                "pss_kib": self.flight.memory_kib(),
            },
        }  # fmt: skip
        self.judge(summary, status, slot_facts)
        return summary

    def settled_status(self):
        """`srfs status` once every node that flight needs is Active; as it is after ANSWER_DEADLINE_S."""
        end = time.monotonic() + ANSWER_DEADLINE_S
        while True:
            self.check_running()
            status = [node for node in self.flight.status() if node["name"] not in self.flight.coming]
            if all(node["state"] == "active" for node in status) or time.monotonic() > end:
                return status

    @staticmethod
    def next_slot_measure(facts):
        if facts is None:
            return None
        return {
            "checked": len(facts),
            "in_next_slot": sum(fact["in_next_slot"] for fact in facts),
            "longest_ms": max((fact["frame_after_ms"] or 0 for fact in facts), default=None),
            "late": [f"{fact['payload']}: {fact['why']}" for fact in facts if not fact["in_next_slot"]],
        }

    def judge(self, summary, status, slot_facts):
        self.display.step("Summing up")
        measures = summary["measures"]
        for node in status:
            self.expect(node["state"] == "active", f"{node['name']} is {node['state']}")
        self.display.note(describe_lateness(summary["machine"]))
        self.display.note(describe_waiting(self.waiting.end()))
        excuses = Excuses(self.witness.end(), self.waiting.end())
        unexplained = {what for what, *times in self.questioned if not self.excuse(excuses, what, *times)}
        self.failures += sorted(unexplained)
        for payload in PAYLOADS:
            self.judge_slots(excuses, payload, summary["slots"][payload])
        self.expect(summary["bad_frames"] == 0, f"{summary['bad_frames']} bad TM frames outside the noise")
        explained = sum("was restarted" in text for text in self.excused)
        self.expect(summary["node_restarts"] <= explained, f"{summary['node_restarts']} node restarts")
        self.expect(measures["overlapping_grants"] == 0, f"{measures['overlapping_grants']} overlapping grants")
        skips = [at for at in self.rotation.skips() if not self.excuse(excuses, "a slot was skipped", ("srfs", *BUS_NODES), at - SLOT_MARGIN_NS, at + SLOT_MARGIN_NS)]
        self.expect(not skips, f"{len(skips)} slots skipped without cause")
        if slot_facts is None:
            self.display.note("the CAN frames are not recorded (simulation.can_log): the payloads' next slots are not judged")
        else:
            late = [f for f in slot_facts if not f["in_next_slot"] and not self.excuse(
                excuses, f"{f['payload']}: {f['why']}", (f["payload"], "ttc", "srfs", "srfs-ground", *BUS_NODES),
                f["sent_ns"], f["sent_ns"] + int(1e6 * (f["frame_after_ms"] or 1000)))]  # fmt: skip
            frames = measures["next_slot_by_can_frame"]
            self.expect(slot_facts and not late, f"next slot by CAN frame: {frames['in_next_slot']} of {frames['checked']} {'; '.join(frames['late'])}".rstrip())
        if self.excused:
            self.display.note(f"excused, because this machine was busy: {len(self.excused)}")
            for text in self.excused[:EXCUSES_SHOWN]:
                self.display.note(f"  {text}")
        summary["excused"] = self.excused
        summary["failures"] = self.failures
        summary["ok"] = not self.failures

    def excuse(self, excuses, what, needs, begin_ns, end_ns):
        """Whether what went wrong is the machine's fault; reports it then."""
        why = excuses.find(needs, begin_ns, end_ns)
        if why:
            self.excused.append(f"{what}: {why}")
        return why is not None

    def judge_slots(self, excuses, payload, slots):
        before = self.slots_before.get(payload) or {"granted": 0, "used": 0, "handed_back": 0}
        if slots["granted"] < before["granted"]:  # it was restarted and counts anew
            before = {"granted": 0, "used": 0, "handed_back": 0}
        lost = sum(sign * (slots[name] - before[name]) for name, sign in (("granted", 1), ("used", -1), ("handed_back", -1)))
        needs = (payload, "srfs", *BUS_NODES)
        failed = self.rotation.failed_slots(payload)
        unexplained = [slot for slot in failed if not self.excuse(excuses, f"a slot of {payload} failed", needs, slot["published"] - SLOT_MARGIN_NS,
                                                                  slot["lease_end"] + SLOT_MARGIN_NS)]  # fmt: skip
        self.expect(slots["used"] > 0 and not unexplained and lost <= len(failed) + SLOTS_UNDER_WAY,
                    f"{payload} used {slots['used']} of {slots['granted']} slots, gave {slots['handed_back']} back while it started, "
                    f"{len(failed) - len(unexplained)} excused")  # fmt: skip

    def show(self, summary):
        m = summary["measures"]
        t = summary["telecommands"]
        slot = m["next_slot_by_can_frame"]
        us = lambda value: "-" if value is None else f"{value / 1000:.2f}"  # noqa: E731
        rows = [["", "", ""]]
        rows += [["ticks", f"{summary['ticks']}", ""]]
        rows += [["slots used / granted", f"{s['used']} / {s['granted']}", p] for p, s in summary["slots"].items()]
        rows += [["telecommands sent", f"{t['sent']}", f"{t['accepted']} accepted, {t['completed']} completed, {t['rejected']} rejected, "
                  f"{t['failed']} failed, {t['unanswered']} unanswered"],
                 ["TM frames / packets", f"{summary['tm_frames']} / {summary['tm_packets']}", f"{summary['bad_frames']} bad, "
                  f"{summary['lost_frames']} lost outside the noise"],
                 ["node restarts", f"{summary['node_restarts']}", ""],
                 ["excused", f"{len(summary['excused'])}", "late or lost while the processes concerned waited for a CPU"],
                 ["waited for a CPU", f"{sum(summary['waited_s'].values()):.1f} s", "all processes; hw_sim " f"{summary['waited_s'].get('hw_sim', 0):.1f} s"],
                 ["needed nodes Active after", f"{m['all_active_ms']} ms", "of srfs up"],
                 ["flag after tick, p50 / p99", f"{us(m['flag_latency_us']['p50'])} / {us(m['flag_latency_us']['p99'])} ms", "in the switcher"],
                 ["", f"{us(m['tick_to_flag_at_recorder_us']['p50'])} / {us(m['tick_to_flag_at_recorder_us']['p99'])} ms", "tick sent to flag heard, at the recorder"],
                 ["last octet to 1,1, p50 / p99", f"{us(m['acceptance_latency_us']['p50'])} / {us(m['acceptance_latency_us']['p99'])} ms", "in ttc, upper bounds"],
                 ["next slot by CAN frame", f"{slot['in_next_slot']} of {slot['checked']}" if slot else "-",
                  f"octets on the line to CAN frame at most {slot['longest_ms']:.0f} ms" if slot and slot["longest_ms"] else ""],
                 ["overlapping grants", f"{m['overlapping_grants']}", f"{m['ends_lost_by_the_recorder']} undecided" if m["ends_lost_by_the_recorder"] else ""],
                 ["skipped slots", f"{m['skipped_slots']['unexplained']}", f"and {m['skipped_slots']['bus_held']} while the bus was held"]]  # fmt: skip
        rows += [["memory (PSS)", "-" if kib is None else f"{kib / 1024:.1f} MiB", node] for node, kib in m["pss_kib"].items()]
        for text in table(rows)[1:]:
            self.display.line(text)
        self.display.line("")
        self.display.line("Operate it yourself, in a browser: ./run sim --web")


def parse(arguments=None):
    parser = argparse.ArgumentParser(prog="./run demo", description="Flies the simulated spacecraft with a scripted operator.")
    parser.add_argument("--duration", type=float, default=40, metavar="S", help=f"approximate length, at least {SHORTEST_S} s (default: %(default)s s)")
    add_flight_options(parser)
    parser.add_argument("--json", action="store_true", help="print only the last line: the summary as JSON")
    options = parser.parse_args(arguments)
    if options.duration < SHORTEST_S:
        parser.error(f"--duration: expected at least {SHORTEST_S}")
    return options


def fly(options, display, signals):
    """Flies the demo beside its witnesses. Returns the summary."""
    with Lateness() as witness, Waiting(options.var.absolute()) as waiting:
        return fly_beside(options, display, signals, witness, waiting)


def fly_beside(options, display, signals, witness, waiting):
    flight = mission.Mission(options.var, options.deployment, options.bin, display.line, wait_for_all=False)
    display.step("Starting the simulated spacecraft and the suite")
    flight.start()
    demo = Demo(flight, display, signals, options.duration, witness, waiting)
    summary = {}
    try:
        display.note(f"{len(flight.up_report['nodes']) - len(flight.coming)} nodes Active after {flight.up_report['took_ms']} ms, DDS domain {flight.domain}, "
                     f"operator's port {flight.var / 'rs422'}")  # fmt: skip
        demo.connect()
        demo.fly()
        summary = demo.summarise()
    except Interrupted:
        demo.failures.append("interrupted by the user")
    except MissionError as error:
        demo.failures.append(str(error))
    finally:
        display.live("")
        left = flight.stop()
    demo.failures += [f"left behind: {text}" for text in left]
    summary["failures"] = demo.failures
    summary["ok"] = not demo.failures
    if "measures" in summary:
        demo.show(summary)
    return summary


def main():
    options = parse()
    display = Display(quiet=options.json)
    signals = StopSignals()
    try:
        summary = fly(options, display, signals)
    except MissionError as error:
        print(f"demo: {error}", file=sys.stderr)
        print(json.dumps({"ok": False, "failures": [str(error)]}), flush=True)
        return error.code
    for failure in summary["failures"]:
        print(f"not as expected: {failure}", file=sys.stderr)
    print(json.dumps(summary), flush=True)
    return 0 if summary["ok"] else 1


if __name__ == "__main__":
    sys.exit(main())
