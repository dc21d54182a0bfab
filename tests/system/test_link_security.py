# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A hardware line is not opened without security or with published keys; hw_sim's line is."""

import secrets
import unittest

from support import ToolTest

LINE = "/dev/srfs_no_such_line"  # below /dev, so not a pseudo-terminal of hw_sim; its absence shows only later
PUBLISHED = {
    "it is zero": "00" * 32,
    "its octets form a sequence, as in published test vectors": bytes(range(32)).hex(),
}


class LinkSecurityTest(ToolTest):
    def write(self, channel):
        self.file = self.folder / "board.yaml"
        self.file.write_text(f"""deployment: board
dds: {{ domain: auto, interfaces: [127.0.0.1] }}
devices: {{ rs422: "serial:{LINE}" }}
link: {{ tc_channels: [{channel}] }}
nodes:
  - {{ name: ttc, executable: ttc_node }}
""")

    def test_without_security_nothing_is_started(self):
        self.write("{ vc: 1, security: none }")
        up = self.srfs("up", "--deadline", "10")
        self.assertEqual(up.returncode, 3, up.stdout + up.stderr)
        self.assertIn(f"TC virtual channel 1 has no security, and serial:{LINE} is a line of hardware", up.stdout + up.stderr)
        self.assertFalse((self.var / "log/ttc.log").exists(), "ttc was not started")
        doctor = self.srfs("doctor")
        self.assertNotEqual(doctor.returncode, 0)
        self.assertRegex(doctor.stdout, r"FAIL.*link\.security.*TC virtual channel 1 has no security")

    def write_keys(self, **keys):
        (self.var / "keys").mkdir(parents=True, mode=0o700, exist_ok=True)
        for name, digits in keys.items():
            key = self.var / "keys" / f"{name}.key"
            key.write_text(digits + "\n")
            key.chmod(0o600)
        self.write(", ".join(f"{{ vc: 0, security: sdls, spi: {spi}, key_file: keys/{name}.key }}" for spi, name in enumerate(keys, 1)))

    def test_with_one_key_that_everybody_may_know_nothing_is_started(self):
        for why, digits in PUBLISHED.items():
            with self.subTest(why):
                self.write_keys(good=secrets.token_hex(32), up=digits)
                up = self.srfs("up", "--deadline", "10")
                self.assertEqual(up.returncode, 3, up.stdout + up.stderr)
                self.assertIn(f"everybody may know the key keys/up.key of TC virtual channel 0 ({why})", up.stdout + up.stderr)
                self.assertFalse((self.var / "log/ttc.log").exists(), "ttc was not started")
                self.assertRegex(self.srfs("doctor").stdout, r"FAIL.*key\.up\.key")

    def start_ttc(self):
        """@return (whether ttc started, its log)"""
        try:
            up = self.srfs("up", "--deadline", "5")
            self.assertIn(up.returncode, (0, 1), up.stdout + up.stderr)
            return up.returncode == 0, (self.var / "log/ttc.log").read_text()
        finally:
            self.assertEqual(self.srfs("down").returncode, 0)

    def test_a_spacecraft_that_ran_loses_the_key_and_not_itself(self):
        (self.var / "state/ttc").mkdir(parents=True)
        (self.var / "state/ttc/mode").write_text("safe\n")
        self.write_keys(up=PUBLISHED["it is zero"])
        up, said = self.start_ttc()
        self.assertFalse(up, "it has no other key")
        self.assertIn("up.key: not used, everybody may know this key: it is zero", said)
        (self.var / "log/ttc.log").unlink()
        self.write_keys(good=secrets.token_hex(32), up=PUBLISHED["it is zero"])
        up, said = self.start_ttc()
        self.assertTrue(up, said)
        self.assertRegex(said, "association 2 is not used: .*up.key: not used, everybody may know this key: it is zero")
        self.assertRegex(self.srfs("doctor").stdout, r"FAIL.*key\.up\.key")


if __name__ == "__main__":
    unittest.main()
