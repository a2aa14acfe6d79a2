//! Scenes that hurt builders and tracers: empty, equal, flat, thin, far, huge, broken. What every builder must survive.

use super::{Mesh, generators};
use crate::random::SplitMix64;

/// One of the scenes.
#[derive(Debug, Clone)]
pub struct Degenerate {
    /// Its name.
    pub name: &'static str,
    /// What hurts, in half a sentence.
    pub what: &'static str,
    /// The triangles: unlike those of a file, not all of them finite and in range.
    pub mesh: Mesh,
}

/// The corners of a triangle.
type Corners = [[f32; 3]; 3];

const UNIT: Corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];

/// All of them, of about `count` triangles where the name does not say how many. The same every time.
pub fn degenerate(count: u32) -> Vec<Degenerate> {
    let groups = [few(), equal(count), flat_and_thin(count), scales(count), far(count), broken(count)];
    groups.into_iter().flatten().collect()
}

fn scene(name: &'static str, what: &'static str, triangles: impl IntoIterator<Item = Corners>) -> Degenerate {
    Degenerate { name, what, mesh: Mesh::of_corners(triangles) }
}

fn few() -> Vec<Degenerate> {
    vec![
        scene("empty", "no triangle at all", []),
        scene("one", "one triangle: no inner node", [UNIT]),
        scene("two", "two triangles: one inner node", [UNIT, moved(UNIT, [2.0; 3])]),
    ]
}

fn equal(n: u32) -> Vec<Degenerate> {
    let half = random(n / 2, [0.0; 3], [1.0; 3]);
    let growing = (1..=n).map(|i| around_the_origin(1.0 + i as f32));
    let zeros = [[-0.0, 0.0, -0.0], [0.0, -0.0, 1.0], [-0.0, 1.0, 0.0]];
    vec![
        scene("identical", "every triangle the same", vec![UNIT; n as usize]),
        scene("twice", "every triangle two times", [&half[..], &half[..]].concat()),
        scene("equal centroids", "around one point, each a little larger than the one before", growing),
        scene("points", "every corner at one point", vec![[[0.25; 3]; 3]; n as usize]),
        scene("negative zeros", "zeros of both signs", vec![zeros; n as usize]),
    ]
}

fn flat_and_thin(n: u32) -> Vec<Degenerate> {
    let diagonal = (0..n).map(|i| moved(around_the_origin(0.5), [i as f32; 3]));
    let flattened = |[a, b, _]: Corners| [a, b, std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i])];
    let without_area = random(n, [0.0; 3], [1.0; 3]).into_iter().map(flattened);
    let needles = generators::needles(n, 1);
    vec![
        scene("in a plane", "flat in y", random(n, [0.0, 3.0, 0.0], [1.0, 0.0, 1.0])),
        scene("on a line", "flat in x and y: no area", random(n, [0.0, 0.0, -5.0], [0.0, 0.0, 10.0])),
        scene("along a line", "their middles on the diagonal, with area", diagonal),
        scene("long street", "a thousand times as long as high", random(n, [0.0; 3], [1000.0, 1.0, 3.0])),
        Degenerate { name: "needles", what: "a thousandth as wide as long", mesh: needles },
        scene("zero area", "all three corners on a line, anywhere", without_area),
    ]
}

fn scales(n: u32) -> Vec<Degenerate> {
    let mut random_numbers = SplitMix64::new(11);
    let mut power = || power_of_two(random_numbers.within(-20.0, 20.0));
    let mixed = (0..n).map(|_| moved(around_the_origin(power()), [power(), power(), power()]));
    let boxes = n.div_ceil(12).max(2);
    let box_size = |i: u32| power_of_two(100.0 * i as f32 / (boxes - 1) as f32 - 50.0);
    let nested = (0..boxes).flat_map(|i| cube(box_size(i))).take(n as usize);
    let row_size = |i: u32| 2f32.powi(i as i32 % 96 - 48);
    let row = (0..n).map(|i| moved(around_the_origin(row_size(i)), [3.0 * row_size(i); 3]));
    vec![
        scene("mixed scales", "places and sizes from 1e-6 to 1e6", mixed),
        scene("nested", "boxes one in another, each larger by the same factor, from 2^-50 to 2^50", nested),
        scene("geometric row", "in a row, each twice as far and large as the one before, over and over", row),
        scene("tiny", "coordinates of 1e-30", random(n, [1e-30; 3], [1e-30; 3])),
        scene("huge", "coordinates of 1e30", random(n, [-1e30; 3], [2e30; 3])),
        scene("as large as floats are", "coordinates of 3e38", random(n, [-3.0e38; 3], [3.0e38; 3])),
    ]
}

fn far(n: u32) -> Vec<Degenerate> {
    let cube_at = |lo: f32, edge: f32| random(n, [lo; 3], [edge; 3]);
    let near_and = |others: Vec<Corners>| cube_at(0.0, 1.0).into_iter().chain(others);
    let mut directions = SplitMix64::new(12);
    let mut in_any_direction = |i: u32| {
        let distance = 2f32.powi(10 + i as i32);
        moved(UNIT, directions.point(-1.0, 1.0).map(|x| x * distance))
    };
    let hundred = (0..100).map(&mut in_any_direction).collect();
    let one_far = vec![[[1e12, 0.0, 0.0], [1e12, 1.0, 0.0], [1e12, 0.0, 1.0]]];
    let one_huge = vec![[[-1e6, -1e6, 0.0], [1e6, -1e6, 0.0], [0.0, 1e6, 0.5]]];
    vec![
        scene("far from the origin", "of size 100 at 1e6: a sixteenth from float to float", cube_at(1e6, 100.0)),
        scene("very far from the origin", "of size 1e26 at 1e30: few floats apart", cube_at(1e30, 1e26)),
        scene("lost far from the origin", "of size 1 at 1e30: all at one float", cube_at(1e30, 1.0)),
        scene("one far away", "one triangle at 1e12", near_and(one_far)),
        scene("a hundred far away", "a hundred triangles from 1e3 to 1e33 in all directions", near_and(hundred)),
        scene("one huge", "one triangle a million times as large as the scene", near_and(one_huge)),
    ]
}

