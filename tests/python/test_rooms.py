# SPDX-License-Identifier: GPL-3.0-or-later
"""The floors of the architecture: a lower room never includes or imports a higher one."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]

# What each native room may include, besides itself.
ROOMS = {
    "base": set(),
    "scene": {"base"},
    "bvh": {"base", "scene"},
    "build": {"base", "scene", "bvh"},
    "trace": {"base", "scene", "bvh", "build"},
    "render": {"base", "scene", "bvh", "build", "trace"},
    "opencl": {"base", "scene", "bvh", "build", "trace", "render"},
    # The references answer in the terms of trace/ray.h and share nothing else with what they judge.
    "reference": {"base", "scene", "trace/ray.h"},
    "image": {"base", "scene"},
    "python": {"base", "scene", "bvh", "build", "trace", "render", "opencl", "reference", "image"},
}


@pytest.mark.parametrize("room", ROOMS)
def test_native_rooms_include_only_lower_ones(room: str) -> None:
    files = [path for path in (ROOT / "native" / room).iterdir() if path.suffix in (".h", ".cpp")]
    assert files
    allowed = {room, *ROOMS[room]}
    for path in files:
        for included in re.findall(r'^#include "([^"]+)"', path.read_text(), re.MULTILINE):
            assert included.split("/")[0] in allowed or included in allowed, f"{path}: {included}"


def test_every_native_room_has_a_floor() -> None:
    assert {path.name for path in (ROOT / "native").iterdir()} == set(ROOMS)


def imports(path: Path) -> set[str]:
    """Names of the modules that a Python file imports, relative ones with their dots."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            module = "." * node.level + (node.module or "")
            names |= {module} | {f"{module.rstrip('.')}.{alias.name}" for alias in node.names}
    return names


def test_study_stands_on_nothing_of_blender() -> None:
    files = list((ROOT / "addon" / "study").glob("*.py"))
    assert files
    for path in files:
        for name in imports(path):
            assert name.split(".")[0] not in ("bpy", "mathutils", "gpu", "bmesh"), f"{path}: {name}"
            assert not re.match(r"\.+(blender|cli)\b", name), f"{path}: {name}"


def test_only_native_py_imports_the_compiled_module() -> None:
    for path in (ROOT / "addon").rglob("*.py"):
        if path.name != "native.py":
            assert not any(name.split(".")[-1] == "_core" for name in imports(path)), path


def test_only_drawing_in_a_window_touches_the_gpu_module() -> None:
    """A batch job has no graphics card: `gpu` is imported in functions of viewport_draw.py only."""
    for path in (ROOT / "addon").rglob("*.py"):
        touched = {name for name in imports(path) if name.split(".")[0] in {"gpu", "gpu_extras"}}
        assert not touched or path.name == "viewport_draw.py", path
        top = ast.Module(
            [node for node in ast.parse(path.read_text()).body if "Import" in type(node).__name__],
            [],
        )
        assert "gpu" not in ast.unparse(top), path


def test_every_source_names_its_licence() -> None:
    sources = [
        path
        for folder in ("addon", "native", "tests", "scripts", "blender_scenes")
        for path in (ROOT / folder).rglob("*")
        if path.suffix in (".py", ".h", ".cpp", ".sh", ".toml") and "__pycache__" not in path.parts
    ]
    assert len(sources) > 50
    for path in sources:
        head = path.read_text().split("\n", 3)[:3]
        assert any("SPDX-License-Identifier: GPL-3.0-or-later" in line for line in head), path
