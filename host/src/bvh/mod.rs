//! BVHs built on the CPU: top-down, bottom-up and by insertion, on all threads of the rayon pool that [`build`] is called in.
//!
//! The methods are those that Frantál compares in "Ray Tracing with Bounding Volume Hierarchies on a CPU" (2019), and `sbvh`, which
//! splits triangles. Each gives the same bytes whatever the number of threads. What the cheapest tree over a few boxes would cost
//! is in [`optimal`].
//!
//! A build goes through phases: `boxes` reads the primitives, `order` sorts them by code where the method wants that, `heuristic`
//! makes another heuristic than the surface area ready, `build` makes the tree, `optimise` moves subtrees, `collapse` makes leaves,
//! and `layout` writes the tree depth first.

mod aac;
pub mod binned;
mod bonsai;
mod bounds;
mod build;
mod finish;
pub mod heuristic;
mod incremental;
mod input;
mod insertion;
mod look_ahead;
pub mod optimal;
mod order;
mod ploc;
mod sbvh;
pub mod sweep;
mod top_down;
mod topology;

pub use aac::AacOptions;
pub use binned::BinnedOptions;
pub use bonsai::BonsaiOptions;
use bounds::Bounds;
use glam::Vec3A;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::layout::{BoxRecord, Bvh2, Record, Triangle, status};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::geometry::finite_box;
use hedgerow::geometry::Aabb;
use hedgerow::{Error, Result};
pub use heuristic::Heuristic;
pub use incremental::{IncrementalOptions, IncrementalOrder};
pub use insertion::{Inefficiency, InsertionOptions};
pub use optimal::top::TopOptions;
pub use sbvh::SbvhOptions;

/// Fewer primitives than this are not worth another thread.
const ALONE: usize = 4096;
/// From this depth on one thread builds a subtree, however large it is.
const DIVIDED_ABOVE: u32 = 48;

/// How a tree is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HostMethod {
    /// The best of all splits along all axes, top-down.
    Sweep,
    /// The best of the planes between bins, top-down.
    Binned(BinnedOptions),
    /// Sweeps over parts, and one over their trees.
    Bonsai(BonsaiOptions),
    /// Approximate agglomerative clustering along the radix tree of the codes, bottom-up.
    Aac(AacOptions),
    /// Parallel locally-ordered clustering: neighbours in the order of the codes that are each other's nearest merge in rounds.
    Ploc {
        /// How many neighbours on either side are looked at, at least 1.
        radius: usize,
    },
    /// One primitive after the other is put where it costs least.
    Incremental(IncrementalOptions),
    /// The best of the planes between bins, top-down, of objects or of space: triangles are split. Boxes that are no triangles are not.
    Sbvh(SbvhOptions),
}

impl HostMethod {
    /// Whether it begins with the order of codes.
    pub const fn sorts(&self) -> bool {
        matches!(self, HostMethod::Aac(_) | HostMethod::Ploc { .. })
    }

    /// Whether it chooses among splits of all primitives of a node.
    const fn is_top_down(&self) -> bool {
        matches!(self, HostMethod::Sweep | HostMethod::Binned(_))
    }
}

/// What [`build`] is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostBvhOptions {
    /// How the tree is built.
    pub method: HostMethod,
    /// The codes of a method that begins with their order; `None` takes [`Codes::for_count`] of all primitives.
    pub codes: Option<Codes>,
    /// The costs of a step and of a test; and whether subtrees become leaves where that is cheaper.
    pub collapse: Collapse,
    /// When a top-down method stops.
    pub termination: Termination,
    /// What moves subtrees before leaves are made.
    pub optimise: HostOptimise,
    /// How many of a node's best splits are judged by temporary trees, 1 to 64; 1 takes the best without. More is for
    /// [`HostMethod::Sweep`] and [`HostMethod::Binned`], and takes that many times as long and more.
    pub look_ahead: u32,
}

impl HostBvhOptions {
    /// What a method does where nothing else is said: leaves by SAH with the costs of the theses.
    pub const fn of(method: HostMethod) -> HostBvhOptions {
        HostBvhOptions {
            method,
            codes: None,
            collapse: Collapse::SAH,
            termination: Termination::Sah,
            optimise: HostOptimise::Off,
            look_ahead: 1,
        }
    }

    /// The least time for a tree that is worth it: AAC-Fast that leaves even fewer clusters, ε = 0.3. Measured in
    /// docs/notes/cpu_builders.md.
    pub const FAST: HostBvhOptions = HostBvhOptions::of(HostMethod::Aac(AacOptions { epsilon: 3, ..AacOptions::FAST }));

    /// The best trees: a sweep, and insertion behind it.
    pub const BEST: HostBvhOptions = HostBvhOptions {
        optimise: HostOptimise::Insertion(InsertionOptions::PAPER),
        ..HostBvhOptions::of(HostMethod::Sweep)
    };

    /// Whether more than one thread makes the tree. What is before and behind that always runs on all threads.
    pub const fn is_parallel(&self) -> bool {
        match (&self.method, &self.optimise) {
            (_, HostOptimise::Insertion(_)) => false,
            (HostMethod::Incremental(options), _) => options.search > 1,
            _ => true,
        }
    }

    /// Whether leaves have one primitive when the tree is built: those that make it better, and other leaves later, want that.
    const fn is_single(&self) -> bool {
        matches!(self.termination, Termination::Single)
            || !self.collapse.enabled
            || !matches!(self.optimise, HostOptimise::Off)
    }

