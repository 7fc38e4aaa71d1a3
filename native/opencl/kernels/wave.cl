// SPDX-License-Identifier: GPL-3.0-or-later
// Gathering what is alive in a wave, in the order that it has, by marks that are summed up by a
// scan (opencl/scan.h): render/compact.h.

/// Whether the mark of `i` was 1, from the marks' exclusive sums.
static bool was_marked(global const uint* sums, global const uint* total, uint count, uint i) {
    const uint next = i + 1 < count ? sums[i + 1] : total[0];
    return next != sums[i];
}

/// Lists what was marked, ascending.
kernel void list_marked(global const uint* sums,   // of the marks, exclusive
                        global const uint* total,  // one: the sum of all
                        uint count,                // of marks
                        global const uint* from,   // what the marks stand for
                        uint has_from,             // 0: for their own index, `from` is not read
                        global uint* list) {       // out
    const uint i = get_global_id(0);
    if (i >= count || !was_marked(sums, total, count, i)) return;
    list[sums[i]] = has_from ? from[i] : i;
}

kernel void gather_rays(global const PathRay* rays,  // all
                        global const uint* list,     // which
                        uint count,                  // of the list
                        global PathRay* gathered) {  // out, by list
    const uint j = get_global_id(0);
    if (j >= count) return;
    gathered[j] = rays[list[j]];
}

// --- paths --------------------------------------------------------------------------------------

kernel void mark_living(global const PathState* states,  // by path
                        uint count,                      // of paths
                        global uint* marks) {            // out: 1 where throughput is left
    const uint i = get_global_id(0);
    if (i >= count) return;
    const PathState state = states[i];
    marks[i] = is_black(vector_of(state.throughput)) ? 0 : 1;
}

kernel void keep_living(global const uint* sums,         // of the marks, exclusive
                        global const uint* total,        // one: the sum of all
                        uint count,                      // of paths
                        global const PathRay* rays,      // by path
                        global const PathState* states,  // by path
                        global const uint* ids,          // by path
                        global PathRay* kept_rays,       // out, dense
                        global PathState* kept_states,   // out
                        global uint* kept_ids) {         // out
    const uint i = get_global_id(0);
    if (i >= count || !was_marked(sums, total, count, i)) return;
    const uint place = sums[i];
    kept_rays[place] = rays[i];
    kept_states[place] = states[i];
    kept_ids[place] = ids[i];
}

/// Makes the hits behind surfaces that were passed the hits of their paths.
kernel void take_behind(global const uint* list,           // of paths
                        uint count,                        // of the list
                        global const PathHit* behind,      // by list
                        global const uint* behind_visits,  // by list; both only with counts
                        global const uint* behind_tests,   //
                        uint has_counts,                   //
                        global PathHit* hits,              // by path
                        global uint* visits,               // by path, added to
                        global uint* tests) {              //
    const uint j = get_global_id(0);
    if (j >= count) return;
    hits[list[j]] = behind[j];
    if (!has_counts) return;
    visits[list[j]] += behind_visits[j];
    tests[list[j]] += behind_tests[j];
}

/// Pass values that tracing tells; shading adds the others where there is a surface.
kernel void fill_depth(global const PathState* states,  // by path, as all are at bounce 0
                       global const PathHit* hits,      // by path
                       global const uint* visits,       // by path
                       global const uint* tests,        // by path
                       uint count,                      // of paths
                       global PassValues* passes) {     // out, by id
    const uint i = get_global_id(0);
    if (i >= count) return;
    passes[i] = (PassValues){{0.0F, 0.0F, 0.0F},
                             states[i].travelled + hits[i].t,
                             {0.0F, 0.0F, 0.0F},
                             (float)visits[i],
                             (float)tests[i]};
}

// --- light --------------------------------------------------------------------------------------

kernel void mark_lit(global const float* light_radiance,  // three by light path
                     uint count,                          // of light paths
                     global uint* marks) {                // out: 1 where there is any
    const uint i = get_global_id(0);
    if (i >= count) return;
    marks[i] = is_black(load_f(light_radiance, i)) ? 0 : 1;
}

kernel void block_light(global const uint* list,         // of light paths
                        global const uchar* occluded,    // by list
                        uint count,                      // of the list
                        global float* light_radiance) {  // three by light path
    const uint j = get_global_id(0);
    if (j >= count || !occluded[j]) return;
    store_f(all_f(0.0F), light_radiance, list[j]);
}

/// Adds up the light of each path in the order of its samples.
kernel void gather_light(global const uint* ids,              // by path
                         global const float* light_radiance,  // three by light path
                         uint shadow_rays,                    // light paths to a path
                         uint count,                          // of paths
                         global float* radiance) {            // three by id, added to
    const uint i = get_global_id(0);
    if (i >= count) return;
    float3 sum = all_f(0.0F);
    for (uint k = 0; k < shadow_rays; ++k)
        sum += load_f(light_radiance, (size_t)i * shadow_rays + k);
    const uint id = ids[i];
    store_f(load_f(radiance, id) + sum, radiance, id);
}
