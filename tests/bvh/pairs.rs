//! Trees over pairs of triangles: the device's equal the host's, and pairs are what they are said to be.

use crate::common::twins::{assert_same, on_device, on_host};
use crate::common::{corpus, device};
use hedgerow::bvh::builder::{BuildOptions, Builder, Method, Primitives, Schedule, Treelets, Window};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::{Bvh2, Triangle};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::split::SplitOptions;
use hedgerow::bvh::twin::{lbvh, pairs};
use hedgerow::geometry::Aabb;
use std::collections::BTreeSet;

const PAIRS: BuildOptions = BuildOptions {
    method: Method::Hploc(Window::DEFAULT),
    codes: Some(Code::Emc64Var.full()),
    pairs: true,
    ..BuildOptions::DEFAULT
};

fn meshes() -> Vec<corpus::Mesh> {
    let left_out = [0, 1, 2, 400].map(|kept| all_but_the_last_are_left_out(40, kept));
    [1, 2, 3, 9, 40].map(corpus::sheet).into_iter().chain(left_out).chain(corpus::meshes()).collect()
}

/// Boxes of leaves are kept for all triangles, and reach beyond nodes where few of them have one.
fn all_but_the_last_are_left_out(side: u32, kept: usize) -> corpus::Mesh {
    let (name, mut positions, mut triangles) = corpus::sheet(side);
    let nowhere = positions.len() as u32;
    positions.push([f32::NAN; 3]);
    let left_out = triangles.len() - kept;
    triangles[..left_out].iter_mut().for_each(|triangle| triangle[2] = nowhere);
    (format!("{name}, the last {kept}"), positions, triangles)
}

fn equals_the_host(options: &BuildOptions, schedules: &[Option<Schedule>]) {
    for mesh in meshes() {
        let expected = on_host(&mesh, options);
        let what = format!("{} {:?}", mesh.0, options.method);
        expected.validate().unwrap_or_else(|e| panic!("{what}: {e}"));
        for &schedule in schedules {
            let got = on_device(&mesh, &BuildOptions { schedule, ..*options });
            assert_same(&got, &expected, &format!("{what} {schedule:?}"));
        }
    }
}

#[test]
fn trees_over_pairs_are_those_of_the_host() {
    equals_the_host(&PAIRS, &[None, Some(Schedule::PERSISTENT)]);
    equals_the_host(&BuildOptions { collapse: Collapse::OFF, ..PAIRS }, &[None]);
}

#[test]
fn trees_over_pairs_by_other_methods_and_codes_are_those_of_the_host() {
    for (method, codes) in [
        (Method::Ploc { radius: 8 }, "emc64var/32"),
        (Method::Hploc(Window::PAPER), "mc30"),
        (Method::Hploc(Window::DEFAULT), "mip6/32"),
        (Method::Hploc(Window::DEFAULT), "bin2a4"),
    ] {
        equals_the_host(&BuildOptions { method, codes: Some(codes.parse().expect("known")), ..PAIRS }, &[None]);
    }
}

/// By one workgroup, too, and where children get an order.
#[test]
fn optimised_trees_over_pairs_are_those_of_the_host() {
    let optimise = Some(ReinsertionOptions { rounds: 6, stride: 2 });
    let options = BuildOptions { optimise, ..PAIRS };
    equals_the_host(&options, &[None, Some(Schedule::Chain), Some(Schedule::Workgroup)]);
    equals_the_host(&BuildOptions { child_order: Some(ChildOrder::MoreHitsForItsCost), ..options }, &[None]);
}

/// What the leaves of an uncollapsed tree hold.
fn leaves(tree: &Bvh2) -> Vec<&[Triangle]> {
    let of =
        |leaf: hedgerow::bvh::layout::Child| &tree.records[leaf.index as usize..(leaf.index + leaf.count) as usize];
    tree.leaf_children().into_iter().map(of).collect()
}

