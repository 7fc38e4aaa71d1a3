// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/trace.h"

#include <algorithm>
#include <map>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "base/parallel.h"
#include "opencl/reorder.h"

namespace bvhlab::opencl {
namespace {

/// StackEntry of traverse_*_nodes.cl.
constexpr std::size_t stack_entry_bytes = 12;
/// Bytes for what stacks of one launch have beyond their nearest entries.
constexpr std::size_t most_spilled = std::size_t(64) << 20U;

/// Rays by which shapes are compared; fewer than the least tell nothing.
constexpr std::size_t least_trial_rays = std::size_t(1) << 14U;
constexpr std::size_t most_trial_rays = std::size_t(1) << 18U;
/// Persistent threads of a compute unit.
constexpr std::size_t threads_on_gpu = 1024;
constexpr std::size_t threads_on_cpu = 64;

// A watchdog ends kernels that take seconds; a cancel waits for one launch.
constexpr double launch_seconds = 0.25;
constexpr std::size_t least_launch = 4096;

/// Of Box in common.cl.
static_assert(sizeof(Box) == 24 && sizeof(Ray) == 32 && sizeof(Hit) == 16);

void check_tests(const TraceOptions& options) {
    if (options.triangle_test != TriangleTest::watertight)
        throw std::invalid_argument(std::string("OpenCL devices have no triangle test '") +
                                    triangle_test_names[std::size_t(options.triangle_test)] +
                                    "', only 'watertight'; use device cpu for the others");
    if (options.box_test != BoxTest::conservative)
        throw std::invalid_argument(std::string("OpenCL devices have no box test '") +
                                    box_test_names[std::size_t(options.box_test)] +
                                    "', only 'conservative'; use device cpu for the others");
}

std::uint32_t number(std::size_t value) {
    return std::uint32_t(value);
}

// --- launches -----------------------------------------------------------------------------------

/// Calls launch(first, end) for shares of [0, count), each so large that it takes about
/// launch_seconds, as far as `rays_per_second` tells, and waits for it.
template <class Launch>
void in_launches(Commands& commands, std::atomic<double>& rays_per_second, std::size_t count,
                 std::size_t first_launch, std::size_t most, const Launch& launch) {
    commands.finish();
    for (std::size_t first = 0; first < count;) {
        const double rate = rays_per_second.load();
        const double wanted = rate > 0.0 ? rate * launch_seconds : double(first_launch);
        const std::size_t size = std::size_t(
            std::clamp(wanted, double(std::min({least_launch, first_launch, most})), double(most)));
        const std::size_t end = first + std::min(size, count - first);
        const double before = commands.times().kernel_seconds();
        launch(number(first), number(end));
        commands.finish();
        const double seconds = commands.times().kernel_seconds() - before;
        if (seconds > 0.0) rays_per_second = double(end - first) / seconds;
        first = end;
    }
}

// --- tracing ------------------------------------------------------------------------------------

/// One call of trace_rays().
class Tracing {
public:
    Tracing(Commands& commands, const DeviceTree& tree, const Buffer<Ray>& rays,
            const TraceOptions& options, const DeviceHits& hits)
        : commands_(commands), tree_(tree), rays_(rays), options_(options), hits_(hits) {}

    /// Rays order[0..count), or 0..count where there is no order.
    void trace(TraceShape shape, const Buffer<std::uint32_t>* order, std::size_t count) {
        if (options_.count) return trace_carefully(order, 0, count);
        const auto undecided = commands_.buffer<std::uint32_t>(count + 1);
        trace_fast(shape, order, count, undecided);
        trace_carefully(&undecided, 1, commands_.value(undecided, 0));
    }

    /// Seconds that a shape takes for some rays, once its kernel is compiled.
    double trial_seconds(TraceShape shape, const Buffer<std::uint32_t>* order, std::size_t count) {
        const auto undecided = commands_.buffer<std::uint32_t>(count + 1);
        trace_fast(shape, order, count, undecided);
        const double before = commands_.times().kernel_seconds();
        trace_fast(shape, order, count, undecided);
        return commands_.times().kernel_seconds() - before;
    }

private:
    void set_zero(const Buffer<std::uint32_t>& counter) {
        const std::uint32_t zero = 0;
        commands_.upload(std::span<const std::uint32_t>(&zero, 1), counter);
    }

