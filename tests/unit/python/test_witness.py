# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The judge of the fencing campaign: each test makes up a violation that the judge must find."""

import unittest

from srfs.campaign import witness

MS = 1_000_000
ADCS, EPS, THERMAL = "payload_adcs", "payload_eps", "payload_thermal"
ADDRESS = {ADCS: 11, EPS: 12, THERMAL: 13}


def frame(at_ms, payload, data="0401017E9BCCCCCC"):
    return f"({at_ms // 1000}.{at_ms % 1000:03}000) can0 18DA{ADDRESS[payload]}01#{data}"


def flag(at_ms, number, holder, switcher=1, lease_ms=60):
    flags = [holder == p for p in ADDRESS]
    return {"type": "flags", "at_ns": at_ms * MS, "switcher": switcher, "grant": number, "holder": holder, "flags": flags,
            "published_ns": at_ms * MS, "lease_end_ns": (at_ms + lease_ms) * MS}  # fmt: skip


def bus(at_ms, number, payload, status="released", switcher=1, sent=3):
    return {"type": "bus", "at_ns": at_ms * MS, "said_ns": at_ms * MS, "switcher": switcher, "grant": number, "payload": payload, "status": status,
            "sent": sent, "detail": ""}  # fmt: skip


def telecommand(number, target=EPS, function=1):
    return {"type": "telecommand", "at_ns": 0, "id": number, "target": target, "function": function}


def report(number, stage, success=True, code=0, node=EPS):
    return {"type": "report", "at_ns": 0, "id": number, "node": node, "stage": stage, "success": success, "failure_code": code}


def flight():
    """A record of three correct slots."""
    lines, messages = [], []
    for number, payload in enumerate(ADDRESS, 1):
        start = 1000 + 40 * number
        messages += [flag(start, number, payload), bus(start + 1, number, payload, "taken"), bus(start + 12, number, payload)]
        lines += [frame(start + 2, payload), f"(1.0{start % 1000 + 4:02}000) can0 18DA01{ADDRESS[payload]}#0381050037", frame(start + 9, payload)]
    return lines, messages


