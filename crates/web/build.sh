#!/usr/bin/env bash
# Builds the page of the viewer into a folder (default: target/web): index.html and its files, for any static host and
# any path. `cargo xtask web` calls it. Exits with status 3 if there is no compiler for WebAssembly.
#
# usage: crates/web/build.sh [FOLDER]
set -euo pipefail
cd "$(dirname "$0")/../.."
export CARGO_TERM_COLOR=never
. bindings/js/wasm.sh

page=$(realpath -m "${1:-$target_dir/web/page}")
need_target
bindgen=$(bindgen)
wasm_opt=$(optimiser)
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS=$wasm_flags
cargo build --quiet --locked --profile web --package lodsmith-web --target "$triple" --target-dir "$target_dir"
mkdir -p "$page"
finish_module "$target_dir/$triple/web/lodsmith_web.wasm" "$page" lodsmith -O2
rm -f "$page"/*.d.ts
cp crates/web/page/* LICENSE-MIT LICENSE-APACHE "$page"
say_size lodsmith "$page/lodsmith_bg.wasm"
