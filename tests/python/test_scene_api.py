# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes through Python: textures, materials, worlds, what a scene uses, refused input."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bvh_lab.native import core
from PIL import Image


def plane() -> Any:
    corners = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)], np.float32)
    return core.Mesh(corners, [(0, 1, 2), (0, 2, 3)])


UVS = np.array([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]], np.float32)
NORMALS = np.broadcast_to(np.array((0, 0, 1), np.float32), (2, 3, 3))
GREY = core.Material([core.Component()])


# --- textures ------------------------------------------------------------------------------------


def test_textures_hold_the_pixels_that_they_are_given() -> None:
    pixels = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 255)]], np.uint8)
    texture = core.Texture(pixels, wrap="extend", closest=True)
    assert (texture.width, texture.height, texture.channels) == (2, 2, 3)
    found = texture.look_up([(0.1, 0.9), (0.9, 0.9), (0.1, 0.1), (0.9, 0.1)])
    np.testing.assert_allclose(found[:, :3], pixels.reshape(4, 3) / 255, atol=1e-6)
    assert (found[:, 3] == 1).all()
    np.testing.assert_allclose(texture.average, (0.5, 0.5, 0.5, 1), atol=1e-6)


def test_grey_fills_all_colours_and_floats_may_exceed_one() -> None:
    texture = core.Texture(np.full((3, 5), 7.5, np.float32))
    np.testing.assert_allclose(texture.look_up([(0.3, 0.7)]), [(7.5, 7.5, 7.5, 1)])


