# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours and numbers that node trees compute, as values: constants, or affine in one texel.

What a node does beyond that is replaced by something simpler, and said in ``lost``.
"""

from __future__ import annotations

from collections.abc import Callable

from . import coordinates, value_functions
from .node_functions import (
    blackbody,
    fresnel_mean,
)
from .nodes import Input, Output, follow
from .textures import Textures
from .values import (
    BLACK,
    WHITE,
    Texel,
    Value,
    constant,
    finite,
    grey,
    mixed,
)

MAX_DEPTH = 100  # nodes in a row
MEAN_HALF = {
    "TEX_NOISE",
    "TEX_MUSGRAVE",
    "TEX_VORONOI",
    "TEX_WAVE",
    "TEX_MAGIC",
    "TEX_GRADIENT",
    "TEX_WHITE_NOISE",
    "TEX_GABOR",
}
MAGENTA = (1.0, 0.0, 1.0)


class Evaluator:
    """Reads the inputs of one material, world or lamp.

    ``lost`` gathers what was approximated or left out, as kinds of `Notes`.
    """

    def __init__(self, textures: Textures) -> None:
        self.textures = textures
        self.lost: set[str] = set()
        self._depth = 0
        self._known: dict[Output, Value] = {}

    def color(self, at: Input) -> Value:
        """The colour (or vector) at ``at``; a number fills all channels."""
        return self._evaluate(at)[0]

    def number(self, at: Input) -> Value:
        """The number at ``at``: of a colour its luminance, of a vector the mean."""
        value, kind = self._evaluate(at)
        if kind == "RGBA":
            return grey(value, self.lost)
        if kind == "VECTOR":
            return constant(sum(value.typical().offset) / 3.0)
        return value

    def constant_number(self, at: Input) -> float:
        """The number where only a constant will do; a texture's counts as a constant."""
        value = self.number(at)
        if not value.is_constant():
            self.lost.add(f"approximated: texture of '{at.socket.name}' by a constant")
        return value.typical().number

    def _evaluate(self, at: Input) -> tuple[Value, str]:
        found = follow(at)
        if isinstance(found, Input):
            return self._own(found), found.socket.type
        reader = NODES.get(found.node.type)
        if reader is not None and found not in self._known and self._depth < MAX_DEPTH:
            self._depth += 1
            self._known[found] = reader(self, found)
            self._depth -= 1
        if found in self._known:
            return self._known[found], found.socket.type
        self.lost.add(f"approximated: node '{found.node.bl_label}' by a constant")
        if found.node.type in MEAN_HALF:
            return constant(0.5), "VALUE"
        return self._own(at), at.socket.type

    def _own(self, at: Input) -> Value:
        """The value that the socket itself holds."""
        value = at.socket.default_value
        if isinstance(value, (int, float)):
            return constant(finite((float(value),) * 3, self.lost))
        red, green, blue = (float(channel) for channel in value[:3])
        return constant(finite((red, green, blue), self.lost))


# --- sources --------------------------------------------------------------------------------------


def _constant(reader: Evaluator, node: Output) -> Value:
    return reader._own(Input(node.node.outputs[0]))


def _image(reader: Evaluator, node: Output) -> Value:
    image = node.node.image
    alpha = node.socket.identifier == "Alpha"
    if image is None:
        reader.lost.add("missing texture is magenta: no image in node 'Image Texture'")
        return constant(1.0 if alpha else MAGENTA)
    if node.node.projection != "FLAT":
        reader.lost.add(f"approximated: {node.node.projection.lower()} projection by a flat one")
    if alpha and image.alpha_mode == "NONE":
        return constant(1.0)
    mapping, layer = coordinates.uv_coordinates(node, reader.lost)
    request = reader.textures.request(
        image,
        node.node.extension,
        node.node.interpolation,
        alpha_used=node.node.outputs["Alpha"].is_linked,
        alpha=alpha,
    )
    texel = Texel(request, "alpha" if alpha else "rgb", mapping, layer, not image.is_float)
    return Value(BLACK, WHITE, texel)


def _fresnel(reader: Evaluator, node: Output) -> Value:
    reader.lost.add("approximated: Fresnel factor by its mean")
    return constant(fresnel_mean(reader.constant_number(node.input("IOR"))))


def _layer_weight(reader: Evaluator, node: Output) -> Value:
    reader.lost.add("approximated: Layer Weight by its mean")
    blend = reader.constant_number(node.input("Blend"))
    if node.socket.identifier == "Fresnel":
        return constant(fresnel_mean(1.0 / max(1.0 - blend, 1e-5)))
    blend = min(max(blend, 0.0), 1.0 - 1e-5)
    exponent = 2.0 * blend if blend < 0.5 else 0.5 / (1.0 - blend)
    # The mean of 1 - cosine^exponent, weighted by the cosine.
    return constant(1.0 - 2.0 / (exponent + 2.0))


def _light_path(reader: Evaluator, node: Output) -> Value:
    reader.lost.add("approximated: Light Path as for a ray of the camera")
    return constant(1.0 if node.socket.identifier == "Is Camera Ray" else 0.0)


def _checker(reader: Evaluator, node: Output) -> Value:
    reader.lost.add("approximated: node 'Checker Texture' by its mean")
    if node.socket.identifier == "Fac":
        return constant(0.5)
    one, two = (reader.color(node.input(name)) for name in ("Color1", "Color2"))
    return mixed(one, two, constant(0.5), reader.lost)


def _blackbody(reader: Evaluator, node: Output) -> Value:
    return constant(blackbody(reader.constant_number(node.input("Temperature"))))


NODES: dict[str, Callable[[Evaluator, Output], Value]] = {
    "RGB": _constant,
    "VALUE": _constant,
    "TEX_IMAGE": _image,
    "TEX_CHECKER": _checker,
    "FRESNEL": _fresnel,
    "LAYER_WEIGHT": _layer_weight,
    "LIGHT_PATH": _light_path,
    "BLACKBODY": _blackbody,
    "GAMMA": value_functions.gamma_node,
    "BRIGHTCONTRAST": value_functions.brightness_node,
    "HUE_SAT": value_functions.hue_saturation_node,
    "INVERT": value_functions.invert_node,
    "CURVE_RGB": value_functions.curves_node,
    "VALTORGB": value_functions.ramp_node,
    "RGBTOBW": value_functions.to_grey_node,
    "SEPARATE_COLOR": value_functions.separate_node,
    "SEPRGB": value_functions.separate_node,
    "SEPXYZ": value_functions.separate_node,
    "COMBINE_COLOR": value_functions.combine_node,
    "COMBRGB": value_functions.combine_node,
    "COMBXYZ": value_functions.combine_node,
    "MAP_RANGE": value_functions.map_range_node,
    "CLAMP": value_functions.clamp_node,
    "AMBIENT_OCCLUSION": value_functions.ambient_occlusion_node,
    "MIX_RGB": value_functions.mix_nodes,
    "MIX": value_functions.mix_nodes,
    "MATH": value_functions.math_node,
}
