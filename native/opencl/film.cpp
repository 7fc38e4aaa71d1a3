// SPDX-License-Identifier: GPL-3.0-or-later
#include "opencl/film.h"

#include <span>

namespace bvhlab::opencl {
namespace {

static_assert(sizeof(PassValues) == 36);

Program film_program(Commands& commands) {
    return Program(commands.device(), {{"vector.cl", "path.cl", "film.cl"}, ""});
}

template <class T>
Array<T> downloaded(Commands& commands, const Buffer<T>& buffer, std::size_t count) {
    Array<T> values(count);
    commands.download(buffer, std::span<T>(values));
    return values;
}

}  // namespace

Film::Film(Commands& commands, std::size_t pixels, bool passes)
    : size_(pixels),
      has_passes_(passes),
      radiance_(commands.buffer<double>(3 * pixels)),
      samples_(commands.buffer<std::uint32_t>(pixels)),
      passes_(commands.buffer<double>(passes ? sums_of_passes * pixels : 0)),
      depth_(commands.buffer<float>(passes ? pixels : 0)) {
    commands.fill(radiance_, 0.0);
    commands.fill(samples_, std::uint32_t(0));
    commands.fill(passes_, 0.0);
    commands.fill(depth_, 0.0F);
    commands.finish();
}

void Film::add(Commands& commands, const PathRange& range, const Buffer<glm::vec3>& radiance,
               const Buffer<PassValues>& passes) {
    Program program = film_program(commands);
    const auto first = std::uint32_t(range.first_pixel), pixels = std::uint32_t(range.pixels);
    commands.stage("film");
    commands.run(program["add_radiance"], range.pixels, radiance, first, pixels, range.samples,
                 radiance_, samples_);
    if (has_passes_)
        commands.run(program["add_passes"], range.pixels, passes, first, pixels, range.samples,
                     std::uint32_t(range.first_sample == 0), passes_, depth_);
    commands.finish();
}

FilmPicture Film::picture(Commands& commands) const {
    Program program = film_program(commands);
    const auto pixels = std::uint32_t(size_);
    const auto colors = commands.buffer<glm::vec3>(size_);
    commands.stage("show");
    commands.run(program["show_radiance"], size_, radiance_, samples_, pixels, colors);
    FilmPicture picture{downloaded(commands, colors, size_), {}, {}, {}, {}, {}};
    if (!has_passes_) return picture;
    const auto normal = commands.buffer<glm::vec3>(size_),
               albedo = commands.buffer<glm::vec3>(size_);
    const auto visits = commands.buffer<float>(size_), tests = commands.buffer<float>(size_);
    commands.run(program["show_passes"], size_, passes_, samples_, pixels, normal, albedo, visits,
                 tests);
    picture.normal = downloaded(commands, normal, size_);
    picture.albedo = downloaded(commands, albedo, size_);
    picture.depth = downloaded(commands, depth_, size_);
    picture.node_visits = downloaded(commands, visits, size_);
    picture.triangle_tests = downloaded(commands, tests, size_);
    return picture;
}

}  // namespace bvhlab::opencl
