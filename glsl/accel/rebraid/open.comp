#version 460
// Opens what the round has selected: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_open(first_round, group_number());
}
