# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of ground/web in a real browser: alone, with a double of the API, and with `srfs-ground serve --web` and the simulation."""

import contextlib
import json
import signal
import time
import unittest
import urllib.error
import urllib.request

from support import BIN, DEADLINE_S, ROOT, SystemTest

from srfs.flight.processes import send_signal, wait_while_it_goes_on
from srfs.flight.serving import GroundServer
from srfs.web.browser import browser, missing, wait_for
from srfs.web.double import Double, Server, iso, own_address

PAGE = ROOT / "ground" / "web"
PAGE_OCTETS_MAX = 300 * 1024


class Page:
    """What a test does with the page: as an operator would, by what can be seen."""

    def __init__(self, driver, url):
        self.driver = driver
        self.url = url

    def open(self, view="overview"):
        self.driver.get(self.url)
        self.wait("return document.body.classList.contains('ready')", "the page is ready")
        self.go(view)

    def go(self, view):
        self.run("location.hash = arguments[0]", f"#/{view}")
        self.wait("return location.hash === arguments[0] && document.querySelector('main > *') !== null", view, f"#/{view}")

    def run(self, script, *values):
        return self.driver.execute_script(script, *values)

    def wait(self, script, what, *values, deadline_s=DEADLINE_S):
        return wait_for(lambda: self.run(script, *values), what, deadline_s)

    def text(self, selector):
        return self.run("return [...document.querySelectorAll(arguments[0])].map((e) => e.innerText).join('\\n')", selector)

    def wait_for_text(self, selector, text):
        return self.wait("return [...document.querySelectorAll(arguments[0])].some((e) => e.innerText.includes(arguments[1]))", f"{text!r} in {selector}", selector, text)

    def type(self, selector, text):
        """As by hand: the field gets the text, and an event of input."""
        self.run("const e = document.querySelector(arguments[0]); e.focus(); e.value = arguments[1]; e.dispatchEvent(new Event('input', {bubbles: true}))", selector, text)

    def click(self, selector):
        self.wait("const e = document.querySelector(arguments[0]); if (!e || e.disabled) return false; e.click(); return true", f"{selector} can be clicked", selector)

    def argument(self, name, text):
        self.type(f"[data-argument='{name}'] :is(input, select)", text)

    def complaints(self):
        """Errors of the page itself: a script that fails, something that the content security policy stops."""
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] == "SEVERE" and "ERR_CONNECTION" not in entry["message"] and "Failed to load resource" not in entry["message"]]


def needs_browser(test):
    if packages := missing():
        test.fail(f"missing: apt-get install {' '.join(packages)}")


def packet(structure, fields, sequence=1, units=None, limits=None):
    return {"type": "tm_packet", "vc": 0, "apid": 2, "source": "timing", "service": 3, "subtype": 25, "sequence": sequence, "time": iso(time.time()),
            "structure": structure, "fields": fields, "units": units or {}, "limits": limits or {}}


def event(text, sequence, name="test.event", severity="high"):
    return {"type": "event", "vc": 0, "apid": 1, "source": "ttc", "service": 5, "sequence": sequence, "time": iso(time.time()), "event": name, "severity": severity, "text": text, "fields": {}}


class OneBrowser:
    """A browser for all tests of a class: each serves its page at an address of its own, which is another site for the browser."""

    @classmethod
    def setUpClass(cls):
        if missing():
            return
        cls.browsing = browser()
        cls.driver = cls.browsing.__enter__()

    @classmethod
    def tearDownClass(cls):
        if not missing():
            cls.browsing.__exit__(None, None, None)


