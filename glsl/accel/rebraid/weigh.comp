#version 460
// What opening the entries would save that there are at first: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_weigh(group_number());
}
