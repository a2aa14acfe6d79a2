//! Boxes as builders on the CPU work with them: two vectors of four lanes, in lengths that areas are finite in.

use bytemuck::Zeroable;
use glam::{Mat4, Vec3A, Vec3Swizzles, Vec4};
use hedgerow::geometry::Aabb;

/// Edges shorter than this count as none, the scene's longest being 1 to 4 (`hedgerow::bvh::sah`).
const SHORTEST: f32 = 1.0 / (1u64 << 50) as f32;
/// Set in the indices that lie in the fourth lanes of an [`Item`]: as a float they are normal, and arithmetic on all lanes is
/// not slowed down by them.
const NORMAL: u32 = 1 << 30;

/// A box.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Bounds {
    pub lo: Vec3A,
    pub hi: Vec3A,
}

impl Bounds {
    pub const EMPTY: Bounds = Bounds { lo: Vec3A::INFINITY, hi: Vec3A::NEG_INFINITY };

    pub fn of(bounds: &Aabb) -> Bounds {
        Bounds { lo: Vec3A::from_array(bounds.lo), hi: Vec3A::from_array(bounds.hi) }
    }

    pub fn aabb(&self) -> Aabb {
        Aabb { lo: self.lo.to_array(), hi: self.hi.to_array() }
    }

    /// With its lengths times `scale`, a power of two.
    pub fn scaled(self, scale: f32) -> Bounds {
        Bounds { lo: self.lo * scale, hi: self.hi * scale }
    }

    pub fn point(p: Vec3A) -> Bounds {
        Bounds { lo: p, hi: p }
    }

    /// Around a triangle.
    #[inline(always)]
    pub fn of_triangle([v0, v1, v2]: [Vec3A; 3]) -> Bounds {
        Bounds { lo: v0.min(v1).min(v2), hi: v0.max(v1).max(v2) }
    }

    #[inline(always)]
    pub fn union(self, other: Bounds) -> Bounds {
        Bounds { lo: self.lo.min(other.lo), hi: self.hi.max(other.hi) }
    }

    /// Half the surface area, as [`Aabb::scaled_half_area`] has it of the box before it was scaled.
    #[inline(always)]
    pub fn half_area(self) -> f32 {
        let edges = self.hi - self.lo;
        sum_of_faces(Vec3A::select(edges.cmpge(Vec3A::splat(SHORTEST)), edges, Vec3A::ZERO))
    }

    /// The half area of what may be a segment or a point, by which merges are compared: an edge is [`SHORTEST`] at least.
    #[inline(always)]
    pub fn distance_area(self) -> f32 {
        sum_of_faces((self.hi - self.lo).max(Vec3A::splat(SHORTEST)))
    }

    /// The axis of the longest edge, the first of equal ones; and its length.
    pub fn longest_edge(self) -> (usize, f32) {
        let [x, y, z] = (self.hi - self.lo).to_array();
        let (axis, edge) = if y > x { (1, y) } else { (0, x) };
        if z > edge { (2, z) } else { (axis, edge) }
    }
}

/// [`Bounds::half_area`] of four boxes at once, bit for bit.
#[inline(always)]
pub(crate) fn half_areas(boxes: [Bounds; 4]) -> Vec4 {
    let [a, b, c, d] = boxes.map(|bounds| (bounds.hi - bounds.lo).extend(0.0));
    let edges = Mat4::from_cols(a, b, c, d).transpose();
    let [x, y, z] = [edges.x_axis, edges.y_axis, edges.z_axis]
        .map(|edges| Vec4::select(edges.cmpge(Vec4::splat(SHORTEST)), edges, Vec4::ZERO));
    x * y + y * z + z * x
}

/// xy + yz + zx, in this order.
#[inline(always)]
fn sum_of_faces(edges: Vec3A) -> f32 {
    let [xy, yz, zx] = (edges * edges.yzx()).to_array();
    xy + yz + zx
}

/// What a tree is built over: a box, which primitive it is of, and for how many primitives it counts. 32 bytes.
#[derive(Debug, Clone, Copy, Zeroable)]
#[repr(C, align(16))]
pub(crate) struct Item {
    lo: [f32; 3],
    primitive: u32,
    hi: [f32; 3],
    weight: u32,
}

