#!/usr/bin/env bash
# Packs the add-on with the wheel of this platform: package.sh FOLDER. Blender installs the file by
# Edit > Preferences > Get Extensions > Install from Disk. With LODSMITH_TARGET for another platform.
set -euo pipefail
[ $# = 1 ] || { printf 'usage: package.sh FOLDER\n' >&2; exit 2; }
mkdir -p "$1"
folder=$(cd "$1" && pwd)
cd "$(dirname "$0")/../.."

work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
bindings/python/package.sh "$work/wheels"
python3 - "$work/wheels" "$folder" << 'END'
import os, pathlib, re, sys, time, zipfile

wheels, folder = map(pathlib.Path, sys.argv[1:])
source = pathlib.Path("bindings/blender/lodsmith_blender")
(wheel,) = wheels.glob("*.whl")
text = (source / "blender_manifest.toml").read_text()
version = re.search(r'^version = "(.+)"$', text, re.M)[1]
text = text.replace("wheels = []", f'wheels = ["./wheels/{wheel.name}"]')
platform = wheel.stem.split("-")[-1]
when = time.gmtime(max(int(os.environ.get("SOURCE_DATE_EPOCH", "315532800")), 315532800))[:6]
files = {path.name: path.read_bytes() for path in sorted(source.glob("*.py"))}
files["blender_manifest.toml"] = text.encode()
for name in ("LICENSE-APACHE", "LICENSE-MIT"):
    files[name] = pathlib.Path(name).read_bytes()
files[f"wheels/{wheel.name}"] = wheel.read_bytes()
with zipfile.ZipFile(folder / f"lodsmith-blender-{version}-{platform}.zip", "w") as out:
    for name, data in sorted(files.items()):
        entry = zipfile.ZipInfo(name, when)
        entry.compress_type = zipfile.ZIP_DEFLATED
        entry.external_attr = 0o644 << 16
        out.writestr(entry, data)
END
