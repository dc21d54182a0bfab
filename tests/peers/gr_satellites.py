#!/usr/bin/env python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Lets gr-satellites, a CADU receiver that is not ours, read the downlink of a running simulation.

    apt-get install --no-install-recommends gnuradio gr-satellites       # about 300 MB, hence a step by hand
    ./run sim --deployment sim_open &                                    # or sim_open_i5 with --interleave 5
    /usr/bin/python3 tests/peers/gr_satellites.py --line PATH_TO_rs422   # `srfs status` names the line

Octets of the line become soft bits, as a demodulator gives them; damaged ones are put into code blocks, so that its Reed-Solomon
decoder has work. Exit code 0: every whole CADU came out as a transfer frame with a right checksum (132.0-B, 4.1.6) and the
spacecraft's id; 1: not all; 2: no line, no octets or gr-satellites missing.
"""

import argparse
import binascii
import os
import random
import select
import sys
import time
import tty

try:
    import numpy
    import pmt
    from gnuradio import blocks, gr, pdu
    from satellites.components.deframers import ccsds_rs_deframer
except ImportError as missing:
    print(f"{missing}: apt-get install --no-install-recommends gnuradio gr-satellites", file=sys.stderr)
    sys.exit(2)

# Debian 12's gr-satellites 4.4 expects these where GNU Radio had them before 3.10.
blocks.byte_t, blocks.float_t = gr.types.byte_t, gr.types.float_t
blocks.tagged_stream_to_pdu, blocks.pdu_to_tagged_stream = pdu.tagged_stream_to_pdu, pdu.pdu_to_tagged_stream

ASM = bytes.fromhex("1acffc1d")
DATA_OCTETS, CODED_OCTETS = 223, 255
QUIET_S = 10


def read_line(path, octets, deadline_s):
    line = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(line)
    end, received = time.monotonic() + deadline_s, bytearray()
    while len(received) < octets and time.monotonic() < end:
        if select.select([line], [], [], 0.2)[0]:
            received += os.read(line, 65536)
    os.close(line)
    return received


def damage(stream, starts, interleave, errors, seed):
    """Changes `errors` octets of every code word of every CADU."""
    chance = random.Random(seed)
    for start in starts:
        for word in range(interleave):
            for position in chance.sample(range(CODED_OCTETS), errors):
                stream[start + len(ASM) + position * interleave + word] ^= chance.randrange(1, 256)


class Frames(gr.basic_block):
    """Collects the frames that the deframer publishes."""

    def __init__(self):
        gr.basic_block.__init__(self, "frames", None, None)
        self.octets = set()
        self.message_port_register_in(pmt.intern("in"))
        self.set_msg_handler(pmt.intern("in"), self.keep)

    def keep(self, message):
        self.octets.add(bytes(pmt.u8vector_elements(pmt.cdr(message))))


def deframed(stream, interleave, expected):
    """Returns the distinct frames. Waits until there are as many as expected, or no new one came for QUIET_S."""
    gr.logging().set_default_level(gr.log_levels.err)  # its blocks log every frame
    soft_bits = numpy.unpackbits(numpy.frombuffer(bytes(stream), numpy.uint8)).astype(numpy.float32) * 2 - 1
    flow = gr.top_block()
    deframer = ccsds_rs_deframer(
        frame_size=DATA_OCTETS * interleave, rs_basis="dual", rs_interleaving=interleave, scrambler="CCSDS", syncword_threshold=0
    )
    frames = Frames()
    # The source repeats the stream: a flow graph that ends drops the messages still in transit.
    flow.connect(blocks.vector_source_f(soft_bits.tolist(), True), deframer)
    flow.msg_connect((deframer, "out"), (frames, "in"))
    flow.start()
    found, since = 0, time.monotonic()
    while found < expected and time.monotonic() - since < QUIET_S:
        time.sleep(0.1)
        if len(frames.octets) > found:
            found, since = len(frames.octets), time.monotonic()
    flow.stop()
    flow.wait()
    return frames.octets


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--line", required=True, metavar="PATH", help="the operator's end of the line")
    arguments.add_argument("--interleave", type=int, default=1, help="Reed-Solomon interleave (default 1)")
    arguments.add_argument("--cadus", type=int, default=200, help="how many to wait for (default 200)")
    arguments.add_argument("--errors", type=int, default=8, help="damaged octets put into every code word, 0 to 16 (default 8)")
    arguments.add_argument("--scid", type=lambda text: int(text, 0), default=0xAB, help="the spacecraft's id (default 0xAB)")
    arguments.add_argument("--deadline", type=float, default=120, metavar="S", help="seconds to read the line at most (default 120)")
    arguments.add_argument("--seed", type=int, default=1, help="of the damage (default 1)")
    given = arguments.parse_args()

    cadu_octets = len(ASM) + CODED_OCTETS * given.interleave
    try:
        stream = read_line(given.line, given.cadus * cadu_octets, given.deadline)
    except OSError as error:
        print(f"{given.line}: {error.strerror}: is the simulation up? `srfs status` names its line", file=sys.stderr)
        return 2
    starts, at = [], stream.find(ASM)
    while at >= 0 and at + cadu_octets <= len(stream):
        starts.append(at)
        at = stream.find(ASM, at + cadu_octets)
    if not starts:
        print(f"{len(stream)} octets and no CADU in {given.deadline:g} s", file=sys.stderr)
        return 2
    damage(stream, starts, given.interleave, given.errors, given.seed)
    frames = deframed(stream, given.interleave, len(starts))
    right = [f for f in frames if binascii.crc_hqx(f, 0xFFFF) == 0 and (f[0] << 4 | f[1] >> 4) & 0x3FF == given.scid]
    channels = {channel: sum(f[1] >> 1 & 7 == channel for f in right) for channel in sorted({f[1] >> 1 & 7 for f in right})}
    print(f"CADUs {len(starts)}, with {given.errors} damaged octets in each of {given.interleave} code words")
    print(f"frames by gr-satellites {len(frames)}, right {len(right)}; by virtual channel {channels}")
    return 0 if len(right) == len(starts) == len(frames) else 1


if __name__ == "__main__":
    sys.exit(main())
