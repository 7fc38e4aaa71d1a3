# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that is open in Blender as plain arrays."""

from __future__ import annotations

import os
from typing import Literal

import bpy

from ..study.framing import auto_cameras
from ..study.scene import Scene, World
from .cameras import read_cameras
from .geometry import ExtractError, Geometry, gather
from .lights import read_lights
from .materials import Materials
from .notes import Notes
from .render_geometry import with_render_depsgraph
from .textures import Textures
from .unmodelled import (
    missing_libraries,
    say_finish,
    say_missing,
    say_render,
    say_view_layer,
)
from .world import read_world

__all__ = ["ExtractError", "extract_as_is", "extract_scene"]
WHITE = World((1.0, 1.0, 1.0))


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


def extract_as_is(depsgraph: bpy.types.Depsgraph, geometry: Literal["viewport", "render"]) -> Scene:
    """As `extract_scene`, of the dependency graph that a render engine is given.

    Without cameras, for the engine has its own view; no light is added where the scene has none. In
    the calling thread.
    """
    return _extract(
        depsgraph.scene, _scene_name(depsgraph.scene), depsgraph, geometry, fill_in=False
    )


def _extract(
    scene: bpy.types.Scene,
    name: str,
    depsgraph: bpy.types.Depsgraph,
    geometry: Literal["viewport", "render"],
    fill_in: bool = True,
) -> Scene:
    notes = Notes()
    textures = Textures(notes)
    materials = Materials(textures, notes)
    found = gather(depsgraph, geometry == "viewport", materials, notes)
    if len(found.triangles) == 0:
        raise ExtractError(_why_empty(scene, depsgraph, geometry))
    _say_geometry(found, geometry, notes)
    cameras = read_cameras(scene, depsgraph, found.vertices, notes) if fill_in else []
    if not cameras and fill_in:
        cameras = auto_cameras(found.vertices)
        notes.fact(f"no camera in the scene: added {len(cameras)} that frame it")
    lights = read_lights(depsgraph, textures, notes)
    world = scene.world.evaluated_get(depsgraph) if scene.world else None
    background = read_world(world, textures, notes)
    emits = any(material.emits for material in materials.found)
    if not lights and not emits and max(background.color) == 0.0:
        dark = "no lamp, no emissive material and a black world"
        notes.fact(f"{dark}: " + ("lit by a white one" if fill_in else "the picture is black"))
        background = WHITE if fill_in else background
    extracted = Scene(
        name=name,
        vertices=found.vertices,
        triangles=found.triangles,
        material_index=found.material_index,
        materials=materials.found,
        cameras=cameras,
        lights=lights,
        world=background,
        geometry=geometry,
        textures=textures.found,
        uvs=found.uvs,
        normals=found.normals,
        source=bpy.data.filepath,
        frame=scene.frame_current,
    )
    _say_features(extracted, notes)
    _say_settings(scene, depsgraph, fill_in, notes)
    extracted.notes = notes.sentences()
    return extracted


def _why_empty(scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, geometry: str) -> str:
    visible = "renderable" if geometry == "render" else "visible"
    reason = f"Scene '{scene.name}' has no {visible} surface: add a mesh or show a hidden one"
    if missing := missing_libraries(depsgraph):
        reason += f", or bring back the missing library {missing[0]}"
    return f"{reason}."


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


def _say_features(extracted: Scene, notes: Notes) -> None:
    """What is modelled of what the scene uses."""
    models = {part.model for material in extracted.materials for part in material.components}
    features = {
        "smooth shading": extracted.normals is not None,
        "image textures": extracted.uvs is not None,
        "environment texture": extracted.world.texture is not None,
        "glossy reflection": bool(models & {"principled", "glossy", "glass"}),
        "refraction": bool(models & {"glass", "refraction"})
        or any(
            part.transmission != 0.0
            for material in extracted.materials
            for part in material.components
        ),
        "translucency": "translucent" in models,
        "transparency": "transparent" in models,
        "emissive materials": any(material.emits for material in extracted.materials),
        "lamps": bool(extracted.lights),
        "depth of field": any(camera.lens_radius > 0.0 for camera in extracted.cameras),
    }
    used = [name for name, is_used in features.items() if is_used]
    notes.fact("modelled: " + (", ".join(used) if used else "diffuse surfaces alone"))
    if "principled" in models and bpy.app.version < (4, 0, 0):
        notes.fact("approximated: the Principled BSDF of this Blender as that of Blender 4.0")


def _say_settings(
    scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph, compared: bool, notes: Notes
) -> None:
    """What settings ask for in vain; ``compared``: Blender does nothing more to our pictures."""
    say_missing(depsgraph, notes)
    say_view_layer(depsgraph.view_layer, notes)
    say_render(scene, notes)
    if compared:
        say_finish(scene, notes)


def _scene_name(scene: bpy.types.Scene) -> str:
    """The file's name, with the scene's where it holds several; the scene's alone if not saved."""
    stem = os.path.splitext(os.path.basename(bpy.data.filepath))[0]
    if not stem:
        return scene.name
    return f"{stem} {scene.name}" if len(bpy.data.scenes) > 1 else stem
