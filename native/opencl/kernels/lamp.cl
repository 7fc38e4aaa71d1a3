// SPDX-License-Identifier: GPL-3.0-or-later
// Lamps and suns: render/lamp.h, which says what they are.

#define KIND_POINT 0U
#define KIND_SUN 1U
#define KIND_SPOT 2U
#define KIND_AREA 3U

#define SMALLEST_ANGLE 0x1p-23
#define DISK_SINE 0.25
#define SMALLEST_SOLID_ANGLE 1e-4

/// A random point of a light as seen from a position.
typedef struct {
    double3 to_light;    ///< from the position; a unit direction where `distant`
    double3 irradiance;  ///< radiance / pdf, unshadowed
    double pdf;          ///< by solid angle; 0 where rays in random directions cannot find it
    bool distant;
} LightSample;

typedef struct {
    double3 radiance;
    double distance, pdf;
} LampHit;

#ifdef LAMPS

/// Distance at which a ray counts as meeting the lamp.
static double nearer(global const Lamp* lamp, double distance, double sine) {
    return most_d(0.0, distance - END_CLEARANCE * (lamp->reach + distance) / sine);
}

// --- points and spots ---------------------------------------------------------------------------

#ifdef POINT_LAMPS

/// Share of a spot's intensity in the unit direction `away` from it.
static double spot_mask(global const Lamp* lamp, double3 away) {
    const double inside = -dot_d(away, load_d(lamp->back)) - lamp->spot_edge;
    if (!(inside > 0.0)) return 0.0;
    if (inside >= lamp->spot_blended) return 1.0;
    const double x = inside / lamp->spot_blended;
    return x * x * (3.0 - 2.0 * x);
}

static LightSample sample_disk_lamp(global const Lamp* lamp, double3 position, double2 random) {
    LightSample sample = {load_d(lamp->centre) - position, all_d(0.0), 0.0, false};
    const double distance = length_d(sample.to_light);
    if (distance == 0.0) return sample;
    const double3 facing = sample.to_light / distance;
    const double extent = lamp->extent;
    const bool seen_as_disk = extent > SMALLEST_ANGLE * distance;
    if (seen_as_disk)
        sample.to_light += in_basis_about(facing, (double3)(extent * sample_disk(random), 0.0));
    const double squared = dot_d(sample.to_light, sample.to_light);
    const double reach = sqrt(squared), cubed = squared * reach;
    const double mask = lamp->kind == KIND_SPOT ? spot_mask(lamp, -sample.to_light / reach) : 1.0;
    if (mask == 0.0) return sample;
    sample.irradiance = load_d(lamp->strength) * (mask * distance / cubed);
    if (seen_as_disk) sample.pdf = cubed / (distance * PI * extent * extent);
    return sample;
}

static double brightness_of_disk(global const Lamp* lamp, double3 to_centre, double3 normal) {
    const double squared = dot_d(to_centre, to_centre);
    if (!(squared > 0.0)) return 0.0;
    const double distance = sqrt(squared);
    double facing = 1.0;
    if (lamp->kind == KIND_SPOT && lamp->extent == 0.0)
        facing = spot_mask(lamp, -to_centre / distance);
    if (!is_zero_d(normal))
        facing *= clamp_d((dot_d(normal, to_centre) + lamp->extent) / distance, 0.0, 1.0);
    return lamp->luminance * facing / (squared + lamp->extent * lamp->extent);
}

static bool meet_disk_lamp(global const Lamp* lamp, double3 position, double3 direction,
                           double t_max, LampHit* hit) {
    const double3 to_centre = load_d(lamp->centre) - position;
    const double squared = dot_d(to_centre, to_centre);
    const double along = dot_d(to_centre, direction);
    if (!(along > 0.0)) return false;
    hit->distance = nearer(lamp, squared / along, DISK_SINE);
    if (hit->distance > t_max) return false;
    const double extent = lamp->extent;
    const double3 cross = cross_d(to_centre, direction);
    if (dot_d(cross, cross) * squared > extent * extent * along * along) return false;
    const double distance = sqrt(squared);
    if (!(extent > SMALLEST_ANGLE * distance)) return false;
    const double mask = lamp->kind == KIND_SPOT ? spot_mask(lamp, -direction) : 1.0;
    if (mask == 0.0) return false;
    hit->radiance = load_d(lamp->strength) * (mask / (PI * extent * extent));
    const double reach = squared / along;
    hit->pdf = reach * reach * distance / (along * PI * extent * extent);
    return true;
}

