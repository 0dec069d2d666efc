# Tools for WebAssembly modules, for scripts that run in the root of the repository with `set -euo pipefail`. Tools that
# are not installed are kept in `target/js`.
# shellcheck shell=bash

target_dir=$(realpath -m "${CARGO_TARGET_DIR:-target}")
cache=$target_dir/js
triple=wasm32-unknown-unknown
mkdir -p "$cache"

# The version of a package in the lock file.
locked() { sed -n "/^name = \"$1\"\$/{n;s/^version = \"\(.*\)\"\$/\1/p}" Cargo.lock; }

has_target() { [ -d "$(rustc --print sysroot)/lib/rustlib/$triple/lib" ]; }

# Adds the standard library for WebAssembly if it is not there; the script ends with status 3 if that is not possible.
need_target() {
    if ! { has_target || rustup target add "$triple" > /dev/null 2>&1 && has_target; }; then
        printf 'no standard library for %s: rustup target add %s\n' "$triple" "$triple" >&2
        exit 3
    fi
}

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

# Vector instructions; no folder of this machine is in the modules.
wasm_flags="-C target-feature=+simd128,+bulk-memory \
--remap-path-prefix=$PWD= --remap-path-prefix=${CARGO_HOME:-$HOME/.cargo}= --remap-path-prefix=$(rustc --print sysroot)="

# What the compiler uses, and every browser and Node has had since 2023.
features_of_wasm=(
    --mvp-features --enable-simd --enable-bulk-memory --enable-bulk-memory-opt --enable-nontrapping-float-to-int
    --enable-sign-ext --enable-mutable-globals --enable-reference-types --enable-multivalue
)

# Makes the module NAME and its JavaScript in a folder from what the compiler has made: finish_module MADE FOLDER NAME
# OPTION..., with options of wasm-opt (such as -O3).
finish_module() {
    local made=$1 folder=$2 name=$3
    shift 3
    "$bindgen" --target web --out-dir "$folder" --out-name "$name" --remove-name-section --remove-producers-section "$made"
    node "$wasm_opt" "$@" "${features_of_wasm[@]}" --strip-debug --strip-producers \
        -o "$folder/${name}_bg.wasm" "$folder/${name}_bg.wasm"
}

# Prints the size of a module as it is and compressed.
say_size() {
    node -e 'const z = require("zlib"), b = require("fs").readFileSync(process.argv[2]);
        console.log(`${process.argv[1]}: ${b.length} bytes, ${z.gzipSync(b, { level: 9 }).length} by gzip, ${z.brotliCompressSync(b).length} by Brotli`)' "$1" "$2"
}
