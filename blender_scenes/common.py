# SPDX-License-Identifier: GPL-3.0-or-later
"""What every scene maker needs: shapes, materials, modifiers, instances, lights and cameras.

Lengths are metres, angles radians, colours linear RGB. Nothing here draws a random number. Only
modifiers whose result has stayed the same from Blender 3.4 on are used: Screw, Array, Mirror,
Subdivision Surface, Edge Split; and they give the same geometry in the viewport and in a render.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence

import bpy
from mathutils import Matrix, Vector

Point = tuple[float, float, float]
Color = tuple[float, float, float]


def empty_scene(name: str) -> bpy.types.Scene:
    """Start from an empty file with the picture settings that all scenes share."""
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    scene.name = name
    scene.render.engine = "CYCLES" if hasattr(scene, "cycles") else scene.render.engine
    scene.render.resolution_x, scene.render.resolution_y = 1024, 768
    scene.render.resolution_percentage = 100
    # BVH Lab writes plain sRGB: a film curve here would make Blender's picture differ from ours.
    scene.view_settings.view_transform = "Standard"
    return scene


def set_world(color: Color) -> None:
    """Give the scene a constant world colour (radiance)."""
    world = bpy.data.worlds.new("sky")
    if world.node_tree is None:
        world.use_nodes = True
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (*color, 1.0)
    background.inputs["Strength"].default_value = 1.0
    world.color = color
    bpy.context.scene.world = world


def add_material(name: str, color: Color, roughness: float = 0.8, glow: float = 0.0) -> None:
    """Make a Principled material of one plain colour; ``glow`` times the colour is its radiance."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*color, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    if glow > 0.0:
        emission = "Emission Color" if "Emission Color" in shader.inputs else "Emission"
        shader.inputs[emission].default_value = (*color, 1.0)
        shader.inputs["Emission Strength"].default_value = glow
    material.diffuse_color = (*color, 1.0)
    material.roughness = roughness


class Shape:
    """Vertices, and faces with the name of their material, gathered until a mesh is made."""

    def __init__(self) -> None:
        self.vertices: list[Point] = []
        self.faces: list[tuple[int, ...]] = []
        self.materials: list[str] = []
        self.smooth: list[bool] = []

    def add(
        self,
        vertices: Iterable[Sequence[float]],
        faces: Iterable[Sequence[int]],
        material: str,
        smooth: bool = False,
    ) -> None:
        """Append vertices, and faces that index into these vertices."""
        first = len(self.vertices)
        self.vertices.extend((float(x), float(y), float(z)) for x, y, z in vertices)
        for face in faces:
            self.faces.append(tuple(first + corner for corner in face))
            self.materials.append(material)
            self.smooth.append(smooth)

    def box(self, low: Point, high: Point, material: str) -> None:
        """Append an axis-aligned box: 12 triangles however long it is."""
        corners = [
            (x, y, z)
            for z in (low[2], high[2])
            for y in (low[1], high[1])
            for x in (low[0], high[0])
        ]
        faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
        self.add(corners, faces, material)

    def beam(self, start: Point, end: Point, size: float, material: str) -> None:
        """Append a square bar from one point to another, in any direction, without caps."""
        path = [Vector(start), Vector(end)]
        self.tube(path, [size * math.sqrt(0.5)] * 2, 4, material, smooth=False)

    def grid(
        self,
        point: Callable[[float, float], Point],
        columns: int,
        rows: int,
        material: str,
        smooth: bool = True,
        closed: bool = False,
    ) -> None:
        """Append ``point(u, v)``, u and v in 0..1, as columns x rows quads.

        A closed grid joins its last column to its first.
        """
        width = columns if closed else columns + 1
        vertices = [point(i / columns, j / rows) for j in range(rows + 1) for i in range(width)]
        faces = []
        for j in range(rows):
            for i in range(columns):
                left, right = j * width + i, j * width + (i + 1) % width
                faces.append((left, right, right + width, left + width))
        self.add(vertices, faces, material, smooth)

    def tube(
        self,
        path: Sequence[Vector],
        radii: Sequence[float],
        sides: int,
        material: str,
        smooth: bool = True,
    ) -> None:
        """Append an open tube of one radius per point along a path."""
        along = (path[-1] - path[0]).normalized()
        helper = Vector((0, 0, 1)) if abs(along.z) < 0.9 else Vector((1, 0, 0))
        rings = []
        for i, centre in enumerate(path):
            tangent = (path[min(i + 1, len(path) - 1)] - path[max(i - 1, 0)]).normalized()
            side = tangent.cross(helper).normalized()
            up = side.cross(tangent)
            rings.append((centre, side, up, radii[i]))

        def on_tube(u: float, v: float) -> Point:
            centre, side, up, radius = rings[round(v * (len(rings) - 1))]
            angle = 2 * math.pi * u + math.pi / 4
            return tuple(centre + radius * (math.cos(angle) * side + math.sin(angle) * up))

        self.grid(on_tube, sides, len(rings) - 1, material, smooth, closed=True)

    def to_mesh(self, name: str) -> bpy.types.Mesh:
        """Make a mesh whose material slots are the used materials, in order of first use."""
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(self.vertices, [], self.faces)
        slots = list(dict.fromkeys(self.materials))
        for slot in slots:
            mesh.materials.append(bpy.data.materials[slot])
        mesh.polygons.foreach_set("material_index", [slots.index(name) for name in self.materials])
        mesh.polygons.foreach_set("use_smooth", self.smooth)
        mesh.update()
        return mesh


def new_collection(name: str, visible: bool = True) -> bpy.types.Collection:
    """Make a collection; one that is not visible holds parts that only instances show."""
    collection = bpy.data.collections.new(name)
    if visible:
        bpy.context.scene.collection.children.link(collection)
    else:
        collection.use_fake_user = True
    return collection