#[test]
fn a_leaf_has_a_triangle_or_two_of_one_block_that_share_an_edge_in_a_small_box() {
    let mut paired = 0;
    for side in [9, 40] {
        let mesh = corpus::sheet(side);
        let tree = on_host(&mesh, &BuildOptions { collapse: Collapse::OFF, ..PAIRS });
        let mut there = BTreeSet::new();
        for leaf in leaves(&tree) {
            assert!(leaf.iter().all(|record| there.insert(record.primitive)), "a triangle is in two leaves");
            let [first, second] = leaf else {
                assert_eq!(leaf.len(), 1);
                continue;
            };
            paired += 1;
            assert!(
                first.primitive < second.primitive
                    && first.primitive as usize / pairs::BLOCK == second.primitive as usize / pairs::BLOCK
            );
            let corners = [first, second].map(|t| [t.v0, t.v1, t.v2]);
            assert!(corners[1].iter().filter(|v| corners[0].contains(v)).count() >= 2, "no edge is shared");
            let [a, b] = corners.map(|c| Aabb::around(&c));
            assert!(a.union(&b).half_area() <= pairs::LARGEST_BOX * (a.half_area() + b.half_area()) * (1.0 + 1e-6));
        }
        let read: Vec<_> = lbvh::corners(&mesh.1, &mesh.2).collect();
        assert_eq!(there.len(), read.iter().flatten().count(), "a triangle is lost");
        assert_eq!(tree.header.active as usize, there.len());
        let whole: Bvh2 = on_host(&mesh, &BuildOptions { pairs: false, collapse: Collapse::OFF, ..PAIRS });
        assert_eq!(tree.header.status, whole.header.status);
        // Left-out triangles have a record each behind the others.
        assert_eq!(tree.header.primitive_count, whole.header.primitive_count);
    }
    assert!(paired > 1000, "{paired} pairs of 3362 triangles");
}

/// Quads whose triangles come one after the other or in turn, in one block or two, and triangles whose common box would be too large.
#[test]
fn the_best_of_a_block_are_pairs() {
    let quad = |x: f32| {
        let [a, b, c, d] = [[x, 0.0, 0.0], [x + 1.0, 0.0, 0.0], [x, 1.0, 0.0], [x + 1.0, 1.0, 0.0]];
        [[a, b, c], [b, d, c]]
    };
    let of = |triangles: &[[[f32; 3]; 3]]| pairs::seconds_of(&triangles.iter().map(|&t| Ok(t)).collect::<Vec<_>>());
    let [[a, b], [c, d]] = [quad(0.0), quad(5.0)];
    assert_eq!(of(&[a, b, c, d]), [Some(1), None, Some(3), None]);
    assert_eq!(of(&[a, c, b, d]), [Some(2), Some(3), None, None]);
    // Not across blocks.
    let far =
        |i: u8| [[100.0 + f32::from(i), 0.0, 0.0], [100.0 + f32::from(i), 0.5, 0.0], [100.5 + f32::from(i), 0.0, 0.0]];
    let others: Vec<_> = (0..7).map(far).collect();
    assert_eq!(of(&[&others[..], &[a, b]].concat())[7], None);
    assert_eq!(of(&[&others[..6], &[a, b]].concat())[6], Some(7));
    // Two long ones at a right angle share an edge, and their box is much larger than they are.
    let (wide, high) = ([[0.0; 3], [0.0, 0.0, 0.1], [9.0, 0.0, 0.0]], [[0.0; 3], [0.0, 0.0, 0.1], [0.0, 9.0, 0.0]]);
    assert_eq!(of(&[wide, high]), [None, None]);
    // What is left out is no partner.
    assert_eq!(pairs::seconds_of(&[Ok(a), Err(1), Ok(b)]), [Some(2), None, None]);
}

#[test]
fn what_cannot_be_paired_is_refused_by_name() {
    let split = Some(SplitOptions::DEFAULT);
    let robust = Some("emc64var+robust".parse().expect("known"));
    for (options, named) in [
        (BuildOptions { method: Method::Lbvh, ..PAIRS }, "Lbvh"),
        (BuildOptions { method: Method::Hlbvh(Treelets::DEFAULT), ..PAIRS }, "Hlbvh"),
        (BuildOptions { primitives: Primitives::Boxes, ..PAIRS }, "Boxes"),
        (BuildOptions { primitives: Primitives::Instances, ..PAIRS }, "Instances"),
        (BuildOptions { split, ..PAIRS }, "split"),
        (BuildOptions { codes: robust, ..PAIRS }, "robust"),
    ] {
        assert!(!options.can_pair());
        let wrong = Builder::new(device(), &options, 100).expect_err("no pairs of these").to_string();
        assert!(wrong.contains("pairs") && wrong.contains(named), "{wrong}");
    }
    assert!(PAIRS.can_pair());
}
