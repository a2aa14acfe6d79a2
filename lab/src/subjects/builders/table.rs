//! The list of all builders.

use super::host_options::{
    ALPHA, AXES, BATCH, BUDGET, DELTA, EPSILON, HEURISTIC, HEURISTIC_OF_SPLITS, HOST_BINS, HOST_OPTIMISE, INSERT_ORDER,
    LEAF, LOOK_AHEAD, MINI, PRUNE, SAMPLE, SBVH_BINS, SEARCH, TEACHING_RAYS, TERMINATION, TERMINATION_BY,
    TERMINATION_FLAT, THREADS, WEIGHT,
};
use super::options::{
    ANY_HIT, BINS, BITS, BY, CODES, COLLAPSE, EXACT, KD_SCHEDULE, KI, KT, OPEN, OPTIMISE, ORDER, PAIRS, RADIUS, RAYS,
    SCHEDULE, SPLIT, TRACE, TRACE_TREE, TRAVERSAL, TREELET, WALK, WIDTH, WINDOW, WORKGROUPS,
};
use super::{BuilderPlan, Spec};
use crate::Result;
#[cfg(feature = "peer-embree")]
use crate::subjects::host::HostPlan;
use crate::subjects::peers::driver::DriverPreference;
#[cfg(feature = "peer-embree")]
use crate::subjects::peers::embree;
#[cfg(feature = "peer-obvhs")]
use crate::subjects::peers::obvhs;
use hedgerow::bvh::builder::Method;
use hedgerow_host::bvh::{AacOptions, BonsaiOptions, HostBvhOptions, HostMethod};
use hedgerow_host::kdtree::Planes;
use std::slice;

/// A builder that can be asked for.
pub struct BuilderEntry {
    /// Its name.
    pub name: &'static str,
    /// What it is, in half a sentence.
    pub what: &'static str,
    /// The options it takes.
    pub options: &'static [BuilderOption],
    /// What `-b all` takes of it: specs that differ in kind, not in degree.
    pub variants: &'static [&'static str],
    /// What it needs of the machine.
    pub needs: Needs,
    pub(super) plan: ReadPlan,
}

/// Reads the options of a builder.
type ReadPlan = fn(&Spec) -> Result<BuilderPlan>;

/// An option of a builder, `key=value`.
pub struct BuilderOption {
    /// Its name.
    pub key: &'static str,
    /// The values it takes, for people.
    pub values: &'static str,
}

/// What a builder needs of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// Nothing: it works on the host.
    Nothing,
    /// A device.
    Device,
    /// A device whose driver has ray queries.
    RayQuery,
}

/// One without options, itself its only variant: a slice borrows the name for that.
const fn needing(needs: Needs, name: &'static &'static str, what: &'static str, plan: ReadPlan) -> BuilderEntry {
    BuilderEntry { name, what, options: &[], variants: slice::from_ref(name), needs, plan }
}

const fn on_device(name: &'static &'static str, what: &'static str, plan: ReadPlan) -> BuilderEntry {
    needing(Needs::Device, name, what, plan)
}

const fn on_host(name: &'static &'static str, what: &'static str, plan: ReadPlan) -> BuilderEntry {
    needing(Needs::Nothing, name, what, plan)
}

impl BuilderEntry {
    const fn taking(self, options: &'static [BuilderOption]) -> BuilderEntry {
        BuilderEntry { options, ..self }
    }

    const fn in_variants(self, variants: &'static [&'static str]) -> BuilderEntry {
        BuilderEntry { variants, ..self }
    }

    /// Its options, with those of all builders of BVHs on the host.
    pub fn all_options(&self) -> impl Iterator<Item = &'static BuilderOption> {
        let of_bvh = if self.builds_bvh_on_host() { &[&TRACE_TREE, &ANY_HIT][..] } else { &[] };
        self.options.iter().chain(of_bvh.iter().copied())
    }

    /// Whether it has an option of this name.
    pub(super) fn takes(&self, key: &str) -> bool {
        self.all_options().any(|option| option.key == key)
    }

    /// Whether it splits triangles, and its heuristics may know of that.
    pub(super) fn splits_triangles(&self) -> bool {
        self.options.iter().any(|option| option.values == HEURISTIC_OF_SPLITS.values)
    }

    /// Whether it builds a BVH on the host; builders of kd-trees there say themselves where rays are traced.
    pub fn builds_bvh_on_host(&self) -> bool {
        self.needs == Needs::Nothing && self.options.iter().all(|option| option.key != TRACE.key)
    }
}

