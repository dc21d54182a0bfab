# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A computer whose root file system does not come up is answered for from its initramfs: srfs_rescue on a serial line of a virtual machine, and the
stock ground station on this one.

The initramfs is made by Debian's mkinitramfs with the hook of packaging/initramfs; the first of its two copies of srfs_rescue is damaged. The machine
has a disk for the data and none for the root. Needs root. About a minute. The last line is "N passed, M failed".

Exit codes: 0 all passed, 1 some failed, 2 cannot be done here.
"""

import argparse
import contextlib
import os
import pathlib
import re
import secrets
import shutil
import subprocess
import sys
import tempfile

from srfs import ROOT
from srfs.flight import deployments
from srfs.flight.processes import PATIENCE, wait_until
from srfs.report import check, conclude
from srfs.vm import guest

ANSWER_S = 240 * PATIENCE  # the kernel starts on an emulated processor
RESET_S = 60 * PATIENCE
COPIES = ("/var/lib/srfs-rescue/a", "/var/lib/srfs-rescue/b")
VAR = "/var/lib/srfs"

# In a mount namespace of its own, with this machine's root below a file system in memory: nothing here changes.
MAKE = """
set -e
mount -t tmpfs tmpfs "$work"
mkdir "$work/upper" "$work/work" "$work/root"
mount -t overlay overlay -o lowerdir=/,upperdir="$work/upper",workdir="$work/work" "$work/root"
for place in proc sys dev "${build%/*}" "$out"; do
  mkdir -p "$work/root/$place"
  mount --rbind "/$place" "$work/root/$place"
