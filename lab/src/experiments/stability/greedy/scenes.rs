//! The scenes of van Kralingen 2023, section 4.4, and parts of real ones: a few triangles each, as their boxes.

use crate::random::SplitMix64;
use crate::scene::Mesh;
use glam::{Quat, Vec3};
use hedgerow::geometry::Aabb;

/// How far a shape is moved from the middle of its cell at most, in cells.
const MOVED: f32 = 0.15;
/// How far the corners of a shape are from its middle, in cells.
const RADIUS: f32 = 0.35;

/// Triangles whose corners are anywhere in a cube. Fewer of the same seed are the first of them.
pub fn random(count: u32, seed: u64) -> Vec<Aabb> {
    let mut random = SplitMix64::new(seed);
    (0..count).map(|_| Aabb::around(&[(); 3].map(|()| random.point(0.0, 1.0)))).collect()
}

/// Equilateral triangles, each turned and moved at random in its cell of a grid.
pub fn displaced(count: u32, seed: u64) -> Vec<Aabb> {
    let corner = |third: f32| {
        let turn = third * std::f32::consts::TAU / 3.0;
        RADIUS * Vec3::new(turn.cos(), turn.sin(), 0.0)
    };
    in_cells(&[[corner(0.0), corner(1.0), corner(2.0)]], count, seed)
}

/// The four faces each of regular tetrahedra, turned and moved at random in their cells of a grid.
pub fn tetrahedra(count: u32, seed: u64) -> Vec<Aabb> {
    let [a, b, c, d] = [[1.0, 1.0, 1.0], [1.0, -1.0, -1.0], [-1.0, 1.0, -1.0], [-1.0, -1.0, 1.0]]
        .map(|corner| RADIUS * Vec3::from_array(corner).normalize());
    in_cells(&[[a, b, c], [a, b, d], [a, c, d], [b, c, d]], count, seed)
}

/// Shapes in cells of the smallest cube of cells that has room, of 3 × 3 × 3 at least.
fn in_cells(shape: &[[Vec3; 3]], count: u32, seed: u64) -> Vec<Aabb> {
    let mut random = SplitMix64::new(seed);
    let side = (3u32..).find(|side| side.pow(3) >= count).expect("a count of 32 bits has a root");
    let mut cells: Vec<u32> = (0..side.pow(3)).collect();
    for i in (1..cells.len()).rev() {
        cells.swap(i, (random.fine_unit() * (i + 1) as f64) as usize);
    }
    let shape_in = |cell: u32| {
        let turn = rotation(&mut random);
        let at = Vec3::from_array([cell, cell / side, cell / side.pow(2)].map(|k| (k % side) as f32));
        let moved = at + Vec3::from_array(random.around(MOVED));
        shape.iter().map(move |triangle| Aabb::around(&triangle.map(|corner| (turn * corner + moved).to_array())))
    };
    cells.into_iter().take(count as usize).flat_map(shape_in).collect()
}

/// Uniform among all rotations (Shoemake 1992, "Uniform Random Rotations").
fn rotation(random: &mut SplitMix64) -> Quat {
    let [part, first, second] = random.point(0.0, 1.0);
    let [first, second] = [first, second].map(|turn| turn * std::f32::consts::TAU);
    let [a, b] = [(1.0 - part).sqrt(), part.sqrt()];
    Quat::from_xyzw(a * first.sin(), a * first.cos(), b * second.sin(), b * second.cos())
}

/// Triangles of a mesh, drawn by their areas (Efraimidis and Spirakis 2006, "Weighted random sampling with a reservoir").
pub fn sampled(mesh: &Mesh, count: u32, seed: u64) -> Vec<Aabb> {
    let mut random = SplitMix64::new(seed);
    let mut keys: Vec<(f64, usize)> = (0..mesh.triangles.len())
        .map(|i| {
            let [a, b, c] = corners(mesh, i);
            // The logarithm of the least of as many numbers as the area says.
            (random.fine_unit().ln() / f64::from((b - a).cross(c - a).length()), i)
        })
        .filter(|(key, _)| key.is_finite())
        .collect();
    keys.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    boxes_of(mesh, keys.iter().take(count as usize).map(|&(_, i)| i))
}

