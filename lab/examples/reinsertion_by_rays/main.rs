//! Whether rays can teach reinsertion where to move subtrees: work of the next frame's rays, over that after as many rounds by area.
//!
//! reinsertion_by_rays SCENE,… WAY,… [ROUNDS [PASSES]]: after so many passes by area, so many rounds in each way. A way is area,
//! density:SHARE, clamped:SHARE, union:SHARE[:EVERY], flux:SHARE:CELLS or exact:SHARE:RAYS.

mod flux;
mod frames;
mod measures;
mod probe;
mod search;

use flux::Flux;
use frames::{Sample, later, rays_of, work};
use hedgerow::bvh::builder::Window;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::{hploc, lbvh, quality};
use hedgerow_lab::scene::{LoadOptions, Scene, load};
use measures::{Area, ByFlux, Counts, Exact, Rule};
use search::{LinkedTree, Measure};
use std::time::Instant;

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let number =
        |at: usize, otherwise: u32| arguments.get(at).map_or(otherwise, |text| text.parse().expect("a number"));
    let (rounds, before) = (number(2, 64), number(3, 0));
    if arguments[1] == "probe" {
        // The frames between those that are looked at, and the passes at the build.
        arguments[0].split(',').for_each(|name| probe::run(name, before, rounds as usize));
        return;
    }
    let ways: Vec<&str> = arguments[1].split(',').collect();
    for name in arguments[0].split(',') {
        let folders = std::env::var_os("HEDGEROW_SCENES").map(Into::into).into_iter().collect();
        let scene = load(name, &LoadOptions { folders, ..LoadOptions::default() }).expect("a scene");
        run(&scene, &ways, rounds, before);
    }
}

fn run(scene: &Scene, ways: &[&str], rounds: u32, before: u32) {
    let mesh = &scene.mesh;
    let radix = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::OFF);
    let start = hploc::build(&radix, Window::DEFAULT);
    let start = start.reinserted(&ReinsertionOptions::of_passes(before));
    let finished = start.collapsed(&Collapse::SAH);
    let bounds = mesh.bounds();
    let frame = |steps: f32, size, seed| rays_of(scene, &finished, later(&scene.camera, &bounds, steps), size, seed);
    let teacher = Sample::new(&frame(0.0, [320, 180], 77), 1 << 18);
    // The same picture with other rays; the next frame; one further on.
    let tested = [frame(0.0, [160, 120], 1), frame(1.0, [160, 120], 2), frame(4.0, [160, 120], 3)];
    println!(
        "{}: {} triangles, {} rays teach, {rounds} rounds after {before} passes",
        scene.name,
        mesh.triangles.len(),
        teacher.rays.len()
    );
    let start_work = tested.each_ref().map(|frame| work(&finished, frame).iter().sum::<f64>());
    let mut by_area: Option<[Vec<f64>; 3]> = None;
    for way in ways {
        let begun = Instant::now();
        let tree = taught(&start, way, rounds, &teacher);
        if *way == "area" && rounds.is_multiple_of(64) && start.nodes.len() > 8192 {
            let options = ReinsertionOptions::of_passes(rounds / 64);
            assert!(tree.nodes == start.reinserted(&options).nodes, "the search is not the library's");
        }
        let seconds = begun.elapsed().as_secs_f64();
        let tree = tree.collapsed(&Collapse::SAH);
        let works = tested.each_ref().map(|frame| work(&tree, frame));
        let by_area = by_area.get_or_insert_with(|| works.clone());
        let total = |k: usize| works[k].iter().sum::<f64>() / by_area[k].iter().sum::<f64>();
        let kinds: Vec<String> = works[1].iter().zip(&by_area[1]).map(|(a, b)| format!("{:.3}", a / b)).collect();
        println!(
            "  {way:24} same {:.3}  next {:.3}  further {:.3}  next by kind {}  next over start {:.3}  sah {:.2}  {seconds:.1} s",
            total(0),
            total(1),
            total(2),
            kinds.join(" "),
            works[1].iter().sum::<f64>() / start_work[1],
            quality::of(&tree, 3.0, 2.0).sah,
        );
    }
}

fn taught(start: &Bvh2, way: &str, rounds: u32, teacher: &Sample) -> Bvh2 {
    let words: Vec<&str> = way.split(':').collect();
    let number = |at: usize, otherwise: f32| words.get(at).map_or(otherwise, |text| text.parse().expect("a number"));
    let share = number(1, 0.5);
    let counts = |rule| Counts::new(teacher, rule, share, number(2, 8.0) as u32);
    let few = |rays: f32| {
        let stride = teacher.rays.len().div_ceil(rays as usize).max(1);
        Sample { rays: teacher.rays.iter().step_by(stride).copied().collect() }
    };
    match words[0] {
        "area" => optimised(start, &mut Area::default(), rounds),
        "density" => optimised(start, &mut counts(Rule::Density), rounds),
        "clamped" => optimised(start, &mut counts(Rule::Clamped), rounds),
        "union" => optimised(start, &mut counts(Rule::Union), rounds),
        "flux" => {
            let flux = Flux::new(&teacher.segments(start), &start.header.root.bounds(), number(2, 64.0) as usize);
            let nodes = Vec::new();
            optimised(start, &mut ByFlux { flux: &flux, share, by_area: 1.0, by_rays: 0.0, nodes }, rounds)
        }
        "exact" => {
            let segments = few(number(2, 16384.0)).segments(start);
            optimised(start, &mut Exact::new(&segments, share), rounds)
        }
        other => panic!("{other}: no such way"),
    }
}

fn optimised(start: &Bvh2, measure: &mut impl Measure, rounds: u32) -> Bvh2 {
    let mut work = LinkedTree::new(start.clone());
    let rounds = rounds * work.stride() / 64;
    for round in 0..rounds {
        work.round(measure, round);
    }
    work.tree
}
