//! Trees on trial, plainly: the same numbers and bytes as [`crate::trace::trial`] has on the device.

use crate::bvh::layout::{Bvh2, status};
use crate::bvh::sah::Collapse;
use crate::trace::counts::whole_costs;
use crate::trace::trial::TrialResult;
use crate::trace::twin::tracer;
use crate::trace::{Query, Ray};

/// Work of these rays in a tree.
pub fn work<'r>(tree: &Bvh2, rays: impl IntoIterator<Item = &'r Ray>, query: Query, costs: &Collapse) -> u64 {
    let [c_t, c_i] = whole_costs(costs).map(u64::from);
    let of_ray = |ray| {
        let work = tracer::trace(tree, ray, query).1;
        c_t * u64::from(work.steps) + c_i * u64::from(work.tests)
    };
    rays.into_iter().map(of_ray).sum()
}

/// Puts `copy` in the place of `tree` if the work of rays in it is less by more than 1%, and the other way round if not.
pub fn decide(tree: &mut Bvh2, copy: &mut Bvh2, work: [u64; 2]) -> TrialResult {
    let (a, b) = (&tree.header, &copy.header);
    let is_of_one = a.primitive_count == b.primitive_count
        && a.active == b.active
        && a.inner_nodes == b.inner_nodes
        && a.node_slots == b.node_slots;
    let [of_tree, of_copy] = work.map(u128::from);
    let is_taken = is_of_one && b.status & status::UNUSABLE == 0 && 100 * of_copy < 99 * of_tree;
    if is_of_one {
        let (from, to) = if is_taken { (&*copy, tree) } else { (&*tree, copy) };
        to.nodes.clone_from(&from.nodes);
        (to.header.status, to.header.child_order) = (from.header.status, from.header.child_order);
    }
    TrialResult { work, is_taken: is_taken.into(), reserved: 0 }
}
