//! No ray falls through a vertex or an edge that triangles share, near the origin or far from it, in instances of any place.
//! The cases are those of VK-GL-CTS; a miss, which it takes for a warning, fails here.

use crate::common::backends::{Backend, backends};
use crate::common::matrices::{Matrix, moved, rotation};
use crate::common::probe::{CONFIRM, IGNORE, ProbeRay};
use crate::common::shapes::Corners;
use crate::common::world::{Part, World, transformed};
use hedgerow::accel::Instance;
use hedgerow::ash::vk::GeometryFlagsKHR as GeometryFlags;
use hedgerow_lab::random::SplitMix64;

/// A surface and places on it where rays must not pass: vertices and points of edges, none of them on its border.
struct Surface {
    name: String,
    corners: Corners,
    places: Vec<[f32; 3]>,
}

fn between(a: [f32; 3], b: [f32; 3], part: f32) -> [f32; 3] {
    std::array::from_fn(|k| a[k] + part * (b[k] - a[k]))
}

/// The square 0..1 in 2·`w`·`h` triangles, whose vertices inside are moved about in its plane by a part of a cell, and which
/// is scaled and then moved; all of it in float32, so that neighbours share their corners' bits.
fn square(w: usize, h: usize, jitter: f32, scale: f32, to: [f32; 3], seed: u64) -> Surface {
    let mut random = SplitMix64::new(seed);
    let mut vertices = Vec::new();
    for j in 0..=h {
        for i in 0..=w {
            let inside = (0 < i && i < w && 0 < j && j < h) as u8 as f32;
            let [a, b, _] = random.around(jitter * inside);
            let at = [(i as f32 + a) / w as f32, (j as f32 + b) / h as f32, 0.0];
            vertices.push(std::array::from_fn(|k| at[k] * scale + to[k]));
        }
    }
    let vertex = |i: usize, j: usize| vertices[j * (w + 1) + i];
    let mut corners = Corners::new();
    let mut places = Vec::new();
    for j in 0..h {
        for i in 0..w {
            let [a, b, c, d] = [vertex(i, j), vertex(i + 1, j), vertex(i + 1, j + 1), vertex(i, j + 1)];
            corners.extend([[a, b, c], [a, c, d]]);
            places.extend([between(a, c, 0.5), between(a, c, 0.25)]);
            if j > 0 {
                places.push(between(a, b, 0.5));
            }
            if i > 0 && j > 0 {
                places.push(a);
            }
        }
    }
    Surface { name: format!("square of {} triangles at {to:?}, seed {seed}", corners.len()), corners, places }
}

/// `count` triangles around a vertex, on a cone that is flatter than any ray.
fn fan(count: usize, scale: f32, to: [f32; 3], seed: u64) -> Surface {
    let mut random = SplitMix64::new(seed);
    let place = |at: [f32; 3]| std::array::from_fn(|k| at[k] * scale + to[k]);
    let rim: Vec<[f32; 3]> = (0..count)
        .map(|i| {
            let turn = std::f32::consts::TAU * (i as f32 + 0.3 * random.signed()) / count as f32;
            let radius = 1.0 + 0.3 * random.signed();
            place([radius * turn.cos(), radius * turn.sin(), -0.1 * radius])
        })
        .collect();
    let top = place([0.0; 3]);
    let corners = (0..count).map(|i| [top, rim[i], rim[(i + 1) % count]]).collect();
    let spokes = rim.iter().flat_map(|&at| [0.5, 0.25, 0.01].map(|part| between(top, at, part)));
    let places = spokes.chain([top; 8]).collect();
    Surface { name: format!("fan of {count} triangles at {to:?}, seed {seed}"), corners, places }
}

/// Two rays to each of some places: straight down, exactly through what is a vertex, and from anywhere above.
fn rays(surface: &Surface, scale: f32, count: usize) -> Vec<(ProbeRay, [f32; 3])> {
    let mut random = SplitMix64::new(surface.places.len() as u64);
    let mut all = Vec::new();
    for i in 0..count.min(surface.places.len()) {
        let at = if surface.places.len() <= count { i } else { random.bits() as usize % surface.places.len() };
        let target = surface.places[at];
        let above = [target[0], target[1], target[2] + scale];
        let [x, y, z] = random.around(scale);
        let beside = [target[0] + x, target[1] + y, target[2] + 0.5 * scale + z.abs()];
        all.push((ProbeRay::new(above, [0.0, 0.0, -1.0 / 3.0]), target));
        all.push((ProbeRay::new(beside, std::array::from_fn(|k| target[k] - beside[k])), target));
    }
    all
}

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f64>().sqrt()
}

