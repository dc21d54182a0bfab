# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs-ground serve --web`: the HTTP API over a real server and spacecraft, and what strangers cannot do to it."""

import contextlib
import http.client
import json
import os
import random
import select
import signal
import socket
import ssl
import subprocess
import threading
import time
import unittest
from pathlib import Path

from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until


class WebServer:
    """`srfs-ground serve --web 0`, started again after each kill()."""

    def __init__(self, var, *options):
        self.var = var
        self.options = options
        self.start()

    def start(self):
        command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), "serve", "--web", "0", *self.options]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout.readline().startswith("serving")
        line = self.process.stdout.readline()
        assert line.startswith("web: http://127.0.0.1:") and "/#token=" in line, line
        self.file = json.loads((self.var / "ground/web.json").read_text())
        self.port = int(self.file["url"].rsplit(":", 1)[1])

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def end(self):
        self.process.terminate()
        self.process.wait(timeout=DEADLINE_S)
        self.process.stdout.close()
        return self.process.returncode

    def gateway(self):
        """The process of the web gateway."""
        children = Path(f"/proc/{self.process.pid}/task/{self.process.pid}/children").read_text().split()
        return int(children[0])

    def ask(self, method, path, body=None, token="command", headers=None, raw=False):
        connection = http.client.HTTPConnection("127.0.0.1", self.port, timeout=DEADLINE_S)
        fields = dict(headers or {})
        if token:
            fields["Authorization"] = "Bearer " + self.file.get(token, token)
        text = body if body is None or isinstance(body, bytes) else json.dumps(body)
        connection.request(method, path if raw else "/api/v1/" + path, text, fields)
        response = connection.getresponse()
        content = response.read()
        connection.close()
        return response.status, content if raw else json.loads(content)

    def telecommand(self, name, **fields):
        return self.ask("POST", "telecommands", {"name": name, **fields})


class Stream:
    """Reads server-sent events in a thread, and connects again with the last id as a browser does."""

    def __init__(self, web, after=None):
        self.web = web
        self.events = []
        self.last = after
        self.connections = 0
        self.ended = False
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()

    def read(self):
        while not self.ended:
            with contextlib.suppress(OSError, http.client.HTTPException):
                self.read_once()
            time.sleep(0.05)

    def read_once(self):
        self.connection = http.client.HTTPConnection("127.0.0.1", self.web.port, timeout=15)
        headers = {} if self.last is None else {"Last-Event-ID": str(self.last)}
        self.connection.request("GET", "/api/v1/stream?token=" + self.web.file["observe"], headers=headers)
        response = self.connection.getresponse()
        self.connections += 1
        event = {}
        while not self.ended:
            line = response.readline()
            if not line:
                return
            name, _, value = line.decode().rstrip("\n").partition(": ")
            if name in ("id", "event", "data"):
                event[name] = value
            elif not name and event:
                if "id" in event:
                    self.last = int(event["id"])
                self.events.append((int(event.get("id", 0)), event["event"], json.loads(event["data"])))
                event = {}

    def stages(self, **wanted):
        return [data["stage"] for _, kind, data in list(self.events) if kind == "tc_stage" and wanted.items() <= data.items()]

    def end(self):
        self.ended = True
        with contextlib.suppress(OSError, AttributeError):
            self.connection.sock.shutdown(socket.SHUT_RDWR)
        self.thread.join(DEADLINE_S)


