# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs record --mcap` and `srfs play`, read by a reader that shares nothing with them (mcap_file.py)."""

import signal
import subprocess
import time
import unittest

import mcap_file
from support import BIN, SystemTest

from srfs.flight.mission import Mission
from srfs.flight.processes import wait_until


class McapTest(SystemTest):
    def test_a_flight_is_recorded_and_played_and_survives_a_kill_of_the_recorder(self):
        self.flight = self.enterContext(Mission(self.var, "sim", BIN))
        file, content = self.check_recording()
        self.check_playing(file, content)
        self.check_killed_recorder()

    def start_recording(self, file, *options):
        command = [BIN / "srfs", "record", "--mcap", file, "--var", self.var, *map(str, options)]
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        self.addCleanup(process.kill)
        wait_until(lambda: self.ticks_in(file) >= 5 or process.poll() is not None, 60, "ticks are recorded")
        return process

    @staticmethod
    def ticks_in(file):
        return len(mcap_file.scan(file.read_bytes())[0].of("/timing/tick")) if file.exists() and file.stat().st_size > 8 else 0

    def check_recording(self):
        """Records with definitions and index. Returns the file and what it holds."""
        file = self.folder / "flight.mcap"
        process = self.start_recording(file)
        process.send_signal(signal.SIGINT)
        said, errors = process.communicate(timeout=60)
        self.assertEqual(process.returncode, 0, errors)
        octets = file.read_bytes()
        content, whole = mcap_file.scan(octets)
        self.assertTrue(whole)
        self.assertLessEqual({"/timing/tick", "/can/task_flags", "/can/bus_status", "/liveness", "/rosout"}, content.topics())
        self.assertFalse([topic for topic in content.topics() if "/_" in topic])
        self.assertIn(f"{len(content.messages)} messages of {len(content.topics())} topics", said)
        for number, topic, encoding, metadata in content.channels.values():
            name, schema_encoding, definition = content.schemas[number]
            self.assertEqual((encoding, schema_encoding), ("cdr", "ros2msg"), (topic, name))
            self.assertTrue(definition and "reliability: 1" in metadata["offered_qos_profiles"])
        sequences = [m.sequence for m in content.of("/timing/tick")]
        self.assertEqual(sequences, list(range(sequences[0], sequences[0] + len(sequences))), "none is missing")
        indexed = mcap_file.Indexed(octets)
        key = lambda m: (m.channel, m.sequence, m.log_time)  # noqa: E731
        self.assertEqual(sorted(map(key, indexed.messages)), sorted(map(key, content.messages)))

        listed = {topic["topic"]: topic for topic in self.flight.srfs_json("topics")}
        self.assertLessEqual(content.topics(), set(listed))
        self.assertEqual((listed["/timing/tick"]["type"], listed["/timing/tick"]["publishers"]), ("srfs_msgs/msg/TimeTick", 1))
        return file, content

    def check_playing(self, file, content):
        octets, again = file.read_bytes(), self.folder / "again.mcap"
        self.assertEqual(self.flight.srfs("record", "--mcap", file).returncode, 1, "the file exists")
        self.assertEqual(file.read_bytes(), octets)
        refused = self.flight.srfs("play", file, "--domain", self.flight.domain)
        self.assertEqual(refused.returncode, 2, refused.stderr)
        domain = self.flight.domain + 100
        listener = subprocess.Popen([BIN / "srfs", "record", "--mcap", again, "--domain", str(domain), "--topic", "/timing/tick"],
                                    stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)  # fmt: skip
        self.addCleanup(listener.kill)
        wait_until(again.exists, 60, "the second recorder has begun")
        played = subprocess.run([BIN / "srfs", "play", file, "--domain", str(domain), "--rate", "2", "--wait", "3000"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
        self.assertEqual(played.returncode, 0, played.stderr)
        self.assertIn(f"{len(content.messages)} of {len(content.messages)} messages published", played.stdout)
        wait_until(lambda: self.ticks_in(again) >= len(content.of("/timing/tick")), 60, "all ticks are recorded again")
        listener.send_signal(signal.SIGINT)
        listener.communicate(timeout=60)
        heard, _ = mcap_file.scan(again.read_bytes())
        self.assertEqual([m.data for m in heard.of("/timing/tick")], [m.data for m in content.of("/timing/tick")])

    def check_killed_recorder(self):
        """What is older than its last chunk is there."""
        file = self.folder / "killed.mcap"
        process = self.start_recording(file)
        time.sleep(0.5)
        process.kill()
        process.communicate()
        octets = file.read_bytes()
        content, whole = mcap_file.scan(octets)
        self.assertFalse(whole)
        ticks = [m.sequence for m in content.of("/timing/tick")]
        self.assertEqual(ticks, list(range(ticks[0], ticks[0] + len(ticks))))
        for end in range(9, len(octets), max(1, len(octets) // 500)):  # at any octet
            part, _ = mcap_file.scan(octets[:end])
            self.assertEqual([m.sequence for m in part.of("/timing/tick")], ticks[: len(part.of("/timing/tick"))])


if __name__ == "__main__":
    unittest.main()
