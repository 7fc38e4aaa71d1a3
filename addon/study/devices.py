# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices by their ids in `core.devices()`: which one a name stands for, and how to call it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .precision import is_exact

CPU = "cpu"
OPENCL = "opencl"  # the first OpenCL device that can be used, graphics cards before others

Devices = Sequence[Mapping[str, Any]]  # as core.devices() gives them


def resolved(chosen: Sequence[str], devices: Devices) -> list[str]:
    """The full ids of the devices chosen, each once, in their order.

    Raises ValueError for one that is not there, listing those that are, or that cannot be used,
    with the reason.
    """
    return list(dict.fromkeys(_resolved(name, devices) for name in chosen))


def _resolved(name: str, devices: Devices) -> str:
    usable = [device for device in devices if device["available"]]
    if name == OPENCL:
        ours = [device for device in usable if device["id"] != CPU]
        if ours:
            return str(max(ours, key=lambda device: bool(device["is_gpu"]))["id"])
    for device in devices:
        if device["id"] == name or (name == OPENCL and device["id"] != CPU):
            if not device["available"]:
                raise ValueError(f"device {name!r} cannot be used: {device['reason']}")
            return name
    there = ", ".join(str(device["id"]) for device in usable)
    raise ValueError(f"unknown device {name!r}; there are: {there}")


def named(text: str) -> list[str]:
    """The devices in a list with commas between; their own names may hold some."""
    names: list[str] = []
    for word in text.split(","):
        if not names or word.strip() == CPU or word.strip().split(":")[0] == OPENCL:
            names.append(word)
        else:
            names[-1] += f",{word}"
    return [name.strip() for name in names if name.strip()]


def has_tests(device: str, triangle_test: str, box_test: str) -> bool:
    """Whether the device traces with these tests: those to compare with are there on the cpu."""
    return device == CPU or is_exact(triangle_test, box_test)


def short_name(device: str) -> str:
    """The device's own name, without the platform's."""
    return device.partition("/")[2] or device


def labels(devices: Iterable[str]) -> dict[str, str]:
    """Short names, but for those that two of the devices share."""
    ids = set(devices)
    names = [short_name(device) for device in ids]
    return {d: short_name(d) if names.count(short_name(d)) == 1 else d for d in ids}


def described(device: Mapping[str, Any]) -> str:
    """What can be said of a device in a line."""
    if not device["available"]:
        return str(device["reason"])
    if device["id"] == CPU:
        return f"{device['threads']} threads"
    kind = "GPU, " if device["is_gpu"] else ""
    memory = f"{device['memory'] / 2**30:.1f} GiB"
    return f"{kind}{device['threads']} compute units, {memory}, driver {device['driver']}"
