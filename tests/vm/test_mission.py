# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A short mission on a virtual CAN interface: the whole suite and the simulated peripherals, candump as recorder, cangen as disturbance.

Needs root and a kernel with CAN; ./run vm-test runs it. The processor may be emulated, so no test judges a duration. SRFS_PATIENCE
stretches the deadlines. SRFS_VM_FULL=1: a longer mission.
"""

import itertools
import os
import pathlib
import shutil
import socket
import subprocess
import tempfile
import threading
import time
import unittest

from srfs.flight import deployments, mission
from srfs.flight.deployments import PAYLOADS
from srfs.flight.processes import PATIENCE, kib_of, wait_until
from srfs.record import can_frames
from srfs.record.rotation import Rotation

FULL = os.environ.get("SRFS_VM_FULL") == "1"
BIN = pathlib.Path(os.environ["SRFS_BIN"])
PATIENCE_S = 90 * PATIENCE
SLOTS = 100 if FULL else 4  # per payload, in each check of the rotation
CLOCK_ERROR_NS = 2_000_000  # between the two clocks, in case the host's clock is slewed meanwhile
LAST_CPU = pathlib.Path("/sys/devices/system/cpu/cpu1/online")
MAY_UNPLUG = os.environ.get("SRFS_IN_GUEST") == "1" and LAST_CPU.exists()  # never a CPU of a real machine
SETPOINT_FRAME = "2102014391C000"  # function 2, heater 1, 291.5 K: the frame behind the first one (docs/reference/icd_can.md, section 3)
REAL_TIME_KERNEL = pathlib.Path("/sys/kernel/realtime").exists()


def ip(*words):
    subprocess.run(["ip", "link", *words], check=True)


def start(command, output=subprocess.DEVNULL, errors=subprocess.DEVNULL):
    return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=errors)


def kernel_pulse_device():
    """/dev/ppsN of pps_parport on QEMU's parallel port (run_tests.py loads it); None if there is none."""
    for entry in pathlib.Path("/sys/class/pps").glob("pps*"):
        if (entry / "name").read_text().strip() == "pps_parport":
            return f"/dev/{entry.name}"
    return None


class PulseWire:
    """Passes the simulated receiver's pulses to the parallel port, whose interrupts the kernel timestamps."""

    def __init__(self, source):
        self.pulses = 0
        self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket.connect(str(source))
        self._port = os.open("/dev/port", os.O_WRONLY)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self):
        while self._socket.recv(64):
            os.pwrite(self._port, b"\x1c", 0x378 + 2)  # control register: initialised, selected, interrupts, no strobe
            self.pulses += 1

    def close(self):
        self._socket.shutdown(socket.SHUT_RDWR)
        self._thread.join()
        self._socket.close()
        os.close(self._port)


class Flight:
    """What all tests share: interface, recorder, disturbance, spacecraft and ground."""

    def __init__(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="srfs-vm-mission-"))
        self.interface = f"sv{os.getpid()}"
        self.programs = []
        self.mission = None
        self.pulse_wire = None
        self.pulse_device = kernel_pulse_device()

    def write_deployments(self, nodes, simulator):
        """Writes vcan.yaml for this interface. The nodes use the kernel's pulses if it has a pulse device, and a board's priorities if it is a
        real-time kernel."""
        deployment = deployments.read("vcan")
        deployment["devices"]["can"] = f"socketcan:{self.interface}"
        deployments.write(deployment, simulator)
        if self.pulse_device:
            deployment["devices"]["gps_pulse"] = f"pps:{self.pulse_device}"
        if REAL_TIME_KERNEL:
            deployments.scheduled(deployment, deployments.realtime())
            for node in deployment["nodes"]:
                node["memory"] = {"lock": True}
        deployments.write(deployment, nodes)

    def start(self):
        ip("add", self.interface, "type", "vcan")
        ip("set", self.interface, "up")
        deployment, simulated = self.folder / "vcan.yaml", self.folder / "simulated.yaml"
        self.write_deployments(deployment, simulated)
        # Records ISO-TP frames only; the interface counts the disturbance. -D: candump continues when the interface goes down.
        with open(self.folder / "candump.log", "wb") as log:
            self.candump = start(["candump", "-D", "-L", "-r", "4000000", f"{self.interface},18DA0000:1FFF0000"], log)
        self.programs.append(self.candump)
        self.mission = mission.Mission(self.folder / "var", deployment, BIN, print)
        self.mission.simulated = simulated
        self.mission.start()
        if self.pulse_device:
            self.pulse_wire = PulseWire(self.mission.run_dir / "gps_pulse.sock")
        self.ground = self.mission.ground()
        self.recorder = self.mission.recorder()
        self.rotation = Rotation()
        self.recorder.on_message(self.rotation.on_message)

    def stop(self):
        """Ends everything. Returns what the mission left behind."""
        if self.pulse_wire:
            self.pulse_wire.close()
        left = self.mission.stop() if self.mission and self.mission.up_report else []
        for program in self.programs:
            program.kill()
            program.wait()
        if pathlib.Path("/sys/class/net", self.interface).exists():
            ip("del", self.interface)
        return left

    def frames_on_the_bus(self):
        return int(pathlib.Path("/sys/class/net", self.interface, "statistics", "tx_packets").read_text())

    def disturb(self):
        """Sends foreign frames at about the full load of a 500 kbit/s bus: any standard or extended identifier, any length, remote frames too."""
        kinds = (["-I", "r"], ["-e", "-I", "r"], ["-e", "-R", "-I", "r"])
        with open(self.folder / "cangen.log", "ab") as errors:
            generators = [start(["cangen", self.interface, "-i", "-g", "0.5", "-L", "r", "-D", "r", *kind], errors=errors) for kind in kinds]
        self.programs += generators
        return generators

    def candump_lines(self):
        return (self.folder / "candump.log").read_text(errors="replace").splitlines()

    def wait_for_slots(self, count, why):
        """Waits until each payload has used `count` more slots."""
        before = {payload: self._used(payload) for payload in PAYLOADS}
        wait_until(lambda: all(self._used(p) - before[p] >= count for p in PAYLOADS), PATIENCE_S + 3 * count, f"{count} more slots of each payload, {why}")

    def _used(self, payload):
        return self.rotation.slots().get(payload, {}).get("used", 0)

    def check_processes(self):
        news, _ = self.mission.news_of_processes()
        return news


