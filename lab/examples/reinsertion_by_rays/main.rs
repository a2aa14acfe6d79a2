//! What rays win that teach reinsertion, on the device: work of the next frame's rays, over that after as many rounds by area.
//!
//! `reinsertion_by_rays SCENE,… SHARE,… [ROUNDS [PASSES]]`: an H-PLOC after so many passes by area, finished; on copies of it so many rounds
//! by area and by each share of rays. Or `reinsertion_by_rays ANIMATION,… probe EVERY PASSES`.

mod frames;
mod probe;

use frames::{Frame, later, rays_of};
use hedgerow::bvh::builder::{BuildOptions, Builder, Method, Window};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::flux::GRID_BYTES;
use hedgerow::bvh::layout::{Bvh2, Triangle};
use hedgerow::bvh::reinsertion::{Cost, Probed, Reinsertion, ReinsertionOptions};
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::quality;
use hedgerow::gpu::{Recorder, Timestamps, TuningChoice};
use hedgerow::trace::flux::{FluxPass, FluxRays};
use hedgerow::trace::tracer::{self, TraceBuffers, TraceShape};
use hedgerow::trace::{Hit, Query, Ray, Work};
use hedgerow_lab::Result;
use hedgerow_lab::device::{Buffer, Device, DeviceOptions};
use hedgerow_lab::scene::{LoadOptions, Scene, load};
use hedgerow_lab::subjects::build_memory::DeviceMesh;

/// Rays that teach, at most.
const TEACHING: usize = 1 << 18;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |at: usize, otherwise: u32| arguments.get(at).map_or(otherwise, |text| text.parse().expect("a number"));
    let (rounds, before) = (number(2, 64), number(3, 0));
    if arguments[1] == "probe" {
        // The frames between those that are looked at, and the passes at the build.
        arguments[0].split(',').for_each(|name| probe::run(name, before, rounds as usize));
        return Ok(());
    }
    let device = Device::new(&DeviceOptions { tuning: TuningChoice::Auto, ..DeviceOptions::default() })?;
    let shares: Vec<f32> = arguments[1].split(',').map(|text| text.parse().expect("a share")).collect();
    for name in arguments[0].split(',') {
        let folders = std::env::var_os("HEDGEROW_SCENES").map(Into::into).into_iter().collect();
        let scene = load(name, &LoadOptions { folders, ..LoadOptions::default() })?;
        run(&device, &scene, &shares, rounds, before)?;
    }
    Ok(())
}

fn run(device: &Device, scene: &Scene, shares: &[f32], rounds: u32, before: u32) -> Result<()> {
    let built = built(device, scene, before)?;
    let bounds = scene.mesh.bounds();
    let frame = |steps: f32, size, seed| rays_of(scene, &built, later(&scene.camera, &bounds, steps), size, seed);
    let teacher = frame(0.0, [320, 180], 77);
    // The same picture with other rays; the next frame; one further on.
    let tested = [frame(0.0, [160, 120], 1), frame(1.0, [160, 120], 2), frame(4.0, [160, 120], 3)];
    let count = built.header.primitive_count;
    let options = ReinsertionOptions { rounds, ..ReinsertionOptions::FAST };
    let pass = Reinsertion::new(device, &options, count);
    let probe = Reinsertion::new(device, &ReinsertionOptions::PROBE, count);
    let scratch = device.buffer("scratch", pass.scratch_bytes_by_rays().max(probe.scratch_bytes_by_rays()))?;
    let grid = device.buffer("grid", GRID_BYTES)?;
    let found = device.buffer("found", size_of::<Probed>() as u64)?;
    let samples = taught(device, &built, &teacher)?;
    let teaching: u32 = samples.iter().map(|(count, ..)| count).sum();
    println!(
        "{}: {count} triangles, {teaching} rays teach, {} rounds after {before} passes",
        scene.name,
        pass.rounds()
    );
    let start: Vec<f64> = tested.iter().map(|frame| total(&works(device, &built, frame)?)).collect::<Result<_>>()?;
    let mut by_area: Option<Vec<Vec<f64>>> = None;
    for share in [None].into_iter().chain(shares.iter().copied().map(Some)) {
        let copy = device.upload("a copy", &built.to_bytes())?;
        let cost = share.map_or(Cost::Area, |share| Cost::Rays { grid: grid.region(), share });
        let rays: Vec<FluxRays> = samples
            .iter()
            .map(|(ray_count, rays, hits)| FluxRays::all(rays.region(), hits.region(), *ray_count))
            .collect();
        let fill =
            |recorder: &mut Recorder<'_>| FluxPass::new(device).record(recorder, copy.region(), &rays, grid.region());
        // Once to make pipelines, and once to be timed.
        let _ = milliseconds(device, fill)?;
        let filling = milliseconds(device, fill)?;
        let probes =
            |r: &mut Recorder<'_>| probe.record_probe(r, copy.region(), &cost, scratch.region(), found.region());
        let _ = milliseconds(device, probes)?;
        let probing = milliseconds(device, probes)?;
        let optimising = milliseconds(device, |r| pass.record_rounds(r, copy.region(), &cost, scratch.region()))?;
        let probed: Probed = found.read(1)[0];
        let tree = Bvh2::<Triangle>::from_bytes(&copy.read::<u8>(built.to_bytes().len()))?;
        tree.validate()?;
        let now: Vec<Vec<f64>> = tested.iter().map(|frame| works(device, &tree, frame)).collect::<Result<_>>()?;
        let by_area = by_area.get_or_insert_with(|| now.clone());
        let sum = |work: &Vec<f64>| work.iter().sum::<f64>();
        let ratio = |k: usize| sum(&now[k]) / sum(&by_area[k]);
        let kinds: Vec<String> = now[1].iter().zip(&by_area[1]).map(|(a, b)| format!("{:.3}", a / b)).collect();
        let way = share.map_or("area".to_owned(), |share| format!("rays, {share}"));
        println!(
            "  {way:10} same {:.3}  next {:.3}  further {:.3}  next by kind {}  next over start {:.3}  sah {:.2}  flux {filling:.1} ms  \
             rounds {optimising:.0} ms  probe {probing:.1} ms, {:.4}",
            ratio(0),
            ratio(1),
            ratio(2),
            kinds.join(" "),
            sum(&now[1]) / start[1],
            quality::of(&tree, 3.0, 2.0).sah,
            probed.relative_gain(tree.header.node_slots),
        );
    }
    Ok(())
}

