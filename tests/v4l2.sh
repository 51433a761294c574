#!/bin/sh
# Records from real V4L2 drivers: boots a Debian kernel in qemu, where the test driver vivid makes cameras, and runs
# tests/v4l2/guest.sh there with the svl that is named, or built for it. Installs what it needs with apt-get where that
# is missing. The machine is emulated, not virtual: KVM is not everywhere, and where it is it may not work.
set -eu
cd "$(dirname "$0")/.."
packages="qemu-system-x86 linux-image-amd64 busybox-static v4l-utils cpio kmod xz-utils python3-minimal"
limit_s=240

# shellcheck disable=SC2012
newest_kernel() { ls /lib/modules/*/kernel/drivers/media/test-drivers/vivid/vivid.ko* 2>/dev/null | tail -1 | cut -d/ -f4; }
missing() {
  for tool in qemu-system-x86_64 busybox v4l2-ctl cpio modprobe; do command -v $tool >/dev/null || return 0; done
  [ ! -r "/boot/vmlinuz-$(newest_kernel)" ]
}
if [ "$(uname -sm)" != "Linux x86_64" ]; then
  echo "skipped: the V4L2 tests run on Linux x86_64"
  exit 0
fi
if missing; then
  as_root=""
  [ "$(id -u)" = 0 ] || as_root="sudo -n"
  install="$as_root apt-get install -qq -y --no-install-recommends $packages"
  $install >/dev/null 2>&1 || { $as_root apt-get update -qq && $install >/dev/null; } 2>/dev/null || {
    echo "skipped: the V4L2 tests need $packages, which could not be installed: as root, apt-get install $packages"
    exit 0
  }
fi
if [ $# = 0 ]; then
  cargo build --release --locked
  set -- "$(cargo metadata --format-version 1 --no-deps | sed 's/.*"target_directory":"\([^"]*\)".*/\1/')/release/svl"
fi
svl="$(realpath "$1")"
kernel="$(newest_kernel)"

work="$(mktemp -d)"
machine=""
trap '[ -z "$machine" ] || kill "$machine" 2>/dev/null || true; rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
mkdir -p "$work/root/bin" "$work/out"
cp "$(command -v busybox)" "$work/root/bin/busybox"
for module in virtio_pci 9pnet_virtio 9p vivid vhci_hcd uvcvideo; do
  modprobe -D -S "$kernel" "$module" | awk '$1 == "insmod" { print $2 }'
done | awk '!seen[$0]++' >"$work/modules"
while read -r module; do
  case "$module" in
    *.xz) xz -dc "$module" >"$work/root/$(basename "$module" .xz)" ;;
    *) cp "$module" "$work/root/" ;;
  esac
done <"$work/modules"
{
  cat <<'INIT'
#!/bin/busybox sh
b=/bin/busybox
for folder in proc sys dev host; do $b mkdir -p /$folder; done
$b mount -t devtmpfs dev /dev
$b mount -t proc proc /proc
$b mount -t sysfs sys /sys
INIT
  # One vivid for each: two webcams, one with several planes, one that gives no images.
  arguments="n_devs=4 node_types=0x1,0x1,0x1,0x20000 num_inputs=1,1,1,1 input_types=0,0,0,0 multiplanar=1,1,2,1"
  while read -r module; do
    name="$(basename "$module" .xz)"
    case "$name" in vivid.ko*) echo "\$b insmod /$name $arguments" ;; *) echo "\$b insmod /$name" ;; esac
  done <"$work/modules"
  cat <<INIT
\$b mount -t 9p -o ro,trans=virtio,version=9p2000.L,msize=262144,cache=loose host /host
for folder in dev proc sys; do \$b mount -o bind /\$folder /host/\$folder; done
\$b mount -t tmpfs work /host/mnt
\$b mkdir /host/mnt/out
\$b mount -t 9p -o trans=virtio,version=9p2000.L out /host/mnt/out
\$b chroot /host /bin/sh -c 'export PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/mnt; exec sh "$PWD/tests/v4l2/guest.sh" "$svl" "$PWD"' >/dev/console 2>&1
echo \$? >/host/mnt/out/status
\$b poweroff -f
INIT
} >"$work/root/init"
chmod +x "$work/root/init"
(cd "$work/root" && find . | cpio -o -H newc --quiet) >"$work/initramfs"
timeout "$limit_s" qemu-system-x86_64 -accel tcg -m 768 -smp 2 -display none -monitor none -serial stdio -no-reboot \
  -kernel "/boot/vmlinuz-$kernel" -initrd "$work/initramfs" -append "console=ttyS0 quiet panic=-1" \
  -virtfs local,path=/,mount_tag=host,security_model=none,readonly=on,multidevs=remap \
  -virtfs local,path="$work/out",mount_tag=out,security_model=none </dev/null >"$work/console" 2>&1 &
machine=$!
wait "$machine" || true
machine=""
tr -d '\r' <"$work/console" | grep -a '^svl: ' || true
[ ! -d "${SVL_V4L2_OUT:-}" ] || cp -r "$work/out/." "$SVL_V4L2_OUT"
status="$(cat "$work/out/status" 2>/dev/null || echo "none within $limit_s s")"
[ "$status" = 0 ] || { echo "the V4L2 tests failed: status $status"; exit 1; }
