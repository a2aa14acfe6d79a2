//! A builder's tree by its options, from the LBVH's: what [`Builder`](crate::bvh::builder::Builder) records one after the other.

use super::lbvh::Finish;
use super::pairs::Paired;
use super::{hlbvh, hploc, ploc};
use crate::bvh::builder::{BuildOptions, Method};
use crate::bvh::codes::Codes;
use crate::bvh::layout::{Bvh2, Record};
use crate::bvh::reinsertion::Areas;
use crate::bvh::sah::Collapse;
use crate::geometry::Aabb;

/// The tree that a builder with these options makes by `codes`, where `lbvh` gives LBVHs over its primitives, their parts, or
/// pairs of them. The codes
/// of the options are not looked at.
pub fn build<R: Record, L: Into<Paired<R>>>(
    options: &BuildOptions,
    codes: Codes,
    lbvh: impl FnOnce(Finish) -> L,
) -> Bvh2<R> {
    build_within(options, codes, None, lbvh)
}

/// The same of instances, of which most are in the box `core`, if some are not ([`CodePlan::core`](crate::bvh::codes::CodePlan::core)).
pub fn build_within<R: Record, L: Into<Paired<R>>>(
    options: &BuildOptions,
    codes: Codes,
    core: Option<&Aabb>,
    lbvh: impl FnOnce(Finish) -> L,
) -> Bvh2<R> {
    let (collapse, child_order) = (options.collapse, options.child_order);
    if options.method == Method::Lbvh && options.optimise.is_none() {
        // Its own collapsing leaves other bytes in slots that fall out.
        return lbvh(Finish { collapse, child_order }).into().with_seconds(|tree| tree);
    }
    let tree = lbvh(Collapse::OFF.into()).into().with_seconds(|radix| match options.method {
        Method::Lbvh => radix,
        Method::Hlbvh(treelets) => hlbvh::build(&radix, codes, treelets),
        Method::Ploc { radius } => ploc::build(&radix, radius as usize),
        Method::Hploc(window) => hploc::build(&radix, window),
    });
    let tree = match &options.optimise {
        None => tree.collapsed(&collapse),
        Some(optimise) => {
            let optimised = match core {
                None => tree.reinserted(optimise),
                Some(core) => tree.reinserted_within(optimise, Areas::of_instances(codes.bounds), core),
            };
            optimised.collapsed(&collapse)
        }
    };
    match child_order {
        None => tree,
        Some(order) => tree.in_child_order(order, &collapse),
    }
}
