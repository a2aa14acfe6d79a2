//! The order of children for rays that end at their first hit, plainly: see [`crate::bvh::child_order`] for the rules. The same bytes as
//! the device's.

use crate::bvh::child_order::{ChildOrder, PRIOR_RAYS};
use crate::bvh::counts::LinkCount;
use crate::bvh::layout::{BoxRecord, Bvh2, Child, Record, status};
use crate::bvh::sah::Collapse;

/// Squared lengths below this are those of nothing: some devices take what they are made of for zero.
const LEAST_SQUARE: f32 = 1.0 / (1u128 << 100) as f32;

impl<R: Record> Bvh2<R> {
    /// The same tree with the children of each node in order, the one to look into first on the left. A tree that cannot be traced stays as
    /// it is.
    pub fn in_child_order(self, order: ChildOrder, costs: &Collapse) -> Bvh2<R> {
        self.ordered(order, costs, &mut [])
    }

    /// The same with an order that rays have taught, by counts of its links; they are swapped with the children. The twin of
    /// [`ChildOrderPass::record_by_counts`](crate::bvh::child_order::ChildOrderPass::record_by_counts).
    ///
    /// # Panics
    /// There are fewer than two counts a node slot.
    pub fn in_order_of_counts(self, counts: &mut [LinkCount], costs: &Collapse) -> Bvh2<R> {
        assert!(counts.len() >= 2 * self.nodes.len(), "two counts a node slot");
        self.ordered(ChildOrder::MoreHitsForItsCost, costs, counts)
    }

    fn ordered(mut self, order: ChildOrder, costs: &Collapse, counts: &mut [LinkCount]) -> Bvh2<R> {
        let usable = self.header.active != 0 && self.header.status & status::UNUSABLE == 0;
        let root = self.header.root;
        if usable && !root.is_leaf() {
            self.header.child_order = 1;
            let ordering = Ordering { order, costs: *costs, scale: self.header.area_scale };
            ordering.subtree(&mut self, counts, root.index);
            return self.with_nothing_far();
        }
        self
    }
}

/// What a ray gains in a subtree, and what that costs.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Weight {
    gain: f32,
    cost: f32,
}

/// A rule, the costs of a step and of a test, and what lengths are scaled by before areas are taken.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ordering {
    pub order: ChildOrder,
    pub costs: Collapse,
    pub scale: f32,
}

impl Ordering {
    /// Puts a node and all below it in order. No deeper than tracers walk.
    fn subtree<R: Record>(&self, tree: &mut Bvh2<R>, counts: &mut [LinkCount], slot: u32) -> Weight {
        let children = tree.nodes[slot as usize].children;
        let weights = children.map(|child| {
            if child.is_leaf() { self.weight_of(tree, &child) } else { self.subtree(tree, counts, child.index) }
        });
        let links = [2 * slot as usize, 2 * slot as usize + 1];
        let compared = [0, 1].map(|side| learned(counts.get(links[side]), weights[side]));
        let (swaps, weight) = self.node(&mut tree.nodes[slot as usize].children, weights, compared);
        if swaps && !counts.is_empty() {
            counts.swap(links[0], links[1]);
        }
        weight
    }

    /// Puts the children of a node in order by what they are compared by; whether they were swapped, and its weight.
    pub fn node(&self, children: &mut [Child; 2], weights: [Weight; 2], compared: [Weight; 2]) -> (bool, Weight) {
        let area = children[0].bounds().union(&children[1].bounds()).scaled_half_area(self.scale);
        let areas = children.map(|child| child.bounds().scaled_half_area(self.scale));
        let shares = areas.map(|of_child| share(of_child, area, 1.0));
        let both = (shares[0] + shares[1] - 1.0).max(0.0);
        let ([left, right], [p_left, p_right]) = (weights, shares);
        let swaps = match self.order {
            ChildOrder::LargerBox => areas[1] > areas[0],
            _ => self.is_right_first(compared, shares, both),
        };
        if !swaps {
            return (false, self.joined(weights, shares, both));
        }
        children.swap(0, 1);
        (true, self.joined([right, left], [p_right, p_left], both))
    }

    fn weight_of<R: Record>(&self, tree: &Bvh2<R>, leaf: &Child) -> Weight {
        let leaf_area = leaf.bounds().scaled_half_area(self.scale);
        let records = &tree.records[leaf.index as usize..][..leaf.count as usize];
        let area = records.iter().fold(0.0, |area, record| area + self.area_of(record, leaf_area));
        self.leaf(area, leaf_area, leaf.count)
    }

