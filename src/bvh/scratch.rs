//! The scratch memory of a build: what lies in it, and from which phase to which.

use super::child_order::ChildOrder;
use super::encode::{Encode, PAIR_BLOCK};
use super::method::Hierarchy;
use super::split::SplitReference;
use crate::gpu::arguments::{self, BUILD_STATE_BYTES, BuildParts};
use crate::gpu::plan::Plan;

/// The phases of a build, as far as memory is used in one and free in the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum BuildPhase {
    /// Triangles become references.
    Split,
    /// Bounds and codes.
    Encode,
    Sort,
    /// The nodes; of HLBVH those of treelets.
    Hierarchy,
    /// Of HLBVH: the clusters of treelets.
    Gather,
    /// Of HLBVH: the nodes over them.
    Top,
    /// Of HLBVH: their weights.
    Above,
    Optimise,
    Weigh,
    /// Where records go.
    Place,
    Records,
}

/// Bytes of a cluster: `Cluster` in clusters.glsl.
pub(super) const CLUSTER_BYTES: u64 = 40;
/// Bytes of a task: `Task` in hlbvh.glsl.
const TASK_BYTES: u64 = 12;
/// Bytes of the weights of a primitive: `Weights` in weights.glsl.
const WEIGHTS_BYTES: u64 = 16;
/// Bytes of what a child is ordered by: `ChildWeight` in run.glsl.
const CHILD_WEIGHT_BYTES: u64 = 12;

/// The plan of a build's scratch memory.
#[derive(Debug, Clone)]
pub(super) struct Scratch {
    plan: Plan<BuildPhase>,
    /// What kernels are given.
    pub parts: BuildParts,
    /// Where the splitting counts: for each triangle, and for tiles of them.
    pub split_counts: u32,
    pub split_sums: u32,
    /// Where reinsertion has its own.
    pub reinsertion: u32,
    count: u64,
    key_bytes: u64,
    table_bytes: u64,
    /// Which of the sort's two buffers has its results.
    sorted: usize,
}

impl Scratch {
    /// For a build by `method`, with the bytes that reinsertion needs, if any, and the words of the sort's table.
    pub fn of(encode: &Encode, method: &dyn Hierarchy, reinsertion: Option<u64>, table_words: u64) -> Scratch {
        let count = u64::from(encode.count);
        let mut scratch = Scratch {
            plan: Plan::new(),
            parts: bytemuck::Zeroable::zeroed(),
            split_counts: 0,
            split_sums: 0,
            reinsertion: 0,
            count,
            key_bytes: 4 * u64::from(encode.key_words()) * count,
            table_bytes: 4 * table_words,
            sorted: encode.passes() as usize % 2,
        };
        scratch.plan.take("state", BUILD_STATE_BYTES, BuildPhase::Encode..=BuildPhase::Records);
        scratch.take_split(encode);
        scratch.parts.values[scratch.sorted] =
            scratch.plan.take("sorted values", 4 * count, BuildPhase::Encode..=BuildPhase::Records);
        if encode.pairs {
            scratch.take_pairs(encode.shape.workgroup);
        }
        method.plan(encode, &mut scratch);
        if let Some(bytes) = reinsertion {
            scratch.reinsertion = scratch.plan.take("reinsertion", bytes, BuildPhase::Optimise..=BuildPhase::Optimise);
            if !method.writes_weights() {
                scratch.take_weights(BuildPhase::Weigh);
            }
            scratch.parts.costs = scratch.take_words("costs", BuildPhase::Weigh, BuildPhase::Weigh);
            scratch.parts.arrivals = scratch.take_words("arrivals", BuildPhase::Weigh, BuildPhase::Weigh);
        }
        if reinsertion.is_some() || method.writes_weights() {
            scratch.parts.large_firsts =
                scratch.take_words("first records of large nodes", BuildPhase::Place, BuildPhase::Place);
            scratch.parts.large_depths =
                scratch.take_words("depths of large nodes", BuildPhase::Place, BuildPhase::Place);
            scratch.parts.walk = scratch.take_words("order of the walk", BuildPhase::Place, BuildPhase::Records);
        }
        scratch
    }

    pub fn bytes(&self) -> u64 {
        self.plan.bytes()
    }

    /// A word for each primitive.
    pub fn take_words(&mut self, name: &'static str, from: BuildPhase, to: BuildPhase) -> u32 {
        self.plan.take(name, 4 * self.count, from..=to)
    }

    fn take_split(&mut self, encode: &Encode) {
        let Some(split) = encode.split else { return };
        let plan = &mut self.plan;
        let references = size_of::<SplitReference>() as u64 * self.count;
        self.parts.references = plan.take("references", references, BuildPhase::Split..=BuildPhase::Records);
        self.parts.split = plan.take("splitting", arguments::SPLIT_STATE_BYTES, BuildPhase::Split..=BuildPhase::Encode);
        self.split_counts = plan.take("splits", 4 * u64::from(split.primitives), BuildPhase::Split..=BuildPhase::Split);
        self.split_sums = plan.take("splits of tiles", split.sums_bytes(), BuildPhase::Split..=BuildPhase::Split);
    }

    /// Which triangles are pairs, and how many of each tile; methods may have their own sums there later.
    fn take_pairs(&mut self, workgroup: u32) {
        let blocks = 4 * self.count.div_ceil(u64::from(PAIR_BLOCK));
        self.parts.pairs = self.plan.take("pairs", blocks, BuildPhase::Encode..=BuildPhase::Records);
        self.take_sums(workgroup, BuildPhase::Encode, BuildPhase::Hierarchy);
    }

