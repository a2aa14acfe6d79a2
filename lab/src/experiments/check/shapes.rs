//! Meshes and rays for the tracing tests, made of nothing but numbers.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use super::corpus;
use crate::random::SplitMix64;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::Ray;

/// Triangles by their corners.
pub type Corners = Vec<[[f32; 3]; 3]>;

/// `count` triangles of a size of about `size` in the cube −1..1.
pub fn soup(count: usize, size: f32, seed: u64) -> Corners {
    let mut random = SplitMix64::new(seed);
    (0..count)
        .map(|_| {
            let centre = random.around(1.0);
            [(); 3].map(|()| add(centre, random.around(size)))
        })
        .collect()
}

/// `count` boxes with edges of up to `size` that begin in the cube −1..1, by their least and greatest corners.
pub fn boxes(count: usize, size: f32, seed: u64) -> Vec<[[f32; 3]; 2]> {
    boxes_by(&mut SplitMix64::new(seed), count, size)
}

/// The same by the next numbers of `random`.
pub fn boxes_by(random: &mut SplitMix64, count: usize, size: f32) -> Vec<[[f32; 3]; 2]> {
    let mut one = || {
        let (at, size) = (random.around(1.0), random.around(size).map(f32::abs));
        [at, add(at, size)]
    };
    (0..count).map(|_| one()).collect()
}

