//! SAH costs of LBVHs over the shared scenes, against those of an independent plain program.
//!
//! That program builds top-down over sorted codes, in double precision, and was written apart from this project. Its figures
//! are rounded to two places; ties between codes may move a cost in the third digit. The scenes are not in the repository:
//! HEDGEROW_SCENES names their folder.

mod common;

use common::device;
use hedgerow::bvh::codes::{Code, Codes};
use hedgerow::measure::Subject;
use hedgerow::measure::builders::Spec;
use hedgerow::scene::{self, LoadOptions};

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

/// Costs agree within this.
const TOLERANCE: f64 = 0.005;

#[test]
fn costs_are_those_of_an_independent_program_within_half_a_percent() {
    let Some(folder) = std::env::var_os("HEDGEROW_SCENES") else {
        eprintln!("skipped: HEDGEROW_SCENES names no folder of scenes");
        return;
    };
    let options = LoadOptions { folders: vec![folder.into()], progress: None };
    for (name, triangles, costs) in COSTS {
        let scene = scene::load(name, &options).unwrap();
        assert_eq!(scene.mesh.triangles.len(), triangles, "{name}");
        for (codes, costs) in CODES.into_iter().zip(costs) {
            for (collapse, expected) in ["off", "sah"].into_iter().zip(costs) {
                let spec: Spec = format!("lbvh:codes={codes}:collapse={collapse}").parse().unwrap();
                let mut subject = spec.make(Some(device()), &scene.mesh).unwrap();
                let got = cost(subject.as_mut());
                let ratio = got / expected;
                assert!((ratio - 1.0).abs() <= TOLERANCE, "{name} {spec}: {got:.2}, elsewhere {expected} ({ratio:.4})");
            }
        }
    }
}

fn cost(subject: &mut dyn Subject) -> f64 {
    subject.build().unwrap();
    subject.quality(3.0, 2.0).unwrap().sah.unwrap()
}