def add_object(
    name: str,
    data: bpy.types.ID | Shape,
    collection: bpy.types.Collection,
    matrix: Matrix | None = None,
) -> bpy.types.Object:
    """Put a mesh, curve or shape into a collection; data passed twice is shared, not copied."""
    if isinstance(data, Shape):
        data = data.to_mesh(name)
    item = bpy.data.objects.new(name, data)
    if matrix is not None:
        item.matrix_world = matrix
    collection.objects.link(item)
    return item


def add_instance(
    source: bpy.types.Collection, collection: bpy.types.Collection, matrix: Matrix
) -> bpy.types.Object:
    """Show a whole collection once more, at ``matrix``."""
    item = add_object(source.name, None, collection, matrix)
    item.instance_type = "COLLECTION"
    item.instance_collection = source
    item.empty_display_size = 0.1
    return item


def subdivide(item: bpy.types.Object, levels: int) -> None:
    """Round an object by Catmull-Clark subdivision."""
    modifier = item.modifiers.new("subdivision", "SUBSURF")
    modifier.levels = modifier.render_levels = levels


def repeat(item: bpy.types.Object, count: int, offset: Point) -> None:
    """Repeat an object ``count`` times, ``offset`` apart."""
    modifier = item.modifiers.new("array", "ARRAY")
    modifier.count = count
    modifier.use_relative_offset = False
    modifier.use_constant_offset = True
    modifier.constant_offset_displace = offset


def mirror(item: bpy.types.Object, axis: int = 0) -> None:
    """Add the mirror image of an object across its own plane; nothing is merged."""
    modifier = item.modifiers.new("mirror", "MIRROR")
    modifier.use_axis = [i == axis for i in range(3)]
    modifier.use_mirror_merge = False
    modifier.use_clip = False


def lathe(
    name: str,
    profile: Sequence[tuple[float, float]],
    steps: int,
    material: str,
    collection: bpy.types.Collection,
    matrix: Matrix | None = None,
) -> bpy.types.Object:
    """Turn a profile of (radius, height), listed upwards, around the Z axis."""
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(
        [(r, 0, z) for r, z in profile], [(i, i + 1) for i in range(len(profile) - 1)], []
    )
    mesh.materials.append(bpy.data.materials[material])
    item = add_object(name, mesh, collection, matrix)
    screw = item.modifiers.new("lathe", "SCREW")
    screw.axis = "Z"
    screw.angle = 2 * math.pi
    screw.steps = screw.render_steps = steps
    screw.use_merge_vertices = True
    screw.merge_threshold = 1e-5
    screw.use_smooth_shade = True
    screw.use_normal_calculate = True
    edges = item.modifiers.new("edges", "EDGE_SPLIT")
    edges.split_angle = math.radians(40)
    return item


def cable(
    name: str,
    paths: Sequence[Sequence[Point]],
    radius: float,
    material: str,
    resolution: int,
    collection: bpy.types.Collection,
) -> bpy.types.Object:
    """Add round cables along polylines as one curve with a bevel; resolution 0 gives four sides."""
    curve = bpy.data.curves.new(name, "CURVE")
    curve.dimensions = "3D"
    curve.bevel_depth = radius
    curve.bevel_resolution = resolution
    curve.materials.append(bpy.data.materials[material])
    for path in paths:
        spline = curve.splines.new("POLY")
        spline.points.add(len(path) - 1)
        spline.points.foreach_set("co", [c for point in path for c in (*point, 1.0)])
    return add_object(name, curve, collection)


def smoothstep(low: float, high: float, x: float) -> float:
    """Return 0 below ``low``, 1 above ``high``, and a smooth rise between."""
    t = min(1.0, max(0.0, (x - low) / (high - low)))
    return t * t * (3 - 2 * t)


def sagging(start: Point, end: Point, sag: float, pieces: int) -> list[Point]:
    """Return a parabola between two points whose middle hangs ``sag`` below the straight line."""
    points = []
    for i in range(pieces + 1):
        t = i / pieces
        x, y, z = (a + (b - a) * t for a, b in zip(start, end, strict=True))
        points.append((x, y, z - 4 * sag * t * (1 - t)))
    return points


def looking(location: Point, target: Point) -> Matrix:
    """Return the matrix that puts an object at ``location``, its -Z towards ``target``, Y up."""
    direction = Vector(target) - Vector(location)
    rotation = direction.to_track_quat("-Z", "Y").to_matrix().to_4x4()
    return Matrix.Translation(location) @ rotation


def add_camera(name: str, location: Point, target: Point, lens: float) -> bpy.types.Object:
    """Add a camera; ``lens`` is in mm on a 36 mm sensor."""
    data = bpy.data.cameras.new(name)
    data.lens = lens
    data.clip_end = 1000.0
    return add_object(name, data, bpy.context.scene.collection, looking(location, target))


def add_sun(name: str, source: Point, strength: float, color: Color, angle: float) -> None:
    """Add a sun that shines from ``source`` towards the origin; ``strength`` in W/m2."""
    data = bpy.data.lights.new(name, "SUN")
    data.energy, data.color, data.angle = strength, color, angle
    add_object(name, data, bpy.context.scene.collection, looking(source, (0, 0, 0)))


def add_area(
    name: str, location: Point, target: Point, size: tuple[float, float], power: float, color: Color
) -> None:
    """Add a rectangular area light of ``power`` W that the camera does not see."""
    data = bpy.data.lights.new(name, "AREA")
    data.shape = "RECTANGLE"
    data.size, data.size_y = size
    data.energy, data.color = power, color
    item = add_object(name, data, bpy.context.scene.collection, looking(location, target))
    item.visible_camera = False
