// Many rays for each invocation, in turn: an invocation takes its next ray while others of its subgroup are still on their way, which
// a ray query of a driver cannot do, as it is not left in the middle.
//
//     #include "trace/query.glsl"
//     #include "trace/query_turns.glsl"
//
//     HedgerowRayQuery query;
//     HedgerowTurns turns = hedgerowTurns();
//     while (hedgerowTakeTurn(turns, next < end)) {                  // next: the first ray of those that this invocation has left
//         if (turns.takes) {
//             i = next++;
//             hedgerowRayQueryInitialize(query, …);
//         }
//         while (hedgerowRayQueryProceedInTurn(query, turns)) { … }  // candidates that the shader decides on
//         if (hedgerowRayQueryEndsInTurn(query, turns)) hits[i] = …;
//     }
//
// Rays that go the same way stay together: the next ones are taken when all have ended. Where more than half of the rounds were spent
// waiting for the longest ray, each invocation takes its next one as soon as it can instead, from then on.
//
// On lavapipe the rays of `hedgerow accel` are 1.14 times as fast as with one for each invocation (docs/notes/rays.md): those that
// go anywhere 1.3 to 1.8 times, those that go the same way 0.94 to 1.04.
//
// needs   votes and arithmetic of subgroups in compute shaders; all invocations of a subgroup come to hedgerowTakeTurn together
#ifndef HEDGEROW_TRACE_QUERY_TURNS
#define HEDGEROW_TRACE_QUERY_TURNS
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#include "trace/query.glsl"

// Rounds of a query until its subgroup is asked again who has ended. On lavapipe 8 are as good as 16; of 1 and 32, rays have 0.88 and
// 0.93 of the speed.
const uint HEDGEROW_ROUNDS_A_TURN = 8u;

struct HedgerowTurns {
    bool takes;      // in this turn: the next ray
    bool goes;       // a ray is on its way
    bool together;
    uint left;       // rounds of this turn
    uint spent;      // rounds since all took a ray
};

HedgerowTurns hedgerowTurns() {
    return HedgerowTurns(false, false, true, 0u, 0u);
}

// Whether anything is left to do in the subgroup, where this invocation has rays left or not.
bool hedgerowTakeTurn(inout HedgerowTurns turns, bool has_rays) {
    bool none_goes = !subgroupAny(turns.goes);
    if (none_goes) {
        if (!subgroupAny(has_rays)) return false;
        uint lanes = subgroupAdd(1u);
        turns.together = turns.together && 2u * subgroupAdd(turns.spent) >= lanes * subgroupMax(turns.spent);
        turns.spent = 0u;
    }
    turns.takes = !turns.goes && has_rays && (none_goes || !turns.together);
    turns.goes = turns.goes || turns.takes;
    turns.left = turns.together ? 0xffffffffu : HEDGEROW_ROUNDS_A_TURN;
    return true;
}

// True while a candidate waits to be decided on. When it is false the query has ended, or goes on in the next turn.
bool hedgerowRayQueryProceedInTurn(inout HedgerowRayQuery query, inout HedgerowTurns turns) {
    if (!turns.goes) return false;
    uint before = turns.left;
    bool waits = hedgerow_proceed_for(query, turns.left, true);
    turns.spent += before - turns.left;
    return waits;
}

// Whether the query has ended in this turn: its hit is what it is. One that ends with the last of its rounds does so in the next.
bool hedgerowRayQueryEndsInTurn(HedgerowRayQuery query, inout HedgerowTurns turns) {
    bool ends = turns.goes && turns.left != 0u;
    if (ends) turns.goes = false;
    return ends;
}
#endif
