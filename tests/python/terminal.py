"""Runs a program in a terminal of 80 x 24 characters and types keys into it.

    terminal.py KEYS PROGRAM ARGUMENT...

A key is typed when the program has been quiet for a moment. Prints all that it wrote, and exits
with its status.
"""

import fcntl
import os
import pty
import select
import struct
import sys
import termios

keys, program = sys.argv[1], sys.argv[2:]
child, terminal = pty.fork()
if child == 0:
    os.environ["TERM"] = "xterm-256color"
    os.execvp(program[0], program)
fcntl.ioctl(terminal, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
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
            os.write(terminal, waiting.pop(0).encode())
    else:
        os.kill(child, 9)
        break
_, status = os.waitpid(child, 0)
sys.stdout.buffer.write(written)
sys.exit(os.waitstatus_to_exitcode(status))
