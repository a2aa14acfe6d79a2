//! Splits that look ahead: of the best few by surface area, the one whose sides have the cheapest temporary trees.
//!
//! Wodniok and Goesele 2017, "Construction of Bounding Volume Hierarchies with SAH Cost Approximation on Temporary Subtrees". A
//! greedy split costs its sides as if they were leaves. Here a quick tree is built over either side, its cost decides, and it is
//! thrown away. Their builder does so for every plane between bins; here a few of the cheapest are judged, and a temporary tree
//! is given up as soon as it costs more than the best so far. Where that happens depends on costs alone, so the tree is the same for
//! any number of threads.

use super::binned::trial::Trial;
use super::bounds::Item;
use super::heuristic::split_cost::{First, Side, SplitCost};
use super::top_down::{Candidates, LeafRule};
use hedgerow::{Error, Result};

/// The most splits of a node that may be judged.
pub(super) const MOST: u32 = 64;
/// Nodes of fewer items are split as ever.
const LEAST: usize = 32;

/// Whether that many splits can be judged.
pub(super) fn check(splits: u32) -> Result<()> {
    let error = || Error::Argument(format!("a build cannot look ahead at {splits} splits; take 1 to {MOST}"));
    (1..=MOST).contains(&splits).then_some(()).ok_or_else(error)
}

/// Splits that can be put in order, and tried out.
pub(super) trait Ranked: Candidates {
    /// At most `most` splits by surface area, the cheapest first; none if the part is a leaf.
    fn cheapest(&self, part: &mut Self::Part<'_>, depth: u32, most: usize) -> Vec<Self::Split>;

    /// The items on either side.
    fn copies(&self, part: &Self::Part<'_>, split: &Self::Split) -> [Vec<Item>; 2];
}

/// The splits of `candidates`, chosen by what lies below.
pub(super) struct LookAhead<'a, C> {
    candidates: &'a C,
    trial: Trial<'a>,
    most: usize,
}

impl<'a, C: Ranked> LookAhead<'a, C> {
    /// Judges at most `most` splits of a node.
    pub fn new(candidates: &'a C, rule: LeafRule<'a>, most: u32) -> LookAhead<'a, C> {
        LookAhead { candidates, trial: Trial::new(rule.costs), most: most as usize }
    }

    /// The split whose temporary trees cost least, the first of equal ones.
    fn judged(&self, part: &C::Part<'_>, splits: Vec<C::Split>) -> Option<C::Split> {
        if splits.len() < 2 {
            return splits.into_iter().next();
        }
        let mut best = (f32::INFINITY, None);
        for split in splits {
            if let Some(excess) = self.excess(self.candidates.copies(part, &split), best.0)
                && (excess < best.0 || best.1.is_none())
            {
                best = (excess, Some(split));
            }
        }
        best.1
    }

    fn excess(&self, [left, right]: [Vec<Item>; 2], limit: f32) -> Option<f32> {
        let of_left = self.trial.excess(left, limit)?;
        Some(of_left + self.trial.excess(right, limit - of_left)?)
    }
}

