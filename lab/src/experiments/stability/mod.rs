//! What `hedgerow stability` measures: where methods give way.
//!
//! [`far`]: the bounds grow by a far triangle; [`top`]: those of a top level by far instances; [`large`]: huge triangles at the scene's edge; [`degenerate`]: scenes that
//! hurt; [`greedy`]: what greedy trees cost over the cheapest ones. The first two compare a builder with itself ([`relative`]) by the cost of what stays ([`clipped`]) and the speed of its
//! rays; [`mod@drop`] says where a tenth is lost. Each gives [`points`] as it goes.

pub mod clipped;
pub(crate) mod command;
pub mod degenerate;
pub mod drop;
pub mod far;
pub mod greedy;
pub mod large;
pub mod page;
pub mod points;
pub mod relative;
pub mod top;

/// What `growth` measures where `-b` does not say: the codes, and builders that sort by them, in trees with one triangle a leaf,
/// so that nothing but the order of the triangles and what is made of it counts.
pub const GROWTH_BUILDERS: &str = "lbvh:codes=mc63:collapse=off,lbvh:codes=emc64sort:collapse=off,\
     lbvh:codes=emc64var:collapse=off,lbvh:codes=emc64var-nosize:collapse=off,\
     lbvh:codes=mip9:collapse=off,lbvh:codes=bin4a4:collapse=off,lbvh:codes=emc64var+robust:collapse=off,\
     hploc:codes=emc64var-nosize:collapse=off,ploc:codes=emc64var-nosize:collapse=off";
/// What `large` measures: codes normalised by the bounds of all boxes, by the concise ones, and with a section for what is huge.
pub const LARGE_BUILDERS: &str = "lbvh:codes=mc63:collapse=off,lbvh:codes=mc63+concise:collapse=off,\
     lbvh:codes=emc64var:collapse=off,lbvh:codes=emc64var+concise:collapse=off,\
     lbvh:codes=emc64var-nosize:collapse=off,lbvh:codes=emc64var-nosize+concise:collapse=off,\
     lbvh:codes=emc64var+robust:collapse=off";
/// What `degenerate` measures: everything that can work here, and what options change most.
pub const DEGENERATE_BUILDERS: &str = "all,lbvh:codes=mip9,lbvh:codes=bin4a4,lbvh:codes=emc64var+robust,lbvh:split=0.3,\
     lbvh:optimise=fast,lbvh:width=4,hploc:window=32,hploc:width=8q";
