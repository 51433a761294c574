"""A USB webcam that is none, for the kernel's own driver (uvcvideo): plugged into port PORT of the virtual host
controller vhci_hcd, which speaks USB/IP over a socket. It sends one motion JPEG without Huffman tables 30 times a second,
writes what its controls are set to to standard output, and is unplugged when it ends. SIGUSR1 makes it send halves of
images, and whole ones again.

usage: webcam.py PORT JPEG
"""

import collections
import select
import signal
import socket
import struct
import sys
import time

PERIOD_S = 1 / 30
WIDTH, HEIGHT = 64, 48
INTERVAL = 333_333  # units of 100 ns
MAX_PAYLOAD = 65_536
CAMERA, PROCESSING, OUTPUT = 1, 2, 3
STALL, UNLINKED = -32, -104

# Control: name, bytes, least, greatest, step or possible bits, current.
CONTROLS = {
    (CAMERA, 2): ["automatic exposure", 1, 0, 0, 0b1001, 8],
    (CAMERA, 3): ["exposure priority", 1, 0, 1, 1, 1],
    (CAMERA, 4): ["exposure", 4, 3, 2047, 1, 250],
    (PROCESSING, 4): ["gain", 2, 16, 255, 1, 64],
}


def descriptors():
    """Of the device and of its configuration."""
    control = (
        bytes([18, 0x24, 2, CAMERA, 1, 2, 0, 0, 0, 0, 0, 0, 0, 0, 3, 0b1110, 0, 0])
        + bytes([11, 0x24, 5, PROCESSING, CAMERA, 0, 0, 2, 0, 0b10, 0])
        + bytes([9, 0x24, 3, OUTPUT, 1, 1, 0, PROCESSING, 0])
    )
    head = struct.pack("<BBBHHIBB", 13, 0x24, 1, 0x100, 13 + len(control), 48_000_000, 1, 1)
    bits = WIDTH * HEIGHT * 16 * 30
    formats = (
        bytes([11, 0x24, 6, 1, 1, 1, 1, 0, 0, 0, 0])
        + struct.pack("<BBBBBHHIIIIBI", 30, 0x24, 7, 1, 0, WIDTH, HEIGHT, bits, bits, MAX_PAYLOAD, INTERVAL, 1, INTERVAL)
        + bytes([6, 0x24, 13, 1, 1, 4])
    )
    stream = struct.pack("<BBBBHBBBBBBBB", 14, 0x24, 1, 1, 14 + len(formats), 0x81, 0, OUTPUT, 0, 0, 0, 1, 0)
    body = (
        bytes([8, 11, 0, 2, 14, 3, 0, 0])
        + bytes([9, 4, 0, 0, 0, 14, 1, 0, 0])
        + head + control
        + bytes([9, 4, 1, 0, 1, 14, 2, 0, 0])
        + stream + formats
        + struct.pack("<BBBBHB", 7, 5, 0x81, 2, 512, 0)
    )
    device = struct.pack("<BBHBBBBHHHBBBB", 18, 1, 0x200, 0xEF, 2, 1, 64, 0x1209, 1, 0x100, 0, 1, 0, 1)
    return device, struct.pack("<BBHBBBBB", 9, 2, 9 + len(body), 2, 1, 0, 0x80, 50) + body


DEVICE, CONFIGURATION = descriptors()
STRINGS = [bytes([4, 3, 9, 4]), b"".join([bytes([24, 3]), "Test webcam".encode("utf-16-le")])]
PROBE = struct.pack("<HBBIHHHHHII", 1, 1, 1, INTERVAL, 0, 0, 0, 0, 0, MAX_PAYLOAD, MAX_PAYLOAD)


def answer(setup, sent):
    """What a control request gets, or None when it is refused."""
    kind, request, value, index, length = struct.unpack("<BBHHH", setup)
    if (kind, request) == (0x80, 6):
        found = {1: [DEVICE], 2: [CONFIGURATION], 3: STRINGS}.get(value >> 8, [])
        number = value & 0xFF
        return found[number][:length] if number < len(found) else None
    if kind & 0x60 == 0:
        return b"" if kind & 0x80 == 0 else bytes(length)
    if index == 1:
        return PROBE[:length] if request != 0x86 else b"\3"
    control = CONTROLS.get((index >> 8, value >> 8))
    if control is None:
        return None
    name, size, least, greatest, step, current = control
    if request == 1:
        control[5] = int.from_bytes(sent, "little")
        print(f"{name} {control[5]}", flush=True)
        return b""
    if request == 0x86:
        return b"\3"
    if request == 0x85:
        return struct.pack("<H", size)
    numbers = {0x81: current, 0x82: least, 0x83: greatest, 0x84: step, 0x87: current}
    return numbers[request].to_bytes(size, "little") if request in numbers else None


def without_tables(jpeg):
    kept, rest = jpeg[:2], jpeg[2:]
    while rest[1] != 0xDA:
        end = 2 + int.from_bytes(rest[2:4], "big")
        if rest[1] != 0xC4:
            kept += rest[:end]
        rest = rest[end:]
    return kept + rest


is_broken = False


def toggle(*_):
    global is_broken
    is_broken = not is_broken


def serve(line, jpeg):
    waiting, number, due = collections.OrderedDict(), 0, time.monotonic()

    def reply(sequence, status, data=b"", is_in=True):
        line.sendall(struct.pack(">IIIIIiiiii8x", 3, sequence, 0, 0, 0, status, len(data), 0, 0, 0) + (data if is_in else b""))

    def receive(length):
        data = b""
        while len(data) < length:
            part = line.recv(length - len(data))
            if not part:
                sys.exit()
            data += part
        return data

    while True:
        ready, _, _ = select.select([line], [], [], max(0, due - time.monotonic()) if waiting else None)
        if not ready:
            sequence, _ = waiting.popitem(last=False)
            # Two bytes of header: the image's parity, and that it ends here.
            reply(sequence, 0, bytes([2, 0x82 | number & 1]) + jpeg[: len(jpeg) // (2 if is_broken else 1)])
            number, due = number + 1, max(due + PERIOD_S, time.monotonic())
            continue
        command, sequence, _, is_in, endpoint = struct.unpack(">IIIII", receive(20))
        rest = receive(28)
        if command == 2:
            unlinked = struct.unpack(">I", rest[:4])[0]
            status = UNLINKED if waiting.pop(unlinked, None) is not None else 0
            line.sendall(struct.pack(">IIIIIi24x", 4, sequence, 0, 0, 0, status))
            continue
        length, setup = struct.unpack(">i", rest[4:8])[0], rest[20:]
        if endpoint == 1:
            if not waiting:
                due = max(due, time.monotonic())
            waiting[sequence] = length
            continue
        sent = b"" if is_in else receive(length)
        data = answer(setup, sent)
        if data is None:
            reply(sequence, STALL)
        else:
            reply(sequence, 0, data if is_in else sent, is_in)


if __name__ == "__main__":
    port = int(sys.argv[1])
    with open(sys.argv[2], "rb") as file:
        image = without_tables(file.read())
    signal.signal(signal.SIGUSR1, toggle)
    ours, kernels = socket.socketpair()
    with open("/sys/devices/platform/vhci_hcd.0/attach", "w") as attach:
        attach.write(f"{port} {kernels.fileno()} {port + 1} 3")
    kernels.close()
    serve(ours, image)
