// What a ray's traversal has put off: one entry a level of the tree, so MAX_DEPTH entries hold every tree that can be traced.
// A shader that walks several trees at once defines HEDGEROW_LEVELS, the entries that it needs, before it includes this file.
//
// A shader may define HEDGEROW_SHARED_LEVELS, a constant or specialisation constant, before it includes this file, and
// declare its workgroup size before that: then so many of the lowest entries of each invocation lie in shared memory, in
// columns, so that invocations side by side touch words side by side; 8 bytes each. The others, without it all, lie in
// private memory. Where shared memory is as good as any (CPUs), all may lie there, and no private array is left.
#ifndef HEDGEROW_TRACE_STACK
#define HEDGEROW_TRACE_STACK
#ifndef HEDGEROW_LEVELS
#define HEDGEROW_LEVELS MAX_DEPTH
#endif

// A child that waits, and the distance at which the ray enters it: minus infinity for a leaf of so many triangles that
// its count has no room in the entry beside the index; it is taken however far it is.
struct HedgerowWaiting {
    uint index;
    uint count;
    float enter;
};

// Nodes and triangles of a structure are fewer than 2^27 (radix_sort::MAX_COUNT), which leaves these bits for the count.
const uint HEDGEROW_WAITING_BITS = 27;
const uint HEDGEROW_LONG_LEAF = 31;

uvec2 hedgerow_packed(HedgerowWaiting waiting) {
    bool long_leaf = waiting.count >= HEDGEROW_LONG_LEAF;
    return uvec2(waiting.index | min(waiting.count, HEDGEROW_LONG_LEAF) << HEDGEROW_WAITING_BITS,
                 long_leaf ? waiting.count : floatBitsToUint(waiting.enter));
}

HedgerowWaiting hedgerow_unpacked(uvec2 entry) {
    uint count = entry.x >> HEDGEROW_WAITING_BITS;
    uint index = entry.x & (1u << HEDGEROW_WAITING_BITS) - 1u;
    bool is_long = count == HEDGEROW_LONG_LEAF;
    return HedgerowWaiting(index, is_long ? entry.y : count, is_long ? -HEDGEROW_INFINITY : uintBitsToFloat(entry.y));
}

#ifdef HEDGEROW_SHARED_LEVELS
const uint HEDGEROW_PRIVATE_LEVELS = HEDGEROW_SHARED_LEVELS < HEDGEROW_LEVELS ? HEDGEROW_LEVELS - HEDGEROW_SHARED_LEVELS : 0;
// One word more than needed: an array must not be empty.
shared uint hedgerow_shared_child[HEDGEROW_SHARED_LEVELS * gl_WorkGroupSize.x + 1];
shared uint hedgerow_shared_enter[HEDGEROW_SHARED_LEVELS * gl_WorkGroupSize.x + 1];
#else
const uint HEDGEROW_PRIVATE_LEVELS = HEDGEROW_LEVELS;
#endif

uvec2 hedgerow_private[HEDGEROW_PRIVATE_LEVELS + 1];

void hedgerow_put_entry(uint level, uvec2 entry) {
#ifdef HEDGEROW_SHARED_LEVELS
    if (HEDGEROW_PRIVATE_LEVELS == 0u || level < HEDGEROW_SHARED_LEVELS) {
        uint at = level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        hedgerow_shared_child[at] = entry.x;
        hedgerow_shared_enter[at] = entry.y;
        return;
    }
    level -= HEDGEROW_SHARED_LEVELS;
#endif
    hedgerow_private[level] = entry;
}

uvec2 hedgerow_entry(uint level) {
#ifdef HEDGEROW_SHARED_LEVELS
    if (HEDGEROW_PRIVATE_LEVELS == 0u || level < HEDGEROW_SHARED_LEVELS) {
        uint at = level * gl_WorkGroupSize.x + gl_LocalInvocationIndex;
        return uvec2(hedgerow_shared_child[at], hedgerow_shared_enter[at]);
    }
    level -= HEDGEROW_SHARED_LEVELS;
#endif
    return hedgerow_private[level];
}

void hedgerow_put(uint level, HedgerowWaiting waiting) {
    hedgerow_put_entry(level, hedgerow_packed(waiting));
}

HedgerowWaiting hedgerow_taken(uint level) {
    return hedgerow_unpacked(hedgerow_entry(level));
}

// The first word of an entry alone.
void hedgerow_put_child(uint level, uint child) {
#ifdef HEDGEROW_SHARED_LEVELS
    if (HEDGEROW_PRIVATE_LEVELS == 0u || level < HEDGEROW_SHARED_LEVELS) {
        hedgerow_shared_child[level * gl_WorkGroupSize.x + gl_LocalInvocationIndex] = child;
        return;
    }
    level -= HEDGEROW_SHARED_LEVELS;
#endif
    hedgerow_private[level].x = child;
}

uint hedgerow_child(uint level) {
#ifdef HEDGEROW_SHARED_LEVELS
    if (HEDGEROW_PRIVATE_LEVELS == 0u || level < HEDGEROW_SHARED_LEVELS) {
        return hedgerow_shared_child[level * gl_WorkGroupSize.x + gl_LocalInvocationIndex];
    }
    level -= HEDGEROW_SHARED_LEVELS;
#endif
    return hedgerow_private[level].x;
}

// A child that is taken however far it is: half of an entry, but for a long leaf.
void hedgerow_put_anyway(uint level, uint index, uint count) {
    if (count >= HEDGEROW_LONG_LEAF) hedgerow_put(level, HedgerowWaiting(index, count, 0.0));
    else hedgerow_put_child(level, index | count << HEDGEROW_WAITING_BITS);
}

// Its index and count.
uvec2 hedgerow_taken_anyway(uint level) {
    uint child = hedgerow_child(level), count = child >> HEDGEROW_WAITING_BITS;
    if (count == HEDGEROW_LONG_LEAF) count = hedgerow_entry(level).y;
    return uvec2(child & (1u << HEDGEROW_WAITING_BITS) - 1u, count);
}
#endif