class PageTest(OneBrowser, unittest.TestCase):
    """The page with a double: what no spacecraft does on demand."""

    def setUp(self):
        needs_browser(self)
        self.double = Double()
        self.server = Server(self.double)
        self.addCleanup(lambda: self.server.__exit__())
        self.page = Page(self.driver, f"{self.server.url}#token=double")
        self.addCleanup(lambda: self.assertEqual(self.page.complaints(), []))

    def test_the_page_is_small_and_loads_nothing_from_elsewhere(self):
        files = [file for file in PAGE.rglob("*") if file.suffix in (".html", ".css", ".js", ".json", ".svg")]
        self.assertLessEqual(sum(file.stat().st_size for file in files), PAGE_OCTETS_MAX)
        for file in files:
            text = file.read_text().replace("http://www.w3.org/2000/svg", "")
            self.assertNotIn("http://", text, file.name)
            self.assertNotIn("https://", text, file.name)
            for forbidden in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", " eval(", "new Function"):
                self.assertFalse(forbidden in text, f"{file.name}: text of the spacecraft could become HTML ({forbidden})")

    def check(self, module, *expected):
        """Compares expressions of a module's exports `m` with their values."""
        expressions = ", ".join(expression for expression, _ in expected)
        script = f"const done = arguments[0]; import('{self.server.url}{module}').then((m) => done(JSON.stringify([{expressions}])), (error) => done(JSON.stringify(String(error))))"
        found = json.loads(self.driver.execute_async_script(script))
        self.assertEqual(dict(zip([expression for expression, _ in expected], found)), dict(expected))

    def test_values_times_and_spans_read_well(self):
        self.page.open()
        self.check("format.js", ("m.value_text(7.8830933)", "7.883"), ("m.value_text(-0.00000321)", "-3.210e-6"), ("m.value_text(12)", "12"), ("m.value_text(null)", "unknown"), ("m.value_text(0)", "0"),
                                 ("m.value_text('0x07')", "0x07"), ("m.span_text(850)", "850 ms"), ("m.span_text(200000)", "3 min 20 s"), ("m.span_text(-90000)", "-90 s"), ("m.span_text(97200000)", "1 d 3 h"),
                                 ("m.bounds_text(7, 8.3)", "7 … 8.3"), ("m.bounds_text(undefined, 0)", "≤ 0"), ("m.version_text(128)", "0.2.0"), ("m.octets_text(46981)", "45.9 KiB"),
                                 ("m.parse_time('10m', 1000000)", 400000), ("m.parse_time('+30s', 1000)", 31000), ("m.parse_time('2026-11-26 20:57', 0)", 1795726620000), ("m.parse_time('soon', 0)", None),
                                 ("m.search(['eps.switch_load', 'ttc.set_mode', 'time.set_report_rate'], 'set mo', (t) => t)", ["ttc.set_mode"]))  # fmt: skip

    def test_a_plot_has_round_ticks_breaks_at_gaps_and_keeps_near_limits_in_sight(self):
        self.page.open()
        points = "[0, 1, 2, 3, 20, 21].map((t) => ({t: t * 1000, v: t}))"
        self.check("parts/plot.js", ("m.value_ticks(0, 10, 5)", [0, 2, 4, 6, 8, 10]), (f"m.first_at({points}, 2500)", 3), (f"m.break_after({points})", 5000), ("m.time_step(600000, 10)", 60000),
                                  (f"m.extent([{{points: {points}, limits: {{yellow_high: 22, red_high: 1000}}}}], {{from: 0, to: 30000}}).high < 100", True),
                                  (f"m.extent([{{points: {points}, limits: {{yellow_high: 22}}}}], {{from: 0, to: 30000}}).high > 22", True))  # fmt: skip
        # A quarter turn about z takes x to y.
        self.check("parts/attitude.js", ("m.rotate([0, 0, Math.SQRT1_2, Math.SQRT1_2], [1, 0, 0]).map((v) => Math.round(v * 1e9) / 1e9)", [0, 1, 0]))

    def test_a_value_that_changes_is_seen(self):
        self.page.open("parameters")
        for value in (1.5, 2.25):
            self.double.put("tm_packet", packet("timing", {"offset_us": value}, units={"offset_us": "us"}))
            self.page.wait_for_text("section[data-name='timing'] td.value", f"{value:.3f}")

    def test_a_filter_holds_for_what_comes_later(self):
        self.page.open("parameters?filter=offset")
        self.double.put("tm_packet", packet("timing", {"offset_us": 1.5, "drift_ppm": 2.5}))
        self.double.put("tm_packet", packet("ttc", {"frames_sent": 1}))
        self.page.wait("return document.querySelector(\"section[data-name='ttc']\")?.hidden === true", "the other structure came, and is hidden")
        self.assertEqual(self.page.run("return [...document.querySelectorAll('.structure tr')].filter((e) => e.offsetParent).length"), 1)

    def test_a_value_outside_its_limits_has_a_shape_and_a_word(self):
        self.page.open("overview")
        self.double.put("tm_packet", packet("timing", {"offset_us": 7000.0}, limits={"offset_us": "red"}))
        self.page.wait_for_text("ul.limits li.red", "red")
        self.page.wait("return document.querySelector('ul.limits li.red svg.red') !== null", "the shape of a red limit")
        self.page.wait_for_text("#bar .limits", "1 red")

    def test_text_of_the_spacecraft_stays_text(self):
        evil = "<img src=x onerror=\"document.title='caught'\"><script>document.title='caught'</script>\u202e\x1b[31m"
        self.page.open("events")
        self.double.put("event", event(evil, 1))
        self.page.wait_for_text("table.events td.text", "<img src=x")
        self.double.put("tm_packet", packet("timing", {"sync_state": evil}))
        self.page.go("parameters?filter=sync_state")
        self.page.wait_for_text("section[data-name='timing'] td.value", "<img")
        self.double.put("file", {"type": "file", "id": "2:1", "name": evil, "direction": "down", "octets": 10, "progress": 3, "event": "progress", "state": "under way"})
        self.page.go("files")
        self.page.wait_for_text(".transfer .name", "<img src=x")
        self.assertEqual(self.page.run("return document.querySelectorAll('main img, main script').length"), 0)
        self.assertNotIn("caught", self.driver.title)

    def test_a_reload_loses_nothing(self):
        self.page.open("events")
        for number in range(5):
            self.double.put("event", event(f"number {number}", number))
        self.page.wait_for_text("table.events td.text", "number 4")
        before = self.page.text("table.events td.text")
        self.driver.refresh()
        self.page.wait_for_text("table.events td.text", "number 4")
        self.assertEqual(self.page.text("table.events td.text"), before)
        self.assertTrue(self.driver.current_url.endswith("#/events"), "the same view, and no token in the address")

    def test_a_server_that_was_gone_is_found_again_and_no_packet_is_missing(self):
        self.page.open("events")
        self.double.put("event", event("before", 1))
        self.page.wait_for_text("table.events td.text", "before")
        address = self.server.server_address
        self.server.__exit__()
        self.page.wait("return !document.getElementById('banner').hidden", "the banner")
        self.double.put("event", event("meanwhile", 2))
        self.server = Server(self.double, address)
        self.page.wait_for_text("table.events td.text", "meanwhile")
        self.page.wait("return document.getElementById('banner').hidden", "the banner goes")
        self.double.put("event", event("after", 3))
        self.page.wait_for_text("table.events td.text", "after")
        texts = self.page.text("table.events td.text").split("\n")
        self.assertEqual(sorted(texts), ["after", "before", "meanwhile"], "each once")

    def test_what_a_new_connection_replays_is_as_old_as_it_is(self):
        self.page.open("overview")
        self.double.put("tm_packet", packet("health", {"mode": "nominal"}))
        self.page.wait_for_text("#bar .mode", "nominal")
        address = self.server.server_address
        self.server.__exit__()
        self.page.wait("return !document.getElementById('banner').hidden", "the banner")
        received = time.time() - 600
        self.double.put("tm_packet", packet("health", {"mode": "safe"}, sequence=2), now=received)
        self.double.put("tm_packet", packet("timing", {"offset_us": 1.0}, limits={"offset_us": "red"}), now=received)
        self.server = Server(self.double, address)
        self.page.wait_for_text("#bar .mode", "safe, 10 min")
        self.page.wait_for_text("#bar .limits", "1 of old values")
        self.assertTrue(self.page.run("return srfs.model.value('health.mode').stale"))
        self.double.put("tm_packet", packet("health", {"mode": "nominal"}, sequence=3))
        self.page.wait("return document.querySelector('#bar .mode .value').innerText === 'nominal'", "a fresh value has no age")

    def test_an_order_whose_answer_is_lost_is_repeated_and_carried_out_once(self):
        self.page.open("commands/eps.switch_load")
        self.page.argument("load", "2")
        self.page.wait("return document.querySelector('form.command .send').disabled === false", "the form is good")
        sent = lambda: [body for path, body in self.double.posted if path == "telecommands" and not json.loads(body).get("check")]  # noqa: E731
        self.double.answers_lost = 2
        self.page.click("form.command .send")
        self.page.wait_for_text("#toasts", "eps.switch_load is on its way")
        self.assertEqual(len(sent()), 1)
        # No answer at all: the operator sends it again, which is the same order.
        self.double.answers_lost = 1000  # a browser repeats a request by itself, too
        self.page.click("form.command .send")
        self.page.wait_for_text("#toasts", "eps.switch_load: no answer")
        self.double.answers_lost = 0
        self.page.click("form.command .send")
        self.page.wait("return srfs.model.own.size === 2", "it was answered")
        self.assertEqual(len(sent()), 2, sent())

    def test_a_refused_order_of_keys_cop1_or_a_transfer_is_shown(self):
        self.page.open("link")
        self.double.put("file", {"type": "file", "id": "2:1", "name": "a.bin", "direction": "down", "octets": 10, "progress": 3, "event": "progress", "state": "under way"})
        self.double.refusals = {"keys": (409, {"error": "keys: the disk is full"}), "cop": (503, {"error": "cop: the line is closed"}), "transfers/2%3A1": (409, {"error": "transfer: no server"})}
        button = "return [...document.querySelectorAll('main button')].some((b) => b.innerText.includes(arguments[0]) && !b.disabled && (b.click(), true))"
        self.page.wait(button, "keys", "Ground: set b")
        self.page.wait("return document.querySelector('dialog[open] button.primary') !== null", "the question")
        self.page.click("dialog[open] button.primary")
        self.page.wait_for_text("#toasts", "keys: the disk is full")
        self.page.wait(button, "AD off", "AD off")
        self.page.wait_for_text("#toasts", "cop: the line is closed")
        self.page.go("files")
        self.page.wait(button, "the transfer", "Cancel")
        self.page.wait_for_text("#toasts", "transfer: no server")
        self.double.put("file", {"type": "file", "id": "2:1", "name": "a.bin", "direction": "down", "octets": 10, "progress": 3, "event": "finished", "state": "ended", "success": False, "condition": "cancel received"})
        self.page.wait_for_text("#toasts", "a.bin: the transfer has failed (cancel received)")
        self.double.put("cop", {"type": "cop", "service": "off", "state": "initial", "problem": "T1 ended too often", "clcw": None})
        self.page.wait_for_text("#toasts", "The AD service has ended: T1 ended too often")

    def test_the_ad_service_is_one_for_all_pages_and_is_not_ended_unasked_while_it_carries_something(self):
        self.page.open("commands/eps.switch_load")
        self.double.put("cop", {"type": "cop", "service": "on", "state": "active", "clcw": None})
        self.page.wait_for_text("form.command label.check", "on, for all pages of this server")
        self.page.go("link")
        self.double.refusals = {"cop": (409, {"error": "2 under way", "under_way": 2})}
        self.page.wait("return [...document.querySelectorAll('main button')].some((b) => b.innerText === 'AD off' && !b.disabled && (b.click(), true))", "AD off")
        self.page.wait_for_text("dialog[open]", "2 telecommands of the pages of this server are under way")
        self.page.click("dialog[open] button.primary")
        self.page.wait_for_text("#toasts", "The AD service ends")
        self.assertEqual([json.loads(body) for path, body in self.double.posted if path == "cop"], [{"order": "ad_off"}, {"order": "ad_off", "drop": True}])

    def test_a_page_that_may_only_observe_offers_no_order(self):
        self.double.access = "observe"
        self.page.open("commands/eps.switch_load")
        self.page.wait_for_text("form.command .refusal", "only observe")
        self.assertTrue(self.page.run("return document.querySelector('form.command .send').disabled"))

    def test_a_telecommand_that_the_mode_refuses_is_grey_and_says_why(self):
        self.double.station["mode"] = None
        self.page.open("commands/image.capture")
        self.assertTrue(self.page.run("return document.querySelector('form.command .refusal').hidden"), "an unknown mode refuses nothing")
        self.double.put("tm_packet", packet("health", {"mode": "safe"}))
        self.page.wait_for_text("form.command .refusal", "not allowed in mode safe")
        self.page.wait_for_text(".telecommands .refused", "image.capture")
        self.page.argument("task", "1")
        self.page.wait("const e = document.querySelector('form.command .send'); return !e.disabled && e.textContent === 'Send anyway'", "an operator who knows better")
        self.double.put("tm_packet", packet("health", {"mode": "nominal"}))
        self.page.wait("return document.querySelector('form.command .refusal').hidden", "the reason goes")

    def test_enter_in_a_field_sends_nothing_and_control_enter_sends(self):
        from selenium.webdriver.common.keys import Keys
        self.page.open("commands/eps.switch_load")
        self.page.argument("load", "2")
        self.page.wait("return document.querySelector('form.command .send').disabled === false", "the form is good")
        sent = lambda: [body for path, body in self.double.posted if path == "telecommands" and not json.loads(body).get("check")]  # noqa: E731
        self.page.run("document.querySelector('[data-argument=load] input').focus()")
        self.driver.switch_to.active_element.send_keys(Keys.ENTER)
        self.assertEqual(sent(), [])
        self.driver.switch_to.active_element.send_keys(Keys.CONTROL, Keys.ENTER)
        self.page.wait_for_text("#toasts", "eps.switch_load is on its way")
        self.assertEqual([json.loads(body) for body in sent()], [{"name": "eps.switch_load", "arguments": {"load": "2"}}])

    def test_keys_reach_every_view_and_the_palette_every_telecommand(self):
        from selenium.webdriver.common.keys import Keys
        self.page.open("overview")
        body = lambda *keys: self.driver.switch_to.active_element.send_keys(*keys)  # noqa: E731
        for key, view in (("2", "parameters"), ("5", "events"), ("9", "link"), ("1", "overview")):
            body(key)
            self.page.wait("return location.hash === arguments[0]", view, f"#/{view}")
        body(Keys.CONTROL, "k")
        self.page.wait("return document.querySelector('dialog.palette input') === document.activeElement", "the palette")
        body(Keys.NULL)
        body("set_mode", Keys.ENTER)
        self.page.wait_for_text("form.command h2", "ttc.set_mode")

    def test_a_plot_shows_what_the_archive_has_and_what_comes(self):
        for number in range(20):
            self.double.put("tm_packet", packet("timing", {"offset_us": float(number)}, sequence=number))
        self.page.open("plots?p=timing.offset_us")
        newest = "return document.querySelector('time-plot')?.series[0]?.points.at(-1)?.v === arguments[0]"
        self.page.wait(newest, "the points of the archive", 19)
        self.double.put("tm_packet", packet("timing", {"offset_us": 99.0}, sequence=21))
        self.page.wait(newest, "a live point", 99)

    def test_a_layout_of_the_operators_own_is_kept(self):
        self.double.put("tm_packet", packet("timing", {"offset_us": 1.0}))
        self.page.open("overview")
        self.page.run("localStorage.setItem('srfs.layouts', JSON.stringify({mine: {title: 'Mine', panels: [{panel: 'values', title: 'My clock', parameters: ['timing.offset_us']}]}}))")
        self.page.go("overview/mine")
        self.page.wait_for_text("main .panel h2", "My clock")
        self.page.run("localStorage.removeItem('srfs.layouts')")


# Puts the form of each telecommand of the list into the page, with its arguments, and notes what it shows: [name, "good" or "refused", Send is
# disabled]. Without the address: a browser changes that 200 times in 10 s at most.
FORMS = """
const [wanted] = arguments;
const found = (window.found = []);
const { model } = srfs;
const context = { model, api: model.api, signal: new AbortController().signal };
import(new URL("parts/command_form.js", document.baseURI)).then(async ({ CommandForm }) => {
  for (const [name, values] of wanted) {
    const form = new CommandForm(context, model.telecommand_of.get(name), values).element;
    document.querySelector("main").append(form);
    while (!form.dataset.checked) await new Promise((resolve) => setTimeout(resolve, 2));
    found.push([form.dataset.name, form.dataset.checked, form.querySelector(".send").disabled]);
    form.remove();
  }
});
"""


class PageFlightTest(OneBrowser, SystemTest):
    """The page with the real server and the simulated spacecraft."""

    @contextlib.contextmanager
    def operated_flight(self):
        needs_browser(self)
        with self.flight() as flight:
            log = self.var / "log" / "serve.log"
            self.server = GroundServer(BIN, self.var, flight.deployment, f"{own_address()}:0", log)
            try:
                page = Page(self.driver, self.server.url)
                page.open()
                yield flight, page
                self.assertEqual(page.complaints(), [])
            finally:
                self.server.stop()

    def api(self, path, body=None):
        """(status, answer) of a request with the token that commands."""
        known = json.loads(self.server.web_file.read_text())
        request = urllib.request.Request(f"{known['url']}/api/v1/{path}", data=None if body is None else json.dumps(body).encode(),
                                         headers={"Authorization": f"Bearer {known['command']}", "Content-Type": "application/json"})  # fmt: skip
        try:
            with urllib.request.urlopen(request, timeout=DEADLINE_S) as answer:
                return answer.status, json.load(answer)
        except urllib.error.HTTPError as error:
            return error.code, json.load(error)

    def wait_for_verdict(self, page, name, verdict):
        page.wait("return [...document.querySelectorAll(`.sent > li[data-name='${arguments[0]}']`)].some((e) => e.dataset.verdict === arguments[1])", f"{name} {verdict}", name, verdict)

    def test_an_operator_commands_the_spacecraft_by_the_page(self):
        with self.operated_flight() as (_, page):
            page.go("commands/eps.switch_load")
            page.argument("load", "9")
            page.wait_for_text("form.command .problem", "9 is out of range 0..3")
            self.assertTrue(page.run("return document.querySelector('form.command .send').disabled"))
            page.argument("load", "2")
            page.argument("state", "on")
            page.click("form.command .send")
            self.wait_for_verdict(page, "eps.switch_load", "completed")
            page.go("parameters?filter=load_switches")
            page.wait_for_text("section[data-name='payload_eps'] td.value", "0x07")

            page.go("commands/eps.power_cycle_peripheral")
            page.argument("off_ms", "100")
            page.wait("return document.querySelector('form.command').dataset.checked === 'good'", "the server encodes it")
            self.assertTrue(page.run("return document.querySelector('form.command .send').disabled"), "not armed")
            page.type("form.command .hazard input", "eps.power_cycle_peripheral")
            page.click("form.command .send")
            self.wait_for_verdict(page, "eps.power_cycle_peripheral", "completed")

            page.go("commands/image.capture")
            page.argument("task", "7")
            page.argument("frames", "2")
            page.argument("exposure_us", "50000")
            page.click("form.command .send")
            self.wait_for_verdict(page, "image.capture", "completed")
            page.go("files")
            page.wait("return document.querySelector('figure.whole')?.dataset.state === 'shown'", "the picture")
            page.wait_for_text(".task .words", "streaks")
            drawn = int(page.wait("return document.querySelector('figure.whole').dataset.findings", "its findings"))
            findings = json.loads(next((self.var / "ground/files").glob("*_findings.json")).read_text())
            self.assertEqual(drawn, sum(streak["frame"] == 0 for streak in findings["streaks"]))

            up = self.folder / "up.bin"
            up.write_bytes(bytes(range(256)) * 80)
            page.driver.find_element("css selector", "input[type=file]").send_keys(str(up))
            page.wait("return document.querySelector(\".transfer[data-name='up.bin'][data-ended='true'] .shape.done\") !== null", "the file is up")
            self.assertEqual((self.var / "files/up.bin").read_bytes(), up.read_bytes())

            page.driver.refresh()
            page.wait("return document.querySelector('figure.whole')?.dataset.state === 'shown'", "the picture again")
            page.wait("return document.querySelector(\".transfer[data-name='up.bin'][data-ended='true'] .shape.done\") !== null", "the file is still up")
            page.go("commands")
            self.wait_for_verdict(page, "eps.switch_load", "completed")
            self.wait_for_verdict(page, "image.capture", "completed")

    def test_an_operator_schedules_acknowledges_retrieves_and_turns_the_ad_service_on(self):
        with self.operated_flight() as (_, page):
            page.go("link")
            page.run("[...document.querySelectorAll('button')].find((b) => b.textContent === 'AD on').click()")
            page.wait("return srfs.model.cop.service === 'on'", "the AD service is on")
            page.wait_for_text("section[aria-label='COP-1'] dd", "on")

            page.go("commands/eps.switch_load?load=3&state=on")
            page.type("form.command input[aria-label='When']", "+1h")
            page.click("form.command .send")
            self.wait_for_verdict(page, "schedule.insert", "completed")
            page.go("schedule")
            page.run("[...document.querySelectorAll('button')].find((b) => b.textContent === 'Ask the spacecraft').click()")
            page.wait_for_text("main tbody td", "eps.switch_load load=3 state=on")

            page.go("events")
            page.type("input.operator", "Maria")
            page.click("button.ack")
            page.wait("return document.querySelector('table.events .shape.done') !== null", "acknowledged")
            self.assertEqual([e["acknowledged"]["who"] for e in self.api("events")[1] if e.get("acknowledged")][0][:5], "Maria")

            page.go("gaps")
            page.type("main form input[aria-label='From']", "5m")
            page.run("[...document.querySelectorAll('main form button')].find((b) => b.textContent === 'Retrieve').click()")
            page.wait_for_text("#toasts", "A retrieval has ended")

    def test_every_form_refuses_what_the_server_refuses(self):
        with self.operated_flight() as (_, page):
            telecommands = self.api("dictionary")[1]["telecommands"]
            self.assertGreater(len(telecommands), 100)
            wanted = []
            for telecommand in telecommands:
                wanted.append((telecommand["name"], {}))
                for argument in telecommand["arguments"][:1]:
                    wanted.append((telecommand["name"], {argument["name"]: "no such value" * 40}))
            page.run(FORMS, wanted)
            tried = lambda: page.run("return window.found.length")  # noqa: E731
            wait_while_it_goes_on(lambda: tried() == len(wanted), tried, DEADLINE_S, "all forms")
            shown = page.run("return window.found")
            hazardous = {t["name"] for t in telecommands if t["hazardous"]}
            refused = 0
            for (name, values), (shown_name, state, disabled) in zip(wanted, shown):
                self.assertEqual(name, shown_name)
                # A choice of the page cannot hold another text than its own.
                status, answer = self.api("telecommands", {"name": name, "arguments": {k: v for k, v in values.items() if self.can_hold(telecommands, name, k)}, "check": True})
                self.assertEqual(state, "good" if status == 200 else "refused", f"{name} {values}: {answer}")
                self.assertEqual(disabled, status != 200 or name in hazardous, name)
                refused += status != 200
            self.assertGreater(refused, 100, "the test has refused telecommands")
            page.driver.get(self.server.observing_url())
            page.wait("return document.body.classList.contains('observe') && document.body.classList.contains('ready')", "the page of an observer")
            page.go("commands/eps.switch_load")
            page.wait_for_text("form.command .refusal", "only observe")

    @staticmethod
    def can_hold(telecommands, name, argument):
        entry = next(a for t in telecommands if t["name"] == name for a in t["arguments"] if a["name"] == argument)
        return "enum" not in entry and entry["type"] != "bool"

    def test_a_killed_server_comes_back_without_a_gap_and_without_a_reload(self):
        with self.operated_flight() as (flight, page):
            page.run("window.kept = true; window.seen = []; srfs.model.on('packet', (p) => window.seen.push([p.apid, p.sequence, p.vc]))")
            page.wait("return window.seen.length > 20", "packets")
            address = self.server.url.split("/#")[0].removeprefix("http://")
            send_signal(self.server.process.pid, signal.SIGKILL)
            self.server.process.wait()
            page.wait("return !document.getElementById('banner').hidden", "the banner")
            had = page.run("return window.seen.length")
            self.server.stop()
            self.server = GroundServer(BIN, self.var, flight.deployment, address, self.var / "log" / "serve.log")
            page.wait("return document.getElementById('banner').hidden && window.seen.length > arguments[0] + 20", "packets again", had)
            self.assertTrue(page.run("return window.kept"), "no reload")
            newest = self.api("latest")[1]["id"]
            page.wait("return Number(srfs.model.stream.last) >= arguments[0]", "all that the archive had", newest)
            seen = page.run("return window.seen")
            self.assertEqual(len({tuple(one) for one in seen}), len(seen), "nothing twice")
            archived = {(p["apid"], p["sequence"]) for p in self.api("packets?limit=5000")[1] if p["type"] in ("tm_packet", "beacon") and "structure" in p and p["id"] <= newest}
            first = min((s for s in seen), key=seen.index)
            missing = archived - {(apid, sequence) for apid, sequence, _ in seen}
            before = [p for p in self.api("packets?limit=5000")[1] if (p["apid"], p["sequence"]) == (first[0], first[1])]
            after = {(p["apid"], p["sequence"]) for p in self.api("packets?limit=5000")[1] if before and p["id"] > before[0]["id"] and p["id"] <= newest and "structure" in p and p["type"] in ("tm_packet", "beacon")}
            self.assertEqual(missing & after, set(), "every packet of the archive since the first one")
