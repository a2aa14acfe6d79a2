#version 460
// Adds rays to the grid, each from where it begins to where it ends: see trace/flux.glsl for the contract.
#include "trace/flux.glsl"

// Where a segment begins or ends: its place, and along which axis it goes through the grid's wall there, or INSIDE.
struct End {
    uvec3 place;
    uint wall;
};

const uint INSIDE = 3;
// Parts of the longest component that count as none.
const float FLATTEST = 9.094947017729282e-13;     // 2^-40
// What is farther, the scene's longest edge being 1 to 4, has no place.
const float FARTHEST = 1099511627776.0;           // 2^40
const float SHORTEST_WAY = 8.673617379884035e-19; // 2^-60
const float LONGEST_WAY = 1152921504606846976.0;  // 2^60

float or_nothing(float x) {
    return abs(x) < SHORTEST_WAY ? 0.0 : x;
}

// Of a way along a ray, in the scene's own measure.
float length_of(float t, float up) {
    precise float length = t * up;
    length = or_nothing(length) * grid.scale;
    return min(or_nothing(length), LONGEST_WAY);
}

void add(uvec3 at, uint what) {
    atomicAdd(counts.word[4u * flux_point(at) + what], 1u);
}

// Of a face across an axis, the point that its cell is summed at.
uvec3 face_at(uint axis, uint plane, uvec3 cells) {
    uvec3 at = cells + 1u;
    at[axis] = plane;
    return at;
}

// Counts an end, or the wall that the segment goes through there.
void add_end(End end) {
    uvec3 cells = flux_cells(end.place);
    if (end.wall == INSIDE) add(cells + 1u, 3u);
    else add(face_at(end.wall, end.place[end.wall] == 0u ? 0u : FLUX_CELLS, cells), end.wall);
}

// Counts all planes between cells along an axis.
void add_crossings(uint axis, uvec3 a, uvec3 b) {
    bool up = a[axis] <= b[axis];
    uvec3 low = up ? a : b, high = up ? b : a;
    uint length = high[axis] - low[axis], last = flux_cell(high[axis]);
    bvec3 rises = greaterThanEqual(high, low);
    uvec3 rise = mix(low - high, high - low, rises);
    for (uint plane = flux_cell(low[axis]) + 1u; plane <= last; ++plane) {
        // Below 2^30: whole numbers, so that every device finds the same cell.
        uvec3 moved = (FLUX_PARTS * plane - low[axis]) * rise / length;
        add(face_at(axis, plane, flux_cells(mix(low - moved, low + moved, rises))), axis);
    }
}

// Adds the segment of a ray that ended at `t_end`.
void add_segment(HedgerowRay ray, float t_end) {
    HedgerowPreparedRay prepared;
    if (!hedgerow_prepare(ray, prepared) || !(ray.t_min < t_end)) return;
    precise vec3 scaled = ray.origin * grid.scale;
    if (!all(lessThanEqual(abs(scaled), vec3(FARTHEST)))) return;
    // Lengths along the ray in the scene's own, and the direction with a longest component of 1 to 2.
    uint exponent = floatBitsToUint(max(max(abs(ray.direction.x), abs(ray.direction.y)), abs(ray.direction.z))) >> 23;
    float up = uintBitsToFloat(exponent << 23), down = uintBitsToFloat((254u - exponent) << 23);
    float near = length_of(max(ray.t_min, 0.0), up), far = length_of(t_end, up);
    precise vec3 direction = ray.direction * down;
    direction = mix(direction, vec3(0.0), lessThan(abs(direction), vec3(FLATTEST)));
    precise vec3 from = (scaled - grid.lo) * grid.factor;
    precise vec3 way = direction * grid.factor;

    float enter = near, leave = far;
    uint wall_in = INSIDE, wall_out = INSIDE;
    for (uint i = 0; i < 3; ++i) {
        if (way[i] == 0.0) {
            if (from[i] < 0.0 || from[i] > FLUX_PLACES) return;
            continue;
        }
        // What is left to the wall in front and to the one behind.
        precise float left_in = or_nothing(way[i] > 0.0 ? -from[i] : from[i] - FLUX_PLACES);
        precise float left_out = or_nothing(way[i] > 0.0 ? FLUX_PLACES - from[i] : from[i]);
        float speed = abs(way[i]);
        if (left_out < 0.0) return;
        precise float reach_in = speed * near;
        if (left_in > 0.0 && reach_in < left_in) {
            float t = flux_quotient(left_in, speed);
            if (t > enter) {
                enter = t;
                wall_in = i;
            }
        } else if (reach_in > left_out) {
            return;
        }
        precise float reach_out = speed * far;
        if (reach_out > left_out) {
            float t = left_out == 0.0 ? 0.0 : flux_quotient(left_out, speed);
            if (t < leave) {
                leave = t;
                wall_out = i;
            }
        }
    }
    if (enter > leave) return;
    precise vec3 a = from + way * enter;
    precise vec3 b = from + way * leave;
    End first = End(uvec3(clamp(a, vec3(0.0), vec3(FLUX_PLACES))), wall_in);
    End last = End(uvec3(clamp(b, vec3(0.0), vec3(FLUX_PLACES))), wall_out);
    if (wall_in != INSIDE) first.place[wall_in] = way[wall_in] > 0.0 ? 0u : uint(FLUX_PLACES);
    if (wall_out != INSIDE) last.place[wall_out] = way[wall_out] > 0.0 ? uint(FLUX_PLACES) : 0u;
    add_end(first);
    add_end(last);
    for (uint axis = 0; axis < 3; ++axis) add_crossings(axis, first.place, last.place);
}

void main() {
    uint at = begin + invocation_number();
    if (at >= count) return;
    HedgerowRay ray = rays.ray[first + at * stride];
    HedgerowHit hit = hits.hit[first + at * stride];
    add_segment(ray, hit.primitive != HEDGEROW_NONE && hit.t < ray.t_max ? hit.t : ray.t_max);
}
