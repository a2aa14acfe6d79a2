//! The grid of rays: the device's is the twin's, number for number, and says how many rays meet a box.

use crate::common::device;
use crate::common::shapes::{
    Corners, hard_rays, icosphere, no_rays, placed, rays_from_inside, soup, tree_of, tree_with,
};
use hedgerow::bvh::flux::{CELLS, FluxGrid, GRID_BYTES, MAX_FLUX_RAYS};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::geometry::Aabb;
use hedgerow::gpu::Region;
use hedgerow::trace::flux::{FluxPass, FluxRays};
use hedgerow::trace::twin::{flux, tracer};
use hedgerow::trace::{Hit, Ray};

const GUARD: [u8; 64] = [0xA5; 64];

fn hits_of(tree: &Bvh2, rays: &[Ray]) -> Vec<Hit> {
    rays.iter().map(|ray| tracer::closest_hit(tree, ray)).collect()
}

/// The device's bytes, of every `stride`-th ray of each sample.
fn on_device(tree: &Bvh2, samples: &[&[Ray]], stride: u32) -> Vec<u8> {
    let device = device();
    let structure = device.upload("structure", &tree.to_bytes()).expect("memory");
    let grid = device.upload("grid", &[vec![0xEE; GRID_BYTES as usize], GUARD.to_vec()].concat()).expect("memory");
    let uploaded: Vec<_> = samples
        .iter()
        .map(|rays| {
            let hits = hits_of(tree, rays);
            (
                rays.len() as u32,
                device.upload("rays", rays).expect("memory"),
                device.upload("hits", &hits).expect("memory"),
            )
        })
        .collect();
    let taken: Vec<FluxRays> = uploaded
        .iter()
        .map(|(ray_count, rays, hits)| FluxRays {
            rays: rays.region(),
            hits: hits.region(),
            ray_count: *ray_count,
            first: 0,
            stride,
        })
        .collect();
    device.run(None, |r| FluxPass::new(device).record(r, structure.region(), &taken, grid.region())).expect("filled");
    assert_eq!(grid.read_at::<u8>(GRID_BYTES, GUARD.len()), GUARD, "wrote behind the grid");
    grid.read::<u8>(GRID_BYTES as usize)
}

fn on_host(tree: &Bvh2, samples: &[&[Ray]], stride: usize) -> FluxGrid {
    let taken: Vec<(Ray, Hit)> =
        samples.iter().flat_map(|rays| rays.iter().copied().zip(hits_of(tree, rays)).step_by(stride)).collect();
    flux::fill(tree, taken.iter().map(|(ray, hit)| (ray, hit)))
}

#[track_caller]
fn assert_as_on_the_host(what: &str, tree: &Bvh2, samples: &[&[Ray]], stride: u32) {
    let expected = on_host(tree, samples, stride as usize).to_bytes();
    let got = on_device(tree, samples, stride);
    let differs = got.iter().zip(&expected).position(|(a, b)| a != b);
    assert_eq!((got.len(), differs), (expected.len(), None), "{what}: the first byte that differs");
}

#[test]
fn the_grid_is_that_of_the_host_at_any_scale() {
    for (size, scale, far) in [(0.3, 1.0, 0.0), (1.0, 1.0, 3.0), (0.2, 1e-10, 0.0), (0.2, 1e15, 1.0), (0.2, 1e30, 0.0)]
    {
        let offset = [far * scale, -far * scale, 0.5 * far * scale];
        let corners = placed(&soup(300, size, 5), scale, offset);
        let rays = hard_rays(&corners, 1_000, scale, offset, 11);
        let inside = rays_from_inside(&corners, 500, scale, offset);
        let tree = tree_with(&corners, Collapse::SAH);
        assert_as_on_the_host(&format!("soup of {scale:e}"), &tree, &[&rays, &inside], 1);
        let counted = on_host(&tree, &[&inside], 1).rays(&tree.header.root.bounds());
        assert!(counted > 300.0, "soup of {scale:e}: {counted} of 500 rays");
    }
    let corners = icosphere(2);
    let rays = hard_rays(&corners, 65, 1.0, [0.0; 3], 3);
    for count in [0, 1, 63, 64, 65] {
        assert_as_on_the_host("a sphere", &tree_of(&corners), &[&rays[..count]], 1);
    }
    assert_as_on_the_host("every third", &tree_of(&corners), &[&rays, &rays[..10]], 3);
    assert_as_on_the_host("what is no ray", &tree_of(&corners), &[&no_rays()], 1);
}

#[test]
fn grids_over_flat_scenes_points_and_nothing_are_those_of_the_host() {
    let flat = |axis: usize| -> Corners {
        let mut corners = soup(50, 0.4, 3);
        corners.iter_mut().flatten().for_each(|p| p[axis] = 0.25);
        corners
    };
    let rays = hard_rays(&soup(50, 0.4, 3), 400, 1.0, [0.0; 3], 8);
    for corners in [flat(0), flat(1), flat(2), vec![[[0.5; 3]; 3]; 3], soup(1, 0.5, 1), Corners::new()] {
        assert_as_on_the_host(&format!("{} triangles", corners.len()), &tree_of(&corners), &[&rays], 1);
    }
}

