# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that make values of values; beyond constants and straight lines they are simplified."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from .node_functions import BLENDS, MATH, curve, hue_saturation, ramp_value
from .nodes import Output
from .values import Texel, Value, complement, constant, grey, mixed, product, total

if TYPE_CHECKING:
    from .value_nodes import Evaluator


# --- functions of one value -----------------------------------------------------------------------


def gamma_node(reader: Evaluator, node: Output) -> Value:
    color, gamma = reader.color(node.input("Color")), reader.constant_number(node.input("Gamma"))
    return _pointwise(reader, color, lambda x: x**gamma if x > 0.0 else x, gamma == 1.0, "gamma")


def brightness_node(reader: Evaluator, node: Output) -> Value:
    bright = reader.constant_number(node.input("Bright"))
    contrast = reader.constant_number(node.input("Contrast"))
    color = reader.color(node.input("Color"))
    slope, offset = 1.0 + contrast, bright - 0.5 * contrast
    changed = color.times((slope,) * 3).plus((offset,) * 3)
    if changed.is_constant():
        return constant(tuple(max(channel, 0.0) for channel in changed.offset))
    return changed


def hue_saturation_node(reader: Evaluator, node: Output) -> Value:
    hue, saturation, value = (
        reader.constant_number(node.input(name)) for name in ("Hue", "Saturation", "Value")
    )
    color, factor = reader.color(node.input("Color")), reader.number(node.input("Fac"))
    if color.is_constant():
        changed = constant(hue_saturation(color.offset, hue, saturation, value))
    else:
        if hue % 1.0 != 0.5 or saturation != 1.0:
            reader.lost.add("approximated: hue and saturation of a texture unchanged")
        changed = color.times((value,) * 3)
    return mixed(color, changed, factor, reader.lost)


def invert_node(reader: Evaluator, node: Output) -> Value:
    color, factor = reader.color(node.input("Color")), reader.number(node.input("Fac"))
    return mixed(color, complement(color), factor, reader.lost)


def curves_node(reader: Evaluator, node: Output) -> Value:
    color, factor = reader.color(node.input("Color")), reader.number(node.input("Fac"))
    if not color.is_constant():
        reader.lost.add("approximated: curves of a texture ignored")
        return color
    return mixed(color, constant(curve(node.node.mapping, color.offset)), factor, reader.lost)


def ramp_node(reader: Evaluator, node: Output) -> Value:
    ramp, factor = node.node.color_ramp, reader.number(node.input("Fac"))
    alpha = node.socket.identifier == "Alpha"
    if factor.is_constant():
        return constant(ramp_value(ramp, factor.number, alpha))
    ends = [element.position for element in ramp.elements]
    straight = len(ends) == 2 and ramp.interpolation == "LINEAR" and ramp.color_mode == "RGB"
    low, high = (ends[0], ends[-1]) if straight and ends[1] > ends[0] else (0.0, 1.0)
    if not (straight and factor.within(low, high)):
        reader.lost.add("approximated: colour ramp of a texture by a straight line")
    first, last = constant(ramp_value(ramp, low, alpha)), constant(ramp_value(ramp, high, alpha))
    share = factor.plus((-low,) * 3).times((1.0 / (high - low),) * 3)
    return mixed(first, last, share, reader.lost)


def to_grey_node(reader: Evaluator, node: Output) -> Value:
    return grey(reader.color(node.input("Color")), reader.lost)


def separate_node(reader: Evaluator, node: Output) -> Value:
    names = [socket.identifier for socket in node.node.outputs]
    if getattr(node.node, "mode", "RGB") != "RGB":
        reader.lost.add("approximated: separated HSV or HSL by RGB")
    first = next(iter(node.inputs()))
    return reader.color(first).channel(names.index(node.socket.identifier))


def combine_node(reader: Evaluator, node: Output) -> Value:
    if getattr(node.node, "mode", "RGB") != "RGB":
        reader.lost.add("approximated: combined HSV or HSL by RGB")
    parts = [reader.number(at) for at in node.inputs()]
    texels = [part.texel for part in parts]
    offset = tuple(part.number for part in parts)
    if all(texel is None for texel in texels):
        return Value(offset)
    scale = tuple(part.scale[0] for part in parts)
    for channel in ("rgb", None):
        whole = _common(texels, channel)
        if whole is not None:
            return Value(offset, scale, whole)
    reader.lost.add("approximated: colour combined of textures by a constant")
    return constant(tuple(part.typical().number for part in parts))


def _common(texels: list[Texel | None], channel: str | None) -> Texel | None:
    """The one texel that all three look up: as its own channels (``rgb``), or the same channel."""
    first = texels[0]
    if first is None or None in texels:
        return None
    if channel is None:
        return first if texels.count(first) == 3 else None
    wanted = [replace(first, channel=name) for name in ("red", "green", "blue")]
    return replace(first, channel="rgb") if texels == wanted else None


