# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as the native core takes it."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import numpy as np

from .scene import Camera, Color, Component, Light, Lookup, Material, Scene, Texture, World

MAGENTA = (1.0, 0.0, 1.0)  # what Blender shows where a picture is missing


def core_scene(core: ModuleType, mesh: Any, scene: Scene) -> tuple[Any, list[str]]:
    """The scene as `core.Scene` on a `core.Mesh` of its triangles, and notes.

    A note, one sentence, names each texture that could not be read and became magenta.
    Raises ValueError naming what the core does not accept.
    """
    notes: list[str] = []
    made = core.Scene(
        mesh,
        [_material(core, material) for material in scene.materials],
        scene.material_index,
        lights=[_light(core, light) for light in scene.lights],
        world=_world(core, scene.world),
        textures=[_texture(core, texture, notes) for texture in scene.textures],
        uvs=scene.uvs,
        normals=scene.normals,
    )
    return made, notes


def core_camera(
    core: ModuleType, camera: Camera, window: tuple[float, float, float, float] | None = None
) -> Any:
    """The camera as `core.Camera`, with another ``window`` if one is given."""
    return core.Camera(
        camera.kind,
        camera.to_world,
        window or camera.window,
        clip_start=camera.clip_start,
        lens_radius=camera.lens_radius,
        focus_distance=camera.focus_distance,
    )


def _texture(core: ModuleType, texture: Texture, notes: list[str]) -> Any:
    settings = {"srgb": texture.srgb, "wrap": texture.wrap, "closest": texture.closest}
    if texture.pixels is not None:
        return core.Texture(texture.pixels, **settings)
    try:
        return core.Texture.read(texture.path, **settings)
    except RuntimeError as error:
        notes.append(f"Missing texture '{texture.name}' is magenta: {str(error).rstrip('.')}.")
        return core.Texture(np.array([[MAGENTA]], np.float32))


def _material(core: ModuleType, material: Material) -> Any:
    return core.Material(
        [_component(core, component) for component in material.components],
        _input(core, material.emission),
    )


def _component(core: ModuleType, component: Component) -> Any:
    return core.Component(
        component.model,
        weight=_input(core, component.weight),
        color=_input(core, component.color),
        roughness=_input(core, component.roughness),
        metallic=_input(core, component.metallic),
        transmission=_input(core, component.transmission),
        ior=component.ior,
        specular=component.specular,
    )


def _input(core: ModuleType, value: float | Color | Lookup) -> Any:
    if not isinstance(value, Lookup):
        return value
    return core.Lookup(
        value.texture,
        channel=value.channel,
        scale=value.scale,
        offset=value.offset,
        mapping=value.mapping,
    )


def _world(core: ModuleType, world: World) -> Any:
    return core.World(world.color, world.texture, world.to_texture)


def _light(core: ModuleType, light: Light) -> Any:
    return core.Light(
        light.kind,
        light.to_world,
        light.color,
        size_x=light.size_x,
        size_y=light.size_y,
        shape=light.shape,
        spot_angle=light.spot_angle,
        spot_blend=light.spot_blend,
    )