/// Every builder, in the order in which they are listed and measured.
pub static BUILDERS: &[BuilderEntry] = &[
    on_device(&"lbvh", "linear BVH on the device: codes, radix sort, hierarchy bottom-up in one pass", |spec| {
        spec.on_device(Method::Lbvh)
    })
    .taking(&[CODES, SPLIT, OPTIMISE, BY, COLLAPSE, SCHEDULE, WIDTH, ORDER, OPEN, ANY_HIT, WALK])
    .in_variants(&[
        "lbvh",
        "lbvh:codes=mc30",
        "lbvh:codes=emc64var-nosize",
        "lbvh:collapse=off",
        "lbvh:schedule=persistent",
        "lbvh:width=4",
        "lbvh:width=8q",
    ]),
    on_device(
        &"hlbvh",
        "hierarchical LBVH on the device: small subtrees of the LBVH under a top split by the surface area heuristic",
        Spec::hlbvh,
    )
    .taking(&[BITS, TREELET, CODES, SPLIT, OPTIMISE, BY, COLLAPSE, SCHEDULE, WIDTH, ORDER, OPEN, ANY_HIT, WALK]),
    on_device(
        &"ploc",
        "parallel locally-ordered clustering on the device: nearest neighbours in the order of codes merged in rounds",
        Spec::ploc,
    )
    .taking(&[RADIUS, CODES, SPLIT, PAIRS, OPTIMISE, BY, COLLAPSE, SCHEDULE, WIDTH, ORDER, OPEN, ANY_HIT, WALK])
    .in_variants(&["ploc", "ploc:radius=25"]),
    on_device(
        &"hploc",
        "hierarchical PLOC on the device: neighbours merged in windows of the order of codes",
        Spec::hploc,
    )
    .taking(&[
        WINDOW, RADIUS, CODES, SPLIT, PAIRS, OPTIMISE, BY, COLLAPSE, SCHEDULE, WIDTH, ORDER, OPEN, ANY_HIT, WALK,
    ]),
    on_device(
        &"auto",
        "the device's builder that takes least for a build and its rays, by its measured costs",
        |spec| spec.rays().map(BuilderPlan::Auto),
    )
    .taking(&[RAYS]),
    on_host(&"lbvh-host", "the same LBVH by one thread of the host: what `lbvh` must equal, byte for byte", |spec| {
        spec.twin()
    })
    .taking(&[CODES, COLLAPSE, OPTIMISE]),
    on_host(
        &"ploc-host",
        "parallel locally-ordered clustering on the host: nearest neighbours in the order of codes merged in rounds",
        Spec::ploc_on_host,
    )
    .taking(&[RADIUS, CODES, COLLAPSE, HOST_OPTIMISE, THREADS]),
    on_host(&"sweep", "full-sweep SAH on the host: the reference for the quality of the others", |spec| {
        spec.on_host(HostMethod::Sweep)
    })
    .taking(&[
        HEURISTIC,
        TEACHING_RAYS,
        SAMPLE,
        WEIGHT,
        LOOK_AHEAD,
        TERMINATION_BY,
        COLLAPSE,
        HOST_OPTIMISE,
        THREADS,
    ]),
    on_host(&"binned", "binned SAH on the host: the best of the planes between bins, top-down", Spec::binned)
        .taking(&[
            HOST_BINS,
            LEAF,
            AXES,
            HEURISTIC,
            TEACHING_RAYS,
            SAMPLE,
            WEIGHT,
            LOOK_AHEAD,
            TERMINATION_FLAT,
            COLLAPSE,
            HOST_OPTIMISE,
            THREADS,
        ])
        .in_variants(&["binned", "binned:axes=all"]),
    on_host(&"sbvh", "binned SAH on the host that also splits triangles between bins of space", Spec::sbvh).taking(&[
        ALPHA,
        BUDGET,
        SBVH_BINS,
        HEURISTIC_OF_SPLITS,
        TEACHING_RAYS,
        SAMPLE,
        WEIGHT,
        TERMINATION_BY,
        COLLAPSE,
        HOST_OPTIMISE,
        THREADS,
    ]),
    on_host(&"bonsai", "sweeps over parts of 512 triangles on the host, and one over their trees", |spec| {
        spec.bonsai(BonsaiOptions::PLAIN)
    })
    .taking(&[MINI, PRUNE, TERMINATION, COLLAPSE, HOST_OPTIMISE, THREADS]),
    on_host(&"bonsai-p", "the same with large mini trees pruned", |spec| spec.bonsai(BonsaiOptions::PRUNED)).taking(&[
        MINI,
        PRUNE,
        TERMINATION,
        COLLAPSE,
        HOST_OPTIMISE,
        THREADS,
    ]),
    on_host(&"bonsai-p2", "the same with parts of 4096 triangles, pruned further", |spec| {
        spec.bonsai(BonsaiOptions::PRUNED_FINE)
    })
    .taking(&[MINI, PRUNE, TERMINATION, COLLAPSE, HOST_OPTIMISE, THREADS]),
    on_host(
        &"aac-hq",
        "approximate agglomerative clustering on the host: bottom-up along the order of codes, nearest clusters first",
        |spec| spec.aac(AacOptions::HIGH_QUALITY),
    )
    .taking(&[DELTA, EPSILON, CODES, COLLAPSE, HOST_OPTIMISE, THREADS]),
    on_host(&"aac-fast", "the same with fewer clusters at a time", |spec| spec.aac(AacOptions::FAST)).taking(&[
        DELTA,
        EPSILON,
        CODES,
        COLLAPSE,
        HOST_OPTIMISE,
        THREADS,
    ]),
    on_host(
        &"incremental",
        "incremental construction on the host: one triangle after the other is put where it costs least",
        Spec::incremental,
    )
    .taking(&[BATCH, INSERT_ORDER, SEARCH, COLLAPSE, HOST_OPTIMISE, THREADS])
    .in_variants(&["incremental", "incremental:optimise=insertion"]),
    on_host(&"host-fast", "the builder on the host to take where the build must be fast: aac-fast:epsilon=3", |spec| {
        spec.preset(HostBvhOptions::FAST)
    })
    .taking(&[COLLAPSE, THREADS]),
    on_host(
        &"host-best",
        "the builder on the host to take where rays must be fast: sweep:optimise=insertion",
        |spec| spec.preset(HostBvhOptions::BEST),
    )
    .taking(&[COLLAPSE, THREADS]),
    on_host(&"kd-exact", "kd-tree on the host: perfect splits by SAH", |spec| spec.kd_on_host(Planes::Exact))
        .taking(&[KT, KI, TRAVERSAL, TRACE]),
    on_host(&"kd-binned", "kd-tree on the host: the best by SAH of equally spaced planes", |spec| {
        spec.kd_on_host(Planes::Binned(spec.parsed(&BINS)?.unwrap_or(Planes::BINS)))
    })
    .taking(&[BINS, KT, KI, TRAVERSAL, TRACE]),
    on_device(
        &"kd-gpu",
        "kd-tree on the device: bins above, level by level; perfect splits of few references below",
        Spec::kd_on_device,
    )
    .taking(&[BINS, EXACT, KT, KI, KD_SCHEDULE, WORKGROUPS, TRAVERSAL]),
    on_host(
        &"kd-gpu-host",
        "kd-tree of bins above and perfect splits below, on the host: what `kd-gpu` must equal, byte for byte",
        Spec::kd_mixed_on_host,
    )
    .taking(&[BINS, EXACT, KT, KI, TRAVERSAL, TRACE]),
    needing(Needs::RayQuery, &"driver-fast-build", "the Vulkan driver's own, asked to build fast", |_| {
        Ok(BuilderPlan::Driver(DriverPreference::FastBuild))
    }),
    needing(Needs::RayQuery, &"driver-fast-trace", "the Vulkan driver's own, asked to trace fast", |_| {
        Ok(BuilderPlan::Driver(DriverPreference::FastTrace))
    }),
    #[cfg(feature = "peer-obvhs")]
    on_host(&"obvhs-fastest", "obvhs on the CPU: PLOC alone", |_| Ok(BuilderPlan::Obvhs(obvhs::Preset::Fastest))),
    #[cfg(feature = "peer-obvhs")]
    on_host(&"obvhs-fast", "obvhs on the CPU: PLOC and a little reinsertion", |_| {
        Ok(BuilderPlan::Obvhs(obvhs::Preset::Fast))
    }),
    #[cfg(feature = "peer-obvhs")]
    on_host(&"obvhs-medium", "obvhs on the CPU: PLOC and more reinsertion", |_| {
        Ok(BuilderPlan::Obvhs(obvhs::Preset::Medium))
    }),
    #[cfg(feature = "peer-embree")]
    on_host(&"embree-low", "Embree on the CPU: Morton codes", |_| Ok(BuilderPlan::Embree(embree::Preset::Low))),
    #[cfg(feature = "peer-embree")]
    on_host(&"embree-medium", "Embree on the CPU: binned SAH", |_| Ok(BuilderPlan::Embree(embree::Preset::Medium))),
    #[cfg(feature = "peer-embree")]
    on_host(&"embree-high", "Embree on the CPU: SAH with spatial splits", |_| {
        Ok(BuilderPlan::Embree(embree::Preset::High))
    }),
    #[cfg(feature = "peer-embree")]
    on_host(
        &"embree-low-tree",
        "the tree that Embree's rtcBuildBVH makes by Morton codes, traced by our tracer; phase build is Embree's alone, convert ours",
        |_| Ok(BuilderPlan::Host(HostPlan::Embree(embree::Preset::Low))),
    ),
    #[cfg(feature = "peer-embree")]
    on_host(&"embree-medium-tree", "the same by binned SAH", |_| {
        Ok(BuilderPlan::Host(HostPlan::Embree(embree::Preset::Medium)))
    }),
    #[cfg(feature = "peer-embree")]
    on_host(&"embree-high-tree", "the same by SAH with spatial splits: a triangle may be in several leaves", |_| {
        Ok(BuilderPlan::Host(HostPlan::Embree(embree::Preset::High)))
    }),
];
