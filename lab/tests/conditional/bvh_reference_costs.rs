//! SAH costs of LBVHs, PLOC and full sweep over the shared scenes, against those of an independent plain program.
//!
//! That program builds LBVHs top-down over sorted codes, in double precision, and was written apart from this project. Its figures
//! are rounded to two places; ties between codes may move a cost in the third digit. The scenes are not in the repository:
//! HEDGEROW_SCENES names their folder.

use crate::common::device;
use crate::conditional::needs;
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow_lab::scene::{self, LoadOptions, Scene};
use hedgerow_lab::subjects::builders::{Needs, Spec};

crate::conditional::tests! {
    lbvh_costs_are_those_of_an_independent_program_within_half_a_percent: needs::scenes(),
    lbvh_costs_of_large_scenes_are_those_of_an_independent_program_within_half_a_percent: needs::time("scenes of up to 1.4M triangles take minutes"),
    ploc_and_sweep_costs_are_those_of_an_independent_program_within_a_percent: needs::scenes(),
    ploc_and_sweep_costs_of_large_scenes_are_those_of_an_independent_program_within_a_percent: needs::time("scenes of up to 1.4M triangles; fails: san_francisco and bunny_in_city by PLOC 25 with mc30 are 1.1% off"),
    hlbvh_costs_at_most_1_15_of_full_sweep_in_the_mean: needs::scenes(),
    hlbvh_costs_of_large_scenes_are_at_most_1_15_of_full_sweep_in_the_mean: needs::time("scenes of up to 1.4M triangles take minutes"),
}

/// Codes in the order of [`COSTS`].
const CODES: [Codes; 4] = [Code::Mc30.full(), Code::Mc63.full(), Code::Emc64VarNoSize.full(), Code::Emc64Var.full()];

