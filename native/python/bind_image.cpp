// SPDX-License-Identifier: GPL-3.0-or-later
// write_image, image_difference, image_error.
#include <pybind11/stl.h>

#include <algorithm>
#include <stdexcept>

#include "python/convert.h"

#ifdef BVHLAB_WITH_OIIO
#include "image/compare.h"
#include "image/error.h"
#include "image/write.h"
#endif

namespace bvhlab {
namespace {

#ifdef BVHLAB_WITH_OIIO

/// A picture from Python: (H, W), or (H, W, C) with 1, 3 or 4 channels.
class Picture {
public:
    Picture(const py::handle& argument, const char* name)
        : values_(float_array(argument, name)),
          view_{values_.data(), int(values_.shape(1)), int(values_.shape(0)),
                values_.ndim() == 3 ? int(values_.shape(2)) : 1} {}

    const ImageView& view() const { return view_; }

private:
    static constexpr py::ssize_t largest_side = 65535;

    static FloatArray float_array(const py::handle& argument, const char* name) {
        const py::array array = py::array::ensure(argument);
        const char kind = array ? array.dtype().kind() : '?';
        if (kind != 'f' && kind != 'i' && kind != 'u')
            throw py::value_error(std::string(name) + " must be an array of numbers");
        const bool has_channels = array.ndim() == 3;
        const py::ssize_t channels = has_channels ? array.shape(2) : 1;
        const bool fits = (array.ndim() == 2 || has_channels) &&
                          (channels == 1 || channels == 3 || channels == 4) && array.size() > 0;
        if (!fits)
            throw py::value_error(std::string(name) +
                                  " must have shape (H, W) or (H, W, C) with C 1, 3 or 4");
        if (std::max(array.shape(0), array.shape(1)) > largest_side)
            throw py::value_error(std::string(name) + " has " + std::to_string(array.shape(1)) +
                                  " x " + std::to_string(array.shape(0)) +
                                  " pixels; a side has at most " + std::to_string(largest_side));
        return converted<FloatArray>(array);
    }

    FloatArray values_;
    ImageView view_;
};

void write_picture(const py::object& path, const py::object& pixels) {
    const auto file = py::module_::import("os").attr("fspath")(path).cast<std::string>();
    const Picture picture(pixels, "pixels");
    std::string problem;
    {
        const py::gil_scoped_release release;
        try {
            write_image(file, picture.view());
        } catch (const std::runtime_error& error) {
            problem = error.what();
        }
    }
    if (problem.empty()) return;
    PyErr_SetString(PyExc_OSError, problem.c_str());
    throw py::error_already_set();
}

py::dict difference(const py::object& a, const py::object& b) {
    const Picture first(a, "a");
    const Picture second(b, "b");
    const ImageDifference found = compare_images(first.view(), second.view());
    py::dict result;
    result["max"] = found.max;
    result["mean"] = found.mean;
    result["rmse"] = found.rmse;
    result["differing_pixels"] = found.differing_pixels;
    return result;
}

py::dict error(const py::object& picture, const py::object& reference, bool flip) {
    const Picture first(picture, "picture");
    const Picture second(reference, "reference");
    ImageError found;
    {
        const py::gil_scoped_release release;
        found = image_error(first.view(), second.view(), flip);
    }
    py::dict result;
    result["relMSE"] = found.relative_mse;
    result["MAE"] = found.mean_absolute;
    result["RMSE"] = found.root_mean_square;
    result["PSNR"] = found.peak_signal_to_noise;
    if (flip) result["FLIP"] = found.flip;
    result["bias"] = found.bias;
    result["non_finite"] = found.non_finite;
    return result;
}

#else

[[noreturn]] void refuse() {
    throw std::runtime_error("this build of BVH Lab has no OpenImageIO: it handles no pictures");
}
void write_picture(const py::object&, const py::object&) {
    refuse();
}
py::dict difference(const py::object&, const py::object&) {
    refuse();
}
py::dict error(const py::object&, const py::object&, bool) {
    refuse();
}

#endif

}  // namespace

void bind_image(py::module_& module) {
    module.def("write_image", &write_picture, py::arg("path"), py::arg("pixels"),
               R"(Write a picture, (H, W) or (H, W, 1 | 3 | 4) linear float32, top row first.

The extension names the format: .exr (32-bit float, linear) or .png (8-bit sRGB, clipped to [0, 1]).
The file is written aside and renamed. Raises ValueError for another extension or shape, OSError
with file and reason where it cannot be written.)");
    module.def(
        "image_difference", &difference, py::arg("a"), py::arg("b"),
        R"(How far two pictures of one shape are apart: dict of max, mean, rmse, differing_pixels.

max, mean and rmse are over all values (pixels times channels); a value that is not finite in one of them
only is infinitely far off. Raises ValueError where the shapes differ.)");
    module.def(
        "image_error", &error, py::arg("picture"), py::arg("reference"), py::arg("flip") = true,
        R"(How wrong a noisy picture is: dict of relMSE, MAE, RMSE, PSNR, FLIP, bias, non_finite.

Both are (H, W) or (H, W, 1 | 3), linear float32, of one shape; x is a value of the picture, r of the
reference, m the mean of r; all values count alike.

relMSE      mean of (x - r)^2 / (r^2 + 0.01 m^2)
MAE, RMSE   mean of |x - r|, and root of the mean of (x - r)^2, in radiance
PSNR        20 log10(largest r / RMSE) in dB; inf where the pictures are equal
FLIP        mean LDR-FLIP, 0 to 1 (Andersson et al. 2020, 67 pixels per degree), both shown as x / (x + m)
bias        mean of x - r, in units of m
non_finite  values of the picture that are NaN or infinite: they make all else inf, PSNR -inf

FLIP takes a second for a million pixels, all else milliseconds: without ``flip`` it is left out.

Raises ValueError where the shapes differ or the reference holds NaN, infinity or a negative value.)");
}

}  // namespace bvhlab