/// An H-PLOC with leaves as they are cheapest.
fn built(device: &Device, scene: &Scene, passes: u32) -> Result<Bvh2> {
    let options = BuildOptions {
        method: Method::Hploc(Window::DEFAULT),
        codes: Some(Code::Mc63.full()),
        optimise: (passes > 0).then(|| ReinsertionOptions::of_passes(passes)),
        collapse: Collapse::SAH,
        ..BuildOptions::DEFAULT
    };
    let mesh = DeviceMesh::new(device, &scene.mesh.positions, &scene.mesh.triangles)?;
    let builder = Builder::new(device, &options, scene.mesh.triangles.len() as u32)?;
    let sizes = builder.sizes();
    let structure = device.buffer("structure", sizes.structure)?;
    let scratch = device.buffer("scratch", sizes.scratch)?;
    device.run(None, |r| builder.record(r, &mesh.input, structure.region(), scratch.region()))?;
    Ok(Bvh2::from_bytes(&structure.read::<u8>(sizes.structure as usize))?)
}

/// Rays that teach with their closest hits, kind by kind: every so many of a frame.
fn taught<'a>(device: &'a Device, tree: &Bvh2, frame: &Frame) -> Result<Vec<(u32, Buffer<'a>, Buffer<'a>)>> {
    let all: usize = frame.iter().map(|(_, rays)| rays.len()).sum();
    let stride = all.div_ceil(TEACHING).max(1);
    let of_kind = |(_, rays): &(Query, Vec<Ray>)| {
        let rays: Vec<Ray> = rays.iter().step_by(stride).copied().collect();
        let hits = frames::closest(tree, &rays);
        Ok((rays.len() as u32, device.upload("rays", &rays)?, device.upload("hits", &hits)?))
    };
    frame.iter().map(of_kind).collect()
}

/// 3 a step and 2 a test of all rays, by kind.
fn works(device: &Device, tree: &Bvh2, frame: &Frame) -> Result<Vec<f64>> {
    let structure = device.upload("structure", &tree.to_bytes())?;
    let of_kind = |(query, rays): &(Query, Vec<Ray>)| {
        let uploaded = device.upload("rays", rays)?;
        let hits = device.buffer("hits", (rays.len() * size_of::<Hit>()) as u64)?;
        let work = device.buffer("work", (rays.len() * size_of::<Work>()) as u64)?;
        let buffers = TraceBuffers {
            structure: structure.address(),
            rays: uploaded.region(),
            hits: hits.region(),
            work: Some(work.region()),
            count: rays.len() as u32,
        };
        device.run(None, |r| tracer::record(r, &TraceShape::of(device), *query, &buffers))?;
        let all: Vec<Work> = work.read(rays.len());
        Ok(all.iter().map(|work| f64::from(3 * work.steps + 2 * work.tests)).sum())
    };
    frame.iter().map(of_kind).collect()
}

fn total(work: &[f64]) -> Result<f64> {
    Ok(work.iter().sum())
}

fn milliseconds(device: &Device, record: impl FnOnce(&mut Recorder<'_>) -> hedgerow::Result<()>) -> Result<f64> {
    let mut timestamps = Timestamps::new(device, 4)?;
    device.run(Some(&mut timestamps), record)?;
    Ok(timestamps.phases()?.iter().map(|phase| phase.milliseconds).sum())
}
