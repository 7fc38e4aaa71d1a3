# SPDX-License-Identifier: GPL-3.0-or-later
"""Devices by their ids in `core.devices()`: which one a name stands for, and how to call it."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from .precision import is_exact

CPU = "cpu"
OPENCL = "opencl"  # the first OpenCL device that can be used, graphics cards before others

Devices = Sequence[Mapping[str, Any]]  # as core.devices() gives them

# What drivers say of a device beside its name: trademarks, brackets, clock rate, what it is.
_BESIDE = re.compile(r"\([^)]*\)|[®™]| @ [\d.]+ ?[GM]Hz|\b(?:Processor|CPU)\b")
_POCL = re.compile(r"opencl:Portable Computing Language/(\w+)-")  # then comes the processor's name
_TWIN = re.compile(r"( #\d+)?$")  # the core numbers devices of one name
LONGEST_NAME = 28  # characters of a device's name in a table


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
    """What to call a device in tables and sentences; its id stands once beside them (`known_as`).

    Its own name without the platform's, cut to `LONGEST_NAME`: "NVIDIA H100 80GB HBM3", and of PoCL
    "PoCL pthread" rather than its processor's name.
    """
    named = device.partition("/")[2]
    if not named:
        return device
    twin = _TWIN.search(named)
    number = twin[0] if twin else ""
    if pocl := _POCL.match(device):
        return f"PoCL {pocl[1]}{number}"
    bare = " ".join(_BESIDE.sub(" ", named.removesuffix(number)).split()) or named
    return textwrap.shorten(bare, LONGEST_NAME, placeholder=" …") + number


def labels(devices: Iterable[str]) -> dict[str, str]:
    """Short names, but for those that two of the devices share."""
    ids = set(devices)
    names = [short_name(device) for device in ids]
    return {d: short_name(d) if names.count(short_name(d)) == 1 else d for d in ids}


def known_as(device: str) -> str:
    """What tables call the device, with its id where that is another: once above a table."""
    name = short_name(device)
    return device if name == device else f"{name} ({device})"


def described(device: Mapping[str, Any]) -> str:
    """What can be said of a device in a line."""
    if not device["available"]:
        return str(device["reason"])
    if device["id"] == CPU:
        return f"{device['threads']} threads"
    kind = "GPU, " if device["is_gpu"] else ""
    memory = f"{device['memory'] / 2**30:.1f} GiB"
    return f"{kind}{device['threads']} compute units, {memory}, driver {device['driver']}"
