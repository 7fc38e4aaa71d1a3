# SPDX-License-Identifier: GPL-3.0-or-later
"""Shader trees as a sum of weighted parts and emission: mixes, sums and groups multiplied out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import bpy

from ..study.scene import ModelName
from .node_functions import fresnel_reflectance
from .nodes import Input, Output, linked
from .value_nodes import Evaluator
from .values import WHITE, Value, complement, constant, product, total

MAX_DEPTH = 64  # nested shaders
ONE = constant(1.0)
HALF = constant(0.5)
GREY = constant(0.8)
NOTHING = constant(0.0)
MOST_IOR = 10.0

# Shaders that become a diffuse one of their colour, and what that leaves out.
AS_DIFFUSE = {
    "BSDF_VELVET": "velvet",
    "BSDF_SHEEN": "sheen",
    "BSDF_TOON": "toon shading",
    "BSDF_HAIR": "hair shading",
    "BSDF_HAIR_PRINCIPLED": "hair shading",
    "SUBSURFACE_SCATTERING": "subsurface scattering",
    "EEVEE_SPECULAR": "Eevee's specular shader",
}


@dataclass(frozen=True)
class Part:
    """A component whose inputs are still values."""

    model: ModelName
    weight: Value = ONE
    color: Value = GREY
    roughness: Value = HALF
    metallic: Value = NOTHING
    transmission: Value = NOTHING
    ior: float = 1.45
    specular: float = 1.0


@dataclass
class Surface:
    """What a shader comes to."""

    parts: list[Part] = field(default_factory=list)
    emission: Value = NOTHING


class ShaderReader(Evaluator):
    """Reads the shader trees of one material, world or lamp."""

    def surface(self, at: Input, depth: int = 0) -> Surface:
        """What the shader linked to ``at`` comes to; nothing where none is linked."""
        node = linked(at)
        if node is None:
            return Surface()
        reader = SHADERS.get(node.node.type)
        if reader is not None and depth < MAX_DEPTH:
            return reader(self, node, depth)
        if node.node.type in AS_DIFFUSE:
            self.lost.add(f"approximated by plain diffuse: {AS_DIFFUSE[node.node.type]}")
            color = node.input("Color" if node.has("Color") else "Base Color")
            return self.part(node, Part("diffuse", color=self.color(color)))
        self.lost.add(f"approximated by plain diffuse: shader node '{node.node.bl_label}'")
        return Surface([Part("diffuse")])

    def part(self, node: Output, part: Part) -> Surface:
        """A single part, after a look at what every shader node may have and no part does."""
        self.check_normal(node)
        return Surface([part])

    def check_normal(self, node: Output) -> None:
        """Say that a changed normal is left out."""
        source = linked(node.input("Normal")) if node.has("Normal") else None
        if source is None:
            return
        kinds = {"NORMAL_MAP": "normal map", "BUMP": "bump"}
        self.lost.add(f"left out: {kinds.get(source.node.type, 'changed normals')}")

    def check_neutral(self, node: Output, feature: str, neutral: float, *identifiers: str) -> None:
        """Say that ``feature`` is left out, if the node has this input and it is not neutral."""
        present = [name for name in identifiers if node.has(name)]
        if present and not self.color(node.input(*present)).is_constant(neutral):
            self.lost.add(feature)

    def index_of_refraction(self, at: Input) -> float:
        """A constant from 1 to 10."""
        ior = self.constant_number(at)
        if ior < 1.0:
            self.lost.add("approximated: index of refraction below 1 by its reciprocal")
            ior = 1.0 / max(ior, 1.0 / MOST_IOR)
        return min(ior, MOST_IOR)


def weighted(surface: Surface, weight: Value, lost: set[str]) -> Surface:
    """All of it times ``weight``."""
    parts = [replace(part, weight=product(part.weight, weight, lost)) for part in surface.parts]
    return Surface(parts, product(surface.emission, weight, lost))


def added(one: Surface, two: Surface, lost: set[str]) -> Surface:
    """The sum of both."""
    return Surface(one.parts + two.parts, total(one.emission, two.emission, lost))


# --- shader nodes ---------------------------------------------------------------------------------


def _mix(reader: ShaderReader, node: Output, depth: int) -> Surface:
    factor_at, one, two = list(node.inputs())[:3]
    factor = reader.number(factor_at).clamped()
    surfaces = []
    for at, weight in ((one, complement(factor)), (two, factor)):
        if not weight.is_constant(0.0):
            surfaces.append(weighted(reader.surface(at, depth + 1), weight, reader.lost))
    if len(surfaces) == 1:
        return surfaces[0]
    return added(*surfaces, reader.lost)


def _add(reader: ShaderReader, node: Output, depth: int) -> Surface:
    one, two = (reader.surface(at, depth + 1) for at in list(node.inputs())[:2])
    return added(one, two, reader.lost)


def _emission(reader: ShaderReader, node: Output, depth: int) -> Surface:
    color, strength = reader.color(node.input("Color")), reader.number(node.input("Strength"))
    return Surface(emission=product(color, strength, reader.lost))


def _diffuse(reader: ShaderReader, node: Output, depth: int) -> Surface:
    reader.check_neutral(
        node, "approximated by plain diffuse: Oren-Nayar roughness", 0.0, "Roughness"
    )
    return reader.part(node, Part("diffuse", color=reader.color(node.input("Color"))))


def _translucent(reader: ShaderReader, node: Output, depth: int) -> Surface:
    return reader.part(node, Part("translucent", color=reader.color(node.input("Color"))))


def _transparent(reader: ShaderReader, node: Output, depth: int) -> Surface:
    return Surface([Part("transparent", color=reader.color(node.input("Color")))])


def _glossy(reader: ShaderReader, node: Output, depth: int) -> Surface:
    reader.check_neutral(node, "left out: anisotropy", 0.0, "Anisotropy")
    part = Part("glossy", color=reader.color(node.input("Color")), roughness=_rough(reader, node))
    return reader.part(node, part)


def _metallic(reader: ShaderReader, node: Output, depth: int) -> Surface:
    """The Metallic BSDF of Blender 4.3: reflectance at normal and at grazing incidence."""
    reader.check_neutral(node, "left out: anisotropy", 0.0, "Anisotropy")
    reader.check_neutral(node, "left out: thin film", 0.0, "Thin Film Thickness")
    if node.node.fresnel_type == "F82":
        color = reader.color(node.input("Base Color"))
        reader.check_neutral(node, "left out: edge tint of metal", 1.0, "Edge Tint")
    else:
        n, k = (reader.color(node.input(name)).typical().offset for name in ("IOR", "Extinction"))
        color = constant(tuple(map(_conductor, n, k)))
        reader.lost.add("approximated: metal of measured index by its colour at normal incidence")
    part = Part("principled", color=color, roughness=_rough(reader, node), metallic=ONE)
    return reader.part(node, part)


def _conductor(n: float, k: float) -> float:
    """Reflectance of a conductor at normal incidence."""
    return ((n - 1.0) ** 2 + k * k) / ((n + 1.0) ** 2 + k * k)


def _refractive(model: ModelName) -> Callable[[ShaderReader, Output, int], Surface]:
    def read(reader: ShaderReader, node: Output, depth: int) -> Surface:
        reader.check_neutral(node, "left out: thin film", 0.0, "Thin Film Thickness")
        part = Part(
            model,
            color=reader.color(node.input("Color")),
            roughness=_rough(reader, node),
            ior=reader.index_of_refraction(node.input("IOR")),
        )
        return reader.part(node, part)

    return read


def _rough(reader: ShaderReader, node: Output) -> Value:
    """The roughness; of another distribution than GGX it is said."""
    distribution = getattr(node.node, "distribution", "GGX")
    if distribution == "SHARP":
        return NOTHING
    roughness = reader.number(node.input("Roughness"))
    if distribution == "GGX" and node.node.type != "BSDF_REFRACTION":
        _say_single_scattering(reader, roughness)
    if distribution not in {"GGX", "MULTI_GGX"} and not roughness.is_constant(0.0):
        name = distribution.replace("_", " ").capitalize()
        reader.lost.add(f"approximated: {name} distribution by GGX")
    return roughness


def _say_single_scattering(reader: ShaderReader, roughness: Value) -> None:
    if not roughness.is_constant(0.0):
        reader.lost.add("approximated: GGX as Multiscatter GGX, which keeps all light")


# --- Principled BSDF ------------------------------------------------------------------------------

# Inputs of the Principled BSDF that no component has: what is said, the neutral value, the names.
LEFT_OUT: list[tuple[str, float, tuple[str, ...]]] = [
    ("left out: anisotropy", 0.0, ("Anisotropic",)),
    ("left out: sheen", 0.0, ("Sheen Weight", "Sheen")),
    ("left out: coat", 0.0, ("Coat Weight", "Clearcoat")),
    ("left out: thin film", 0.0, ("Thin Film Thickness",)),
    (
        "approximated by plain diffuse: subsurface scattering",
        0.0,
        ("Subsurface Weight", "Subsurface"),
    ),
    ("approximated by plain diffuse: Oren-Nayar roughness", 0.0, ("Diffuse Roughness",)),
]


def _principled(reader: ShaderReader, node: Output, depth: int) -> Surface:
    for feature, neutral, names in LEFT_OUT:
        reader.check_neutral(node, feature, neutral, *names)
    neutral_tint = 1.0 if node.input("Specular Tint").socket.type == "RGBA" else 0.0
    reader.check_neutral(node, "left out: specular tint", neutral_tint, "Specular Tint")
    reader.check_normal(node)
    base_color = reader.color(node.input("Base Color"))
    metallic = reader.number(node.input("Metallic")).clamped()
    transmission = reader.number(node.input("Transmission Weight", "Transmission")).clamped()
    if not transmission.is_constant(0.0):
        reader.check_neutral(
            node, "left out: transmission roughness", 0.0, "Transmission Roughness"
        )
    ior, specular = _coat(reader, node, transmission)
    roughness = reader.number(node.input("Roughness"))
    if node.node.distribution == "GGX" and bpy.app.version >= (4, 0, 0):
        _say_single_scattering(reader, roughness)
    part = Part(
        "principled",
        color=base_color,
        roughness=roughness,
        metallic=metallic,
        transmission=transmission,
        ior=ior,
        specular=specular,
    )
    color = reader.color(node.input("Emission Color", "Emission"))
    strength = reader.number(node.input("Emission Strength"))
    whole = Surface([part], product(color, strength, reader.lost))
    alpha = reader.number(node.input("Alpha")).clamped()
    if alpha.is_constant(1.0):
        return whole
    clear = Surface([Part("transparent", complement(alpha), color=constant(WHITE))])
    return added(weighted(whole, alpha, reader.lost), clear, reader.lost)


def _coat(reader: ShaderReader, node: Output, transmission: Value) -> tuple[float, float]:
    """Index of refraction, and the factor of its normal reflectance.

    The reflectance is that of the node: 0.08 times "Specular" before Blender 4.0, since then that
    of its index times twice "Specular IOR Level". Where nothing is refracted the index follows it.
    """
    ior = reader.index_of_refraction(node.input("IOR"))
    own = fresnel_reflectance(1.0, ior)
    if node.has("Specular IOR Level"):
        level = reader.constant_number(node.input("Specular IOR Level"))
        wanted = own * max(2.0 * level, 0.0)
    else:
        wanted = 0.08 * max(reader.constant_number(node.input("Specular")), 0.0)
    if transmission.is_constant(0.0):
        root = min(wanted, 0.99) ** 0.5
        return min((1.0 + root) / (1.0 - root), MOST_IOR), 1.0
    return ior, min(wanted / own, 2.0) if own > 0.0 else 0.0


SHADERS: dict[str, Callable[[ShaderReader, Output, int], Surface]] = {
    "BSDF_PRINCIPLED": _principled,
    "BSDF_DIFFUSE": _diffuse,
    "BSDF_GLOSSY": _glossy,
    "BSDF_ANISOTROPIC": _glossy,
    "BSDF_METALLIC": _metallic,
    "BSDF_GLASS": _refractive("glass"),
    "BSDF_REFRACTION": _refractive("refraction"),
    "BSDF_TRANSLUCENT": _translucent,
    "BSDF_TRANSPARENT": _transparent,
    "EMISSION": _emission,
    "BACKGROUND": _emission,
    "MIX_SHADER": _mix,
    "ADD_SHADER": _add,
}
