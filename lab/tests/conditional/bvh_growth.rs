//! What far primitives cost: the relative cost of Riemersma 2024, section 4.3, on the host.
//!
//! Relative cost: the SAH sum of a tree with every box clipped to the bounds of the scene as it was, divided by their area, over that
//! of the tree of the scene alone. The far triangle is that of CONTRACT.md. The bunny's figures are of an independent program; its
//! scene is not in the repository: HEDGEROW_SCENES names the folder.

use crate::conditional::needs;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin;
use hedgerow::geometry::Aabb;
use hedgerow_lab::scene::{self, LoadOptions, Mesh};

crate::conditional::tests! {
    a_far_triangle_costs_robust_codes_almost_nothing_at_any_distance: needs::nothing(),
    a_hundred_far_triangles_at_different_distances_cost_robust_codes_almost_nothing: needs::nothing(),
    grids_move_the_drop_by_what_their_prefix_spares: needs::nothing(),
    the_bunny_costs_what_an_independent_program_says: needs::scene("bunny"),
}

/// How a scene grows.
#[derive(Debug, Clone, Copy)]
struct Growth {
    axes: usize,
    positive: bool,
}

const GROWTHS: [Growth; 4] = [
    Growth { axes: 1, positive: true },
    Growth { axes: 1, positive: false },
    Growth { axes: 3, positive: true },
    Growth { axes: 3, positive: false },
];

fn load(name: &str) -> Mesh {
    let folders = vec![crate::conditional::scenes_folder()];
    scene::load(name, &LoadOptions { folders, progress: None }).expect(name).mesh
}

fn bounds(mesh: &Mesh) -> Aabb {
    Aabb::around(&mesh.positions)
}

/// Two corners of the far triangle: those of its box.
fn far(bounds: &Aabb, growth: Growth, e: f64) -> [[f32; 3]; 2] {
    let corner = |grown: f64, other: f64| {
        std::array::from_fn(|axis| {
            let (lo, hi) = (f64::from(bounds.lo[axis]), f64::from(bounds.hi[axis]));
            let extent = hi - lo;
            (match (axis < growth.axes, growth.positive) {
                (true, true) => lo + extent * e.exp2() * grown,
                (true, false) => hi - extent * e.exp2() * grown,
                (false, _) => hi - extent * other,
            }) as f32
        })
    };
    [corner(1.0 - 1e-6, 1e-3), corner(1.0, 0.0)]
}

/// The SAH sum with boxes clipped to `bounds`, over their area: c_T = 3, c_I = 2.
fn clipped_cost(tree: &Bvh2, bounds: &Aabb) -> f64 {
    let area = |lo: [f32; 3], hi: [f32; 3]| {
        let extent = |i: usize| f64::from(hi[i].min(bounds.hi[i])) - f64::from(lo[i].max(bounds.lo[i]));
        let [x, y, z] = [extent(0), extent(1), extent(2)];
        if x.min(y).min(z) < 0.0 { 0.0 } else { x * y + y * z + z * x }
    };
    let mut stack = vec![tree.header.root];
    let mut sum = 0.0;
    while let Some(child) = stack.pop() {
        if child.is_leaf() {
            sum += 2.0 * area(child.lo, child.hi) * f64::from(child.count);
        } else {
            sum += 3.0 * area(child.lo, child.hi);
            stack.extend(tree.nodes[child.index as usize].children);
        }
    }
    sum / area(bounds.lo, bounds.hi)
}

/// The cost with these far triangles over that without.
fn relative_cost(mesh: &Mesh, codes: &str, far: &[[[f32; 3]; 2]]) -> f64 {
    let codes: Codes = codes.parse().unwrap();
    let cost = |far: &[[[f32; 3]; 2]]| {
        let (mut positions, mut triangles) = (mesh.positions.clone(), mesh.triangles.clone());
        for [a, b] in far {
            let first = positions.len() as u32;
            positions.extend([a, b, a]);
            triangles.push([first, first + 1, first + 2]);
        }
        clipped_cost(&twin::lbvh::build(&positions, &triangles, codes, Collapse::OFF), &bounds(mesh))
    };
    cost(far) / cost(&[])
}

