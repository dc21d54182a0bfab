# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""srfs-lane as maintenance calls it, on benign and on malicious sources and programs. Every run is limited to seconds."""

import hashlib
import json
import os
import pathlib
import shutil
import signal
import subprocess
import time
import unittest

from support import BIN, temporary_folder

from srfs import ROOT
from srfs.flight.processes import wait_until

LANE = BIN / "srfs-lane"
USER = 64044  # no other test uses it
ROOT_USER = os.geteuid() == 0

FORKS = """#include <unistd.h>
int main() { while (geteuid() != 0) if (fork() == 0) setsid(); }
"""
ALLOCATES = """#include <cstring>
#include <new>
int main() { while (true) std::memset(new char[1 << 20], 1, 1 << 20); }
"""
FILES = """#include <fstream>
#include <string>
#include <unistd.h>
int main() { for (int i = 0; i < 1000000; ++i) std::ofstream(std::to_string(i)) << i; pause(); }
"""
SOCKETS = """#include <cerrno>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
int main() {
  sockaddr_in far{}; far.sin_family = AF_INET; far.sin_port = htons(9); far.sin_addr.s_addr = htonl(0xc0000201);
  int s = socket(AF_INET, SOCK_DGRAM, 0);
  if (sendto(s, "x", 1, 0, (sockaddr*)&far, sizeof far) >= 0) return 10;
  sockaddr_un suite{AF_UNIX, SUITE};
  s = socket(AF_UNIX, SOCK_STREAM, 0);
  if (s >= 0 && connect(s, (sockaddr*)&suite, sizeof suite) == 0) return 11;
  return access(KEY, R_OK) == 0 ? 12 : 0;
}
"""
HANDS = """#include <csignal>
#include <fcntl.h>
#include <initializer_list>
#include <unistd.h>
int main() {
  for (const char* path : {"/etc/x", "/usr/x", "/x", OUTSIDE}) if (open(path, O_WRONLY | O_CREAT, 0600) >= 0) return 20;
  if (kill(getppid(), 0) == 0) return 21;  // would it reach it?
  return 0;
}
"""
ARGUMENTS = """#include <cstdio>
#include <unistd.h>
int main(int argc, char** argv) {
  for (int i = 1; i < argc; ++i) std::printf("[%s]", argv[i]);
  return access(argv[5], R_OK);
}
"""
TEMPLATES = """template <int A, int B> struct T { using type = typename T<A - 1, 2 * B>::type; char c[A]; static constexpr int v = T<A - 1, 2 * B>::v + T<A - 1, 2 * B + 1>::v; };
template <int B> struct T<0, B> { using type = int; static constexpr int v = B; };
int main() { return T<24, 0>::v; }
"""


def lane_processes():
    found = []
    for entry in pathlib.Path("/proc").glob("[0-9]*"):
        try:
            # A zombie only waits for the process that inherited it.
            if entry.stat().st_uid == USER and (entry / "stat").read_text().rsplit(")", 1)[1].split()[0] != "Z":
                found.append(int(entry.name))
        except OSError:
            pass
    return found


def cgroups():
    return {str(p) for p in pathlib.Path("/sys/fs/cgroup").glob("**/srfs_lane.*")}


