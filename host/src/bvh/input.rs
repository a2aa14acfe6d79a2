//! What a tree is built over: the boxes of the primitives that are in it, and the scene around them.

use super::ALONE;
use super::bounds::{Bounds, Item};
use bytemuck::zeroed_vec;
use hedgerow::bvh::layout::{Child, Header, MAGIC, Record};
use hedgerow::bvh::sah::area_scale;
use hedgerow::geometry::Aabb;
use rayon::prelude::*;

/// Scales of scenes whose items are left as they are: their areas are far from the ends of the floats.
const MODEST: std::ops::RangeInclusive<f32> = 1.0 / (1u64 << 20) as f32..=(1u64 << 20) as f32;

/// The boxes of all primitives.
pub(crate) struct Input {
    /// Those that are in the tree, in the order of the input.
    pub items: Vec<Item>,
    /// The power of two that lengths of the items are scaled by, so that their areas are finite and not 0; 1 for most scenes.
    pub item_scale: f32,
    /// How many boxes were read, with those that were left out.
    pub count: usize,
    /// The box around them, as it is.
    pub bounds: Aabb,
    /// The power of two that lengths are scaled by where areas are kept: [`area_scale`].
    pub scale: f32,
    /// How many records the tree has: one an item, though the items may be taken away, or as many as there are references.
    active: u32,
    /// Whether those are references to primitives that were split.
    pub is_split: bool,
    /// Bits of [`hedgerow::bvh::layout::status`].
    pub status: u32,
    /// Bits of the codes that they were sorted by.
    pub code_bits: u32,
}

impl Input {
    /// Reads `count` boxes; those in whose place is a reason are left out.
    pub fn new(count: usize, bounds_of: impl Fn(u32) -> Result<Bounds, u32> + Sync) -> Input {
        // Pages of zeros come with the threads that write them.
        let mut items: Vec<Item> = zeroed_vec(count);
        let read = |(piece, items): (usize, &mut [Item])| {
            let (mut around, mut status) = (Bounds::EMPTY, 0);
            for (primitive, item) in ((piece * ALONE) as u32..).zip(items) {
                match bounds_of(primitive) {
                    Ok(bounds) => {
                        *item = Item::new(bounds, primitive, 1);
                        around = around.union(bounds);
                    }
                    Err(reason) => status |= reason,
                }
            }
            (around, status)
        };
        let both = |a: (Bounds, u32), b: (Bounds, u32)| (a.0.union(b.0), a.1 | b.1);
        let pieces = items.par_chunks_mut(ALONE).enumerate().map(read);
        let (around, status) = pieces.reduce(|| (Bounds::EMPTY, 0), both);
        if status != 0 {
            items.retain(|item| item.weight() > 0);
        }
        let bounds = Aabb { lo: around.lo.to_array(), hi: around.hi.to_array() };
        let scale = area_scale(&bounds);
        if !MODEST.contains(&scale) {
            items.par_iter_mut().with_min_len(ALONE).for_each(|item| *item = item.scaled(scale));
        }
        let item_scale = if MODEST.contains(&scale) { 1.0 } else { scale };
        Input {
            active: items.len() as u32,
            is_split: false,
            items,
            count,
            item_scale,
            bounds,
            scale,
            status,
            code_bits: 0,
        }
    }

    /// The tree is over `count` references; `is_split` says whether any is to a part of a primitive alone.
    pub fn refer(&mut self, count: usize, is_split: bool) {
        (self.active, self.is_split) = (count as u32, is_split);
    }

    /// The header of a tree that is not built yet.
    pub fn header<R: Record>(&self) -> Header {
        let active = self.active;
        Header {
            magic: MAGIC,
            kind: R::KIND,
            status: self.status,
            active,
            code_bits: self.code_bits,
            geometry_count: 1,
            split_from: if self.is_split { self.count as u32 } else { 0 },
            area_scale: if active == 0 { 0.0 } else { self.scale },
            root: Child { lo: Aabb::EMPTY.lo, index: 0, hi: Aabb::EMPTY.hi, count: 0 },
            ..bytemuck::Zeroable::zeroed()
        }
    }
}
