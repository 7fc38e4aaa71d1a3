// SPDX-License-Identifier: GPL-3.0-or-later
// Sums of samples in double, and the picture that they make: render/film.h. A work-item has a pixel
// and adds its samples one by one in their order.

#define PASS_SUMS 8  ///< normal, albedo, node visits, triangle tests

kernel void add_radiance(global const float* radiance,  // three by path: samples of a pixel follow
                         uint first_pixel,              // one another, pixel by pixel
                         uint pixels,                   //
                         uint samples,                  // of each pixel
                         global double* sums,           // three by pixel
                         global uint* counts) {         // samples by pixel
    const uint i = get_global_id(0);
    if (i >= pixels) return;
    const size_t pixel = (size_t)first_pixel + i;
    double3 sum = vload3(pixel, sums);
    for (uint s = 0; s < samples; ++s)
        sum += convert_double3(load_f(radiance, (size_t)i * samples + s));
    vstore3(sum, pixel, sums);
    counts[pixel] += samples;
}

kernel void add_passes(global const PassValues* passes,  // by path
                       uint first_pixel,                 //
                       uint pixels,                      //
                       uint samples,                     // of each pixel
                       uint are_first,                   // 1: sample 0 is among them
                       global double* sums,              // PASS_SUMS by pixel
                       global float* depth) {            // of sample 0, by pixel
    const uint i = get_global_id(0);
    if (i >= pixels) return;
    const size_t pixel = (size_t)first_pixel + i;
    if (are_first) depth[pixel] = passes[(size_t)i * samples].depth;
    global double* own = sums + pixel * PASS_SUMS;
    for (uint s = 0; s < samples; ++s) {
        const PassValues pass = passes[(size_t)i * samples + s];
        for (int axis = 0; axis < 3; ++axis) {
            own[axis] += (double)pass.normal[axis];
            own[3 + axis] += (double)pass.albedo[axis];
        }
        own[6] += (double)pass.node_visits;
        own[7] += (double)pass.triangle_tests;
    }
}

kernel void show_radiance(global const double* sums,  // three by pixel
                          global const uint* counts,  // by pixel
                          uint pixels,                //
                          global float* picture) {    // out, three by pixel: means
    const uint i = get_global_id(0);
    if (i >= pixels) return;
    vstore3(convert_float3(vload3(i, sums) / (double)max(1U, counts[i])), i, picture);
}

kernel void show_passes(global const double* sums,       // PASS_SUMS by pixel
                        global const uint* counts,       // by pixel
                        uint pixels,                     //
                        global float* normal,            // out, three by pixel
                        global float* albedo,            // out, three by pixel
                        global float* node_visits,       // out, by pixel
                        global float* triangle_tests) {  // out, by pixel
    const uint i = get_global_id(0);
    if (i >= pixels) return;
    const double samples = (double)max(1U, counts[i]);
    global const double* own = sums + (size_t)i * PASS_SUMS;
    vstore3(convert_float3(vload3(0, own) / samples), i, normal);
    vstore3(convert_float3(vload3(1, own) / samples), i, albedo);
    node_visits[i] = (float)(own[6] / samples);
    triangle_tests[i] = (float)(own[7] / samples);
}
