# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender images as textures: a file's path where there is one, else the pixels."""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Literal, TypeAlias

import bpy
import numpy as np
import numpy.typing as npt

from ..study.scene import Float32Array, Texture, WrapName
from .notes import Notes

# Written by all; what else Blender reads it hands over as pixels.
FILE_FORMATS = {"PNG", "JPEG", "TIFF", "OPEN_EXR", "OPEN_EXR_MULTILAYER", "HDR", "TARGA", "BMP"}
LINEAR = {"", "Linear", "Linear Rec.709", "Linear BT.709", "Non-Color", "Raw", "scene_linear"}
WRAPS: dict[str, WrapName] = {
    "REPEAT": "repeat",
    "EXTEND": "extend",
    "CLIP": "clip",
    "MIRROR": "mirror",
}
ALPHA_DEPTHS = {16, 32, 64, 128}  # bits of a pixel with alpha
# Of a picture that is not opaque: all; its colour times alpha; its colour or its alpha alone.
Part: TypeAlias = Literal["whole", "associated", "color", "alpha"]
MAGENTA = np.array([[[1.0, 0.0, 1.0]]], np.float32)  # Blender's for a missing picture


@dataclass(frozen=True)
class Request:
    """How a node looks an image up. ``alpha``: the look-up is of alpha, ``alpha_used``: that of
    another node may be; of a picture without alpha neither matters.
    """

    image: bpy.types.Image
    wrap: WrapName
    closest: bool
    cubic: bool
    alpha_used: bool
    alpha: bool

    def key(self) -> tuple[object, ...]:
        """Equal for what is looked up in the same way."""
        how = (self.wrap, self.closest, self.cubic, self.alpha_used, self.alpha)
        return (self.image.as_pointer(), *how)


class Textures:
    """The textures of a scene; the same image looked up in the same way is one of them.

    A node asks for one when it is read, which costs nothing. The picture is read once it turns out
    that a material or the world looks it up.
    """

    def __init__(self, notes: Notes) -> None:
        self.found: list[Texture] = []
        self._notes = notes
        self._requests: list[Request] = []
        self._known: dict[tuple[object, ...], int] = {}
        self._numbers: dict[tuple[int, WrapName, bool, Part], int] = {}
        self._translucent: dict[int, bool] = {}

    def request(
        self,
        image: bpy.types.Image,
        extension: str = "REPEAT",
        interpolation: str = "Linear",
        alpha_used: bool = False,
        alpha: bool = False,
    ) -> int:
        """Ask for the texture of an Image or Environment Texture node: a number for `index`.

        ``alpha`` is of a look-up of alpha, ``alpha_used`` of a node of which both may be looked up:
        otherwise the colour is multiplied by alpha, as in Cycles.
        """
        image = image.original or image
        if image.depth not in ALPHA_DEPTHS:
            alpha_used = alpha = False
        closest, cubic = interpolation == "Closest", interpolation == "Cubic"
        asked = Request(image, WRAPS[extension], closest, cubic, alpha_used, alpha)
        number = self._known.setdefault(asked.key(), len(self._requests))
        if number == len(self._requests):
            self._requests.append(asked)
        return number

    def index(self, request: int) -> int:
        """Number in ``found`` of the texture of a request; the picture is read with its first."""
        asked = self._requests[request]
        image = asked.image
        if asked.cubic:
            self._notes.add("approximated: cubic interpolation of a texture by linear", image.name)
        part: Part = "whole"
        # What lies outside of a clipped picture is transparent too.
        clipped = asked.wrap == "clip" and image.depth in ALPHA_DEPTHS
        if clipped or self._is_translucent(image):
            if image.alpha_mode in {"STRAIGHT", "PREMUL"}:
                part = "whole" if asked.alpha_used else "associated"
            else:  # alpha has nothing to do with the colour
                part = "alpha" if asked.alpha else "color"
        key = (image.as_pointer(), asked.wrap, asked.closest, part)
        if key not in self._numbers:
            self._numbers[key] = len(self.found)
            self.found.append(self._read(image, asked.wrap, asked.closest, part))
        return self._numbers[key]

    def _is_translucent(self, image: bpy.types.Image) -> bool:
        """Whether any texel is not opaque."""
        if image.depth not in ALPHA_DEPTHS:
            return False
        key = image.as_pointer()
        if key not in self._translucent:
            pixels = read_pixels(image)
            opaque = pixels is None or pixels.shape[2] != 4 or _alpha(pixels).min() >= 1.0
            self._translucent[key] = not opaque
        return self._translucent[key]

    def _read(self, image: bpy.types.Image, wrap: WrapName, closest: bool, part: Part) -> Texture:
        if image.source in {"MOVIE", "SEQUENCE"}:
            self._notes.add("approximated: first frame of a moving texture", image.name)
        if image.source == "TILED" and len(image.tiles) > 1:
            self._notes.add("approximated: first tile of a tiled texture", image.name)
        srgb = self._is_srgb(image)
        path = _path(image)
        if path and part == "whole":
            return Texture(image.name, path=path, srgb=srgb, wrap=wrap, closest=closest)
        pixels = read_pixels(image)
        if pixels is None:
            self._notes.add("missing texture is magenta", image.name)
            return Texture(image.name, pixels=MAGENTA, wrap=wrap, closest=closest)
        # Blender keeps floating point pixels in linear colours.
        srgb = srgb and pixels.dtype == np.uint8
        pixels = _part(pixels, part)
        return Texture(image.name, pixels=pixels, srgb=srgb, wrap=wrap, closest=closest)

    def _is_srgb(self, image: bpy.types.Image) -> bool:
        space = image.colorspace_settings.name
        if space == "sRGB" or space in LINEAR:
            return space == "sRGB"
        meant = "linear" if image.is_float else "sRGB"
        self._notes.add(f"approximated: colour space {space} read as {meant}", image.name)
        return not image.is_float


