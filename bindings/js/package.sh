#!/usr/bin/env bash
# Makes the npm package: package.sh FOLDER.
set -euo pipefail
[ $# = 1 ] || { printf 'usage: package.sh FOLDER\n' >&2; exit 2; }
mkdir -p "$1"
exec "$(dirname "$0")/build.sh" --pack "$(cd "$1" && pwd)"
