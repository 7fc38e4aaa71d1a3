// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include "base/array.h"
#include "base/token.h"
#include "scene/box.h"
#include "trace/ray.h"

namespace bvhlab {

/// The order in which to trace rays, and what finding it took.
struct RayOrder {
    Array<std::uint32_t> order;
    double key_seconds, sort_seconds;
};

/// Sorts rays along a Morton curve through origin and direction: the compacted key of Aila that the
/// paper uses (section 3; Meister et al. 2020), 32 bits: 7 levels of the origin and 3 2/3 of the
/// direction. Rays are not moved; equal keys keep their order.
RayOrder order_rays(const RayBatch& rays, const Box& bounds, const Token& token);

}  // namespace bvhlab