class WebTest(SystemTest):
    @contextlib.contextmanager
    def web_flight(self, *options):
        with self.flight():
            web = WebServer(self.var, *options)
            streams = []
            try:
                yield web, lambda *a: streams.append(Stream(web, *a)) or streams[-1]
            finally:
                for stream in streams:
                    stream.end()
                self.assertEqual(web.end(), 0)

    def wait_for_stage(self, stream, stage, **wanted):
        wait_until(lambda: stage in stream.stages(**wanted) or stream.stages(final=True, **wanted), DEADLINE_S, f"{wanted} ends")
        self.assertIn(stage, stream.stages(**wanted), wanted)

    def stalled_reader(self, web):
        """Asks for everything there is, and reads nothing."""
        connection = socket.socket()
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
        connection.connect(("127.0.0.1", web.port))
        connection.sendall(f"GET /api/v1/stream?after=0&token={web.file['observe']} HTTP/1.1\r\nHost: 127.0.0.1:{web.port}\r\n\r\n".encode())
        self.addCleanup(connection.close)

    def test_telecommands_go_up_and_what_happens_comes_down_while_another_reader_stalls(self):
        with self.web_flight() as (web, open_stream):
            stream = open_stream()
            wait_until(lambda: stream.events, DEADLINE_S, "the stream begins")
            self.stalled_reader(web)
            wait_until(lambda: web.ask("GET", "station")[1]["readers"] == 2, DEADLINE_S, "two readers")
            status, sent = web.telecommand("eps.switch_load", arguments={"load": 2, "state": "on"})
            self.assertEqual(status, 202, sent)
            self.wait_for_stage(stream, "completed", token=sent["token"])
            self.assertEqual(stream.stages(token=sent["token"])[:2], ["sent", "accepted"])
            # Those of others, too.
            self.assertEqual(self.ground_run("tc", "eps.switch_load", "load=1", "state=on", "--wait").returncode, 0)
            others = lambda: [d for _, kind, d in list(stream.events) if kind == "tc_stage" and "who" in d]  # noqa: E731
            wait_until(lambda: "completed" in [d["stage"] for d in others()], DEADLINE_S, "the stream has it, too")
            self.assertEqual([d["stage"] for d in others()][:2], ["sent", "accepted"])
            self.assertIn("tc", others()[0]["who"])
            # A hazardous one is armed first, and only with its name typed again.
            hazardous = {"arguments": {"off_ms": 100}}
            status, refused = web.telecommand("eps.power_cycle_peripheral", **hazardous)
            self.assertEqual((status, refused["hazardous"]), (409, True))
            self.assertEqual(web.telecommand("eps.power_cycle_peripheral", **hazardous, arm=True, confirm="yes")[0], 400)
            status, sent = web.telecommand("eps.power_cycle_peripheral", **hazardous, arm=True, confirm="eps.power_cycle_peripheral")
            self.assertEqual(status, 202, sent)
            self.wait_for_stage(stream, "completed", token=sent["token"], command="eps.power_cycle_peripheral")
            self.assertIn("completed", stream.stages(token=sent["token"], arms="eps.power_cycle_peripheral"))
            # What it knows.
            timing = lambda: web.ask("GET", "latest", token="observe")[1]["values"].get("timing")  # noqa: E731
            wait_until(timing, DEADLINE_S, "timing's telemetry has come")
            self.assertIn("fields", timing())
            status, station = web.ask("GET", "station", token="observe")
            self.assertEqual((station["line"], station["locked"]), ("open", True))
            names = [c["name"] for c in web.ask("GET", "commands?limit=10")[1]]
            self.assertEqual(names[-2:], ["ttc.arm", "eps.power_cycle_peripheral"])
            history = lambda: web.ask("GET", "history?parameter=timing.offset_us&from=10m")[1]  # noqa: E731
            wait_until(lambda: history()["points"], DEADLINE_S, "an offset is known")
            self.assertEqual((history()["unit"], history()["minutes"]), ("us", False))
            dictionary = json.loads(self.ground_run("dictionary").stdout)
            self.assertEqual(web.ask("GET", "dictionary")[1], dictionary)
            # A file goes up; one that came is read.
            content = random.Random(1).randbytes(3000)
            status, put = web.ask("POST", "uplink?name=up.bin", content)
            self.assertEqual(status, 202, put)
            wait_until(lambda: (self.var / "files/up.bin").exists(), DEADLINE_S, "the file is on board")
            self.assertEqual((self.var / "files/up.bin").read_bytes(), content)
            (self.var / "ground/files/note.txt").write_text("hello")
            self.assertEqual(web.ask("GET", "/api/v1/files/note.txt", raw=True), (200, b"hello"))
            card = lambda text: text.ljust(80).encode()  # noqa: E731
            fits = [card("SIMPLE  =                    T"), card("BITPIX  =                   16"), card("NAXIS   =                    2")]
            fits += [card("NAXIS1  =                   64"), card("NAXIS2  =                   64"), card("END")]
            (self.var / "ground/files/a.fits").write_bytes(b"".join(fits).ljust(2880) + (bytes(range(256)) * 32).ljust(3 * 2880, b"\0"))
            self.assertEqual({f["name"]: f["type"] for f in web.ask("GET", "files")[1]}, {"note.txt": "text", "a.fits": "picture"})
            status, picture = web.ask("GET", "/api/v1/files/a.fits?view=png", raw=True)
            self.assertEqual((status, picture[:4]), (200, b"\x89PNG"))
            self.assertEqual(web.ask("GET", "/api/v1/files/note.txt?view=png", raw=True)[0], 409)
            # An event is acknowledged, once.
            event = web.ask("GET", "events?limit=1")[1][0]
            self.assertEqual(web.ask("POST", f"events/{event['id']}/acknowledge", {"who": "Ada"})[0], 200)
            self.assertEqual(web.ask("POST", f"events/{event['id']}/acknowledge")[0], 409)
            acknowledged = [e["acknowledged"]["who"] for e in web.ask("GET", "events")[1] if e["acknowledged"]]
            self.assertEqual([who.split(" (")[0] for who in acknowledged], ["Ada"])
            # The reader that takes nothing is disconnected; the other one never was.
            burst = lambda: [web.telecommand("housekeeping.one_shot", arguments={"structure": "health"}) for _ in range(5)]  # noqa: E731
            wait_until(lambda: burst() and web.ask("GET", "station")[1]["readers"] == 1, 2 * DEADLINE_S, "the stalled reader is gone")
            self.assertEqual(stream.connections, 1)

    def test_strangers_learn_nothing_and_disturb_nobody(self):
        with self.web_flight() as (web, open_stream):
            self.assertEqual((self.var / "ground/web.json").stat().st_mode & 0o777, 0o600)
            self.assertEqual(web.ask("GET", "station", token=None)[0], 401)
            self.assertEqual(web.ask("GET", "station", token="x" * 64)[0], 401)
            ping = {"name": "ttc.ping"}
            self.assertEqual(web.ask("POST", "telecommands", ping, token="observe")[0], 403)
            self.assertEqual(web.ask("GET", "station", headers={"Host": "evil.example"})[0], 403)
            self.assertEqual(web.ask("POST", "telecommands", ping, headers={"Origin": "http://evil.example"})[0], 403)
            self.assertEqual(web.ask("POST", "telecommands", ping, headers={"Origin": web.file["url"]})[0], 202)
            for path in ("/../web.json", "/%2e%2e/web.json", "/api/v1/files/..%2fweb.json", "/api/v1/files/%2e%2e", "//etc/passwd"):
                status, content = web.ask("GET", path, raw=True)
                self.assertIn(status, (400, 404), path)
                self.assertNotIn(web.file["command"].encode(), content)
            stream = open_stream()
            wait_until(lambda: stream.events, DEADLINE_S, "the stream begins")
            gateway = web.gateway()
            self.send_rubbish(web, int(os.environ.get("SRFS_WEB_REQUESTS", "1000")))
            # Connections that say nothing take all places, and give way.
            idle = [socket.create_connection(("127.0.0.1", web.port)) for _ in range(150)]
            self.assertEqual(web.ask("GET", "station")[0], 200)
            for connection in idle:
                connection.close()
            known = len(stream.events)
            self.assertEqual(web.ask("POST", "telecommands", ping)[0], 202)
            wait_until(lambda: any(kind == "pong" for _, kind, _ in stream.events[known:]), DEADLINE_S, "the pong")
            self.assertEqual(stream.connections, 1, "the stream was not interrupted")
            self.assertEqual(web.gateway(), gateway, "it did not end")

    def test_an_order_that_is_repeated_with_its_key_is_carried_out_once(self):
        with self.web_flight() as (web, open_stream):
            stream = open_stream()
            wait_until(lambda: stream.events, DEADLINE_S, "the stream begins")
            order = {"name": "eps.switch_load", "arguments": {"load": 2, "state": "on"}}
            send = lambda body, key="order-1-of-this-test": web.ask("POST", "telecommands", body, headers={"Idempotency-Key": key})  # noqa: E731
            answers = []
            threads = [threading.Thread(target=lambda: answers.append(send(order))) for _ in range(8)]
            for thread in threads:
                thread.start()
            for thread in threads:
                thread.join()
            self.assertEqual(answers, [answers[0]] * 8)
            self.assertEqual(answers[0][0], 202, answers[0])
            self.assertEqual(send({**order, "arguments": {"load": 1, "state": "on"}})[0], 422)
            self.assertEqual(send(order, "a key")[0], 400)
            self.assertEqual(send(order, "order-2-of-this-test")[0], 202, "another key is another order")
            # Neither the end of the gateway nor that of the server makes it another order.
            for end in (lambda: os.kill(web.gateway(), signal.SIGKILL), web.kill):
                connections = stream.connections
                end()
                if web.process.poll() is not None:
                    web.start()
                wait_until(lambda c=connections: stream.connections > c, DEADLINE_S, "connected again")
                status, again = send(order)
                self.assertEqual((status, again["id"], again["repeated"]), (202, answers[0][1]["id"], True))
            rows = web.ask("GET", "commands?limit=10")[1]
            self.assertEqual([c["name"] for c in rows], ["eps.switch_load"] * 2)
            # What is nested deeply, and too short to be long, ends nothing.
            gateway = web.gateway()
            deep = b'{"name":"ttc.ping","arguments":' + b"[" * 30000 + b"]" * 30000 + b"}"
            for path in ("telecommands", "cop", "keys", "retrieve", "transfers/1:1", "events/1/acknowledge"):
                self.assertEqual(web.ask("POST", path, deep)[0], 400, path)
            self.assertEqual(web.gateway(), gateway)

    def test_an_order_whose_server_was_killed_is_of_unknown_outcome_and_not_carried_out_again(self):
        with self.web_flight("--no-archive") as (web, _):
            orders = {"uplink?name=up.bin": b"octets", "telecommands": {"name": "eps.switch_load", "arguments": {"load": 2, "state": "on"}}}
            journal = self.var / "ground/web_orders"
            for number, (path, body) in enumerate(orders.items()):
                key = f"killed-order-{number}"
                send = lambda p=path, b=body, k=key: web.ask("POST", p, b, headers={"Idempotency-Key": k})  # noqa: E731
                ended = []

                def order(send=send, ended=ended):
                    with contextlib.suppress(OSError, http.client.HTTPException):
                        ended.append(send())

                web.process.send_signal(signal.SIGSTOP)
                ordering = threading.Thread(target=order)
                ordering.start()
                wait_until(lambda k=key: k in journal.read_text(), DEADLINE_S, "the order is begun")
                web.kill()  # and with it its gateway
                ordering.join(DEADLINE_S)
                # The gateway ends with its server; when it noticed that before its own end, it said what it knows.
                self.assertIn([(status, answer["outcome"]) for status, answer in ended], ([], [(504, "unknown")]))
                web.start()
                status, again = send()
                self.assertEqual((status, again["outcome"]), (504, "unknown"), again)
            self.assertEqual(web.ask("GET", "transfers?live=true")[1], [], "the file is not on its way")
            self.assertEqual(web.ask("POST", "telecommands", orders["telecommands"], headers={"Idempotency-Key": "a-new-order"})[0], 202)
            sent = lambda: web.ask("GET", "station")[1]["telecommands_sent"]  # noqa: E731
            wait_until(sent, DEADLINE_S, "the new order is sent")
            self.assertEqual(sent(), 1, "by this server")

    def test_other_machines_need_tls_and_a_name_of_the_certificate(self):
        certificate, key = self.folder / "station.pem", self.folder / "station.key"
        command = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:P-256", "-nodes", "-days", "1", "-subj", "/CN=station.example"]
        command += ["-addext", "subjectAltName=DNS:station.example", "-keyout", str(key), "-out", str(certificate)]
        subprocess.run(command, check=True, capture_output=True)
        with self.web_flight() as (web, _):
            refused = self.ground_run("web", "0.0.0.0:0")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("--web-certificate and --web-key are needed", refused.stderr)
            command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), "web", "0.0.0.0:0", "--web-certificate", str(certificate)]
            second = subprocess.Popen([*command, "--web-key", str(key)], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
            line = second.stdout.readline()
            self.assertTrue(line.startswith("web: https://0.0.0.0:"), line)
            self.assertEqual(json.loads((self.var / "ground/web.json").read_text()), web.file, "the file is the first gateway's")
            port = int(line.split("/#")[0].rsplit(":", 1)[1])

            def ask(host):
                trusted = ssl.create_default_context(cafile=str(certificate))
                with socket.create_connection(("127.0.0.1", port), timeout=DEADLINE_S) as plain:
                    with trusted.wrap_socket(plain, server_hostname="station.example") as connection:
                        request = f"GET /api/v1/station HTTP/1.1\r\nHost: {host}:{port}\r\nAuthorization: Bearer {web.file['observe']}\r\n\r\n"
                        connection.sendall(request.encode())
                        return connection.recv(65536).split(b" ")[1]

            self.assertEqual(ask("station.example"), b"200")
            self.assertEqual(ask("evil.example"), b"403")
            self.assertEqual(ask("localhost"), b"403", "no name of the certificate")
            with socket.create_connection(("127.0.0.1", port), timeout=DEADLINE_S) as plain:
                plain.sendall(b"GET / HTTP/1.1\r\n\r\n")
                with contextlib.suppress(ConnectionResetError):
                    self.assertNotIn(b"HTTP", plain.recv(65536))
            second.terminate()
            self.assertEqual(second.wait(DEADLINE_S), 0)
            second.stdout.close()

    def send_rubbish(self, web, requests):
        """Requests changed at random, many on a connection."""
        rubbish = random.Random(2)
        token = web.file["observe"]
        good = (
            f"GET /api/v1/history?parameter=timing.offset_us&from=1m&points=5 HTTP/1.1\r\nHost: 127.0.0.1:{web.port}\r\nAuthorization: Bearer {token}\r\n\r\n",
            f"GET /api/v1/events?limit=3 HTTP/1.1\r\nHost: 127.0.0.1:{web.port}\r\nAuthorization: Bearer {token}\r\n\r\n",
            f'POST /api/v1/telecommands HTTP/1.1\r\nHost: 127.0.0.1:{web.port}\r\nContent-Length: 19\r\nAuthorization: Bearer {token}\r\n\r\n{{"name":"ttc.ping"}}',
            f"GET /api/v1/files/x?view=png HTTP/1.1\r\nHost: 127.0.0.1:{web.port}\r\n\r\n",
        )
        sent = 0
        while sent < requests:
            with contextlib.suppress(OSError):
                with socket.create_connection(("127.0.0.1", web.port), timeout=5) as connection:
                    for _ in range(20):
                        text = bytearray(rubbish.choice(good).encode())
                        for _ in range(rubbish.randrange(5)):
                            text[rubbish.randrange(len(text))] = rubbish.randrange(256)
                        sent += 1
                        if rubbish.random() < 0.1:
                            connection.sendall(text[: rubbish.randrange(len(text)) + 1])
                            break
                        connection.sendall(text)
                        if not select.select([connection], [], [], 0.05)[0] or not connection.recv(65536):
                            break

    def test_a_stream_goes_on_after_the_server_was_killed_without_loss_or_repetition(self):
        kills = int(os.environ.get("SRFS_WEB_KILLS", "2"))
        with self.web_flight() as (web, open_stream):
            stream = open_stream(0)
            moments = random.Random(3)
            for number in range(kills):
                known = len(stream.events)
                wait_until(lambda k=known: len([e for e in stream.events[k:] if e[0]]) > 3, DEADLINE_S, "packets come")
                web.telecommand("eps.switch_load", arguments={"load": 2, "state": "on"})
                time.sleep(moments.uniform(0, 0.3))  # any moment is as good as another
                web.kill() if number % 2 == 0 else os.kill(web.gateway(), signal.SIGKILL)
                if number % 2 == 0:
                    web.start()
            wait_until(lambda: stream.connections > kills, DEADLINE_S, "it is connected again")
            last = stream.last
            wait_until(lambda: stream.last > last, DEADLINE_S, "it goes on")
            stream.end()
            ids = [number for number, _, _ in stream.events if number]
            self.assertEqual(ids, sorted(set(ids)), "in order, none twice")
            archived = self.ground_run("--json", "packets")
            known = {json.loads(line)["id"] for line in archived.stdout.splitlines()}
            self.assertEqual({i for i in known if i <= ids[-1]} - set(ids), set(), "none is missing")


if __name__ == "__main__":
    unittest.main()
