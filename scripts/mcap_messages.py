#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The messages of a recording, with Python and libzstd alone.

scripts/mcap_messages.py FILE.mcap    prints a line of JSON for each: topic, type, time [ns], data

A recording that was killed ends with its last whole chunk.
"""
import base64
import ctypes
import json
import struct
import sys

ZSTD = ctypes.CDLL("libzstd.so.1")
ZSTD.ZSTD_decompress.restype = ctypes.c_size_t
ZSTD.ZSTD_decompress.argtypes = [ctypes.c_char_p, ctypes.c_size_t] * 2
SCHEMA, CHANNEL, MESSAGE, CHUNK, DATA_END = 3, 4, 5, 6, 15


def records(data):
    at = 0
    while at + 9 <= len(data):
        kind, size = struct.unpack_from("<BQ", data, at)
        if at + 9 + size > len(data):
            return
        yield kind, data[at + 9:at + 9 + size]
        at += 9 + size


def texts(data, at, count):
    """`count` texts behind their lengths, and where they end."""
    found = []
    for _ in range(count):
        size, = struct.unpack_from("<I", data, at)
        found.append(data[at + 4:at + 4 + size].decode())
        at += 4 + size
    return found, at


def chunk_of(content):
    size, _ = struct.unpack_from("<QI", content, 16)
    (kind,), at = texts(content, 28, 1)
    packed = content[at + 8:]
    if kind != "zstd":
        return packed
    whole = ctypes.create_string_buffer(size)
    if ZSTD.ZSTD_decompress(whole, size, packed, len(packed)) != size:
        raise ValueError("a chunk is damaged")
    return whole.raw


def messages(file):
    """(topic, type, time [ns], data, definition) of each message, in the order of the file; CDR."""
    with open(file, "rb") as opened:
        data = opened.read()
    schemas, channels = {}, {}

    def walk(part):
        for kind, content in records(part):
            if kind == SCHEMA:
                schemas[struct.unpack_from("<H", content)[0]] = texts(content, 2, 3)[0]
            elif kind == CHANNEL:
                number, schema = struct.unpack_from("<HH", content)
                channels[number] = texts(content, 4, 1)[0][0], schema
            elif kind == MESSAGE:
                number, _, time = struct.unpack_from("<HIQ", content)
                topic, schema = channels[number]
                yield topic, schemas[schema], time, content[22:]
            elif kind == CHUNK:
                yield from walk(chunk_of(content))
            elif kind == DATA_END:
                return

    for topic, schema, time, content in walk(memoryview(data)[8:].tobytes()):
        yield topic, schema[0], time, content, schema[2]


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for name, kind, when, bytes_, definition in messages(sys.argv[1]):
        print(json.dumps([name, kind, str(when), base64.b64encode(bytes_).decode(), definition]))
