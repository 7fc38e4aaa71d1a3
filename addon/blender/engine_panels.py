# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine's panels, and which of Blender's own are shown beside them."""

from __future__ import annotations

import bpy

from . import engine_final, engine_scene, store
from .engine import ENGINE
from .text import paragraph

# Of the panels that Blender offers to any engine, those of settings that ours does not follow, or
# of which it takes the richer one below.
NOT_OURS = {
    "DATA_PT_area",
    "DATA_PT_camera_stereoscopy",
    "DATA_PT_falloff_curve",
    "DATA_PT_light",
    "RENDER_PT_freestyle",
    "RENDER_PT_gpencil",
    "RENDER_PT_stereoscopy",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
}
# Panels made for other engines that show nothing but what ours follows too.
OURS_TOO = {
    "DATA_PT_EEVEE_light",
    "DATA_PT_camera_dof",
    "DATA_PT_camera_dof_aperture",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
    "MATERIAL_PT_preview",
}


class EnginePanel:
    """Where our panels stand, shown only while the engine is chosen."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.engine in cls.COMPAT_ENGINES


class BVHLAB_PT_sampling(EnginePanel, bpy.types.Panel):
    bl_label = "Sampling"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.bvh_lab_render
        if reason := store.native_reason():
            paragraph(layout.box(), context, reason, icon="ERROR")
            return
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        column.prop(settings, "samples", text="Render Samples")
        column.prop(settings, "viewport_samples", text="Viewport")
        column = layout.column(align=True)
        column.prop(settings, "depth")
        column.prop(settings, "shadow_rays")
        layout.prop(settings, "seed")


class BVHLAB_PT_hierarchy(EnginePanel, bpy.types.Panel):
    bl_label = "Bounding Volume Hierarchy"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.bvh_lab_render
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(align=True)
        column.prop(settings, "builder", text="Render")
        column.prop(settings, "viewport_builder", text="Viewport")
        layout.row().prop(settings, "branching", expand=True)
        layout.prop(settings, "reorder")


class BVHLAB_PT_render_notes(EnginePanel, bpy.types.Panel):
    bl_label = "Approximations"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return super().poll(context) and bool(_losses(context))

    def draw_header_preset(self, context: bpy.types.Context) -> None:
        self.layout.label(text=str(len(_losses(context))))

    def draw(self, context: bpy.types.Context) -> None:
        for note in _losses(context):
            paragraph(self.layout, context, note, icon="DOT")


def _losses(context: bpy.types.Context) -> list[str]:
    """Of the scene's last render."""
    notes = engine_final.notes_of.get(store.scene_key(context.scene), [])
    return engine_scene.losses(notes)


class BVHLAB_PT_passes(EnginePanel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def draw(self, context: bpy.types.Context) -> None:
        layout, layer = self.layout, context.view_layer
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Data")
        column.prop(layer, "use_pass_z", text="Depth")
        column.prop(layer, "use_pass_normal")
        column.prop(layer.bvh_lab, "use_pass_albedo")
        column = layout.column(heading="Traversal")
        column.prop(layer.bvh_lab, "use_pass_traversal_steps", text="Steps")
        column.prop(layer.bvh_lab, "use_pass_triangle_tests")


CLASSES = (
    BVHLAB_PT_sampling,
    BVHLAB_PT_hierarchy,
    BVHLAB_PT_render_notes,
    BVHLAB_PT_passes,
)


def stock_panels() -> list[type[bpy.types.Panel]]:
    """Blender's own panels that hold with our engine."""
    return [panel for panel in bpy.types.Panel.__subclasses__() if _holds(panel)]


def _holds(panel: type[bpy.types.Panel]) -> bool:
    name = panel.__name__.removeprefix("NODE_")  # the same panel in a node editor shares its set
    if name in OURS_TOO:
        return True
    for_any_engine = "BLENDER_RENDER" in getattr(panel, "COMPAT_ENGINES", ())
    return for_any_engine and name not in NOT_OURS and "freestyle" not in name


def register() -> None:
    """Add our panels and show Blender's."""
    for cls in CLASSES:
        bpy.utils.register_class(cls)
    for panel in stock_panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister() -> None:
    """Remove ours, and ourselves from Blender's."""
    for panel in bpy.types.Panel.__subclasses__():
        if panel not in CLASSES:
            getattr(panel, "COMPAT_ENGINES", set()).discard(ENGINE)
    for cls in reversed(CLASSES):
        bpy.utils.unregister_class(cls)
