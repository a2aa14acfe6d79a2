#version 460
// Radix sort, the step `scan` of one digit, a task a workgroup: see gpu/radix_sort.glsl for its contract.
#include "gpu/radix_sort/pass.glsl"

void main() {
    Radix r;
    if (is_done(r)) radix_scan(r, group_number());
}
