// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

namespace bvhlab {

// The part of Embree's C interface that we use, declared here so that one build works with Embree 3
// and 4, whichever headers are installed. Checked against rtcore*.h of 3.13.5 and of 4.3.3; the
// values below are the same in both.
namespace embree {

inline constexpr std::uint32_t invalid_id = 0xFFFFFFFFU;   // RTC_INVALID_GEOMETRY_ID
inline constexpr int device_version = 0;                   // RTC_DEVICE_PROPERTY_VERSION
inline constexpr int triangle_geometry = 0;                // RTC_GEOMETRY_TYPE_TRIANGLE
inline constexpr int index_buffer = 0, vertex_buffer = 1;  // RTC_BUFFER_TYPE_*
inline constexpr int format_uint3 = 0x5003;                // RTC_FORMAT_UINT3
inline constexpr int format_float3 = 0x9003;               // RTC_FORMAT_FLOAT3
inline constexpr int quality_low = 0, quality_medium = 1, quality_high = 2;  // RTC_BUILD_QUALITY_*
inline constexpr int scene_robust = 4;  // RTC_SCENE_FLAG_ROBUST

using Device = struct DeviceTag*;
using Scene = struct SceneTag*;
using Geometry = struct GeometryTag*;

/// RTCRay: 48 bytes.
struct alignas(16) Ray {
    float origin[3];
    float t_min;
    float direction[3];
    float time = 0.0F;
    float t_max;  ///< becomes t of the hit; -infinity where rtcOccluded1 found one
    std::uint32_t mask = 0xFFFFFFFFU;
    std::uint32_t id = 0;
    std::uint32_t flags = 0;
};
static_assert(sizeof(Ray) == 48);

/// RTCHit: 32 bytes in Embree 3, 48 in Embree 4 with instance arrays. Instance numbers come last,
/// one or two for each level of instancing that the library was built for; there is room for eight
/// levels.
struct alignas(16) Hit {
    float normal[3];
    float u, v;
    std::uint32_t triangle;
    std::uint32_t geometry = invalid_id;
    std::uint32_t instance[17];
};
static_assert(sizeof(Hit) == 96);

struct RayHit {
    Ray ray;
    Hit hit;
};

/// RTCIntersectContext of Embree 3: 24 bytes, more for more levels of instancing.
struct Context3 {
    int flags = 0;  // RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT
    void* filter = nullptr;
    std::uint32_t instance[18] = {invalid_id};
};
static_assert(offsetof(Context3, instance) == 16);

}  // namespace embree

/// Embree's functions, found at run time in a library opened with local scope.
///
/// We never link Embree: its symbols carry no version, and in a Blender that has another Embree in
/// the global scope a linked module would run that one behind the wrong headers, and miss with
/// every ray.
struct EmbreeLibrary {
    int major = 0;        ///< 3 or 4
    std::string version;  ///< e.g. "4.4.0"

    embree::Device (*new_device)(const char* config) = nullptr;
    void (*release_device)(embree::Device) = nullptr;
    std::ptrdiff_t (*device_property)(embree::Device, int property) = nullptr;
    int (*device_error)(embree::Device) = nullptr;
    embree::Geometry (*new_geometry)(embree::Device, int type) = nullptr;
    void* (*new_buffer)(embree::Geometry, int type, unsigned slot, int format, std::size_t stride,
                        std::size_t count) = nullptr;
    void (*set_geometry_quality)(embree::Geometry, int quality) = nullptr;
    void (*commit_geometry)(embree::Geometry) = nullptr;
    void (*release_geometry)(embree::Geometry) = nullptr;
    embree::Scene (*new_scene)(embree::Device) = nullptr;
    void (*set_scene_flags)(embree::Scene, int flags) = nullptr;
    void (*set_scene_quality)(embree::Scene, int quality) = nullptr;
    unsigned (*attach_geometry)(embree::Scene, embree::Geometry) = nullptr;
    void (*commit_scene)(embree::Scene) = nullptr;
    void (*release_scene)(embree::Scene) = nullptr;

    // Embree 4 dropped the context and put optional arguments last.
    void (*intersect3)(embree::Scene, embree::Context3*, embree::RayHit*) = nullptr;
    void (*occluded3)(embree::Scene, embree::Context3*, embree::Ray*) = nullptr;
    void (*intersect4)(embree::Scene, embree::RayHit*, void* arguments) = nullptr;
    void (*occluded4)(embree::Scene, embree::Ray*, void* arguments) = nullptr;
};

/// Opens `file` as Embree of version `major` (3 or 4) and checks the version that it reports. The
/// library stays open to the end of the process. Nothing where the file cannot be opened. Throws
/// std::runtime_error naming the file where it lacks a function or is another version.
std::optional<EmbreeLibrary> open_embree(const char* file, int major);

/// "4.3.3" for 40303, the form in which Embree reports its version.
std::string embree_version_text(std::ptrdiff_t version);

/// Throws std::runtime_error unless the reported version is one of `major`.
void check_embree_version(std::ptrdiff_t version, int major);

}  // namespace bvhlab
