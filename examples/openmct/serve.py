#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Serves this folder and Open MCT on loopback, and hands what the page reads to `srfs-ground serve --web`. Only GET, and with the token that
observes, which the browser never sees: whoever reaches this page can look and not command."""

import argparse
import http.client
import json
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from urllib.parse import urlsplit

HERE = Path(__file__).resolve().parent


class Handler(SimpleHTTPRequestHandler):
    def __init__(self, *args, web, **options):
        self.web = web
        super().__init__(*args, directory=str(HERE), **options)

    def do_GET(self):
        own = {f"{name}:{self.server.server_port}" for name in ("127.0.0.1", "localhost")}
        if self.headers.get("Host") not in own:
            self.send_error(403, "another site asks")
        elif self.path.startswith("/api/v1/"):
            self.hand_on()
        else:
            super().do_GET()

    def hand_on(self):
        station = urlsplit(self.web["url"])
        connection = http.client.HTTPConnection(station.hostname, station.port, timeout=30)
        headers = {"Authorization": "Bearer " + self.web["observe"]}
        if "Last-Event-ID" in self.headers:
            headers["Last-Event-ID"] = self.headers["Last-Event-ID"]
        try:
            connection.request("GET", self.path, headers=headers)
            response = connection.getresponse()
        except OSError as error:
            self.send_error(502, f"the station does not answer: {error}")
            return
        with response:
            self.send_response(response.status)
            self.send_header("Content-Type", response.getheader("Content-Type", "application/json"))
            self.end_headers()
            while octets := response.read1(65536):
                self.wfile.write(octets)
                self.wfile.flush()


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--web", type=Path, default=Path("var/ground/web.json"), help="of the station (default: %(default)s)")
    parser.add_argument("--port", type=int, default=8191)
    options = parser.parse_args()
    server = ThreadingHTTPServer(("127.0.0.1", options.port), partial(Handler, web=json.loads(options.web.read_text())))
    if not (HERE / "node_modules/openmct").exists():
        print("Open MCT is not here yet: npm install (README.md)", flush=True)
    print(f"http://127.0.0.1:{server.server_port}/", flush=True)
    server.serve_forever()


if __name__ == "__main__":
    main()
