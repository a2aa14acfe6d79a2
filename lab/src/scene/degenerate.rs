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
    let mut list = List { count, scenes: Vec::new() };
    list.few();
    list.equal();
    list.flat_and_thin();
    list.scales();
    list.far();
    list.broken();
    list.scenes
}

struct List {
    count: u32,
    scenes: Vec<Degenerate>,
}

impl List {
    fn add(&mut self, name: &'static str, what: &'static str, triangles: Vec<Corners>) {
        let indices = (0..triangles.len() as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
        let mesh = Mesh { positions: triangles.into_iter().flatten().collect(), triangles: indices };
        self.scenes.push(Degenerate { name, what, mesh });
    }

    fn few(&mut self) {
        self.add("empty", "no triangle at all", vec![]);
        self.add("one", "one triangle: no inner node", vec![UNIT]);
        self.add("two", "two triangles: one inner node", vec![UNIT, moved(UNIT, [2.0; 3])]);
    }

    fn equal(&mut self) {
        let n = self.count;
        self.add("identical", "every triangle the same", vec![UNIT; n as usize]);
        self.add("twice", "every triangle two times", {
            let half = random(n / 2, [0.0; 3], [1.0; 3]);
            half.iter().chain(&half).copied().collect()
        });
        self.add("equal centroids", "around one point, each a little larger than the one before", {
            (1..=n).map(|i| around_the_origin(1.0 + i as f32)).collect()
        });
        self.add("points", "every corner at one point", vec![[[0.25; 3]; 3]; n as usize]);
        self.add("negative zeros", "zeros of both signs", {
            let corners = [[-0.0, 0.0, -0.0], [0.0, -0.0, 1.0], [-0.0, 1.0, 0.0]];
            vec![corners; n as usize]
        });
    }

    fn flat_and_thin(&mut self) {
        let n = self.count;
        self.add("in a plane", "flat in y", random(n, [0.0, 3.0, 0.0], [1.0, 0.0, 1.0]));
        self.add("on a line", "flat in x and y: no area", random(n, [0.0, 0.0, -5.0], [0.0, 0.0, 10.0]));
        self.add("along a line", "their middles on the diagonal, with area", {
            (0..n).map(|i| moved(around_the_origin(0.5), [i as f32; 3])).collect()
        });
        self.add("long street", "a thousand times as long as high", random(n, [0.0; 3], [1000.0, 1.0, 3.0]));
        let needles = generators::needles(n, 1);
        self.scenes.push(Degenerate { name: "needles", what: "a thousandth as wide as long", mesh: needles });
        self.add("zero area", "all three corners on a line, anywhere", {
            let middle = |[a, b, _]: Corners| [a, b, std::array::from_fn(|i| 0.5 * a[i] + 0.5 * b[i])];
            random(n, [0.0; 3], [1.0; 3]).into_iter().map(middle).collect()
        });
    }

    fn scales(&mut self) {
        let n = self.count;
        self.add("mixed scales", "places and sizes from 1e-6 to 1e6", {
            let mut random = SplitMix64::new(11);
            let mut power = || power_of_two(random.within(-20.0, 20.0));
            (0..n).map(|_| moved(around_the_origin(power()), [power(), power(), power()])).collect()
        });
        self.add("nested", "boxes one in another, each larger by the same factor, from 2^-50 to 2^50", {
            let boxes = n.div_ceil(12).max(2);
            let size = |i: u32| power_of_two(100.0 * i as f32 / (boxes - 1) as f32 - 50.0);
            (0..boxes).flat_map(|i| cube(size(i))).take(n as usize).collect()
        });
        self.add("geometric row", "in a row, each twice as far and large as the one before, over and over", {
            let size = |i: u32| 2f32.powi(i as i32 % 96 - 48);
            (0..n).map(|i| moved(around_the_origin(size(i)), [3.0 * size(i); 3])).collect()
        });
        self.add("tiny", "coordinates of 1e-30", random(n, [1e-30; 3], [1e-30; 3]));
        self.add("huge", "coordinates of 1e30", random(n, [-1e30; 3], [2e30; 3]));
        self.add("as large as floats are", "coordinates of 3e38", random(n, [-3.0e38; 3], [3.0e38; 3]));
    }

    fn far(&mut self) {
        let n = self.count;
        let near = || random(n, [0.0; 3], [1.0; 3]);
        self.add(
            "far from the origin",
            "of size 100 at 1e6: a sixteenth from float to float",
            random(n, [1e6; 3], [100.0; 3]),
        );
        self.add("very far from the origin", "of size 1e26 at 1e30: few floats apart", random(n, [1e30; 3], [1e26; 3]));
        self.add("lost far from the origin", "of size 1 at 1e30: all at one float", random(n, [1e30; 3], [1.0; 3]));
        self.add("one far away", "one triangle at 1e12", {
            near().into_iter().chain([[[1e12, 0.0, 0.0], [1e12, 1.0, 0.0], [1e12, 0.0, 1.0]]]).collect()
        });
        self.add("a hundred far away", "a hundred triangles from 1e3 to 1e33 in all directions", {
            let mut directions = SplitMix64::new(12);
            let far = |i: u32| {
                let distance = 2f32.powi(10 + i as i32);
                moved(UNIT, directions.point(-1.0, 1.0).map(|x| x * distance))
            };
            near().into_iter().chain((0..100).map(far)).collect()
        });
        self.add("one huge", "one triangle a million times as large as the scene", {
            near().into_iter().chain([[[-1e6, -1e6, 0.0], [1e6, -1e6, 0.0], [0.0, 1e6, 0.5]]]).collect()
        });
    }

    fn broken(&mut self) {
        let n = self.count as usize;
        self.add("not finite and out of range", "NaN, infinite and missing vertices among sound ones", {
            random(self.count, [0.0; 3], [1.0; 3])
        });
        let mesh = &mut self.scenes.last_mut().expect("just added").mesh;
        for (i, corner) in mesh.positions.iter_mut().enumerate() {
            match i % 97 {
                10 => *corner = [f32::NAN, 0.0, 0.0],
                41 => *corner = [0.0, f32::INFINITY, 0.0],
                70 => *corner = [0.5, 0.5, f32::NEG_INFINITY],
                _ => {}
            }
        }
        let vertices = mesh.positions.len() as u32;
        mesh.triangles.iter_mut().step_by(53).for_each(|triangle| triangle[2] = vertices);
        mesh.triangles.iter_mut().skip(1).step_by(89).for_each(|triangle| triangle[0] = u32::MAX);
        self.add("nothing finite", "every corner NaN", vec![[[f32::NAN; 3]; 3]; n]);
    }
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
        // Whoever asks for nothing gets nothing that breaks.
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