    /// What the tree is finished by, from the phase on that writes it.
    pub fn take_weights(&mut self, from: BuildPhase) {
        self.parts.weights = self.plan.take("weights", WEIGHTS_BYTES * self.count, from..=BuildPhase::Records);
    }

    /// The codes in order, in use up to a phase.
    pub fn take_codes(&mut self, to: BuildPhase) {
        self.parts.keys[self.sorted] = self.plan.take("sorted keys", self.key_bytes, BuildPhase::Encode..=to);
    }

    /// Where climbs of the radix tree meet, in use up to a phase. Encoding writes it.
    pub fn take_ends(&mut self, to: BuildPhase) {
        self.parts.ends = self.take_words("ends", BuildPhase::Encode, to);
    }

    /// What the sort alone uses.
    pub fn take_sort(&mut self) {
        let life = || BuildPhase::Encode..=BuildPhase::Sort;
        self.parts.keys[1 - self.sorted] = self.plan.take("other keys", self.key_bytes, life());
        self.parts.values[1 - self.sorted] = self.plan.take("other values", 4 * self.count, life());
        self.parts.table = self.plan.take("table", self.table_bytes, life());
    }

    /// Costs of left and right children in climbs of the radix tree, and what they are ordered by.
    pub fn take_child_costs(&mut self, order: Option<ChildOrder>) {
        let weight_bytes = if order.is_some_and(ChildOrder::has_weights) { CHILD_WEIGHT_BYTES } else { 0 };
        let bytes = (4 + weight_bytes) * self.count;
        let life = || BuildPhase::Hierarchy..=BuildPhase::Hierarchy;
        self.parts.child_costs =
            ["costs of left children", "costs of right children"].map(|name| self.plan.take(name, bytes, life()));
    }

    pub fn take_clusters(&mut self, from: BuildPhase, to: BuildPhase) {
        self.parts.clusters = self.plan.take("clusters", CLUSTER_BYTES * self.count, from..=to);
    }

    /// The tasks of two levels of the top; a task has two treelets at least.
    pub fn take_tasks(&mut self) {
        self.parts.tasks = self.plan.take("tasks", TASK_BYTES * self.count, BuildPhase::Top..=BuildPhase::Top);
    }

    /// A sum for each tile, of which the smallest has `workgroup` items; where they are there, those.
    pub fn take_sums(&mut self, workgroup: u32, from: BuildPhase, to: BuildPhase) {
        if self.parts.sums != 0 {
            return;
        }
        self.parts.sums = self.plan.take("sums of tiles", 4 * self.count.div_ceil(workgroup.into()), from..=to);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::builder::{Method, Primitives, Treelets, Window};
    use crate::bvh::codes::Code;
    use crate::bvh::hploc::Merging;
    use crate::bvh::sah::Collapse;
    use crate::gpu::radix_sort::SortShape;

    fn encode(count: u32, bits: u32, workgroup: u32) -> Encode {
        Encode {
            codes: Code::Emc64Var.full().with_bits(bits),
            bits_up_to: None,
            collapse: Collapse::SAH,
            child_order: None,
            shape: SortShape::strips_of(workgroup),
            items: 4,
            bounds_items: 4,
            meets_in_group: false,
            sharers: 64,
            shared_left: 0,
            count,
            split: None,
            primitives: Primitives::Triangles,
            geometry_count: 1,
            build_flags: 0,
            alone: false,
            pairs: false,
            numbered: false,
            clusters_in_records: false,
        }
    }

    /// With whether triangles are paired.
    const METHODS: [(Method, bool); 6] = [
        (Method::Lbvh, false),
        (Method::Hlbvh(Treelets::DEFAULT), false),
        (Method::Ploc { radius: 16 }, false),
        (Method::Ploc { radius: 16 }, true),
        (Method::Hploc(Window::DEFAULT), false),
        (Method::Hploc(Window::DEFAULT), true),
    ];

    /// As the tables of a sort grow in steps, and the parts of methods do not.
    #[test]
    fn parts_in_use_share_nothing_and_nothing_is_wasted_where_scenes_are_large() {
        for (count, bits) in [(0, 32), (1, 32), (2, 64), (1000, 32), (1 << 20, 32), (1 << 20, 64), (1 << 27, 64)] {
            for (method, pairs) in METHODS {
                for reinsertion in [None, Some(15 * u64::from(count))] {
                    let encode = Encode { pairs, ..encode(count, bits, 8) };
                    let merging = Merging::by_one();
                    let scratch = Scratch::of(&encode, &*method.hierarchy(&merging), reinsertion, encode.table_words());
                    scratch.plan.assert_nothing_in_use_is_shared();
                    let (bytes, least) = (scratch.bytes(), scratch.plan.most_in_use());
                    assert!(count < 1 << 20 || bytes <= least + least / 16, "{method:?} of {count}: {bytes}, {least}");
                }
            }
        }
    }

    /// What accel's sizes for the most primitives promise to builds of fewer.
    #[test]
    fn fewer_primitives_never_need_more() {
        for (method, pairs) in METHODS {
            for reinsertion in [0, 15] {
                let bytes = |count: u32| {
                    let encode = Encode { pairs, ..encode(count, 32, 8) };
                    let merging = Merging::by_one();
                    let reinsertion = (reinsertion > 0).then_some(reinsertion * u64::from(count));
                    let most = encode.shape.most_table_words(count).max(encode.table_words());
                    Scratch::of(&encode, &*method.hierarchy(&merging), reinsertion, most).bytes()
                };
                let sizes: Vec<u64> = (0..2000).chain((2000..300_000).step_by(997)).map(bytes).collect();
                assert!(sizes.is_sorted(), "{method:?}");
            }
        }
    }
}