impl Item {
    /// Of no primitive: its weight is 0, as that of one whose bytes are all 0.
    pub const NONE: Item = Item { lo: [0.0; 3], primitive: NORMAL, hi: [0.0; 3], weight: NORMAL };

    /// What `index` names, of `weight` primitives.
    #[inline(always)]
    pub fn new(bounds: Bounds, index: u32, weight: u32) -> Item {
        let Bounds { lo, hi } = bounds;
        Item { lo: lo.to_array(), primitive: index | NORMAL, hi: hi.to_array(), weight: weight | NORMAL }
    }

    /// The same with its lengths times `scale`, a power of two.
    pub fn scaled(&self, scale: f32) -> Item {
        let [lo, hi] = [self.lo, self.hi].map(|corner| corner.map(|x| x * scale));
        Item { lo, hi, ..*self }
    }

    /// The primitive, or what else it was made of.
    #[inline(always)]
    pub fn primitive(&self) -> u32 {
        self.primitive & !NORMAL
    }

    /// How many primitives it counts for.
    #[inline(always)]
    pub fn weight(&self) -> u32 {
        self.weight & !NORMAL
    }

    #[inline(always)]
    pub fn bounds(&self) -> Bounds {
        let [lo, hi] = self.lanes();
        Bounds { lo: Vec3A::from_vec4(lo), hi: Vec3A::from_vec4(hi) }
    }

    /// Twice its centroid.
    #[inline(always)]
    pub fn centroid(&self) -> Vec3A {
        let Bounds { lo, hi } = self.bounds();
        lo + hi
    }

    /// Twice its centroid, along an axis.
    #[inline(always)]
    pub fn centroid_on(&self, axis: usize) -> f32 {
        self.lo[axis] + self.hi[axis]
    }

    #[inline(always)]
    fn lanes(&self) -> [Vec4; 2] {
        let Item { lo, primitive, hi, weight } = *self;
        [[lo[0], lo[1], lo[2], f32::from_bits(primitive)], [hi[0], hi[1], hi[2], f32::from_bits(weight)]]
            .map(Vec4::from_array)
    }
}

/// The box around them.
pub(crate) fn around(items: &[Item]) -> Bounds {
    items.iter().fold(Bounds::EMPTY, |bounds, item| bounds.union(item.bounds()))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Small boxes in a cube, some of which are equal.
    pub fn boxes(count: u32) -> Vec<Item> {
        let at = |i: u32, step: u32| (i.wrapping_mul(step) >> 8) as f32 / (1 << 24) as f32;
        let of = |i: u32| {
            let j = if i % 7 == 3 { i / 2 } else { i };
            let lo = Vec3A::new(at(j, 2_654_435_761), at(j, 805_459_861), at(j, 3_674_653_429));
            Item::new(Bounds { lo, hi: lo + 0.2 * at(j, 97_654_321) }, i, 1)
        };
        (0..count).map(of).collect()
    }

    #[test]
    fn an_area_is_that_of_the_scaled_box_bit_for_bit() {
        let scale = 1.0 / 1024.0;
        for hi in [[3.0, 5.5, 700.1], [0.0, 1e-20, 900.0], [1e-13, 2e-13, 1.0], [0.3, 0.0, 0.0]] {
            let bounds = Aabb { lo: [0.1, -0.0, 0.0].map(|x| x + 0.0), hi: hi.map(|x| x + 0.2) };
            let item = Item::new(Bounds::of(&bounds), 7, 1).scaled(scale);
            assert_eq!(item.bounds().half_area(), bounds.scaled_half_area(scale));
            assert_eq!((item.primitive(), item.weight()), (7, 1));
        }
    }

    #[test]
    fn four_areas_at_once_are_those_of_each_bit_for_bit() {
        let hi = [[3.0, 5.5, 700.1], [0.0, 1e-20, 900.0], [1e-13, 2e-13, 1.0], [0.3, 0.7, 0.1]];
        let boxes = hi.map(|hi| Bounds { lo: Vec3A::new(-0.1, 0.0, 0.3), hi: Vec3A::from_array(hi) + 0.7 });
        let boxes = [boxes[0], boxes[1], boxes[2], Bounds { lo: boxes[3].lo, hi: boxes[3].lo }];
        let each = boxes.map(|bounds| bounds.half_area().to_bits());
        assert_eq!(half_areas(boxes).to_array().map(f32::to_bits), each);
    }
}
