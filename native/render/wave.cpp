// SPDX-License-Identifier: GPL-3.0-or-later
#include "render/wave.h"

namespace bvhlab {

void Paths::resize(std::size_t count) {
    origins.resize(count);
    directions.resize(count);
    throughput.resize(count);
    normals.resize(count);
    pdf.resize(count);
    travelled.resize(count);
    id.resize(count);
}

void Paths::copy(const Paths& other, std::size_t from, std::size_t to) {
    origins[to] = other.origins[from];
    directions[to] = other.directions[from];
    throughput[to] = other.throughput[from];
    normals[to] = other.normals[from];
    pdf[to] = other.pdf[from];
    travelled[to] = other.travelled[from];
    id[to] = other.id[from];
}

void LightPaths::resize(std::size_t count) {
    origins.resize(count);
    directions.resize(count);
    t_max.resize(count);
    radiance.resize(count);
}

}  // namespace bvhlab
