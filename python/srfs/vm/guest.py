# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs one command as root under Debian's own kernel, in a virtual machine (QEMU) that shares this machine's files.

For what the running kernel lacks: CAN, above all. The kernel package is fetched once with apt-get and kept unpacked below
~/.cache/srfs/vm. The guest sees this machine's whole root file system read-only, under a file system in its memory, so that the
command finds everything where it is and changes nothing. It has no network and no disk. Its processor is emulated, without KVM: integer
code about as fast as outside, floating point 10 times slower, cryptography 100 times.

    python3 -m srfs.vm.guest run [options] -- COMMAND...    prints what the command prints while it runs; its exit code
    python3 -m srfs.vm.guest fetch [--kernel rt]            only gets the kernel

Exit codes of its own: 2 cannot be done here (the reason is printed), 124 the guest did not end before --deadline, 125 it reset itself
(a kernel panic, a watchdog) or went off without an exit code; the end of its console is printed then.
"""

import argparse
import contextlib
import ctypes
import fcntl
import hashlib
import json
import lzma
import os
import pathlib
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time

from srfs import ROOT
from srfs.flight.processes import Patience

SLOWER = 6  # starts and discovery, on an emulated processor of a busy machine
HERE = pathlib.Path(__file__).resolve().parent
QEMU = "qemu-system-x86_64"
PACKAGES = {"amd64": "linux-image-amd64", "rt": "linux-image-rt-amd64"}  # each depends on the newest kernel of its kind
BOOT_MODULES = ("virtio_pci", "9pnet_virtio", "9p", "overlay")
DOWNLOAD_DEADLINE_S = 900
EXIT_CANNOT = 2
EXIT_HUNG = 124
EXIT_RESET = 125
CONSOLE_LINES = 25


class CannotRun(Exception):
    """There can be no guest here; the text says why and what to do."""


# --- the kernel ------------------------------------------------------------------------------------------------------


def cache_folder():
    base = os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache"
    return pathlib.Path(base) / "srfs" / "vm"


def quietly(command, deadline_s, **options):
    """Runs a program without a terminal; its output in the error when it fails."""
    try:
        # depmod and modprobe are in /sbin, which is not in every PATH; apt's messages are parsed below.
        environment = {**os.environ, "PATH": os.environ.get("PATH", "/usr/bin:/bin") + ":/usr/sbin:/sbin", "LC_ALL": "C"}
        result = subprocess.run(command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
                                errors="replace", timeout=deadline_s, **options)  # fmt: skip
    except FileNotFoundError as error:
        raise CannotRun(f"{command[0]} is missing: install the packages of packages.txt (group vm)") from error
    except subprocess.TimeoutExpired as error:
        raise CannotRun(f"{shlex.join(command)}: not finished within {deadline_s} s") from error
    if result.returncode != 0:
        raise CannotRun(f"{shlex.join(command)}:\n{result.stdout.strip()}")
    return result.stdout


def newest_package(kind):
    """linux-image-6.1.0-NN-amd64, as apt's lists have it; None when they do not know it."""
    with contextlib.suppress(CannotRun):
        for line in quietly(["apt-cache", "depends", PACKAGES[kind]], 60).splitlines():
            word, _, name = line.strip().partition("Depends: ")
            if not word and name.startswith("linux-image-"):
                return name
    return None


def sha256(path):
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def is_whole(kernel):
    """Whether a folder of the cache still holds what was put there. Modules are judged by size: there are four thousand."""
    with contextlib.suppress(OSError, ValueError, KeyError):
        contents = json.loads((kernel / "contents.json").read_text())
        sizes_fit = all((kernel / name).stat().st_size == size for name, size in contents["sizes"].items())
        return sizes_fit and sha256(kernel / "vmlinux") == contents["vmlinux"]
    return False


def extract_vmlinux(image):
    """The ELF image inside a compressed kernel: QEMU starts it directly, 15 s sooner than the code that unpacks itself."""
    data = image.read_bytes()
    start = -1
    while (start := data.find(b"\xfd7zXZ\x00", start + 1)) >= 0:
        with contextlib.suppress(lzma.LZMAError, EOFError):
            kernel = lzma.LZMADecompressor(format=lzma.FORMAT_XZ).decompress(data[start:])
            if kernel.startswith(b"\x7fELF"):
                return kernel
    raise CannotRun(f"{image.name}: no kernel compressed with xz inside")


