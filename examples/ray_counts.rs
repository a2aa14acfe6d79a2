//! An engine whose camera moves: its shadow rays teach the tree which child to look into first.
//!
//! Each frame counts a sixteenth of its rays beside tracing all of them; every fourth frame puts the children of the tree in the order
//! that was learned, of which the counts of earlier frames weigh half. A frame is one command buffer. An engine has its own device and
//! memory (`examples/engine.rs`); here they are the laboratory's.
//!
//! ```text
//! cargo run --release --example ray_counts
//! ```

use hedgerow::bvh::child_order::{ChildOrder, ChildOrderPass};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::gpu::TuningChoice;
use hedgerow::trace::counts::{CountPass, CountedRays, CountedWalk, Earlier, Tallies};
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::twin::tracer as on_host;
use hedgerow::trace::{Hit, Ray, Work};
use hedgerow_lab::Result;
use hedgerow_lab::device::{Device, DeviceOptions};
use hedgerow_lab::rays::kinds::{self, RayKind, RayOptions};
use hedgerow_lab::scene::{self, LoadOptions, Scene};

/// Of a frame's rays every sixteenth is counted, in each frame others.
const STRIDE: u32 = 16;
/// Frames from one order of children to the next.
const FRAMES_AN_ORDER: u32 = 4;

fn main() -> Result<()> {
    let device = Device::new(&DeviceOptions { tuning: TuningChoice::Auto, ..DeviceOptions::default() })?;
    let mut scene = scene::load("gen:stadium:4", &LoadOptions::default())?;
    let tree = lbvh::build(&scene.mesh.positions, &scene.mesh.triangles, Code::Emc64Var.full(), Collapse::SAH);
    let primitives = tree.header.primitive_count;
    let structure = device.upload("structure", &tree.to_bytes())?;

    // What an engine makes once.
    let count = CountPass::new(&device, Collapse::SAH, primitives);
    let order = ChildOrderPass::new(&device, ChildOrder::MoreHitsForItsCost, Collapse::SAH, primitives);
    let tallies = device.buffer("tallies", count.tally_bytes())?;
    let counts = device.buffer("counts", count.counts_bytes())?;
    let scratch = device.buffer("scratch", count.scratch_bytes().max(order.scratch_bytes()))?;
    let counted = Tallies { structure: structure.region(), tallies: tallies.region() };
    device.run(None, |recorder| {
        count.record_clear(recorder, &counted)?;
        // Before any ray is counted, the order by surface area.
        order.record(recorder, structure.region(), scratch.region())
    })?;

    for frame in 0..12 {
        scene.camera.eye[0] += 0.02 * frame as f32;
        let rays = shadow_rays(&scene, &tree)?;
        let ray_count = rays.len() as u32;
        let rays = device.upload("rays", &rays)?;
        let hits = device.buffer("hits", u64::from(ray_count) * size_of::<Hit>() as u64)?;
        let work = device.buffer("work", u64::from(ray_count) * size_of::<Work>() as u64)?;
        let structure = structure.region();
        device.run(None, |recorder| {
            let buffers = TraceBuffers {
                structure: structure.address,
                rays: rays.region(),
                hits: hits.region(),
                work: Some(work.region()),
                count: ray_count,
            };
            tracer::record_left_first(recorder, &TraceShape::of(&device), &buffers)?;
            // Both only read the structure: no barrier between them.
            let part = CountedRays { rays: rays.region(), ray_count, first: frame % STRIDE, stride: STRIDE };
            count.record_rays(recorder, CountedWalk::Exhaustive, &part, &counted)?;
            if frame % FRAMES_AN_ORDER != FRAMES_AN_ORDER - 1 {
                return Ok(());
            }
            recorder.barrier();
            let earlier = if frame < FRAMES_AN_ORDER { Earlier::Dropped } else { Earlier::Halved };
            count.record_gather(recorder, &counted, counts.region(), scratch.region(), earlier)?;
            recorder.barrier();
            order.record_by_counts(recorder, structure, counts.region(), scratch.region())
        })?;
        let work: Vec<Work> = work.read(ray_count as usize);
        let sum: u64 = work.iter().map(|work| u64::from(3 * work.steps + 2 * work.tests)).sum();
        println!(
            "frame {frame:2}: {ray_count} shadow rays, {:.1} of work a ray",
            sum as f64 / f64::from(ray_count.max(1))
        );
    }
    Ok(())
}

/// What an engine has from its own primary rays.
fn shadow_rays(scene: &Scene, tree: &hedgerow::bvh::layout::Bvh2) -> Result<Vec<Ray>> {
    let options = RayOptions { size: [160, 120], seed: 1 };
    let closest = |rays: &[Ray]| Ok(rays.iter().map(|ray| on_host::closest_hit(tree, ray)).collect());
    kinds::generate(RayKind::Shadow, scene, &options, &mut { closest })
}
