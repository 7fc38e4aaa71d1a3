# SPDX-License-Identifier: GPL-3.0-or-later
"""A .blend opened so that two renderers see the same: size, camera, diffuse materials if asked."""

from __future__ import annotations

from pathlib import Path

import bpy


def open_for_render(path: Path, width: int, height: int, camera: str, diffuse: bool) -> None:
    """Open the file in the bpy module. ``camera`` "" is the scene's own.

    Raises ValueError naming a camera that is not there.
    """
    bpy.ops.wm.open_mainfile(filepath=str(path), load_ui=False, use_scripts=False)
    scene = bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, height, 100
    render.pixel_aspect_x = render.pixel_aspect_y = 1.0
    render.use_border = render.use_simplify = render.use_motion_blur = False
    if camera:
        cameras = {obj.name: obj for obj in scene.objects if obj.type == "CAMERA"}
        if camera not in cameras:
            raise ValueError(f"{path} has no camera {camera!r}; it has {', '.join(cameras)}")
        scene.camera = cameras[camera]
    if diffuse:
        for material in bpy.data.materials:
            make_diffuse(material)


def make_diffuse(material: bpy.types.Material) -> None:
    """Put a Diffuse BSDF of its base colour, with its emission, in place of a Principled BSDF."""
    tree = material.node_tree
    principled = [n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled"]
    output = tree.get_output_node("ALL")
    if not principled or output is None:
        return
    old = principled[0]
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    _take(tree, old.inputs["Base Color"], shader.inputs["Color"])
    result = shader.outputs[0]
    color, strength = old.inputs["Emission Color"], old.inputs["Emission Strength"]
    if color.is_linked or (max(color.default_value[:3]) > 0.0 and strength.default_value > 0.0):
        emission, add = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeAddShader")
        _take(tree, color, emission.inputs["Color"])
        _take(tree, strength, emission.inputs["Strength"])
        tree.links.new(result, add.inputs[0])
        tree.links.new(emission.outputs[0], add.inputs[1])
        result = add.outputs[0]
    tree.links.new(result, output.inputs["Surface"])


def _take(tree: bpy.types.NodeTree, old: bpy.types.NodeSocket, new: bpy.types.NodeSocket) -> None:
    """The new socket gets what the old one has: a link, or its number."""
    if old.is_linked:
        tree.links.new(old.links[0].from_socket, new)
    else:
        new.default_value = old.default_value
