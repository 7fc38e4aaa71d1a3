// SPDX-License-Identifier: GPL-3.0-or-later
#include "reference/embree_library.h"

#include <dlfcn.h>

#include <stdexcept>

namespace bvhlab {
namespace {

template <class Function>
void find(void* library, const char* name, Function*& function) {
    function = reinterpret_cast<Function*>(dlsym(library, name));
    if (!function) throw std::runtime_error(std::string("it lacks the function ") + name);
}

void find_functions(void* library, EmbreeLibrary& embree) {
    find(library, "rtcNewDevice", embree.new_device);
    find(library, "rtcReleaseDevice", embree.release_device);
    find(library, "rtcGetDeviceProperty", embree.device_property);
    find(library, "rtcGetDeviceError", embree.device_error);
    find(library, "rtcNewGeometry", embree.new_geometry);
    find(library, "rtcSetNewGeometryBuffer", embree.new_buffer);
    find(library, "rtcSetGeometryBuildQuality", embree.set_geometry_quality);
    find(library, "rtcCommitGeometry", embree.commit_geometry);
    find(library, "rtcReleaseGeometry", embree.release_geometry);
    find(library, "rtcNewScene", embree.new_scene);
    find(library, "rtcSetSceneFlags", embree.set_scene_flags);
    find(library, "rtcSetSceneBuildQuality", embree.set_scene_quality);
    find(library, "rtcAttachGeometry", embree.attach_geometry);
    find(library, "rtcCommitScene", embree.commit_scene);
    find(library, "rtcReleaseScene", embree.release_scene);
    if (embree.major == 3) {
        find(library, "rtcIntersect1", embree.intersect3);
        find(library, "rtcOccluded1", embree.occluded3);
    } else {
        find(library, "rtcIntersect1", embree.intersect4);
        find(library, "rtcOccluded1", embree.occluded4);
    }
}

/// The version that the library's own device reports.
std::ptrdiff_t reported_version(const EmbreeLibrary& embree) {
    const embree::Device device = embree.new_device(nullptr);
    if (!device)
        throw std::runtime_error("it cannot make a device (error " +
                                 std::to_string(embree.device_error(nullptr)) + ")");
    const std::ptrdiff_t version = embree.device_property(device, embree::device_version);
    embree.release_device(device);
    return version;
}

}  // namespace

std::string embree_version_text(std::ptrdiff_t version) {
    return std::to_string(version / 10000) + "." + std::to_string(version / 100 % 100) + "." +
           std::to_string(version % 100);
}

void check_embree_version(std::ptrdiff_t version, int major) {
    if (version / 10000 != major)
        throw std::runtime_error("it reports version " + embree_version_text(version) + " where " +
                                 std::to_string(major) + " was expected");
}

std::optional<EmbreeLibrary> open_embree(const char* file, int major) {
    // Local scope: our Embree must not become anyone else's. RTLD_DEEPBIND would abort Debian's
    // Blender, whose allocator is jemalloc.
    void* library = dlopen(file, RTLD_NOW | RTLD_LOCAL);
    if (!library) return std::nullopt;
    EmbreeLibrary embree;
    embree.major = major;
    try {
        find_functions(library, embree);
        const std::ptrdiff_t version = reported_version(embree);
        check_embree_version(version, major);
        embree.version = embree_version_text(version);
    } catch (const std::runtime_error& problem) {
        throw std::runtime_error(std::string(file) + " was refused: " + problem.what());
    }
    return embree;
}

}  // namespace bvhlab
