#!/usr/bin/env bash
# Makes the pictures of commands and pages: bash docs/pictures/make.sh
# Needs python3, `script` of util-linux, and the browser chromium-headless-shell, or another that BROWSER names. SVL names
# a program in place of the release build. docs/rerun.png is a screenshot of `svl view reports/arena`.
set -euo pipefail
cd "$(dirname "$0")/../.."
root="$PWD"
if [ -z "${SVL:-}" ]; then
  cargo build --release --locked
  SVL="$root/target/release/svl"
fi
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
mkdir "$work/bin"
ln -s "$(realpath "$SVL")" "$work/bin/svl"
export PATH="$work/bin:$PATH"
cd "$work"

# Lines that a command prints on a terminal of 80 columns, up to the one before the pattern.
terminal() {
  script -qec "stty cols 80 rows 50; $3 2>/dev/null" /dev/null </dev/null | tr -d '\r' | sed "/$2/,\$d" |
    python3 "$root/docs/pictures/terminal.py" "$3" >"$root/docs/pictures/$1"
}
page() {
  "${BROWSER:-chromium-headless-shell}" --no-sandbox --disable-gpu --hide-scrollbars --window-size="$2" \
    --screenshot="$root/docs/pictures/$1" "file://$work/$3"
}

svl record arena --frames 60 --seed 7 --ros2 --quiet -o bag.mcap
# The sentences below the table name times, which are those of the machine.
terminal terminal.svg '^[*] best' \
  "svl score bag.mcap --truth /truth/depth --beyond 2 --algo v5 --algo sgm --algo v3 --columns right,wrong,unknown,missed"
echo 'resize:100x27 down down down down right right right wait screen q' >keys
terminal tune.svg '^v3:texture_delta' 'svl tune bag.mcap --truth /truth/depth --algo v3 --rerun none --script keys'

svl score "$root/scenarios/drive.toml" --seeds 3 --algo v5 --algo v3 --algo bm --algo truth --drives none --quiet \
  --figures drive >/dev/null
cp drive/course-3.svg "$root/docs/pictures/drive.svg"
# The frame 1.2 s before v3 collides.
svl score "$root/scenarios/drive.toml" --seeds 4 --algo v5 --algo v3 --algo bm --quiet -o four --figures course >/dev/null
svl score four/course-4-v3.mcap --from 15.1 --to 15.2 --algo v5 --algo v3 --algo bm --quiet -o frame >/dev/null
python3 "$root/docs/pictures/story.py" frame/index.html course/course-4.svg >story.html
page story.png 1200,745 story.html

svl score "$root/scenarios/drive.toml" --seeds 501 --algo truth --quiet -o way >/dev/null
svl score way/course-501-truth.mcap --robot 0.16x0.12 --cells 24x12 --every 2 --algo bm --algo v3 --algo sgm --algo v5 \
  --stress row_offset --quiet -o shifted --figures phantoms >/dev/null
cp phantoms/row_offset-phantoms.svg "$root/docs/pictures/phantoms.svg"

# Estimates beside the truth, and a board as truth.
estimate() {
  svl score "$root/scenarios/$1.toml" --seeds "$2" --every 2 --algo sgm --algo bm --algo v3 --algo v4 --algo dp \
    --columns wrong,estimated_wrong --rerun none --quiet -o "$1" >/dev/null
}
estimate arena 81,82
estimate worlds 1001..1020
python3 "$root/docs/pictures/estimates.py" arena worlds >"$root/docs/pictures/estimates.svg"
svl record board --frames 120 --quiet -o board.mcap
svl calibrate board board.mcap --squares 9x6 --square-m 0.025 --yes -o board.yml >/dev/null
svl score board.mcap --calib board.yml --truth board:9x6 --cells 24x12 --every 6 --algo v5:max_disparity=160 \
  --algo bm:max_disparity=160 --rerun none --quiet -o board >/dev/null
python3 "$root/docs/pictures/board.py" board/index.html >board.html
page board.png 1200,335 board.html

# A ROS 2 bag.
svl record arena --ros2 --quiet -o drive.mcap
svl score drive.mcap --truth /truth/depth --algo v1 --algo v3 --algo bm --algo sgm --algo v5 --quiet >/dev/null
page report.png 1200,1480 reports/drive/index.html
