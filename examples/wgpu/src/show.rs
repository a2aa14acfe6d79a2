//! What wgpu does with the picture: a render pass into a texture, which is read back where a window would show it.

use crate::Result;

const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
const PIXEL_BYTES: u32 = 4;

pub struct Show {
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    texture: wgpu::Texture,
    read_back: wgpu::Buffer,
}

impl Show {
    /// Shows what lies in `light`, four floats a pixel.
    pub fn new(device: &wgpu::Device, light: &wgpu::Buffer, [width, height]: [u32; 2]) -> Show {
        let module = device.create_shader_module(wgpu::include_wgsl!("show.wgsl"));
        let pipeline = device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: None,
            layout: None,
            vertex: wgpu::VertexState {
                module: &module,
                entry_point: Some("whole"),
                compilation_options: Default::default(),
                buffers: &[],
            },
            primitive: Default::default(),
            depth_stencil: None,
            multisample: Default::default(),
            fragment: Some(wgpu::FragmentState {
                module: &module,
                entry_point: Some("shown"),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &[("width", f64::from(width))],
                    ..Default::default()
                },
                targets: &[Some(FORMAT.into())],
            }),
            multiview_mask: None,
            cache: None,
        });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: light.as_entire_binding() }],
        });
        let texture = device.create_texture(&wgpu::TextureDescriptor {
            label: None,
            size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: FORMAT,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        let read_back = device.create_buffer(&wgpu::BufferDescriptor {
            label: None,
            size: u64::from(row_bytes(width) * height),
            usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
            mapped_at_creation: false,
        });
        Show { pipeline, bindings, texture, read_back }
    }

    /// Records the pass, and a copy for [`Show::pixels`].
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        let view = self.texture.create_view(&Default::default());
        let attachment = wgpu::RenderPassColorAttachment {
            view: &view,
            depth_slice: None,
            resolve_target: None,
            ops: wgpu::Operations { load: wgpu::LoadOp::Clear(wgpu::Color::BLACK), store: wgpu::StoreOp::Store },
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            color_attachments: &[Some(attachment)],
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.draw(0..3, 0..1);
        drop(pass);
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(row_bytes(self.texture.width())),
            rows_per_image: None,
        };
        let target = wgpu::TexelCopyBufferInfo { buffer: &self.read_back, layout };
        encoder.copy_texture_to_buffer(self.texture.as_image_copy(), target, self.texture.size());
    }

    /// The picture of the last frame that was submitted, when that has finished.
    pub fn pixels(&self, device: &wgpu::Device) -> Result<image::RgbImage> {
        let (mapped, whether_mapped) = std::sync::mpsc::channel();
        self.read_back.map_async(wgpu::MapMode::Read, .., move |result| {
            let _ = mapped.send(result);
        });
        const LONGEST: std::time::Duration = std::time::Duration::from_secs(60);
        device.poll(wgpu::PollType::Wait { submission_index: None, timeout: Some(LONGEST) })?;
        whether_mapped.recv()??;
        let bytes = self.read_back.get_mapped_range(..)?;
        let row = row_bytes(self.texture.width());
        let image = image::RgbImage::from_fn(self.texture.width(), self.texture.height(), |x, y| {
            let at = (y * row + PIXEL_BYTES * x) as usize;
            image::Rgb([bytes[at], bytes[at + 1], bytes[at + 2]])
        });
        drop(bytes);
        self.read_back.unmap();
        Ok(image)
    }
}

/// Bytes of a row where a copy puts it.
fn row_bytes(width: u32) -> u32 {
    (PIXEL_BYTES * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT)
}
