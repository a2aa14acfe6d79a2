//! Splitting of large triangles: the device's trees equal the host's, byte for byte; no ray loses a hit; what cannot be split says so.

use crate::common::corpus::{self, soup};
use crate::common::device;
use crate::common::twins::{assert_same, built, on_device, on_host};
use hedgerow::bvh::builder::{BuildOptions, Builder, Input, Method, Schedule, Source, Treelets, Window};
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::geometry::{Geometry, GeometryFlags, IndexFormat, Primitives};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::split;
use hedgerow::bvh::twin::split::around_parts;
use hedgerow::bvh::wide::layout::{Wide4, Wide8, Wide8q};
use hedgerow::bvh::{refit, reinsertion};
use hedgerow::geometry::Aabb;
use hedgerow::gpu::Region;
use hedgerow::trace::twin::tracer;
use hedgerow::trace::twin::wide as wide_host;
use hedgerow::trace::wide::Order;
use hedgerow::trace::{Query, Ray};

/// The usual, and as much as there may be.
const SPLITS: [split::SplitOptions; 2] = [split::SplitOptions::DEFAULT, ALL];
const ALL: split::SplitOptions = split::SplitOptions { fraction: 1.0, most: split::SplitOptions::MOST_SPLITS };

/// Without splits, collapsed by SAH.
const WHOLE: BuildOptions = BuildOptions { codes: Some(Code::Emc64Var.full()), ..BuildOptions::DEFAULT };

/// Triangles that reach across the scene in all directions.
fn large(count: usize) -> corpus::Mesh {
    let mut next = corpus::unit_floats(5);
    let triangles = (0..count).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| next()))).collect();
    soup(&format!("{count} large"), triangles)
}

/// Triangles whose corners lie on planes that halve the scene, or a unit in the last place beside them; and two that span it.
fn grazing() -> corpus::Mesh {
    let mut next = corpus::unit_floats(9);
    let mut near_plane = || {
        let plane = (next() * 16.0).floor() / 16.0;
        match (next() * 3.0) as u32 {
            0 => plane,
            1 => plane.next_up(),
            _ => plane.next_down(),
        }
    };
    let random = (0..200).map(|_| std::array::from_fn(|_| std::array::from_fn(|_| near_plane())));
    let floor =
        [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 1.0]], [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0], [0.0, 1.0, 0.0]]];
    soup("grazing", random.chain(floor).collect())
}

/// Many small triangles and a few large ones.
fn mixed() -> corpus::Mesh {
    let (_, positions, _) = corpus::random("small", 700, [0.0; 3], [1.0; 3]);
    let (_, more, _) = large(40);
    let corners = positions.chunks(3).chain(more.chunks(3));
    soup("mixed", corners.map(|c| [c[0], c[1], c[2]]).collect())
}

fn meshes() -> Vec<corpus::Mesh> {
    corpus::meshes().into_iter().chain([large(130), grazing(), mixed()]).collect()
}

/// The LBVH's tree with splits, not collapsed.
fn lbvh(mesh: &corpus::Mesh, split: split::SplitOptions) -> Bvh2 {
    on_host(mesh, &BuildOptions { split: Some(split), collapse: Collapse::OFF, ..WHOLE })
}

#[test]
fn every_method_gives_the_bytes_of_the_host() {
    let methods =
        [Method::Lbvh, Method::Hlbvh(Treelets::DEFAULT), Method::Ploc { radius: 8 }, Method::Hploc(Window::DEFAULT)];
    for mesh in meshes() {
        for (i, method) in methods.into_iter().enumerate() {
            let options = BuildOptions { method, split: Some(SPLITS[i % 2]), ..WHOLE };
            let expected = on_host(&mesh, &options);
            expected.validate().unwrap_or_else(|e| panic!("{} {method:?}: {e}", mesh.0));
            // The kernels of pools take long to compile: two methods stand for all.
            let pool = matches!(method, Method::Lbvh | Method::Hploc(_));
            for schedule in [Schedule::Chain, Schedule::PERSISTENT].into_iter().take(1 + usize::from(pool)) {
                let got = on_device(&mesh, &BuildOptions { schedule: Some(schedule), ..options });
                assert_same(&got, &expected, &format!("{} {method:?} {schedule:?}", mesh.0));
            }
        }
    }
}

