# SPDX-License-Identifier: GPL-3.0-or-later
"""How a study measures, in words."""

from __future__ import annotations

from .devices import CPU
from .plan import Plan


def method(plan: Plan) -> list[str]:
    """What was measured and how, a sentence each."""
    judged = f"{plan.judged_rays} rays of each view and kind"
    pictured = "" if plan.all_exact() else ", with the default tests only"
    builds = f"median of {plan.build_repeats} builds" if plan.build_repeats > 1 else "one build"
    lines = [
        f"Speed: MRays/s from the median of {plan.repeats} timed runs after a warm-up, all "
        "variants interleaved; the arithmetic mean over the views, as in the paper. ± is half the "
        "distance between the quartiles. Sort keys, sorting and traversal are included, generating "
        "the rays is not.",
        "Rays: those that the path tracer traces for one path of each pixel, generated once and "
        "traced by every variant, bounce by bounce; paths that have ended have none. Primary: "
        "closest hit, from the camera. Secondary: closest hit, from a hit on, in directions that "
        f"the material scatters to, for {plan.depth} bounces. Shadow: any hit, {plan.shadow_rays} "
        "towards sampled lights from each hit where light can be found so.",
        "Visits, boxes, triangles: interior nodes visited, their children's boxes tested and "
        "triangles tested, per ray, counted in a run of their own.",
    ]
    if set(plan.reorders) != {"off"}:
        lines.append(
            "Rays reordered: secondary and shadow rays of a bounce are sorted by a key of 32 bits "
            "(Meister et al. 2020; aila is the paper's) and traced in that order; primary rays are "
            "not. % sorting: what keys and sorting take of the time."
        )
    if set(plan.devices) != {CPU}:
        lines.append(
            "OpenCL devices: keys, sorting and traversal are timed by the device's own clock, "
            "kernels alone. Builds are timed by the wall clock from the first command to the last, "
            "after one that is not. Copying to the device and back, and compiling programs, are in "
            "no time (CSV and JSON have them apart)."
        )
    if plan.target_error:
        lines.append(
            f"Time to relMSE {plan.target_error:g}: of the first view's picture, without building "
            "the tree. The samples needed, the same for all variants as their pictures are equal, "
            "come from pictures of 1, 2, 4, ... samples against a converged reference of other "
            "random numbers, interpolated on log-log axes; the seconds are those samples times the "
            "variant's seconds per sample in its one render of its picture (no repeats)."
        )
    return [
        *lines,
        f"Build: {builds}, binary tree and collapse together.",
        "BVH cost: Eq. 2 (binary) and 3 (wide) of Meister & Bittner 2022 with c_T = "
        f"{plan.traversal:g}, c_I = {plan.intersection:g}.",
        f"Wrong hits: against brute force, decided in exact arithmetic, on {judged}; two triangles "
        "at exactly the same distance are both right. Differing rays: against the answers of the "
        "default tests, bit for bit, over all rays; for Embree and other tests by the rule for "
        "wrong hits. Errors of t, u and v (web page and CSV): where the right triangle was hit, "
        "against its exact crossing; t in units in the last place (ulp) of float32.",
        f"Picture: path traced, {plan.samples} samples per pixel, depth {plan.depth}, "
        f"{plan.shadow_rays} shadow rays a hit{pictured}; the difference is the largest of any "
        "channel (linear) to the first variant's on the same device.",
    ]
