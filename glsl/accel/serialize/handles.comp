#version 460
// The handles, which the caller may have changed, into the instances: see accel/serialize.glsl for the contract.
#include "accel/serialize.glsl"

void main() {
    Header header = structure.header;
    uint handles = handle_count(header);
    Instances instances = instances_of(header);
    for (uint k = 0, i = grid_item(0); i < handles; i = grid_item(++k)) {
        instances.instance[i].structure = memory.handle[i];
    }
}
