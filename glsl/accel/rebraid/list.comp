#version 460
// Lists what the round opens: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_list(this_round, group_number());
}
