# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene of every feature that BVH Lab models, and of those that it approximates or leaves out.

For tests: `build` fills an empty file and returns the notes that extraction must give, all of them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import bpy

OLD = bpy.app.version < (4, 0, 0)
FAR = 40.0  # beyond the far plane of the camera


def build() -> list[str]:
    """Fill the open scene, which must be empty; return the sentences about it, in any order."""
    scene = bpy.context.scene
    notes = [
        "Viewport geometry (eye icons and viewport levels of modifiers): 43 objects and instances, "
        "43 distinct.",
        "Modelled: smooth shading, image textures, environment texture, glossy reflection, "
        "refraction, translucency, transparency, emissive materials, lamps, depth of field.",
    ]
    if OLD:
        notes.append("Approximated: the Principled BSDF of this Blender as that of Blender 4.0.")
    for part in (_surfaces, _materials, _objects, _left_out, _lamps, _world, _cameras, _settings):
        notes += part(scene)
    return notes


def add_plane(name: str, x: float, material: bpy.types.Material | None = None) -> bpy.types.Object:
    """A unit square in the scene."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], [], [(0, 1, 2, 3)])
    mesh.uv_layers.new(name="UVMap")
    if material is not None:
        mesh.materials.append(material)
    obj = bpy.data.objects.new(name, mesh)
    obj.location.x = x
    bpy.context.scene.collection.objects.link(obj)
    return obj


class Nodes:
    """A material of its own on a plane of its own."""

    places = iter(range(1 << 30))

    def __init__(self, name: str) -> None:
        self.material = bpy.data.materials.new(name)
        if bpy.app.version < (5, 0, 0):
            self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.principled = self.tree.nodes["Principled BSDF"]
        add_plane(name, 1.5 * next(self.places), self.material)

    def new(self, kind: str, **inputs: object) -> bpy.types.Node:
        """A node; ``inputs`` by name."""
        node = self.tree.nodes.new("ShaderNode" + kind)
        for name, value in inputs.items():
            node.inputs[name].default_value = value
        return node

    def link(self, source: bpy.types.Node, target: bpy.types.Node, socket: str) -> None:
        self.tree.links.new(source.outputs[0], target.inputs[socket])

    def show(self, kind: str, socket: str = "Surface", **inputs: object) -> bpy.types.Node:
        """A node at the output."""
        node = self.new(kind, **inputs)
        self.link(node, self.tree.nodes["Material Output"], socket)
        return node

    def set(self, value: object, *names: str) -> None:
        """The first of the principled shader's inputs of these names: versions differ."""
        inputs = self.principled.inputs
        inputs[next(name for name in names if name in inputs)].default_value = value


def _surfaces(scene: bpy.types.Scene) -> list[str]:
    """What has a surface: all of it is modelled."""
    bpy.ops.object.text_add(location=(0, 3, 0))
    bpy.ops.object.metaball_add(location=(4, 3, 0))
    bpy.ops.surface.primitive_nurbs_surface_sphere_add(location=(8, 3, 0))
    bpy.ops.mesh.primitive_uv_sphere_add(location=(12, 3, 0))
    for polygon in bpy.context.object.data.polygons:
        polygon.use_smooth = True
    return []


def _materials(scene: bpy.types.Scene) -> list[str]:
    image = bpy.data.images.new("Picture", 4, 4)
    textured = Nodes("Textured")
    textured.link(_image(textured, image), textured.principled, "Base Color")
    Nodes("Metal").set(1.0, "Metallic")
    Nodes("Glass").set(1.0, "Transmission Weight", "Transmission")
    Nodes("Leaf").show("BsdfTranslucent")
    Nodes("Veil").show("BsdfTransparent")
    Nodes("Glow").show("Emission")
    return [*_shading(image), *_principled_extras(), *_values(), *_volumes_and_shape()]


def _image(nodes: Nodes, image: bpy.types.Image | None) -> bpy.types.Node:
    node = nodes.new("TexImage")
    node.image = image
    return node


