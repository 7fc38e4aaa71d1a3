// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/trace.h"

#include <tbb/enumerable_thread_specific.h>

#include <atomic>
#include <stdexcept>

#include "base/parallel.h"
#include "trace/transforms.h"
#include "trace/traverse.h"

namespace bvhlab {
namespace {

constexpr std::size_t rays_per_task = 1024;

Hits make_hits(std::size_t rays, const TraceOptions& options) {
    Hits hits;
    hits.occluded.resize(rays);
    if (!options.any_hit) {
        hits.t.resize(rays);
        hits.u.resize(rays);
        hits.v.resize(rays);
        hits.triangle.resize(rays);
    }
    if (options.count) {
        hits.node_visits.resize(rays);
        hits.box_tests.resize(rays);
        hits.triangle_tests.resize(rays);
    }
    return hits;
}

void traverse_all(const Bvh& bvh, const RayBatch& rays, const TraceOptions& options,
                  const std::uint32_t* order, const TriangleTransforms* transforms, Hits& hits,
                  Token& token) {
    tbb::enumerable_thread_specific<std::vector<StackEntry>> stacks(
        [&] { return std::vector<StackEntry>(stack_size(bvh)); });
    std::atomic<std::size_t> finished{0};
    parallel_for_ranges(0, rays.size(), rays_per_task, [&](const IndexRange& range) {
        token.check();
        traverse({&bvh, &rays, order, range.begin(), range.end(), options.any_hit, options.count,
                  options.triangle_test, options.box_test, transforms, &hits, &stacks.local()});
        const std::size_t done = finished.fetch_add(range.size()) + range.size();
        token.advance(float(done) / float(rays.size()));
    });
}

/// Index of `name` in `names`; throws naming what `kind` there are.
template <std::size_t N>
std::size_t index_named(const std::array<const char*, N>& names, const std::string& name,
                        const char* kind) {
    std::string known;
    for (std::size_t i = 0; i < N; ++i) {
        if (name == names[i]) return i;
        known += std::string(i ? ", " : "") + names[i];
    }
    throw std::invalid_argument("unknown " + std::string(kind) + " '" + name +
                                "'; there are: " + known);
}

}  // namespace

TriangleTest triangle_test_named(const std::string& name) {
    return TriangleTest(index_named(triangle_test_names, name, "triangle test"));
}

BoxTest box_test_named(const std::string& name) {
    return BoxTest(index_named(box_test_names, name, "box test"));
}

Hits trace(const Bvh& bvh, const RayBatch& rays, const TraceOptions& options, Token& token) {
    token.begin("tracing");
    Hits hits = make_hits(rays.size(), options);
    with_threads(options.threads, [&] {
        RayOrder ordered{};
        const bool reorder = options.reorder != Reorder::off;
        if (reorder) ordered = order_rays(options.reorder, rays, bvh.mesh->bounds, token);
        hits.key_seconds = ordered.key_seconds;
        hits.sort_seconds = ordered.sort_seconds;
        const Stopwatch prepare_watch;
        const auto transforms = triangle_transforms(bvh, options.triangle_test, token);
        hits.prepare_seconds = transforms ? prepare_watch.seconds() : 0.0;
        hits.prepared_bytes = transforms ? transforms->bytes() : 0;
        const Stopwatch watch;
        traverse_all(bvh, rays, options, reorder ? ordered.order.data() : nullptr, transforms.get(),
                     hits, token);
        hits.traverse_seconds = watch.seconds();
    });
    return hits;
}

}  // namespace bvhlab
