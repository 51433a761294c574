"""A printed board in view as the truth: board.py PAGE.html >board.html

PAGE.html is the report of a recording that was scored with --truth board:9x6.
"""

import re
import sys

page = open(sys.argv[1], encoding="utf-8").read()
style = re.search(r"<style>.*?</style>", page, re.DOTALL).group()
shared = "".join(re.findall(r"<symbol.*?</symbol>|<image id=.*?/>", page, re.DOTALL))
section = re.search(r'<section class="figure".*?</section>', page, re.DOTALL).group()
shown = [("truth", "truth: the cells that the board covers"), ("bm[^\"]*: estimate", "bm"), ("v5[^\"]*: estimate", "v5")]
figures = "".join(
    f"<figure>{svg.group()}<figcaption>{caption}</figcaption></figure>"
    for name, caption in shown
    if (svg := re.search(rf'<svg [^>]*aria-label="[^"]*{name}[^"]*".*?</svg>', section, re.DOTALL))
)
print(
    f"""<!doctype html><meta charset="utf-8">{style}
<style>
body {{ margin: 8px; padding: 0; max-width: none; width: 1184px; background: #fff; color-scheme: only light; }}
.row {{ display: grid; grid-template-columns: repeat(3, 1fr); gap: 8px; }}
figure {{ margin: 0; }} figcaption {{ font: 18px sans-serif; color: #222; }}
svg {{ width: 100%; max-width: none; margin: 0; }}
</style>
<svg width="0" height="0" style="position: absolute"><defs>{shared}</defs></svg>
<div class="row">{figures}</div>"""
)
