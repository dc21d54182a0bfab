# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Telecommands for the file folder on board (PUS 23): listing, checksum, copies to and from the ground, bad names, a disk that fails."""

import errno
import hashlib
import json
import mmap
import random
import struct
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest, kill, wait_for_ttc

from srfs.flight.processes import wait_until

TRANSFER_S = 180  # far above the transfer time of these files, for a machine under load
LARGE = 1_000_000  # about 11 s on the line


def content(octets, seed):
    return random.Random(seed).randbytes(octets)


class RemoteFilesTest(SystemTest):
    def tool(self, flight, *arguments, json_lines=False):
        """Runs srfs-ground once; no session may hold the port."""
        command = flight.ground_command(*(["--json"] if json_lines else []), *arguments)
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TRANSFER_S)

    def done(self, flight, *arguments):
        """Runs srfs-ground, which must succeed. Returns the lines of its output."""
        run = self.tool(flight, *arguments)
        self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
        return run.stdout.splitlines()

    def refuse(self, ground, command, name, stage="start_failed"):
        outcome = ground.command(f"tc {command}", DEADLINE_S)
        self.assertIsNotNone(outcome, command)
        self.assertEqual((outcome.get("stage"), outcome.get("name")), (stage, name), outcome)

    def copies(self, ground):
        """The copies under way, as reported by the spacecraft: {operation: fields}."""
        since = ground.position()
        self.complete(ground, "tc file.report_copies")
        told = ground.select(lambda m: m.get("structure") == "file_copy_status", since)
        return {m["fields"]["operation"]: m["fields"] for m in told if m["fields"]["operations"]}

    def write(self, flight, name, octets):
        """Writes a file and renames it at the end, so that no reader sees a part of it."""
        path = flight.var / "files" / name
        wait_until((flight.var / "files/outbox").exists, DEADLINE_S, "the folder of files")
        path.parent.mkdir(exist_ok=True)
        part = path.with_name("." + path.name)
        part.write_bytes(octets)
        part.rename(path)

    def test_an_operator_lists_checks_fetches_and_deletes_files(self):
        with self.flight() as flight:
            names = [f"image{i:03}.fits" for i in range(150)]
            for i, name in enumerate(names):
                self.write(flight, f"images/{name}", content(i, i))
            lines = self.done(flight, "remote", "ls", "images")
            self.assertEqual([line.split() for line in lines], [["file", str(i), name] for i, name in enumerate(names)])
            self.assertEqual([line.split()[-1] for line in self.done(flight, "remote", "ls")], ["images/", "outbox/", "unsent/"])

            large = content(3_000_000, 7)
            self.write(flight, "images/large", large)
            told = "\n".join(self.done(flight, "remote", "stat", "images/large"))
            self.assertIn(hashlib.sha256(large).hexdigest(), told)
            self.assertIn(" 3000000\n", told)
            self.assertIn(f"0x{sum(struct.unpack('>750000I', large)) & 0xFFFFFFFF:08x}", told)

            self.done(flight, "remote", "get", "images/image149.fits", "first.fits")
            self.assertEqual((flight.var / "ground/files/first.fits").read_bytes(), content(149, 149))

            self.done(flight, "remote", "rm", "images/large", "images/image000.fits")
            self.assertFalse((flight.var / "files/images/large").exists())
            self.done(flight, "remote", "mkdir", "new")
            self.done(flight, "remote", "rmdir", "new/")
            refused = self.tool(flight, "remote", "rmdir", "images")
            self.assertEqual(refused.returncode, 1)
            self.assertIn("folder_not_empty", refused.stdout)

    def test_no_name_leads_out_of_the_folder_of_files(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.complete(ground, "tc file.list")
            secret = flight.var / "secret"
            secret.write_text("secret")
            (flight.var / "files/link").symlink_to(flight.var)
            before = sorted(p.name for p in flight.var.iterdir())
            for folder, name in (("..", "secret"), ("link", "secret"), ("/", "etc"), ("a/../..", "secret"), (".cfdp", "x")):
                for command in (f"file.delete repository={folder} file={name}", f"file.report repository={folder} file={name}",
                                f"file.make_folder repository={folder} folder={name}", f"file.remove_folder repository={folder} folder={name}",
                                f"file.copy operation=1 source_repository={folder} source_file={name}"):  # fmt: skip
                    # An invalid name is refused as such, or as a missing folder.
                    outcome = ground.command(f"tc {command}", DEADLINE_S)
                    self.assertIn(outcome.get("name"), ("bad_file_name", "file_not_found"), f"{command}: {outcome}")
                self.refuse(ground, f"file.list repository={folder}", "file_not_found" if folder.startswith("a") else "bad_file_name")
            self.refuse(ground, "file.delete file=../secret", "bad_file_name")
            self.refuse(ground, "file.report file=missing", "file_not_found")
            self.refuse(ground, "file.delete file=outbox", "not_a_file")
            self.refuse(ground, "file.remove_folder folder=outbox", "file_denied")
            self.refuse(ground, "file.copy operation=1 source_file=x target_repository=images", "copy_not_supported")
            self.assertEqual(sorted(p.name for p in flight.var.iterdir()), before)
            self.assertEqual(secret.read_text(), "secret")

    def test_a_copy_rests_over_a_loss_of_signal_and_a_death_of_ttc_and_goes_on_when_it_is_resumed(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.write(flight, "images/large", content(LARGE, 1))
            self.complete(ground, "tc file.copy operation=5 source_repository=images source_file=large target_file=came")
            under_way = ground.wait_for(lambda m: m["type"] == "file" and m["name"] == "came" and m["progress"] > 0, DEADLINE_S)
            self.assertIsNotNone(under_way)
            self.complete(ground, "tc file.suspend_all")
            self.refuse(ground, "file.delete repository=images file=large", "file_in_use")
            rests = self.copies(ground)[5]
            self.assertEqual((rests["state"], rests["direction"], rests["file"]), ("suspended", "down", "images/large"))
            self.assertLess(rests["progress"], LARGE)

            flight.control({"rs422": {"cut": True}})
            kill(flight, "ttc")
            flight.control({"rs422": {"cut": False}})
            wait_for_ttc(ground)
            still = self.copies(ground)[5]
            self.assertEqual(still["state"], "suspended", "a contact does not wake what rests by request")
            for _ in range(5):
                self.complete(ground, "ping --timeout 20")
            self.assertEqual(self.copies(ground)[5]["progress"], still["progress"])

            self.refuse(ground, "file.resume operation=6", "unknown_operation")
            self.complete(ground, "tc file.resume operation=5")
            done = ground.wait_for(lambda m: m["type"] == "file" and m["event"] == "finished" and m["name"] == "came", TRANSFER_S)
            self.assertTrue(done and done["success"], done)
            self.assertEqual((flight.var / "ground/files/came").read_bytes(), content(LARGE, 1))
            wait_until(lambda: self.copies(ground) == {}, DEADLINE_S, "nothing is under way")
            self.assertTrue((flight.var / "files/images/large").exists(), "a copy leaves the file where it is")

    def test_copies_of_both_directions_are_cancelled(self):
        with self.flight() as flight:
            ground = flight.ground()
            # Large enough that neither copy ends before it is suspended, even on a slow machine.
            self.write(flight, "down", content(3 * LARGE, 2))
            (self.folder / "up").write_bytes(content(3 * LARGE, 3))
            self.complete(ground, "tc file.copy operation=9 source_file=down")
            ground.send(f"put {self.folder / 'up'}")
            for name in ("down", "up"):
                self.assertIsNotNone(ground.wait_for(lambda m, n=name: m["type"] == "file" and m["name"] == n and m["progress"] > 0, DEADLINE_S))
            self.complete(ground, "tc file.suspend_all")
            sender = ground.select(lambda m: m["type"] == "file" and m["name"] == "up")[0]["id"]
            upload = 2**32 + int(sender.removeprefix("1:"))
            self.assertEqual({number: copy["direction"] for number, copy in self.copies(ground).items()}, {9: "down", upload: "up"})

            self.assertEqual({copy["state"] for copy in self.copies(ground).values()}, {"suspended"})
            self.complete(ground, "tc file.abort operation=9")
            self.complete(ground, f"tc file.abort operation={upload}")
            for direction, name in (("down", "down"), ("up", "up")):
                ended = ground.wait_for(lambda m, d=direction, n=name: m["type"] == "file" and m["event"] == "finished" and (m["direction"], m["name"]) == (d, n),
                                        TRANSFER_S)  # fmt: skip
                self.assertIsNotNone(ended, name)
                self.assertFalse(ended["success"])
                said = ground.wait_for(lambda m, n=name: m["type"] == "event" and m["event"] == "file.failed" and m["fields"]["name"] == n, DEADLINE_S)
                self.assertIsNotNone(said, name)
            wait_until(lambda: self.copies(ground) == {}, TRANSFER_S, "nothing is under way")
            self.assertFalse((flight.var / "files/up").exists())
            self.complete(ground, "tc file.delete file=down")

    def faulty_deployment(self):
        self.fault = self.var / "disk_fault"  # below VAR: ttc writes nowhere else
        self.var.mkdir()
        self.fault.write_bytes(bytes(4))
        wrapper = self.folder / "ttc_node"
        wrapper.write_text(f'#!/bin/sh\nexport LD_PRELOAD={BIN.parent}/lib/libsrfs_disk_fault.so SRFS_DISK_FAULT={self.fault}\nexec {BIN}/ttc_node "$@"\n')
        wrapper.chmod(0o755)
        return self.deployment(("executable: ttc_node\n", f"executable: {wrapper}\n"))

    def test_a_disk_that_is_full_read_only_or_failing_says_so_and_commanding_goes_on(self):
        with self.flight(self.faulty_deployment()) as flight:
            ground = flight.ground()
            self.write(flight, "old", b"x")
            self.complete(ground, "tc file.list")
            with open(self.fault, "r+b") as file, mmap.mmap(file.fileno(), 4) as force:
                for number, name in ((errno.ENOSPC, "no_space"), (errno.EROFS, "file_denied"), (errno.EIO, "disk_failed")):
                    force[:] = struct.pack("=I", number)
                    self.refuse(ground, "file.make_folder folder=new", name)
                    self.refuse(ground, "file.delete file=old", name)
                    since = ground.position()
                    self.complete(ground, "tc file.list")
                    self.assertIn("old", [m["fields"]["object_name"] for m in ground.select(lambda m: m.get("structure") == "repository_summary", since)])
                    self.complete(ground, "tc file.report file=old")
                    self.complete(ground, "ping")
                # An upload is refused, not lost silently.
                (self.folder / "up").write_bytes(b"up")
                ground.send(f"put {self.folder / 'up'}")
                ended = ground.wait_for(lambda m: m["type"] == "file" and m["event"] == "finished", TRANSFER_S)
                self.assertTrue(ended and not ended["success"], ended)
                force[:] = bytes(4)
            self.complete(ground, "tc file.delete file=old")
            self.assertEqual([n["restarts"] for n in flight.status() if n["name"] == "ttc"], [0])

    def test_the_answers_of_the_tool_are_json_for_programs(self):
        with self.flight() as flight:
            self.write(flight, "abc", b"abc")
            run = self.tool(flight, "remote", "stat", "abc", json_lines=True)
            lines = [json.loads(line) for line in run.stdout.splitlines()]
            (told,) = [m for m in lines if m.get("structure") == "file_attributes"]
            self.assertEqual((told["fields"]["octets"], told["fields"]["checksum"]), (3, "0x61626300"))
            self.assertEqual(lines[-1]["stage"], "completed")


if __name__ == "__main__":
    unittest.main()
