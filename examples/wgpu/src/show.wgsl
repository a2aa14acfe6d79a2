// wgpu's own pass: linear light from the buffer that hedgerow's rays have filled, as colours of the picture.

override width: u32;

@group(0) @binding(0) var<storage, read> light: array<vec4f>;

@vertex
fn whole(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    // One triangle that covers the picture.
    return vec4f(f32(corner % 2u) * 4.0 - 1.0, f32(corner / 2u) * 4.0 - 1.0, 0.0, 1.0);
}

@fragment
fn shown(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = light[u32(at.y) * width + u32(at.x)];
    return vec4f(pow(pixel.rgb, vec3f(1.0 / 2.2)), 1.0);
}
