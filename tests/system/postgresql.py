# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A PostgreSQL of a test, in a folder, at a UNIX socket there (tests/postgresql_cluster.hpp does the same for unit tests)."""

import os
import pathlib
import pwd
import shutil
import signal
import subprocess

from srfs.flight.processes import wait_until

PROGRAMS = max(pathlib.Path("/usr/lib/postgresql").glob("*/bin/initdb"), default=pathlib.Path("/none/initdb")).parent
IS_INSTALLED = (PROGRAMS / "initdb").exists()


class PostgresqlCluster:
    def __init__(self, folder):
        self.home = pathlib.Path(folder) / "postgresql"
        self.home.mkdir()
        self.address = f"postgresql://srfs@/postgres?host={self.home}"
        self.as_user = ["setpriv"]
        if os.geteuid() == 0:  # PostgreSQL refuses to run as root
            user = pwd.getpwnam("postgres")
            os.chown(self.home, user.pw_uid, user.pw_gid)
            pathlib.Path(folder).chmod(0o711)
            self.as_user += ["--reuid=postgres", "--regid=postgres", "--clear-groups"]
        self.as_user += ["--pdeathsig", "QUIT"]
        made = [PROGRAMS / "initdb", "--auth=trust", "--username=srfs", "--no-sync", "--encoding=UTF8", "--locale=C", "--pgdata", self.home / "data"]
        subprocess.run([*self.as_user, *made], check=True, capture_output=True)
        self.process = None
        self.start()

    def start(self):
        options = ["-c", "listen_addresses=", "-c", "fsync=off", "-c", "log_min_messages=panic"]
        self.process = subprocess.Popen([*self.as_user, PROGRAMS / "postgres", "-D", self.home / "data", "-k", self.home, *options])
        wait_until(self._is_ready, 60, "PostgreSQL takes connections")

    def _is_ready(self):
        try:
            lines = (self.home / "data/postmaster.pid").read_text().splitlines()
        except OSError:
            return False
        return len(lines) > 7 and lines[0] == str(self.process.pid) and lines[7].startswith("ready")

    def stop(self, signal_number=signal.SIGQUIT):
        """SIGQUIT: at once, as a crash; SIGINT: in order."""
        self.process.send_signal(signal_number)
        self.process.wait(timeout=60)

    def end(self):
        self.stop()
        shutil.rmtree(self.home)