def download(package, kind, folder, say):
    """The package file, in `folder`; apt-get checks it against the release's signed lists."""
    say(f"fetching {package} (about 70 MB)")
    sandbox = ["-o", "APT::Sandbox::User=root"] if os.geteuid() == 0 else []
    fetch = ["apt-get", *sandbox, "download", package]
    try:
        quietly(fetch, DOWNLOAD_DEADLINE_S, cwd=folder)
    except CannotRun:
        # The lists may be older than what the mirror has.
        root = [] if os.geteuid() == 0 else ["sudo", "-n"]
        with contextlib.suppress(CannotRun):
            quietly([*root, "apt-get", "update", "-q"], DOWNLOAD_DEADLINE_S)
        package = newest_package(kind) or package
        quietly([*fetch[:-1], package], DOWNLOAD_DEADLINE_S, cwd=folder)
    return next(folder.glob("*.deb"))


def unpack(archive, folder):
    """Fills a folder of the cache from a package file: vmlinux, the modules with their index, the initramfs."""
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix="unpack.") as place:
        quietly(["dpkg-deb", "--extract", str(archive), place], 300)
        version = next(pathlib.Path(place).glob("lib/modules/*")).name
        quietly(["depmod", "--basedir", place, version], 120)
        shutil.move(pathlib.Path(place, "lib"), folder / "lib")
        (folder / "vmlinux").write_bytes(extract_vmlinux(pathlib.Path(place, "boot", f"vmlinuz-{version}")))
    sizes = {str(path.relative_to(folder)): path.stat().st_size for path in folder.rglob("*") if path.is_file()}
    (folder / "contents.json").write_text(json.dumps({"vmlinux": sha256(folder / "vmlinux"), "sizes": sizes}))


def kernels_of(kind, cache):
    """The unpacked ones, newest first."""
    folders = [path for path in cache.glob("linux-image-*") if path.is_dir() and ("-rt-" in path.name) == (kind == "rt")]
    return sorted(folders, key=lambda path: path.stat().st_mtime, reverse=True)