#endif

// --- suns ---------------------------------------------------------------------------------------

static LightSample sample_sun(global const Lamp* lamp, double2 random) {
    const double extent = lamp->extent;
    return (LightSample){sample_cone(load_d(lamp->back), extent, random),
                         load_d(lamp->strength) * (2.0 / (2.0 - extent)),
                         extent > 0.0 ? 0.5 / (PI * extent) : 0.0, true};
}

static double brightness_of_sun(global const Lamp* lamp, double3 normal) {
    if (is_zero_d(normal)) return lamp->luminance;
    const double facing = dot_d(normal, load_d(lamp->back)) + sqrt(2.0 * lamp->extent);
    return lamp->luminance * clamp_d(facing, 0.0, 1.0);
}

static bool meet_sun(global const Lamp* lamp, double3 direction, double t_max, LampHit* hit) {
    if (t_max < INFINITY) return false;
    const double extent = lamp->extent;
    const double3 chord = direction - load_d(lamp->back);
    if (dot_d(chord, chord) > 2.0 * extent) return false;
    hit->radiance = load_d(lamp->strength) / (PI * extent * (2.0 - extent));
    hit->distance = INFINITY;
    hit->pdf = 0.5 / (PI * extent);
    return true;
}

// --- areas --------------------------------------------------------------------------------------

#ifdef AREA_LAMPS

static bool is_drawn_by_solid_angle(global const Lamp* lamp, double squared_distance) {
    return !lamp->ellipse && lamp->right_angled &&
           lamp->extent > SMALLEST_SOLID_ANGLE * squared_distance;
}

/// The rectangle as seen from a position from which its centre is at `to_centre`.
static SphericalRectangle seen_rectangle(global const Lamp* lamp, double3 to_centre) {
    const double3 edges = load_d(lamp->edge_x) + load_d(lamp->edge_y);
    return spherical_rectangle(to_centre - 0.5 * edges, load_d(lamp->unit_x), load_d(lamp->unit_y),
                               vload2(0, lamp->size));
}

static LightSample sample_area(global const Lamp* lamp, double3 position, double2 random) {
    LightSample sample = {load_d(lamp->centre) - position, all_d(0.0), 0.0, false};
    const double height = dot_d(sample.to_light, load_d(lamp->back));
    const double squared_distance = dot_d(sample.to_light, sample.to_light);
    if (!(height > 0.0)) return sample;
    if (is_drawn_by_solid_angle(lamp, squared_distance)) {
        const SphericalRectangle seen = seen_rectangle(lamp, sample.to_light);
        if (!(seen.solid_angle > 0.0)) return sample;
        sample.to_light = sample_rectangle(&seen, random);
        sample.irradiance = load_d(lamp->strength) * seen.solid_angle;
        sample.pdf = 1.0 / seen.solid_angle;
        return sample;
    }
    const double2 place = lamp->ellipse ? 0.5 * sample_disk(random) : random - 0.5;
    sample.to_light += place.x * load_d(lamp->edge_x) + place.y * load_d(lamp->edge_y);
    const double squared = dot_d(sample.to_light, sample.to_light);
    const double solid_angle = lamp->extent * height / (squared * sqrt(squared));
    sample.irradiance = load_d(lamp->strength) * solid_angle;
    if (lamp->extent > SMALLEST_ANGLE * SMALLEST_ANGLE * squared_distance)
        sample.pdf = 1.0 / solid_angle;
    return sample;
}

static double brightness_of_area(global const Lamp* lamp, double3 to_centre, double3 normal) {
    const double height = dot_d(to_centre, load_d(lamp->back));
    if (!(height > 0.0)) return 0.0;
    double facing = 1.0;
    if (!is_zero_d(normal)) {
        const double half_size = 0.5 * (fabs(dot_d(normal, load_d(lamp->edge_x))) +
                                        fabs(dot_d(normal, load_d(lamp->edge_y))));
        const double highest = dot_d(normal, to_centre) + half_size;
        if (!(highest > 0.0)) return 0.0;
        facing = least_d(1.0, highest / length_d(to_centre));
    }
    const double x =
        most_d(0.0, fabs(dot_d(to_centre, load_d(lamp->unit_x))) - 0.5 * lamp->size[0]);
    const double y =
        most_d(0.0, fabs(dot_d(to_centre, load_d(lamp->unit_y))) - 0.5 * lamp->size[1]);
    const double squared = height * height + x * x + y * y;
    return lamp->luminance * lamp->extent * facing * height /
           (sqrt(squared) * (squared + lamp->extent / PI));
}

