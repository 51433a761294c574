#!/usr/bin/env bash
# Builds the wheel, installs it into a virtual environment, and runs tests/python/svl_bench_test.py there. Without maturin
# it fails.
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
  echo "maturin, numpy: missing; pip install -r tests/python/requirements.txt, and SVL_PYTHON names that Python" >&2
  exit 1
fi
work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
packaging/wheel.sh "$work" "$profile"

"$python" -m venv "$work/venv"
# numpy and the like are those of $python: no network is needed.
"$python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))' > \
  "$("$work/venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/base.pth"
"$work/venv/bin/pip" -q install --no-index --no-deps "$work"/svl_bench-*.whl
cd "$work"
"$work/venv/bin/python" "$OLDPWD/tests/python/svl_bench_test.py"
