# SPDX-License-Identifier: GPL-3.0-or-later
"""Values that shader nodes make of constants and textures: affine functions of one texel."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

from ..study.scene import ChannelName, Color, Lookup, Mapping

BLACK: Color = (0.0, 0.0, 0.0)
WHITE: Color = (1.0, 1.0, 1.0)
LUMINANCE: Color = (0.2126, 0.7152, 0.0722)  # of linear Rec. 709, as Cycles turns colour into grey
SINGLE: tuple[ChannelName, ...] = ("red", "green", "blue")
NO_MAPPING: Mapping = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True)
class Texel:
    """What is looked up: a channel of the texture that was requested, and where.

    ``layer`` names the UV map, "" for the one that renders; ``rotation`` belongs to environments.
    ``bounded``: no channel lies outside [0, 1].
    """

    request: int
    channel: ChannelName = "rgb"
    mapping: Mapping = NO_MAPPING
    layer: str = ""
    bounded: bool = True
    rotation: tuple[Color, Color, Color] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


@dataclass(frozen=True)
class Value:
    """``offset + scale * texel``, channel by channel; a constant where there is no texel."""

    offset: Color = BLACK
    scale: Color = BLACK
    texel: Texel | None = None

    @property
    def number(self) -> float:
        """The first channel of a constant."""
        return self.offset[0]

    def is_constant(self, color: Color | float | None = None) -> bool:
        """Whether it is constant, and where ``color`` is given equal to that."""
        if self.texel is not None:
            return False
        return color is None or self.offset == (
            color if isinstance(color, tuple) else (color, color, color)
        )

    def typical(self) -> Value:
        """The constant that it takes where the texel is one half."""
        if self.texel is None:
            return self
        return Value(_each(lambda offset, scale: offset + 0.5 * scale, self.offset, self.scale))

    def times(self, factor: Color) -> Value:
        """Channel by channel; times 0 nothing is looked up."""
        scale = _times(self.scale, factor)
        return Value(_times(self.offset, factor), scale, self.texel if any(scale) else None)

    def plus(self, summand: Color) -> Value:
        """Channel by channel."""
        return replace(self, offset=_plus(self.offset, summand))

    def within(self, low: float, high: float) -> bool:
        """Whether no channel can leave [low, high]."""
        if self.texel is not None and not self.texel.bounded:
            return False
        ends = (*self.offset, *_plus(self.offset, self.scale))
        return min(ends) >= low - 1e-6 and max(ends) <= high + 1e-6

    def clamped(self) -> Value:
        """A constant's channels in [0, 1]; look-ups are clamped where they are made."""
        if self.texel is not None:
            return self
        return Value(_each(lambda channel: min(max(channel, 0.0), 1.0), self.offset))

    def channel(self, index: int) -> Value:
        """One channel as a number."""
        texel = self.texel
        if texel is not None and texel.channel == "rgb":
            texel = replace(texel, channel=SINGLE[index])
        return Value(_grey(self.offset[index]), _grey(self.scale[index]), texel)

    def lookup(self, texture: int) -> Lookup:
        """As the study's scene has it, of the texture of that index; only with a texel."""
        assert self.texel is not None
        return Lookup(texture, self.texel.channel, self.scale, self.offset, self.texel.mapping)


def constant(value: Color | float) -> Value:
    """A colour, or a number in all channels."""
    return Value(value if isinstance(value, tuple) else _grey(value))


def grey(value: Value, lost: set[str]) -> Value:
    """The luminance of a colour as a number."""
    offset, texel = _grey(_dot(value.offset, LUMINANCE)), value.texel
    if texel is None:
        return Value(offset)
    if texel.channel == "rgb":
        if max(value.scale) - min(value.scale) > 1e-6:
            lost.add("approximated: luminance of a tinted texture")
        texel = replace(texel, channel="luminance")
    return Value(offset, _grey(_dot(value.scale, LUMINANCE)), texel)


def product(one: Value, two: Value, lost: set[str]) -> Value:
    """Exact where one of the two is constant; else the second counts as a constant."""
    if two.texel is not None and one.texel is not None:
        lost.add("approximated: product of two textures")
        two = two.typical()
    elif two.texel is not None:
        one, two = two, one
    return one.times(two.offset)


def total(one: Value, two: Value, lost: set[str]) -> Value:
    """Exact where one of the two is constant or both look up the same."""
    if one.texel is not None and one.texel == two.texel:
        return Value(_plus(one.offset, two.offset), _plus(one.scale, two.scale), one.texel)
    if two.texel is not None and one.texel is not None:
        lost.add("approximated: sum of two textures")
        two = two.typical()
    elif two.texel is not None:
        one, two = two, one
    return one.plus(two.offset)


def complement(value: Value) -> Value:
    """One minus the value."""
    return value.times((-1.0, -1.0, -1.0)).plus(WHITE)


def mixed(one: Value, two: Value, factor: Value, lost: set[str]) -> Value:
    """``one * (1 - factor) + two * factor``."""
    if one.is_constant() and two.is_constant():
        difference = constant(_each(lambda a, b: b - a, one.offset, two.offset))
        return total(one, product(difference, factor, lost), lost)
    if not factor.is_constant():
        lost.add("approximated: mix of textures by a texture")
        factor = factor.typical()
    return total(product(one, complement(factor), lost), product(two, factor, lost), lost)


def finite(value: Color, lost: set[str]) -> Color:
    """The colour with what is not a finite number as 0, and said."""
    if all(map(math.isfinite, value)):
        return value
    lost.add("left out: a colour or number that is not finite counts as 0")
    return _each(lambda channel: channel if math.isfinite(channel) else 0.0, value)


def _grey(value: float) -> Color:
    return (value, value, value)


def _dot(one: Color, two: Color) -> float:
    return sum(a * b for a, b in zip(one, two, strict=True))


def _times(one: Color, two: Color) -> Color:
    return _each(lambda a, b: a * b, one, two)


def _plus(one: Color, two: Color) -> Color:
    return _each(lambda a, b: a + b, one, two)


def _each(function: Callable[..., float], *colors: Color) -> Color:
    red, green, blue = (function(*channels) for channels in zip(*colors, strict=True))
    return (red, green, blue)
