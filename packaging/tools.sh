#!/usr/bin/env bash
# Makes a virtual environment with the tools of packaging/requirements.txt in the target folder, and prints its path.
# SVL_PYTHON names the Python.
set -euo pipefail
cd "$(dirname "$0")"
python="${SVL_PYTHON:-python3}"
target="$(cargo metadata --no-deps --format-version 1 | "$python" -c 'import json, sys; print(json.load(sys.stdin)["target_directory"])')"
tools="$target/packaging"
if ! cmp -s requirements.txt "$tools/complete"; then
  rm -f "$tools/complete"
  if ! { "$python" -m venv "$tools" && "$tools/bin/pip" -q install -r requirements.txt 2> /dev/null; } >&2; then
    echo "maturin, zig: missing; once with a network: $tools/bin/pip install -r packaging/requirements.txt" >&2
    exit 1
  fi
  cp requirements.txt "$tools/complete"
fi
echo "$tools"