    /// `undecided` receives the number of rays that are left, then those rays.
    void trace_fast(TraceShape shape, const Buffer<std::uint32_t>* order, std::size_t count,
                    const Buffer<std::uint32_t>& undecided) {
        const DeviceInfo& device = commands_.device().info();
        const TraceKernel form = kernel_of(commands_, tree_, shape, options_.any_hit);
        Program program(commands_.device(), form.source);
        Kernel& kernel = program[form.name];
        const Buffer<std::uint32_t> none;
        const auto fetched = commands_.buffer<std::uint32_t>(1);
        const std::size_t most_threads =
            device.compute_units * (device.is_gpu ? threads_on_gpu : threads_on_cpu);
        set_zero(undecided);
        const auto launch = [&](std::uint32_t first, std::uint32_t end, const auto&... more) {
            const std::size_t threads = std::size_t(end - first) * form.threads;
            const Range range(form.fetches ? std::min(threads, most_threads) : threads, form.group);
            commands_.run(kernel, range, tree_.nodes, tree_.leaves, tree_.triangles, tree_.bounds,
                          rays_, order ? *order : none, std::uint32_t(order != nullptr), first, end,
                          hits_.hits, hits_.occluded, undecided, more...);
        };
        // What a team of threads has no room for in local memory.
        const std::size_t groups = form.group ? (most_threads + form.group - 1) / form.group : 0;
        const std::size_t teams = groups * form.group / form.threads;
        const std::size_t far_capacity =
            form.threads == 1
                ? 0
                : std::min(tree_.stack_size - form.stack, most_spilled / stack_entry_bytes / teams);
        const auto far_stacks =
            commands_.buffer<std::byte>(teams * far_capacity * stack_entry_bytes);
        const Local near_stacks{form.group / form.threads * form.stack * stack_entry_bytes};
        in_launches(commands_, tree_.rays_per_second, count,
                    std::size_t(1) << (device.is_gpu ? 20U : 15U), count,
                    [&](std::uint32_t first, std::uint32_t end) {
                        if (!form.fetches) return launch(first, end);
                        set_zero(fetched);
                        if (form.threads == 1) return launch(first, end, fetched);
                        launch(first, end, fetched, near_stacks, number(form.stack), far_stacks,
                               number(far_capacity));
                    });
    }

    /// `order` from `order_first` on.
    void trace_carefully(const Buffer<std::uint32_t>* order, std::uint32_t order_first,
                         std::size_t count) {
        if (count == 0) return;
        const TraceKernel form = careful_kernel_of(commands_.suits_gpu, tree_);
        Program program(commands_.device(), form.source);
        Kernel& kernel = program[form.name];
        const std::size_t capacity = tree_.stack_size > form.stack ? tree_.stack_size : 0;
        const std::size_t bytes = capacity * stack_entry_bytes;
        const std::size_t most =
            bytes ? std::clamp<std::size_t>(most_spilled / bytes, 1, count) : count;
        const auto spilled = commands_.buffer<std::byte>(bytes * most);
        const Buffer<std::uint32_t> none;
        in_launches(commands_, tree_.careful_rays_per_second, count, least_launch, most,
                    [&](std::uint32_t first, std::uint32_t end) {
                        commands_.run(kernel, end - first, tree_.nodes, tree_.leaves,
                                      tree_.triangles, tree_.bounds, rays_, order ? *order : none,
                                      order_first, std::uint32_t(order != nullptr), first, end,
                                      std::uint32_t(options_.any_hit), hits_.hits, hits_.occluded,
                                      std::uint32_t(options_.count), hits_.node_visits,
                                      hits_.box_tests, hits_.triangle_tests, spilled,
                                      std::uint32_t(capacity));
                    });
    }

    Commands& commands_;
    const DeviceTree& tree_;
    const Buffer<Ray>& rays_;
    const TraceOptions& options_;
    const DeviceHits& hits_;
};

// --- shapes -------------------------------------------------------------------------------------

/// The fastest shape so far found, by device and kind of tree.
class Fastest {
public:
    static Fastest& of_process() {
        static Fastest fastest;
        return fastest;
    }

