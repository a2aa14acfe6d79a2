//! Cables that hang across the scene: long, thin, and along the diagonals, so that boxes are huge, empty, and all overlap.

use super::tube::{self, Knot};
use super::{Assembly, series, turns};
use crate::random::SplitMix64;
use crate::scene::Mesh;
use glam::Vec3;

const SEGMENTS: u32 = 60;
const SIDES: u32 = 5;
const RADIUS: f32 = 0.0015;

/// A catenary of span 1.
struct Catenary {
    /// Its parameter, tension over weight: y = tension · cosh((x − lowest) / tension).
    tension: f64,
    /// Where along the span it hangs lowest.
    lowest: f64,
}

/// Sagging, tight, and with one end higher than the other.
const CATENARIES: [Catenary; 4] = [
    Catenary { tension: 0.5, lowest: 0.5 },
    Catenary { tension: 0.9, lowest: 0.5 },
    Catenary { tension: 1.0, lowest: 0.35 },
    Catenary { tension: 0.6, lowest: 0.4 },
];

/// `count` cables of 600 triangles about the unit cube's middle, each near one of the two diagonals of its floor.
pub fn place(count: u32) -> Assembly {
    let parts: Vec<Mesh> = CATENARIES.iter().map(cable).collect();
    let mut random = SplitMix64::new(0);
    let instances = (0..count).map(|_| {
        let part = random.bits() as usize % parts.len();
        // Either end first, along either diagonal, up to 7 degrees off it.
        let [x, z] = [(); 2].map(|()| if random.bits() >> 63 == 0 { 1.0 } else { -1.0 });
        let turn = turns::towards([x * random.within(0.8, 1.25), z]);
        let at = [random.within(0.25, 0.75), random.within(0.25, 0.75), random.within(0.25, 0.75)];
        turns::upright(part, [random.within(0.9, 1.3); 3], turn, at)
    });
    let instances = instances.collect();
    (parts, instances)
}

/// Along x from −0.5 to 0.5, its first end at height 0.
fn cable(catenary: &Catenary) -> Mesh {
    let &Catenary { tension, lowest } = catenary;
    let height = |x: f64| tension * series::cosh((x - lowest) / tension);
    let path: Vec<Knot> = (0..=SEGMENTS)
        .map(|i| {
            let x = f64::from(i) / f64::from(SEGMENTS);
            Knot { at: Vec3::new((x - 0.5) as f32, (height(x) - height(0.0)) as f32, 0.0), radius: RADIUS }
        })
        .collect();
    let mut mesh = Mesh::default();
    tube::append(&mut mesh, SIDES, &path);
    mesh
}
