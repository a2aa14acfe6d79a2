//! Whether a search without moves says what a pass of reinsertion would win, in trees that were refitted for some frames.

use super::frames::{rays_of, work};
use super::measures::Area;
use super::search::{LinkedTree, Measure};
use hedgerow::bvh::builder::Window;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::{hploc, lbvh, quality, refit};
use hedgerow_lab::scene::{LoadOptions, Scene, load_animation};

/// Of a tree, the sum of the best gains of the links of a round, for all links, over the root's area.
fn probed(tree: &Bvh2, round: u32) -> f64 {
    let linked = LinkedTree::new(tree.clone());
    let mut area = Area::default();
    area.prepare(&linked, round);
    let stride = linked.stride();
    let moves = linked.moves(&area, round % stride, stride);
    let sum: f64 = moves.iter().map(|m| f64::from(m.gain)).sum();
    sum * f64::from(stride) / f64::from(linked.area(&tree.header.root.bounds()))
}

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
    let mut rows: Vec<[f64; 6]> = Vec::new();
    for number in (0..animation.frames.len()).step_by(every) {
        let mesh = animation.mesh(number);
        refit::refit_corners(&mut tree, lbvh::corners(&mesh.positions, &mesh.triangles), Collapse::SAH);
        let sah = |tree: &Bvh2| quality::of(tree, 3.0, 2.0).sah;
        let better = tree.reinserted(&ReinsertionOptions::FAST);
        let scene = Scene { name: name.to_owned(), mesh, camera: animation.camera, lights: Vec::new() };
        let frame = rays_of(&scene, &tree, animation.camera, [120, 90], 1);
        let total = |tree: &Bvh2| work(tree, &frame).iter().sum::<f64>();
        let (before, after) = (sah(&tree), sah(&better));
        let (work_before, work_after) = (total(&tree), total(&better));
        let probes: Vec<f64> = (0..4).map(|k| 3.0 * probed(&tree, 17 * k)).collect();
        let row = [
            probes[0] / before,
            probes.iter().sum::<f64>() / 4.0 / before,
            (before - after) / before,
            (work_before - work_after) / work_before,
            before / first - 1.0,
            f64::from(number as u32),
        ];
        println!(
            "  frame {number:3}  probe {:.4}  of four {:.4}  won sah {:.4}  won work {:.4}  growth {:.4}",
            row[0], row[1], row[2], row[3], row[4]
        );
        rows.push(row);
    }
    let r = |a: usize, b: usize| correlation(&rows.iter().map(|row| [row[a], row[b]]).collect::<Vec<_>>());
    println!(
        "  r: probe, sah {:.3}  of four, sah {:.3}  probe, work {:.3}  of four, work {:.3}  growth, sah {:.3}  growth, work {:.3}",
        r(0, 2),
        r(1, 2),
        r(0, 3),
        r(1, 3),
        r(4, 2),
        r(4, 3)
    );
}

fn correlation(pairs: &[[f64; 2]]) -> f64 {
    let n = pairs.len() as f64;
    let mean = [0, 1].map(|i| pairs.iter().map(|pair| pair[i]).sum::<f64>() / n);
    let moment = |i: usize, j: usize| pairs.iter().map(|pair| (pair[i] - mean[i]) * (pair[j] - mean[j])).sum::<f64>();
    moment(0, 1) / (moment(0, 0) * moment(1, 1)).sqrt()
}
