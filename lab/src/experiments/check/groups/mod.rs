//! The groups, from the simplest pass to whole top levels.

mod builders;
mod counts;
mod derived;
pub(super) mod faults;
mod flux;
mod kdtree;
mod large;
mod levels;
mod passes;
mod queries;
mod tracers;

use super::Group;

const fn group(name: &'static str, what: &'static str, run: fn(&mut super::cases::Cases<'_>)) -> Group {
    Group { name, what, run }
}

/// All of them, in the order in which they run.
pub const GROUPS: &[Group] = &[
    group("device", "memory, submits, long loops, progress of workgroups", passes::device),
    group("scan", "prefix sums and reductions against their twins", passes::scan_and_reduce),
    group("sort", "the radix sort against its twin", passes::sort),
    group("pool", "trees of tasks come out complete", passes::pool),
    group("lbvh", "LBVH by every schedule against its twin", builders::lbvh),
    group("codes", "every kind of codes against its twin", builders::codes),
    group("hlbvh", "HLBVH against its twin", builders::hlbvh),
    group("ploc", "PLOC against its twin", builders::ploc),
    group("hploc", "H-PLOC in small and large windows against its twin", builders::hploc),
    group("pairs", "trees over pairs of triangles against their twin", builders::pairs),
    group("split", "split triangles against their twin", builders::split),
    group("optimise", "reinsertion against its twin", builders::optimise),
    group("wide", "collapsing to 4 and 8 children, quantised or not, against its twin", derived::wide),
    group("refit", "refitting to moved triangles against its twin", derived::refit),
    group("child-order", "children in every order against its twin", derived::child_order),
    group("ordered", "builds with children in every order against their twin", builders::in_child_order),
    group("ray-counts", "rays counted by links, and what they teach, against their twins", counts::ray_counts),
    group(
        "by-rays",
        "the flux of rays, reinsertion that it teaches, and trees on trial, against their twins",
        flux::by_rays,
    ),
    group("kd-build", "kd-trees by every schedule against their twin", kdtree::build),
    group("kd-merge", "objects merged into a kd-tree and out again against their twin", kdtree::merge),
    group("trace", "every binary tracer against its twin and brute force", tracers::binary),
    group("trace-wide", "every wide tracer against its twin and brute force", tracers::wide),
    group("trace-kd", "every kd-tree tracer against its twin and brute force", tracers::kd),
    group(
        "queries",
        "flags, masks and decisions in a foreign shader against brute force",
        queries::flags_and_decisions,
    ),
    group("facing", "sides, culling and mirrored instances against brute force", queries::facing),
    group("transforms", "instances by all kinds of matrices against brute force", queries::transforms),
    group("boxes", "boxes, generated hits and inactive primitives against brute force", queries::boxes),
    group("update", "updated levels against brute force", levels::update),
    group("copy", "clones, compaction and serialisation against the host", levels::copies),
    group("rebraid", "re-braided top levels against their twin", levels::rebraid),
    group("large", "more work than one dispatch of one item an invocation holds", large::large),
];
