#!/usr/bin/env bash
# Builds the npm package: two WebAssembly modules and the JavaScript around them in `dist`, and the tarball in the folder
# that --pack names. Tools that are not installed are kept in `target/js`. The target
# wasm32-unknown-unknown is added by rustup if it is not there.
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

target_dir=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cache=$target_dir/js
dist=bindings/js/dist
triple=wasm32-unknown-unknown
mkdir -p "$cache"

# The version of a package in the lock file.
locked() { sed -n "/^name = \"$1\"\$/{n;s/^version = \"\(.*\)\"\$/\1/p}" Cargo.lock; }

has_target() { [ -d "$(rustc --print sysroot)/lib/rustlib/$triple/lib" ]; }

# wasm-bindgen of the version in the lock file, which the modules must be made for.
bindgen() {
    local version tool
    version=$(locked wasm-bindgen)
    for tool in wasm-bindgen "$cache/tools/bin/wasm-bindgen"; do
        if [ "$("$tool" --version 2> /dev/null)" = "wasm-bindgen $version" ]; then
            command -v "$tool"
            return
        fi
    done
    # (It runs for seconds: little optimisation is enough.)
    CARGO_PROFILE_RELEASE_OPT_LEVEL=1 cargo install --quiet wasm-bindgen-cli --version "$version" \
        --root "$cache/tools" --target-dir "$cache/tools-build" >&2
    rm -rf "$cache/tools-build"
    printf '%s\n' "$cache/tools/bin/wasm-bindgen"
}

# wasm-opt of this version; older ones do not know all instructions that the compiler uses.
optimiser() {
    local binaryen=132.0.0
    if [ "$(cat "$cache/binaryen/version" 2> /dev/null)" != "$binaryen" ]; then
        mkdir -p "$cache/binaryen"
        npm install --silent --no-audit --no-fund --prefix "$cache/binaryen" "binaryen@$binaryen" >&2
        printf '%s' "$binaryen" > "$cache/binaryen/version"
    fi
    printf '%s\n' "$cache/binaryen/node_modules/binaryen/bin/wasm-opt"
}

bindgen=$(bindgen)
wasm_opt=$(optimiser)

if ! { has_target || rustup target add "$triple" > /dev/null 2>&1 && has_target; }; then
    printf 'no standard library for %s: rustup target add %s\n' "$triple" "$triple" >&2
    exit 3
fi

# One unit for everything: the modules are downloaded, and a build of them is rare. Less is inlined than by default, which
# takes some 7 % off the download. (Measured: a threshold of 25; opt-level "s" would take off 8 % more, and runs would
# take twice as long.) No folder of this machine is in them.
export CARGO_PROFILE_RELEASE_LTO=fat CARGO_PROFILE_RELEASE_CODEGEN_UNITS=1 CARGO_PROFILE_RELEASE_PANIC=abort
export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS="-C target-feature=+simd128,+bulk-memory -C llvm-args=-inline-threshold=25 \
--remap-path-prefix=$PWD= --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}= --remap-path-prefix=$(rustc --print sysroot)="

# What the compiler uses, and every browser and Node has had since 2023.
features_of_wasm=(
    --mvp-features --enable-simd --enable-bulk-memory --enable-bulk-memory-opt --enable-nontrapping-float-to-int
    --enable-sign-ext --enable-mutable-globals --enable-reference-types --enable-multivalue
)

# Builds the module NAME with these features.
module() {
    local name=$1 features=$2
    cargo build --release --quiet --locked --package lodsmith-js --features "$features" \
        --target "$triple" --target-dir "$target_dir"
    "$bindgen" --target web --out-dir "$dist/wasm" --out-name "$name" --remove-name-section --remove-producers-section \
        "$target_dir/$triple/release/lodsmith_js.wasm"
    node "$wasm_opt" -O3 "${features_of_wasm[@]}" --strip-debug --strip-producers \
        -o "$dist/wasm/${name}_bg.wasm" "$dist/wasm/${name}_bg.wasm"
}

rm -rf "$dist"
mkdir -p "$dist/wasm"
module lodsmith ''
module lodsmith_files formats
cp bindings/js/lib/*.js bindings/js/lib/*.d.ts bindings/js/package.json LICENSE-MIT LICENSE-APACHE "$dist"
cp bindings/js/README.md "$dist/README.md"
node bindings/js/options_types.mjs "$dist"
version=$(sed -n '/^\[workspace.package\]/,/^$/s/^version = "\(.*\)"$/\1/p' Cargo.toml)
[ "$(node -p 'require("./bindings/js/package.json").version')" = "$version" ] || {
    printf 'bindings/js/package.json is not of version %s\n' "$version" >&2
    exit 1
}
for name in lodsmith lodsmith_files; do
    wasm=$dist/wasm/${name}_bg.wasm
    node -e 'const z = require("zlib"), b = require("fs").readFileSync(process.argv[2]);
        console.log(`${process.argv[1]}: ${b.length} bytes, ${z.gzipSync(b, { level: 9 }).length} by gzip, ${z.brotliCompressSync(b).length} by Brotli`)' "$name" "$wasm"
done
[ -z "$pack" ] || (cd "$dist" && npm pack --silent --pack-destination "$pack")
