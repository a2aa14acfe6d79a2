#version 460
// What opening entries would save: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_weigh(first_round, group_number());
}
