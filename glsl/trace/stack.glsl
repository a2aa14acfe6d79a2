// What a ray's traversal has put off: one entry a level of the tree, so MAX_DEPTH entries hold every tree that can be traced.
//
// A shader may define HEDGEROW_SHARED_LEVELS, a constant or specialisation constant, before it includes this file, and
// declare its workgroup size before that: then so many of the lowest entries of each invocation lie in shared memory, in
// columns, so that invocations side by side touch words side by side; 12 bytes each. The others, without it all, lie in
// private memory. Where shared memory is as good as any (CPUs), all may lie there, and no private array is left.
#ifndef HEDGEROW_TRACE_STACK
#define HEDGEROW_TRACE_STACK

// A child that waits, and the distance at which the ray enters it.
struct HedgerowWaiting {
    uint index;
    uint count;
    float enter;
};

#ifdef HEDGEROW_SHARED_LEVELS
const uint HEDGEROW_PRIVATE_LEVELS = HEDGEROW_SHARED_LEVELS < MAX_DEPTH ? MAX_DEPTH - HEDGEROW_SHARED_LEVELS : 0;
// One word more than needed: an array must not be empty.
shared uint hedgerow_shared_index[HEDGEROW_SHARED_LEVELS * gl_WorkGroupSize.x + 1];
shared uint hedgerow_shared_count[HEDGEROW_SHARED_LEVELS * gl_WorkGroupSize.x + 1];
shared float hedgerow_shared_enter[HEDGEROW_SHARED_LEVELS * gl_WorkGroupSize.x + 1];
#else
const uint HEDGEROW_PRIVATE_LEVELS = MAX_DEPTH;
#endif

HedgerowWaiting hedgerow_private[HEDGEROW_PRIVATE_LEVELS + 1];

void hedgerow_put(uint level, HedgerowWaiting waiting) {
#ifdef HEDGEROW_SHARED_LEVELS
    if (HEDGEROW_PRIVATE_LEVELS == 0u || level < HEDGEROW_SHARED_LEVELS) {
        uint at = level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        hedgerow_shared_index[at] = waiting.index;
        hedgerow_shared_count[at] = waiting.count;
        hedgerow_shared_enter[at] = waiting.enter;
        return;
    }
    level -= HEDGEROW_SHARED_LEVELS;
#endif
    hedgerow_private[level] = waiting;
}

HedgerowWaiting hedgerow_taken(uint level) {
#ifdef HEDGEROW_SHARED_LEVELS
    if (HEDGEROW_PRIVATE_LEVELS == 0u || level < HEDGEROW_SHARED_LEVELS) {
        uint at = level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        return HedgerowWaiting(hedgerow_shared_index[at], hedgerow_shared_count[at], hedgerow_shared_enter[at]);
    }
    level -= HEDGEROW_SHARED_LEVELS;
#endif
    return hedgerow_private[level];
}
#endif