/// A closed mesh of 20·4^`levels` triangles with corners on the sphere around the origin.
pub fn icosphere(levels: u32) -> Corners {
    let golden = (1.0 + 5f32.sqrt()) / 2.0;
    let mut corners = Vec::new();
    for (a, b) in [(1.0, golden), (-1.0, golden), (1.0, -golden), (-1.0, -golden)] {
        corners.extend([[0.0, a, b], [a, b, 0.0], [b, 0.0, a]]);
    }
    let edge = |p: [f32; 3], q: [f32; 3]| (0..3).map(|i| (p[i] - q[i]).powi(2)).sum::<f32>() < 4.1;
    let mut faces = Corners::new();
    for i in 0..12 {
        for j in 0..i {
            for k in 0..j {
                let [p, q, r] = [corners[i], corners[j], corners[k]];
                if edge(p, q) && edge(q, r) && edge(r, p) {
                    faces.push([p, q, r].map(onto_sphere));
                }
            }
        }
    }
    for _ in 0..levels {
        faces = faces
            .iter()
            .flat_map(|&[a, b, c]| {
                // The sum of two corners is the same from both sides of an edge, so neighbours share their corners' bits.
                let [ab, bc, ca] = [(a, b), (b, c), (c, a)].map(|(p, q)| onto_sphere(add(p, q)));
                [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
            })
            .collect();
    }
    faces
}

pub fn onto_sphere(p: [f32; 3]) -> [f32; 3] {
    let length = p.iter().map(|x| x * x).sum::<f32>().sqrt();
    p.map(|x| x / length)
}

pub fn add(p: [f32; 3], q: [f32; 3]) -> [f32; 3] {
    std::array::from_fn(|i| p[i] + q[i])
}

/// Every corner scaled, then moved.
pub fn placed(corners: &Corners, scale: f32, offset: [f32; 3]) -> Corners {
    corners.iter().map(|triangle| triangle.map(|p| add(p.map(|x| x * scale), offset))).collect()
}

/// The host's LBVH with leaves of several triangles.
pub fn tree_of(corners: &Corners) -> Bvh2 {
    tree_with(corners, Collapse::SAH)
}

/// The host's LBVH.
pub fn tree_with(corners: &Corners, collapse: Collapse) -> Bvh2 {
    let (_, positions, triangles) = corpus::soup("", corners.clone());
    lbvh::build(&positions, &triangles, Code::Emc64Var.full(), collapse)
}

/// A ray without an end.
pub fn ray(origin: [f32; 3], direction: [f32; 3]) -> Ray {
    Ray { origin, t_min: 0.0, direction, t_max: f32::INFINITY }
}

/// Rays from `offset`, the middle of a closed surface of radius `scale`, and from around it, through corners and edges: each must
/// hit.
pub fn rays_from_inside(corners: &Corners, count: usize, scale: f32, offset: [f32; 3]) -> Vec<Ray> {
    let around = |random: &mut SplitMix64| add(offset, random.around(0.2 * scale));
    rays_to(corners, count, scale, 7, |random, i| if i % 2 == 0 { offset } else { around(random) })
}

/// From the middle of a closed surface to it: through corners and edges, and at any place between them.
pub fn rays_from_the_middle(corners: &Corners, count: usize, scale: f32, offset: [f32; 3]) -> Vec<Ray> {
    rays_to(corners, count, scale, 3, |_, _| offset)
}

fn rays_to(
    corners: &Corners,
    count: usize,
    scale: f32,
    seed: u64,
    origin: impl Fn(&mut SplitMix64, usize) -> [f32; 3],
) -> Vec<Ray> {
    let mut random = SplitMix64::new(seed);
    (0..count)
        .map(|i| {
            let origin = origin(&mut random, i);
            let [a, b, c] = corners[random.bits() as usize % corners.len()];
            let along = [0.0, 0.25, 0.5, 1.0, random.signed().abs()][i % 5];
            let from = if i % 7 == 0 { c } else { a };
            let to = |k: usize| along * (b[k] - origin[k]) + (1.0 - along) * (from[k] - origin[k]);
            ray(origin, std::array::from_fn(|k| to(k) / scale))
        })
        .collect()
}

/// Rays with this number as their direction, and in place of each of their words.
pub fn rays_with(bad: f32) -> Vec<Ray> {
    let of_word = |word: usize| {
        let mut words = [0.1, 0.2, 0.3, 0.0, 0.5, 0.6, -0.7, 9.0];
        words[word] = bad;
        bytemuck::cast(words)
    };
    [ray([0.0; 3], [bad; 3])].into_iter().chain((0..8).map(of_word)).collect()
}

/// What is not a ray, or nearly none.
pub fn no_rays() -> Vec<Ray> {
    [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 0.0, -0.0, 1e38].map(rays_with).concat()
}

/// Rays that are hard for a scene in `−scale..scale` around `offset`: random ones, along the axes and in their planes, with
/// zeroes of both signs, through corners, edges and centres of triangles, along edges, and short ones.
pub fn hard_rays(corners: &Corners, count: usize, scale: f32, offset: [f32; 3], seed: u64) -> Vec<Ray> {
    let mut random = SplitMix64::new(seed);
    (0..count)
        .map(|i| {
            let origin = add(random.around(1.5 * scale), offset);
            let number = random.bits() as usize % corners.len().max(1);
            let [a, b, c] = corners.get(number).copied().unwrap_or_default();
            let to = |target: [f32; 3]| std::array::from_fn(|k| target[k] - origin[k]);
            let middle = |p: [f32; 3], q: [f32; 3]| std::array::from_fn(|k| 0.5 * p[k] + 0.5 * q[k]);
            let mut ray = match i % 8 {
                0 => ray(origin, random.around(1.0)),
                1 => {
                    let mut axis = [[0.0, -0.0][i / 8 % 2]; 3];
                    axis[i / 8 % 3] = random.signed();
                    ray(origin, axis)
                }
                2 => {
                    let mut plane = random.around(1.0);
                    plane[i / 8 % 3] = [0.0, -0.0][i / 8 % 2];
                    // From the height of a corner, so that it runs along the faces of boxes.
                    let mut origin = origin;
                    origin[i / 8 % 3] = a[i / 8 % 3];
                    ray(origin, plane)
                }
                3 => ray(origin, to(a)),
                4 => ray(origin, to(middle(a, b))),
                5 => ray(origin, to(middle(middle(a, b), c))),
                6 => ray(a, std::array::from_fn(|k| b[k] - a[k])),
                _ => Ray { t_min: 0.25, t_max: 1.0, ..ray(origin, to(middle(a, c))) },
            };
            if i % 3 == 0 {
                let stretch = 2f32.powi((random.bits() % 80) as i32 - 40);
                ray.direction = ray.direction.map(|x| x * stretch);
                ray.t_min /= stretch;
                ray.t_max /= stretch;
            }
            ray
        })
        .collect()
}