/// The triangles of a mesh whose middles are nearest to that of one which is drawn.
pub fn near(mesh: &Mesh, count: u32, seed: u64) -> Vec<Aabb> {
    let middle = |i: usize| corners(mesh, i).into_iter().sum::<Vec3>() / 3.0;
    let drawn = (SplitMix64::new(seed).fine_unit() * mesh.triangles.len() as f64) as usize;
    let mut keys: Vec<(f32, usize)> =
        (0..mesh.triangles.len()).map(|i| (middle(i).distance_squared(middle(drawn)), i)).collect();
    keys.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    boxes_of(mesh, keys.iter().take(count as usize).map(|&(_, i)| i))
}

fn corners(mesh: &Mesh, triangle: usize) -> [Vec3; 3] {
    mesh.triangles[triangle].map(|vertex| Vec3::from_array(mesh.positions[vertex as usize]))
}

fn boxes_of(mesh: &Mesh, triangles: impl Iterator<Item = usize>) -> Vec<Aabb> {
    triangles.map(|i| Aabb::around(&corners(mesh, i).map(|corner| corner.to_array()))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The diameter of the sphere around a shape.
    const LONGEST: f32 = 2.0 * RADIUS;

    #[test]
    fn scenes_have_as_many_triangles_as_asked_for_and_differ_by_seed() {
        for (of, each) in [(random as fn(u32, u64) -> Vec<Aabb>, 1), (displaced, 1), (tetrahedra, 4)] {
            for count in [3, 12, 27, 28, 64] {
                assert_eq!(of(count, 1).len(), (count * each) as usize);
                assert_eq!(of(count, 1), of(count, 1));
                assert_ne!(of(count, 1), of(count, 2));
            }
        }
        assert_eq!(random(15, 9)[..3], random(3, 9), "fewer are the first of more");
    }

    #[test]
    fn shapes_keep_to_their_cells() {
        for (of, each) in [(displaced as fn(u32, u64) -> Vec<Aabb>, 1), (tetrahedra, 4)] {
            let boxes = of(27, 5);
            let shapes: Vec<Aabb> =
                boxes.chunks(each).map(|faces| faces.iter().fold(Aabb::EMPTY, |all, face| all.union(face))).collect();
            let mut cells: Vec<[i32; 3]> = shapes
                .iter()
                .map(|shape| [0, 1, 2].map(|k| (0.5 * (shape.lo[k] + shape.hi[k])).round() as i32))
                .collect();
            assert!(shapes.iter().all(|shape| (0..3).all(|k| shape.hi[k] - shape.lo[k] <= LONGEST + 1e-5)));
            cells.sort_unstable();
            cells.dedup();
            assert_eq!(cells.len(), 27, "a shape each");
        }
    }

    /// A row of small triangles along x, and a large one at its end.
    fn row() -> Mesh {
        let triangle = |i: usize| {
            let size = if i == 99 { 1000.0 } else { 0.1 };
            [[i as f32, 0.0, 0.0], [i as f32 + size, 0.0, 0.0], [i as f32, size, 0.0]]
        };
        let positions = (0..100).flat_map(triangle).collect();
        Mesh { positions, triangles: (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect() }
    }

    #[test]
    fn large_triangles_are_drawn_more_often_and_near_ones_lie_together() {
        let of_row = row();
        let has_large = |seed| sampled(&of_row, 1, seed)[0].hi[0] > 500.0;
        assert!((0..50).all(has_large), "it has all but 10⁻⁶ of the area");
        for seed in 0..20 {
            let boxes = near(&of_row, 5, seed);
            let around = boxes.iter().fold(Aabb::EMPTY, |all, b| all.union(b));
            assert!(boxes.len() == 5 && around.lo[0] >= around.hi[0].min(100.0) - 10.0, "{around:?}");
        }
        assert_eq!(sampled(&of_row, 200, 1).len(), 100);
    }
}