    /// The shape kept for `key`, else the one for which `seconds` is least. Two threads may both
    /// measure: that does no harm.
    template <class Seconds>
    TraceShape of(const std::string& key, const std::vector<TraceShape>& shapes,
                  const Seconds& seconds) {
        {
            const std::scoped_lock lock(mutex_);
            if (const auto known = kept_.find(key); known != kept_.end()) return known->second;
        }
        std::vector<double> all(shapes.size());
        std::ranges::transform(shapes, all.begin(), seconds);
        const auto best = std::ranges::min_element(all) - all.begin();
        const std::scoped_lock lock(mutex_);
        return kept_[key] = shapes[std::size_t(best)];
    }

private:
    std::mutex mutex_;
    std::map<std::string, TraceShape> kept_;
};

/// The shape that is to trace. Throws where the tree does not have it.
TraceShape chosen_shape(TraceShape wanted, Commands& commands, const DeviceTree& tree,
                        const TraceOptions& options, Tracing& tracing,
                        const Buffer<std::uint32_t>* order, std::size_t count) {
    if (options.count) return TraceShape::single;
    const DeviceInfo& device = commands.device().info();
    const std::vector<TraceShape> shapes = shapes_for(tree);
    if (wanted == TraceShape::automatic)
        wanted = device.is_gpu ? TraceShape::measured : TraceShape::single;
    if (wanted == TraceShape::measured && count < least_trial_rays) return shapes.back();
    if (wanted == TraceShape::measured) {
        const std::string key = device.id + " " + std::to_string(tree.branching) +
                                node_layout_names[std::size_t(tree.layout)] +
                                (options.any_hit ? " any" : " closest");
        commands.stage("choosing a shape");
        return Fastest::of_process().of(key, shapes, [&](TraceShape shape) {
            return tracing.trial_seconds(shape, order, std::min(count, most_trial_rays));
        });
    }
    if (std::ranges::find(shapes, wanted) == shapes.end())
        throw std::invalid_argument(
            std::string("a tree of branching factor ") + std::to_string(tree.branching) +
            ", layout " + node_layout_names[std::size_t(tree.layout)] + ", has no trace shape '" +
            trace_shape_names[std::size_t(wanted)] + "'; there are single and " +
            trace_shape_names[std::size_t(shapes.back())]);
    return wanted;
}

// --- host's arrays ------------------------------------------------------------------------------

Buffer<Ray> upload_rays(Commands& commands, const RayBatch& batch, const Token& token) {
    Array<Ray> rays(batch.size());
    parallel_for_each(batch.size(), 65536, token, [&](std::size_t i) { rays[i] = batch[i]; });
    return commands.upload(std::span(rays));
}

template <class T>
Array<T> downloaded(Commands& commands, const Buffer<T>& source, std::size_t count) {
    Array<T> values(count);
    commands.download(source, std::span(values));
    return values;
}

void download_closest(Commands& commands, const Buffer<Hit>& source, std::size_t count, Hits& hits,
                      const Token& token) {
    const Array<Hit> all = downloaded(commands, source, count);
    hits.t.resize(count);
    hits.u.resize(count);
    hits.v.resize(count);
    hits.triangle.resize(count);
    hits.occluded.resize(count);
    parallel_for_each(count, 65536, token, [&](std::size_t i) {
        hits.t[i] = all[i].t;
        hits.u[i] = all[i].u;
        hits.v[i] = all[i].v;
        hits.triangle[i] = all[i].triangle;
        hits.occluded[i] = all[i].triangle != no_triangle;
    });
}

}  // namespace

DeviceHits DeviceHits::with_rays(Commands& commands, std::size_t count,
                                 const TraceOptions& options) {
    DeviceHits hits;
    if (options.any_hit)
        hits.occluded = commands.buffer<std::uint8_t>(count);
    else
        hits.hits = commands.buffer<Hit>(count);
    if (options.count) {
        hits.node_visits = commands.buffer<std::uint32_t>(count);
        hits.box_tests = commands.buffer<std::uint32_t>(count);
        hits.triangle_tests = commands.buffer<std::uint32_t>(count);
    }
    return hits;
}

TraceShape trace_rays(Commands& commands, const DeviceTree& tree, const Buffer<Ray>& rays,
                      std::size_t count, const TraceOptions& options, const char* stage,
                      const DeviceHits& hits, TraceShape shape) {
    check_tests(options);
    std::optional<Buffer<std::uint32_t>> sorted;
    if (options.reorder != Reorder::off && count != 0)
        sorted = order_rays(commands, rays, count, options.reorder, tree.bounds);
    const Buffer<std::uint32_t>* const order = sorted ? &*sorted : nullptr;
    Tracing tracing(commands, tree, rays, options, hits);
    const TraceShape chosen = chosen_shape(shape, commands, tree, options, tracing, order, count);
    commands.stage(stage);
    if (count != 0) tracing.trace(chosen, order, count);
    return chosen;
}

ShapedHits trace(Commands& commands, const Bvh&, const DeviceTree& tree, const RayBatch& rays,
                 const TraceOptions& options, Token& token, TraceShape shape) {
    check_tests(options);
    token.begin("tracing");
    const std::size_t count = rays.size();
    const Buffer<Ray> device_rays = upload_rays(commands, rays, token);
    const DeviceHits answers = DeviceHits::with_rays(commands, count, options);
    commands.finish();
    const Times before = commands.times();
    ShapedHits hits;
    hits.shape =
        trace_rays(commands, tree, device_rays, count, options, "traverse", answers, shape);
    commands.finish();

    const auto seconds = [&](const char* stage) {
        return commands.times().stage_seconds(stage) - before.stage_seconds(stage);
    };
    hits.key_seconds = seconds("key");
    hits.sort_seconds = seconds("sort");
    hits.traverse_seconds = seconds("traverse");
    if (options.any_hit)
        hits.occluded = downloaded(commands, answers.occluded, count);
    else
        download_closest(commands, answers.hits, count, hits, token);
    if (options.count) {
        hits.node_visits = downloaded(commands, answers.node_visits, count);
        hits.box_tests = downloaded(commands, answers.box_tests, count);
        hits.triangle_tests = downloaded(commands, answers.triangle_tests, count);
    }
    token.advance(1.0F);
    return hits;
}

}  // namespace bvhlab::opencl
