//! An engine on wgpu that builds and traces with hedgerow: one device, one queue, one submit a frame.
//!
//! wgpu uploads a mesh, hedgerow builds a structure over it, the engine's own shader (`trace.comp`) traces rays through it, and wgpu
//! shows what they have seen. All of it is wgpu's: the device, the queue, the buffers, the command encoders. So all that hedgerow
//! needs is a device with its features (`engine.rs`) and buffers with addresses (`memory.rs`).
//!
//! What keeps the parts in order, without a semaphore of the engine's:
//!
//! - A frame is one `Queue::submit`: wgpu's uploads, the two encoders of [`engine::frame`], the encoder of [`show::Show`]. wgpu puts
//!   all into one `vkQueueSubmit`, and commands begin in this order.
//! - `transition_resources` tells wgpu how hedgerow uses each buffer. wgpu places the barriers before it: uploads are finished and
//!   visible before the build reads them.
//! - The picture is left in the state "written in shaders". The render pass reads it, so wgpu places the barrier between them.
//! - The next frame writes the same memory again. Each submit of wgpu's waits for the one before, by a semaphore of wgpu's own.
//!
//! ```text
//! make test-wgpu
//! cargo run --release -p hedgerow-on-wgpu -- scenes/knot.ply picture.png [the picture of hedgerow render]
//! ```

mod compare;
mod engine;
mod memory;
mod scene;
mod show;
mod tracing;

use hedgerow::accel::{self, Placement, Request};
use hedgerow::bvh::geometry::Geometry;
use hedgerow::gpu::Context;
use memory::Shared;
use scene::{Camera, Mesh};

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// What `make test-wgpu` tells `hedgerow render`, too.
const SIZE: [u32; 2] = [640, 480];

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (scene, picture, other) = match &arguments[..] {
        [scene, picture] => (scene, picture, None),
        [scene, picture, other] => (scene, picture, Some(other)),
        _ => return Err("usage: hedgerow-on-wgpu SCENE.ply PICTURE.png [OTHER.png]".into()),
    };
    let image = draw(&Mesh::read(scene)?)?;
    image.save(picture).map_err(|error| format!("{picture}: {error}"))?;
    match other {
        Some(other) => compare::compare(&image, &image::open(other)?.to_rgb8()),
        None => Ok(()),
    }
}

/// Two frames: the first of the mesh upside down, so that the second has to build, trace and show anew.
fn draw(mesh: &Mesh) -> Result<image::RgbImage> {
    let backends = wgpu::Backends::VULKAN;
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
        backends,
        ..wgpu::InstanceDescriptor::new_without_display_handle()
    });
    let adapter = pollster::block_on(instance.request_adapter(&Default::default()))?;
    println!("on {}", adapter.get_info().name);
    // SAFETY: `Scene` lets go of the context before the device.
    let ((device, queue), context) = unsafe { engine::open(&adapter) }?;
    let scene = Scene::new(device, queue, context, mesh)?;
    let turned: Vec<_> = mesh.positions.iter().map(|&[x, y, z]| [x, -z, y]).collect();
    scene.frame(&turned)?;
    let first = scene.show.pixels(&scene.device)?;
    scene.frame(&mesh.positions)?;
    let second = scene.show.pixels(&scene.device)?;
    if first == second {
        return Err("both frames show the same, so the second has changed nothing".into());
    }
    Ok(second)
}

/// What lives from frame to frame. Fields are dropped in this order: the device comes last.
struct Scene {
    tracing: tracing::Tracing,
    context: Context,
    show: show::Show,
    request: Request,
    positions: Shared,
    triangles: Shared,
    picture: Shared,
    structure: Shared,
    scratch: Shared,
    queue: wgpu::Queue,
    device: wgpu::Device,
}

impl Scene {
    fn new(device: wgpu::Device, queue: wgpu::Queue, context: Context, mesh: &Mesh) -> Result<Scene> {
        let shared = |size: u64| Shared::new(&device, size);
        let positions = shared(size_of_val(&mesh.positions[..]) as u64)?;
        let triangles = shared(size_of_val(&mesh.triangles[..]) as u64)?;
        let picture = shared(u64::from(SIZE[0] * SIZE[1]) * 16)?;
        let vertex_count = mesh.positions.len() as u32;
        let geometry = Geometry::mesh(positions.region.address, vertex_count, triangles.region.address);
        let request = Request::triangles(&[(geometry, mesh.triangles.len() as u32)]);
        let sizes = request.sizes(&accel::Device::new(&context))?;
        let (structure, scratch) = (shared(sizes.structure)?, shared(sizes.scratch)?);
        let show = show::Show::new(&device, &picture.buffer, SIZE);
        let tracing = tracing::Tracing::new(context.ash_device())?;
        queue.write_buffer(&triangles.buffer, 0, bytemuck::cast_slice(&mesh.triangles));
        Ok(Scene { tracing, context, show, request, positions, triangles, picture, structure, scratch, queue, device })
    }

    fn frame(&self, positions: &[[f32; 3]]) -> Result<()> {
        self.queue.write_buffer(&self.positions.buffer, 0, bytemuck::cast_slice(positions));

        let encoder = || self.device.create_command_encoder(&Default::default());
        let [mut before, mut commands, mut after] = [encoder(), encoder(), encoder()];
        let read = [&self.positions, &self.triangles].map(Shared::read);
        let written = [&self.structure, &self.scratch, &self.picture].map(Shared::written);
        let mesh = Placement { request: &self.request, structure: self.structure.region, scratch: self.scratch.region };
        let push = tracing::Push {
            scene: self.structure.region.address,
            positions: self.positions.region.address,
            triangles: self.triangles.region.address,
            picture: self.picture.region.address,
            size: SIZE,
            camera: Camera::of_knot(SIZE),
        };
        // SAFETY: the buffers outlive the frame: `transition_resources` keeps each until the queue has finished.
        unsafe {
            engine::frame(
                &self.context,
                [&mut before, &mut commands],
                read.into_iter().chain(written),
                mesh,
                |commands| {
                    self.tracing.record(commands, &push);
                    Ok(())
                },
            )
        }?;
        self.show.record(&mut after);
        self.queue.submit([before.finish(), commands.finish(), after.finish()]);
        Ok(())
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // Pipelines are destroyed next, and no command may use them any more.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
    }
}
