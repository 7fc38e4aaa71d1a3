// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/embree.h"

#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>

#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include "base/parallel.h"
#include "reference/embree_library.h"

namespace bvhlab {
namespace {

constexpr std::size_t rays_per_chunk = 1024;

struct EmbreeFile {
    const char* name;
    int major;
};
constexpr EmbreeFile embree_files[] = {
    {"libembree4.so.4", 4}, {"libembree4.so", 4}, {"libembree3.so.3", 3}, {"libembree3.so", 3}};

/// What the search for Embree found: a library, and what was passed over on the way.
struct Search {
    std::optional<EmbreeLibrary> library;
    std::string refused;
};

Search find_embree() {
    Search search;
    for (const EmbreeFile& file : embree_files) {
        try {
            std::optional<EmbreeLibrary> library = open_embree(file.name, file.major);
            if (!library) continue;
            check_known_rays(*library);
            search.library = std::move(library);
            return search;
        } catch (const std::runtime_error& problem) {
            search.refused += (search.refused.empty() ? "" : "; ") + std::string(problem.what());
        }
    }
    return search;
}

/// The one library of this process.
const Search& embree_search() {
    static const Search search = find_embree();
    return search;
}

const EmbreeLibrary& embree_library() {
    const EmbreeStatus status = embree_status();
    if (!status.available) throw std::runtime_error(status.reason);
    return *embree_search().library;
}

void check_device(const EmbreeLibrary& library, embree::Device device, const char* doing) {
    constexpr const char* errors[] = {"no error",          "unknown error", "invalid argument",
                                      "invalid operation", "out of memory", "unsupported processor",
                                      "cancelled"};
    const int error = library.device_error(device);
    if (error == 0) return;
    const std::string text =
        error > 0 && error < int(std::size(errors)) ? errors[error] : std::to_string(error);
    throw std::runtime_error(std::string("Embree failed while ") + doing + ": " + text);
}

/// Embree's advice for every thread that traces: denormal numbers count as 0. Puts the mode back at
/// the end.
class FlushDenormals {
public:
#ifdef __SSE__
    FlushDenormals() : before_(_mm_getcsr()) {
        _mm_setcsr(before_ | 0x8040U);
    }
    ~FlushDenormals() {
        _mm_setcsr(before_);
    }

private:
    unsigned before_;
#else
    FlushDenormals() {}
#endif
};

embree::Ray embree_ray(const Ray& ray) {
    embree::Ray result;
    std::memcpy(result.origin, &ray.origin, sizeof(result.origin));
    std::memcpy(result.direction, &ray.direction, sizeof(result.direction));
    result.t_min = ray.t_min;
    result.t_max = ray.t_max;
    return result;
}

}  // namespace

/// Embree's device and scene with the one mesh in it, built.
class CommittedMesh {
public:
    CommittedMesh(const EmbreeLibrary& library, const Mesh& mesh, EmbreeQuality quality,
                  bool robust, int threads)
        : library_(library), device_(library.new_device(nullptr), library.release_device) {
        check_device(library_, device_.get(), "making a device");
        scene_ = {library_.new_scene(device_.get()), library_.release_scene};
        check_device(library_, device_.get(), "making a scene");
        library_.set_scene_flags(scene_.get(), robust ? embree::scene_robust : 0);
        library_.set_scene_quality(scene_.get(), embree_quality(quality));
        attach(mesh, embree_quality(quality));
        commit(threads);
    }

    double seconds() const { return seconds_; }

    Hit intersect(const Ray& ray) const {
        embree::RayHit answer{embree_ray(ray), {}};
        if (library_.major == 3) {
            embree::Context3 context;
            library_.intersect3(scene_.get(), &context, &answer);
        } else {
            library_.intersect4(scene_.get(), &answer, nullptr);
        }
        if (answer.hit.geometry == embree::invalid_id)
            return {std::numeric_limits<float>::infinity(), 0.0F, 0.0F, no_triangle};
        return {answer.ray.t_max, answer.hit.u, answer.hit.v, answer.hit.triangle};
    }

    bool occluded(const Ray& ray) const {
        embree::Ray answer = embree_ray(ray);
        if (library_.major == 3) {
            embree::Context3 context;
            library_.occluded3(scene_.get(), &context, &answer);
        } else {
            library_.occluded4(scene_.get(), &answer, nullptr);
        }
        return answer.t_max == -std::numeric_limits<float>::infinity();
    }

private:
    template <class Tag>
    using Handle = std::unique_ptr<Tag, void (*)(Tag*)>;

    static int embree_quality(EmbreeQuality quality) {
        switch (quality) {
            case EmbreeQuality::low:
                return embree::quality_low;
            case EmbreeQuality::medium:
                return embree::quality_medium;
            case EmbreeQuality::high:
                return embree::quality_high;
        }
        throw std::logic_error("no such Embree quality");
    }

