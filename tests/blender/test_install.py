# SPDX-License-Identifier: GPL-3.0-or-later
"""`make zip`'s zip, installed into an empty Blender: Debian's, and the bpy module's."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import unittest
import zipfile
from pathlib import Path

import bpy
from blender_support import BUILD, REPOSITORY

SCRIPT = Path(__file__).with_name("install_in_blender.py")
BLENDER = "/usr/bin/blender"


@unittest.skipUnless(getattr(bpy.app, "module", False), "run once, with the bpy module")
class Install(unittest.TestCase):
    @classmethod
    def setUpClass(cls) -> None:
        cls.folder = Path(tempfile.mkdtemp())
        cls.zips = [cls.make_zip(name) for name in ("first", "second")]

    @classmethod
    def tearDownClass(cls) -> None:
        shutil.rmtree(cls.folder)

    @classmethod
    def make_zip(cls, name: str) -> Path:
        script = REPOSITORY / "scripts" / "make_zip.py"
        command = [sys.executable, str(script), "--package", str(BUILD / "bvh_lab")]
        subprocess.run([*command, "--out", str(cls.folder / name)], check=True)
        (made,) = (cls.folder / name).iterdir()
        return made

    def test_zip(self) -> None:
        first, second = self.zips
        self.assertEqual(first.read_bytes(), second.read_bytes())
        names = zipfile.ZipFile(first).namelist()
        self.assertEqual({name.split("/")[0] for name in names}, {"bvh_lab"})
        for name in ("__init__.py", "blender_manifest.toml", "LICENSE", "cli.py"):
            self.assertIn(f"bvh_lab/{name}", names)
        self.assertTrue(any(name.startswith("bvh_lab/_core.") for name in names))
        self.assertFalse([name for name in names if "__pycache__" in name])

    def install(self, *command: str) -> None:
        with tempfile.TemporaryDirectory() as resources:
            environment = {**os.environ, "BLENDER_USER_RESOURCES": resources}
            environment.pop("PYTHONPATH", None)
            run = subprocess.run(
                [*command, str(self.zips[0])], env=environment, capture_output=True, text=True
            )
            self.assertEqual(run.returncode, 0, run.stdout + run.stderr)
            self.assertIn("installed ", run.stdout)

    @unittest.skipUnless(Path(BLENDER).exists(), f"no {BLENDER}")
    def test_debians_blender(self) -> None:
        options = ["--background", "--factory-startup", "-noaudio", "--python-exit-code", "1"]
        self.install(BLENDER, *options, "--python", str(SCRIPT), "--")

    def test_bpy_module(self) -> None:
        self.install(sys.executable, str(SCRIPT))


if __name__ == "__main__":
    unittest.main()
