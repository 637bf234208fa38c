# SPDX-License-Identifier: Apache-2.0
"""Reads Sightline's SEI messages from an H.264 byte stream, written from docs/sei.md alone: it shares no code with
the product and so checks the document too."""
import struct

UUID = bytes.fromhex("5b1c3a9e7d424f6a9b08e153c42f8d71")
STATES = ("searching", "tracking", "degraded", "coasting", "lost")


def nal_units(data):
    """The NAL units of an Annex B stream, without start codes."""
    start = data.find(b"\x00\x00\x01")
    while start >= 0:
        following = data.find(b"\x00\x00\x01", start + 3)
        end = len(data) if following < 0 else following
        yield data[start + 3:end].rstrip(b"\x00") if following >= 0 else data[start + 3:end]
        start = following


def without_emulation_prevention(nal):
    return nal.replace(b"\x00\x00\x03", b"\x00\x00")


def sei_payloads(nal):
    """(type, payload) of a SEI NAL unit."""
    data = without_emulation_prevention(nal)
    at = 1
    while at + 2 <= len(data) and data[at] != 0x80:
        numbers = []
        for _ in range(2):
            value = 0
            while data[at] == 255:
                value += 255
                at += 1
            numbers.append(value + data[at])
            at += 1
        yield numbers[0], data[at:at + numbers[1]]
        at += numbers[1]


def parse_message(payload):
    """A version 1 message as a dictionary."""
    if payload[:16] != UUID or payload[16] != 1:
        return None
    at = 17
    (length,) = struct.unpack_from("<H", payload, at)
    count, epoch, sequence, capture, utc, error, name_length = struct.unpack_from("<BIQqqIB", payload, at + 2)
    name_at = at + 2 + struct.calcsize("<BIQqqIB")
    message = {"epoch": epoch, "sequence": sequence, "capture_ns": capture, "utc_ns": utc, "error_ns": error,
               "camera": payload[name_at:name_at + name_length].decode(), "objects": []}
    at += length
    for _ in range(count):
        (length,) = struct.unpack_from("<H", payload, at)
        number, state, source, name_length = struct.unpack_from("<IBBB", payload, at + 2)
        name_at = at + 2 + struct.calcsize("<IBBB")
        thing = {"id": number, "state": STATES[state], "source": source,
                 "name": payload[name_at:name_at + name_length].decode(), "pose": None}
        if source != 0:
            values = struct.unpack_from("<7d2f", payload, name_at + name_length)
            thing["pose"] = (values[0:3], values[3:7])
            thing["sigma_t"], thing["sigma_r"] = values[7:9]
        message["objects"].append(thing)
        at += length
    return message


def images(data):
    """One entry per coded picture, in stream order: its message, or None."""
    out, pending = [], None
    for nal in nal_units(data):
        kind = nal[0] & 31
        if kind == 6:
            for payload_type, payload in sei_payloads(nal):
                if payload_type == 5 and payload[:16] == UUID:
                    pending = parse_message(payload)
        elif kind in (1, 5) and nal[1] & 0x80:  # first_mb_in_slice is 0: a new image
            out.append(pending)
            pending = None
    return out
