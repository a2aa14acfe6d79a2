//! The list of all builders.

use super::Spec;
use super::options::{
    BINS, BITS, CODES, COLLAPSE, EXACT, KD_SCHEDULE, KI, KT, OPTIMISE, ORDER, RADIUS, RAYS, SCHEDULE, SPLIT,
    TERMINATION, TRACE, TRAVERSAL, TREELET, WIDTH, WINDOW, WORKGROUPS,
};
use crate::Result;
use crate::subjects::host::HostMethod;
use crate::subjects::peers::driver::DriverPreference;
#[cfg(feature = "peer-embree")]
use crate::subjects::peers::embree;
#[cfg(feature = "peer-obvhs")]
use crate::subjects::peers::obvhs;
use hedgerow::bvh::builder;
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
    pub(super) kind: Kind,
}

/// An option of a builder, `key=value`.
pub struct BuilderOption {
    /// Its name.
    pub key: &'static str,
    /// The values it takes, for people.
    pub values: &'static str,
}

impl BuilderOption {
    pub(super) const fn new(key: &'static str, values: &'static str) -> BuilderOption {
        BuilderOption { key, values }
    }
}

/// What a builder is: what it needs, which options must be sound, and how its subject is made follow from it.
pub(super) enum Kind {
    /// One of ours on the device, with these options.
    Device(fn(&Spec) -> Result<builder::BuildOptions>),
    /// One of ours on the host, with this hierarchy.
    Host(fn(&Spec) -> Result<HostMethod>),
    /// A kd-tree by one of ours on the host.
    KdHost(fn(&Spec) -> Result<hedgerow_host::kdtree::HostKdOptions>),
    /// A kd-tree by ours on the device.
    KdGpu,
    /// The one of ours on the device that is expected to take least, by the table of costs.
    Auto,
    /// The Vulkan driver's own.
    Driver(DriverPreference),
    #[cfg(feature = "peer-obvhs")]
    Obvhs(obvhs::Preset),
    #[cfg(feature = "peer-embree")]
    Embree(embree::Preset),
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

impl BuilderEntry {
    /// One without options, itself its only variant: a slice borrows the name for that.
    const fn new(name: &'static &'static str, what: &'static str, kind: Kind) -> BuilderEntry {
        BuilderEntry { name, what, options: &[], variants: slice::from_ref(name), kind }
    }

    const fn taking(self, options: &'static [BuilderOption]) -> BuilderEntry {
        BuilderEntry { options, ..self }
    }

    const fn in_variants(self, variants: &'static [&'static str]) -> BuilderEntry {
        BuilderEntry { variants, ..self }
    }

    /// What it needs of the machine.
    pub fn needs(&self) -> Needs {
        match self.kind {
            Kind::Device(_) | Kind::KdGpu | Kind::Auto => Needs::Device,
            Kind::Driver(_) => Needs::RayQuery,
            Kind::Host(_) | Kind::KdHost(_) => Needs::Nothing,
            #[cfg(feature = "peer-obvhs")]
            Kind::Obvhs(_) => Needs::Nothing,
            #[cfg(feature = "peer-embree")]
            Kind::Embree(_) => Needs::Nothing,
        }
    }
}

