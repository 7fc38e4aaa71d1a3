# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that is open in Blender as plain arrays."""

from __future__ import annotations

import os
from typing import Literal

import bpy

from ..study.framing import auto_cameras
from ..study.scene import Scene
from .cameras import read_cameras
from .geometry import ExtractError, Geometry, gather
from .lights import read_lights, read_world
from .materials import read_material
from .notes import Notes
from .render_geometry import with_render_depsgraph

__all__ = ["ExtractError", "extract_scene"]
WHITE = (1.0, 1.0, 1.0)


def extract_scene(
    context: bpy.types.Context, geometry: Literal["viewport", "render"] = "viewport"
) -> Scene:
    """Evaluate the context's scene at its frame and read triangles, materials, cameras and lights.

    ``viewport`` follows the eye icons and viewport levels of modifiers, ``render`` the camera icons
    and render levels. Raises ExtractError, one sentence naming the object, where there is nothing
    to trace or a vertex is not finite. Main thread only.
    """
    scene, name = context.scene, _scene_name(context.scene)
    if geometry == "render":
        return with_render_depsgraph(
            scene, context.view_layer, lambda depsgraph: _extract(scene, name, depsgraph, "render")
        )
    if geometry != "viewport":
        raise ExtractError(f"Geometry is 'viewport' or 'render', not '{geometry}'.")
    return _extract(scene, name, context.evaluated_depsgraph_get(), "viewport")


def _extract(
    scene: bpy.types.Scene,
    name: str,
    depsgraph: bpy.types.Depsgraph,
    geometry: Literal["viewport", "render"],
) -> Scene:
    notes = Notes()
    found = gather(depsgraph, geometry == "viewport", notes)
    if len(found.triangles) == 0:
        visible = "renderable" if geometry == "render" else "visible"
        raise ExtractError(
            f"Scene '{scene.name}' has no {visible} surface: add a mesh or show a hidden one."
        )
    _say_geometry(found, geometry, notes)
    cameras = read_cameras(scene, depsgraph, notes)
    if not cameras:
        cameras = auto_cameras(found.vertices)
        notes.fact(f"no camera in the scene: added {len(cameras)} that frame it")
    materials = [read_material(material, notes) for material in found.materials]
    lights = read_lights(depsgraph, notes)
    world = scene.world.evaluated_get(depsgraph) if scene.world else None
    radiance = read_world(world, notes)
    if not lights and not any(max(material.emission) > 0.0 for material in materials):
        radiance = WHITE
        notes.fact("no lamp and no emissive material in the scene: lit by a white world")
    return Scene(
        name=name,
        vertices=found.vertices,
        triangles=found.triangles,
        material_index=found.material_index,
        materials=materials,
        cameras=cameras,
        lights=lights,
        world=radiance,
        geometry=geometry,
        source=bpy.data.filepath,
        frame=scene.frame_current,
        notes=notes.sentences(),
    )


def _say_geometry(found: Geometry, geometry: str, notes: Notes) -> None:
    levels = (
        "camera icons and render levels"
        if geometry == "render"
        else "eye icons and viewport levels"
    )
    notes.fact(
        f"{geometry} geometry ({levels} of modifiers): {found.objects} objects and instances, "
        f"{found.meshes} distinct"
    )
    notes.fact(
        "left out: smooth shading, textures and motion blur; every surface is flat and opaque"
    )


def _scene_name(scene: bpy.types.Scene) -> str:
    """The file's name, with the scene's where it holds several; the scene's alone if not saved."""
    stem = os.path.splitext(os.path.basename(bpy.data.filepath))[0]
    if not stem:
        return scene.name
    return f"{stem} {scene.name}" if len(bpy.data.scenes) > 1 else stem