def _shading(image: bpy.types.Image) -> Iterator[str]:
    for name, kind, said in (
        ("Mapped", "NormalMap", "Left out: normal map: Mapped."),
        ("Bumpy", "Bump", "Left out: bump: Bumpy."),
        ("Bent", "Bevel", "Left out: changed normals: Bent."),
    ):
        nodes = Nodes(name)
        nodes.link(nodes.new(kind), nodes.principled, "Normal")
        yield said
    cubic, box = Nodes("Cubic"), Nodes("Box")
    picture = _image(cubic, image)
    picture.interpolation = "Cubic"
    cubic.link(picture, cubic.principled, "Base Color")
    yield "Approximated: cubic interpolation of a texture by linear: Picture."
    picture = _image(box, image)
    picture.projection = "BOX"
    box.link(picture, box.principled, "Base Color")
    yield "Approximated: box projection by a flat one: Box."
    lost = Nodes("Lost")
    lost.link(_image(lost, None), lost.principled, "Base Color")
    yield "Missing texture is magenta: no image in node 'Image Texture': Lost."


def _principled_extras() -> Iterator[str]:
    for name, said, sockets in (
        (
            "Skin",
            "Approximated by plain diffuse: subsurface scattering",
            ("Subsurface Weight", "Subsurface"),
        ),
        ("Velvet", "Left out: sheen", ("Sheen Weight", "Sheen")),
        ("Lacquer", "Left out: coat", ("Coat Weight", "Clearcoat")),
        ("Brushed", "Left out: anisotropy", ("Anisotropic",)),
        ("Bubble", "Left out: thin film", ("Thin Film Thickness",)),
        ("Clay", "Approximated by plain diffuse: Oren-Nayar roughness", ("Diffuse Roughness",)),
    ):
        nodes = Nodes(name)
        if any(socket in nodes.principled.inputs for socket in sockets):
            nodes.set(0.5, *sockets)
            yield f"{said}: {name}."
    yield from _other_shaders()


def _other_shaders() -> Iterator[str]:
    Nodes("Cartoon").show("BsdfToon")
    yield "Approximated by plain diffuse: toon shading: Cartoon."
    Nodes("Hole").show("Holdout")
    yield "Approximated by plain diffuse: shader node 'Holdout': Hole."
    rough = Nodes("Ashikhmin").show("BsdfGlossy" if OLD else "BsdfAnisotropic")
    rough.distribution = "ASHIKHMIN_SHIRLEY"
    yield "Approximated: Ashikhmin shirley distribution by GGX: Ashikhmin."
    many = Nodes("Many")
    last = many.new("BsdfDiffuse")
    for roughness in (0.1, 0.2, 0.3, 0.4, 0.5):
        glossy, mix = many.new("BsdfGlass", Roughness=roughness), many.new("MixShader")
        glossy.distribution = "MULTI_GGX"
        many.tree.links.new(last.outputs[0], mix.inputs[1])
        many.tree.links.new(glossy.outputs[0], mix.inputs[2])
        last = mix
    many.link(last, many.tree.nodes["Material Output"], "Surface")
    yield "Approximated: 6 shaders by the heaviest 4: Many."


def _values() -> Iterator[str]:
    for name, kind, socket, said in (
        ("Noise", "TexNoise", "Base Color", "Approximated: node 'Noise Texture' by a constant"),
        ("Checks", "TexChecker", "Base Color", "Approximated: node 'Checker Texture' by its mean"),
        ("Rim", "Fresnel", "Metallic", "Approximated: Fresnel factor by its mean"),
        ("Facing", "LayerWeight", "Metallic", "Approximated: Layer Weight by its mean"),
        ("Path", "LightPath", "Metallic", "Approximated: Light Path as for a ray of the camera"),
        ("Tint", "ObjectInfo", "Metallic", "Approximated: node 'Object Info' by a constant"),
    ):
        nodes = Nodes(name)
        nodes.link(nodes.new(kind), nodes.principled, socket)
        yield f"{said}: {name}."
    crevice = Nodes("Crevice")
    crevice.link(crevice.new("AmbientOcclusion"), crevice.principled, "Base Color")
    yield "Approximated: node 'Ambient Occlusion' as unoccluded: Crevice."


