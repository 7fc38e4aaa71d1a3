# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of what is modelled, approximated and left out, line by line."""

from __future__ import annotations

import sys
import unittest

import bpy
from blender_support import REPOSITORY, EmptySceneTest
from engine_support import EngineTest

sys.path.insert(0, str(REPOSITORY / "blender_scenes"))
import everything


class Everything(EmptySceneTest):
    def test_the_list_is_complete(self) -> None:
        expected = everything.build()
        scene = self.extract()
        self.assertEqual(sorted(scene.notes), sorted(expected))
        self.assertEqual(len(set(expected)), len(expected))

    def test_a_plain_scene_has_a_short_one(self) -> None:
        everything.add_plane("Plane", 0.0)
        light = bpy.data.objects.new("Sun", bpy.data.lights.new("Sun", "SUN"))
        camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
        for obj in (light, camera):
            bpy.context.scene.collection.objects.link(obj)
        bpy.context.scene.view_settings.view_transform = "Standard"
        notes = self.extract().notes
        self.assertEqual(notes[1:], ["Modelled: lamps."])


class FinalRender(EngineTest):
    """What only a render by the engine is asked for."""

    def test_passes_and_settings(self) -> None:
        from bvh_lab.blender import engine_final, store

        layer = bpy.context.view_layer
        layer.use_pass_mist = layer.use_pass_uv = True
        layer.aovs.add().name = "Mask"
        bpy.ops.scene.view_layer_add_lightgroup(name="Key")
        self.scene.render.use_multiview = True
        self.scene.camera.data.clip_end = 2.0
        self.scene.camera.data.dof.use_dof = True
        self.scene.view_settings.view_transform = "Filmic"  # is Blender's to do
        bpy.ops.render.render()
        notes = engine_final.notes_of[store.scene_key(self.scene)]
        said = [
            note for note in notes if not note.startswith(("Render geometry", "Approximated: the"))
        ]
        self.assertEqual(
            sorted(said),
            [
                "Approximated: far clipping is ignored, all is seen however far: Camera.",
                "Left out: light groups: Key.",
                "Left out: render passes: UV, Mist, AOV Mask.",
                "Left out: stereoscopy, every view shows the same picture.",
                "Modelled: depth of field.",
                "Modelled: glossy reflection, lamps.",
            ],
        )


if __name__ == "__main__":
    unittest.main()
