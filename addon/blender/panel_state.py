# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel's state, ``WindowManager.bvh_lab``."""

from __future__ import annotations

import bpy
from bpy.props import (
    BoolProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from . import store

COLUMNS = ("NAME", "BUILD", "COST", "SPEED", "RATIO", "WRONG")


def _percent(panel: BVHLAB_PG_panel) -> float:
    return 100.0 * store.running.job.fraction if store.running else 0.0


def _ignore(panel: BVHLAB_PG_panel, value: float) -> None:
    """The bar shows; it does not set."""


class BVHLAB_PG_row(bpy.types.PropertyGroup):
    """A row of the table, by scene and variant; its numbers are in the store."""

    scene: StringProperty()


class BVHLAB_PG_panel(bpy.types.PropertyGroup):
    """How the table is shown. Never saved, never undone."""

    rows: CollectionProperty(type=BVHLAB_PG_row)
    active: IntProperty(name="Variant", description="The variant of which the details are shown")
    sort_column: EnumProperty(
        items=[(name, name.title(), "", i) for i, name in enumerate(COLUMNS)], default="SPEED"
    )
    sort_reverse: BoolProperty(default=True)
    baseline: StringProperty()
    kind: EnumProperty(
        name="Rays",
        description="Which rays the table's speeds are of",
        items=[
            ("primary", "Primary", "Closest hit of one ray through each pixel", 0),
            ("secondary", "Secondary", "Closest hit of the rays that surfaces send on", 1),
            ("shadow", "Shadow", "Any hit towards lights, from all that was hit", 2),
        ],
    )
    progress: FloatProperty(
        name="Progress",
        description="Finished part of the comparison",
        subtype="PERCENTAGE",
        precision=0,
        min=0.0,
        max=100.0,
        get=_percent,
        set=_ignore,  # without one Blender greys the bar out
    )

    def show(self, scene: str, names: list[str]) -> None:
        """Make the table's rows of one scene those named."""
        old = [index for index, row in enumerate(self.rows) if row.scene == scene]
        if [self.rows[index].name for index in old] == names:
            return
        for index in reversed(old):
            self.rows.remove(index)
        for name in names:
            row = self.rows.add()
            row.name, row.scene = name, scene

    def active_name(self, scene: str) -> str:
        """Variant that is selected, if it is one of this scene's."""
        if 0 <= self.active < len(self.rows) and self.rows[self.active].scene == scene:
            return str(self.rows[self.active].name)
        return ""

    def select(self, scene: str, name: str) -> None:
        """Select a variant of a scene."""
        for index, row in enumerate(self.rows):
            if (row.scene, row.name) == (scene, name):
                self.active = index


CLASSES = (BVHLAB_PG_row, BVHLAB_PG_panel)


def register() -> None:
    """Put the panel's state on the window manager."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.WindowManager.bvh_lab = PointerProperty(type=BVHLAB_PG_panel, options={"SKIP_SAVE"})


def unregister() -> None:
    """Take it away."""
    del bpy.types.WindowManager.bvh_lab
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
