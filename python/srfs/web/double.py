# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A double of the HTTP API of `srfs-ground serve` for the page alone: it plays a record of the stream, at any speed, and takes what a test
puts in. It encodes nothing: what the API does is tested with the real server."""

import functools
import http.server
import itertools
import json
import os
import pathlib
import threading
import time
import urllib.parse
from datetime import datetime, timezone

from mission_dictionary import Dictionary

from srfs import ROOT

TYPES = {".html": "text/html; charset=utf-8", ".css": "text/css", ".js": "text/javascript", ".json": "application/json", ".svg": "image/svg+xml"}
TOKEN = "double"
KEPT = 5000  # objects of the stream for a page that resumes


def iso(seconds):
    return datetime.fromtimestamp(seconds, timezone.utc).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def seconds_of(text):
    return datetime.fromisoformat(text.replace("Z", "+00:00")).timestamp()


def field_json(field, enums):
    entry = {"name": field["name"], "type": field["type"], "unit": field.get("unit", ""), "description": field.get("description", "")}
    if "enum" in field:
        entry["enum"] = enums[field["enum"]]["labels"]
    if "range" in field:
        entry["min"], entry["max"] = field["range"]
    if "default" in field:
        entry["default"] = field["default"]
    if "max" in field:
        entry["length"] = field["max"]
    if "reference" in field:
        entry["reference"] = field["reference"]
    limits = {}
    for kind, colour in (("soft", "yellow"), ("hard", "red")):
        for bound, side in zip(field.get("limits", {}).get(kind, (None, None)), ("low", "high")):
            if bound is not None:
                limits[f"{colour}_{side}"] = bound
    if limits:
        entry["limits"] = limits
    return entry


def laid_out(dictionary, fields):
    for field in fields:
        if "structure" in field:
            yield from laid_out(dictionary, dictionary.structure_of[field["structure"]]["fields"])
        else:
            yield field


@functools.cache  # reading it takes longer than a test
def dictionary_json():
    """The dictionary of the mission as GET /api/v1/dictionary has it; not to be changed."""
    dictionary = Dictionary(ROOT / "mission")
    enums = dictionary.enums
    telecommands = [{"name": c["name"], "description": c["description"], "node": c["node"], "apid": dictionary.apid_of[c["node"]],
                     "service": c.get("service", [8, 1])[0], "subtype": c.get("service", [8, 1])[1], "hazardous": c.get("hazardous", False),
                     "repeat": c.get("repeat", "at_most_once"), "modes": c.get("modes", []), "timeout_s": c.get("timeout_ms", 10000) / 1000,
                     "arguments": [field_json(a, enums) for a in c["arguments"]]} for c in dictionary.commands]
    structures = [{"name": s["name"], "id": s.get("id"), "subsystem": s.get("node", ""), "interval_s": s.get("interval_ms", 0) / 1000,
                   "parameters": [field_json(f, enums) for f in laid_out(dictionary, s["fields"])]} for s in dictionary.structures]
    events = [{"name": e["name"], "id": e["id"], "severity": e["severity"], "text": e["text"]} for e in dictionary.events]
    return {"mission": "SRFS", "telecommands": telecommands, "structures": structures, "events": events,
            "stores": [s["name"] for s in dictionary.stores], "nodes": sorted(dictionary.apid_of)}


class Double:
    """The station that pages see. put() is what comes from the spacecraft; posted are the orders of pages."""

    def __init__(self, root=ROOT / "ground" / "web", files=None):
        self.root, self.files = root, files
        self.dictionary = dictionary_json()
        self.changed = threading.Condition()
        self.stream, self.next_id = [], 1
        self.values, self.history, self.events, self.commands, self.gaps, self.passes = {}, {}, [], [], [], []
        self.posted = []
        self.refusals = {}  # path -> (status, answer) of the next order to it
        self.answered = {}  # Idempotency-Key -> (status, answer)
        self.answers_lost = 0  # the next so many orders are carried out, and get no answer
        self.station = {"line": "open", "locked": True, "mode": "nominal"}
        self.access = "command"  # of the token

    def put(self, kind, item, now=None):
        """Something comes: it is kept, and every page gets it."""
        now = now or time.time()
        with self.changed:
            archived = kind in ("tm_packet", "beacon", "event")
            number = self.next_id if archived else None
            self.next_id += archived
            if kind == "event":
                item = {**item, "id": number}
                self.events.append(item)
            if "structure" in item and item.get("vc") == 0:
                self.values[item["structure"]] = {"time": item["time"], "received": iso(now), **{k: item[k] for k in ("fields", "units", "limits")}}
                for name, value in item["fields"].items():
                    points = self.history.setdefault(f"{item['structure']}.{name}", [])
                    points.append({"time": item["time"], "value": value})
                    del points[:-4000]
            self.stream.append((number, kind, item, iso(now)))
            del self.stream[:-KEPT]
            self.changed.notify_all()

    def answer_post(self, path, query, body):
        self.posted.append((path, body))
        if path in self.refusals:
            return self.refusals.pop(path)
        if self.access == "observe":
            return 403, {"error": "this token may only observe"}
        if path == "telecommands":
            given = json.loads(body)
            if given.get("check"):
                return 200, {"octets": "00"}
            return 202, {"token": str(len(self.posted)), "id": f"{len(self.posted):08x}"}
        return 202, {"id": f"{len(self.posted)}"}

    def answer_get(self, path, query):
        if path == "dictionary":
            return self.dictionary
        if path == "station":
            return {**self.station, "server_time": iso(time.time())}
        if path == "latest":
            return {"id": self.next_id - 1, "values": self.values}
        if path == "history":
            begin = query.get("from", [""])[0]
            return {"parameter": query["parameter"][0], "points": [p for p in self.history.get(query["parameter"][0], []) if p["time"] >= begin]}
        if path == "events":
            return self.events[-500:]
        if path == "files":
            return [{"name": f.name, "octets": f.stat().st_size, "time": iso(f.stat().st_mtime), "type": f.suffix[1:]} for f in sorted(pathlib.Path(self.files).glob("*")) if f.is_file()] if self.files else []
        return {"commands": self.commands, "gaps": self.gaps, "passes": self.passes}.get(path, [])

    def play(self, record, speed, ended):
        """Plays @p record (JSON lines of a session or of the stream) again and again, its times moved to now, until @p ended."""
        items = [json.loads(line) for line in pathlib.Path(record).read_text().splitlines()]
        items = [item for item in items if item.get("type") in ("tm_packet", "beacon", "event", "stats")]
        times = [seconds_of(item["time"]) for item in items if "time" in item]
        first, length = min(times), max(times) - min(times) + 1
        begin = time.time()
        round_begin = begin
        while not ended.is_set():
            for item in items:
                if "time" in item:
                    due = round_begin + (seconds_of(item["time"]) - first) / speed
                    if ended.wait(max(0, due - time.time())):
                        return
                    item = {**item, "time": iso(due)}
                self.put(item["type"], item)
            round_begin += length / speed


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def log_message(self, *_):
        pass

    def _answer(self, code, body, kind="application/json"):
        octets = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(code)
        self.send_header("Content-Type", kind)
        self.send_header("Content-Length", str(len(octets)))
        self.send_header("Content-Security-Policy", "default-src 'self'")
        self.end_headers()
        self.wfile.write(octets)

    def do_GET(self):
        double = self.server.double
        url = urllib.parse.urlsplit(self.path)
        query = urllib.parse.parse_qs(url.query)
        if not url.path.startswith("/api/v1/"):
            file = double.root / (url.path.lstrip("/") or "index.html")
            if not file.is_file() or ".." in url.path:
                return self._answer(404, {"error": "no such file"})
            return self._answer(200, file.read_bytes(), TYPES.get(file.suffix, "application/octet-stream"))
        if TOKEN not in (self.headers.get("Authorization", "").removeprefix("Bearer "), query.get("token", [""])[0]):
            return self._answer(401, {"error": "no token"})
        path = url.path.removeprefix("/api/v1/")
        if path == "stream":
            return self._stream(query)
        if path.startswith("files/"):
            return self._answer(200, (pathlib.Path(double.files) / urllib.parse.unquote(path[6:])).read_bytes(), "application/octet-stream")
        with double.changed:
            answer = double.answer_get(path, query)
            return self._answer(200, answer)

    def do_POST(self):
        url = urllib.parse.urlsplit(self.path)
        body = self.rfile.read(int(self.headers.get("Content-Length", 0)))
        double, key = self.server.double, self.headers.get("Idempotency-Key", object())
        if key not in double.answered:
            double.answered[key] = double.answer_post(url.path.removeprefix("/api/v1/"), urllib.parse.parse_qs(url.query), body)
        if double.answers_lost:
            double.answers_lost -= 1
            self.close_connection = True
            return
        self._answer(*double.answered[key])

    def _stream(self, query):
        double = self.server.double
        self.send_response(200)
        self.send_header("Content-Type", "text/event-stream")
        self.end_headers()
        after = self.headers.get("Last-Event-ID") or query.get("after", [None])[0]
        with double.changed:
            at = next((i for i, (number, *_) in enumerate(double.stream) if after is not None and number and number > int(after)), len(double.stream))
            seen = [(number, kind, {**item, "received": received}) for number, kind, item, received in double.stream[at:]]
            last = double.stream[-1] if double.stream else None
        self._write(seen)
        try:
            while not self.server.ended.is_set():
                with double.changed:
                    double.changed.wait(0.2)
                    at = next((i + 1 for i in range(len(double.stream) - 1, -1, -1) if double.stream[i] is last), 0)
                    news = double.stream[at:]
                    last = double.stream[-1] if double.stream else None
                self._write(news)
        except OSError:
            pass
        self.close_connection = True

    def _write(self, items):
        text = "".join((f"id: {number}\n" if number else "") + f"event: {kind}\ndata: {json.dumps(item)}\n\n" for number, kind, item, *_ in items)
        if text:
            self.wfile.write(text.encode())
            self.wfile.flush()


def own_address(numbers=itertools.count(1)):
    """An address of the loopback network that no other server of this machine has: a browser keeps nothing of another site, and its port stays free while
    it is down."""
    pid, number = os.getpid(), next(numbers)
    return f"127.{1 + pid // 250 % 250}.{1 + pid % 250}.{1 + number % 250}"


class Server(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def __init__(self, double, address=None):
        super().__init__(address or (own_address(), 0), Handler)
        self.double, self.ended = double, threading.Event()
        self.url = f"http://{self.server_address[0]}:{self.server_address[1]}/"
        threading.Thread(target=self.serve_forever, args=(0.02,), daemon=True).start()  # shutdown() waits so long

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.ended.set()
        self.shutdown()
        self.server_close()
