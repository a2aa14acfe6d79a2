// Exclusive scan of words in three steps over tiles: sum each tile, scan the sums, scan each tile from its sum on.
// src/gpu/scan.rs records them and holds the twin. Sums wrap around at 2^32.
//
//   sum    reads values          writes sums[tile]
//   sums   reads sums            writes sums (exclusive), sums[tiles] = total; one workgroup
//   apply  reads values, sums    writes results (may be the values' memory)
//
// needs  one barrier between each two; any subgroup size
#ifndef HEDGEROW_GPU_SCAN
#define HEDGEROW_GPU_SCAN
#include "gpu/scan_range.glsl"

layout(push_constant, scalar) uniform ScanArguments {
    Words values;
    Words results;
    Words sums;
    uint count;
    uint rounds;   // words of an invocation in a tile
};

// Words that lie side by side which an invocation takes at once: one where a subgroup's loads shall lie side by side, several where a scan
// over lanes costs more than loads that do not.
layout(constant_id = 1) const uint EACH = 1;
#endif
