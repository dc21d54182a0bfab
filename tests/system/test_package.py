# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs-ground package` as a payload team calls it: makes, shows, verifies and refuses packages, and uploads them to the running suite."""

import json
import os
import stat
import subprocess
import unittest
from pathlib import Path

from support import BIN, SystemTest, TemporaryFolder

from srfs import ROOT

EXAMPLE = ROOT / "examples/packages/payload_eps.yaml"


def package(*arguments, cwd=None):
    return subprocess.run([BIN / "srfs-ground", "package", *map(str, arguments)], stdin=subprocess.DEVNULL, cwd=cwd,
                          capture_output=True, text=True, timeout=60)  # fmt: skip


class PackageProgramTest(unittest.TestCase):
    def setUp(self):
        folder = TemporaryFolder()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)
        self.seed, self.key = self.folder / "team.seed", self.folder / "package.pub"
        self.assert_done(package("keygen", self.seed, self.key))
        self.sources = self.folder / "impact"
        (self.sources / "lib").mkdir(parents=True)
        (self.sources / "main.cpp").write_text("int main() { return 0; }\n")
        (self.sources / "lib/impact.hpp").write_text("#pragma once\n")
        (self.sources / "notes.txt").write_text("not a source\n")
        self.out = self.folder / "out.pkg"

    def assert_done(self, run):
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        return run.stdout

    def assert_refused(self, run, message, code=2):
        self.assertIn(message, run.stderr)
        self.assertEqual((run.returncode, run.stdout), (code, ""), run.stderr)
        self.assertEqual(len(run.stderr.splitlines()), 1, run.stderr)

    def make(self, *more, sources=None, counter=7, kind="replace"):
        return package("make", "--node", "payload_eps", "--kind", kind, "--counter", counter, "--sources", sources or self.sources,
                       "--key", self.seed, "-o", self.out, *more)  # fmt: skip

    def show(self, *more):
        return json.loads(self.assert_done(package("show", self.out, "--json", *more)))

    def test_makes_shows_and_verifies(self):
        made = self.assert_done(self.make("--option=-O3", "--option=-g", "--self-test", 5, "--probation", 60, "--binary", BIN / "srfs-ground"))
        for text in ("payload_eps, replaced", "-O3 -g", "lib/impact.hpp", "main.cpp", "good"):
            self.assertIn(text, made)
        self.assertNotIn("notes.txt", made)
        shown = self.show()
        self.assertEqual((shown["format"], shown["signature"]), (2, "not checked"))
        self.assertEqual(shown["octets"], self.out.stat().st_size)
        manifest = shown["manifest"]
        self.assertEqual([file["path"] for file in manifest["files"]], ["lib/impact.hpp", "main.cpp"])
        self.assertEqual((manifest["counter"], manifest["self_test_s"], manifest["probation_s"]), (7, 5, 60))
        self.assertEqual(len(manifest["binary_sha256"]), 64)
        self.assertEqual(self.show("--key-public", self.key)["signature"], "good")
        self.assertIn("good: payload_eps, counter 7, 2 files", self.assert_done(package("verify", self.out, "--public", self.key, "--last-counter", 6)))

    def test_the_same_input_gives_the_same_octets(self):
        self.assert_done(self.make())
        first = self.out.read_bytes()
        self.assert_done(self.make())
        self.assertEqual(self.out.read_bytes(), first)
        os.utime(self.sources / "main.cpp", (0, 0))
        self.assert_done(package("make", "--node", "payload_eps", "--kind", "replace", "--counter", "7", "--sources", "impact/main.cpp", "impact/lib/impact.hpp",
                                 "--root", "impact", "--key", "team.seed", "-o", "out.pkg", cwd=self.folder))  # fmt: skip
        self.assertEqual(self.out.read_bytes(), first)

    def test_a_typical_change_is_small(self):
        made = package("make", "--manifest", EXAMPLE, "--counter", 3, "--key", self.seed, "-o", self.out)
        self.assert_done(made)
        self.assertLess(self.out.stat().st_size, 15_000)
        manifest = self.show()["manifest"]
        self.assertEqual((manifest["node"], manifest["counter"], manifest["options"]), ("payload_eps", 3, ["-O2"]))
        self.assertIn("mission/payload_eps/main.cpp", [file["path"] for file in manifest["files"]])

    def test_a_new_node_brings_its_entry_its_slot_and_its_dictionary(self):
        (self.sources / "entry.yaml").write_text(
            'name: impact\nexecutable: impact_node\nmemory_limit_mib: 64\nparameters: {rate: 0.5, label: "7", on: true, lines: [8, 9]}\n')
        (self.sources / "impact.yaml").write_text("subsystem: impact\n")
        manifest = self.sources / "package.yaml"
        manifest.write_text("node: impact\nkind: new\ncounter: 1\nsources: [main.cpp, lib]\nring_after: payload_thermal\ndeployment_entry: entry.yaml\n"
                            "fragment: impact.yaml\nslot: {allotted_ms: 60, overrun_ms: 20, reset_ms: 40, after: payload_thermal}\n")
        made = self.assert_done(package("make", "--manifest", manifest, "--key", self.seed, "-o", self.out))
        self.assertIn("60 ms, overrun 20 ms, reset 40 ms, after payload_thermal", made)
        shown = self.show()["manifest"]
        self.assertEqual(shown["deployment"], {"name": "impact", "executable": "impact_node", "memory_limit_mib": 64,
                                               "parameters": {"rate": 0.5, "label": "7", "on": True, "lines": [8, 9]}})  # fmt: skip
        self.assertEqual(shown["dictionary"], "impact.yaml")
        self.assertEqual(shown["slot"], {"allotted_ms": 60, "overrun_ms": 20, "reset_ms": 40, "after": "payload_thermal"})
        self.assertEqual([file["path"] for file in shown["files"]], ["impact.yaml", "lib/impact.hpp", "main.cpp"])

        (self.sources / "entry.yaml").write_text("name: other\nexecutable: impact_node\n")
        self.assert_refused(package("make", "--manifest", manifest, "--key", self.seed, "-o", self.out), "'name': expected 'impact'")
        self.assert_refused(self.make(kind="new"), "a new node needs a deployment entry")
        self.assert_refused(self.make("--deployment-entry", self.sources / "entry.yaml"), "keeps its deployment entry")

    def test_keys_are_private_and_never_replaced(self):
        self.assertEqual(stat.S_IMODE(self.seed.stat().st_mode), 0o600)
        before = self.seed.read_text(), self.key.read_text()
        self.assert_refused(package("keygen", self.seed, self.folder / "other.pub"), "exists already")
        self.assert_refused(package("keygen", self.folder / "other.seed", self.key), "exists already")
        self.assertFalse((self.folder / "other.seed").exists())
        self.assertEqual((self.seed.read_text(), self.key.read_text()), before)
        self.seed.chmod(0o644)
        self.assert_refused(self.make(), "expected mode 0600")
        self.assertFalse(self.out.exists())

    def test_verify_says_why_a_package_is_refused(self):
        self.assert_done(self.make())
        good = self.out.read_bytes()
        verify = lambda *more: package("verify", self.out, "--public", self.key, *more)  # noqa: E731
        self.assert_refused(verify("--last-counter", 7), "refused: ", 1)
        self.assertIn("7, the last was 7", verify("--last-counter", 7).stderr)

        other = self.folder / "other.pub"
        self.assert_done(package("keygen", self.folder / "other.seed", other))
        self.assert_refused(package("verify", self.out, "--public", other), "refused: signed with another key", 1)
        self.assertEqual(self.show("--key-public", other)["signature"], "of another key")

        self.out.write_bytes(good.replace(b'"counter":7', b'"counter":9'))
        self.assertEqual(verify().returncode, 1)
        self.assertEqual(self.show("--key-public", self.key)["signature"], "wrong")
        self.out.write_bytes(good[:-3])
        self.assertIn("not as long as the manifest says", verify().stderr)
        self.out.write_bytes(b"int main() {}\n")
        self.assert_refused(verify(), "truncated, or not a package", 1)
        self.assert_refused(package("show", self.out), "truncated, or not a package")
        self.out.unlink()
        self.assert_refused(verify(), "out.pkg")

    def test_bad_sources_are_named(self):
        link = self.sources / "linked.txt"
        link.symlink_to("/etc/passwd")
        self.assert_refused(self.make(), "linked.txt: a link")
        self.assert_refused(self.make("--root", self.sources, sources=link), "is a link")
        link.unlink()
        outside = self.folder / "outside.cpp"
        outside.write_text("\n")
        self.assert_refused(self.make("--root", self.sources, sources=self.sources / ".." / "outside.cpp"), "not below")
        self.assert_refused(self.make(sources=self.sources / "none.cpp"), "no such file")
        self.assert_refused(self.make("--root", "/", sources="/dev/null"), "/dev/null: not a regular file")
        hidden = self.sources / ".hidden.cpp"
        hidden.write_text("\n")
        self.assert_refused(self.make(), "a path that is not allowed: .hidden.cpp")
        hidden.unlink()
        odd = self.sources / "a b.cpp"
        odd.write_text("\n")
        self.assert_refused(self.make(), "a path that is not allowed: a b.cpp")
        odd.unlink()
        large = self.sources / "large.cpp"
        large.write_bytes(b"x" * ((1 << 20) + 1))
        self.assert_refused(self.make(), "large.cpp")
        large.unlink()
        for i in range(5):
            (self.sources / f"part{i}.cpp").write_bytes(b"x" * (1 << 20))
        self.assert_refused(self.make(), "octets of sources")
        for i in range(5):
            (self.sources / f"part{i}.cpp").unlink()
        many = self.sources / "many"
        many.mkdir()
        for i in range(256):
            (many / f"f{i}.h").touch()
        self.assert_refused(self.make(), "more than 256 files")
        empty = self.folder / "empty"
        empty.mkdir()
        self.assert_refused(self.make(sources=empty), "no .cpp, .hpp or .h below it")
        self.assertFalse(self.out.exists())

    def test_bad_arguments_are_named(self):
        self.assert_refused(self.make("--option=-fplugin=x.so"), "-fplugin=x.so")
        self.assert_refused(self.make("--self-test", 61), "self_test_s")
        self.assert_refused(self.make("--probation", 2_592_001), "probation_s")
        self.assert_refused(self.make(counter=0), "counter")
        self.assert_refused(self.make("--ring-after", "No"), "ring_after")
        self.assert_refused(package("make", "--key", self.seed, "-o", self.out), "no node given")
        manifest = self.folder / "package.yaml"
        for text, message in (("node: x\nkind: replace\ncounter: 1\nsource: [a]\n", "'source'"), ("counter: -1\n", "package.yaml:1: 'counter'"), ("[", "package.yaml"),
                              ("slot: {allotted_ms: 0}\n", "slot.allotted_ms")):  # fmt: skip
            manifest.write_text(text)
            self.assert_refused(package("make", "--manifest", manifest, "--key", self.seed, "-o", self.out), message)
        for arguments in ((), ("make",), ("make", "--kind", "other"), ("verify", self.out), ("sell",), ("make", "--fast")):
            self.assertEqual(package(*arguments).returncode, 2, arguments)
        self.assertFalse(self.out.exists())

    def test_install_refuses_a_package_before_anything_goes_up(self):
        self.assert_done(self.make())
        other = self.folder / "other.pub"
        self.assert_done(package("keygen", self.folder / "other.seed", other))
        install = lambda *more: package("install", self.out, "--port", self.folder / "rs422", *more)  # noqa: E731
        self.assert_refused(install("--public", other), "refused: signed with another key")
        self.out.write_bytes(self.out.read_bytes()[:-1])
        self.assert_refused(install("--public", self.key), "not as long as the manifest says")
        self.out.write_bytes(b"x")
        self.assert_refused(install(), "truncated, or not a package")
        self.assertFalse((self.folder / "ground").exists())

    def test_explains_itself(self):
        for arguments in (("--help",), ("make", "--help"), ("install", "--help")):
            self.assertIn("--", self.assert_done(package(*arguments)))