def map_range_node(reader: Evaluator, node: Output) -> Value:
    if node.node.data_type != "FLOAT":
        reader.lost.add("approximated: Map Range of a vector ignored")
        return reader.color(node.input("Vector"))
    low, high, first, last = (
        reader.constant_number(node.input(name))
        for name in ("From Min", "From Max", "To Min", "To Max")
    )
    value = reader.number(node.input("Value"))
    if node.node.interpolation_type != "LINEAR":
        reader.lost.add("approximated: Map Range by a straight line")
    if high == low:
        return constant(first)
    share = value.plus((-low,) * 3).times((1.0 / (high - low),) * 3)
    if node.node.clamp:
        share = _clamped(reader, share, 0.0, 1.0)
    return share.times((last - first,) * 3).plus((first,) * 3)


def clamp_node(reader: Evaluator, node: Output) -> Value:
    low, high = (reader.constant_number(node.input(name)) for name in ("Min", "Max"))
    value = reader.number(node.input("Value"))
    if node.node.clamp_type == "RANGE" and low > high:
        low, high = high, low
    return _clamped(reader, value, low, high)


def ambient_occlusion_node(reader: Evaluator, node: Output) -> Value:
    reader.lost.add("approximated: node 'Ambient Occlusion' as unoccluded")
    return reader.color(node.input("Color")) if node.socket.type == "RGBA" else constant(1.0)


# --- functions of several -------------------------------------------------------------------------


def mix_nodes(reader: Evaluator, node: Output) -> Value:
    """The Mix node (several types) and its predecessor Mix RGB."""
    tree_node = node.node
    if tree_node.type == "MIX_RGB":
        names, blend = ("Fac", "Color1", "Color2"), tree_node.blend_type
        clamp_factor, clamp_result = True, tree_node.use_clamp
    else:
        kind = {"FLOAT": "Float", "VECTOR": "Vector", "RGBA": "Color"}[tree_node.data_type]
        names = ("Factor_Float", f"A_{kind}", f"B_{kind}")
        blend = tree_node.blend_type if kind == "Color" else "MIX"
        clamp_factor = tree_node.clamp_factor
        clamp_result = tree_node.clamp_result and kind == "Color"
    factor = reader.number(node.input(names[0]))
    read = reader.number if names[1] == "A_Float" else reader.color
    one, two = read(node.input(names[1])), read(node.input(names[2]))
    if clamp_factor:
        factor = factor.clamped()
    result = _blend(reader, blend, one, two, factor)
    return _clamped(reader, result, 0.0, 1.0) if clamp_result else result


def _blend(reader: Evaluator, blend: str, one: Value, two: Value, factor: Value) -> Value:
    lost = reader.lost
    if blend == "MIX":
        return mixed(one, two, factor, lost)
    if blend == "MULTIPLY":
        return mixed(one, product(one, two, lost), factor, lost)
    if blend in {"ADD", "SUBTRACT"}:
        sign = 1.0 if blend == "ADD" else -1.0
        return total(one, product(two, factor, lost).times((sign,) * 3), lost)
    if blend == "SCREEN":
        screened = complement(product(complement(one), complement(two), lost))
        return mixed(one, screened, factor, lost)
    if blend in BLENDS and one.is_constant() and two.is_constant() and factor.is_constant():
        pairs = zip(one.offset, two.offset, strict=True)
        return mixed(one, constant(tuple(BLENDS[blend](a, b) for a, b in pairs)), factor, lost)
    lost.add(f"approximated: colours mixed by {blend.lower().replace('_', ' ')}: the first alone")
    return one if one.texel or not two.texel else two


def math_node(reader: Evaluator, node: Output) -> Value:
    operation = node.node.operation
    values = [reader.number(at) for at in node.inputs()]
    result = _operation(reader, operation, values)
    return _clamped(reader, result, 0.0, 1.0) if node.node.use_clamp else result


def _operation(reader: Evaluator, operation: str, values: list[Value]) -> Value:
    one, two, three = values
    lost = reader.lost
    if operation == "ADD":
        return total(one, two, lost)
    if operation == "SUBTRACT":
        return total(one, two.times((-1.0,) * 3), lost)
    if operation == "MULTIPLY":
        return product(one, two, lost)
    if operation == "MULTIPLY_ADD":
        return total(product(one, two, lost), three, lost)
    if operation == "DIVIDE" and two.is_constant():
        return one.times((1.0 / two.number if two.number else 0.0,) * 3)
    function = MATH.get(operation)
    if function is not None and all(value.is_constant() for value in values):
        try:
            result = function(one.number, two.number, three.number)
        except (ValueError, ZeroDivisionError, OverflowError):
            result = 0.0  # as Blender, which guards each of them
        return constant(result)
    lost.add(f"approximated: math node '{operation.lower().replace('_', ' ')}' ignored")
    return next((value for value in values if value.texel), one)


def _pointwise(
    reader: Evaluator,
    value: Value,
    function: Callable[[float], float],
    neutral: bool,
    name: str,
) -> Value:
    """``function`` of each channel of a constant; a texture goes on unchanged."""
    if neutral:
        return value
    if value.is_constant():
        return constant(tuple(function(channel) for channel in value.offset))
    reader.lost.add(f"approximated: {name} of a texture ignored")
    return value


def _clamped(reader: Evaluator, value: Value, low: float, high: float) -> Value:
    if value.is_constant():
        return constant(tuple(min(max(channel, low), high) for channel in value.offset))
    if not value.within(low, high) and (low, high) != (0.0, 1.0):
        reader.lost.add("approximated: limits of a textured value ignored")
    return value
