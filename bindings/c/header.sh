#!/usr/bin/env bash
# Writes include/lodsmith.h from the sources; --check fails if it is not up to date.
set -euo pipefail
cd "$(dirname "$0")"
cbindgen=0.29.4

if [[ "$(cbindgen --version 2> /dev/null)" != "cbindgen $cbindgen" ]]; then
    cargo install --quiet --locked cbindgen --version "$cbindgen"
fi
out=$(mktemp)
trap 'rm -f "$out"' EXIT
cbindgen --quiet --config cbindgen.toml --output "$out" .
# Headings of the Rust documentation that have no meaning in C.
sed -i -e 's|^// # Safety$|// Conditions:|' "$out"
case "${1:-}" in
    '') cp "$out" include/lodsmith.h ;;
    --check) diff -u include/lodsmith.h "$out" || { printf 'run bindings/c/header.sh\n' >&2; exit 1; } ;;
    *) printf 'usage: header.sh [--check]\n' >&2; exit 2 ;;
esac
