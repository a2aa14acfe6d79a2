// Clones a structure: the bytes that its header counts. Anything else becomes an empty one with the status
// WRONG_VERSION.
//
// reads   source
// writes  target
// needs   one barrier before and after; any number of workgroups; any subgroup size; no overlap of the two
#version 460
#include "bvh/copy.glsl"

layout(push_constant, scalar) uniform CopyStructureArguments {
    Structure source;
    Structure target;
};

void main() {
    Header header = source.header;
    if (!is_structure(header)) {
        write_wrong_version(target);
        return;
    }
    copy_bytes(uvec2(source), uvec2(target), structure_bytes(header));
}
