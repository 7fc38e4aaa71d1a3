# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings of objects, view layers, worlds and renders that change a picture, but none of ours.

Shader nodes, lamps and cameras are looked at where they are read.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator

import bpy

from .notes import Notes

Check = tuple[str, Callable[[bpy.types.ID], bool]]
RAYS = ("visible_camera", "visible_diffuse", "visible_glossy", "visible_transmission")
WORLD_RAYS = ("camera", "diffuse", "glossy", "transmission", "scatter")
# Offsets that keep Cycles' shadows off the edges of coarse smooth meshes, with their defaults.
TERMINATOR = {
    "shadow_terminator_offset": 0.0,
    "shadow_terminator_normal_offset": 0.0,
    "shadow_terminator_shading_offset": 0.0,
    "shadow_terminator_geometry_offset": 0.1,
}
PASSES = {"use_pass_combined", "use_pass_z", "use_pass_normal", "use_pass_cryptomatte_accurate"}


def say_object(obj: bpy.types.Object, notes: Notes) -> None:
    """Of a mesh that is traced."""
    for sentence, is_true in OBJECT:
        if is_true(obj):
            notes.add(sentence, obj.name)


def say_world(world: bpy.types.World, notes: Notes) -> None:
    """Of the world that shines."""
    visibility = getattr(world, "cycles_visibility", None)
    if not all(getattr(visibility, name, True) for name in WORLD_RAYS):
        notes.add("approximated: ray visibility is ignored, every ray sees these", world.name)


def say_view_layer(layer: bpy.types.ViewLayer, notes: Notes) -> None:
    """Of the view layer, whichever way its picture is made."""
    if layer.material_override is not None:
        notes.add("left out: material override of the view layer", layer.name)
    if getattr(layer, "world_override", None) is not None:  # Blender 5.0
        notes.add("left out: world override of the view layer", layer.name)
    for child in _layer_collections(layer.layer_collection):
        if child.holdout:
            notes.add("left out: holdout", f"collection {child.name}")
        if child.indirect_only:
            notes.add("approximated: indirect only is ignored, every ray sees these", child.name)


def say_render(scene: bpy.types.Scene, notes: Notes) -> None:
    """Of the scene's render settings, whichever way its picture is made."""
    render = scene.render
    if render.use_motion_blur:
        notes.fact("left out: motion blur")
    if render.film_transparent:
        notes.fact("left out: transparent film, alpha is 1 everywhere")
    if render.use_freestyle:
        notes.fact("left out: Freestyle lines")
    if render.engine == "CYCLES" and scene.cycles.film_exposure != 1.0:
        notes.fact("left out: film exposure of Cycles")


def say_finish(scene: bpy.types.Scene, notes: Notes) -> None:
    """Of what Blender does to a render engine's picture, but nobody to those of a comparison."""
    view, render = scene.view_settings, scene.render
    changes = [view.view_transform] if view.view_transform not in {"Standard", "Raw"} else []
    changes += [f"look {view.look}"] if view.look != "None" else []
    neutral = (view.exposure, view.gamma) == (0.0, 1.0)
    if view.use_curve_mapping or getattr(view, "use_white_balance", False) or not neutral:
        changes.append("exposure, gamma, curves or white balance")
    if changes:
        notes.fact(f"left out: colour management ({', '.join(changes)}), colours are plain sRGB")
    if render.use_border:
        notes.fact("left out: the render border, pictures are whole")
    nodes = getattr(scene, "compositing_node_group", None)
    if nodes is None and bpy.app.version < (5, 0, 0) and scene.use_nodes:
        nodes = scene.node_tree
    if render.use_compositing and nodes is not None:
        notes.fact("left out: compositing")
    if render.use_sequencer and _has_strips(scene):
        notes.fact("left out: the video sequencer")


def _has_strips(scene: bpy.types.Scene) -> bool:
    editor = scene.sequence_editor
    if editor is None:
        return False
    return len(getattr(editor, "strips_all", ()) or getattr(editor, "sequences_all", ())) > 0