class WitnessTest(unittest.TestCase):
    def judge(self, lines=(), messages=(), executed=None, faults=()):
        own_lines, own_messages = flight()
        verdict, _ = witness.judge(sorted([*own_lines, *lines]), [*own_messages, *messages], executed or {}, list(faults), 500 * MS)
        return verdict

    def broken(self, **record):
        verdict = self.judge(**record)
        self.assertEqual(verdict["ok"], not any(not c["ok"] for c in verdict["checks"]))
        return [c["what"] for c in verdict["checks"] if not c["ok"]]

    def assert_broken(self, what, **record):
        self.assertTrue(any(what in found for found in self.broken(**record)), (what, self.broken(**record)))

    def test_a_flight_as_it_should_be_is_accepted(self):
        verdict = self.judge()
        self.assertEqual([c for c in verdict["checks"] if not c["ok"]], [])
        self.assertEqual((verdict["slots"], verdict["slots_used"], verdict["frames"]), (3, 3, 6))

    def test_an_empty_record_is_no_proof(self):
        verdict, _ = witness.judge([], [], {}, [], MS)
        self.assertFalse(verdict["ok"])

    def test_a_frame_after_a_newer_grant_is_found(self):
        self.assert_broken("none after a newer grant", lines=[frame(1081, ADCS)])

    def test_frames_from_before_the_observation_are_not_judged(self):
        self.assertEqual(self.broken(lines=[frame(1001, ADCS)]), [])

    def test_a_frame_between_two_of_another_payload_is_found(self):
        self.assert_broken("interleave", lines=[frame(1085, ADCS), frame(1086, EPS)])

    def test_a_payload_that_is_granted_again_does_not_interleave(self):
        self.assertEqual(self.broken(messages=[flag(1160, 4, ADCS), bus(1180, 4, ADCS)], lines=[frame(1165, ADCS)]), [])

    def test_a_second_flag_is_found(self):
        double = flag(1160, 4, ADCS)
        double["flags"] = [True, True, False]
        self.assert_broken("one flag", messages=[double])

    def test_a_grant_while_another_payload_holds_the_bus_is_found(self):
        taken = [flag(1160, 4, ADCS), bus(1161, 4, ADCS, "taken")]
        self.assert_broken("before the holder gave", messages=[*taken, bus(1195, 4, ADCS), flag(1190, 5, EPS)])
        self.assertEqual(self.broken(messages=[*taken, flag(1221, 5, EPS)]), [], "its lease was over")
        self.assertEqual(self.broken(messages=[*taken, flag(1190, 5, EPS)]), [], "the end of ADCS was not heard")

    def test_an_old_switcher_that_grants_after_a_new_one_is_found(self):
        self.assert_broken("grants rise", messages=[flag(1240, 1, ADCS, switcher=2), bus(1250, 1, ADCS, switcher=2), flag(1280, 4, EPS)])

    def test_a_grant_whose_flag_only_the_holder_heard_is_no_violation(self):
        self.assertEqual(self.broken(messages=[bus(1161, 4, ADCS, "taken"), bus(1180, 4, ADCS)], lines=[frame(1165, ADCS)]), [])

    # --- telecommands

    DONE = (telecommand(0x1_0000_0007), report(0x1_0000_0007, 1), report(0x1_0000_0007, 7))

    def test_a_telecommand_executed_once_is_accepted(self):
        self.assertEqual(self.broken(messages=self.DONE, executed={EPS: [7]}), [])

    def test_a_telecommand_executed_twice_is_found(self):
        self.assert_broken("executed twice", messages=self.DONE, executed={EPS: [7, 8, 7]})

    def test_a_completion_that_never_happened_is_found(self):
        self.assert_broken("what the peripheral did", messages=self.DONE, executed={EPS: [], ADCS: [7]})

    def test_an_accepted_telecommand_without_an_end_is_found(self):
        self.assert_broken("executed once", messages=self.DONE[:2], executed={EPS: []})
        self.assertEqual(self.broken(messages=self.DONE[:2], executed={EPS: [7]}), [], "only the observer did not hear it")

    def stage(self, stage, final, code=None):
        return {"type": "tc_stage", "at_ns": 0, "line": 3, "command": "eps.switch_load", "stage": stage, "final": final, "success": code is None,
                **({} if code is None else {"code": code})}  # fmt: skip

    def test_what_the_ground_is_not_told_is_found(self):
        accepted = self.stage("accepted", False)
        self.assertEqual(self.broken(messages=[accepted, self.stage("completed", True)]), [])
        self.assertEqual(self.broken(messages=[accepted, self.stage("completion_failed", True, 36)]), [])
        self.assert_broken("the ground is told", messages=[accepted])
        self.assert_broken("the ground is told", messages=[accepted, self.stage("completion_failed", True, 21)])

    def test_accepted_telecommands_that_were_given_up_are_found_but_for_a_few_of_a_soak(self):
        given_up = [*self.DONE[:2], report(0x1_0000_0007, 7, False, 35)]
        self.assert_broken("peripherals answer", messages=given_up)
        self.assert_broken("executed once", messages=[*self.DONE[:2], report(0x1_0000_0007, 7, False, 32)])
        for others, good in ((998, False), (999, True)):
            done = [m for n in range(8, 8 + others) for m in (telecommand(n), report(n, 1), report(n, 7))]
            checks = witness.executed_once(witness.telecommands_of([*given_up, *done]), {EPS: list(range(7, 8 + others))}, soak=True)
            self.assertEqual(all(c["ok"] for c in checks), good, checks)

    def test_what_went_unanswered_while_the_machine_was_late_is_no_fault_of_the_nodes(self):
        given_up = [telecommand(7), report(7, 1), report(7, 7, False, 30) | {"at_ns": 900 * MS}]
        told = [self.stage("accepted", False), self.stage("completion_failed", True, 30) | {"at_ns": 900 * MS}]
        for late, good in (([(400 * MS, 430 * MS)], True), ([(901 * MS, 950 * MS)], False), ([], False)):
            checks = [*witness.executed_once(witness.telecommands_of(given_up), {EPS: [7]}, late=late), witness.told_to_the_ground(told, late=late)]
            self.assertEqual([c["ok"] for c in checks], [True, True, True, good, good], checks)
        for waited, good in ((EPS, True), (ADCS, False)):
            excused = lambda payload, begin, end, waited=waited: f"{payload} waited" if payload == waited and end == 900 * MS else None  # noqa: E731
            checks = [*witness.executed_once(witness.telecommands_of(given_up), {EPS: [7]}, why_late=excused), witness.told_to_the_ground(told, why_late=excused)]
            self.assertEqual([c["ok"] for c in checks], [True, True, True, good, good], checks)
        twice = witness.executed_once(witness.telecommands_of(given_up), {EPS: [7, 7]}, late=[(400 * MS, 430 * MS)])
        self.assertFalse(twice[0]["ok"], "lateness is no excuse for this")

    def test_a_telecommand_may_expire_before_its_acceptance_in_an_overload_alone(self):
        expired = [self.stage("sent", False), self.stage("start_failed", True, 21) | {"at_ns": 900 * MS}]
        for overloads, good in (([(400 * MS, 700 * MS)], True), ([(901 * MS, 950 * MS)], False), ([], False)):
            self.assertEqual(witness.told_to_the_ground(expired, overloads=overloads)["ok"], good, overloads)
        self.assertFalse(witness.told_to_the_ground(expired[:1], overloads=[(0, 900 * MS)])["ok"], "no end")

    def test_an_unknown_outcome_may_be_executed_or_not(self):
        unknown = [*self.DONE[:2], report(0x1_0000_0007, 7, False, 36)]
        self.assertEqual(self.broken(messages=unknown, executed={EPS: [7]}), [])
        self.assertEqual(self.broken(messages=unknown), [])

    def test_an_expired_telecommand_that_was_executed_is_found(self):
        self.assert_broken("what the peripheral did", messages=[*self.DONE[:2], report(0x1_0000_0007, 3, False, 20)], executed={EPS: [7]})

    def test_a_refused_telecommand_needs_no_execution(self):
        self.assertEqual(self.broken(messages=[self.DONE[0], report(0x1_0000_0007, 1, False, 22)]), [])

    def test_a_repeated_reset_is_found(self):
        reset = [frame(1084, EPS, "040303A1B2CCCCCC")]
        command = [telecommand(9, function=16), report(9, 1), report(9, 7)]
        self.assertEqual(self.broken(lines=reset, messages=command), [])
        self.assert_broken("never repeated", lines=reset)
        self.assert_broken("never repeated", lines=[*reset, frame(1086, EPS, "040304A1B2CCCCCC")], messages=command)
        order = {"type": "peripheral_reset", "at_ns": 0, "payload": EPS, "grant": 2, "reason": ""}
        self.assertEqual(self.broken(lines=reset, messages=[order]), [])

    def test_the_end_of_a_reset_is_asked_for_on_the_ground_not_of_the_observer(self):
        heard = [telecommand(9, function=16), report(9, 1)]
        self.assertEqual(self.broken(messages=heard), [])
        self.assert_broken("the ground is told", messages=[*heard, self.stage("accepted", False)])

    # --- recovery

    def fault(self, victim=EPS, begin_ms=1050, end_ms=1050):
        return witness.Fault("kill a payload", victim, begin_ms * MS, end_ms * MS)

    def test_the_gap_after_a_fault_ends_with_the_next_used_slot(self):
        verdict = self.judge(faults=[self.fault()])
        self.assertTrue(verdict["ok"])
        self.assertEqual(verdict["faults"]["kill a payload"]["bus_gap"]["max_ms"], 42.0)  # granted at 1080, given back at 1092

    def test_a_rotation_that_stands_still_is_found(self):
        late = [flag(2000, 4, EPS), bus(2010, 4, EPS)]
        self.assert_broken("rotation goes on", faults=[self.fault(begin_ms=1140, end_ms=1140)])
        self.assert_broken("rotation goes on", faults=[self.fault(begin_ms=1140, end_ms=1140)], messages=late)
        self.assertEqual(self.broken(faults=[self.fault(begin_ms=1140, end_ms=1900)], messages=late), [], "it was stopped as long")

    def test_a_victim_that_does_not_come_back_is_found(self):
        others = [m for n in range(4, 60) for m in (flag(1000 + 40 * n, n, ADCS), bus(1010 + 40 * n, n, ADCS))]
        self.assert_broken("victim comes back", faults=[self.fault(begin_ms=1100, end_ms=1100)], messages=others)

    def test_a_slot_without_a_frame_is_no_recovery(self):
        unused = [flag(1200, 4, EPS), bus(1201, 4, EPS, sent=0)]
        self.assert_broken("rotation goes on", faults=[self.fault(begin_ms=1140, end_ms=1140)], messages=unused)


if __name__ == "__main__":
    unittest.main()