fn broken(n: u32) -> Vec<Degenerate> {
    let among_sound_ones = "NaN, infinite and missing vertices among sound ones";
    let mut some = scene("not finite and out of range", among_sound_ones, random(n, [0.0; 3], [1.0; 3]));
    let Mesh { positions, triangles } = &mut some.mesh;
    positions.iter_mut().skip(10).step_by(97).for_each(|corner| *corner = [f32::NAN, 0.0, 0.0]);
    positions.iter_mut().skip(41).step_by(97).for_each(|corner| *corner = [0.0, f32::INFINITY, 0.0]);
    positions.iter_mut().skip(70).step_by(97).for_each(|corner| *corner = [0.5, 0.5, f32::NEG_INFINITY]);
    triangles.iter_mut().step_by(53).for_each(|triangle| triangle[2] = positions.len() as u32);
    triangles.iter_mut().skip(1).step_by(89).for_each(|triangle| triangle[0] = u32::MAX);
    vec![some, scene("nothing finite", "every corner NaN", vec![[[f32::NAN; 3]; 3]; n as usize])]
}

fn moved(corners: Corners, by: [f32; 3]) -> Corners {
    corners.map(|corner| std::array::from_fn(|i| corner[i] + by[i]))
}

/// 2^`x`, but for straight lines from one whole power to the next: no function of the platform is asked.
fn power_of_two(x: f32) -> f32 {
    2f32.powi(x.floor() as i32) * (1.0 + x - x.floor())
}

/// A triangle across the three axes whose box is the cube from −`size` to `size`.
fn around_the_origin(size: f32) -> Corners {
    [[-size, -size, size], [size, -size, -size], [-size, size, -size]]
}

/// Small triangles anywhere in the box from `lo` with edges `extent`.
fn random(count: u32, lo: [f32; 3], extent: [f32; 3]) -> Vec<Corners> {
    let mut random = SplitMix64::new(u64::from(count) + 7);
    let triangle = |_| {
        let centre: [f32; 3] = std::array::from_fn(|i| lo[i] + extent[i] * random.unit());
        std::array::from_fn(|_| std::array::from_fn(|i| centre[i] + 0.05 * extent[i] * (random.unit() - 0.5)))
    };
    (0..count).map(triangle).collect()
}

/// The twelve triangles of the cube from −`size` to `size`.
fn cube(size: f32) -> impl Iterator<Item = Corners> {
    (0..6).flat_map(move |face| {
        let (axis, at) = (face / 2, if face % 2 == 0 { -size } else { size });
        let corner = |x: f32, y: f32| {
            let mut corner = [at; 3];
            (corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (x, y);
            corner
        };
        let [a, b, c, d] = [corner(-size, -size), corner(size, -size), corner(size, size), corner(-size, size)];
        [[a, b, c], [a, c, d]]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use hedgerow::geometry::Aabb;

    fn mesh(name: &str, count: u32) -> Mesh {
        degenerate(count).into_iter().find(|scene| scene.name == name).expect(name).mesh
    }

    #[test]
    fn names_tell_them_apart_and_sizes_are_as_asked_for() {
        let scenes = degenerate(600);
        for (i, scene) in scenes.iter().enumerate() {
            assert!(scenes[..i].iter().all(|other| other.name != scene.name), "{}", scene.name);
            let count = scene.mesh.triangles.len();
            let few = ["empty", "one", "two"].contains(&scene.name);
            assert!(few && count <= 2 || (600..=700).contains(&count), "{}: {count}", scene.name);
        }
        // Nothing asked for is nothing broken.
        assert!(degenerate(0).iter().all(|scene| scene.mesh.triangles.len() <= 101));
    }

    #[test]
    fn they_are_what_they_are_called() {
        let boxes =
            |mesh: &Mesh| -> Vec<Aabb> { (0..mesh.triangles.len()).map(|i| Aabb::around(&mesh.corners(i))).collect() };
        let equal = boxes(&mesh("equal centroids", 200));
        assert!(equal.iter().all(|b| b.centroid() == [0.0; 3]) && equal.windows(2).all(|w| w[1].contains(&w[0])));
        let nested = boxes(&mesh("nested", 240));
        assert_eq!(nested.last().map(|b| b.extent().into_iter().fold(0.0, f32::max)), Some(2f32.powi(51)));
        assert!(boxes(&mesh("lost far from the origin", 50)).iter().all(|b| b.extent() == [0.0; 3]));
        assert!(boxes(&mesh("very far from the origin", 50)).iter().any(|b| b.extent() != [0.0; 3]));
        let scales = boxes(&mesh("mixed scales", 500));
        let least = scales.iter().map(|b| b.extent()[0]).fold(f32::INFINITY, f32::min);
        let most = scales.iter().map(|b| b.extent()[0]).fold(0.0, f32::max);
        assert!(least < 1e-5 && most > 1e5, "{least} {most}");
        let broken = mesh("not finite and out of range", 500);
        assert!(broken.positions.iter().any(|p| p[0].is_nan()) && broken.triangles.iter().any(|t| t[0] == u32::MAX));
    }
}
