# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A reader of MCAP files, written from the specification (https://mcap.dev/spec), which shares nothing with lib/mcap.

Debian has no reader of MCAP. This one is strict: what the specification forbids is an error. It reads from begin to end (scan), as after a
kill of the recorder, and by the index at the end (Indexed), as viewers do.
"""

import ctypes
import dataclasses
import struct
import zlib

MAGIC = b"\x89MCAP0\r\n"
HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX, STATISTICS, SUMMARY_OFFSET, DATA_END = 1, 2, 3, 4, 5, 6, 7, 8, 11, 14, 15
_zstd = ctypes.CDLL("libzstd.so.1")
_zstd.ZSTD_decompress.restype = ctypes.c_size_t


class Malformed(Exception):
    pass


class Truncated(Malformed):
    """The file ends inside of a record."""


def require(good, what):
    if not good:
        raise Malformed(what)


class Fields:
    def __init__(self, octets):
        self.octets, self.at = octets, 0

    def take(self, count):
        require(self.at + count <= len(self.octets), "a field goes beyond its record")
        self.at += count
        return self.octets[self.at - count : self.at]

    def number(self, form):
        return struct.unpack("<" + form, self.take(struct.calcsize("<" + form)))[0]

    def string(self):
        return self.take(self.number("I")).decode("utf-8")

    def entries(self, key, value):
        """A map or an array of pairs, as a list."""
        inner, found = Fields(self.take(self.number("I"))), []
        while inner.at < len(inner.octets):
            found.append(tuple(inner.string() if form == "s" else inner.number(form) for form in (key, value)))
        return found

    def rest(self):
        return self.take(len(self.octets) - self.at)


@dataclasses.dataclass
class Message:
    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


def records(octets, at, end):
    """(opcode, content, offset of the record) from `at` to `end`."""
    while at < end:
        if at + 9 > end:
            raise Truncated("in the head of a record")
        opcode, length = octets[at], struct.unpack_from("<Q", octets, at + 1)[0]
        if at + 9 + length > end:
            raise Truncated(f"in a record of opcode {opcode}")
        yield opcode, octets[at + 9 : at + 9 + length], at
        at += 9 + length


def decompress(name, octets, size):
    if name == "":
        return octets
    require(name == "zstd", f"compression {name}")
    out = ctypes.create_string_buffer(max(size, 1))
    found = _zstd.ZSTD_decompress(out, ctypes.c_size_t(size), octets, ctypes.c_size_t(len(octets)))
    require(found == size, "a chunk cannot be decompressed")
    return out.raw[:size]


class Content:
    """Schemas, channels and messages of the records that it is given."""

    def __init__(self):
        self.schemas, self.channels, self.messages = {}, {}, []

    def take(self, opcode, content):
        fields = Fields(content)
        if opcode == SCHEMA:
            number = fields.number("H")
            schema = (fields.string(), fields.string(), fields.take(fields.number("I")).decode("utf-8"))
            require(number != 0 and self.schemas.setdefault(number, schema) == schema, "a schema has two forms")
        elif opcode == CHANNEL:
            number = fields.number("H")
            channel = (fields.number("H"), fields.string(), fields.string(), dict(fields.entries("s", "s")))
            require(channel[0] == 0 or channel[0] in self.schemas, "a channel's schema does not come before it")
            require(self.channels.setdefault(number, channel) == channel, "a channel has two forms")
        elif opcode == MESSAGE:
            message = Message(fields.number("H"), fields.number("I"), fields.number("Q"), fields.number("Q"), fields.rest())
            require(message.channel in self.channels, "a message's channel does not come before it")
            self.messages.append(message)

    def topics(self):
        return {topic for _, topic, _, _ in self.channels.values()}

    def of(self, topic):
        return [m for m in self.messages if self.channels[m.channel][1] == topic]


def open_chunk(content):
    """(records, earliest, latest time)."""
    fields = Fields(content)
    begin, end, size, crc = (fields.number(form) for form in "QQQI")
    compression = fields.string()
    chunk = decompress(compression, fields.take(fields.number("Q")), size)
    require(crc == 0 or crc == zlib.crc32(chunk), "a chunk has a wrong checksum")
    return chunk, begin, end


def scan(octets):
    """(Content, whether the file is whole): everything of each whole chunk, from begin to end."""
    require(octets[:8] == MAGIC, "no MCAP file")
    found = Content()
    try:
        for opcode, content, at in records(octets, 8, len(octets)):
            require((at == 8) == (opcode == HEADER), "the header is not the first record")
            if opcode == DATA_END:
                return found, True
            if opcode == CHUNK:
                chunk, begin, end = open_chunk(content)
                before = len(found.messages)
                for inner, inner_content, _ in records(chunk, 0, len(chunk)):
                    require(inner in (SCHEMA, CHANNEL, MESSAGE), "a chunk holds another record")
                    found.take(inner, inner_content)
                times = [m.log_time for m in found.messages[before:]] or [0]
                require((min(times), max(times)) == (begin, end), "a chunk's times are wrong")
            else:
                found.take(opcode, content)
    except Truncated:
        pass
    return found, False


class Indexed:
    """The file by its end: summary, statistics, chunk and message indexes. Each is checked against what it points to."""

    def __init__(self, octets):
        require(octets[-8:] == MAGIC, "no magic at the end")
        footer_at = len(octets) - 8 - 29
        ((opcode, content, _),) = records(octets, footer_at, footer_at + 29)
        require(opcode == FOOTER, "no footer at the end")
        start, offsets_at, crc = struct.unpack("<QQI", content)
        require(crc == zlib.crc32(octets[start : footer_at + 9 + 16]), "the summary has a wrong checksum")
        self.summary, self.statistics, chunks, groups = Content(), None, [], []
        for opcode, content, at in records(octets, start, offsets_at):
            if not groups or groups[-1][0] != opcode:
                groups.append([opcode, at, 0])
            groups[-1][2] += 9 + len(content)
            if opcode == CHUNK_INDEX:
                chunks.append(Fields(content))
            elif opcode == STATISTICS:
                self.statistics = Fields(content)
            else:
                self.summary.take(opcode, content)
        require(len({opcode for opcode, _, _ in groups}) == len(groups), "the summary is not grouped by opcode")
        offsets = [list(struct.unpack("<BQQ", content)) for opcode, content, _ in records(octets, offsets_at, footer_at) if opcode == SUMMARY_OFFSET]
        require(offsets == groups, "the summary's offsets are wrong")
        self.messages = [m for chunk in chunks for m in self._messages(octets, chunk)]
        self._check_statistics(len(chunks))

    def _messages(self, octets, index):
        begin, end, at, length = (index.number("Q") for _ in range(4))
        offsets = dict(index.entries("H", "Q"))
        index_length = index.number("Q")
        compression, compressed, uncompressed = index.string(), index.number("Q"), index.number("Q")
        ((opcode, content, _),) = records(octets, at, at + length)
        require(opcode == CHUNK, "a chunk index points to another record")
        chunk, chunk_begin, chunk_end = open_chunk(content)
        require((begin, end, uncompressed) == (chunk_begin, chunk_end, len(chunk)), "a chunk index is wrong")
        require(len(content) == 8 + 8 + 8 + 4 + 4 + len(compression) + 8 + compressed, "a chunk's compressed size is wrong")
        indexes = {offset: content for opcode, content, offset in records(octets, at + length, at + length + index_length) if opcode == MESSAGE_INDEX}
        require(set(indexes) == set(offsets.values()), "message indexes are not where the chunk index says")
        found = []
        for channel, offset in offsets.items():
            fields = Fields(indexes[offset])
            require(fields.number("H") == channel, "a message index is of another channel")
            for time, place in fields.entries("Q", "Q"):
                opcode, content, _ = next(records(chunk, place, len(chunk)))
                one = Content()
                one.channels = self.summary.channels
                one.take(opcode, content)
                require(len(one.messages) == 1 and one.messages[0].log_time == time and one.messages[0].channel == channel, "a message index is wrong")
                found += one.messages
        return found

    def _check_statistics(self, chunk_count):
        s = self.statistics
        counts = {}
        for message in self.messages:
            counts[message.channel] = counts.get(message.channel, 0) + 1
        times = [m.log_time for m in self.messages] or [0]
        expected = (len(self.messages), len(self.summary.schemas), len(self.summary.channels), 0, 0, chunk_count, min(times), max(times))
        require(tuple(s.number(form) for form in "QHIIIIQQ") == expected, "the statistics are wrong")
        require(dict(s.entries("H", "Q")) == counts, "the counts of the channels are wrong")
