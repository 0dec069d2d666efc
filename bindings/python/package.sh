#!/usr/bin/env bash
# Builds the wheel: package.sh FOLDER. With LODSMITH_TARGET for another platform.
# Needs Python 3.9 or later with venv. Uses the installed maturin, or installs one in the target folder.
set -euo pipefail
[ $# = 1 ] || { printf 'usage: package.sh FOLDER\n' >&2; exit 2; }
mkdir -p "$1"
folder=$(cd "$1" && pwd)
cd "$(dirname "$0")/../.."

if command -v maturin > /dev/null; then
    maturin=maturin
else
    tools=${CARGO_TARGET_DIR:-$PWD/target}/maturin
    [ -x "$tools/bin/maturin" ] || { python3 -m venv "$tools" && "$tools/bin/pip" install --quiet 'maturin>=1.9,<2'; }
    maturin=$tools/bin/maturin
fi
words=(--release --locked --out "$folder")
[ -z "${LODSMITH_TARGET:-}" ] || words+=(--target "$LODSMITH_TARGET")
cd bindings/python
"$maturin" build "${words[@]}"
