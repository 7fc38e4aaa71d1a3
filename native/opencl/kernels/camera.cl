// SPDX-License-Identifier: GPL-3.0-or-later
// Camera rays: render/camera_rays.h. With LENS, from points of the aperture.

/// scene/camera.h
typedef struct {
    double to_world[16];  ///< by columns
    double left, right, bottom, top;
    double clip_start, lens_radius, focus_distance;
    uint perspective, width, height, unused;
} Camera;

/// The affine matrix times (v, w), in GLM's order of additions.
static double3 placed(const Camera* camera, double3 v, double w) {
    const double* m = camera->to_world;
    const double3 x = (double3)(m[0], m[1], m[2]), y = (double3)(m[4], m[5], m[6]),
                  z = (double3)(m[8], m[9], m[10]), t = (double3)(m[12], m[13], m[14]);
    return (x * v.x + y * v.y) + (z * v.z + t * w);
}

static PathRay placed_ray(const Camera* camera, double3 origin, double3 direction) {
    return ray_of(convert_float3(placed(camera, origin, 1.0)),
                  convert_float3(unit_d(placed(camera, direction, 0.0))), INFINITY);
}

static PathRay camera_ray(const Camera* camera, uint pixel, uint sample, uint seed) {
    // Choose the point of the pixel, in pixels from the top left corner.
    const Sampler random = sampler_of(pixel, sample, seed);
    double2 point = (double2)((double)(pixel % camera->width), (double)(pixel / camera->width));
    point += sample == 0 ? (double2)(0.5, 0.5) : random_pair(random, CAMERA_DIMENSION);

    // Find it in the window.
    const double x =
        camera->left + (camera->right - camera->left) * (point.x / (double)camera->width);
    const double y =
        camera->top + (camera->bottom - camera->top) * (point.y / (double)camera->height);

    // Start on the near plane.
    const double3 direction =
        camera->perspective ? (double3)(x, y, -1.0) : (double3)(0.0, 0.0, -1.0);
#ifndef LENS
    const double3 origin =
        camera->perspective ? direction * camera->clip_start : (double3)(x, y, -camera->clip_start);
    return placed_ray(camera, origin, direction);
#else
    // From a point of the lens, to where the ray through its centre is in focus.
    const double3 lens =
        (double3)(camera->lens_radius * sample_disk(random_pair(random, LENS_DIMENSION)), 0.0);
    const double3 centre = camera->perspective ? all_d(0.0) : (double3)(x, y, 0.0);
    const double3 to_focus = direction * camera->focus_distance - lens;
    const double3 start = centre + lens + to_focus * (camera->clip_start / camera->focus_distance);
    return placed_ray(camera, start, to_focus);
#endif
}

kernel void generate(Camera camera,             // of the picture
                     WaveSettings wave,         // whose paths start
                     uint count,                // of paths
                     global PathRay* rays,      // out, by path
                     global PathState* states,  // out, by path
                     global uint* ids,          // out: all paths are alive
                     global float* radiance) {  // out, three by path: none yet
    const uint i = get_global_id(0);
    if (i >= count) return;
    rays[i] = camera_ray(&camera, pixel_of(wave, i), sample_of(wave, i), wave.seed);
    states[i] = state_of(all_f(1.0F), 0.0F, all_f(0.0F), 0.0F);
    ids[i] = i;
    store_f(all_f(0.0F), radiance, i);
}
