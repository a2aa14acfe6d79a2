// Traces rays through the driver's own acceleration structure: the peer of trace/, with its rays and its hits.
//
// wants  a device with VK_KHR_ray_query: the pipeline is made only there
#version 460
#extension GL_EXT_scalar_block_layout : require
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference2 : require
#extension GL_EXT_ray_query : require
layout(local_size_x_id = 0) in;
#include "measure/ray_query.glsl"
