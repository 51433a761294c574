#!/usr/bin/env bash
# Builds the wheel, installs it into a virtual environment, and runs tests/python/svl_bench_test.py there. Without maturin
# it is skipped.
#
#   packaging/python-test.sh                       # in the profile release
#   packaging/python-test.sh work
#
# SVL_PYTHON names a Python with numpy and maturin, and for all tests those of tests/python/requirements.txt.
set -euo pipefail
cd "$(dirname "$0")/.."
profile="${1:-release}"
python="${SVL_PYTHON:-python3}"
if ! "$python" -c 'import maturin, numpy' 2> /dev/null; then
  echo "no Python with maturin, numpy; SVL_PYTHON names one" | tee -a "${SVL_SKIPPED:-/dev/null}" >&2
  exit
fi
target="$(cargo metadata --no-deps --format-version 1 | "$python" -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT

cargo build --quiet --locked --profile "$profile" --bin svl
rm -rf packaging/svl.data && mkdir -p packaging/svl.data/scripts
ln "$target/$profile/svl" packaging/svl.data/scripts/ 2> /dev/null || cp "$target/$profile/svl" packaging/svl.data/scripts/
"$python" -m maturin build --quiet --locked --profile "$profile" --manifest-path src/python/Cargo.toml -o "$work"

"$python" -m venv "$work/venv"
# numpy and the like are those of $python: no network is needed.
"$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' > \
  "$("$work/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/base.pth"
"$work/venv/bin/pip" -q install --no-index --no-deps "$work"/svl_bench-*.whl
cd "$work"
"$work/venv/bin/python" "$OLDPWD/tests/python/svl_bench_test.py"
