#version 460
// Radix sort, the step `scatter` of one digit, a task a workgroup: see gpu/radix_sort.glsl for its contract.
#include "gpu/radix_sort.glsl"

layout(push_constant, scalar) uniform RadixSortArguments {
    Words keys;
    Words values;
    Words keys_out;
    Words values_out;
    Words table;
    uint count;
    uint shift;
    uint columns;
    uint column_keys;
    uint identity;
};

void main() {
    Radix r = Radix(keys, values, keys_out, values_out, table, count, shift, columns, column_keys, identity != 0);
    radix_scatter(r, group_number());
}