/// Every builder, in the order in which they are listed and measured.
pub static BUILDERS: &[BuilderEntry] = &[
    BuilderEntry::new(
        &"lbvh",
        "linear BVH on the device: codes, radix sort, hierarchy bottom-up in one pass",
        Kind::Device(Spec::lbvh_options),
    )
    .taking(&[CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER])
    .in_variants(&[
        "lbvh",
        "lbvh:codes=mc30",
        "lbvh:codes=emc64var-nosize",
        "lbvh:collapse=off",
        "lbvh:schedule=persistent",
        "lbvh:width=4",
        "lbvh:width=8q",
    ]),
    BuilderEntry::new(
        &"hlbvh",
        "hierarchical LBVH on the device: small subtrees of the LBVH under a top split by the surface area heuristic",
        Kind::Device(Spec::hlbvh_options),
    )
    .taking(&[BITS, TREELET, CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER]),
    BuilderEntry::new(
        &"ploc",
        "parallel locally-ordered clustering on the device: nearest neighbours in the order of codes merged in rounds",
        Kind::Device(Spec::ploc_options),
    )
    .taking(&[RADIUS, CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER])
    .in_variants(&["ploc", "ploc:radius=25"]),
    BuilderEntry::new(
        &"hploc",
        "hierarchical PLOC on the device: neighbours merged in windows of the order of codes",
        Kind::Device(Spec::hploc_options),
    )
    .taking(&[WINDOW, RADIUS, CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER]),
    BuilderEntry::new(
        &"auto",
        "the device's builder that takes least for a build and its rays, by its measured costs",
        Kind::Auto,
    )
    .taking(&[RAYS]),
    BuilderEntry::new(
        &"lbvh-host",
        "the same LBVH by one thread of the host: what `lbvh` must equal, byte for byte",
        Kind::Host(|_| Ok(HostMethod::Lbvh)),
    )
    .taking(&[CODES, COLLAPSE, OPTIMISE]),
    BuilderEntry::new(
        &"ploc-host",
        "locally-ordered clustering by one thread of the host: what `ploc` must equal, byte for byte",
        Kind::Host(|spec| spec.ploc_radius().map(HostMethod::Ploc)),
    )
    .taking(&[RADIUS, CODES, COLLAPSE, OPTIMISE]),
    BuilderEntry::new(
        &"sweep",
        "full-sweep SAH on the host: the reference for the quality of the others",
        Kind::Host(|spec| spec.sweep_leaves().map(HostMethod::Sweep)),
    )
    .taking(&[COLLAPSE, OPTIMISE, TERMINATION]),
    BuilderEntry::new(&"kd-exact", "kd-tree on the host: perfect splits by SAH", Kind::KdHost(Spec::kd_exact_options))
        .taking(&[KT, KI, TRAVERSAL, TRACE]),
    BuilderEntry::new(
        &"kd-binned",
        "kd-tree on the host: the best by SAH of equally spaced planes",
        Kind::KdHost(Spec::kd_binned_options),
    )
    .taking(&[BINS, KT, KI, TRAVERSAL, TRACE]),
    BuilderEntry::new(
        &"kd-gpu",
        "kd-tree on the device: bins above, level by level; perfect splits of few references below",
        Kind::KdGpu,
    )
    .taking(&[BINS, EXACT, KT, KI, KD_SCHEDULE, WORKGROUPS, TRAVERSAL]),
    BuilderEntry::new(
        &"kd-gpu-host",
        "kd-tree of bins above and perfect splits below, on the host: what `kd-gpu` must equal, byte for byte",
        Kind::KdHost(Spec::kd_mixed_options),
    )
    .taking(&[BINS, EXACT, KT, KI, TRAVERSAL, TRACE]),
    BuilderEntry::new(
        &"driver-fast-build",
        "the Vulkan driver's own, asked to build fast",
        Kind::Driver(DriverPreference::FastBuild),
    ),
    BuilderEntry::new(
        &"driver-fast-trace",
        "the Vulkan driver's own, asked to trace fast",
        Kind::Driver(DriverPreference::FastTrace),
    ),
    #[cfg(feature = "peer-obvhs")]
    BuilderEntry::new(&"obvhs-fastest", "obvhs on the CPU: PLOC alone", Kind::Obvhs(obvhs::Preset::Fastest)),
    #[cfg(feature = "peer-obvhs")]
    BuilderEntry::new(
        &"obvhs-fast",
        "obvhs on the CPU: PLOC and a little reinsertion",
        Kind::Obvhs(obvhs::Preset::Fast),
    ),
    #[cfg(feature = "peer-obvhs")]
    BuilderEntry::new(
        &"obvhs-medium",
        "obvhs on the CPU: PLOC and more reinsertion",
        Kind::Obvhs(obvhs::Preset::Medium),
    ),
    #[cfg(feature = "peer-embree")]
    BuilderEntry::new(&"embree-low", "Embree on the CPU: Morton codes", Kind::Embree(embree::Preset::Low)),
    #[cfg(feature = "peer-embree")]
    BuilderEntry::new(&"embree-medium", "Embree on the CPU: binned SAH", Kind::Embree(embree::Preset::Medium)),
    #[cfg(feature = "peer-embree")]
    BuilderEntry::new(&"embree-high", "Embree on the CPU: SAH with spatial splits", Kind::Embree(embree::Preset::High)),
];