impl<C: Ranked> Candidates for LookAhead<'_, C> {
    type Part<'a> = C::Part<'a>;
    type Split = C::Split;

    fn count(&self, part: &C::Part<'_>) -> usize {
        self.candidates.count(part)
    }

    fn best<H: SplitCost>(&self, by: &H, here: &H::Here, part: &mut C::Part<'_>, depth: u32) -> Option<C::Split> {
        if self.count(part) < LEAST {
            return self.candidates.best(by, here, part, depth);
        }
        let splits = self.candidates.cheapest(part, depth, self.most);
        self.judged(part, splits)
    }

    fn sides(&self, by: &impl SplitCost, part: &C::Part<'_>, split: Option<&C::Split>) -> [Side; 2] {
        self.candidates.sides(by, part, split)
    }

    fn members(&self, part: &C::Part<'_>, split: &C::Split, each: &mut dyn FnMut(usize, u32)) {
        self.candidates.members(part, split, each);
    }

    fn divide<'a>(&self, part: C::Part<'a>, split: C::Split, first: First) -> [C::Part<'a>; 2] {
        self.candidates.divide(part, split, first)
    }

    fn end(&self, part: C::Part<'_>) {
        self.candidates.end(part);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bvh::binned::BinnedAxes;
    use crate::bvh::bounds::tests::boxes as items;
    use crate::bvh::heuristic::InteriorForm;
    use crate::bvh::heuristic::split_cost::Area;
    use crate::bvh::optimal::tests::random_triangles;
    use crate::bvh::{
        ALONE, AacOptions, BinnedOptions, Heuristic, HostBvhOptions, HostMethod, Termination, build_aabbs,
        build_aabbs_by,
    };
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::geometry::Aabb;

    const METHODS: [HostMethod; 3] = [
        HostMethod::Sweep,
        HostMethod::Binned(BinnedOptions::WALD),
        HostMethod::Binned(BinnedOptions { axes: BinnedAxes::All, ..BinnedOptions::WALD }),
    ];

    fn boxes(count: u32) -> Vec<Aabb> {
        items(count).iter().map(|item| item.bounds().aabb()).collect()
    }

    #[test]
    fn one_split_is_the_best_one_whatever_its_trees_cost() {
        // By the path of those that look ahead, which a build with one split does not take.
        for (count, single) in [(40, false), (700, true), (5000, false)] {
            let rule = LeafRule { costs: &Collapse::SAH, single };
            let plain = crate::bvh::sweep::build(&Area, &items(count), rule);
            assert!(crate::bvh::sweep::build_ahead(&items(count), rule, 1) == plain, "{count} boxes by sweep");
            for axes in [BinnedAxes::Longest, BinnedAxes::All] {
                let options = BinnedOptions { axes, ..BinnedOptions::WALD };
                let plain = crate::bvh::binned::build(&Area, items(count), 1.0, rule, &options);
                let ahead = crate::bvh::binned::build_ahead(items(count), 1.0, rule, &options, 1);
                assert!(ahead == plain, "{count} boxes, {axes:?}");
            }
        }
    }

    #[test]
    fn trees_that_look_ahead_are_valid_and_the_same_on_any_number_of_threads() {
        let boxes = boxes(2 * ALONE as u32);
        for method in METHODS {
            for termination in [Termination::Sah, Termination::Single] {
                let options = HostBvhOptions { look_ahead: 4, termination, ..HostBvhOptions::of(method) };
                let bytes_on = |threads| {
                    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                    let tree = pool.install(|| build_aabbs(&boxes, &options)).expect("sound options").tree;
                    tree.validate().unwrap_or_else(|error| panic!("{options:?}: {error}"));
                    tree.to_bytes()
                };
                let one = bytes_on(1);
                assert!(one == bytes_on(3), "{options:?}");
                let plain = build_aabbs(&boxes, &HostBvhOptions { look_ahead: 1, ..options }).expect("sound options");
                assert!(one != plain.tree.to_bytes(), "{options:?}");
            }
        }
    }

    #[test]
    fn trees_that_look_ahead_cost_less_in_the_mean() {
        for method in METHODS {
            let cost = |look_ahead, boxes: &[Aabb]| {
                let options = HostBvhOptions { look_ahead, ..HostBvhOptions::of(method) };
                build_aabbs(boxes, &options).expect("sound options").tree.header.cost
            };
            let ratio = |seed| {
                let boxes = random_triangles(400, seed);
                cost(8, &boxes) / cost(1, &boxes)
            };
            let mean = (0..8).map(ratio).sum::<f32>() / 8.0;
            assert!(mean < 1.0, "{method:?}: {mean}");
        }
    }

    #[test]
    fn what_cannot_look_ahead_is_named() {
        let says = |heuristic: Heuristic<'_>, options: HostBvhOptions| {
            build_aabbs_by(&heuristic, &boxes(3), &options).expect_err("cannot look ahead").to_string()
        };
        let of = |method, look_ahead| HostBvhOptions { look_ahead, ..HostBvhOptions::of(method) };
        assert!(says(Heuristic::Sah, of(HostMethod::Sweep, 0)).contains("take 1 to 64"));
        assert!(says(Heuristic::Sah, of(HostMethod::Sweep, 65)).contains("at 65 splits"));
        let bottom_up = HostMethod::Aac(AacOptions::FAST);
        assert!(says(Heuristic::Sah, of(bottom_up, 2)).contains("take Sweep or Binned"));
        let interior = Heuristic::Interior(InteriorForm::Fast);
        assert!(says(interior, of(HostMethod::Sweep, 2)).contains("take Heuristic::Sah, or 1 split"));
    }

    #[test]
    fn what_cannot_be_told_apart_has_a_tree() {
        for boxes in
            [vec![], vec![Aabb { lo: [1.0; 3], hi: [1.0; 3] }; 300], vec![Aabb { lo: [0.0; 3], hi: [2.0; 3] }; 90]]
        {
            for method in METHODS {
                let options = HostBvhOptions { look_ahead: 8, ..HostBvhOptions::of(method) };
                build_aabbs(&boxes, &options).expect("sound options").tree.validate().expect("valid");
            }
        }
    }
}