#[test]
fn codes_with_a_grid_or_sections_and_optimised_trees_are_those_of_the_host() {
    let options = BuildOptions { split: Some(split::SplitOptions::DEFAULT), ..WHOLE };
    for mesh in [large(130), mixed()] {
        for codes in ["mip6", "bin2a4", "emc64var+robust"] {
            let options = BuildOptions { codes: Some(codes.parse().expect("known")), ..options };
            assert_same(&on_device(&mesh, &options), &on_host(&mesh, &options), &format!("{} {codes}", mesh.0));
        }
        let options =
            BuildOptions { optimise: Some(reinsertion::ReinsertionOptions { rounds: 6, stride: 2 }), ..options };
        let expected = on_host(&mesh, &options);
        expected.validate().expect("valid");
        assert_same(&on_device(&mesh, &options), &expected, &format!("{} optimised", mesh.0));
    }
}

#[test]
fn splits_are_within_the_budget_and_lower_the_cost_where_few_triangles_are_large() {
    for mesh in meshes() {
        let count = mesh.2.len() as u32;
        for split in SPLITS {
            let tree = lbvh(&mesh, split);
            let whole = on_host(&mesh, &BuildOptions { collapse: Collapse::OFF, ..WHOLE });
            assert_eq!(tree.header.primitive_count, count + split.budget(count), "{}", mesh.0);
            assert!(tree.header.active >= whole.header.active, "{}: a triangle is lost", mesh.0);
            assert_eq!(tree.header.status, whole.header.status, "{}", mesh.0);
            let bounds = whole.header.root.bounds();
            assert!(around_parts(&bounds).contains(&tree.header.root.bounds()), "{}", mesh.0);
            assert!(tree.header.root.bounds().contains(&bounds), "{}", mesh.0);
            if mesh.0 == "mixed" {
                assert!(tree.header.active > whole.header.active, "{}: nothing was split", mesh.0);
                let (with, whole) = [&tree, &whole].map(|t| t.collapsed(&Collapse::SAH).header.sah()).into();
                assert!(with < whole, "{}: {with} with {split:?}, {whole} without", mesh.0);
            }
        }
    }
}

#[test]
fn a_fraction_too_small_for_one_split_gives_the_tree_without() {
    let mesh = large(130);
    let split = split::SplitOptions { fraction: 0.005, ..ALL };
    let without = BuildOptions { codes: Some(Code::Mc63.full()), ..BuildOptions::DEFAULT };
    let tree = on_device(&mesh, &BuildOptions { split: Some(split), ..without });
    assert_same(&tree, &on_host(&mesh, &without), "as without");
}

/// Rays from everywhere to points of triangles, many of them where planes cut these; and along the axes.
fn rays_at((_, positions, triangles): &corpus::Mesh, tree: &Bvh2) -> Vec<Ray> {
    let mut next = corpus::unit_floats(77);
    let bounds = tree.header.root.bounds();
    let extent: [f32; 3] = bounds.extent().map(|e| if e > 0.0 && e.is_finite() { e } else { 1.0 });
    let leaves: Vec<Aabb> =
        tree.nodes.iter().filter(|n| n.is_used()).flat_map(|n| n.children).map(|c| c.bounds()).collect();
    let mut rays = Vec::new();
    for i in 0..1500 {
        let Some(triangle) = triangles.get(next_index(&mut next, triangles.len())) else { break };
        let corners = triangle.map(|v| positions.get(v as usize).copied().unwrap_or([0.0; 3]));
        let (mut u, mut v) = (next(), next());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        let mut target: [f32; 3] = std::array::from_fn(|k| {
            corners[0][k] + u * (corners[1][k] - corners[0][k]) + v * (corners[2][k] - corners[0][k])
        });
        // To a side of a leaf's box, which is often a plane that something was split at.
        if i % 2 == 0 && !leaves.is_empty() {
            let leaf = leaves[next_index(&mut next, leaves.len())];
            let axis = i / 2 % 3;
            target[axis] = if i % 4 == 0 { leaf.lo[axis] } else { leaf.hi[axis] };
        }
        let mut origin: [f32; 3] = std::array::from_fn(|k| bounds.lo[k] + extent[k] * (3.0 * next() - 1.0));
        // Along an axis, within the planes of the two others.
        if i % 5 == 0 {
            let axis = i / 5 % 3;
            origin = std::array::from_fn(|k| if k == axis { bounds.lo[k] - extent[k] } else { target[k] });
        }
        let direction = std::array::from_fn(|k| target[k] - origin[k]);
        rays.push(Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY });
    }
    rays
}