    /// Whether [`build()`] can use them.
    ///
    /// # Errors
    /// [`Error::Argument`] names the option that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        look_ahead::check(self.look_ahead)?;
        if self.look_ahead > 1 && !self.method.is_top_down() {
            let error = format!("{:?} cannot look ahead; take Sweep or Binned, or 1 split", self.method);
            return Err(Error::Argument(error));
        }
        match &self.method {
            HostMethod::Sweep => Ok(()),
            HostMethod::Aac(options) => options.check(),
            HostMethod::Ploc { radius: 0 } => {
                Err(Error::Argument("a radius of 0 cannot be used; take 1 or more clusters".into()))
            }
            HostMethod::Ploc { .. } => Ok(()),
            HostMethod::Binned(options) => options.check(),
            HostMethod::Bonsai(options) => options.check(),
            HostMethod::Incremental(options) => options.check(),
            HostMethod::Sbvh(options) => options.check(),
        }?;
        match &self.optimise {
            HostOptimise::Off | HostOptimise::Reinsertion(_) => Ok(()),
            HostOptimise::Insertion(options) => options.check(),
            HostOptimise::Top(options) => options.check(),
        }
    }
}

/// When a top-down method splits a node no further.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Termination {
    /// Where one primitive is left: leaves are made by collapsing.
    Single,
    /// Where a leaf is cheaper than the best split into two leaves, by surface area. A build by another heuristic goes on to single
    /// primitives.
    Sah,
    /// The same by the heuristic that the tree is built by, as van Kralingen 2023 has it (equation 5). Leaves may be huge where the
    /// heuristic knows of no rays: to show what that does.
    Heuristic,
}

/// What makes a tree better that is built.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum HostOptimise {
    /// Nothing.
    Off,
    /// Parallel reinsertion, as on the device, here on one thread.
    Reinsertion(ReinsertionOptions),
    /// Insertion-based optimisation: slow, and the best there is for a tree of any builder.
    Insertion(InsertionOptions),
    /// The cheapest top by planes over the largest subtrees.
    Top(TopOptions),
}

/// A tree, and how its build went.
#[derive(Debug, Clone)]
pub struct Built<R: Record> {
    /// The tree, its nodes depth first.
    pub tree: Bvh2<R>,
    /// Name and milliseconds of each phase, in order.
    pub phases: Vec<(&'static str, f64)>,
}

/// Builds the BVH of `triangles` over `positions`. Triangles that are not finite or name vertices that are not there are left
/// out, and the status says so.
///
/// # Errors
/// An option cannot be used: [`HostBvhOptions::check`].
pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], options: &HostBvhOptions) -> Result<Built<Triangle>> {
    build_by(&Heuristic::Sah, positions, triangles, options)
}

/// The same with splits that cost what `heuristic` says, by [`HostMethod::Sweep`], [`HostMethod::Binned`] or [`HostMethod::Sbvh`].
///
/// # Errors
/// An option or the heuristic cannot be used: [`HostBvhOptions::check`], [`Heuristic::check`].
pub fn build_by(
    heuristic: &Heuristic<'_>,
    positions: &[[f32; 3]],
    triangles: &[[u32; 3]],
    options: &HostBvhOptions,
) -> Result<Built<Triangle>> {
    let corners = |primitive: u32| triangles[primitive as usize].map(|v| positions.get(v as usize));
    let bounds = |primitive| {
        let [Some(v0), Some(v1), Some(v2)] = corners(primitive) else { return Err(status::INDEX_OUT_OF_RANGE) };
        let corners = [v0, v1, v2].map(|v| Vec3A::from_array(*v) + 0.0);
        let is_finite = corners.iter().all(|v| v.is_finite());
        if is_finite { Ok(Bounds::of_triangle(corners)) } else { Err(status::NON_FINITE) }
    };
    let record = |primitive| {
        let [v0, v1, v2] = corners(primitive).map(|v| v.expect("a triangle in the tree has vertices").map(|x| x + 0.0));
        Triangle { v0, v1, v2, primitive }
    };
    build::build_of(triangles.len(), bounds, record, (options, heuristic))
}

/// Builds the BVH of boxes; one that is not finite or is inside out is left out.
///
/// # Errors
/// As those of [`build`].
pub fn build_aabbs(boxes: &[Aabb], options: &HostBvhOptions) -> Result<Built<BoxRecord>> {
    build_aabbs_by(&Heuristic::Sah, boxes, options)
}

/// The same with splits that cost what `heuristic` says.
///
/// # Errors
/// As those of [`build_by`].
pub fn build_aabbs_by(heuristic: &Heuristic<'_>, boxes: &[Aabb], options: &HostBvhOptions) -> Result<Built<BoxRecord>> {
    let finite = |primitive: u32| finite_box(&boxes[primitive as usize]);
    let record = |primitive| box_record(boxes, primitive);
    let bounds = |primitive| finite(primitive).map(|bounds| Bounds::of(&bounds));
    build::build_of(boxes.len(), bounds, record, (options, heuristic))
}

/// The record of a box that is finite.
fn box_record(boxes: &[Aabb], primitive: u32) -> BoxRecord {
    let Aabb { lo, hi } = finite_box(&boxes[primitive as usize]).expect("a box in the tree is finite");
    BoxRecord { lo, hi, primitive }
}
