#!/usr/bin/env bash
# Builds the C library and installs it: install.sh PREFIX. Linux and macOS.
#
#   PREFIX/include/lodsmith.h
#   PREFIX/lib/liblodsmith.{a,so}          (macOS: .dylib)
#   PREFIX/lib/pkgconfig/lodsmith.pc
#   PREFIX/lib/cmake/lodsmith/             find_package(lodsmith CONFIG)
#   PREFIX/share/licenses/lodsmith/
#
# LODSMITH_PROFILE=dev builds without optimisation. LODSMITH_FILES=0 leaves out the jobs on files, which makes the
# library a third of the size; then the installed header does not declare them. The installed files can be moved to
# another folder.
set -euo pipefail
[ $# = 1 ] || { printf 'usage: install.sh PREFIX\n' >&2; exit 2; }
mkdir -p "$1"
prefix=$(cd "$1" && pwd)
cd "$(dirname "$0")/../.."
profile=${LODSMITH_PROFILE:-release}

# FBX is read by a library in C; users of this C interface have a C compiler.
case "${LODSMITH_FILES:-1}" in
    0) features=(--no-default-features) ;;
    *) features=(--features fbx) ;;
esac

cargo build --locked --package lodsmith-c --profile "$profile" "${features[@]}"
folder=${CARGO_TARGET_DIR:-target}/$profile
[ "$profile" != dev ] || folder=${CARGO_TARGET_DIR:-target}/debug
version=$(sed -n 's/^version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1)
major=${version%%.*}

lib=$prefix/lib
mkdir -p "$prefix/include" "$lib/pkgconfig" "$lib/cmake/lodsmith" "$prefix/share/licenses/lodsmith"
install -m 644 bindings/c/include/lodsmith.h "$prefix/include/"
if [ "${LODSMITH_FILES:-1}" = 0 ]; then
    awk '{ print } /^#define LODSMITH_H$/ { print "\n#define LODSMITH_NO_FILES 1" }' \
        bindings/c/include/lodsmith.h > "$prefix/include/lodsmith.h"
fi
install -m 644 LICENSE-MIT LICENSE-APACHE "$prefix/share/licenses/lodsmith/"
install -m 644 "$folder/liblodsmith_c.a" "$lib/liblodsmith.a"
if [ "$(uname)" = Darwin ]; then
    shared=liblodsmith.dylib
    install -m 755 "$folder/liblodsmith_c.dylib" "$lib/liblodsmith.$version.dylib"
    ln -sf "liblodsmith.$version.dylib" "$lib/liblodsmith.$major.dylib"
    ln -sf "liblodsmith.$major.dylib" "$lib/$shared"
    private='-lSystem -lm'
else
    shared=liblodsmith.so
    install -m 755 "$folder/liblodsmith_c.so" "$lib/$shared.$version"
    ln -sf "$shared.$version" "$lib/$shared.$major"
    ln -sf "$shared.$major" "$lib/$shared"
    private='-lgcc_s -lpthread -lm -ldl'
fi

fill() { sed -e "s|@VERSION@|$version|g" -e "s|@MAJOR@|$major|g" -e "s|@SHARED@|$shared|g" -e "s|@PRIVATE@|$private|g" "$1" > "$2"; }
fill bindings/c/cmake/lodsmith.pc.in "$lib/pkgconfig/lodsmith.pc"
fill bindings/c/cmake/lodsmith-config.cmake.in "$lib/cmake/lodsmith/lodsmith-config.cmake"
fill bindings/c/cmake/lodsmith-config-version.cmake.in "$lib/cmake/lodsmith/lodsmith-config-version.cmake"