def kernel_folder(say, kind="amd64"):
    """The unpacked kernel, fetched when it is not there or damaged. With an older one there, a failing network is no obstacle."""
    cache = cache_folder()
    cache.mkdir(parents=True, exist_ok=True)
    with open(cache / "lock", "w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)  # another process may be fetching it right now
        package = newest_package(kind)
        for kernel in kernels_of(kind, cache):
            if package in (None, kernel.name):
                if is_whole(kernel):
                    return kernel
                say(f"{kernel} is damaged, making it again")
                shutil.rmtree(kernel)
        for left_over in [*cache.glob("new.*"), *cache.glob("unpack.*")]:
            shutil.rmtree(left_over)
        try:
            return fetch(package or PACKAGES[kind], kind, cache, say)
        except CannotRun as error:
            for kernel in kernels_of(kind, cache):
                if is_whole(kernel):
                    say(f"{error}\nusing {kernel.name} from the cache")
                    return kernel
            raise CannotRun(f"the kernel package cannot be fetched, and {cache} has none: {error}") from error


def fetch(package, kind, cache, say):
    new = pathlib.Path(tempfile.mkdtemp(dir=cache, prefix="new."))
    try:
        with tempfile.TemporaryDirectory(dir=cache, prefix="unpack.") as place:
            archive = download(package, kind, pathlib.Path(place), say)
            name = archive.name.split("_")[0]
            unpack(archive, new)
        for old in kernels_of(kind, cache):
            shutil.rmtree(old)
        new.chmod(0o755)
        return new.rename(cache / name)
    finally:
        shutil.rmtree(new, ignore_errors=True)


def make_initramfs(kernel, target):
    """busybox, the modules that mount the host's files, and initramfs_init.sh."""
    version = next((kernel / "lib" / "modules").iterdir()).name
    busybox = shutil.which("busybox")
    if not busybox:
        raise CannotRun("busybox is missing: install the packages of packages.txt (group vm)")
    with tempfile.TemporaryDirectory(prefix="srfs-initramfs-") as place:
        root = pathlib.Path(place)
        for folder in ("bin", "proc", "sys", "dev", "m", "mnt/lower", "mnt/over", "mnt/root"):
            (root / folder).mkdir(parents=True)
        shutil.copy(busybox, root / "bin" / "busybox")
        (root / "bin" / "sh").symlink_to("busybox")
        paths = []
        for module in BOOT_MODULES:
            told = quietly(["modprobe", "--dirname", str(kernel), "--set-version", version, "--show-depends", module], 30)
            paths += [line.split()[1] for line in told.splitlines() if line.startswith("insmod ")]
        paths = list(dict.fromkeys(paths))
        for path in paths:
            shutil.copy(path, root / "m")
        (root / "modules").write_text("".join(f"{os.path.basename(path)}\n" for path in paths))
        shutil.copy(HERE / "initramfs_init.sh", root / "init")
        (root / "init").chmod(0o755)
        pack = f"find . | cpio --create --format=newc --quiet > {shlex.quote(str(target))}"
        quietly(["bash", "-o", "pipefail", "-c", pack], 60, cwd=root)


# --- the machine -----------------------------------------------------------------------------------------------------


def die_with_parent():
    ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG


def qemu_command(kernel, exchange, options, hardware=(), may_reset=False):
    def share(path, tag, more=""):
        return ["-virtfs", f"local,path={path},mount_tag={tag},security_model=none{more}"]

    # No KVM: where it is offered inside a virtual machine it often does not work, and the guest shall be the same everywhere.
    return [
        QEMU, "-accel", "tcg,thread=multi,tb-size=512", "-cpu", "max", "-smp", str(options.cpus), "-m", str(options.memory_mib),
        "-nodefaults", "-parallel", "null", "-nographic", *([] if may_reset else ["-no-reboot"]), "-monitor", "none", "-serial", f"file:{exchange / 'console'}",
        "-device", "virtio-rng-pci", *hardware,
        *share("/", "root", ",readonly=on,multidevs=remap"), *share(exchange, "vm"),
        "-kernel", str(kernel / "vmlinux"), "-initrd", str(exchange / "initramfs"),
        # no_timer_check: on a busy machine the timer seems broken to the kernel, which then panics.
        "-append", "console=ttyS0 quiet panic=-1 mitigations=off random.trust_cpu=on no_timer_check",
    ]  # fmt: skip


class Output:
    """Shows what is added to a file."""

    def __init__(self, path):
        self._path = path
        self._file = None

    def show(self):
        if self._file is None:
            with contextlib.suppress(FileNotFoundError):
                self._file = open(self._path, "rb")
        if self._file and (news := self._file.read()):
            sys.stdout.buffer.write(news)
            sys.stdout.buffer.flush()

    def close(self):
        self.show()
        if self._file:
            self._file.close()


def read_number(path):
    try:
        return float(path.read_text())
    except (OSError, ValueError):
        return None


def print_console(exchange):
    with contextlib.suppress(OSError):
        lines = (exchange / "console").read_text(errors="replace").splitlines()[-CONSOLE_LINES:]
        print("--- the end of the guest's console", *lines, "---", sep="\n", file=sys.stderr)


def prepare(exchange, kernel, command):
    make_initramfs(kernel, exchange / "initramfs")
    shutil.copy(HERE / "guest_init.sh", exchange)
    version = next((kernel / "lib" / "modules").iterdir())
    (exchange / "modules").write_text(str(version))
    (exchange / "command").write_text(f"cd {shlex.quote(os.getcwd())} && exec {shlex.join(command)}\n")


def wait_for(qemu, output, deadline_s):
    """Until the machine is off; False when it did not go off in time and was ended. Time in which it waits for a CPU does not count."""
    with Patience(deadline_s, qemu.pid) as patience:
        while True:
            try:
                qemu.wait(0.1)
                return True
            except subprocess.TimeoutExpired:
                output.show()
            if patience.left_s() < 0:
                qemu.kill()
                qemu.wait()
                return False


def run(command, options, say, hardware=(), may_reset=False, keep_file=None):
    """Boots, runs the command, returns its exit code or one of our own. hardware: more words of QEMU's command line. may_reset: a reset boots again and runs
    the command again; what it left in /run/vm is still there.
    keep_file (name, target): a file of /run/vm to copy out at the end."""
    if platform.machine() != "x86_64":
        raise CannotRun(f"the guest is an amd64 machine that runs this machine's programs, but these are for {platform.machine()}. "
                        "The tests run directly on a kernel with CAN: as root, `modprobe vcan` and try again")  # fmt: skip
    if not shutil.which(QEMU):
        raise CannotRun(f"{QEMU} is missing: install the packages of packages.txt (group vm)")
    kernel = kernel_folder(say, options.kernel)
    exchange = pathlib.Path(tempfile.mkdtemp(prefix="srfs-vm-"))
    try:
        prepare(exchange, kernel, command)
        began = time.monotonic()
        qemu = subprocess.Popen(qemu_command(kernel, exchange, options, hardware, may_reset), stdin=subprocess.DEVNULL, stdout=2,
                                preexec_fn=die_with_parent)  # fmt: skip
        output = Output(exchange / "output")
        try:
            ended = wait_for(qemu, output, options.deadline)
        finally:
            if qemu.poll() is None:
                qemu.kill()
                qemu.wait()
        output.close()
        booted, code = read_number(exchange / "booted_s"), read_number(exchange / "exit_code")
        took = time.monotonic() - began
        if code is not None:
            say(f"guest: {took:.1f} s in all, {booted or 0:.1f} s of it to boot; exit code {code:.0f}")
            return int(code)
        print_console(exchange)
        if not ended:
            say(f"the guest hung: not finished within {options.deadline} s" + ("" if booted else "; it did not boot"))
            return EXIT_HUNG
        say(f"the guest reset itself or switched off without an exit code after {took:.1f} s (QEMU ended with {qemu.returncode})")
        return EXIT_RESET
    finally:
        if keep_file and (exchange / keep_file[0]).exists():
            shutil.copy(exchange / keep_file[0], keep_file[1])
        if options.keep:
            say(f"kept: {exchange}")
        else:
            shutil.rmtree(exchange, ignore_errors=True)


# --- command line ----------------------------------------------------------------------------------------------------


def add_options(parser, deadline="300"):
    parser.add_argument("--kernel", choices=PACKAGES, default="amd64", help="Debian's usual kernel, or the one with PREEMPT_RT (default: %(default)s)")
    parser.add_argument("--cpus", type=int, default=2, metavar="N", help="CPUs of the guest (default: %(default)s)")
    parser.add_argument("--memory-mib", type=int, default=3072, metavar="N", help="memory of the guest; files may use 60 %% of it (default: %(default)s)")
    parser.add_argument("--deadline", type=float, default=300, metavar="S", help=f"stop the guest after S seconds (default: {deadline})")
    parser.add_argument("--keep", action="store_true", help="keep the folder with console, output and exit code")


def say(text):
    print(f"vm: {text}", file=sys.stderr, flush=True)


def exit_code_of(work):
    """What work() returns; of its own where there can be no guest or the user ends it. SIGTERM ends like Ctrl-C: through every `finally`."""

    def end(number, frame):
        raise KeyboardInterrupt

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGHUP, end)
    try:
        return work()
    except CannotRun as error:
        say(str(error))
        return EXIT_CANNOT
    except KeyboardInterrupt:
        say("interrupted")
        return 130


def python(script, *arguments, **environment):
    """The command of a script of tests/vm in the guest."""
    environment = {"PYTHONPATH": ROOT / "python", "SRFS_PATIENCE": SLOWER, **environment}
    return ["env", *(f"{name}={value}" for name, value in environment.items()), sys.executable, "-B", str(ROOT / "tests" / "vm" / script), *arguments]


def main():
    parser = argparse.ArgumentParser(prog="srfs.vm.guest", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="action", required=True)
    runner = commands.add_parser("run", help="boot and run a command")
    add_options(runner)
    runner.add_argument("command", nargs="+", metavar="COMMAND")
    fetcher = commands.add_parser("fetch", help="only fetch the kernel")
    fetcher.add_argument("--kernel", choices=PACKAGES, default="amd64")
    options = parser.parse_args()
    if options.action == "fetch":
        return exit_code_of(lambda: print(kernel_folder(say, options.kernel)) or 0)
    return exit_code_of(lambda: run(options.command, options, say))


if __name__ == "__main__":
    sys.exit(main())