    /// Copies the mesh into buffers of Embree's: a shared one would need padding behind its last
    /// vertex.
    void attach(const Mesh& mesh, int quality) {
        const Handle<embree::GeometryTag> geometry(
            library_.new_geometry(device_.get(), embree::triangle_geometry),
            library_.release_geometry);
        const auto fill = [&](int buffer, int format, const auto& items) {
            void* memory = library_.new_buffer(geometry.get(), buffer, 0, format, sizeof(items[0]),
                                               items.size());
            check_device(library_, device_.get(), "copying the mesh");
            std::memcpy(memory, items.data(), items.size() * sizeof(items[0]));
        };
        fill(embree::vertex_buffer, embree::format_float3, mesh.vertices);
        fill(embree::index_buffer, embree::format_uint3, mesh.triangles);
        library_.set_geometry_quality(geometry.get(), quality);
        library_.commit_geometry(geometry.get());
        library_.attach_geometry(scene_.get(), geometry.get());
        check_device(library_, device_.get(), "adding the mesh");
    }

    /// A device made with "threads=n" would limit every user of oneTBB in the process as long as it
    /// lives; this limits them for the time of the build only.
    void commit(int threads) {
        std::optional<tbb::global_control> limit;
        if (threads > 0)
            limit.emplace(tbb::global_control::max_allowed_parallelism, std::size_t(threads));
        const Stopwatch watch;
        library_.commit_scene(scene_.get());
        seconds_ = watch.seconds();
        check_device(library_, device_.get(), "building");
    }

    const EmbreeLibrary& library_;
    Handle<embree::DeviceTag> device_;
    Handle<embree::SceneTag> scene_{nullptr, nullptr};
    double seconds_ = 0.0;
};

void check_known_rays(const EmbreeLibrary& library) {
    const Mesh mesh =
        make_mesh({{0.0F, 0.0F, 2.0F}, {4.0F, 0.0F, 2.0F}, {0.0F, 4.0F, 2.0F}}, {{0, 1, 2}});
    const CommittedMesh scene(library, mesh, EmbreeQuality::medium, true, 1);
    const auto ray_at = [](float x) {
        return Ray{
            {x, 2.0F, 0.0F}, 0.0F, {0.0F, 0.0F, 1.0F}, std::numeric_limits<float>::infinity()};
    };
    const auto is = [](float value, float expected) { return std::abs(value - expected) < 1e-5F; };
    const Hit hit = scene.intersect(ray_at(1.0F));
    const bool hit_right = hit.triangle == 0 && is(hit.t, 2.0F) && is(hit.u, 0.25F) &&
                           is(hit.v, 0.5F) && scene.occluded(ray_at(1.0F));
    const bool miss_right =
        scene.intersect(ray_at(3.0F)).triangle == no_triangle && !scene.occluded(ray_at(3.0F));
    if (!hit_right || !miss_right)
        throw std::runtime_error("Embree " + library.version +
                                 " was refused: it answers a known ray wrongly");
}

EmbreeStatus embree_status() {
    const Search& search = embree_search();
    if (search.library) return {true, search.library->version, search.refused};
    if (!search.refused.empty()) return {false, "", search.refused};
    std::string names;
    for (const EmbreeFile& file : embree_files)
        names += (names.empty() ? "" : ", ") + std::string(file.name);
    return {false, "", "Embree is not installed: none of " + names + " can be opened"};
}

EmbreeScene::EmbreeScene(const Mesh& mesh, EmbreeQuality quality, bool robust, int threads)
    : committed_(std::make_unique<const CommittedMesh>(embree_library(), mesh, quality, robust,
                                                       threads)) {}

EmbreeScene::~EmbreeScene() = default;

double EmbreeScene::build_seconds() const {
    return committed_->seconds();
}

Hits EmbreeScene::trace(const RayBatch& rays, bool any_hit, int threads, Token& token) const {
    token.begin("Embree");
    const std::size_t closest = any_hit ? 0 : rays.size();
    Hits hits;
    hits.t = Array<float>(closest);
    hits.u = Array<float>(closest);
    hits.v = Array<float>(closest);
    hits.triangle = Array<std::uint32_t>(closest);
    hits.occluded = Array<std::uint8_t>(rays.size());

    const auto trace_one = [&](std::size_t i) {
        if (any_hit) {
            hits.occluded[i] = committed_->occluded(rays[i]);
            return;
        }
        const Hit hit = committed_->intersect(rays[i]);
        hits.t[i] = hit.t;
        hits.u[i] = hit.u;
        hits.v[i] = hit.v;
        hits.triangle[i] = hit.triangle;
        hits.occluded[i] = hit.triangle != no_triangle;
    };
    const Stopwatch watch;
    with_threads(threads, [&] {
        const std::size_t chunks = (rays.size() + rays_per_chunk - 1) / rays_per_chunk;
        parallel_for_each(chunks, 1, token, [&](std::size_t chunk) {
            const FlushDenormals mode;
            const std::size_t begin = chunk * rays_per_chunk;
            const std::size_t end = std::min(begin + rays_per_chunk, rays.size());
            for (std::size_t i = begin; i < end; ++i) trace_one(i);
        });
    });
    hits.traverse_seconds = watch.seconds();
    return hits;
}

}  // namespace bvhlab
