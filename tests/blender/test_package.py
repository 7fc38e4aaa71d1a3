# SPDX-License-Identifier: GPL-3.0-or-later
"""What Blender reads without importing, bl_info and manifest; and what importing must not do."""

from __future__ import annotations

import ast
import subprocess
import sys
import unittest
from collections.abc import Iterator
from pathlib import Path

import bpy
from blender_support import BUILD, REPOSITORY

ADDON = REPOSITORY / "addon"


def manifest() -> dict:
    import tomllib

    return tomllib.loads((ADDON / "blender_manifest.toml").read_text(encoding="utf-8"))


def bl_info() -> dict:
    """As Blender 3.4 reads it: a literal in the source."""
    for node in ast.parse((ADDON / "__init__.py").read_text(encoding="utf-8")).body:
        if isinstance(node, ast.Assign) and node.targets[0].id == "bl_info":
            return ast.literal_eval(node.value)
    raise AssertionError("no bl_info")


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and not node.level:
            yield str(node.module)


class Package(unittest.TestCase):
    def test_manifest_and_bl_info_agree(self) -> None:
        for key in ("name", "version", "tagline"):
            mine = bl_info()["description" if key == "tagline" else key]
            mine = ".".join(map(str, mine)) if key == "version" else mine
            self.assertEqual(manifest()[key], mine)
        self.assertIn(bl_info()["category"], manifest()["tags"])
        self.assertEqual(bl_info()["author"], manifest()["maintainer"])

    def test_import_needs_no_bpy_and_loads_nothing(self) -> None:
        code = (
            "import sys, bvh_lab; "
            "print([name for name in sys.modules if name == 'bpy' or name.startswith('bvh_lab.')])"
        )
        python = sys.executable if "python" in Path(sys.executable).name else "python3"
        run = subprocess.run(
            [python, "-c", code], cwd=BUILD, capture_output=True, text=True, check=True
        )
        self.assertEqual(run.stdout.strip(), "[]")

    def test_only_this_room_imports_bpy_and_only_the_viewport_gpu(self) -> None:
        for path in ADDON.rglob("*.py"):
            roots = {name.split(".")[0] for name in imports(path)}
            if path.name != "viewport_draw.py":
                self.assertFalse(roots & {"gpu", "bgl", "blf"}, path)
            if path.parent.name != "blender":
                self.assertNotIn("bpy", roots, path)

    def test_tooltips_end_without_a_dot(self) -> None:
        import bvh_lab
        from bvh_lab.blender import panel_state, properties

        bvh_lab.register()
        try:
            groups = (properties.BVHLAB_PG_settings, *panel_state.CLASSES)
            texts = [prop.description for group in groups for prop in group.bl_rna.properties]
            texts += [
                cls.bl_description
                for name in dir(bpy.types)
                if name.startswith("BVHLAB_OT_") and (cls := getattr(bpy.types, name))
            ]
        finally:
            bvh_lab.unregister()
        self.assertGreater(len(texts), 20)
        self.assertEqual([text for text in texts if text.endswith(".")], [])


if __name__ == "__main__":
    unittest.main()
