# SPDX-License-Identifier: GPL-3.0-or-later
"""What holds for every file: where results go, and how many threads to use."""

from __future__ import annotations

from pathlib import Path

import bpy
from bpy.props import IntProperty, StringProperty

from ..study.devices import described
from .text import paragraph

PACKAGE = __package__.rpartition(".")[0]


class BVHLAB_AP_preferences(bpy.types.AddonPreferences):
    """The add-on's page in the preferences."""

    bl_idname = PACKAGE

    out_folder: StringProperty(
        name="Export Folder",
        description="Where exports go unless you choose another place. Empty: beside the file",
        subtype="DIR_PATH",
    )
    threads: IntProperty(
        name="Threads",
        description="Threads to build and trace with, 0 for all of this machine",
        default=0,
        min=0,
        max=4096,
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Two settings, the devices, and the reason where the compiled core is missing."""
        from . import store

        layout = self.layout
        if reason := store.native_reason():
            paragraph(layout.box(), context, reason, icon="ERROR")
        layout.use_property_split = True
        layout.prop(self, "out_folder")
        layout.prop(self, "threads")
        for device in store.devices():
            text = f"{device['name']}: {described(device)}"
            paragraph(layout, context, text, icon="CHECKMARK" if device["available"] else "INFO")


def _preferences() -> BVHLAB_AP_preferences | None:
    addon = bpy.context.preferences.addons.get(PACKAGE)
    return addon.preferences if addon else None


def threads() -> int:
    """Threads to use; 0 means all."""
    chosen = _preferences()
    return chosen.threads if chosen else 0


def out_folder() -> Path:
    """Where exports go by default: the chosen folder, else the file's, else the home folder."""
    chosen = _preferences()
    if chosen and chosen.out_folder:
        return Path(bpy.path.abspath(chosen.out_folder))
    if bpy.data.filepath:
        return Path(bpy.data.filepath).parent
    return Path.home()


def register() -> None:
    """Add the preferences."""
    bpy.utils.register_class(BVHLAB_AP_preferences)


def unregister() -> None:
    """Remove them."""
    bpy.utils.unregister_class(BVHLAB_AP_preferences)
