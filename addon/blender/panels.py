# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel in Properties > Render: what to compare, one button, and the table under it."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import bpy

from ..study.precision import BOX_TESTS, LAYOUTS, TRIANGLE_TESTS
from ..study.results import Row
from ..study.table import failures
from . import store, summary
from .text import paragraph

HEADINGS = {
    "NAME": "BVH",
    "BUILD": "Build",
    "COST": "Cost",
    "SPEED": "MRays/s",
    "RATIO": "Ratio",
    "WRONG": "Wrong",
}
# The columns with their shares of the width: all, or those for which a narrow panel has room.
WIDE = {"NAME": 0.34, "BUILD": 0.14, "COST": 0.13, "SPEED": 0.17, "RATIO": 0.11, "WRONG": 0.11}
NARROW = {"NAME": 0.40, "BUILD": 0.22, "SPEED": 0.22, "WRONG": 0.16}
NARROW_PIXELS = 400  # width of the region, at interface scale 1, below which a panel is narrow


class RenderPanel:
    """Where our panels stand: under Render, whatever the engine."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"


class BVHLAB_PT_compare(RenderPanel, bpy.types.Panel):
    bl_label = "BVH Lab"
    bl_order = 2  # below the settings of the engine, ours or another

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.bvh_lab
        if reason := store.native_reason():
            paragraph(layout.box(), context, reason, icon="ERROR")
            return
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        column.enabled = store.running is None
        _draw_switches(column, "Builders", settings, [f"use_{b['id']}" for b in store.builders()])
        _draw_switches(column, "Branching", settings, ["use_2", "use_4", "use_8"])
        column.row().prop(settings, "geometry", expand=True)
        layout.separator(factor=0.5)
        _draw_start(layout, context)


def _draw_switches(
    layout: bpy.types.UILayout,
    label: str,
    settings: bpy.types.PropertyGroup,
    names: Sequence[str],
    columns: int = 3,
) -> None:
    """Switches behind a label, so many to a row, which a click toggles one by one."""
    split = layout.split(factor=0.4)
    split.use_property_split = False
    heading = split.row()
    heading.alignment = "RIGHT"
    heading.label(text=label)
    grid = split.grid_flow(row_major=True, columns=columns, even_columns=True, align=True)
    for name in names:
        if hasattr(settings, name):
            grid.prop(settings, name, toggle=True)


def _draw_start(layout: bpy.types.UILayout, context: bpy.types.Context) -> None:
    """The button, or the progress of what it started."""
    running = store.running
    if running is None:
        row = layout.row()
        row.scale_y = 1.6
        count = context.scene.bvh_lab.variants()
        text = f"Compare {count} BVHs" if count > 1 else "Compare"
        row.operator("bvhlab.compare", text=text, icon="PLAY")
        return
    row = layout.row(align=True)
    row.use_property_split = False
    row.scale_y = 1.6
    fraction = running.job.fraction
    text = f"{summary.seconds(running.job.seconds_left)} left" if fraction > 0.02 else "Starting"
    if hasattr(row, "progress"):  # Blender 4.0
        row.progress(factor=fraction, text=f"{fraction:.0%}, {text}")
    else:
        row.prop(context.window_manager.bvh_lab, "progress", text=text, slider=True)
    row.operator("bvhlab.stop", text="", icon="X")
    stage = running.job.stage
    if not store.is_running(context.scene):
        stage = f"in another scene: {stage}"
    paragraph(layout, context, stage[:1].upper() + stage[1:])


def devices_left_out(chosen: str) -> list[str]:
    """Why devices are not in the list, a sentence each; ``chosen`` is empty for a lost one."""
    left_out = [device for device in store.devices() if not device["available"]]
    sentences = [f"{device['name']}: {device['reason']}" for device in left_out]
    if not chosen:
        sentences.insert(0, "The device that this file had is not here: the CPU is used")
    return sentences


class BVHLAB_PT_settings(RenderPanel, bpy.types.Panel):
    bl_label = "Settings"
    bl_parent_id = "BVHLAB_PT_compare"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return not store.native_reason()

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.bvh_lab
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.enabled = store.running is None
        column = layout.column()
        column.prop(settings, "device")
        for sentence in devices_left_out(settings.device):
            paragraph(column, context, sentence, icon="INFO")
        column.prop(settings, "use_reordering")
        if settings.use_reordering:
            column.prop(settings, "reorder_key")
        column = layout.column()
        column.row().prop(settings, "preset", expand=True)
        if settings.preset == "quick":
            sizes = column.column(align=True)
            sizes.prop(settings, "resolution")
            sizes.prop(settings, "samples")
            sizes.prop(settings, "depth")
            sizes.prop(settings, "views")
            if settings.use_prbvh_a or settings.use_prbvh_sa:
                sizes.prop(settings, "annealing")
        checks = layout.column(align=True)
        if settings.preset == "quick":
            checks.prop(settings, "ray_resolution")
        checks.prop(settings, "repeats")
        checks.prop(settings, "judged_rays")
        column = layout.column(heading="Also")
        column.prop(settings, "pictures")
        column.prop(settings, "embree")
        target = layout.column()
        target.enabled = settings.pictures
        target.prop(settings, "target_error")


class BVHLAB_PT_advanced(RenderPanel, bpy.types.Panel):
    bl_label = "Advanced"
    bl_parent_id = "BVHLAB_PT_settings"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.bvh_lab
        layout.enabled = store.running is None
        if settings.preset == "paper":
            sentence = "Preset Paper has full nodes only, and the exact tests"
            paragraph(layout, context, sentence, icon="INFO")
            return
        for label, group, names in (
            ("Nodes", "layout", LAYOUTS),
            ("Triangle Test", "triangle", TRIANGLE_TESTS),
            ("Box Test", "box", BOX_TESTS),
        ):
            _draw_switches(layout, label, settings, [f"{group}_{name}" for name in names], 2)
        if not settings.plan().all_exact():
            sentence = "Other tests are there to be compared: they may be wrong, and render nothing"
            paragraph(layout, context, sentence, icon="INFO")


class BVHLAB_UL_variants(bpy.types.UIList):
    """The table: numbers from the store, sorted by the column that was clicked."""

    def draw_item(
        self,
        context: bpy.types.Context,
        layout: bpy.types.UILayout,
        data: Any,
        item: bpy.types.PropertyGroup,
        icon: int,
        active_data: Any,
        active_property: str,
    ) -> None:
        rows = store.rows_of(context.scene)
        row = next((row for row in rows if row.name == item.name), None)
        if row is None:
            return
        best = summary.fastest(rows, data.kind)
        texts = summary.cells(row, data.kind, summary.baseline(rows, data.baseline))
        layout.alert = summary.has_errors(row) or row.disagrees()
        for column, cell in _cells(layout, _columns(context)):
            if column == "NAME":
                icon = "ERROR" if layout.alert else "SOLO_ON" if row is best else "BLANK1"
                cell.label(text=texts[column], icon=icon)
            else:
                cell.alignment = "RIGHT"
                cell.label(text=texts[column])

    def draw_filter(self, context: bpy.types.Context, layout: bpy.types.UILayout) -> None:
        """The column headings sort; there is nothing to search for."""

    def filter_items(
        self, context: bpy.types.Context, data: Any, propname: str
    ) -> tuple[list[int], list[int]]:
        items = getattr(data, propname)
        here = store.scene_key(context.scene)
        rows = {row.name: row for row in store.rows_of(context.scene)}
        flags = [
            self.bitflag_filter_item if item.scene == here and item.name in rows else 0
            for item in items
        ]
        order = sorted(
            (index for index, flag in enumerate(flags) if flag),
            key=lambda index: _sort_key(rows[items[index].name], data),
        )
        order += [index for index, flag in enumerate(flags) if not flag]
        places = [0] * len(items)
        for place, index in enumerate(order):
            places[index] = place
        return flags, places


def _sort_key(row: Row, panel: bpy.types.PropertyGroup) -> tuple[Any, ...]:
    """Rows without a value come last, whichever way the table is sorted."""
    missing, value = summary.sort_value(row, panel.sort_column, panel.kind)
    if panel.sort_reverse:
        value = -value if not isinstance(value, str) else tuple(-ord(letter) for letter in value)
    return (missing, value)


def _columns(context: bpy.types.Context) -> dict[str, float]:
    """The columns that fit into the region, with their shares of its width."""
    narrow = context.region.width < NARROW_PIXELS * context.preferences.system.ui_scale
    return NARROW if narrow else WIDE


def _cells(
    layout: bpy.types.UILayout, columns: dict[str, float]
) -> Iterator[tuple[str, bpy.types.UILayout]]:
    """A row of sub-layouts, one for each column."""
    left = 1.0
    for column, share in columns.items():
        if share < left - 1e-6:
            layout = layout.split(factor=share / left, align=True)
        yield column, layout.row(align=True)
        left -= share


class BVHLAB_PT_results(RenderPanel, bpy.types.Panel):
    bl_label = "Results"
    bl_parent_id = "BVHLAB_PT_compare"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(store.rows_of(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, panel = self.layout, context.window_manager.bvh_lab
        rows, study = store.rows_of(context.scene), store.study_of(context.scene)
        finished = study is not None and not store.is_running(context.scene)
        layout.row().prop(panel, "kind", expand=True)
        said = summary.winner(rows, panel.kind)
        if said:
            box = layout.box()
            for number, sentence in enumerate(said):
                paragraph(box, context, sentence, icon="BLANK1" if number else "SOLO_ON")
            if finished and (same := summary.pictures(study.result)):
                paragraph(box, context, same, icon="BLANK1")
        if finished:
            for failure in failures(study.result):
                paragraph(layout.box(), context, failure, icon="ERROR")
            if study.result.cancelled:
                paragraph(
                    layout, context, "Stopped early: these are the rows until then", icon="INFO"
                )
        table = layout.column(align=True)
        _draw_headings(table, panel, _columns(context))
        table.template_list(
            "BVHLAB_UL_variants",
            "",
            panel,
            "rows",
            panel,
            "active",
            rows=min(max(len(rows), 3), 12),
        )
        row = layout.row(align=True)
        row.operator("bvhlab.set_baseline", icon="PINNED")
        row.operator_menu_enum("bvhlab.export", "format", text="Export", icon="EXPORT")
        if finished and study.pictures:
            row = layout.row(align=True)
            for view in dict.fromkeys(view for _, view in study.pictures):
                row.operator("bvhlab.show_picture", text=view, icon="IMAGE_DATA").view = view


def _draw_headings(
    layout: bpy.types.UILayout, panel: bpy.types.PropertyGroup, columns: dict[str, float]
) -> None:
    row = layout.box().row()
    arrow = "TRIA_DOWN" if panel.sort_reverse else "TRIA_UP"
    for column, cell in _cells(row, columns):
        cell.alignment = "LEFT" if column == "NAME" else "RIGHT"
        sorted_by = panel.sort_column == column and columns is WIDE  # else no room for an arrow
        icon = arrow if sorted_by else "NONE"
        heading = HEADINGS[column]
        cell.operator("bvhlab.sort", text=heading, icon=icon, emboss=False).column = column


class BVHLAB_PT_details(RenderPanel, bpy.types.Panel):
    bl_label = "Details"
    bl_parent_id = "BVHLAB_PT_results"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(store.rows_of(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        name = context.window_manager.bvh_lab.active_name(store.scene_key(context.scene))
        row = next((row for row in store.rows_of(context.scene) if row.name == name), None)
        if row is None:
            self.layout.label(text="Select a row of the table", icon="INFO")
            return
        column = self.layout.column(align=True)
        column.label(text=summary.title(row))
        for label, value in summary.details(row):
            split = column.split(factor=0.3)
            split.label(text=label)
            split.label(text=value)


class BVHLAB_PT_notes(RenderPanel, bpy.types.Panel):
    bl_label = "What Was Measured"
    bl_parent_id = "BVHLAB_PT_results"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return store.study_of(context.scene) is not None and not store.is_running(context.scene)

    def draw(self, context: bpy.types.Context) -> None:
        result = store.study_of(context.scene).result
        subject, machine = result.subject, result.machine
        column = self.layout.column()
        for sentence in (
            f"{subject.triangles:,d} triangles of scene {subject.name}, frame {subject.frame}",
            f"{machine.cpu}, {machine.host}, BVH Lab {machine.version}",
            *result.notes,
        ):
            paragraph(column, context, sentence, icon="DOT")


CLASSES = (
    BVHLAB_UL_variants,
    BVHLAB_PT_compare,
    BVHLAB_PT_settings,
    BVHLAB_PT_advanced,
    BVHLAB_PT_results,
    BVHLAB_PT_details,
    BVHLAB_PT_notes,
)
register, unregister = bpy.utils.register_classes_factory(CLASSES)