static bool meet_area(global const Lamp* lamp, double3 position, double3 direction, double t_max,
                      LampHit* hit) {
    const double slope = dot_d(direction, load_d(lamp->back));
    if (!(slope > 0.0)) return false;
    const double3 to_centre = load_d(lamp->centre) - position;
    const double height = dot_d(to_centre, load_d(lamp->back));
    if (!(height > 0.0)) return false;
    const double distance = height / slope;
    hit->distance = nearer(lamp, distance, slope);
    if (hit->distance > t_max) return false;
    const double3 place = direction * distance - to_centre;

    // Coordinates along the edges, -0.5 to 0.5.
    const double3 edge_x = load_d(lamp->edge_x), edge_y = load_d(lamp->edge_y);
    const double3 normal = cross_d(edge_x, edge_y);
    const double squared_area = dot_d(normal, normal);
    const double x = dot_d(cross_d(place, edge_y), normal) / squared_area;
    const double y = dot_d(cross_d(edge_x, place), normal) / squared_area;
    if (lamp->ellipse ? x * x + y * y > 0.25 : most_d(fabs(x), fabs(y)) > 0.5) return false;

    const double squared_distance = dot_d(to_centre, to_centre);
    hit->radiance = load_d(lamp->strength);
    if (is_drawn_by_solid_angle(lamp, squared_distance)) {
        const SphericalRectangle seen = seen_rectangle(lamp, to_centre);
        if (!(seen.solid_angle > 0.0)) return false;
        hit->pdf = 1.0 / seen.solid_angle;
        return true;
    }
    if (!(lamp->extent > SMALLEST_ANGLE * SMALLEST_ANGLE * squared_distance)) return false;
    hit->pdf = distance * distance / (lamp->extent * slope);
    return true;
}

#endif

// --- any lamp -----------------------------------------------------------------------------------

static LightSample sample_lamp(global const Lamp* lamp, double3 position, double2 random) {
    LightSample sample = {all_d(0.0), all_d(0.0), 0.0, false};
    if (lamp->kind == KIND_SUN) return sample_sun(lamp, random);
    const bool area = lamp->kind == KIND_AREA;
#ifdef AREA_LAMPS
    if (area) sample = sample_area(lamp, position, random);
#endif
#ifdef POINT_LAMPS
    if (!area) sample = sample_disk_lamp(lamp, position, random);
#endif
    const double distance = length_d(sample.to_light);
    if (!(distance > 0.0)) return sample;
    const double sine = area ? dot_d(sample.to_light, load_d(lamp->back)) / distance : DISK_SINE;
    sample.to_light *= sine > 0.0 ? nearer(lamp, distance, sine) / distance : 0.0;
    return sample;
}

/// About the irradiance that the lamp brings to a surface.
static double brightness_of(global const Lamp* lamp, double3 position, double3 normal) {
    if (lamp->kind == KIND_SUN) return brightness_of_sun(lamp, normal);
    const double3 to_centre = load_d(lamp->centre) - position;
#ifdef AREA_LAMPS
    if (lamp->kind == KIND_AREA) return brightness_of_area(lamp, to_centre, normal);
#endif
#ifdef POINT_LAMPS
    return brightness_of_disk(lamp, to_centre, normal);
#endif
    return 0.0;
}

/// Whether a ray meets the lamp's shining side, no farther than `t_max`; fills `hit`.
static bool meet_lamp(global const Lamp* lamp, double3 position, double3 direction, double t_max,
                      LampHit* hit) {
    if (lamp->kind == KIND_SUN) return meet_sun(lamp, direction, t_max, hit);
#ifdef AREA_LAMPS
    if (lamp->kind == KIND_AREA) return meet_area(lamp, position, direction, t_max, hit);
#endif
#ifdef POINT_LAMPS
    return meet_disk_lamp(lamp, position, direction, t_max, hit);
#endif
    return false;
}

#endif
