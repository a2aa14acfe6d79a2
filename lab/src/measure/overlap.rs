//! End-point overlap under a bound in time: a tree of large triangles that lie across each other takes as long as brute force.

use crate::Result;
use crate::device::Device;
use hedgerow::bvh::epo::{OverlapBuffers, OverlapFigures, OverlapPass};
use hedgerow::bvh::layout::Bvh2;
use hedgerow::bvh::twin::epo::{Areas, Surfaces};
use rayon::prelude::*;
use std::str::FromStr;
use std::time::{Duration, Instant};

/// Records that are measured between two looks at the clock.
const PIECE: u32 = 1 << 15;

/// Whether the end-point overlap is measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Epo {
    /// It is not.
    Off,
    /// It is given up after [`Epo::CHEAP`].
    WhereCheap,
    /// However long it takes.
    On,
}

impl Epo {
    /// How long is cheap, for one tree.
    pub const CHEAP: Duration = Duration::from_secs(5);

    /// When to give up; `None` for never.
    fn deadline(self) -> Option<Instant> {
        match self {
            Epo::Off => Some(Instant::now()),
            Epo::WhereCheap => Some(Instant::now() + Epo::CHEAP),
            Epo::On => None,
        }
    }
}

impl FromStr for Epo {
    type Err = String;

    fn from_str(text: &str) -> Result<Epo, String> {
        match text {
            "off" => Ok(Epo::Off),
            "cheap" => Ok(Epo::WhereCheap),
            "on" => Ok(Epo::On),
            _ => Err(format!("{text:?} is unknown; use on, off, or cheap (given up after {:?} a tree)", Epo::CHEAP)),
        }
    }
}

/// Whether the time is over.
fn over(deadline: Option<Instant>) -> bool {
    deadline.is_some_and(|deadline| Instant::now() >= deadline)
}

/// The overlap of a tree on the host, by all cores; `None` where it was given up, or where there is no surface.
pub fn on_host(tree: &Bvh2, c_t: f64, c_i: f64, epo: Epo) -> Option<f64> {
    let deadline = epo.deadline();
    if over(deadline) {
        return None;
    }
    let surfaces = Surfaces::new(tree);
    let mut sum = Areas::default();
    for first in (0..surfaces.count()).step_by(PIECE as usize) {
        if over(deadline) {
            return None;
        }
        let piece = first..surfaces.count().min(first + PIECE as usize);
        let areas: Vec<Areas> = piece.into_par_iter().map(|i| surfaces.areas(i)).collect();
        sum = areas.iter().fold(sum, |sum, areas| sum.plus(areas));
    }
    sum.epo(c_t, c_i)
}

/// An estimate of the same from at most `most` surfaces, every so many of the primitives: of trees over the same primitives the same
/// ones, so that trees compare. `None` where it was given up after [`Epo::CHEAP`], or where there is no surface.
pub fn of_some_on_host(tree: &Bvh2, c_t: f64, c_i: f64, most: usize) -> Option<f64> {
    let deadline = Epo::WhereCheap.deadline();
    let surfaces = Surfaces::new(tree);
    let stride = surfaces.count().div_ceil(most.max(1)).max(1);
    let chosen: Vec<usize> = (0..surfaces.count()).step_by(stride).collect();
    let mut sum = Areas::default();
    for piece in chosen.chunks(PIECE as usize / 16) {
        if over(deadline) {
            return None;
        }
        let areas: Vec<Areas> = piece.par_iter().map(|&i| surfaces.areas(i)).collect();
        sum = areas.iter().fold(sum, |sum, areas| sum.plus(areas));
    }
    sum.epo(c_t, c_i)
}

/// The overlap of the `Bvh2` of `records` triangles at `structure` on the device; `None` where it was given up, or where there is
/// no surface.
///
/// # Errors
/// Too little memory; the device failed.
pub fn on_device(
    device: &Device,
    structure: u64,
    records: u32,
    (c_t, c_i): (f64, f64),
    epo: Epo,
) -> Result<Option<f64>> {
    let deadline = epo.deadline();
    if over(deadline) {
        return Ok(None);
    }
    let measure = OverlapPass::new(device, records);
    let scratch = device.buffer("overlap: scratch", measure.scratch_bytes())?;
    let result = device.buffer("overlap: figures", size_of::<OverlapFigures>() as u64)?;
    let buffers = OverlapBuffers { structure, scratch: scratch.region(), result: result.region() };
    device.run(None, |recorder| measure.begin(recorder, &buffers))?;
    for first in (0..records).step_by(PIECE as usize) {
        if over(deadline) {
            return Ok(None);
        }
        let piece = first..records.min(first.saturating_add(PIECE));
        device.run(None, |recorder| measure.overlaps(recorder, &buffers, piece))?;
    }
    device.run(None, |recorder| measure.end(recorder, &buffers))?;
    Ok(result.read::<OverlapFigures>(1)[0].epo(c_t, c_i))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{LoadOptions, load};
    use hedgerow::bvh::codes::Code;
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::bvh::twin::{epo, lbvh};

    #[test]
    fn all_cores_find_what_one_does() {
        let mesh = load("gen:soup:70000:3", &LoadOptions::default()).expect("a generator").mesh;
        let tree = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
        let (all, one) = (on_host(&tree, 3.0, 2.0, Epo::On), epo::epo(&tree, 3.0, 2.0));
        assert!(all.is_some() && all == one, "{all:?} {one:?}");
        assert_eq!(on_host(&tree, 3.0, 2.0, Epo::Off), None);
    }

    #[test]
    fn some_surfaces_stand_for_all() {
        let mesh = load("gen:soup:20000:3", &LoadOptions::default()).expect("a generator").mesh;
        let tree = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
        let all = epo::epo(&tree, 3.0, 2.0).expect("a surface");
        assert_eq!(of_some_on_host(&tree, 3.0, 2.0, 20_000), Some(all));
        let some = of_some_on_host(&tree, 3.0, 2.0, 2_000).expect("a surface");
        assert!(some != all && (some / all - 1.0).abs() < 0.05, "{some} of some, {all} of all");
    }

    #[test]
    fn what_is_not_known_is_named_with_what_there_is() {
        assert_eq!(("on".parse(), "off".parse(), "cheap".parse()), (Ok(Epo::On), Ok(Epo::Off), Ok(Epo::WhereCheap)));
        assert!("auto".parse::<Epo>().expect_err("not known").contains("on, off, or cheap"));
    }
}