fn cost_at(mesh: &Mesh, codes: &str, growth: Growth, e: f64) -> f64 {
    relative_cost(mesh, codes, &[far(&bounds(mesh), growth, e)])
}

/// The first whole e at which the cost is above 1.2.
fn drop(mesh: &Mesh, codes: &str, growth: Growth, from: u32, to: u32) -> u32 {
    (from..to).find(|&e| cost_at(mesh, codes, growth, f64::from(e)) > 1.2).unwrap_or(to)
}

/// A sphere whose triangles are in an order that says nothing of where they are.
fn sphere(levels: u32) -> Mesh {
    let mesh = scene::load(&format!("gen:icosphere:{levels}"), &LoadOptions::default()).expect("a generator").mesh;
    let count = mesh.triangles.len();
    // Prime, and no divisor of 20 · 4^levels.
    let triangles = (0..count).map(|i| mesh.triangles[i * 1237 % count]).collect();
    Mesh { triangles, ..mesh }
}

fn a_far_triangle_costs_robust_codes_almost_nothing_at_any_distance() {
    let mesh = sphere(4);
    for growth in GROWTHS {
        for e in [1.0, 3.0, 10.0, 22.0, 40.0, 60.0, 100.0, 125.0] {
            for codes in ["emc64var+robust", "emc64var+robust/32", "mc63+robust"] {
                let cost = cost_at(&mesh, codes, growth, e);
                assert!(cost < 1.05, "{codes}, {growth:?} by 2^{e}: {cost:.3}");
            }
        }
        assert!(cost_at(&mesh, "emc64var-nosize", growth, 100.0) > 2.0, "the experiment shows a drop");
    }
}

fn a_hundred_far_triangles_at_different_distances_cost_robust_codes_almost_nothing() {
    let mesh = sphere(5);
    for growth in GROWTHS {
        for most in [8.0, 30.0, 60.0, 120.0] {
            let hundred: Vec<_> = (1..=100).map(|i| far(&bounds(&mesh), growth, most * f64::from(i) / 100.0)).collect();
            let cost = relative_cost(&mesh, "emc64var+robust", &hundred);
            assert!(cost < 1.05, "{growth:?} to 2^{most}: {cost:.3}");
        }
    }
}

fn grids_move_the_drop_by_what_their_prefix_spares() {
    let mesh = sphere(4);
    for growth in GROWTHS {
        let (from, to) = if growth.axes == 1 { (44, 66) } else { (12, 26) };
        let base = drop(&mesh, "emc64var-nosize", growth, from, to);
        // Riemersma 2024, equation 13: log2 of the cells over the axes that grow; one bit of it goes to the prefix.
        for (codes, bits) in [("mip9", 9.0), ("bin4a4", 7.0)] {
            let moved = f64::from(drop(&mesh, codes, growth, from, to)) - f64::from(base);
            let expected = bits / growth.axes as f64;
            assert!((moved - expected).abs() <= 1.0, "{codes}, {growth:?}: from {base} by {moved}, not {expected}");
        }
    }
}

fn the_bunny_costs_what_an_independent_program_says() {
    let mesh = load("bunny.obj");
    let nosize = "emc64var-nosize";
    for positive in [true, false] {
        let figures = [
            (nosize, 1, vec![(10.0, 1.03), (42.0, 1.03), (46.0, 1.08), (50.0, 1.38), (56.0, 5.6)]),
            (nosize, 3, vec![(14.0, 1.03), (16.0, 1.18), (18.0, 2.99), (20.0, 29.0)]),
            ("mc63", 1, vec![(4.0, 1.36), (10.0, 4.7), (60.0, 4.7)]),
        ];
        for (codes, axes, figures) in figures {
            for (e, expected) in figures {
                let cost = cost_at(&mesh, codes, Growth { axes, positive }, e);
                assert!(
                    (cost / expected - 1.0).abs() < 0.02,
                    "{codes}, {axes} axes by 2^{e}: {cost:.3}, elsewhere {expected}"
                );
            }
        }
    }
    for growth in GROWTHS {
        for e in [1.0, 20.0, 60.0] {
            let cost = cost_at(&mesh, "emc64var+robust", growth, e);
            assert!(cost < 1.03, "{growth:?} by 2^{e}: {cost:.3}");
        }
    }
}
