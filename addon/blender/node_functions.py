# SPDX-License-Identifier: GPL-3.0-or-later
"""What shader nodes compute from constants."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable

import bpy

from ..study.scene import Color

# Blend types on channels; the mix with the factor comes after.
BLENDS: dict[str, Callable[[float, float], float]] = {
    "DARKEN": min,
    "LIGHTEN": max,
    "DIFFERENCE": lambda a, b: abs(a - b),
    "DIVIDE": lambda a, b: a / b if b else a,
    "OVERLAY": lambda a, b: 2.0 * a * b if a < 0.5 else 1.0 - 2.0 * (1.0 - a) * (1.0 - b),
}

# Operations of the Math node on three numbers; the linear ones are not among them.
MATH: dict[str, Callable[[float, float, float], float]] = {
    "DIVIDE": lambda a, b, c: a / b,
    "POWER": lambda a, b, c: math.pow(a, b),
    "LOGARITHM": lambda a, b, c: math.log(a, b),
    "SQRT": lambda a, b, c: math.sqrt(a),
    "INVERSE_SQRT": lambda a, b, c: 1.0 / math.sqrt(a),
    "ABSOLUTE": lambda a, b, c: abs(a),
    "EXPONENT": lambda a, b, c: math.exp(a),
    "MINIMUM": lambda a, b, c: min(a, b),
    "MAXIMUM": lambda a, b, c: max(a, b),
    "LESS_THAN": lambda a, b, c: float(a < b),
    "GREATER_THAN": lambda a, b, c: float(a > b),
    "SIGN": lambda a, b, c: math.copysign(1.0, a) if a else 0.0,
    "ROUND": lambda a, b, c: math.floor(a + 0.5),
    "FLOOR": lambda a, b, c: math.floor(a),
    "CEIL": lambda a, b, c: math.ceil(a),
    "TRUNC": lambda a, b, c: math.trunc(a),
    "FRACT": lambda a, b, c: a - math.floor(a),
    "MODULO": lambda a, b, c: math.fmod(a, b),
    "SINE": lambda a, b, c: math.sin(a),
    "COSINE": lambda a, b, c: math.cos(a),
    "TANGENT": lambda a, b, c: math.tan(a),
    "RADIANS": lambda a, b, c: math.radians(a),
    "DEGREES": lambda a, b, c: math.degrees(a),
}


def fresnel_reflectance(cosine: float, ior: float) -> float:
    """Unpolarised reflectance of a smooth dielectric of relative index ``ior``."""
    refracted = ior * ior - 1.0 + cosine * cosine
    if refracted <= 0.0:
        return 1.0
    g = math.sqrt(refracted)
    a, b = (
        (g - cosine) / (g + cosine),
        (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0),
    )
    return 0.5 * a * a * (1.0 + b * b)


def fresnel_mean(ior: float, steps: int = 256) -> float:
    """Fresnel reflectance averaged over the hemisphere, weighted by the cosine."""
    squares = ((step + 0.5) / steps for step in range(steps))
    return sum(fresnel_reflectance(math.sqrt(square), max(ior, 1e-5)) for square in squares) / steps


def hue_saturation(color: Color, hue: float, saturation: float, value: float) -> Color:
    """The Hue/Saturation/Value node at full factor."""
    red, green, blue = (max(channel, 0.0) for channel in color)
    h, s, v = colorsys.rgb_to_hsv(red, green, blue)
    s = min(max(s * saturation, 0.0), 1.0)
    return colorsys.hsv_to_rgb((h + hue + 0.5) % 1.0, s, v * value)


def curve(mapping: bpy.types.CurveMapping, color: Color) -> Color:
    """The RGB Curves node at full factor: the combined curve, then each channel's."""
    mapping.initialize()
    combined = mapping.curves[3]
    channels = (mapping.evaluate(combined, channel) for channel in color)
    red, green, blue = (
        mapping.evaluate(mapping.curves[i], channel) for i, channel in enumerate(channels)
    )
    return (red, green, blue)


def ramp_value(ramp: bpy.types.ColorRamp, position: float, alpha: bool) -> Color:
    """The colour of a ramp, or its alpha in all channels."""
    red, green, blue, opacity = ramp.evaluate(position)
    return (opacity, opacity, opacity) if alpha else (red, green, blue)


def blackbody(kelvin: float) -> Color:
    """Linear Rec. 709 colour of luminance 1, of a black body of 1667 to 25000 K.

    The chromaticity is the cubic fit to the Planckian locus of Kim et al., US patent 7024034.
    """
    t = 1000.0 / min(max(kelvin, 1667.0), 25000.0)
    if kelvin < 4000.0:
        x = -0.2661239 * t**3 - 0.2343589 * t**2 + 0.8776956 * t + 0.179910
    else:
        x = -3.0258469 * t**3 + 2.1070379 * t**2 + 0.2226347 * t + 0.240390
    if kelvin < 2222.0:
        y = -1.1063814 * x**3 - 1.34811020 * x**2 + 2.18555832 * x - 0.20219683
    elif kelvin < 4000.0:
        y = -0.9549476 * x**3 - 1.37418593 * x**2 + 2.09137015 * x - 0.16748867
    else:
        y = 3.0817580 * x**3 - 5.87338670 * x**2 + 3.75112997 * x - 0.37001483
    big_x, big_z = x / y, (1.0 - x - y) / y
    return (
        max(0.0, 3.2404542 * big_x - 1.5371385 - 0.4985314 * big_z),
        max(0.0, -0.9692660 * big_x + 1.8760108 + 0.0415560 * big_z),
        max(0.0, 0.0556434 * big_x - 0.2040259 + 1.0572252 * big_z),
    )
