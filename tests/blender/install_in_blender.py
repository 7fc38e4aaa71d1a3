# SPDX-License-Identifier: GPL-3.0-or-later
"""Install the zip as a user would, enable and disable it three times, and compare once.

blender --background --python install_in_blender.py -- ZIP     (or `python` with the bpy module)
"""

from __future__ import annotations

import sys
import traceback

import bpy

ZIP = sys.argv[-1]


def install() -> str:
    """Install without enabling; return the module's name."""
    if bpy.app.version >= (4, 2, 0):
        bpy.ops.extensions.package_install_files(
            filepath=ZIP, repo="user_default", enable_on_install=False
        )
        return "bl_ext.user_default.bvh_lab"
    bpy.ops.preferences.addon_install(filepath=ZIP)
    return "bvh_lab"


def left_behind() -> list[str]:
    found = [name for name in dir(bpy.types) if name.startswith("BVHLAB_")]
    return found + (["Scene.bvh_lab"] if hasattr(bpy.types.Scene, "bvh_lab") else [])


def main() -> None:
    module = install()
    for turn in range(3):
        bpy.ops.preferences.addon_enable(module=module)
        assert module in bpy.context.preferences.addons, f"{module} is not enabled"
        assert len(left_behind()) > 10, left_behind()
        bpy.context.preferences.addons[module].preferences.threads = 2
        if turn == 2:
            settings = bpy.context.scene.bvh_lab
            settings.resolution, settings.repeats, settings.use_sbvh = 32, 3, False
            assert bpy.ops.bvhlab.compare() == {"FINISHED"}
        bpy.ops.preferences.addon_disable(module=module)
        assert not left_behind(), left_behind()
    print(f"installed {module} in {bpy.app.version_string}", flush=True)


try:
    main()
except BaseException:
    traceback.print_exc()
    sys.exit(1)
