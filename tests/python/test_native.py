# SPDX-License-Identifier: GPL-3.0-or-later
"""The door to the compiled core: what it says where there is none that fits."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

import pytest
from bvh_lab import native

ADDON = Path(__file__).parents[2] / "addon"


def import_core(folder: Path) -> str:
    """The text of the NativeMissing that importing the core from ``folder`` raises."""
    program = (
        "import bvh_lab.native as native\n"
        "try:\n    from bvh_lab.native import core\n"
        "except native.NativeMissing as error:\n    print(error)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=folder,
        env={"PYTHONPATH": str(folder)},
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.count("\n") == 1
    return done.stdout


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the add-on without the core; its parent folder is on the path of `import_core`."""
    ignore = shutil.ignore_patterns("__pycache__", "_core*")
    return Path(shutil.copytree(ADDON, tmp_path / "bvh_lab", ignore=ignore))


def test_core_is_loaded_once() -> None:
    assert native.core is native.load()


def test_one_version_everywhere() -> None:
    tree = ast.parse((ADDON / "__init__.py").read_text())
    info = next(
        ast.literal_eval(node.value)
        for node in tree.body
        if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "bl_info"
    )
    assert ".".join(map(str, info["version"])) == native.package_version()
    assert native.load().__version__ == native.package_version()


def test_unknown_attribute() -> None:
    with pytest.raises(AttributeError, match="nothing_here"):
        _ = native.nothing_here


def test_missing_file_names_what_was_looked_for(package: Path) -> None:
    said = import_core(package.parent)
    assert f"_core{EXTENSION_SUFFIXES[0]}" in said
    assert "found none" in said and "make build" in said


def test_file_for_another_python_is_named(package: Path) -> None:
    (package / "_core.cpython-399-x86_64-linux-gnu.so").touch()
    assert "found _core.cpython-399-x86_64-linux-gnu.so" in import_core(package.parent)


def test_broken_file_says_so(package: Path) -> None:
    (package / f"_core{EXTENSION_SUFFIXES[0]}").write_text("not a library")
    assert "does not load" in import_core(package.parent)


def test_core_of_another_version(package: Path) -> None:
    shutil.copy(native.load().__file__, package)
    manifest = package / "blender_manifest.toml"
    manifest.write_text(manifest.read_text().replace('\nversion = "', '\nversion = "9'))
    assert f"is version {native.package_version()}" in import_core(package.parent)
