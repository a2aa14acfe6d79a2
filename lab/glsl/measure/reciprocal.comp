#version 460
// Reciprocals by estimates and by the device's own division: lab/tests/main/gpu_reciprocal.rs compares them with the host's.
//
// reads   values[count], estimates[count]
// writes  by_estimate[count], by_device[count]
// needs   nothing of other workgroups
#include "gpu/pass.glsl"
#include "gpu/reciprocal.glsl"

layout(push_constant, scalar) uniform ReciprocalArguments {
    Floats values;
    Floats estimates;
    Floats by_estimate;
    Floats by_device;
    uint count;
};

void main() {
    uint i = invocation_number();
    if (i >= count) return;
    by_estimate.value[i] = hedgerow_rounded_reciprocal(values.value[i], estimates.value[i]);
    by_device.value[i] = hedgerow_reciprocal(values.value[i]);
}
