//! kd-trees for the CPU: by perfect splits or by bins, and merging of one into another.
//!
//! The bytes do not depend on how many threads there are.

mod exact;
pub mod merge;

use hedgerow::bvh::twin::lbvh;
use hedgerow::kdtree::layout::KdTree;
use hedgerow::kdtree::termination::Costs;
use hedgerow::kdtree::twin::{Fork, binned, grown};
use hedgerow::{Error, Result};

/// Side by side on rayon's threads.
struct Threads;

impl Fork for Threads {
    fn join<A: Send, B: Send>(&self, a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
        rayon::join(a, b)
    }
}

/// Which planes are looked at.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Planes {
    /// Every face of every box: perfect splits (Wald and Havran 2006).
    Exact,
    /// Between this many bins along each axis (Shevtsov, Soupikov and Kapustin 2007).
    Binned(u32),
    /// The same in cells of more than `exact` references, and every face of every box in the others: what the device builds.
    Mixed {
        /// Bins along each axis.
        bins: u32,
        /// References of a cell below which no bins are taken.
        exact: u32,
    },
}

impl Planes {
    /// The default number of bins. The thesis' number is not in the text that is left of it; 32 is a subgroup's lanes on its
    /// device.
    pub const BINS: u32 = 32;
    /// The most bins there may be.
    pub const MAX_BINS: u32 = 1024;
    /// The most references of a cell that is split exactly below bins: looking at every plane takes time by the square.
    pub const MAX_EXACT: u32 = 64;
}

/// What a build is asked for.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HostKdOptions {
    /// Which planes are looked at.
    pub planes: Planes,
    /// The costs by which the best is chosen.
    pub costs: Costs,
}

impl HostKdOptions {
    /// Perfect splits.
    pub const EXACT: HostKdOptions = HostKdOptions { planes: Planes::Exact, costs: Costs::DEFAULT };
    /// Bins.
    pub const BINNED: HostKdOptions = HostKdOptions { planes: Planes::Binned(Planes::BINS), costs: Costs::DEFAULT };

    /// # Errors
    /// [`Error::Argument`] names the option that cannot be used, and what can.
    pub fn check(&self) -> Result<()> {
        if !self.check_planes() {
            return Err(Error::Argument(format!(
                "{:?} cannot be used; take 2 to {} bins, and exact splits of at most {} references",
                self.planes,
                Planes::MAX_BINS,
                Planes::MAX_EXACT
            )));
        }
        match [self.costs.c_t, self.costs.c_i].into_iter().find(|&cost| !Costs::check(cost)) {
            Some(cost) => Err(Error::Argument(format!("a cost of {cost} cannot be used; take 0.001 to 1000"))),
            None => Ok(()),
        }
    }

    /// Whether there can be this many bins.
    pub fn check_planes(&self) -> bool {
        match self.planes {
            Planes::Exact => true,
            Planes::Binned(bins) => (2..=Planes::MAX_BINS).contains(&bins),
            Planes::Mixed { bins, exact } => (2..=Planes::MAX_BINS).contains(&bins) && exact <= Planes::MAX_EXACT,
        }
    }
}

/// Builds the kd-tree of `triangles` over `positions`. Triangles that are not finite or name vertices that are not there are
/// left out, and the status says so.
///
/// # Errors
/// [`Error::Argument`] if an option cannot be used, or if there would be more nodes or references than the layout can name.
pub fn build(positions: &[[f32; 3]], triangles: &[[u32; 3]], options: &HostKdOptions) -> Result<KdTree> {
    options.check()?;
    grown(lbvh::corners(positions, triangles), options.costs, |heuristic, records, cell, references| {
        let bins = match options.planes {
            Planes::Exact => return exact::build(heuristic, records, cell, references),
            Planes::Binned(bins) => (bins, 0),
            Planes::Mixed { bins, exact } => (bins, exact),
        };
        binned::build(&Threads, heuristic, records, bins, cell, references)
    })
}
