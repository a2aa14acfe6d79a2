//! How many rays a build pays for: the time that it takes beyond the reference's, over what a ray takes less.

use super::record::{RaysRecord, TreeRecord};
use crate::subjects::retraced::TreeTracer;

/// When a tree is the better choice.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Pays {
    /// Always: it is built no slower, and traced faster.
    AtOnce,
    /// From so many rays a build on.
    From(f64),
    /// Up to so many rays a build: it is built faster, and traced slower.
    UpTo(f64),
    /// Never: it is built no faster, and traced slower.
    Never,
    /// Rays are not told apart: the runs of both overlap.
    Unclear,
}

impl Pays {
    /// Of a tree against the reference, by milliseconds of a build and rays through both.
    pub fn of((build_ms, rays): (f64, &RaysRecord), (reference_ms, reference): (f64, &RaysRecord)) -> Pays {
        if rays.ns.overlaps(&reference.ns) {
            return Pays::Unclear;
        }
        let (dearer, gain) = ((build_ms - reference_ms) * 1e6, reference.ns.median - rays.ns.median);
        match (dearer > 0.0, gain > 0.0) {
            (true, true) => Pays::From(dearer / gain),
            (false, true) => Pays::AtOnce,
            (false, false) => Pays::UpTo(dearer / gain),
            (true, false) => Pays::Never,
        }
    }

    /// In words.
    pub fn in_words(&self) -> String {
        let count = crate::report::numbers::short_count;
        match self {
            Pays::AtOnce => "at once".into(),
            Pays::From(rays) => format!("from {}", count(*rays)),
            Pays::UpTo(rays) => format!("up to {}", count(*rays)),
            Pays::Never => "never".into(),
            Pays::Unclear => "not told apart".into(),
        }
    }
}

/// A tree's build and rays beside the reference's.
#[derive(Debug, Clone, PartialEq)]
pub struct Gain<'r> {
    /// The tree.
    pub tree: &'r TreeRecord,
    /// Milliseconds of its build over the reference's.
    pub build: f64,
    /// All rays together, by each tracer.
    pub rays: [Option<RayGain>; 2],
}

/// What rays gain by a tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayGain {
    /// Nanoseconds that a ray takes.
    pub ns: f64,
    /// Nanoseconds that it takes less than through the reference.
    pub less: f64,
    /// When that pays.
    pub pays: Pays,
}

/// Every tree beside the reference of its scene; nothing of a scene without one.
pub fn gains(records: &[TreeRecord]) -> Vec<Gain<'_>> {
    let of_reference =
        |tree: &TreeRecord| records.iter().find(|other| other.is_reference() && other.scene == tree.scene);
    let gain = |tree| {
        let reference = of_reference(tree)?;
        let (ms, reference_ms) = (tree.build_ms.median, reference.build_ms.median);
        let by = |tracer| {
            let (rays, others) = (tree.all_rays(tracer)?, reference.all_rays(tracer)?);
            let pays = Pays::of((ms, &rays), (reference_ms, &others));
            Some(RayGain { ns: rays.ns.median, less: others.ns.median - rays.ns.median, pays })
        };
        Some(Gain { tree, build: ms / reference_ms, rays: TreeTracer::ALL.map(by) })
    };
    records.iter().filter(|tree| !tree.is_reference()).filter_map(gain).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Spread;

    fn rays(ns: f64) -> RaysRecord {
        let ns = Spread { median: ns, min: 0.99 * ns, max: 1.01 * ns, runs: 3 };
        RaysRecord { rays: "all".into(), count: 1, ns, steps: 1.0, tests: 1.0 }
    }

    #[test]
    fn a_build_pays_when_its_rays_have_made_up_for_it() {
        let of = |build_ms, ns| Pays::of((build_ms, &rays(ns)), (100.0, &rays(500.0)));
        // 30 ms more, 100 ns a ray less: 300,000 rays.
        assert_eq!(of(130.0, 400.0), Pays::From(300_000.0));
        assert_eq!(of(90.0, 400.0), Pays::AtOnce);
        assert_eq!(of(130.0, 600.0), Pays::Never);
        assert_eq!(of(70.0, 600.0), Pays::UpTo(300_000.0));
        assert_eq!(of(130.0, 495.0), Pays::Unclear, "495 · 1.01 is beyond 500 · 0.99");
        assert_eq!(of(130.0, 400.0).in_words(), "from 300 k");
    }
}