def _volumes_and_shape() -> Iterator[str]:
    Nodes("Smoke").show("VolumeScatter", "Volume")
    yield "Left out: volume: Smoke, world World."
    Nodes("Relief").show("Displacement", "Displacement")
    yield "Left out: displacement: Relief."


def _objects(scene: bpy.types.Scene) -> list[str]:
    """Settings of objects."""
    add_plane("Hold", -2).is_holdout = True
    add_plane("Catcher", -4).is_shadow_catcher = True
    add_plane("Ghost", -6).visible_glossy = False
    add_plane("Far", FAR)
    notes = [
        "Left out: holdout: Hold, collection Cut.",
        "Left out: shadow catcher: Catcher.",
        "Approximated: ray visibility is ignored, every ray sees these: Ghost, Dim, World.",
        "Approximated: far clipping is ignored, all is seen however far: Camera.",
    ]
    furry = add_plane("Furry", -8)
    furry.modifiers.new("Hair", "PARTICLE_SYSTEM")
    settings = furry.particle_systems[0].settings
    settings.type, settings.count = "HAIR", 3
    notes.append("Left out: particle hair: Furry.")
    coarse = add_plane("Coarse", -10)
    owner = coarse if hasattr(coarse, "shadow_terminator_geometry_offset") else coarse.cycles
    owner.shadow_terminator_geometry_offset = 0.5
    notes.append("Approximated: shadow terminator offsets are ignored: Coarse.")
    diced = add_plane("Diced", -12)
    modifier = diced.modifiers.new("Subdivision", "SUBSURF")
    owner = modifier if hasattr(modifier, "use_adaptive_subdivision") else diced.cycles
    owner.use_adaptive_subdivision = True
    notes.append("Approximated: adaptive subdivision by that of the modifier: Diced.")
    linked = add_plane("Linked", -14)
    if hasattr(linked, "light_linking"):
        linked.light_linking.receiver_collection = bpy.data.collections.new("Receivers")
        notes.append("Approximated: light linking is ignored, these light everything: Linked.")
    return notes


def _left_out(scene: bpy.types.Scene) -> list[str]:
    """Objects that are no surfaces."""
    notes = []
    curves = bpy.data.hair_curves.new("Strands")
    scene.collection.objects.link(bpy.data.objects.new("Strands", curves))
    notes.append("Left out: hair curves: Strands.")
    if hasattr(bpy.data, "pointclouds"):
        points = bpy.data.pointclouds.new("Dots")
        scene.collection.objects.link(bpy.data.objects.new("Dots", points))
        notes.append("Left out: point clouds: Dots.")
    scene.collection.objects.link(bpy.data.objects.new("Cloud", bpy.data.volumes.new("Cloud")))
    notes.append("Left out: volumes: Cloud.")
    drawing = bpy.data.grease_pencils.new("Sketch")
    scene.collection.objects.link(bpy.data.objects.new("Sketch", drawing))
    notes.append("Left out: grease pencil drawings: Sketch.")
    return notes


def _lamp(kind: str, name: str) -> bpy.types.Object:
    data = bpy.data.lights.new(name, kind)
    data.energy = 10.0
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _lamps(scene: bpy.types.Scene) -> list[str]:
    for kind in ("POINT", "SUN"):
        _lamp(kind, kind.title())
    for shape in ("SQUARE", "RECTANGLE", "DISK", "ELLIPSE"):
        _lamp("AREA", shape.title()).data.shape = shape
    notes = []
    _lamp("SPOT", "Spot")
    if OLD:
        notes.append("Approximated: spot light without the cosine of older Cycles: Spot.")
    _lamp("AREA", "Beam").data.spread = 1.0
    notes.append("Approximated: area light spread ignored: Beam.")
    _lamp("POINT", "Dim").visible_diffuse = False
    shadowless = _lamp("POINT", "Shadowless").data
    if hasattr(shadowless, "use_shadow") and not OLD:
        shadowless.use_shadow = False
    else:
        shadowless.cycles.cast_shadow = False
    notes.append("Approximated: light without shadows casts them: Shadowless.")
    _lamp("AREA", "Portal").data.cycles.is_portal = True
    notes.append("Left out: light portals: Portal.")
    _lamp("POINT", "Hole in light").data.energy = -1.0
    notes.append("Left out: negative light counts as 0: Hole in light.")
    measured = _lamp("POINT", "Measured").data
    measured.use_nodes = True
    tree = measured.node_tree
    profile = tree.nodes.new("ShaderNodeTexIES")
    tree.links.new(profile.outputs[0], tree.nodes["Emission"].inputs["Strength"])
    notes.append("Approximated: node 'IES Texture' by a constant: Measured.")
    return notes