def _path(image: bpy.types.Image) -> str:
    """The absolute path of the file that holds the image; "" where only Blender has its pixels."""
    if image.source not in {"FILE", "SEQUENCE", "TILED"} or not image.filepath:
        return ""
    if image.packed_file or image.is_dirty or image.file_format not in FILE_FORMATS:
        return ""
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "TILED":
        path = path.replace("<UDIM>", str(image.tiles[0].number))
    return os.path.normpath(path)


def _alpha(pixels: npt.NDArray[np.uint8] | Float32Array) -> Float32Array:
    """(H, W, 1) from 0 to 1."""
    return pixels[:, :, 3:] / np.float32(255.0 if pixels.dtype == np.uint8 else 1.0)


def _part(
    pixels: npt.NDArray[np.uint8] | Float32Array, part: Part
) -> npt.NDArray[np.uint8] | Float32Array:
    """All channels, or of a picture that is not opaque what ``part`` says."""
    if part == "whole":
        return pixels
    if part == "alpha":
        return np.repeat(pixels[:, :, 3:], 4, axis=2)
    colors = pixels[:, :, :3]
    if part == "associated":  # multiplied as encoded
        colors = colors * _alpha(pixels)
    if pixels.dtype == np.uint8:
        colors = np.rint(colors)
    return np.ascontiguousarray(colors.astype(pixels.dtype))


def read_pixels(image: bpy.types.Image) -> npt.NDArray[np.uint8] | Float32Array | None:
    """The image (H, W, C), top row first, colour not multiplied by alpha; None without data."""
    (width, height), channels = image.size, image.channels
    if width * height * channels == 0 or len(image.pixels) != width * height * channels:
        return None
    flat = np.empty(width * height * channels, np.float32)
    image.pixels.foreach_get(flat)
    pixels = flat.reshape(height, width, channels)[::-1]
    if channels == 2:
        pixels = pixels[:, :, :1]
    if not image.is_float:
        return np.ascontiguousarray(np.rint(pixels * 255.0).astype(np.uint8))
    if channels == 4 and image.alpha_mode in {"STRAIGHT", "PREMUL"}:
        alpha = pixels[:, :, 3:]  # colours in floating point are multiplied by it
        pixels = np.concatenate(
            [pixels[:, :, :3] / np.where(alpha > 0.0, alpha, 1.0), alpha], axis=2
        )
    return np.ascontiguousarray(pixels)
