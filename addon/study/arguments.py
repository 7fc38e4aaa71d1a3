# SPDX-License-Identifier: GPL-3.0-or-later
"""A plan from the words of a command line."""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterable

from .devices import named
from .plan import BRANCHINGS, BUILDERS, PRESETS, REORDERS, Plan
from .precision import BOX_TESTS, LAYOUTS, TRIANGLE_TESTS

NUMBERS = (
    *("samples", "depth", "shadow_rays", "ray_long_side"),
    *("repeats", "build_repeats", "judged_rays", "target_error", "seed", "threads"),
)


def add_plan_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options that `plan_from_arguments` reads. None of them has a default of its own:

    what is not given is as the preset has it.
    """
    plan = Plan()
    add = parser.add_argument
    add("--preset", choices=PRESETS, default="quick", help="where all other choices start")
    add("--builders", metavar="A,B", help=f"of {','.join(plan.builders)} (default: all)")
    add("--branching", metavar="2,4,8", help="branching factors (default: all)")
    add(
        "--reorder",
        metavar="A,B",
        help=f"sort rays before they are traced: {','.join(REORDERS)} (default: off)",
    )
    add(
        "--layouts",
        metavar="A,B",
        help=f"how nodes are stored: {','.join(LAYOUTS)}; cwbvh is 8-wide only (default: all, "
        "preset paper: full)",
    )
    add(
        "--triangle-tests",
        metavar="A,B",
        help=f"all, or of {','.join(TRIANGLE_TESTS)}: all but the first may miss or hit wrongly "
        "(default: watertight)",
    )
    add(
        "--box-tests",
        metavar="A,B",
        help=f"all, or of {','.join(BOX_TESTS)}: plain may miss (default: conservative)",
    )
    add(
        "--device",
        metavar="A,B",
        help="see the command devices; opencl is the first OpenCL device (default: cpu)",
    )
    add(
        "--param",
        metavar="BUILDER.NAME=VALUE",
        action="append",
        default=[],
        help="a builder setting",
    )
    add("--views", metavar="N|A,B", help="how many cameras, or their names (default: 3)")
    add(
        "--resolution",
        metavar="WxH|N",
        help=f"pixels, or those of the long side (default: {plan.long_side})",
    )
    add(
        "--samples",
        type=int,
        metavar="N",
        help=f"per pixel of the pictures (default: {plan.samples})",
    )
    add("--depth", type=int, metavar="N", help=f"bounces of a path (default: {plan.depth})")
    add(
        "--shadow-rays",
        type=int,
        metavar="N",
        help=f"towards lights from each hit (default: {plan.shadow_rays})",
    )
    add(
        "--ray-resolution",
        type=int,
        dest="ray_long_side",
        metavar="N",
        help="long side of the pixels whose rays speed is measured on, 0: the pictures' "
        f"(default: {plan.ray_long_side})",
    )
    add("--repeats", type=int, metavar="N", help=f"timed runs, 3 or more (default: {plan.repeats})")
    add(
        "--build-repeats",
        type=int,
        metavar="N",
        help=f"timed builds (default: {plan.build_repeats})",
    )
    add(
        "--judged-rays",
        type=int,
        metavar="N",
        help=f"rays of each view and kind checked by brute force (default: {plan.judged_rays})",
    )
    add(
        "--target-error",
        type=float,
        metavar="RELMSE",
        help="measure the time to this error of the picture, e.g. 0.05; the first time it takes a "
        "minute or more for the converged reference (default: 0, do not)",
    )
    add("--seed", type=int, metavar="N", help="of all random choices (default: 0)")
    add("--threads", type=int, metavar="N", help="0 means all (default: 0)")
    add("--memory", type=float, metavar="GIB", help="for the trees held at once (default: half)")
    add("--no-embree", dest="embree", action="store_false", help="leave Embree's rows out")
    add("--no-pictures", dest="pictures", action="store_false", help="render nothing")


def plan_from_arguments(arguments: argparse.Namespace) -> Plan:
    """The preset with what was given on top. Raises ValueError naming the bad option."""
    plan = Plan.from_preset(arguments.preset)
    for name in NUMBERS:
        if getattr(arguments, name) is not None:
            setattr(plan, name, getattr(arguments, name))
    if arguments.memory is not None:
        plan.memory_gib = arguments.memory
    if arguments.builders is not None:
        plan.builders = _choices(arguments.builders, BUILDERS)
    if arguments.device is not None:
        plan.devices = named(arguments.device)
    if arguments.branching is not None:
        words = _choices(arguments.branching, [str(branching) for branching in BRANCHINGS])
        plan.branchings = [_integer("--branching", word) for word in words]
    if arguments.reorder is not None:
        plan.reorders = _choices(arguments.reorder, REORDERS)
    if arguments.layouts is not None:
        plan.layouts = _choices(arguments.layouts, LAYOUTS)
    if arguments.triangle_tests is not None:
        plan.triangle_tests = _choices(arguments.triangle_tests, TRIANGLE_TESTS)
    if arguments.box_tests is not None:
        plan.box_tests = _choices(arguments.box_tests, BOX_TESTS)
    if arguments.views is not None:
        words = _words(arguments.views)
        counted = len(words) == 1 and words[0].isdecimal()
        plan.views = int(words[0]) if counted else words
    if arguments.resolution is not None:
        _set_resolution(plan, arguments.resolution)
    for setting in arguments.param:
        _set_parameter(plan, setting)
    plan.embree, plan.pictures = arguments.embree, arguments.pictures
    plan.check()
    return plan


def _words(text: str) -> list[str]:
    return [word.strip() for word in text.split(",") if word.strip()]


def _choices(text: str, known: Iterable[str]) -> list[str]:
    """The words, or all that are known for the word "all"."""
    words = _words(text)
    return list(known) if words == ["all"] else words


def _integer(option: str, word: str) -> int:
    try:
        return int(word)
    except ValueError:
        raise ValueError(f"{option}: {word!r} is not a whole number") from None


def _set_resolution(plan: Plan, text: str) -> None:
    sides = [_integer("--resolution", side) for side in text.lower().split("x")]
    if len(sides) == 1:
        plan.width, plan.height, plan.long_side = 0, 0, sides[0]
    elif len(sides) == 2 and 0 not in sides:
        plan.width, plan.height = sides
    else:
        raise ValueError(f"--resolution is like 512x384 or 512, not {text!r}")


def _set_parameter(plan: Plan, setting: str) -> None:
    name, equals, value = setting.partition("=")
    builder, dot, parameter = name.partition(".")
    try:
        number = float(value)
    except ValueError:
        number = math.nan
    if not (equals and dot and math.isfinite(number)):
        raise ValueError(f"--param is like sbvh.alpha=1e-5, not {setting!r}")
    plan.params.setdefault(builder, {})[parameter] = number