fn next_index(next: &mut impl FnMut() -> f32, count: usize) -> usize {
    (next() * count as f32) as usize
}

#[test]
fn no_ray_loses_a_hit() {
    let mut hits = 0;
    for mesh in meshes() {
        let whole = on_host(&mesh, &WHOLE);
        for collapse in [Collapse::OFF, Collapse::SAH] {
            let method = Method::Hploc(Window::DEFAULT);
            let tree = on_host(&mesh, &BuildOptions { method, split: Some(ALL), collapse, ..WHOLE });
            tree.validate().unwrap_or_else(|e| panic!("{}: {e}", mesh.0));
            let (wide4, wide8, quantised) = (Wide4::of(&tree), Wide8::of(&tree), Wide8q::of(&tree));
            wide4.validate().unwrap_or_else(|e| panic!("{} wide4: {e}", mesh.0));
            wide8.validate().unwrap_or_else(|e| panic!("{} wide8: {e}", mesh.0));
            quantised.validate().unwrap_or_else(|e| panic!("{} wide8q: {e}", mesh.0));
            for ray in rays_at(&mesh, &tree) {
                let expected = tracer::closest_hit_by_brute_force(&whole, &ray);
                assert_eq!(tracer::closest_hit(&tree, &ray), expected, "{} {ray:?}", mesh.0);
                let any = tracer::any_hit(&tree, &ray);
                assert_eq!(any.is_some(), expected.is_some(), "{} {ray:?}", mesh.0);
                for wide in [
                    wide_host::trace(&wide4, &ray, Query::ClosestHit, Order::Distance).0,
                    wide_host::trace(&wide8, &ray, Query::ClosestHit, Order::Distance).0,
                    wide_host::trace(&quantised, &ray, Query::ClosestHit, Order::Distance).0,
                ] {
                    assert_eq!(wide, expected, "{} {ray:?}", mesh.0);
                }
                hits += u32::from(expected.is_some());
            }
        }
    }
    assert!(hits > 20_000, "{hits} hits");
}

#[test]
fn a_compacted_split_tree_is_valid_and_has_the_same_hits() {
    let mesh = mixed();
    let tree = lbvh(&mesh, split::SplitOptions::DEFAULT).collapsed(&Collapse::SAH);
    let compacted = tree.compacted();
    compacted.validate().expect("valid");
    assert_eq!(compacted.header.split_from, tree.header.split_from);
    for ray in rays_at(&mesh, &tree) {
        assert_eq!(tracer::closest_hit(&compacted, &ray), tracer::closest_hit(&tree, &ray), "{ray:?}");
    }
}

#[test]
fn validation_sees_a_part_that_is_lost() {
    let mesh = large(130);
    let tree = lbvh(&mesh, ALL);
    tree.validate().expect("valid");
    // A leaf that gives up an inner tenth of its box loses some of its triangle, and the boxes above stay what they are.
    let mut seen = 0;
    for slot in 0..tree.nodes.len() {
        let mut broken = tree.clone();
        let [left, right] = &mut broken.nodes[slot].children;
        let inner = (0..3).find(|&i| left.hi[i] < right.hi[i] && left.lo[i] >= right.lo[i]);
        let Some(axis) = inner.filter(|_| left.count == 1) else { continue };
        left.hi[axis] -= 0.1 * (left.hi[axis] - left.lo[axis]);
        seen += u32::from(broken.validate().is_err_and(|e| e.to_string().contains("do not cover it")));
    }
    assert!(seen > 5, "{seen} seen");
}

