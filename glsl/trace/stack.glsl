// What a ray's traversal has put off: one entry a level of the tree, so MAX_DEPTH entries hold every tree that can be traced.
//
// The lowest SHARED_LEVELS entries of each invocation lie in shared memory, in columns, so that invocations side by side
// touch words side by side; the others in private memory, which few rays reach. Where shared memory is as good as any
// (CPUs), all lie there, and no private array is left in the shader.
#ifndef HEDGEROW_TRACE_STACK
#define HEDGEROW_TRACE_STACK
#include "bvh/layout.glsl"

layout(constant_id = 3) const uint SHARED_LEVELS = 0;

shared uint shared_index[SHARED_LEVELS * gl_WorkGroupSize.x + 1];
shared uint shared_count[SHARED_LEVELS * gl_WorkGroupSize.x + 1];
shared float shared_enter[SHARED_LEVELS * gl_WorkGroupSize.x + 1];

// A child that waits, and the distance at which the ray enters it.
struct Waiting {
    uint index;
    uint count;
    float enter;
};

Waiting private_levels[SHARED_LEVELS < MAX_DEPTH ? MAX_DEPTH - SHARED_LEVELS : 1];

void put(uint level, Waiting waiting) {
    if (SHARED_LEVELS < MAX_DEPTH && level >= SHARED_LEVELS) {
        private_levels[level - SHARED_LEVELS] = waiting;
        return;
    }
    uint at = level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    shared_index[at] = waiting.index;
    shared_count[at] = waiting.count;
    shared_enter[at] = waiting.enter;
}

Waiting taken(uint level) {
    if (SHARED_LEVELS < MAX_DEPTH && level >= SHARED_LEVELS) return private_levels[level - SHARED_LEVELS];
    uint at = level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
    return Waiting(shared_index[at], shared_count[at], shared_enter[at]);
}
#endif
