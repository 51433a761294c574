"""One obstacle for three algorithms: story.py PAGE.html MAP.svg >story.html

PAGE.html is the report of the frame in which v3 misses it, MAP.svg the course with all three paths.
"""

import re
import sys

page, course = (open(path, encoding="utf-8").read() for path in sys.argv[1:])
style = re.search(r"<style>.*?</style>", page, re.DOTALL).group()
# The page's symbols and the picture that its frames share.
shared = "".join(re.findall(r"<symbol.*?</symbol>|<image id=.*?/>", page, re.DOTALL))


def frame(algorithm, picture):
    return re.search(rf'<svg [^>]*aria-label="{algorithm}[^"]*: {picture}".*?</svg>', page, re.DOTALL).group()


def known(algorithm):
    cells = frame(algorithm, "estimate").count('class="median"')
    return f"<b>{algorithm}</b>: {cells} of 15 cells known"


pictures = [(frame(name, "estimate"), known(name)) for name in ("v3", "bm", "v5")]
distance = re.search(r"\(2, 1\): ([\d.]+ m)", frame("v5", "truth")).group(1)
pictures.append((frame("v5", "truth"), f"<b>truth</b>: a wall, {distance} ahead"))
figures = "".join(f"<figure>{svg}<figcaption>{caption}</figcaption></figure>" for svg, caption in pictures)
course = re.sub(r"<title>.*?</title>|<text[^>]*>\s*course \d+\s*</text>", "", course, flags=re.DOTALL)
print(
    f"""<!doctype html><meta charset="utf-8">{style}
<style>
body {{ margin: 12px; padding: 0; max-width: none; width: 1176px; background: #fff; color-scheme: only light; }}
.four {{ display: grid; grid-template-columns: repeat(4, 1fr); gap: 12px; }}
figure {{ margin: 0; }} figcaption {{ font: 18px sans-serif; color: #222; margin: 2px 0 10px; }}
svg, svg.plot {{ width: 100%; max-width: none; margin: 0; }}
</style>
<svg width="0" height="0" style="position: absolute"><defs>{shared}</defs></svg>
<div class="four">{figures}</div>
<figure>{course}<figcaption>From above, from left to right: the robot that v3 steers hits that wall (×) 1.2 s later.
Those of bm and v5 arrive.</figcaption></figure>"""
)
