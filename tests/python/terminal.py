"""Runs a program in a terminal of 80 x 24 characters and types keys into it.

    terminal.py KEYS PROGRAM ARGUMENT...

A key is typed when the program has been quiet for a moment; the key `^` closes the terminal. Prints
all that it wrote, and exits with its status, or with 1 if it does not end within two minutes.
"""

import fcntl
import os
import pty
import select
import struct
import sys
import termios
import time

keys, program = sys.argv[1], sys.argv[2:]
child, terminal = pty.fork()
if child == 0:
    # Before the program asks for it.
    fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
    os.environ["TERM"] = "xterm-256color"
    os.execvp(program[0], program)
written = b""
waiting = list(keys)
while True:
    ready, _, _ = select.select([terminal], [], [], 0.5 if waiting else 20)
    if ready:
        try:
            part = os.read(terminal, 65536)
        except OSError:
            break
        if not part:
            break
        written += part
    elif waiting:
        # Before it has drawn, a key would be lost.
        if b"frame" in written:
            key = waiting.pop(0)
            if key == "^":
                os.close(terminal)
                break
            os.write(terminal, key.encode())
    else:
        break
until = time.monotonic() + 120
ended, status = os.waitpid(child, os.WNOHANG)
while not ended and time.monotonic() < until:
    time.sleep(0.02)
    ended, status = os.waitpid(child, os.WNOHANG)
if not ended:
    os.killpg(child, 9)
    os.waitpid(child, 0)
    sys.exit("the program does not end")
sys.stdout.buffer.write(written)
sys.exit(os.waitstatus_to_exitcode(status))
