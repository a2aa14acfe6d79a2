#version 460
// Probe of division: src/gpu/probe.rs compares what it gives with the host.
//
// reads   numerators[count], denominators[count]
// writes  quotients[count]
// needs   nothing of other workgroups
#include "gpu/pass.glsl"

layout(push_constant, scalar) uniform DivideArguments {
    Floats numerators;
    Floats denominators;
    Floats quotients;
    uint count;
};

void main() {
    uint i = invocation_number();
    if (i >= count) return;
    precise float quotient = numerators.value[i] / denominators.value[i];
    quotients.value[i] = quotient;
}