def _world(scene: bpy.types.Scene) -> list[str]:
    world = bpy.data.worlds.new("World")
    scene.world = world
    if bpy.app.version < (5, 0, 0):
        world.use_nodes = True
    tree = world.node_tree
    background, output = tree.nodes["Background"], tree.nodes["World Output"]
    sky, picture = tree.nodes.new("ShaderNodeTexSky"), tree.nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.new("Surroundings", 4, 2, float_buffer=True)
    second, add = tree.nodes.new("ShaderNodeBackground"), tree.nodes.new("ShaderNodeAddShader")
    tree.links.new(sky.outputs[0], background.inputs["Color"])
    tree.links.new(picture.outputs[0], second.inputs["Color"])
    tree.links.new(background.outputs[0], add.inputs[0])
    tree.links.new(second.outputs[0], add.inputs[1])
    tree.links.new(add.outputs[0], output.inputs["Surface"])
    fog = tree.nodes.new("ShaderNodeVolumeScatter")
    tree.links.new(fog.outputs[0], output.inputs["Volume"])
    world.cycles_visibility.glossy = False
    return [
        "Approximated: sky texture by mid grey: world World.",
        "Approximated: colour added to an environment texture left out: world World.",
    ]


def _cameras(scene: bpy.types.Scene) -> list[str]:
    for name in ("Camera", "Dome"):
        scene.collection.objects.link(bpy.data.objects.new(name, bpy.data.cameras.new(name)))
    scene.camera = bpy.data.objects["Camera"]
    scene.camera.rotation_euler = (0.0, -math.pi / 2, 0.0)  # along +X
    lens = scene.camera.data
    lens.clip_end = 0.5 * FAR
    lens.dof.use_dof, lens.dof.aperture_blades, lens.dof.aperture_ratio = True, 6, 2.0
    dome = bpy.data.cameras["Dome"]
    dome.type, dome.clip_end = "PANO", 1e6
    return [
        "Approximated: aperture blades, the aperture is round: Camera.",
        "Approximated: anamorphic bokeh, the aperture is round: Camera.",
        "Approximated: panoramic camera treated as perspective: Dome.",
    ]


def _settings(scene: bpy.types.Scene) -> list[str]:
    render = scene.render
    render.engine = "CYCLES"
    render.use_motion_blur = render.film_transparent = render.use_freestyle = True
    render.use_border = True
    scene.cycles.film_exposure = 2.0
    scene.view_settings.view_transform, scene.view_settings.exposure = "Filmic", 1.0
    layer = bpy.context.view_layer
    layer.material_override = bpy.data.materials["Metal"]
    for name in ("Cut", "Bounce"):
        scene.collection.children.link(bpy.data.collections.new(name))
    layer.layer_collection.children["Cut"].holdout = True
    layer.layer_collection.children["Bounce"].indirect_only = True
    return [
        "Left out: motion blur.",
        "Left out: transparent film, alpha is 1 everywhere.",
        "Left out: Freestyle lines.",
        "Left out: film exposure of Cycles.",
        "Left out: the render border, pictures are whole.",
        "Left out: colour management (Filmic, exposure, gamma, curves or white balance), colours "
        "are plain sRGB.",
        "Left out: material override of the view layer: ViewLayer.",
        "Approximated: indirect only is ignored, every ray sees these: Bounce.",
    ]