/// A room of [0, 1]³ whose grid lines are multiples of 1/64.
fn room() -> Bvh2 {
    let far = |x: f32| [[x, x, x], [x, x, x], [x, x, x]];
    tree_of(&vec![far(0.0), far(1.0)])
}

fn straight(from: [f32; 3], to: [f32; 3]) -> (Ray, Hit) {
    let direction = std::array::from_fn(|i| to[i] - from[i]);
    (Ray { origin: from, t_min: 0.0, direction, t_max: f32::INFINITY }, Hit { t: 1.0, primitive: 0, u: 0.0, v: 0.0 })
}

#[test]
fn boxes_of_whole_cells_have_the_segments_that_meet_them() {
    let tree = room();
    let cells = CELLS as f32;
    let mut word = 7u32;
    let mut next = move || {
        word = word.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (word >> 8) as f32 / (1 << 24) as f32
    };
    // Some begin or end out of the room.
    let segments: Vec<(Ray, Hit)> =
        (0..300).map(|_| straight([0; 3].map(|_| 1.4 * next() - 0.2), [0; 3].map(|_| 1.4 * next() - 0.2))).collect();
    let grid = flux::fill(&tree, segments.iter().map(|(ray, hit)| (ray, hit)));
    let mut met = 0.0;
    for _ in 0..200 {
        let a: [f32; 3] = [0; 3].map(|_| (next() * cells).floor());
        let b: [f32; 3] = std::array::from_fn(|i| (a[i] + 1.0 + (next() * 20.0).floor()).min(cells));
        let bounds = Aabb { lo: a.map(|x| x / cells), hi: b.map(|x| x / cells) };
        // The clipped segment has a length within.
        let meets = |(ray, _): &&(Ray, Hit)| {
            let (mut near, mut far) = (0.0f32, 1.0f32);
            for i in 0..3 {
                let [p, q] = [bounds.lo[i], bounds.hi[i]].map(|wall| (wall - ray.origin[i]) / ray.direction[i]);
                (near, far) = (near.max(p.min(q)), far.min(p.max(q)));
            }
            near < far
        };
        let expected = segments.iter().filter(meets).count() as f32;
        let got = grid.rays(&bounds);
        // Places are whole 512ths of a cell: a segment may just miss an edge or a corner.
        assert!((got - expected).abs() <= 1.0 + 0.03 * expected, "{bounds:?}: {got} rays, {expected} meet it");
        met += expected;
    }
    assert!(met > 1000.0, "{met} rays in all boxes");
}

#[test]
fn a_box_within_a_cell_has_its_part_of_the_cell() {
    let tree = room();
    // Across the x faces of one cell, and no other face of it.
    let (ray, hit) = straight([0.1 / 64.0, 32.5 / 64.0, 32.5 / 64.0], [62.9 / 64.0, 32.5 / 64.0, 32.5 / 64.0]);
    let grid = flux::fill(&tree, std::iter::repeat_n((&ray, &hit), 1000));
    let at = |lo: [f32; 3], hi: [f32; 3]| grid.rays(&Aabb { lo: lo.map(|x| x / 64.0), hi: hi.map(|x| x / 64.0) });
    assert_eq!(at([20.0, 32.0, 32.0], [21.0, 33.0, 33.0]), 1000.0);
    assert_eq!(at([20.25, 32.0, 32.0], [20.5, 32.5, 32.25]), 125.0);
    assert_eq!(at([20.25, 31.0, 31.5], [25.5, 32.5, 32.25]), 125.0);
    assert_eq!(at([20.0, 33.0, 32.0], [21.0, 40.0, 33.0]), 0.0);
}

#[test]
fn what_is_no_sample_is_refused_by_name() {
    let device = device();
    let of = |bytes| Region { address: 16, bytes };
    let rays = FluxRays { rays: of(320), hits: of(160), ray_count: 10, first: 0, stride: 1 };
    let refused = |rays: &[FluxRays], grid: Region| {
        device.run(None, |r| FluxPass::new(device).record(r, of(1 << 20), rays, grid)).expect_err("refused").to_string()
    };
    let grid = of(GRID_BYTES);
    assert!(refused(&[FluxRays { stride: 0, ..rays }], grid).contains("take a stride of 1"));
    assert!(refused(&[FluxRays { ray_count: 11, ..rays }], grid).contains("memory of rays of 320"));
    assert!(refused(&[FluxRays { rays: of(352), ray_count: 11, ..rays }], grid).contains("memory of hits of 160"));
    assert!(refused(&[rays], of(GRID_BYTES - 1)).contains("memory for a grid of rays"));
    // The rays of all samples are counted together.
    let half = FluxRays { rays: of(1 << 40), hits: of(1 << 40), ray_count: MAX_FLUX_RAYS / 2 + 1, ..rays };
    assert!(refused(&[half, half], grid).contains(&MAX_FLUX_RAYS.to_string()));
}
