// Many rays for each invocation, in turn: an invocation takes its next ray while others of its subgroup are still on their way, which
// a ray query of a driver cannot do, as it is not left in the middle.
//
//     #include "trace/query.glsl"
//     #include "trace/query_turns.glsl"
//
//     HedgerowRayQuery query;
//     HedgerowTurns turns = hedgerowTurns(structure);
//     while (hedgerowTakeTurn(turns, next < end)) {                  // next: the first ray of those that this invocation has left
//         if (turns.takes) {
//             i = next++;
//             hedgerowRayQueryInitialize(query, …);
//         }
//         if (hedgerowRayQueryProceedInTurn(query, turns, flags)) { … }     // a candidate that the shader decides on
//         if (hedgerowRayQueryEndsInTurn(query, turns)) hits[i] = …;
//     }
//
// Rays that go the same way stay together: the next ones are taken when all have ended. Where more than half of the rounds were spent
// waiting for the longest ray, each invocation takes its next one as soon as it can instead, from then on.
//
// A shader whose workgroups are one subgroup each, of at most 16 invocations, may define HEDGEROW_LANES, how many they are, before it
// includes trace/query.glsl: a constant or specialisation constant. Its lanes then load nodes and triangles one after the other
// (trace/lanes.glsl): what CPUs' drivers are faster with that load what is uniform once. It says by HEDGEROW_FORMS (trace/query_walk.glsl)
// what nodes there are, or those of either form are loaded for all lanes. Through two levels of nodes of eight each lane's own loads are
// faster. What a lane loads that needs nothing is the beginning of the structure that hedgerowTurns was told of. Rays may go into others,
// but if that is null, or with HEDGEROW_ONE_LEVEL, those meet nothing.
//
// On lavapipe the rays of `hedgerow accel` are 1.25 times as fast lane by lane as with one for each invocation (docs/notes/rays.md): those
// that go anywhere 1.6 to 2.1 times, those that go the same way 0.91 to 1.13. With each lane's own loads it was 1.13 times. Where
// HEDGEROW_ALL_BUILT (trace/query_walk.glsl) is true, no lane asks in each turn whether there is something to load.
//
// needs   votes and arithmetic of subgroups in compute shaders, with HEDGEROW_LANES ballots in place of them; all invocations of a
//         subgroup come to hedgerowTakeTurn and hedgerowRayQueryProceedInTurn together
#ifndef HEDGEROW_TRACE_QUERY_TURNS
#define HEDGEROW_TRACE_QUERY_TURNS
#include "trace/query.glsl"
#ifdef HEDGEROW_LANES
#include "trace/query_lanes.glsl"
#else
#extension GL_KHR_shader_subgroup_basic : require
#extension GL_KHR_shader_subgroup_vote : require
#extension GL_KHR_shader_subgroup_arithmetic : require
#define hedgerow_sum_of_lanes subgroupAdd
#define hedgerow_max_of_lanes subgroupMax
#endif

// Rounds of a query until its subgroup is asked again who has ended. On lavapipe 8 are as good as 16; of 1 and 32, rays have 0.88 and
// 0.93 of the speed.
const uint HEDGEROW_ROUNDS_A_TURN = 8u;

struct HedgerowTurns {
    bool takes;      // in this turn: the next ray
    bool any_takes;  // of the subgroup
    // Words, 1 or 0: trace/query_walk.glsl says why.
    uint goes;       // a ray is on its way
    uint ends;       // in this turn
    uint together;
    uint spent;      // rounds since all took a ray
    uvec2 told;      // the structure that lanes load from that need nothing
};

// Before the first turn. The structure has to be the same for all invocations of a subgroup, with HEDGEROW_LANES of the workgroup.
HedgerowTurns hedgerowTurns(HedgerowStructure structure) {
    uvec2 told = uvec2(structure);
    // Of one level what lanes load lies among its nodes and triangles.
    bool asks = HEDGEROW_ONE_LEVEL && !HEDGEROW_ALL_BUILT && any(notEqual(told, uvec2(0u)));
    if (asks) told = hedgerow_can_be_traced(structure.header) ? told : uvec2(0u);
    return HedgerowTurns(false, false, 0u, 0u, 1u, 0u, told);
}

// Whether anything is left to do in the subgroup, where this invocation has rays left or not.
//
// There is no return in the middle here either, nor in the next function. With one lavapipe keeps even constants, the numbers of lanes, in
// variables that it writes by a mask, and then compares lanes and selects words where it would insert them: rays that are loaded lane by
// lane have 0.8 of the speed (docs/notes/rays.md).
bool hedgerowTakeTurn(inout HedgerowTurns turns, bool has_rays) {
    bool waits = turns.goes == 0u && has_rays;
#ifdef HEDGEROW_LANES
    uint lanes = hedgerow_sum_of_lanes(turns.goes | (waits ? 1u << 16 : 0u));
    bool none_goes = (lanes & 0xFFFFu) == 0u, any_waits = lanes >> 16 != 0u;
#else
    bool none_goes = !subgroupAny(turns.goes != 0u), any_waits = subgroupAny(waits);
#endif
    if (none_goes) {
        uint all = hedgerow_sum_of_lanes(1u);
        bool stay = 2u * hedgerow_sum_of_lanes(turns.spent) >= all * hedgerow_max_of_lanes(turns.spent);
        turns.together = stay ? turns.together : 0u;
        turns.spent = 0u;
    }
    bool take = none_goes || turns.together == 0u;
    turns.any_takes = take && any_waits;
    turns.takes = take && waits;
    turns.goes = turns.takes ? 1u : turns.goes;
    return !none_goes || any_waits;
}

// True if a candidate waits to be decided on. If not, the query has ended or goes on in the next turn. Its flags are asked for again, as a
// compiler does not see that they are constant where they come from another turn.
bool hedgerowRayQueryProceedInTurn(inout HedgerowRayQuery query, inout HedgerowTurns turns, uint flags) {
    query.flags = flags;
    turns.ends = 0u;
    uint waits = 0u;
#ifdef HEDGEROW_LANES
    hedgerow_recall(query);
    // Not found on the way: a driver may load what is the same for all lanes where none of them is active, from what it then finds there.
    bool is_told = HEDGEROW_ALL_BUILT || any(notEqual(turns.told, uvec2(0u)));
    // Of one level the nodes and records of that structure are loaded by their indices.
    bool goes = turns.goes != 0u && (!HEDGEROW_ONE_LEVEL || all(equal(query.top, turns.told)));
    if (is_told) {
        waits = hedgerow_round_of_lanes(query, goes, turns.told, turns.ends);
        // Rays into another structure have ended. So all lanes ask the same one for the geometry of a hit, and it is loaded once.
        if (HEDGEROW_ONE_LEVEL) query.top = turns.told;
    }
    turns.ends |= goes && is_told ? 0u : turns.goes;
    turns.spent += turns.goes;
#else
    if (turns.goes != 0u) {
        uint most = turns.together != 0u ? 0xffffffffu : HEDGEROW_ROUNDS_A_TURN;
        uint left = most;
        bool ends;
        waits = hedgerow_proceed_for(query, left, true, ends) ? 1u : 0u;
        turns.ends = ends ? 1u : 0u;
        turns.spent += most - left;
    }
#endif
    return waits != 0u;
}

// Whether the query has ended in this turn: its hit is what it is.
bool hedgerowRayQueryEndsInTurn(HedgerowRayQuery query, inout HedgerowTurns turns) {
    uint ends = turns.goes & turns.ends;
    turns.goes ^= ends;
    return ends != 0u;
}
#endif