    /// The weight of a leaf by the area of its primitives, the half area of its box, and their number.
    pub fn leaf(&self, area_of_primitives: f32, leaf_area: f32, count: u32) -> Weight {
        let count = count as f32;
        let cost = self.costs.c_i * count;
        let hits = share(area_of_primitives, leaf_area, 0.0);
        match self.order {
            ChildOrder::LargerPrimitives => Weight { gain: area_of_primitives, cost: count },
            ChildOrder::MoreHitsForItsCost => Weight { gain: hits, cost: cost * (1.0 - 0.5 * hits) },
            _ => Weight { gain: 1.0, cost },
        }
    }

    /// The area by which a ray meets a record: a convex body is met by its half area, as a triangle by its whole. What an instance
    /// holds fills its leaf. Of a triangle that was split it is not more than the leaf has room for.
    pub fn area_of<R: Record>(&self, record: &R, leaf_area: f32) -> f32 {
        let area = match record.corners() {
            Some(corners) => self.area_of_triangle(corners),
            None if R::KIND == BoxRecord::KIND => {
                record.bounds().map_or(leaf_area, |bounds| bounds.scaled_half_area(self.scale))
            }
            None => leaf_area,
        };
        area.min(leaf_area)
    }

    fn area_of_triangle(&self, corners: [[f32; 3]; 3]) -> f32 {
        let [v0, v1, v2] = corners.map(|v| v.map(|x| x * self.scale));
        let [a, b]: [[f32; 3]; 2] = [v1, v2].map(|v| std::array::from_fn(|i| v[i] - v0[i]));
        let n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let square = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
        if square >= LEAST_SQUARE { 0.5 * square_root(square) } else { 0.0 }
    }

    /// Whether the right child comes first. `shares` are of the rays in the node those that meet each child, `both` those that meet both.
    fn is_right_first(&self, [left, right]: [Weight; 2], shares: [f32; 2], both: f32) -> bool {
        match self.order {
            ChildOrder::Cheaper => both * (left.cost - right.cost) + self.costs.c_t * (shares[1] - shares[0]) > 0.0,
            _ => right.gain * left.cost > left.gain * right.cost,
        }
    }

    /// Of a node whose children come in this order.
    fn joined(&self, [first, second]: [Weight; 2], [p_first, p_second]: [f32; 2], both: f32) -> Weight {
        let hits = p_first * first.gain + p_second * second.gain - both * (first.gain * second.gain);
        let goes_on = p_second - both * first.gain;
        let cost = self.costs.c_t + (p_first * first.cost + goes_on * second.cost);
        match self.order {
            ChildOrder::Cheaper => Weight { gain: 1.0, cost },
            ChildOrder::MoreHitsForItsCost => Weight { gain: hits, cost },
            _ => Weight { gain: first.gain + second.gain, cost: first.cost + second.cost },
        }
    }
}

/// By rays that went into a child, and by as much as a few do of what is known without them.
fn learned(of_rays: Option<&LinkCount>, without_rays: Weight) -> Weight {
    let Some(of_rays) = of_rays else { return without_rays };
    Weight {
        gain: of_rays.hits as f32 + PRIOR_RAYS * without_rays.gain,
        cost: of_rays.work as f32 + PRIOR_RAYS * without_rays.cost,
    }
}

/// Of rays that meet what has the area `whole`, the part that meets what has the area `part` in it; `otherwise` where there is no area.
fn share(part: f32, whole: f32, otherwise: f32) -> f32 {
    if whole > 0.0 { (part * reciprocal(whole)).min(1.0) } else { otherwise }
}

/// Of a normal number above 0, to the last few bits: the same bits on every device, which a division is not.
fn reciprocal(x: f32) -> f32 {
    let guess = f32::from_bits(0x7EF3_11C3 - x.to_bits());
    (0..3).fold(guess, |y, _| y * (2.0 - x * y))
}

/// The same of the square root.
fn square_root(x: f32) -> f32 {
    let (half, guess) = (0.5 * x, f32::from_bits(0x5F37_5A86 - (x.to_bits() >> 1)));
    x * (0..3).fold(guess, |y, _| y * (1.5 - half * y * y))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reciprocals_and_roots_are_right_to_a_few_units() {
        for i in 0..2000 {
            let x = f32::from_bits(((27 + i / 16) << 23) | (i * 0x0007_1A35) & 0x007F_FFFF);
            let wrong = [reciprocal(x) * x - 1.0, square_root(x) / x.sqrt() - 1.0];
            assert!(wrong.iter().all(|wrong| wrong.abs() < 4.0 * f32::EPSILON), "{x:e}: {wrong:?}");
        }
    }
}
