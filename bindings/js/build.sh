#!/usr/bin/env bash
# Builds the npm package: two WebAssembly modules and the JavaScript around them in `dist`, and with --pack the tarball
# in a folder. Tools that are not installed are kept in `target/js`. rustup adds the target wasm32-unknown-unknown if it
# is missing.
#
# usage: bindings/js/build.sh [--pack FOLDER]
set -euo pipefail
cd "$(dirname "$0")/../.."
export CARGO_TERM_COLOR=never

pack=
while [ $# -gt 0 ]; do
    case "$1" in
        --pack) pack=$(realpath "$2"); shift ;;
        *) printf 'usage: bindings/js/build.sh [--pack FOLDER]\n' >&2; exit 2 ;;
    esac
    shift
done

dist=bindings/js/dist
. bindings/js/wasm.sh

need_target
bindgen=$(bindgen)
wasm_opt=$(optimiser)

# A single codegen unit: the download size matters more than the build time. Less is inlined than by default, which
# makes the download about 8 % smaller. (Measured: a threshold of 25 gives 1 % more and the same times, 5 saves .1 %;
# with opt-level "s", it would be another 8 % smaller, but runs would take twice as long.)
export CARGO_PROFILE_RELEASE_LTO=fat CARGO_PROFILE_RELEASE_CODEGEN_UNITS=1 CARGO_PROFILE_RELEASE_PANIC=abort
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="$wasm_flags -C llvm-args=-inline-threshold=15"

# Code that runs once per call is optimised for size.
small=()
for package in lodsmith-asset lodsmith-bindings lodsmith-js serde_json indexmap robust; do
    small+=(--config "profile.release.package.$package.opt-level=\"z\"")
done

# Builds the module NAME with these features.
module() {
    local name=$1 features=$2
    cargo build --release --locked --package lodsmith-js --features "$features" "${small[@]}" \
        --target "$triple" --target-dir "$target_dir"
    # (Measured: inlining by wasm-opt in addition makes runs 4 % faster and the download 3 % larger; -O3 takes the same
    # times, and makes it .7 % larger; --converge repeats passes until they change nothing, which makes it .4 % smaller.)
    finish_module "$target_dir/$triple/release/lodsmith_js.wasm" "$dist/wasm" "$name" -O2 --skip-pass=inlining-optimizing \
        --converge
}

rm -rf "$dist"
mkdir -p "$dist/wasm"
module lodsmith ''
module lodsmith_files formats
cp -r bindings/js/lib/node "$dist"
cp bindings/js/lib/*.js bindings/js/lib/*.d.ts bindings/js/package.json LICENSE-MIT LICENSE-APACHE "$dist"
cp bindings/js/README.md "$dist/README.md"
node bindings/js/options_types.mjs "$dist"
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"$/\1/p' Cargo.toml)
[ "$(node -p 'require("./bindings/js/package.json").version')" = "$version" ] || {
    printf 'bindings/js/package.json does not have version %s\n' "$version" >&2
    exit 1
}
for name in lodsmith lodsmith_files; do
    say_size "$name" "$dist/wasm/${name}_bg.wasm"
done
[ -z "$pack" ] || (cd "$dist" && npm pack --silent --pack-destination "$pack")