flight = None


def setUpModule():
    global flight
    flight = Flight()
    try:
        flight.start()
    except BaseException:
        mission.show_logs(flight.folder / "var")
        tearDownModule()
        raise


def tearDownModule():
    left = flight.stop()
    if left:
        mission.show_logs(flight.folder / "var")
    shutil.rmtree(flight.folder, ignore_errors=True)
    if left:
        raise AssertionError("left behind: " + ", ".join(left))


class MissionOnVcan(unittest.TestCase):
    """One flight for all tests, which pass in any order."""

    def tearDown(self):
        self.assertEqual(flight.check_processes(), [], "no node may end or be restarted")
        if not self._outcome.success:
            mission.show_logs(flight.folder / "var")

    def test_telemetry_of_every_payload_arrives_at_the_ground(self):
        for payload in PAYLOADS:
            self.assertIsNotNone(flight.ground.housekeeping(payload, PATIENCE_S, 0), payload)

    def test_the_kernel_hands_a_payload_only_the_frames_of_its_own_transfers(self):
        lists = {name: pathlib.Path("/proc/net/can", name).read_text().splitlines() for name in ("rcvlist_eff", "rcvlist_all", "rcvlist_fil")}
        of_raw_sockets = {name: [line.split() for line in lines if flight.interface in line and line.endswith("raw")] for name, lines in lists.items()}
        for address in (0x11, 0x12, 0x13):
            for identifier in (0x98DA0100 | address, 0x98DA0001 | address << 8):
                self.assertIn(f"{identifier:08x}", [words[1] for words in of_raw_sockets["rcvlist_eff"]])
        self.assertEqual(len(of_raw_sockets["rcvlist_all"]), 1, "can_switcher's, which measures the load")
        # Two for each of three payloads and four peripherals: frames to it, and its echoes.
        self.assertEqual(len(of_raw_sockets["rcvlist_eff"]), 14)
        self.assertEqual(len(of_raw_sockets["rcvlist_fil"]), 1, "candump's")

    def test_the_rotation_goes_on_under_foreign_traffic(self):
        generators = flight.disturb()
        frames, began = flight.frames_on_the_bus(), time.monotonic()
        flight.wait_for_slots(SLOTS, "with foreign traffic")
        rate = (flight.frames_on_the_bus() - frames) / (time.monotonic() - began)
        said = (flight.folder / "cangen.log").read_text()
        ended = [generator.args + [generator.returncode] for generator in generators if generator.poll() is not None]
        self.assertLess(len(ended), len(generators), f"no traffic any more: {ended}, {said}")
        if ended:
            print(f"cangen ended: {ended}, {said}", flush=True)
        for generator in generators:
            generator.kill()
            generator.wait()
        print(f"{rate:.0f} frames a second meanwhile; 500 kbit/s carry about 3800", flush=True)

    def test_a_telecommand_is_executed_in_the_payloads_slot(self):
        generators = flight.disturb()
        since = flight.ground.position()
        outcome = flight.ground.command("tc thermal.set_setpoint heater=1 setpoint_k=291.5", PATIENCE_S)
        self.assertIsNotNone(outcome, "no outcome")
        self.assertEqual(outcome.get("stage"), "completed", outcome)
        for generator in generators:
            generator.kill()
            generator.wait()
        told = flight.ground.housekeeping("payload_thermal", PATIENCE_S, since, lambda fields: fields["setpoint_k[1]"] == 291.5)
        self.assertIsNotNone(told, "the telemetry does not say so")
        lines = flight.candump_lines()
        sent = [frame for frame in can_frames.computer_frames(lines) if frame.payload == "payload_thermal"]
        # Modes may order something, too: ours is known by its arguments.
        first_frames = {first.at for first, second in itertools.pairwise(sent) if second.data.startswith(SETPOINT_FRAME)}
        commands = [times for (payload, _), times in can_frames.command_frames(lines).items() if payload == "payload_thermal" and first_frames & set(times)]
        self.assertEqual(len(commands), 1, "one telecommand on the bus")
        self.judge([(at, "payload_thermal") for at in commands[0]], at_least=1)

    def test_the_suite_survives_that_the_interface_goes_down_and_up(self):
        for _ in range(10 if FULL else 1):
            since = flight.recorder.position()
            ip("set", flight.interface, "down")
            failed = flight.recorder.wait_for(lambda m: m["type"] == "bus" and m["status"] == "failed", PATIENCE_S, since)
            self.assertIsNotNone(failed, "a payload says that its slot failed")
            ip("set", flight.interface, "up")
            flight.wait_for_slots(2, "after the interface came back")

    @unittest.skipUnless(MAY_UNPLUG, "no virtual machine with a second CPU that can be unplugged")
    def test_a_cpu_that_goes_and_comes_back_restarts_no_node(self):
        self.addCleanup(LAST_CPU.write_text, "1")
        for state in ("0", "1"):
            LAST_CPU.write_text(state)
            flight.wait_for_slots(SLOTS, f"after cpu1 got {state} as its state")

    @unittest.skipUnless(kernel_pulse_device(), "this kernel has no pulse device that we can drive")
    def test_timing_follows_pulses_that_the_kernel_stamped(self):
        seen = flight.ground.housekeeping("timing", PATIENCE_S, None, lambda fields: fields["time_valid"] and fields["sync_state"] != "unlocked")
        self.assertIsNotNone(seen, "timing does not follow the pulse")
        told = seen["fields"]
        print(f"{told['pulses_seen']} pulses of the kernel, {told['pulse_outliers']} outliers; {told['sync_state']}, offset {told['offset_us']:.0f} us", flush=True)
        self.assertLessEqual(told["pulses_seen"], flight.pulse_wire.pulses, "each once")

    @unittest.skipUnless(REAL_TIME_KERNEL, "no kernel with PREEMPT_RT")
    def test_every_node_has_its_priority_and_its_memory_on_a_real_time_kernel(self):
        for name, scheduling in deployments.realtime().items():
            pid = flight.mission.node_pid(name)
            self.assertEqual((os.sched_getscheduler(pid), os.sched_getparam(pid).sched_priority), (os.SCHED_FIFO, scheduling["priority"]), name)
            self.assertGreater(kib_of(f"/proc/{pid}/status", "VmLck"), 1024, name)

    def test_no_two_payloads_ever_shared_a_slot(self):
        now = time.monotonic_ns()
        flight.wait_for_slots(2, "to judge: with the second the recorder knows what it lost")
        frames = can_frames.computer_frames(flight.candump_lines())
        print(f"{flight.rotation.undecided()} ends of slots lost by the recorder", flush=True)
        self.assertEqual(flight.rotation.overlaps(until=now), 0)
        self.judge(frames, at_least=3)

    def judge(self, frames, at_least):
        """Compares the frames recorded by candump with the slots reported on the topics."""
        to_monotonic = time.clock_gettime_ns(time.CLOCK_MONOTONIC) - time.clock_gettime_ns(time.CLOCK_REALTIME)
        # Slots under way are not recorded yet: wait for the ones to be judged.
        wait_until(lambda: flight.rotation.recorded_slots()[-1]["published"] > max(frames)[0] + to_monotonic, PATIENCE_S, "the next slot")
        good, wrong = can_frames.judge_slots([(at + to_monotonic, payload) for at, payload, *_ in frames], flight.rotation.recorded_slots(), CLOCK_ERROR_NS)
        self.assertEqual(wrong, [])
        self.assertGreaterEqual(good, at_least)
        print(f"{good} of {len(frames)} frames of the computer were in their sender's recorded slot, none in another", flush=True)


def load_tests(loader, tests, pattern):
    """Runs the tests in the order of a flight; the one that judges the whole flight comes last."""
    story = ("telemetry_of_every_payload_arrives_at_the_ground", "the_kernel_hands_a_payload_only_the_frames_of_its_own_transfers",
             "timing_follows_pulses_that_the_kernel_stamped", "every_node_has_its_priority_and_its_memory_on_a_real_time_kernel",
             "the_rotation_goes_on_under_foreign_traffic", "a_telecommand_is_executed_in_the_payloads_slot",
             "the_suite_survives_that_the_interface_goes_down_and_up", "a_cpu_that_goes_and_comes_back_restarts_no_node", "no_two_payloads_ever_shared_a_slot")  # fmt: skip
    return unittest.TestSuite(MissionOnVcan(f"test_{name}") for name in story)


if __name__ == "__main__":
    unittest.main(verbosity=2)