class LaneTest(unittest.TestCase):
    def setUp(self):
        self.folder, lock = temporary_folder()
        os.chmod(self.folder, 0o755)
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)
        self.addCleanup(os.close, lock)
        self.cgroups = cgroups()
        self.mounts = pathlib.Path("/proc/self/mounts").read_text()

    def assert_nothing_left(self):
        self.assertEqual(lane_processes(), [])
        self.assertFalse((self.folder / "work/job").exists())
        self.assertEqual(pathlib.Path("/proc/self/mounts").read_text(), self.mounts)
        self.assertEqual({c for c in cgroups() - self.cgroups if c.split(".")[1] == str(self.pid)}, set())

    def command(self, what, *arguments):
        return [LANE, what, "--work", self.folder / "work", "--report", self.folder / "report.json", "--uid", str(USER), "--gid", str(USER),
                "--normal-priority", *map(str, arguments)]  # fmt: skip

    def run_lane(self, what, *arguments):
        self.lane = subprocess.Popen(self.command(what, *arguments), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.pid = self.lane.pid
        self.output, _ = self.lane.communicate(timeout=150)
        report = json.loads((self.folder / "report.json").read_text()) if (self.folder / "report.json").exists() else None
        self.assertIsNotNone(report, self.output)
        self.assert_nothing_left()
        return self.lane.returncode, report

    def sources(self, **files):
        shutil.rmtree(self.folder / "src", ignore_errors=True)
        for name, text in files.items():
            path = self.folder / "src" / f"{name}.cpp"
            path.parent.mkdir(exist_ok=True)
            path.write_text(text)
        return self.folder / "src"

    def build(self, sources, *arguments):
        return self.run_lane("build", "--sources", sources, "--name", "probe", "--out", self.folder / "probe", "--log", self.folder / "log", *arguments)

    def log(self):
        return (self.folder / "log").read_text()

    def built(self, text):
        """Builds a source without the precompiled header, which it does not need. Returns the program's path."""
        code, report = self.build(self.sources(main=text), "--no-precompiled-header")
        self.assertEqual((code, report["outcome"]), (0, "built"), self.log())
        return self.folder / "probe"


class BuildTest(LaneTest):
    def test_a_payload_node_is_built_from_its_sources(self):
        shutil.copytree(ROOT / "mission/payload_eps", self.folder / "src/mission/payload_eps", ignore=shutil.ignore_patterns("test", "*_model.*"))
        arguments = ("--option", "-O2", "--require", "limits")
        for _ in range(2):
            code, report = self.build(self.folder / "src", *arguments)
            self.assertEqual((code, report["outcome"]), (0, "built"), self.log())
            self.assertTrue(report["precompiled_header"])
        self.assertNotIn("precompile", self.output)
        self.assertIn("compile 1/2 mission/payload_eps/eps_profile.cpp\ncompile 2/2 mission/payload_eps/main.cpp\nlink\n", self.output)
        program = (self.folder / "probe").read_bytes()
        self.assertEqual((report["octets"], report["sha256"]), (len(program), hashlib.sha256(program).hexdigest()))
        self.assertIn("--deployment", subprocess.run([self.folder / "probe", "--help"], capture_output=True, text=True, timeout=30).stdout)
        self.assertEqual(self.log(), "")

        code, again = self.build(self.folder / "src", *arguments, "--no-precompiled-header")
        self.assertEqual((code, again["precompiled_header"]), (0, False))

    def test_an_error_is_in_the_log_and_no_program_comes_out(self):
        code, report = self.build(self.sources(main="int main() { return undeclared; }"), "--no-precompiled-header")
        self.assertEqual((code, report["outcome"]), (1, "compiler_failed"))
        self.assertIn("main.cpp:1:21: error: ‘undeclared’ was not declared", self.log())
        self.assertFalse((self.folder / "probe").exists())
        code, report = self.build(self.sources(main="int missing(); int main() { return missing(); }"), "--no-precompiled-header")
        self.assertEqual((code, report["outcome"]), (1, "compiler_failed"))
        self.assertIn("undefined reference", self.log())

    def test_a_long_log_keeps_its_ends(self):
        text = "#include <vector>\n" + "".join(f"#warning {'x' * 200} {i}\n" for i in range(1000)) + "int main() {}\n"
        code, _ = self.build(self.sources(main=text), "--no-precompiled-header", "--log-kib", "16")
        self.assertEqual(code, 0)
        log = self.log()
        self.assertLess(len(log), 17 << 10)
        self.assertIn("octets left out", log)

    def test_sources_with_links_are_refused(self):
        sources = self.sources(main="int main() {}")
        (sources / "shadow.cpp").symlink_to("/etc/shadow")
        code, report = self.build(sources)
        self.assertEqual((code, report["outcome"]), (2, "sandbox_failed"))

    def test_foreign_files_do_not_come_into_the_program(self):
        for text in ('asm(".incbin \\"/etc/shadow\\""); int main() {}', '#include "/etc/shadow"\nint main() {}',
                     f'asm(".incbin \\"{self.folder}/var/keys/key\\""); int main() {{}}'):  # fmt: skip
            key = self.folder / "var/keys/key"
            key.parent.mkdir(parents=True, exist_ok=True)
            key.write_text("secret")
            for mode in ((), ("--no-namespaces",)):
                code, report = self.build(self.sources(main=text), "--no-precompiled-header", *mode)
                self.assertEqual((code, report["outcome"]), (1, "compiler_failed"), text)

    def test_endless_input_ends_at_a_limit(self):
        for device in ("zero", "urandom", "random"):
            code, report = self.build(self.sources(main=f'#include "/dev/{device}"\nint main() {{}}'), "--no-precompiled-header",
                                      "--memory-mib", "128", "--seconds", "10")  # fmt: skip
            self.assertIn((code, report["outcome"]), ((1, "compiler_failed"), (3, "memory_limit"), (3, "time_limit")), self.log())

    def test_includes_without_end(self):
        code, report = self.build(self.sources(main='#include "main.cpp"\n'), "--no-precompiled-header", "--seconds", "20")
        self.assertEqual((code, report["outcome"]), (1, "compiler_failed"))
        self.assertIn("nested depth", self.log())
        # 2^40 inclusions, but never nested deeply
        text = "#if __INCLUDE_LEVEL__ < 40\n" + 2 * '#include "main.cpp"\n' + "#endif\n"
        code, report = self.build(self.sources(main=text), "--no-precompiled-header", "--seconds", "3")
        self.assertEqual((code, report["outcome"]), (3, "time_limit"), self.log())

    def test_templates_that_eat_memory(self):
        code, report = self.build(self.sources(main=TEMPLATES), "--no-precompiled-header", "--memory-mib", "96", "--seconds", "30")
        self.assertEqual((code, report["outcome"]), (3, "memory_limit"), self.log())

    def test_a_compiler_that_computes_for_ever(self):
        text = "template <int N> struct F { enum { v = F<N - 1>::v + F<N - 2>::v }; }; constexpr long f(long n) { long s = 0; for (long i = 0; i < n; ++i) s += i; return s; }\n" + \
            "".join(f"static_assert(f(30000000 + {i}) != 1);\n" for i in range(1)) + "".join(f"constexpr long g{i} = f(200000 + {i});\n" for i in range(3000)) + "int main() {}\n"  # fmt: skip
        code, report = self.build(self.sources(main=text), "--no-precompiled-header", "--cpu-s", "2", "--seconds", "60")
        self.assertIn((code, report["outcome"]), ((3, "cpu_limit"), (1, "compiler_failed")), self.log())
        code, report = self.build(self.sources(main=text.replace("static_assert", "//")), "--no-precompiled-header", "--cpu-s", "2", "--seconds", "60")
        self.assertEqual((code, report["outcome"]), (3, "cpu_limit"), self.log())
        code, report = self.build(self.sources(main=text.replace("static_assert", "//")), "--no-precompiled-header", "--seconds", "1")
        self.assertEqual((code, report["outcome"]), (3, "time_limit"), self.log())

    def test_output_without_end(self):
        code, report = self.build(self.sources(main="char big[1UL << 30] = {1}; int main() {}"), "--no-precompiled-header", "--file-mib", "8", "--seconds", "60")
        self.assertEqual((code, report["outcome"]), (3, "output_too_large"), self.log())
        code, report = self.build(self.sources(main='asm(".fill 0x10000000"); int main() {}'), "--no-precompiled-header", "--work-mib", "16", "--seconds", "60")
        self.assertIn((code, report["outcome"]), ((3, "quota"), (3, "output_too_large"), (3, "memory_limit")), self.log())

    def test_a_pragma_loads_no_plugin(self):
        code, report = self.build(self.sources(main='#pragma GCC optimize("-fplugin=/tmp/evil.so")\n#pragma GCC optimize("fplugin=evil")\nint main() {}'), "--no-precompiled-header")
        self.assertIn(report["outcome"], ("built", "compiler_failed"))
        self.assertIn("bad option", self.log())

    def test_rules_of_how_to_build_are_not_taken_from_sources(self):
        code, report = self.build(self.sources(main="int main() {}"), "--option", "-fplugin=x")
        self.assertEqual(code, 2)

    def run_lane(self, what, *arguments):
        if "-fplugin=x" in arguments:
            run = subprocess.run(self.command(what, *arguments), stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30)
            return run.returncode, None
        return super().run_lane(what, *arguments)


class EndedLaneTest(LaneTest):
    def start(self):
        text = "constexpr long f(long n) { long s = 0; for (long i = 0; i < n; ++i) s += i; return s; }\n" + \
            "".join(f"constexpr long g{i} = f(200000 + {i});\n" for i in range(20000)) + "int main() {}\n"  # fmt: skip
        sources = self.sources(main=text)
        lane = subprocess.Popen(self.command("build", "--sources", sources, "--name", "probe", "--out", self.folder / "probe", "--log", self.folder / "log",
                                             "--no-precompiled-header"), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)  # fmt: skip
        self.pid = lane.pid
        self.addCleanup(lane.stdout.close)
        self.assertTrue(lane.stdout.readline().startswith("compile 1/1"))
        return lane

    def test_sigterm_cancels(self):
        lane = self.start()
        lane.send_signal(signal.SIGTERM)
        self.assertEqual(lane.wait(timeout=20), 4)
        self.assertEqual(json.loads((self.folder / "report.json").read_text())["outcome"], "cancelled")
        self.assert_nothing_left()

    def test_sigkill_at_any_instant_leaves_no_process_and_the_next_one_tidies_up(self):
        killed = set()
        for delay_ms in (0, 1, 2, 5, 10, 20, 50, 100, 300):
            sources = self.sources(main="int main() { while (true) {} }\n" + "int f();\n" * 100000)
            lane = subprocess.Popen(self.command("build", "--sources", sources, "--name", "probe", "--out", self.folder / "probe", "--log", self.folder / "log",
                                                 "--no-precompiled-header"), stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL)  # fmt: skip
            time.sleep(delay_ms / 1000)
            lane.kill()
            lane.wait()
            killed.add(str(lane.pid))
            wait_until(lambda: not lane_processes(), 10, "all of a killed lane has ended")
        code, report = self.build(self.sources(main="int main() {}"), "--no-precompiled-header")
        self.assertEqual((code, report["outcome"]), (0, "built"))
        self.assertEqual([c for c in cgroups() if c.split(".")[1] in killed], [])
        self.assertEqual(sorted(p.name for p in (self.folder / "work").iterdir()), ["lock"])

    def test_one_lane_at_a_time_in_a_folder(self):
        lane = self.start()
        second = subprocess.run(self.command("build", "--sources", self.folder / "src", "--name", "x", "--out", self.folder / "x", "--log", self.folder / "xlog"),
                                stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=20)  # fmt: skip
        self.assertEqual(second.returncode, 2)
        self.assertIn("another srfs-lane is using it", second.stderr)
        lane.terminate()
        lane.wait(timeout=20)


class SelfTestTest(LaneTest):
    def judge(self, program, *arguments, seconds=10, deployment="name: test\n"):
        (self.folder / "deployment.yaml").write_text(deployment)
        return self.run_lane("self-test", "--program", program, "--name", "probe", "--deployment", self.folder / "deployment.yaml", "--seconds", seconds, *arguments)

    def test_its_verdict_is_its_exit_code(self):
        program = self.built("int main(int, char** v) { return v[1][2] == 's' ? 0 : 9; }")
        self.assertEqual(self.judge(program)[1]["outcome"], "passed")
        program = self.built('#include <cstdio>\nint main() { std::puts("the sensor does not answer"); return 6; }')
        code, report = self.judge(program)
        self.assertEqual((code, report["outcome"], report["last_lines"]), (1, "failed", "the sensor does not answer\n"))

    def test_it_gets_its_arguments(self):
        code, report = self.judge(self.built(ARGUMENTS), "--domain", "77")
        self.assertEqual(code, 0)
        job = self.folder / "work/job"
        self.assertEqual(report["last_lines"], f"[--self-test][--name][probe][--deployment][{job}/deployment/deployment.yaml][--var][{job}/var][--domain][77]")

    def test_it_finds_what_its_deployment_extends(self):
        (self.folder / "other.yaml").write_text("name: test\n")
        program = self.built('#include <fstream>\n#include <string>\nint main(int, char** v) {\n'
                             '  return std::ifstream(std::string(v[5], std::string(v[5]).rfind(\'/\')) + "/other.yaml") ? 0 : 6;\n}')  # fmt: skip
        self.assertEqual(self.judge(program, deployment="extends: other\n")[1]["outcome"], "passed")
        code, report = self.judge(program, deployment="extends: nothing\n")
        self.assertEqual(code, 2)
        self.assertIn("'extends'", report["reason"])

    def test_crashes_and_hangs(self):
        code, report = self.judge(self.built("int main() { __builtin_trap(); }"))
        self.assertEqual((code, report["outcome"]), (1, "crashed"))
        self.assertIn("signal 4", report["reason"])
        self.assertEqual(self.judge(self.built("int main() { return 1; }"))[1]["outcome"], "crashed")
        endless = self.built("int main() { for (volatile int i = 0;; i = i + 1) {} }")
        self.assertEqual(self.judge(endless, seconds=1)[:2][1]["outcome"], "hung")
        self.assertEqual(self.judge(endless, "--cpu-s", "1", seconds=60)[1]["outcome"], "cpu_limit")

    @unittest.skipUnless(ROOT_USER, "needs a user of its own")
    def test_bombs(self):
        forks, allocates, files = (self.keep(self.built(text), name) for name, text in (("forks", FORKS), ("allocates", ALLOCATES), ("files", FILES)))
        for mode in ((), ("--no-namespaces",)):
            code, report = self.judge(forks, *mode, seconds=2)
            self.assertIn((code, report["outcome"]), ((3, "process_limit"), (1, "hung")))
            code, report = self.judge(allocates, "--memory-mib", "128", *mode, seconds=20)
            self.assertIn((code, report["outcome"]), ((3, "memory_limit"), (1, "crashed")))
            code, report = self.judge(files, *mode, seconds=30)
            self.assertEqual((code, report["outcome"]), (3, "quota"))

    def keep(self, program, name):
        return program.rename(self.folder / name)

    @unittest.skipUnless(ROOT_USER, "needs a user of its own")
    def test_it_reaches_nothing_outside(self):
        import socket

        suite = self.folder / "suite"
        listening = socket.socket(socket.AF_UNIX)
        self.addCleanup(listening.close)
        listening.bind(str(suite))
        listening.listen()
        suite.chmod(0o777)
        key = self.folder / "var/keys/key"
        key.parent.mkdir(parents=True)
        key.write_text("secret")
        sockets = self.keep(self.built(SOCKETS.replace("SUITE", f'"{suite}"').replace("KEY", f'"{key}"')), "sockets")
        hands = self.keep(self.built(HANDS.replace("OUTSIDE", f'"{self.folder}/outside"')), "hands")
        code, report = self.judge(sockets)
        if "network" in report["layers"]["in_force"]:
            self.assertEqual((code, report["outcome"]), (0, "passed"), report)
        for mode in ((), ("--no-namespaces",)):
            code, report = self.judge(hands, *mode)
            self.assertEqual((code, report["outcome"]), (0, "passed"), report)

    @unittest.skipUnless(ROOT_USER and shutil.which("setpriv"), "needs setpriv")
    def test_as_root_in_a_plain_container_the_floor_holds(self):
        program = self.built("#include <unistd.h>\nint main() { return geteuid() == 0; }")
        plain = ["setpriv", "--bounding-set", "-sys_admin", "--inh-caps", "-all"]
        command, self.command = self.command, lambda *a: [*plain, *command(*a)]
        code, report = self.judge(program)
        self.assertEqual((code, report["outcome"]), (0, "passed"), report)
        self.assertLessEqual({"user", "system_calls", "limits"}, set(report["layers"]["in_force"]))
        self.assertNotIn("processes", report["layers"]["in_force"])
        self.assertIn("EPERM", report["layers"]["failures"]["processes"])
        code, report = self.judge(program, "--require", "processes")
        self.assertEqual((code, report["outcome"]), (2, "sandbox_failed"))
        self.assertEqual(report["reason"], "required but not available: processes")


if __name__ == "__main__":
    unittest.main()