/// Scene, triangles, and for each code the cost with one triangle a leaf and after collapsing, c_T = 3, c_I = 2.
type Row = (&'static str, usize, [[f64; 2]; 4]);

#[rustfmt::skip]
const COSTS: [Row; 11] = [
    ("bunny.obj", 69451, [[110.15, 105.8], [110.15, 105.8], [110.15, 105.8], [110.15, 105.8]]),
    ("sponza.obj", 66450, [[274.46, 247.34], [274.43, 247.33], [284.85, 258.24], [273.9, 247.39]]),
    ("classroom.obj", 111162, [[169.05, 155.62], [169.02, 155.6], [163.46, 150.08], [152.8, 138.8]]),
    ("samurai_monastery.obj", 124789, [[147.67, 137.58], [147.63, 137.57], [140.17, 130.42], [138.65, 128.94]]),
    ("san_francisco.obj", 268041, [[149.11, 140.3], [149.09, 140.29], [128.71, 119.76], [128.71, 119.76]]),
    ("terrain_jacksboro.obj", 275772, [[188.76, 185.23], [188.76, 185.23], [78.13, 73.9], [78.13, 73.9]]),
    ("motorbike.obj", 331653, [[249.31, 239.13], [249.31, 239.13], [231.01, 220.72], [231.01, 220.72]]),
    ("bunny_in_city.obj", 337492, [[149.11, 140.3], [149.09, 140.29], [128.71, 119.76], [128.71, 119.76]]),
    ("salle_de_bain.tri", 1016615, [[124.06, 103.82], [123.85, 103.66], [119.41, 98.17], [114.28, 93.05]]),
    ("country_kitchen.tri", 1443517, [[156.94, 143.15], [156.57, 142.85], [144.77, 131.0], [136.98, 122.99]]),
    ("dragon.tri", 871414, [[177.45, 170.91], [177.44, 170.91], [175.55, 169.02], [175.55, 169.02]]),
];

/// Builders in the order of [`HOST_COSTS`].
const HOST_BUILDERS: [&str; 9] = [
    "ploc-host:codes=mc63:radius=10:collapse=off",
    "ploc-host:codes=mc63:radius=10",
    "ploc-host:codes=mc30:radius=10",
    "ploc-host:codes=mc63:radius=25:collapse=off",
    "ploc-host:codes=mc63:radius=25",
    "ploc-host:codes=mc30:radius=25",
    "sweep:collapse=off",
    "sweep:termination=off",
    "sweep",
];

/// Scene, and for each builder the cost.
#[rustfmt::skip]
const HOST_COSTS: [(&str, [f64; 9]); 10] = [
    ("bunny.obj", [102.15, 97.46, 97.46, 104.74, 100.0, 100.0, 93.46, 88.71, 88.71]),
    ("sponza.obj", [201.19, 174.03, 174.03, 201.46, 174.05, 174.05, 208.69, 179.18, 179.5]),
    ("classroom.obj", [110.46, 97.23, 97.26, 107.74, 94.33, 94.34, 121.46, 106.98, 106.98]),
    ("samurai_monastery.obj", [94.93, 84.07, 84.23, 91.21, 80.13, 80.13, 96.93, 85.04, 85.1]),
    ("san_francisco.obj", [124.71, 115.82, 116.91, 124.8, 115.85, 115.68, 108.71, 99.35, 99.45]),
    ("terrain_jacksboro.obj", [115.28, 111.36, 111.36, 106.73, 102.72, 102.72, 75.52, 71.2, 71.2]),
    ("motorbike.obj", [219.9, 208.91, 208.91, 217.19, 206.12, 206.12, 196.92, 185.93, 185.93]),
    ("bunny_in_city.obj", [124.93, 116.05, 116.83, 125.2, 116.25, 115.59, 109.27, 99.9, 100.01]),
    ("salle_de_bain.tri", [95.23, 74.42, 73.58, 95.04, 73.25, 73.37, 111.15, 89.96, 89.98]),
    ("country_kitchen.tri", [101.31, 84.46, 84.07, 100.22, 83.13, 82.69, 118.37, 101.15, 101.16]),
];

/// Costs of LBVHs agree within this.
const LBVH_TOLERANCE: f64 = 0.005;
/// Those of other builders.
const TOLERANCE: f64 = 0.01;
/// Where ties decide: a regular grid, whose neighbours are equally near, and an atrium that is its own mirror image, with
/// centroids on the borders of the codes' cells. The same PLOC with distances in double precision (radius 25) has the other
/// program's 102.72 for the terrain; with other orders of operations in `f32` it has 101.6 to 106.0, and for the atrium with codes
/// in double precision 176.1 instead of 171.3.
const TIES: [(&str, f64); 2] = [("sponza", 0.02), ("terrain_jacksboro", 0.02)];
/// Scenes of fewer triangles are in the suite.
const SMALL: usize = 130_000;

fn lbvh_costs_are_those_of_an_independent_program_within_half_a_percent() {
    compare_lbvhs(|triangles| triangles < SMALL);
}

fn lbvh_costs_of_large_scenes_are_those_of_an_independent_program_within_half_a_percent() {
    compare_lbvhs(|triangles| triangles >= SMALL);
}

fn ploc_and_sweep_costs_are_those_of_an_independent_program_within_a_percent() {
    compare_host_builders(|triangles| triangles < SMALL);
}

fn ploc_and_sweep_costs_of_large_scenes_are_those_of_an_independent_program_within_a_percent() {
    compare_host_builders(|triangles| triangles >= SMALL);
}

fn hlbvh_costs_at_most_1_15_of_full_sweep_in_the_mean() {
    compare_hlbvhs(|triangles| triangles < SMALL);
}

fn hlbvh_costs_of_large_scenes_are_at_most_1_15_of_full_sweep_in_the_mean() {
    compare_hlbvhs(|_| true);
}

fn compare_lbvhs(is_meant: fn(usize) -> bool) {
    for (name, triangles, costs) in COSTS.into_iter().filter(|&(_, triangles, _)| is_meant(triangles)) {
        let scene = load(name);
        assert_eq!(scene.mesh.triangles.len(), triangles, "{name}");
        for (codes, costs) in CODES.into_iter().zip(costs) {
            for (collapse, expected) in ["off", "sah"].into_iter().zip(costs) {
                compare(&scene, &format!("lbvh:codes={codes}:collapse={collapse}"), expected, LBVH_TOLERANCE);
            }
        }
    }
}

fn compare_host_builders(is_meant: fn(usize) -> bool) {
    let triangles = |name| COSTS.iter().find(|row| row.0 == name).map(|row| row.1).unwrap();
    for (name, costs) in HOST_COSTS.into_iter().filter(|&(name, _)| is_meant(triangles(name))) {
        let scene = load(name);
        for (builder, expected) in HOST_BUILDERS.into_iter().zip(costs) {
            let ties = TIES.iter().find(|(tied, _)| *tied == scene.name && builder.starts_with("ploc"));
            compare(&scene, builder, expected, ties.map_or(TOLERANCE, |ties| ties.1));
        }
    }
}

/// The geometric mean of what the device's HLBVH costs over what full sweep does.
fn compare_hlbvhs(is_meant: fn(usize) -> bool) {
    let triangles = |name| COSTS.iter().find(|row| row.0 == name).map(|row| row.1).unwrap();
    let mut ratios = Vec::new();
    for (name, costs) in HOST_COSTS.into_iter().filter(|&(name, _)| is_meant(triangles(name))) {
        let scene = load(name);
        let spec: Spec = "hlbvh".parse().unwrap();
        let mut subject = spec.make(Some(device()), &scene.mesh).unwrap();
        subject.build().unwrap();
        let ratio = subject.quality(3.0, 2.0).unwrap().sah.unwrap() / costs[HOST_BUILDERS.len() - 1];
        println!("{name} {spec}: {ratio:.4} of full sweep");
        ratios.push(ratio);
    }
    let mean = (ratios.iter().map(|ratio| ratio.ln()).sum::<f64>() / ratios.len() as f64).exp();
    assert!(mean <= 1.15, "{mean:.4} of full sweep over {} scenes", ratios.len());
}

/// A scene of HEDGEROW_SCENES.
pub fn load(name: &str) -> Scene {
    let options = LoadOptions { folders: vec![crate::conditional::scenes_folder()], progress: None };
    scene::load(name, &options).unwrap()
}

/// The cost of what `builder` makes of `scene`.
pub fn cost(scene: &Scene, builder: &str) -> f64 {
    let spec: Spec = builder.parse().unwrap();
    let on = matches!(spec.needs(), Needs::Device).then(device);
    let mut subject = spec.make(on, &scene.mesh).unwrap();
    subject.build().unwrap();
    subject.quality(3.0, 2.0).unwrap().sah.unwrap()
}

/// The cost of what `builder` makes of `scene` is the expected one but for this share of it.
pub fn compare(scene: &Scene, builder: &str, expected: f64, tolerance: f64) {
    let got = cost(scene, builder);
    let ratio = got / expected;
    println!("{} {builder}: {got:.2}, elsewhere {expected} ({ratio:.4})", scene.name);
    assert!((ratio - 1.0).abs() <= tolerance, "{} {builder}: {got:.2}, elsewhere {expected} ({ratio:.4})", scene.name);
}