/// Traces as opaque triangles and as such that are asked of; returns the rays that miss.
fn misses(backend: &dyn Backend, surface: &Surface, scale: f32, matrix: Matrix, count: usize) -> usize {
    let to_world = matrix.map(|row| row.map(f64::from));
    let bring = |p: [f32; 3], w| transformed(&to_world, p.map(f64::from), w).map(|x| x as f32);
    let (local, targets): (Vec<ProbeRay>, Vec<[f32; 3]>) = rays(surface, scale, count).into_iter().unzip();
    let brought = local.iter().map(|ray| ProbeRay {
        origin: bring(ray.origin, 1.0),
        direction: bring(ray.direction, 0.0),
        ..*ray
    });
    let rays: Vec<ProbeRay> = brought.collect();
    let mut misses = 0;
    for (flags, decision) in
        [(GeometryFlags::OPAQUE, CONFIRM), (GeometryFlags::NO_DUPLICATE_ANY_HIT_INVOCATION, IGNORE)]
    {
        let part = Part::Triangles(vec![(surface.corners.clone(), flags)]);
        let world = World::new(vec![part], vec![Instance::new(1, matrix)]);
        let built = world.build(backend);
        let asked: Vec<ProbeRay> = rays.iter().map(|ray| ProbeRay { decision, ..*ray }).collect();
        for (i, report) in backend.probe(built.top.structure, &asked).iter().enumerate() {
            let what = || format!("{}, {}, {matrix:?}: {:?}: {report:?}", backend.name(), surface.name, asked[i]);
            if decision == CONFIRM {
                let hit = &report.committed;
                misses += usize::from(hit.kind == 0);
                // Where the ray is at t: at its target, as far as the coordinates tell.
                let (target, ray) = (bring(targets[i], 1.0), &asked[i]);
                let at = std::array::from_fn(|k| f64::from(ray.origin[k]) + f64::from(hit.t * ray.direction[k]));
                let largest = ray.origin.iter().chain(&target).fold(scale, |a, b| a.max(b.abs()));
                let far = distance(at, target.map(f64::from));
                assert!(hit.kind == 0 || far < 1e-5 * f64::from(largest), "{}: {far} from its target", what());
            } else {
                misses += usize::from(report.candidate_count == 0);
                // Some share the place; none is a candidate twice.
                let mut told = report.sorted_candidates();
                let count = told.len();
                told.dedup();
                assert_eq!(told.len(), count, "{}", what());
            }
        }
        backend.destroy(built.top.structure);
        built.parts.iter().for_each(|part| backend.destroy(part.structure));
    }
    misses
}

fn assert_closed(surfaces: &[(Surface, f32)], matrices: &[Matrix], count: usize) {
    for backend in backends() {
        let (mut all, mut lost) = (0, 0);
        for (surface, scale) in surfaces {
            for &matrix in matrices {
                let here = misses(&*backend, surface, *scale, matrix, count);
                all += 4 * count.min(surface.places.len());
                lost += here;
                assert!(
                    backend.name() != "hedgerow" || here == 0,
                    "{}, {matrix:?}: {here} rays fall through",
                    surface.name
                );
            }
        }
        // Of others the specification asks that they should.
        assert!(lost * 100 <= all, "{}: {lost} of {all} rays fall through", backend.name());
    }
}

#[test]
fn no_ray_falls_through_a_subdivided_square() {
    let sizes = [(2, 1), (2, 2), (8, 8), (32, 32), (256, 128)];
    let of = |(w, h), seed| (square(w, h, 0.4, 1.0, [0.0; 3], seed), 1.0);
    let surfaces: Vec<_> = sizes.into_iter().flat_map(|size| [of(size, 1), of(size, 2)]).collect();
    assert_closed(&surfaces, &[Instance::IDENTITY, rotation(31)], 400);
}

#[test]
fn no_ray_falls_through_a_closed_fan() {
    let surfaces: Vec<_> = [4, 5, 16, 100, 1024].map(|count| (fan(count, 1.0, [0.0; 3], count as u64), 1.0)).into();
    assert_closed(&surfaces, &[Instance::IDENTITY, rotation(32)], 400);
}

/// Where vertices are far from the origin, or instances are.
#[test]
fn no_ray_falls_through_far_from_the_origin() {
    let surfaces = [1e4f32, 1e6].map(|far| {
        let to = [far, -far, 0.5 * far];
        [(square(16, 16, 0.4, 0.01 * far, to, 3), 0.01 * far), (fan(64, 0.01 * far, to, 4), 0.01 * far)]
    });
    assert_closed(surfaces.as_flattened(), &[Instance::IDENTITY, rotation(33)], 300);
    let near = [(square(16, 16, 0.4, 64.0, [0.0; 3], 5), 64.0), (fan(64, 64.0, [0.0; 3], 6), 64.0)];
    let away = [1e4, 1e6].map(|far| [moved(Instance::IDENTITY, [far, -far, 0.5 * far]), moved(rotation(34), [far; 3])]);
    assert_closed(&near, away.as_flattened(), 300);
}