done
mkdir -p "$work/root/lib/modules/$version" "$work/root/boot"
echo CONFIG_RD_GZIP=y > "$work/root/boot/config-$version" # the kernel's package has it
mount --bind "$modules" "$work/root/lib/modules/$version"
cp "$packaging/hook" "$work/root/usr/share/initramfs-tools/hooks/srfs-rescue"
echo MODULES=list > "$work/root/etc/initramfs-tools/conf.d/few-modules"
printf '%s\\n' virtio_pci virtio_blk ext4 >> "$work/root/etc/initramfs-tools/modules"
mkdir -p "$work/root/usr/share/initramfs-tools/scripts/panic"
cp "$packaging/panic" "$work/root/usr/share/initramfs-tools/scripts/panic/srfs-rescue"
cp "$packaging/conf" "$work/root/usr/share/initramfs-tools/conf-hooks.d/srfs-rescue"
mkdir -p "$work/root/var/lib/srfs"
cp -r "$out/keys" "$work/root/var/lib/srfs/"
chroot "$work/root" "$build/bin/srfs" --deployment "$out/deployment.yaml" --var /var/lib/srfs rescue prepare --into /var/lib/srfs-rescue/a --into /var/lib/srfs-rescue/b
printf x | dd of="$work/root/var/lib/srfs-rescue/a/srfs_rescue" bs=1 seek=100000 conv=notrunc status=none
chroot "$work/root" mkinitramfs -c gzip -o "$out/initramfs" "$version"
"""


def make(folder, build, kernel):
    """Fills the folder: deployment, keys, initramfs, the disk of the data."""
    content = deployments.read("sim")
    content["devices"]["rs422"] = "serial:/dev/ttyS1"
    content["devices"].pop("watchdog")
    content["link"]["baud"] = 115200
    deployments.write(content, folder / "deployment.yaml")
    link = content["link"]
    for entry in [*link["tc_channels"], *link["key_encryption_keys"], link["tm"]]:
        key = folder / entry["key_file"]
        key.parent.mkdir(exist_ok=True)
        key.touch(0o600)
        key.write_text(secrets.token_hex(32) + "\n")
    version = next((kernel / "lib" / "modules").iterdir())
    with tempfile.TemporaryDirectory(prefix="srfs-initramfs-") as work:
        environment = {**os.environ, "PATH": os.environ["PATH"] + ":/usr/sbin:/sbin", "work": work, "build": str(build), "out": str(folder), "version": version.name,
                       "modules": str(version), "packaging": str(ROOT / "packaging" / "initramfs")}  # fmt: skip
        made = subprocess.run(["unshare", "--mount", "bash", "-c", MAKE], env=environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if made.returncode != 0:
        raise guest.CannotRun(f"no initramfs: {made.stdout}{made.stderr}")
    disk = folder / "data"
    disk.touch()
    os.truncate(disk, 64 << 20)
    guest.quietly(["mkfs.ext4", "-q", "-L", "srfs-data", str(disk)], 60)


class Machine:
    def __init__(self, folder, kernel):
        self.console = folder / "console"
        command = [guest.QEMU, "-accel", "tcg,thread=multi", "-cpu", "max", "-smp", "2", "-m", "1024", "-nodefaults", "-nographic", "-no-reboot", "-monitor", "none",
                   "-serial", f"file:{self.console}", "-serial", "pty", "-device", "virtio-rng-pci", "-drive", f"file={folder / 'data'},format=raw,if=virtio",
                   "-kernel", str(kernel / "vmlinux"), "-initrd", str(folder / "initramfs"), "-append", "console=ttyS0 quiet root=/dev/absent rootdelay=1 mitigations=off"]  # fmt: skip
        self.said = folder / "qemu"
        with open(self.said, "wb") as said:
            self.qemu = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=said, preexec_fn=guest.die_with_parent)
        wait_until(lambda: self.line() or self.qemu.poll() is not None, RESET_S, "the machine has a serial line")

    def line(self):
        found = re.search(r"(/dev/pts/\d+)", self.said.read_text())
        return found and found[1]

    def is_off(self):
        return self.qemu.poll() is not None

    def close(self):
        if self.qemu.poll() is None:
            self.qemu.kill()
            self.qemu.wait()


class Station:
    def __init__(self, folder, build, line):
        self.folder, self.program = folder / "station", build / "bin" / "srfs-ground"
        self.deployment = folder / "deployment.yaml"
        self.folder.mkdir()
        (self.folder / "rs422").symlink_to(line)
        shutil.copytree(folder / "keys", self.folder / "keys")

    def ground(self, *words):
        command = [str(self.program), "--port", str(self.folder / "rs422"), "--deployment", str(self.deployment), *words]
        return subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)

    def ping(self, *keys):
        return self.ground(*keys, "ping", "--timeout", "5").returncode == 0


def fly(folder, build, kernel):
    make(folder, build, kernel)
    machine = Machine(folder, kernel)
    status = ""
    try:
        station = Station(folder, build, machine.line())
        with contextlib.suppress(Exception):
            wait_until(lambda: station.ping() or machine.is_off(), ANSWER_S, "srfs_rescue answers")
        answered = station.ping()
        contingency = station.ping("--keys", "contingency")
        status = station.ground("status", "--timeout", "60").stdout
        ordered = station.ground("tc", "rescue.start_suite", "--wait", "--timeout", "60")
        with contextlib.suppress(Exception):
            wait_until(machine.is_off, RESET_S, "the computer restarts")
        restarted = machine.is_off()
    finally:
        machine.close()
        if not status:
            for said in (machine.said, machine.console):
                print(said.read_text(errors="replace")[-3000:] if said.exists() else "")
    counters = guest.quietly(["debugfs", "-R", "stat /state/ttc/link_state", str(folder / "data")], 60)
    mode = (folder / "initramfs").stat().st_mode & 0o777
    return [
        check(answered, "without a root file system the ground is answered, from the whole one of two copies"),
        check(contingency, "with the contingency key, too"),
        check("suite is down" in status, "its status says that the suite is down"),
        check(ordered.returncode == 0 and restarted, "an order to start the suite restarts the computer"),
        check("Type: regular" in counters, "the counters of the uplink are on the disk of the data"),
        check(mode == 0o600, "only root reads the initramfs, which has keys in it"),
    ]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build-release", metavar="DIR", help="default: %(default)s")
    options = parser.parse_args()

    def run():
        if not shutil.which("mkinitramfs", path=os.environ["PATH"] + ":/usr/sbin"):
            raise guest.CannotRun("mkinitramfs is missing: install the packages of packages.txt (group vm)")
        with tempfile.TemporaryDirectory(prefix="srfs-initramfs-") as folder:
            checks = fly(pathlib.Path(folder), options.build.absolute(), guest.kernel_folder(guest.say))
        return conclude(checks)

    return guest.exit_code_of(run)


if __name__ == "__main__":
    sys.exit(main())
