#version 460
// Where most entries are: see accel/rebraid.glsl for the contract.
#include "accel/rebraid.glsl"

void main() {
    rebraid_fences();
}
