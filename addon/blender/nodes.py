# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the inputs of shader nodes get their values from: links followed to their other end."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import bpy

MAX_LINKS = 1000  # followed in a row; more can only be a circle


@dataclass(frozen=True)
class Input:
    """An input socket, with the group nodes around its tree, outermost first."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()


@dataclass(frozen=True)
class Output:
    """An output socket of a node that makes something, with the group nodes around its tree."""

    socket: bpy.types.NodeSocket
    groups: tuple[bpy.types.Node, ...] = ()

    @property
    def node(self) -> bpy.types.Node:
        """The node that makes it."""
        return self.socket.node

    def has(self, identifier: str) -> bool:
        """Whether the node has such an input."""
        return _by_identifier(self.node.inputs, identifier) is not None

    def input(self, *identifiers: str) -> Input:
        """The first of the node's inputs that exists: Blender 4.0 renamed several."""
        found = (_by_identifier(self.node.inputs, name) for name in identifiers)
        return Input(next(socket for socket in found if socket is not None), self.groups)

    def inputs(self) -> Iterator[Input]:
        """All inputs of the node."""
        return (Input(socket, self.groups) for socket in self.node.inputs)


def node_tree(block: bpy.types.Material | bpy.types.World) -> bpy.types.NodeTree | None:
    """The node tree in use; from Blender 5.0 on it always is, and the switch is deprecated."""
    if bpy.app.version < (5, 0, 0) and not block.use_nodes:
        return None
    return block.node_tree


def follow(at: Input) -> Output | Input:
    """What feeds ``at``: a node's output, or where nothing does the input that holds the value.

    Reroutes and muted nodes are passed, groups are entered, and what a group's inputs feed is
    sought at the group node.
    """
    for _ in range(MAX_LINKS):
        further = _step(at)
        if further is None:
            return at
        if isinstance(further, Output):
            return further
        at = further
    return at


def linked(at: Input) -> Output | None:
    """The output that feeds ``at``, None where nothing does."""
    found = follow(at)
    return found if isinstance(found, Output) else None


def _step(at: Input) -> Output | Input | None:
    source = _link_source(at.socket)
    if source is None:
        return None
    node = source.node
    if node.mute:
        bypass = (link.from_socket for link in node.internal_links if link.to_socket == source)
        return _input_or_none(next(bypass, None), at.groups)
    if node.type == "GROUP" and node.node_tree:
        return _input_or_none(_inside(node.node_tree, source.identifier), (*at.groups, node))
    if node.type == "GROUP_INPUT" and at.groups:
        outer = _by_identifier(at.groups[-1].inputs, source.identifier)
        return _input_or_none(outer, at.groups[:-1])
    return Output(source, at.groups)


def _link_source(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """The socket that feeds ``socket``, through reroutes; a reroute that hangs loose feeds none."""
    for _ in range(MAX_LINKS):
        link = next((link for link in socket.links if link.is_valid and not link.is_muted), None)
        if link is None or link.from_node.type != "REROUTE":
            return link.from_socket if link else None
        socket = link.from_node.inputs[0]
    return None


def _inside(tree: bpy.types.NodeTree, identifier: str) -> bpy.types.NodeSocket | None:
    """The socket inside a group that feeds its output of this identifier."""
    ends = (node for node in tree.nodes if node.type == "GROUP_OUTPUT" and node.is_active_output)
    end = next(ends, None)
    return _by_identifier(end.inputs, identifier) if end else None


def _by_identifier(sockets: bpy.types.NodeInputs, identifier: str) -> bpy.types.NodeSocket | None:
    return next((socket for socket in sockets if socket.identifier == identifier), None)


def _input_or_none(
    socket: bpy.types.NodeSocket | None, groups: tuple[bpy.types.Node, ...]
) -> Input | None:
    return Input(socket, groups) if socket is not None else None
