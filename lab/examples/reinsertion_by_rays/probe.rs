//! Whether a search without moves says what a pass of reinsertion would win, in trees that were refitted for some frames.

use super::frames::{rays_of, work};
use hedgerow::bvh::builder::Window;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::reinsertion::CostOnHost;
use hedgerow::bvh::twin::{hploc, lbvh, quality, refit};
use hedgerow_lab::scene::{LoadOptions, Scene, load_animation};

/// A line a frame: what was probed, what a pass wins in the cost of steps and in work, and how the cost has grown.
pub fn run(name: &str, passes: u32, every: usize) {
    let folders = std::env::var_os("HEDGEROW_SCENES").map(Into::into).into_iter().collect();
    let animation = load_animation(name, &LoadOptions { folders, ..LoadOptions::default() }).expect("an animation");
    let triangles = &animation.triangles;
    let radix = lbvh::build(&animation.frames[0], triangles, Code::Mc63.full(), Collapse::OFF);
    let start = hploc::build(&radix, Window::DEFAULT).reinserted(&ReinsertionOptions::of_passes(passes));
    let mut tree = start.collapsed(&Collapse::SAH);
    let first = quality::of(&tree, 3.0, 2.0).sah;
    println!("{name}: {} triangles, {} frames, {passes} passes at the build", triangles.len(), animation.frames.len());
    let mut rows: Vec<[f64; 4]> = Vec::new();
    for number in (0..animation.frames.len()).step_by(every) {
        let mesh = animation.mesh(number);
        refit::refit_corners(&mut tree, lbvh::corners(&mesh.positions, &mesh.triangles), Collapse::SAH);
        let sah = |tree: &Bvh2| quality::of(tree, 3.0, 2.0).sah;
        let better = tree.reinserted(&ReinsertionOptions::FAST);
        let scene = Scene { name: name.to_owned(), mesh, camera: animation.camera, lights: Vec::new() };
        let frame = rays_of(&scene, &tree, animation.camera, [120, 90], 1);
        let (before, after) = (sah(&tree), sah(&better));
        let (work_before, work_after) = (work(&tree, &frame), work(&better, &frame));
        let probed = tree.probed(&ReinsertionOptions::PROBE, &CostOnHost::Area).expect("areas");
        let gain = 3.0 * probed.relative_gain(tree.header.node_slots) / before;
        let won = [(before - after) / before, (work_before - work_after) / work_before];
        let row = [gain, before / first - 1.0, won[0], won[1]];
        println!("  frame {number:3}  {}", row.map(|x| format!("{x:8.4}")).join(""));
        rows.push(row);
    }
    let names = ["a 16th", "growth"];
    for (i, what) in names.iter().enumerate() {
        let r = |with: usize| correlation(&rows.iter().map(|row| [row[i], row[with]]).collect::<Vec<_>>());
        println!("  {what:14} r with the cost that a pass wins {:.3}, with the work {:.3}", r(2), r(3));
    }
}

fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let n = pairs.len() as f64;
    let mean = [0, 1].map(|i| pairs.iter().map(|pair| pair[i]).sum::<f64>() / n);
    let moment = |i: usize, j: usize| pairs.iter().map(|pair| (pair[i] - mean[i]) * (pair[j] - mean[j])).sum::<f64>();
    moment(0, 1) / (moment(0, 0) * moment(1, 1)).sqrt()
}
