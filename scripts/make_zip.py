# SPDX-License-Identifier: GPL-3.0-or-later
"""Pack build/bvh_lab into dist/bvh_lab-<version>.zip, which Blender installs as an add-on.

One top-level folder holds both ``bl_info`` and ``blender_manifest.toml``, so one zip serves
Blender 3.4 and 4.2+ (the zip that Blender's own `extension build` makes does not install in 3.4).
Blender's own validator checks the manifest and the zip. The same files give the same zip, byte for
byte.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import sysconfig
import tomllib
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NAME = "bvh_lab"
EPOCH = (1980, 1, 1, 0, 0, 0)  # the earliest date that a zip can hold
VALIDATOR = "bpy/*/scripts/addons_core/bl_pkg/cli/blender_ext.py"


class ZipError(Exception):
    """Why there is no zip, in one sentence."""


def package_files(package: Path) -> dict[str, Path]:
    """Return the files by their name in the zip, sorted; links to the sources are followed."""
    files = {f"{NAME}/LICENSE": ROOT / "LICENSE"}
    for folder, _, names in os.walk(package, followlinks=True):
        if Path(folder).name != "__pycache__":
            paths = (Path(folder, name) for name in names)
            files |= {f"{NAME}/{path.relative_to(package)}": path for path in paths}
    if not any(Path(name).name.startswith("_core.") for name in files):
        raise ZipError(f"no compiled module in {package}: run make build first")
    return dict(sorted(files.items()))


def write_zip(path: Path, files: dict[str, Path]) -> None:
    """Write and validate the zip aside, then rename it."""
    path.parent.mkdir(parents=True, exist_ok=True)
    aside = path.with_name(f".{path.stem}.partial.zip")
    try:
        with zipfile.ZipFile(aside, "w") as archive:
            for name, file in files.items():
                entry = zipfile.ZipInfo(name, EPOCH)
                entry.external_attr = 0o100644 << 16
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, file.read_bytes(), compresslevel=9)
        validate(aside)
        aside.replace(path)
    finally:
        aside.unlink(missing_ok=True)


def validate(path: Path) -> None:
    """Let the validator of the bpy module look at the zip; raises ZipError with what it says."""
    validators = sorted(Path(sysconfig.get_path("purelib")).glob(VALIDATOR))
    if not validators:
        raise ZipError(f"no {VALIDATOR} beside {sys.executable}: run this with .venv/bin/python")
    command = [sys.executable, str(validators[-1]), "validate", str(path)]
    run = subprocess.run(command, capture_output=True, text=True)
    if run.returncode != 0:
        raise ZipError(f"Blender's validator refuses {path}: {run.stdout}{run.stderr}")


def main() -> int:
    """Make the zip and print its place and size."""
    parser = argparse.ArgumentParser(description="Make the add-on's installable zip.")
    parser.add_argument("--package", type=Path, default=ROOT / "build" / NAME, help="built package")
    parser.add_argument("--out", type=Path, default=ROOT / "dist", help="folder for the zip")
    arguments = parser.parse_args()
    try:
        files = package_files(arguments.package)
        manifest = tomllib.loads(files[f"{NAME}/blender_manifest.toml"].read_text(encoding="utf-8"))
        path = arguments.out / f"{NAME}-{manifest['version']}.zip"
        write_zip(path, files)
    except (ZipError, OSError) as error:
        print(f"make_zip: {error}", file=sys.stderr)
        return 1
    print(f"{path}: {len(files)} files, {path.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
