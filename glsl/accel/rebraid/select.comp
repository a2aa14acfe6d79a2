#version 460
// How many entries of each chunk are opened: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_select(this_round, group_number());
}