def test_srgb_decodes_colours_and_not_alpha() -> None:
    texture = core.Texture(np.full((1, 1, 4), 128, np.uint8), srgb=True)
    linear = ((128 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(texture.average, (linear, linear, linear, 128 / 255), atol=1e-5)


@pytest.mark.parametrize(
    ("mode", "pixel", "channels", "expected"),
    [
        ("RGB", (200, 100, 50), 3, (200, 100, 50, 255)),
        ("RGBA", (200, 100, 50, 64), 4, (200, 100, 50, 64)),
        ("L", 90, 1, (90, 90, 90, 255)),
        ("LA", (90, 128), 4, (90, 90, 90, 128)),
    ],
)
def test_files_are_read_as_they_are(
    tmp_path: Path, mode: str, pixel: Any, channels: int, expected: tuple[int, ...]
) -> None:
    Image.new(mode, (4, 3), pixel).save(tmp_path / "a.png")
    texture = core.Texture.read(tmp_path / "a.png")
    assert (texture.width, texture.height, texture.channels) == (4, 3, channels)
    np.testing.assert_allclose(texture.average, np.array(expected) / 255, atol=1e-6)


def test_rows_of_files_run_from_the_top(tmp_path: Path) -> None:
    picture = Image.new("L", (1, 2), 0)
    picture.putpixel((0, 0), 255)
    picture.save(tmp_path / "a.png")
    texture = core.Texture.read(str(tmp_path / "a.png"), closest=True)
    assert texture.look_up([(0.5, 0.9), (0.5, 0.1)])[:, 0].tolist() == [1, 0]


def test_colours_of_openexr_files_are_divided_by_alpha(tmp_path: Path) -> None:
    pixels = np.array([[(0.5, 1, 0, 0.5), (3, 0, 0, 0)]], np.float32)
    core.write_image(str(tmp_path / "a.exr"), pixels)
    texture = core.Texture.read(tmp_path / "a.exr", wrap="extend", closest=True)
    found = texture.look_up([(0.2, 0.5)])
    np.testing.assert_allclose(found[0], (1, 2, 0, 0.5))
    assert texture.average[0] == 2  # what has no alpha stays


def test_files_that_are_no_pictures_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.png").write_text("not a picture")
    good = tmp_path / "b.png"
    Image.effect_noise((64, 64), 50).save(good)
    (tmp_path / "cut.png").write_bytes(good.read_bytes()[:600])
    for path, words in (
        (tmp_path / "none.png", "none.png: there is no such file"),
        (tmp_path, "it is a folder"),
        (tmp_path / "a.png", "a.png"),
        (tmp_path / "cut.png", "cut.png"),
    ):
        with pytest.raises(RuntimeError, match=f"cannot read .*{words}"):
            core.Texture.read(path)


def test_textures_that_make_no_sense_are_refused() -> None:
    pixels = np.zeros((2, 2, 3), np.uint8)
    for arguments, words in (
        ({"pixels": "red"}, "uint8 or float32"),
        ({"pixels": np.zeros((2, 2), np.int64)}, "uint8 or float32"),
        ({"pixels": np.zeros(4, np.uint8)}, r"shape \(H, W\)"),
        ({"pixels": np.zeros((2, 2, 2), np.uint8)}, "1, 3 or 4 channels, not 2"),
        ({"pixels": np.zeros((0, 2), np.uint8)}, "empty"),
        ({"pixels": np.zeros((1, 70000), np.uint8)}, "65535"),
        ({"wrap": "wave"}, "unknown wrap 'wave'; there are repeat, extend, clip, mirror"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Texture(**{"pixels": pixels, **arguments})


# --- materials -----------------------------------------------------------------------------------


def test_materials_that_make_no_sense_are_refused() -> None:
    for arguments, words in (
        ({"model": "velvet"}, "unknown model 'velvet'; there are principled, diffuse"),
        ({"weight": 2}, "weight is 2: it must be 0 to 1"),
        ({"color": (1, 2, 0)}, r"color is \(1, 2, 0\)"),
        ({"color": 0.5}, r"color must be numbers of shape \(3,\), or a Lookup"),
        ({"roughness": math.nan}, "roughness is nan"),
        ({"metallic": (0, 1)}, "metallic must be numbers of shape"),
        ({"transmission": -0.1}, "transmission is -0.1"),
        ({"ior": 0.9}, "ior is 0.9: it must be 1 to 10"),
        ({"specular": 3}, "specular is 3"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Component(**arguments)
    with pytest.raises(ValueError, match=r"emission is \(0, -1, 0\)"):
        core.Material([], (0, -1, 0))
    for arguments, words in (
        ({"texture": -1}, "texture must be"),
        ({"channel": "hue"}, "unknown channel 'hue'"),
        ({"scale": math.inf}, "must be finite"),
        ({"mapping": np.eye(3)}, r"mapping must be numbers of shape \(2, 3\)"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Lookup(**{"texture": 0, **arguments})


# --- scenes --------------------------------------------------------------------------------------


def test_scenes_say_what_they_use() -> None:
    index = np.zeros(2, np.uint32)
    plain = core.Scene(plane(), [GREY], index)
    assert plain.features == dict.fromkeys(plain.features, False)
    everything = core.Scene(
        plane(),
        [
            core.Material(
                [
                    core.Component("principled", 0.5, core.Lookup(0), transmission=0.5),
                    core.Component("transparent", core.Lookup(1, "alpha", -1, 1)),
                ],
                core.Lookup(0, scale=(2, 3, 4)),
            )
        ],
        index,
        [core.Light("point", np.eye(4), (1, 1, 1))],
        core.World((1, 1, 1), texture=1),
        [core.Texture(np.ones((2, 2), np.float32)), core.Texture(np.ones((2, 2, 4), np.float32))],
        UVS,
        NORMALS,
    )
    assert everything.features == dict.fromkeys(plain.features, True)
    assert everything.mesh.triangles.shape == (2, 3)


def test_scenes_that_make_no_sense_are_refused() -> None:
    texture = core.Texture(np.zeros((2, 2, 3), np.uint8))
    image = core.Material([core.Component(color=core.Lookup(0))])
    number = core.Material([core.Component(roughness=core.Lookup(0))])
    good = {
        "materials": [GREY],
        "material_index": np.zeros(2, np.uint32),
        "textures": [texture],
        "uvs": UVS,
        "normals": NORMALS,
    }
    core.Scene(plane(), **good)
    for change, words in (
        ({"materials": []}, "at least one material"),
        ({"materials": [core.Material([core.Component()] * 5)]}, "material 0 has 5 components"),
        ({"materials": [image], "uvs": None}, "material 0, component 0: color looks up texture 0"),
        ({"materials": [image], "textures": []}, "lookup 0 refers to texture 0"),
        ({"materials": [GREY, number]}, "material 1, component 0: roughness is a number"),
        ({"material_index": np.array([0, 1])}, "triangle 1 has material 1"),
        ({"material_index": np.array([-1, 0])}, "triangle 0 has material -1"),
        ({"material_index": np.zeros(3, int)}, "3 entries for 2 triangles"),
        ({"material_index": np.zeros(2)}, "material_index must be integers"),
        ({"uvs": np.zeros((3, 3, 2))}, "uvs has 9 corners for 2 triangles"),
        ({"uvs": np.zeros((2, 3))}, r"uvs must be numbers of shape \(T, 3, 2\)"),
        ({"uvs": np.full((2, 3, 2), math.nan)}, "triangle 0, corner 0 has uv"),
        ({"normals": np.zeros((2, 3, 3))}, "triangle 0, corner 0 has normal"),
        ({"world": core.World((0, 0, -1))}, "the world's color"),
        ({"world": core.World((1, 1, 1), texture=1)}, "the world refers to texture 1"),
        ({"world": core.World((1, 1, 1), 0, np.ones((3, 3)))}, "must be a rotation"),
    ):
        with pytest.raises(ValueError, match=words):
            core.Scene(plane(), **{**good, **change})
    with pytest.raises(ValueError, match="color must be numbers"):
        core.World(None)
