// SPDX-License-Identifier: GPL-3.0-or-later
// libFuzzer target: any bytes are a mesh, a builder with parameters, a layout and rays. Bad ones
// must be refused by std::invalid_argument; for the others the tree must be valid and give the
// exact hits, bit for bit those of another tree. Anything else aborts, and the sanitizers watch.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "base/parallel.h"
#include "build/builder.h"
#include "bvh/collapse.h"
#include "bvh/validate.h"
#include "fuzz_input.h"
#include "reference/brute_force.h"
#include "reference/crossings.h"
#include "trace/trace.h"

namespace bvhlab {
namespace {

/// Up to here a rounded t is within a few ulp of the exact one: each of float's roundings is
/// magnified by the condition number.
constexpr double well_conditioned = 0x1p20;

void require(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "fuzz_core: %s\n", what);
    std::abort();
}

/// Every builder runs with small numbers of iterations and of references, and no limit of time,
/// which depends on the machine.
Parameters random_parameters(const BuilderInfo& builder, FuzzInput& input) {
    Parameters parameters;
    for (const ParameterInfo& info : builder.parameters) {
        if (info.name == "max_seconds") continue;
        const unsigned choice = input.byte(), step = input.byte();
        const double most = info.name == "iterations"       ? 40.0
                            : info.name == "max_references" ? 64.0
                                                            : info.maximum;
        double value = std::min(info.default_value, most);
        if (choice % 4 == 1) value = std::min(info.minimum + step, most);
        if (choice % 4 == 2) value = info.minimum + (most - info.minimum) * (step / 255.0);
        parameters[std::string(info.name)] = info.integer ? std::floor(value) : value;
    }
    return check_parameters(builder, parameters);
}

Bvh random_bvh(const std::shared_ptr<const Mesh>& mesh, FuzzInput& input, Token& token) {
    const BuilderInfo& builder = builders()[input.byte() % builders().size()];
    const CostModel model{input.byte() % 2 ? 3.0 : 1e-3, input.byte() % 2 ? 2.0 : 1e3};
    BuildLog log;
    const BinaryBvh binary =
        builder.build(*mesh, model, random_parameters(builder, input), token, log);
    validate(binary, *mesh);
    const unsigned layout = input.byte() % 4;
    return layout == 3 ? compress(binary, mesh, model, token)
                       : collapse(binary, mesh, 2U << layout, model, token);
}

template <class Value>
bool same_bits(const Array<Value>& a, const Array<Value>& b) {
    return a.size() == b.size() &&
           (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(Value)) == 0);
}

void require_same(const Hits& a, const Hits& b) {
    require(a.triangle == b.triangle && a.occluded == b.occluded, "two trees differ in a triangle");
    require(same_bits(a.t, b.t) && same_bits(a.u, b.u) && same_bits(a.v, b.v),
            "two trees differ in t, u or v");
}

/// Hit or miss is exactly that of brute force; the triangle is met, lies in the interval, and none
/// is nearer by more than the rounding of t.
void require_exact(const Mesh& mesh, const RayBatch& rays, const Hits& hits, Token& token) {
    const HitsOf<double> truth = brute_force(mesh, rays, false, 1, token);
    require(hits.occluded == truth.occluded, "hit or miss is not the exact answer");
    Array<std::uint32_t> ours = hits.triangle, nearest = truth.triangle;
    std::ranges::replace(ours, no_triangle, 0U);
    std::ranges::replace(nearest, no_triangle, 0U);
    const Crossings answered = crossings(mesh, rays, ours, 1, token);
    const Crossings first = crossings(mesh, rays, nearest, 1, token);
    for (std::size_t i = 0; i < rays.size(); ++i) {
        if (!hits.occluded[i]) continue;
        const Ray ray = rays[i];
        require(answered.meets[i], "the answered triangle is not met");
        require(ray.t_min <= hits.t[i] && hits.t[i] <= ray.t_max, "t is not in its interval");
        if (answered.condition[i] > well_conditioned || first.condition[i] > well_conditioned)
            continue;
        const double ulp = std::max(0x1p-23 * std::abs(truth.t[i]), 0x1p-149);
        require(answered.t[i] - truth.t[i] <= 2.0 * ulp, "a nearer triangle was passed over");
        require(std::abs(double(hits.t[i]) - answered.t[i]) <= 4.0 * ulp, "t is off");
    }
}

/// The other tests may be wrong, but must name a triangle there is.
void require_sane(const Mesh& mesh, const Hits& hits) {
    for (const std::uint32_t triangle : hits.triangle)
        require(triangle < mesh.size() || triangle == no_triangle, "no such triangle");
}

void run(FuzzInput& input) {
    Token token;
    std::shared_ptr<const Mesh> mesh;
    try {
        mesh = std::make_shared<const Mesh>(input.mesh());
    } catch (const std::invalid_argument&) {
        return;
    }
    const Bvh bvh = random_bvh(mesh, input, token), other = random_bvh(mesh, input, token);
    validate(bvh);
    validate(other);

    TraceOptions options{.count = input.byte() % 2 == 0, .threads = 1};
    options.reorder = Reorder(input.byte() % reorder_names.size());
    const FuzzRays rays = input.rays(*mesh);
    if (rays.origins.empty()) return;
    const Hits hits = trace(bvh, rays.batch(), options, token);
    require_same(hits, trace(other, rays.batch(), {.threads = 1}, token));
    require_exact(*mesh, rays.batch(), hits, token);

    options.any_hit = true;
    require(trace(bvh, rays.batch(), options, token).occluded == hits.occluded,
            "any hit differs from the closest");
    const TraceOptions published{
        .threads = 1,
        .triangle_test = TriangleTest(input.byte() % triangle_test_names.size()),
        .box_test = BoxTest(input.byte() % box_test_names.size())};
    require_sane(*mesh, trace(bvh, rays.batch(), published, token));
}

}  // namespace
}  // namespace bvhlab

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    bvhlab::FuzzInput input(data, size);
    bvhlab::with_threads(1, [&] { bvhlab::run(input); });
    return 0;
}
