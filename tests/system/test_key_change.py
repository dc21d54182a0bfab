# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Link keys replaced in flight (SDLS Extended Procedures): whatever is cut or killed, the next telecommand arrives."""

import shutil
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest, kill

from srfs.flight.processes import wait_until

STEPS = ("on board, under key-encryption key", "active", "verified", "association 1: key")  # as `keys replace` reports them
CUT_LINE = {"rs422": {"flip_probability": 0.2}}
WHOLE_LINE = {"rs422": {"flip_probability": 0}}


class KeyChangeTest(SystemTest):
    def ground(self, *words):
        return [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), *words]

    def prove_contact(self, why):
        """No word of keys: with what the ground has, a telecommand is executed."""
        wait_until(lambda: self.ground_run("ping", "--timeout", "3").returncode == 0, DEADLINE_S, f"contact: {why}")

    def replace_until(self, step, then):
        """Runs `keys replace 1` and calls then(process) when it reports the step. Returns its exit code."""
        with subprocess.Popen(self.ground("keys", "replace", "1", "--timeout", "4"), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, text=True) as process:  # fmt: skip
            said = []
            for line in process.stdout:
                said.append(line)
                if step in line:
                    then(process)
                    step = "\0"
            self.assertEqual(step, "\0", f"the step was reported: {said}")
            return process.wait(DEADLINE_S)

    def replace(self, *words, spi="1"):
        result = self.ground_run(*words, "keys", "replace", spi, "--timeout", "20")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def inventory(self):
        result = self.ground_run("keys", "inventory", "--timeout", "20")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        return result.stdout

    def secrets(self):
        """All octets of keys, as they stand in files."""
        found = {key.read_text().strip() for key in (self.var / "keys").glob("*.key")}
        for copy in (*self.var.glob("ground/session_keys.[01]"), *self.var.glob("keys/session/session_keys.[01]")):
            self.assertEqual(copy.stat().st_mode & 0o777, 0o600, copy)
            found |= {word.split(":")[2] for word in copy.read_text().split() if word.startswith("k")}
        return found

    def assert_no_log_has_a_key(self):
        keys = self.secrets()
        self.assertGreater(len(keys), 7)
        for log in (*(self.var / "log").glob("*.log"), *(self.var / "state").rglob("telecommands.*")):
            text = log.read_bytes()
            for key in keys:
                self.assertNotIn(key.encode(), text, log)
                self.assertNotIn(bytes.fromhex(key), text, log)

    def test_keys_are_replaced_over_cuts_and_kills_and_the_old_ones_end(self):
        with self.flight() as flight:
            self.prove_contact("the keys of the files")
            before = self.folder / "ground_before"
            shutil.copytree(self.var / "ground", before)

            for step in STEPS:
                self.replace_until(step, lambda process: process.kill())
                self.prove_contact(f"the ground was killed after '{step}'")
            for step in STEPS:
                self.replace_until(step, lambda _: kill(flight, "ttc"))
                self.prove_contact(f"ttc was killed after '{step}'")
            for step in STEPS:
                self.replace_until(step, lambda _: flight.control(CUT_LINE))
                flight.control(WHOLE_LINE)
                self.prove_contact(f"the line was cut after '{step}'")

            self.replace()
            self.prove_contact("the replaced key")
            self.assertRegex(self.inventory(), r"key \d+: active on board; association 1 sends under it")
            self.replace("--ad", spi="2")
            self.assertEqual(self.ground_run("--ad", "ping", "--timeout", "20").returncode, 0, "the AD service has its own")
            self.assertRegex(self.inventory(), r"key \d+: active on board; association 2 sends under it")

            old = self.ground_run("--state", str(before), "ping", "--timeout", "3")
            self.assertEqual(old.returncode, 1, "the key of the file: " + old.stdout + old.stderr)
            last_way = self.ground_run("--state", str(before), "--keys", "contingency", "ping", "--timeout", "20")
            self.assertEqual(last_way.returncode, 0, last_way.stdout + last_way.stderr)
            self.assert_no_log_has_a_key()

    def test_the_second_key_encryption_key_works_and_a_ground_that_lost_its_keys_begins_anew_with_the_contingency(self):
        with self.flight() as flight:
            self.prove_contact("the keys of the files")
            result = self.ground_run("keys", "replace", "1", "--master", "2", "--timeout", "20")
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
            self.assertIn("under key-encryption key 2", result.stdout)
            self.prove_contact("the replaced key")

            for copy in self.var.glob("ground/session_keys.[01]"):
                copy.unlink()
            self.assertEqual(self.ground_run("ping", "--timeout", "3").returncode, 1, "the ground has the file's key alone")
            self.replace("--keys", "contingency")
            self.prove_contact("the key after the loss")

            # On board both copies are lost: the contingency key is the last way in, and the only one.
            def lose():
                for copy in self.var.glob("keys/session/session_keys.[01]"):
                    copy.write_text("damaged")

            lose()
            kill(flight, "ttc")
            contact = self.ground_run("--keys", "contingency", "ping", "--timeout", str(DEADLINE_S))
            self.assertEqual(contact.returncode, 0, contact.stdout + contact.stderr)
            self.assertEqual(self.ground_run("ping", "--timeout", "3").returncode, 1, "neither the lost key nor the file's")
            self.replace("--keys", "contingency")
            self.prove_contact("the key after the loss on board")


if __name__ == "__main__":
    unittest.main()