class PackageInstallTest(SystemTest):
    """A package signed with a foreign key: it goes up whole, even over an interrupted line, and the spacecraft refuses it."""

    def install(self, flight, *more):
        command = flight.ground_command("--json", "package", "install", self.package, "--public", self.folder / "other.pub", *more)
        run = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=180)
        return run.returncode, [json.loads(line) for line in run.stdout.splitlines()]

    def test_a_package_goes_up_and_on_after_an_interruption_and_the_telecommand_tells_the_outcome(self):
        self.package = self.folder / "any_name.pkg"
        for arguments in (("keygen", self.folder / "other.seed", self.folder / "other.pub"),
                          ("make", "--manifest", EXAMPLE, "--counter", 7, "--key", self.folder / "other.seed", "-o", self.package)):  # fmt: skip
            run = package(*arguments)
            self.assertEqual(run.returncode, 0, run.stderr)
        with self.flight() as flight:
            # The simulation's test key files match: a package signed with the one verifies with the other.
            own = package("make", "--manifest", EXAMPLE, "--key", flight.var / "ground/package_test.seed", "-o", self.folder / "own.pkg")
            self.assertEqual(own.returncode, 0, own.stderr)
            own = package("verify", self.folder / "own.pkg", "--public", flight.var / "keys/package.pub")
            self.assertEqual(own.returncode, 0, own.stderr)

            flight.control({"rs422": {"cut": True}})
            code, told = self.install(flight, "--timeout", "2")
            self.assertEqual(code, 1, told)
            begun = [m["id"] for m in told if m["type"] == "file"][0]
            self.assertIn("is not up yet", told[-1]["message"])
            other = self.folder / "other.pkg"
            self.assertEqual(package("make", "--manifest", EXAMPLE, "--counter", 7, "--option=-O3", "--key", self.folder / "other.seed", "-o", other).returncode, 0)
            whole, self.package = self.package, other
            code, told = self.install(flight, "--timeout", "2")
            self.assertEqual(code, 2, told)
            self.assertIn("another file with this name is being sent", told[-1]["message"])
            self.package = whole

            flight.control({"rs422": {"cut": False}})
            code, told = self.install(flight, "--timeout", "90")
            self.assertEqual(code, 1, told)
            up = [m for m in told if m["type"] == "file" and m["event"] == "finished"]
            self.assertEqual([(m["id"], m["name"], m["success"]) for m in up], [(begun, "payload_eps_7.pkg", True)])
            self.assertEqual((flight.var / "files/payload_eps_7.pkg").read_bytes(), whole.read_bytes())
            stages = [m for m in told if m["type"] == "tc_stage" and m["command"] == "package.install"]
            self.assertEqual(stages[0]["stage"], "sent")
            self.assertEqual((stages[-1]["final"], stages[-1]["success"]), (True, False))


if __name__ == "__main__":
    unittest.main()