#[test]
fn what_cannot_be_split_says_so() {
    let device = device();
    let options = BuildOptions { split: Some(split::SplitOptions::DEFAULT), ..BuildOptions::DEFAULT };
    let error =
        |options: &BuildOptions| Builder::new(device, options, 1000).map(drop).expect_err("refused").to_string();
    for fraction in [-0.1, 1.1, f32::NAN] {
        let options = BuildOptions { split: Some(split::SplitOptions { fraction, ..ALL }), ..options };
        assert!(error(&options).contains("the fraction of splits is 0 to 1"), "{fraction}");
    }
    for most in [0, 1024] {
        let options = BuildOptions { split: Some(split::SplitOptions { most, ..ALL }), ..options };
        assert!(error(&options).contains("that is 1 to 1023"), "{most}");
    }
    assert!(error(&BuildOptions { primitives: Primitives::Boxes, ..options }).contains("only triangles"));
    assert!(error(&BuildOptions { schedule: Some(Schedule::Workgroup), ..options }).contains("choose chain, or none"));

    let refit = refit::Refit::new(device, &refit::RefitOptions::from(&options), 1000);
    assert!(refit.expect_err("refused").to_string().contains("build it again"));

    let builder = Builder::new(device, &options, 1000).unwrap();
    let once = Geometry { flags: GeometryFlags::NO_DUPLICATES, ..Geometry::mesh(256, 3000, 256) };
    let input = Input { source: Source::One(once), primitive_count: 1000 };
    let memory = Region::unbounded(256);
    assert!(builder.steps(&input, memory, memory).expect_err("refused").to_string().contains("once"));
}

#[test]
fn memory_grows_by_the_budget() {
    let sizes =
        |split| Builder::new(device(), &BuildOptions { split, ..BuildOptions::DEFAULT }, 10_000).unwrap().sizes();
    let (without, with) = (sizes(None), sizes(Some(split::SplitOptions { fraction: 0.5, ..ALL })));
    // A node and a record for each reference.
    assert_eq!(with.structure - without.structure, 5000 * (64 + 40));
    assert!(with.scratch > without.scratch + 15_000 * 32, "room for the references");
}

#[test]
fn triangles_of_other_formats_and_of_several_geometries_are_split_alike() {
    let (device, mesh) = (device(), mixed());
    let options = BuildOptions { split: Some(split::SplitOptions::DEFAULT), ..WHOLE };
    let expected = on_host(&mesh, &options);
    let count = mesh.2.len() as u32;
    // Each triangle has vertices of its own, in order: they need no indices.
    let vertices = device.upload("positions", &mesh.1).unwrap();
    let whole = Geometry { index_format: IndexFormat::NONE, ..Geometry::mesh(vertices.address(), 3 * count, 0) };
    let tree = built(&options, &Input { source: Source::One(whole), primitive_count: count });
    assert_same(&tree, &expected, "without indices");

    const FIRST: u32 = 300;
    let second = Geometry {
        vertices: vertices.address() + 36 * u64::from(FIRST),
        vertex_count: 3 * (count - FIRST),
        first: FIRST,
        ..whole
    };
    let records = device.upload("geometries", &[Geometry { vertex_count: 3 * FIRST, ..whole }, second]).unwrap();
    let source = Source::Several { records: records.address(), count: 2 };
    let options = BuildOptions { geometry_count: 2, ..options };
    let tree = built(&options, &Input { source, primitive_count: count });
    let expected = expected.with_geometries(&[(FIRST, 0), (count - FIRST, 0)], 0);
    assert_same(&tree, &expected, "two geometries");
}

#[test]
fn a_refit_leaves_a_split_structure_as_it_is() {
    let (device, mesh) = (device(), mixed());
    let count = mesh.2.len() as u32;
    let tree = lbvh(&mesh, split::SplitOptions::DEFAULT).collapsed(&Collapse::SAH);
    // As large as one without splits, so that nothing but the header tells.
    let before = tree.compacted().to_bytes();
    let planned = tree.header.active;
    let refit = refit::Refit::new(device, &refit::RefitOptions::DEFAULT, planned).unwrap();
    let positions: Vec<[f32; 3]> = mesh.1.iter().map(|p| p.map(|x| x + 1.0)).collect();
    let vertices = device.upload("positions", &positions).unwrap();
    let indices = device.upload("indices", &mesh.2).unwrap();
    let structure = device.upload("structure", &before).unwrap();
    let scratch = device.buffer("scratch", refit.scratch_bytes()).unwrap();
    // Room for more triangles than there are: none is read.
    let input = Input::mesh(vertices.address(), 3 * count, indices.address(), planned);
    device.run(None, |r| refit.record(r, &input, structure.region(), scratch.region())).unwrap();
    assert!(structure.read::<u8>(before.len()) == before, "other bytes");
}
