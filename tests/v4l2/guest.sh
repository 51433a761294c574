# Runs in the virtual machine of tests/v4l2.sh, as root, with two vivid cameras (/dev/video0, /dev/video1), one with
# images in several planes (/dev/video2) and one that gives none (/dev/video3). USB webcams are plugged in at the end.
# shellcheck shell=sh disable=SC2015,SC2046,SC2164
svl=$1
house=$2
both=v4l2:/dev/video0,/dev/video1
small=$both,size=320x180
cd /mnt
failures=0

say() { echo "svl: $*"; }
# expect CODE WORDS... : the last command ended so, and what it said holds all of these.
expect() {
  wanted=$1
  shift
  [ "$code" = "$wanted" ] || fail "exit code $code, not $wanted"
  for words in "$@"; do
    case "$said" in *"$words"*) ;; *) fail "does not say '$words'" ;; esac
  done
}
fail() {
  say "FAILED: $what: $*; it said: $(echo "$said" | tr '\n' '|')"
  failures=$((failures + 1))
}
try() {
  what="$*"
  said=$("$svl" "$@" 2>&1)
  code=$?
}
# Records to a file of that name in the background; `ended` waits for the end.
begin() {
  name=$1
  shift
  what="record $* -o $name"
  timeout -s KILL 40 "$svl" record "$@" -o "$name" >"$name.said" 2>&1 &
  recording=$!
  until [ -s "$name" ] || ! kill -0 $recording 2>/dev/null; do sleep 0.1; done
  sleep 0.5
}
ended() {
  wait $recording
  code=$?
  said=$(cat "$name.said")
}
control() { v4l2-ctl -d "/dev/video$1" -c "$2" || fail "control $2"; }

try record --list
expect 0 "/dev/video0             camera: vivid-000" "GREY: 320x180 (60 Hz), 640x360 (40 Hz), 640x480 (25 Hz)" \
  "gives images in several planes" "captures no images"

# What works.
try record "$both" --frames 60 -o usual.mcap
expect 0 "usual.mcap: 60 pairs"
case "$said" in *"gives no times"*) fail "vivid gives times" ;; esac
say "$(echo "$said" | head -1)"
try info usual.mcap
expect 0 "pairs      60" "intact     yes"
try record "$small,format=YUYV" --rate 50 --frames 60 -o yuyv.mcap
expect 0 "60 pairs"
try record "$both,size=640x480" --frames 10 -o slow.mcap
expect 0 "10 pairs" "gives 25.0 images per second in GREY of 640x480"
control 0 timestamp_source=1
control 1 timestamp_source=1
try record "$small" --frames 20 -o begin.mcap
expect 0 "20 pairs"
cp usual.mcap yuyv.mcap /mnt/out/

# What is refused, with one line and without a file.
refused() {
  wanted_code=$1 cameras=$2 words=$3
  shift 3
  try record "$cameras" -o refused.mcap "$@"
  expect "$wanted_code" "$words"
  [ "$(echo "$said" | wc -l)" = 1 ] || fail "more than one line"
  [ ! -e refused.mcap ] || fail "left a file"
}
ln -sf /dev/video0 /mnt/left
refused 2 v4l2:/dev/video0,/dev/video0 "is named twice"
refused 1 v4l2:/mnt/left,/dev/video0 "/mnt/left and /dev/video0 are one camera"
refused 1 v4l2:/dev/video0,/dev/video9 "/dev/video9: no such device; \`svl record --list\`"
refused 1 v4l2:/dev/video0,/dev/video2 "/dev/video2: gives images in several planes"
refused 1 v4l2:/dev/video3,/dev/video0 "/dev/video3: captures no images"
refused 1 v4l2:/dev/null,/dev/video0 "/dev/null: is no video device"
refused 1 "$both,size=123x45" "no GREY, YUYV, UYVY or MJPG mode of 123x45 in common"
refused 1 "$both,format=MJPG" "no MJPG mode in common"
refused 2 "$both" "svl cannot trigger v4l2 cameras" --trigger software
refused 2 "$both" "use --pairing stamp" --pairing trigger
control 1 inject_vidioc_streamon_error=1
refused 1 "$both" "/dev/video1: "
what="as another user"
said=$(cd / && setpriv --reuid 65534 --clear-groups "$svl" record "$both" -o /mnt/refused.mcap 2>&1)
code=$?
expect 1 "/dev/video0: permission denied; join the group"

begin busy.mcap "$small"
refused 1 "$both" "/dev/video0: in use by another program; close that"
kill -INT $(pgrep -P $recording)
ended
expect 0 "busy.mcap: " " pairs in "

# What goes wrong on the way.
begin damaged.mcap "$small" --frames 60
control 1 inject_v4l2_buf_flag_error=1
ended
expect 0 "60 pairs" "1 damaged on the way" "/dev/video1: an image arrived damaged (its driver says so)"

control 1 percentage_of_dropped_buffers=30
try record "$small" --frames 30 -o dropped.mcap
expect 0 "30 pairs" "too far apart in time"
control 1 percentage_of_dropped_buffers=0

control 1 wrap_timestamp=1
try record "$small" --frames 10 -o wrapped.mcap
expect 0 "10 pairs" "/dev/video1: its driver gives no times"
control 1 wrap_timestamp=0

begin fatal.mcap "$small"
control 0 inject_fatal_streaming_error=1
ended
expect 1 "left camera, /dev/video0: its driver failed; unplug it, plug it in and record again"

begin gone.mcap "$small"
control 1 disconnect=1
ended
expect 1 "right camera, /dev/video1: disconnected; plug it in and record again"
for name in gone fatal damaged; do
  try info $name.mcap
  expect 0 "intact     yes"
done

# Webcams by the kernel's USB driver, with a shutter and a gain to be set, and JPEGs without Huffman tables.
plug() { python3 "$house/tests/v4l2/webcam.py" "$1" "$house/src/grab/v4l2/linux/webcam.jpg" >"/mnt/webcam$1.set" & }
webcams() { grep -lx 0 /dev/null $(grep -l "Test webcam" /sys/class/video4linux/*/name | sed 's/name$/index/') | cut -d/ -f5; }
plug 0
left_cord=$!
plug 1
right_cord=$!
for _ in $(seq 100); do [ "$(webcams | wc -l)" = 2 ] && break || sleep 0.1; done
left=/dev/$(webcams | head -1) right=/dev/$(webcams | tail -1)
try record --list
expect 0 "$left             camera: Test webcam" "MJPG: 64x48 (30 Hz)"
try record "v4l2:$left,$right" --frames 60 -o webcams.mcap
expect 0 "60 pairs"
say "$(echo "$said" | head -1)"
for number in 0 1; do
  said=$(cat /mnt/webcam$number.set)
  what="what webcam $number was set to"
  expect 0 "automatic exposure 1" "exposure priority 0" "exposure 40" "gain 16"
done
cp webcams.mcap /mnt/out/
begin half.mcap "v4l2:$left,$right" --timeout 0.3
kill -USR1 $right_cord
ended
expect 1 "$right: an image arrived damaged (a JPEG that is cut off: it has no end marker, 269 bytes)" \
  ": all its images arrived damaged for" "check its cable"
kill -USR1 $right_cord
begin unplugged.mcap "v4l2:$left,$right"
kill $left_cord
ended
expect 1 ": disconnected; plug it in and record again"
kill $right_cord

[ $failures = 0 ] && say "all passed in $(cut -d' ' -f1 /proc/uptime) s of the machine's time"
exit $failures