def say_passes(scene: bpy.types.Scene, layer: bpy.types.ViewLayer, notes: Notes) -> None:
    """Of what a final render is asked for beside its picture."""
    for settings in (layer, getattr(layer, "cycles", None)):
        for name, prop in settings.bl_rna.properties.items() if settings else ():
            if name.startswith("use_pass_") and name not in PASSES and getattr(settings, name):
                notes.add("left out: render passes", prop.name)
    for each in layer.aovs:
        notes.add("left out: render passes", f"AOV {each.name}")
    for each in layer.lightgroups:
        notes.add("left out: light groups", each.name)
    if scene.render.use_multiview:
        notes.fact("left out: stereoscopy, every view shows the same picture")


def say_missing(depsgraph: bpy.types.Depsgraph, notes: Notes) -> None:
    """Of data that is linked from where it cannot be found: Blender puts empty blocks in place."""
    for path in missing_libraries(depsgraph):
        notes.add("missing library, what is linked from it is left out", path)
    for block in depsgraph.ids:
        is_missing = getattr(block.original, "is_missing", False)  # Blender 4.0
        if is_missing and not _is_lost(block.original.library):
            notes.add("missing in its library and left out", block.name)


def missing_libraries(depsgraph: bpy.types.Depsgraph) -> list[str]:
    """Paths of the libraries that the scene links to and that are not there."""
    libraries = {block.original.library: None for block in depsgraph.ids}
    return [library.filepath for library in libraries if library and _is_lost(library)]


def _is_lost(library: bpy.types.Library) -> bool:
    """Whether its file was not found. Blender 3.4 does not tell: there it is looked for anew."""
    if hasattr(library, "is_missing"):
        return bool(library.is_missing)
    path = bpy.path.abspath(library.filepath)
    return library.packed_file is None and not os.path.isfile(path)


def _layer_collections(
    parent: bpy.types.LayerCollection,
) -> Iterator[bpy.types.LayerCollection]:
    """All below, without those that are excluded."""
    for child in parent.children:
        if not child.exclude:
            yield child
            yield from _layer_collections(child)


def _has_path_hair(obj: bpy.types.Object) -> bool:
    settings = [system.settings for system in obj.particle_systems]
    return any(each.type == "HAIR" and each.render_type == "PATH" for each in settings)


def _has_light_linking(obj: bpy.types.Object) -> bool:
    linking = getattr(obj, "light_linking", None)  # Blender 4.0
    return bool(linking and (linking.receiver_collection or linking.blocker_collection))


def _has_terminator(obj: bpy.types.Object) -> bool:
    for name, default in TERMINATOR.items():
        own = getattr(obj, name, None)
        cycles = getattr(getattr(obj, "cycles", None), name, default)
        if abs((cycles if own is None else own) - default) > 1e-6:
            return True
    return False


def _is_diced(obj: bpy.types.Object) -> bool:
    """Whether Cycles subdivides it by its size in the picture."""
    if getattr(getattr(obj, "cycles", None), "use_adaptive_subdivision", False):
        return True
    modifiers = [modifier for modifier in obj.modifiers if modifier.type == "SUBSURF"]
    return any(getattr(each, "use_adaptive_subdivision", False) for each in modifiers)


OBJECT: tuple[Check, ...] = (
    ("left out: particle hair", _has_path_hair),
    ("left out: holdout", lambda obj: obj.is_holdout),
    ("left out: shadow catcher", lambda obj: obj.is_shadow_catcher),
    (
        "approximated: ray visibility is ignored, every ray sees these",
        lambda obj: not (all(getattr(obj, name) for name in RAYS) and obj.visible_shadow),
    ),
    ("approximated: light linking is ignored, these light everything", _has_light_linking),
    ("approximated: shadow terminator offsets are ignored", _has_terminator),
    ("approximated: adaptive subdivision by that of the modifier", _is_diced),
)
