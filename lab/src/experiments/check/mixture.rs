//! Worlds for re-braiding, and their structures read back: instances of all kinds of parts by all kinds of transforms.
#![allow(missing_docs, reason = "names and types say it all: groups and tests are the only readers")]

use super::backend::{Backend, Built, Ours};
use super::shapes::{Corners, boxes_by, icosphere, soup};
use super::world::{BuiltWorld, Part, World};
use crate::random::SplitMix64;
use ash::vk;
use hedgerow::accel::{Instance, REBRAID, Tree, twin};
use hedgerow::bvh::layout::{BoxRecord, InstanceRecord, Triangle};
use std::collections::BTreeMap;
use vk::GeometryFlagsKHR as GeometryFlags;

/// A part of triangles that are not opaque.
pub fn part(corners: Corners) -> Part {
    Part::Triangles(vec![(corners, GeometryFlags::empty())])
}

/// A row of `count` small triangles along the diagonal of the cube −1..1: nearly nothing in a large box.
pub fn diagonal(count: usize) -> Corners {
    let at = |i: usize| 2.0 * (i as f32 + 0.5) / count as f32 - 1.0;
    let moved = |(i, t): (usize, &[[f32; 3]; 3])| t.map(|corner| std::array::from_fn(|k| corner[k] - t[0][k] + at(i)));
    soup(count, 0.2 / count as f32, 5).iter().enumerate().map(moved).collect()
}

/// Scaled, with no turn, and moved.
pub fn scaled(scale: f32, [x, y, z]: [f32; 3]) -> [[f32; 4]; 3] {
    [[scale, 0.0, 0.0, x], [0.0, scale, 0.0, y], [0.0, 0.0, scale, z]]
}

/// Instances of all kinds of parts, by all kinds of transforms: turned, sheared, mirrored, flat ones and none.
pub fn mixture(count: usize, seed: u64) -> World {
    let mut random = SplitMix64::new(seed);
    let boxes = boxes_by(&mut random, 40, 0.1);
    let parts = vec![
        part(diagonal(200)),
        part(soup(100, 0.3, seed)),
        part(icosphere(2)),
        Part::Boxes(vec![(boxes, GeometryFlags::empty())]),
        part(soup(1, 0.5, seed)),
        part(Corners::new()),
        part(vec![[[f32::NAN; 3]; 3]; 4]),
        part(soup(2, 0.5, seed)),
    ];
    let instances = (0..count)
        .map(|i| {
            // Most are of the first parts; some name none.
            let number = if i % 3 == 0 { random.bits() % (parts.len() as u64 + 1) } else { 1 + random.bits() % 4 };
            let mut m: [[f32; 4]; 3] =
                [(); 3].map(|()| [random.signed(), random.signed(), random.signed(), 9.0 * random.signed()]);
            match i % 11 {
                0 => m = scaled(random.signed(), random.around(5.0)),
                // Of no thickness, and of no size at all.
                5 => m[1] = [0.0, 0.0, 0.0, 1.0],
                6 if i % 5 == 0 => m = [[0.0; 4]; 3],
                7 if i % 5 == 0 => m[2][3] = f32::INFINITY,
                8 => m = m.map(|row| row.map(|x| 1e-3 * x)),
                _ => {}
            }
            Instance::new(number, m).with_index_and_mask(i as u32, random.bits() as u8)
        })
        .collect();
    World { flags: REBRAID, ..World::new(parts, instances) }
}

/// The structures of a world, read back, and the instances as they were given.
pub struct ReadBack {
    /// The top level.
    pub top: Tree<InstanceRecord>,
    /// The instances, with the addresses of their structures.
    pub instances: Vec<Instance>,
    /// Structures of triangles by their addresses.
    pub triangles: BTreeMap<u64, Tree<Triangle>>,
    /// Structures of boxes by theirs.
    pub boxes: BTreeMap<u64, Tree<BoxRecord>>,
}

impl ReadBack {
    /// Builds a world and reads it.
    ///
    /// # Panics
    /// What is read is not a structure.
    pub fn new(backend: &Ours, world: &World) -> ReadBack {
        let BuiltWorld { top, parts, .. } = &world.build(backend);
        let bytes = |built: &Built| built.memory.read::<u8>(built.bytes as usize);
        let (mut triangles, mut boxes) = (BTreeMap::new(), BTreeMap::new());
        for (part, built) in world.parts.iter().zip(parts) {
            let (address, bytes) = (backend.address(built.structure), bytes(built));
            match part {
                Part::Triangles(_) => {
                    drop(triangles.insert(address, Tree::from_bytes(&bytes).expect("a structure of triangles")));
                }
                Part::Boxes(_) => drop(boxes.insert(address, Tree::from_bytes(&bytes).expect("a structure of boxes"))),
            }
        }
        let top = Tree::from_bytes(&bytes(top)).expect("a top level");
        ReadBack { top, instances: world.placed(backend, parts), triangles, boxes }
    }

    /// What an instance points to.
    pub fn below(&self, address: u64) -> Option<twin::Below<'_>> {
        let triangles = self.triangles.get(&address).map(twin::Below::from);
        triangles.or_else(|| self.boxes.get(&address).map(twin::Below::from))
    }
}
