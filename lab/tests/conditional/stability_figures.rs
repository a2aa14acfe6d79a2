//! What a far triangle costs, against what an independent program has measured, and on a mesh that needs no file.
//!
//! That program builds LBVHs of exact `emc64var-nosize` and `mc63` codes over the bunny, one triangle a leaf, and was written
//! apart from this project; its figures are rounded to two or three digits. The bunny is not in the repository:
//! HEDGEROW_SCENES names its folder.

use crate::conditional::needs;
use hedgerow_lab::experiments::stability::far::{FarTriangle, Side};
use hedgerow_lab::experiments::stability::points::Growth;
use hedgerow_lab::experiments::stability::relative::{self, RelativeSetup};
use hedgerow_lab::rays::kinds::RayOptions;
use hedgerow_lab::scene::{self, LoadOptions, Scene};
use hedgerow_lab::subjects::builders;

crate::conditional::tests! {
    costs_are_those_of_an_independent_program_on_either_side: needs::scene("bunny"),
    codes_lose_a_soup_where_their_bits_end_on_either_side: needs::nothing(),
}

/// Costs of these codes on the host, by axes, side and e.
fn costs(scene: &Scene, codes: &str, axes: u32, steps: &[u32]) -> Vec<Growth> {
    let specs = builders::parse_list(&format!("lbvh-host:codes={codes}:collapse=off")).expect("known");
    let rays = RayOptions { size: [1, 1], seed: 1 };
    let stage = RelativeSetup { device: None, builders: &specs, runs: 1, kinds: &[], rays, say: &|_| {} };
    let mut all: Vec<u32> = steps.to_vec();
    all.insert(0, 0);
    let triangles = Side::ALL.map(|side| FarTriangle { axes, side });
    let mut points = Vec::new();
    let mut keep = |point| {
        points.push(point);
        Ok(())
    };
    let mut failed = |failure| panic!("{failure:?}");
    relative::measure(&stage, scene, (&triangles, &all), &mut failed, &mut keep).expect("it is measured");
    points
}

/// Costs agree within this, past the drop, too.
const TOLERANCE: f64 = 0.02;

/// e, and the relative cost that the independent program has there.
type Known = &'static [(u32, f64)];

fn costs_are_those_of_an_independent_program_on_either_side() {
    let options = LoadOptions { folders: vec![crate::conditional::scenes_folder()], progress: None };
    let bunny = scene::load("bunny", &options).expect("the bunny");
    let known: [(&str, u32, Known); 3] = [
        ("emc64var-nosize", 1, &[(10, 1.03), (42, 1.03), (46, 1.08), (50, 1.38), (56, 5.6)]),
        ("emc64var-nosize", 3, &[(10, 1.03), (14, 1.03), (16, 1.18), (18, 2.99), (20, 29.0)]),
        ("mc63", 1, &[(4, 1.36), (10, 4.7), (30, 4.7)]),
    ];
    for (codes, axes, known) in known {
        let steps: Vec<u32> = known.iter().map(|(e, _)| *e).collect();
        for point in costs(&bunny, codes, axes, &steps) {
            let Some((e, expected)) = known.iter().find(|(e, _)| *e == point.e) else { continue };
            let got = point.relative_cost.expect("an area");
            let what = format!("{codes}, {} axes, side {}, e = {e}", axes, point.by.side.name());
            assert!((got / expected - 1.0).abs() <= TOLERANCE, "{what}: {got:.3}, elsewhere {expected}");
        }
    }
}

fn codes_lose_a_soup_where_their_bits_end_on_either_side() {
    let soup = scene::load("gen:soup:5000:1", &LoadOptions::default()).expect("a generator");
    let cost = |points: &[Growth], side, e| {
        points.iter().find(|p| p.by.side == side && p.e == e).and_then(|p| p.relative_cost).expect("measured")
    };
    let one = costs(&soup, "emc64var-nosize", 1, &[30, 62]);
    let three = costs(&soup, "emc64var-nosize", 3, &[10, 21]);
    let plain = costs(&soup, "mc63", 1, &[3, 21]);
    for side in Side::ALL {
        // 5,000 triangles are told apart by some 14 bits: 64 less 30, or less three times 10.
        assert!(cost(&one, side, 30) < 1.05 && cost(&three, side, 10) < 1.05, "{side:?}: {one:?} {three:?}");
        assert!(cost(&plain, side, 3) < 1.5, "{side:?}: {plain:?}");
        // All bits, or all of x, are spent on the distance.
        assert!(cost(&one, side, 62) > 5.0 && cost(&three, side, 21) > 20.0, "{side:?}: {one:?} {three:?}");
        assert!(cost(&plain, side, 21) > 1.5, "{side:?}: {plain:?}");
    }
    for (e, points) in [(30, &one), (10, &three), (21, &plain)] {
        let [plus, minus] = Side::ALL.map(|side| cost(points, side, e));
        assert!((plus / minus - 1.0).abs() < 0.05, "e = {e}, the sides lose the same: {plus} {minus}");
    }
}
