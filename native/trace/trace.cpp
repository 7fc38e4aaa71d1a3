// SPDX-License-Identifier: GPL-3.0-or-later
#include "trace/trace.h"

#include <tbb/enumerable_thread_specific.h>

#include <atomic>

#include "base/parallel.h"
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
                  const std::uint32_t* order, Hits& hits, Token& token) {
    tbb::enumerable_thread_specific<std::vector<StackEntry>> stacks(
        [&] { return std::vector<StackEntry>(stack_size(bvh)); });
    std::atomic<std::size_t> finished{0};
    tbb::parallel_for(
        tbb::blocked_range<std::size_t>(0, rays.size(), rays_per_task),
        [&](const tbb::blocked_range<std::size_t>& range) {
            token.check();
            traverse({&bvh, &rays, order, range.begin(), range.end(), options.any_hit,
                      options.count, &hits, &stacks.local()});
            const std::size_t done = finished.fetch_add(range.size()) + range.size();
            token.advance(float(done) / float(rays.size()));
        },
        tbb::simple_partitioner{});
}

}  // namespace

Hits trace(const Bvh& bvh, const RayBatch& rays, const TraceOptions& options, Token& token) {
    token.begin("tracing");
    Hits hits = make_hits(rays.size(), options);
    with_threads(options.threads, [&] {
        RayOrder ordered{};
        const bool reorder = options.reorder != Reorder::off;
        if (reorder) ordered = order_rays(options.reorder, rays, bvh.mesh->bounds, token);
        hits.key_seconds = ordered.key_seconds;
        hits.sort_seconds = ordered.sort_seconds;
        const Stopwatch watch;
        traverse_all(bvh, rays, options, reorder ? ordered.order.data() : nullptr, hits, token);
        hits.traverse_seconds = watch.seconds();
    });
    return hits;
}

}  // namespace bvhlab
