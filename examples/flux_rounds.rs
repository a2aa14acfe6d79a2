//! An engine whose camera moves: the rays that it traced teach a copy of its tree, and the next frame's rays decide which is better.
//!
//! In the first of four frames a part of the rays goes onto a grid. In three frames reinsertion makes a few rounds on the copy, by that
//! grid. In the fourth a part of the rays is traced in both trees, and the copy is taken if it takes less work by more than 1%. A frame is
//! one command buffer, and nothing is read back but for the lines that are printed. An engine has its own device and memory
//! (`examples/engine.rs`); here they are the laboratory's.
//!
//! ```text
//! cargo run --release --example flux_rounds
//! ```

use hedgerow::bvh::codes::Code;
use hedgerow::bvh::flux::GRID_BYTES;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::reinsertion::{Cost, Reinsertion, ReinsertionOptions};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::gpu::TuningChoice;
use hedgerow::trace::counts::CountedRays;
use hedgerow::trace::flux::{FluxPass, FluxRays};
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::trial::{Trial, TrialResult, TrialTrees};
use hedgerow::trace::twin::tracer as on_host;
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_lab::Result;
use hedgerow_lab::device::{Device, DeviceOptions};
use hedgerow_lab::rays::kinds::{self, RayKind, RayOptions};
use hedgerow_lab::scene::{self, LoadOptions, Scene};

/// Of a frame's rays every fourth teaches, or decides.
const STRIDE: u32 = 4;
/// Frames from one grid to the next.
const FRAMES_A_TRIAL: u32 = 4;
/// Rounds of a frame; 64 are a pass.
const ROUNDS: ReinsertionOptions = ReinsertionOptions { rounds: 16, stride: 64 };

fn main() -> Result<()> {
    let device = Device::new(&DeviceOptions { tuning: TuningChoice::Auto, ..DeviceOptions::default() })?;
    fly(&device, 12, |frame, work, trial| {
        print!("frame {frame:2}: {work:.1} of work a ray");
        if let Some(TrialResult { work: [before, after], is_taken, .. }) = trial {
            let what = if is_taken == 1 { "taken" } else { "not taken" };
            print!("; the copy takes {:.3} of it and is {what}", after as f64 / before.max(1) as f64);
        }
        println!();
    })
}

/// Flies for some frames, and tells the work a ray of each, and how the trial went if there was one.
pub fn fly(device: &Device, frames: u32, mut told: impl FnMut(u32, f64, Option<TrialResult>)) -> Result<()> {
    let mut scene = scene::load("gen:stadium:4", &LoadOptions::default())?;
    let tree = lbvh::build(&scene.mesh.positions, &scene.mesh.triangles, Code::Mc30.full(), Collapse::SAH);
    let primitives = tree.header.primitive_count;

    // What an engine makes once.
    let structure = device.upload("structure", &tree.to_bytes())?;
    let copy = device.upload("copy", &tree.to_bytes())?;
    let result = device.buffer("result", size_of::<TrialResult>() as u64)?;
    let trees = TrialTrees { structure: structure.region(), copy: copy.region(), result: result.region() };
    let grid = device.buffer("grid", GRID_BYTES)?;
    let scratch = device.buffer("scratch", Reinsertion::new(device, &ROUNDS, primitives).scratch_bytes_by_rays())?;
    let trial = Trial::new(device, Collapse::SAH, primitives);
    let cost = Cost::Rays { grid: grid.region(), share: Cost::SHARE };
    let mut rounds_made = 0;

    for frame in 0..frames {
        scene.camera.eye[0] += 0.02 * frame as f32;
        let rays = bounced_rays(&scene, &tree)?;
        let ray_count = rays.len() as u32;
        let rays = device.upload("rays", &rays)?;
        let hits = device.buffer("hits", u64::from(ray_count) * size_of::<Hit>() as u64)?;
        let work = device.buffer("work", u64::from(ray_count) * size_of::<Work>() as u64)?;
        let step = frame % FRAMES_A_TRIAL;
        let rounds = Reinsertion::new(device, &ROUNDS, primitives).from_round(rounds_made);
        device.run(None, |recorder| {
            let buffers = TraceBuffers {
                structure: trees.structure.address,
                rays: rays.region(),
                hits: hits.region(),
                work: Some(work.region()),
                count: ray_count,
            };
            tracer::record(recorder, &TraceShape::of(device), Query::ClosestHit, &buffers)?;
            let first = frame % STRIDE;
            if step == FRAMES_A_TRIAL - 1 {
                let part = CountedRays { rays: rays.region(), ray_count, first, stride: STRIDE };
                trial.record_begin(recorder, &trees)?;
                recorder.barrier();
                trial.record_rays(recorder, Query::ClosestHit, &part, &trees)?;
                recorder.barrier();
                return trial.record_decision(recorder, &trees);
            }
            recorder.barrier();
            if step == 0 {
                let part = FluxRays { rays: rays.region(), hits: hits.region(), ray_count, first, stride: STRIDE };
                FluxPass::new(device).record(recorder, trees.structure, &[part], grid.region())?;
                recorder.barrier();
            }
            rounds.record_rounds(recorder, trees.copy, &cost, scratch.region())
        })?;
        let all: Vec<Work> = work.read(ray_count as usize);
        let sum: u64 = all.iter().map(|work| u64::from(3 * work.steps + 2 * work.tests)).sum();
        let work = sum as f64 / f64::from(ray_count.max(1));
        if step == FRAMES_A_TRIAL - 1 {
            told(frame, work, Some(result.read(1)[0]));
        } else {
            rounds_made += rounds.rounds();
            told(frame, work, None);
        }
    }
    Ok(())
}

/// What an engine has from its own primary rays.
fn bounced_rays(scene: &Scene, tree: &Bvh2) -> Result<Vec<Ray>> {
    let options = RayOptions { size: [160, 120], seed: 1 };
    let closest = |rays: &[Ray]| Ok(rays.iter().map(|ray| on_host::closest_hit(tree, ray)).collect());
    let primary = kinds::generate(RayKind::Primary, scene, &options, &mut { closest })?;
    let bounced = kinds::generate(RayKind::Diffuse1, scene, &options, &mut { closest })?;
    Ok([primary, bounced].concat())
}
