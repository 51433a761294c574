"""A terminal's text as SVG: python3 terminal.py COMMAND <text >picture.svg

Colours are those of 256 (ESC[38;5;Nm), which svl prints.
"""
import html
import re
import sys
import textwrap

WIDTH, HEIGHT, MARGIN = 8.4, 18, 14
LEVELS = [0, 95, 135, 175, 215, 255]


def colour(code):
    if code >= 232:
        return "#" + f"{8 + 10 * (code - 232):02x}" * 3
    code -= 16
    return "#" + "".join(f"{LEVELS[code // place % 6]:02x}" for place in (36, 6, 1))


def spans(line):
    """Column, colour and text of each word."""
    column, fill = 0, "#24292f"
    for part in re.split(r"(\x1b\[[0-9;]*m)", line):
        if part.startswith("\x1b"):
            code = re.fullmatch(r"\x1b\[38;5;(\d+)m", part)
            fill = colour(int(code[1])) if code else "#24292f"
        else:
            for word in re.finditer(r"\S+", part):
                yield column + word.start(), fill, word[0]
            column += len(part)


command = textwrap.wrap(f"$ {sys.argv[1]}", 78, subsequent_indent="    ", break_on_hyphens=False)
lines = [*" \\\n".join(command).split("\n"), *sys.stdin.read().replace("\r", "").rstrip().split("\n")]
columns = max(len(re.sub(r"\x1b\[[0-9;]*m", "", line)) for line in lines)
width, height = columns * WIDTH + 2 * MARGIN, len(lines) * HEIGHT + 2 * MARGIN
print(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height}" width="{width:.0f}">')
print(f'<rect width="{width:.0f}" height="{height}" rx="8" fill="#f6f8fa" stroke="#d0d7de"/>')
print('<g font-family="DejaVu Sans Mono, Menlo, Consolas, monospace" font-size="14">')
for row, line in enumerate(lines):
    y = MARGIN + row * HEIGHT + 13
    for column, fill, text in spans(line):
        # The length keeps columns aligned in any font.
        x, length = MARGIN + column * WIDTH, len(text) * WIDTH
        print(f'<text x="{x:.1f}" y="{y}" fill="{fill}" textLength="{length:.1f}">{html.escape(text)}</text>')
print("</g></svg>")
