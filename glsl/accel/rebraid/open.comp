#version 460
// Opens what the round has listed, and weighs what comes to be: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_open(this_round, group_number());
}
