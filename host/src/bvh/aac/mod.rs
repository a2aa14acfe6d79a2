//! Approximate agglomerative clustering: along the radix tree of the codes, each node merges the clusters that its children left,
//! nearest ones first, until few enough are left for its parent.
//!
//! Gu, He, Fatahalian, Blelloch 2013, "Efficient BVH Construction via Approximate Agglomerative Clustering"; Frantál 2019, section
//! 3.2. What they leave open is settled so that the tree does not depend on who builds it:
//!
//! - The radix tree is that of the LBVH: a node splits where the highest bit changes, equal codes by their places.
//! - The distance of two clusters is the half area of the box around both ([`Bounds::distance_area`]). Of pairs at the same
//!   distance the one with the fewest primitives merges first, then the one with the least representatives. So what is equal
//!   merges into a balanced tree, not a chain.
//! - How many clusters are left is computed in integers (`left_over.rs`), rounded down.
//!
//! Distances within a child stay known in its parent (`clusters.rs`). The thesis keeps them in one stack of matrices, which it says
//! excludes threads. Here the stack is that of a thread, and what another thread has made of the right child is put on it.
//!
//! [`Bounds::distance_area`]: super::bounds::Bounds::distance_area

mod clusters;
mod left_over;

use super::bounds::Item;
use super::order::left_count;
use super::topology::{Merge, Topology};
use super::{ALONE, DIVIDED_ABOVE};
use clusters::ClusterStack;
use hedgerow::{Error, Result};
use left_over::LeftOver;

/// The parameters of approximate agglomerative clustering.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AacOptions {
    /// Fewer primitives than this are clustered without regard to the radix tree: 2 to [`AacOptions::MAX_DELTA`].
    pub delta: u32,
    /// Tenths of ε, at most [`AacOptions::MAX_EPSILON`]: x primitives leave about x^(1/2 − ε) clusters.
    pub epsilon: u32,
}

impl AacOptions {
    /// AAC-HQ: δ = 20, ε = 0.1.
    pub const HIGH_QUALITY: AacOptions = AacOptions { delta: 20, epsilon: 1 };
    /// AAC-Fast: δ = 4, ε = 0.2.
    pub const FAST: AacOptions = AacOptions { delta: 4, epsilon: 2 };
    /// The largest δ.
    pub const MAX_DELTA: u32 = 1000;
    /// The largest ε, in tenths: what is left does not grow with what there is.
    pub const MAX_EPSILON: u32 = 5;

    pub(super) fn check(&self) -> Result<()> {
        let AacOptions { delta, epsilon } = *self;
        if !(2..=AacOptions::MAX_DELTA).contains(&delta) {
            let most = AacOptions::MAX_DELTA;
            return Err(Error::Argument(format!("a delta of {delta} cannot be used; take 2 to {most} primitives")));
        }
        if epsilon > AacOptions::MAX_EPSILON {
            let most = AacOptions::MAX_EPSILON;
            return Err(Error::Argument(format!("an epsilon of {epsilon} tenths cannot be used; take 0 to {most}")));
        }
        Ok(())
    }
}

/// The tree over the primitives of `items`, which are in the order of `codes`.
pub(super) fn build(items: &[Item], codes: &[u64], options: &AacOptions) -> Topology {
    let mut merges = Merge::none(items.len());
    if !items.is_empty() {
        let aac = Aac { items, codes, delta: options.delta as usize, left_over: LeftOver::new(options, items.len()) };
        let mut stack = ClusterStack::default();
        let count = aac.cluster(0, &mut merges, &mut stack, 0);
        stack.merge_down(count, 1, &mut merges, 0);
    }
    Topology::of_representatives(&merges, |place| items[place as usize].primitive())
}

struct Aac<'a> {
    items: &'a [Item],
    codes: &'a [u64],
    delta: usize,
    left_over: LeftOver,
}

impl Aac<'_> {
    /// Puts the clusters of the primitives from `first` on, of which there are as many as `merges`, onto the stack. How many there
    /// are.
    fn cluster(&self, first: usize, merges: &mut [Merge], stack: &mut ClusterStack, depth: u32) -> usize {
        let count = merges.len();
        if count < self.delta {
            stack.push_primitives(&self.items[first..first + count], first as u32);
            return stack.merge_down(count, self.left_over.of(self.delta), merges, first as u32);
        }
        let on_left = left_count(self.codes, first, count);
        let (left, right) = merges.split_at_mut(on_left);
        let counts = if count < ALONE || depth >= DIVIDED_ABOVE {
            let left_count = self.cluster(first, left, stack, depth + 1);
            [left_count, self.cluster(first + on_left, right, stack, depth + 1)]
        } else {
            let other = || {
                let mut stack = ClusterStack::default();
                let count = self.cluster(first + on_left, right, &mut stack, depth + 1);
                (stack, count)
            };
            let (left_count, (of_right, right_count)) =
                rayon::join(|| self.cluster(first, left, stack, depth + 1), other);
            stack.push_stack(&of_right);
            [left_count, right_count]
        };
        let together = stack.unite(counts);
        stack.merge_down(together, self.left_over.of(count), merges, first as u32)
    }
}
