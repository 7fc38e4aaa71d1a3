// SPDX-License-Identifier: GPL-3.0-or-later
#pragma once

#include <memory>
#include <string>

#include "base/token.h"
#include "scene/mesh.h"
#include "trace/ray.h"

namespace bvhlab {

struct EmbreeLibrary;
class CommittedMesh;

/// Whether Embree can be used in this process.
struct EmbreeStatus {
    bool available;
    std::string version;  ///< e.g. "4.4.0"; empty where not available
    std::string reason;   ///< why it is not available, or which library was passed over; else empty
};

/// Opens Embree 4, else 3, at the first call; later calls give the same answer.
EmbreeStatus embree_status();

/// How long Embree may take to build: Morton codes, binned SAH, or SAH with spatial splits.
enum class EmbreeQuality { low, medium, high };

/// One mesh in Embree, the outside reference for build time and speed.
class EmbreeScene {
public:
    /// `robust` makes Embree's box and triangle tests watertight, as ours are. `threads` 0 means
    /// all. Throws std::runtime_error where Embree is not available or fails.
    EmbreeScene(const Mesh& mesh, EmbreeQuality quality, bool robust, int threads);
    ~EmbreeScene();
    EmbreeScene(const EmbreeScene&) = delete;
    EmbreeScene& operator=(const EmbreeScene&) = delete;

    /// Wall-clock seconds of rtcCommitScene alone: without copying the mesh, as for our builders.
    double build_seconds() const;

    /// Traces each ray with rtcIntersect1 or rtcOccluded1, in chunks as our own tracing does. Rays
    /// must be finite: Embree does not bear NaN. Throws Cancelled.
    Hits trace(const RayBatch& rays, bool any_hit, int threads, Token& token) const;

private:
    std::unique_ptr<const CommittedMesh> committed_;
};

/// Traces one known hit and one known miss. Throws std::runtime_error where the library answers
/// wrongly.
void check_known_rays(const EmbreeLibrary& library);

}  // namespace bvhlab
