//! What merging costs on the device beside building anew: prints the figures of docs/notes/kdtree.md. Needs the scenes of
//! HEDGEROW_SCENES and minutes:
//!
//! `cargo test --release --test kdtree_merge_device_cost -- --ignored --nocapture`

use crate::common::corpus::{self, Mesh};
use crate::common::device;
use crate::common::shapes::Corners;
use hedgerow::bvh::builder::Input;
use hedgerow::bvh::layout::status;
use hedgerow::gpu::{Phase, Timestamps};
use hedgerow::kdtree::builder::{self, KdBuilder, KdReport as BuildReport, KdSchedule};
use hedgerow::kdtree::merge::{MergeCapacity, MergeEstimate, MergeMemory, MergeOptions, MergeReport, Merger, Object};
use hedgerow_lab::device::Buffer;
use hedgerow_lab::scene::{LoadOptions, load};
use std::collections::BTreeMap;

const ROUNDS: usize = 9;
const SCHEDULES: [KdSchedule; 2] = [KdSchedule::Chain, KdSchedule::Persistent];

fn input_of((_, positions, triangles): &Mesh) -> (Input, [Buffer<'static>; 2]) {
    let vertices = device().upload("positions", positions).expect("memory");
    let indices = device().upload("indices", triangles).expect("memory");
    let input = Input::mesh(vertices.address(), positions.len() as u32, indices.address(), triangles.len() as u32);
    (input, [vertices, indices])
}

/// Milliseconds by phase.
fn timed(record: impl FnOnce(&mut hedgerow::gpu::Recorder<'_>) -> hedgerow::Result<()>) -> Vec<Phase> {
    let mut timestamps = Timestamps::new(device(), 400).expect("timestamps");
    device().run(Some(&mut timestamps), record).expect("a run");
    timestamps.phases().expect("timestamps")
}

fn total(phases: &[Phase]) -> f64 {
    phases.iter().map(|phase| phase.milliseconds).sum()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

/// A twentieth of the scene's triangles: those around one of them, a little beside where they are.
fn patch(all: &Corners) -> Corners {
    let centre = |t: &[[f32; 3]; 3]| -> [f32; 3] { std::array::from_fn(|k| (t[0][k] + t[1][k] + t[2][k]) / 3.0) };
    let middle = centre(&all[all.len() / 3]);
    let distance = |t: &[[f32; 3]; 3]| (0..3).map(|k| (centre(t)[k] - middle[k]).powi(2)).sum::<f32>();
    let mut near = all.clone();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    near.truncate(all.len() / 20);
    let by = near.last().map_or(0.0, distance).sqrt() * 0.3;
    near.iter().map(|t| t.map(|p| [p[0] + by, p[1] + 0.7 * by, p[2] - 0.4 * by])).collect()
}

/// The scenes that merging is measured in.
fn scenes(names: &[&'static str]) -> impl Iterator<Item = (&'static str, Corners)> {
    let folders = std::env::var_os("HEDGEROW_SCENES").into_iter().map(Into::into).collect();
    let loading = LoadOptions { folders, progress: None };
    names.iter().map(move |name| {
        let mesh = load(name, &loading).expect(name).mesh;
        (*name, mesh.triangles.iter().map(|t| t.map(|i| mesh.positions[i as usize])).collect())
    })
}

#[test]
#[ignore = "prints what merging costs, in minutes, over scenes that are not in the repository"]
fn merging_beside_building_on_the_device() {
    for (name, corners) in scenes(&["bunny", "sponza", "armadillo"]) {
        let still = corpus::soup(name, corners.clone());
        let moves = corpus::soup("object", patch(&corners));
        let both = corpus::soup("both", corners.iter().copied().chain(patch(&corners)).collect());
        let options = MergeOptions::DEFAULT;
        let (count, triangles) = (still.2.len() as u32, moves.2.len() as u32);
        let most = MergeCapacity { objects: 1, triangles };
        let build = builder::KdOptions { more: Merger::room(&options, most), ..options.build };
        let (still_builder, builder) = (
            KdBuilder::new(device(), &build, count).expect("a builder"),
            KdBuilder::new(device(), &options.build, count + triangles).expect("a builder"),
        );
        let mergers = SCHEDULES.map(|schedule| {
            let build = builder::KdOptions { schedule: Some(schedule), ..options.build };
            Merger::new(device(), &MergeOptions { build, ..options }, &still_builder.header(), most).expect("a merger")
        });
        let buffer = |bytes: u64| device().buffer("memory", bytes).expect("memory");
        let (structure, other) = (buffer(still_builder.sizes().structure), buffer(builder.sizes().structure));
        let building = buffer(still_builder.sizes().scratch.max(builder.sizes().scratch));
        let sizes = mergers.each_ref().map(Merger::sizes);
        let scratch = buffer(sizes.iter().map(|sizes| sizes.scratch).max().expect("schedules"));
        let undo = buffer(sizes[0].undo);
        let memory = MergeMemory { structure: structure.region(), scratch: scratch.region(), undo: undo.region() };
        let ((still_input, _a), (input, _b), (both_input, _c)) = (input_of(&still), input_of(&moves), input_of(&both));
        timed(|recorder| still_builder.record(recorder, &still_input, structure.region(), building.region()));
        let object = Object { input, first_primitive: count, tree: None };
        let (mut builds, mut merges, mut restores) = (Vec::new(), SCHEDULES.map(|_| Vec::new()), Vec::new());
        let mut by_phase = SCHEDULES.map(|_| BTreeMap::<&str, f64>::new());
        for round in 0..=ROUNDS {
            let built = timed(|r| builder.record(r, &both_input, other.region(), building.region()));
            let report: BuildReport = building.read_at(builder.report_range().start, 1)[0];
            assert_eq!(report.status & status::OUT_OF_ROOM, 0, "{report:?}");
            // The first compiles.
            if round > 0 {
                builds.push(total(&built));
            }
            for (i, merger) in mergers.iter().enumerate() {
                let merged = timed(|r| merger.record(r, memory, &[object]));
                let report: MergeReport = scratch.read_at(merger.report_range().start, 1)[0];
                assert_eq!(report.status, 0, "{report:?}");
                let restored = timed(|r| merger.restore(r, memory));
                if round > 0 {
                    merges[i].push(total(&merged));
                    restores.push(total(&restored) / total(&merged));
                    merged
                        .iter()
                        .for_each(|p| *by_phase[i].entry(p.name).or_default() += p.milliseconds / ROUNDS as f64);
                } else if i == 0 {
                    println!("{name}: {count} triangles, {triangles} merged; {:?}", report.estimate(triangles));
                    println!("  {report:?}");
                }
            }
        }
        let ratio = |a: &[f64], b: &[f64]| median(a.iter().zip(b).map(|(a, b)| a / b).collect());
        println!("  restore / merge {:.4}; median of builds, ms: {:.1}", median(restores), median(builds.clone()));
        for ((schedule, merges), by_phase) in SCHEDULES.into_iter().zip(merges).zip(by_phase) {
            println!("  {schedule}: merge / build {:.3}, median, ms: {:.2}", ratio(&merges, &builds), median(merges));
            println!("    by phase, ms: {by_phase:.2?}");
        }
    }
}

/// Merges by both ways with as much room as each needs, in turn.
#[test]
#[ignore = "prints what pushing trees costs beside finding leaves, over scenes that are not in the repository"]
fn pushing_beside_finding() {
    for (name, corners) in scenes(&["bunny", "sponza"]) {
        let still = corpus::soup(name, corners.clone());
        let moves = corpus::soup("object", patch(&corners));
        let (count, triangles) = (still.2.len() as u32, moves.2.len() as u32);
        let most = MergeCapacity { objects: 1, triangles };
        let buffer = |bytes: u64| device().buffer("memory", bytes).expect("memory");
        let ((still_input, _a), (input, _b)) = (input_of(&still), input_of(&moves));
        let builder = KdBuilder::new(device(), &builder::KdOptions::DEFAULT, triangles).expect("a builder");
        let (tree, building) = (buffer(builder.sizes().structure), buffer(builder.sizes().scratch));
        let record_tree = || timed(|r| builder.record(r, &input, tree.region(), building.region()));
        record_tree();
        let place = |object: &Object, options: &MergeOptions| {
            let build = builder::KdOptions { more: Merger::room(options, most), ..builder::KdOptions::DEFAULT };
            let still_builder = KdBuilder::new(device(), &build, count).expect("a builder");
            let merger = Merger::new(device(), options, &still_builder.header(), most).expect("a merger");
            let structure = buffer(still_builder.sizes().structure);
            let (scratch, undo) = (buffer(merger.sizes().scratch), buffer(merger.sizes().undo));
            let building = buffer(still_builder.sizes().scratch);
            timed(|recorder| still_builder.record(recorder, &still_input, structure.region(), building.region()));
            (*object, merger, structure, scratch, undo)
        };
        for schedule in SCHEDULES {
            let ways = [None, Some(tree.address())].map(|tree| {
                let object = Object { input, first_primitive: count, tree };
                let build = builder::KdOptions { schedule: Some(schedule), ..builder::KdOptions::DEFAULT };
                let mut options = MergeOptions { build, estimate: MergeEstimate::WITH_TREES };
                loop {
                    let place = place(&object, &options);
                    let (object, merger, structure, scratch, undo) = &place;
                    let memory =
                        MergeMemory { structure: structure.region(), scratch: scratch.region(), undo: undo.region() };
                    timed(|r| merger.record(r, memory, &[*object]));
                    let report: MergeReport = scratch.read_at(merger.report_range().start, 1)[0];
                    timed(|r| merger.restore(r, memory));
                    options.estimate = report.estimate(triangles);
                    if report.status & status::OUT_OF_ROOM == 0 {
                        println!("{name}, {schedule}: {report:?}");
                        break place;
                    }
                }
            });
            let mut merges = [Vec::new(), Vec::new()];
            let mut by_phase = [BTreeMap::<&str, f64>::new(), BTreeMap::new()];
            let mut builds = Vec::new();
            for _ in 0..ROUNDS {
                builds.push(total(&record_tree()));
                for (i, (object, merger, structure, scratch, undo)) in ways.iter().enumerate() {
                    let memory =
                        MergeMemory { structure: structure.region(), scratch: scratch.region(), undo: undo.region() };
                    let merged = timed(|r| merger.record(r, memory, &[*object]));
                    timed(|r| merger.restore(r, memory));
                    merges[i].push(total(&merged));
                    merged
                        .iter()
                        .for_each(|p| *by_phase[i].entry(p.name).or_default() += p.milliseconds / ROUNDS as f64);
                }
            }
            let [find, push] = merges;
            let ratio = |a: &[f64], b: &[f64]| median(a.iter().zip(b).map(|(a, b)| a / b).collect());
            println!("  push / find {:.3}, the object's tree / find {:.3}", ratio(&push, &find), ratio(&builds, &find));
            println!("  medians, ms: find {:.2}, push {:.2}, tree {:.2}", median(find), median(push), median(builds));
            println!("  by phase, ms: {by_phase:.2?}");
        }
    }
}
