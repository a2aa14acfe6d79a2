//! Options of builders of BVHs on the host, and what a [`Spec`] says with them.

use super::options::{OPTIMISE, RADIUS, option};
use super::plan::BuilderPlan;
use super::{BuilderOption, Spec};
use crate::rays::kinds::RayKind;
use crate::rays::sample;
use crate::subjects::host::{HostPlan, TwinPlan};
use crate::subjects::taught::{CameraRays, HeuristicSpec, OcclusionRules};
use crate::{Error, Result};
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::trace::Query;
use hedgerow_host::bvh::binned::{BinnedAxes, BinnedOptions, Bins};
use hedgerow_host::bvh::heuristic::InteriorForm;
use hedgerow_host::bvh::{
    AacOptions, BonsaiOptions, HostBvhOptions, HostMethod, HostOptimise, IncrementalOptions, IncrementalOrder,
    Inefficiency, InsertionOptions, SbvhOptions, Termination, TopOptions,
};
use std::num::NonZeroU32;

pub(super) const TERMINATION: BuilderOption =
    option("termination", "sah, or off: leaves of one triangle, then collapsed");
pub(super) const TERMINATION_BY: BuilderOption = option(
    "termination",
    "sah, off: leaves of one triangle, then collapsed, or heuristic: a leaf where the heuristic finds it cheaper",
);
pub(super) const TERMINATION_FLAT: BuilderOption = option(
    "termination",
    "sah, off: leaves of one triangle, then collapsed, heuristic: a leaf where the heuristic finds it cheaper, or flat: also a leaf \
     where centroids are in a plane along the axes",
);
pub(super) const HEURISTIC: BuilderOption = option(
    "heuristic",
    "sah, interior, interior-hq, interior-fast, perspective, parallel, spherical, rdh, osah or srdh: what splits cost; leaves are made by sah",
);
pub(super) const HEURISTIC_OF_SPLITS: BuilderOption = option(
    "heuristic",
    "sah, interior, interior-hq, interior-fast, perspective, parallel, spherical, rdh, osah, osah-complete or srdh: what splits cost; \
     leaves are made by sah",
);
pub(super) const TEACHING_RAYS: BuilderOption = option(
    "rays",
    "all, or kinds of rays with + between: those that rdh, osah and srdh learn from; unless given primary+shadow+ao+diffuse1+diffuse2, \
     and shadow+ao for srdh",
);
pub(super) const SAMPLE: BuilderOption =
    option("sample", "a number of rays from 0 to 100000000 that rdh and srdh learn from, at most; 262144 unless given");
pub(super) const WEIGHT: BuilderOption =
    option("weight", "a number from 0 to 1: what cameras and rays weigh beside the area; 0.9 unless given");
pub(super) const LOOK_AHEAD: BuilderOption =
    option("look-ahead", "a number of splits of a node from 1 to 64, judged by temporary trees below; 1 unless given");
pub(super) const LEAF: BuilderOption = option("leaf", "a number of triangles from 1 to 255 that always are a leaf");
pub(super) const AXES: BuilderOption = option("axes", "longest or all");
pub(super) const HOST_BINS: BuilderOption =
    option("bins", "a number of bins from 2 to 256, or adaptive: 4 + 2 √n of n triangles");
pub(super) const SBVH_BINS: BuilderOption = option(
    "bins",
    "a number of bins from 2 to 128, for splits of either kind; 32 unless given, and 128 for osah-complete",
);
pub(super) const ALPHA: BuilderOption = option(
    "alpha",
    "a number from 0 to 1: triangles are split where sides overlap by this part of the scene's area; 1e-5 unless given",
);
pub(super) const BUDGET: BuilderOption =
    option("budget", "a number from 1 to 16: references at most, for each triangle; 2 unless given");
pub(super) const MINI: BuilderOption =
    option("mini", "a number of triangles at most in a mini tree, from 1 to 1000000");
pub(super) const PRUNE: BuilderOption =
    option("prune", "off, or a number from 0 to 100: mini trees of more than this part of their mean area are pruned");
pub(super) const DELTA: BuilderOption =
    option("delta", "a number of triangles from 2 to 1000: fewer are clustered without regard to the order of codes");
pub(super) const EPSILON: BuilderOption = option(
    "epsilon",
    "a number of tenths from 0 to 5: n triangles leave about n^(1/2 - epsilon) clusters to their parent",
);
pub(super) const THREADS: BuilderOption =
    option("threads", "a number of threads that build, from 1 to 1024; unless given, as --threads says");
pub(super) const HOST_OPTIMISE: BuilderOption = option(
    "optimise",
    "off; fast, medium, high or a number of passes of reinsertion; insertion, or by one measure alone insertion-sum, \
             insertion-min or insertion-area; top, or top-N: the best top over N subtrees, 2 to 64 and 32 unless given",
);
pub(super) const BATCH: BuilderOption =
    option("batch", "a number of triangles from 1 to 100000000 that are put in between two optimisations");
pub(super) const INSERT_ORDER: BuilderOption = option("order", "file or shuffled");
pub(super) const SEARCH: BuilderOption =
    option("search", "a number from 1 to 65536 of triangles that look for their places at once");

/// Threads that a builder may have of its own.
const MOST_THREADS: NonZeroU32 = NonZeroU32::new(1024).expect("not 0");

/// Subtrees that the best top is sought over where it is not told: 64 may take a minute.
const TOP_SUBTREES: u32 = 32;

impl Spec {
    /// Options `codes`, `collapse` and `optimise` of the twin of `lbvh`.
    pub(super) fn twin(&self) -> Result<BuilderPlan> {
        let (codes, collapse, reinsertion) = (self.codes()?, self.collapse()?, self.reinsertion_on_host()?);
        Ok(BuilderPlan::Host(HostPlan::Twin(TwinPlan { codes, reinsertion, collapse })))
    }

    /// Options `radius`, 25 where it was not given, and those of every builder on the host.
    pub(super) fn ploc_on_host(&self) -> Result<BuilderPlan> {
        let radius = self.within(&RADIUS, 1..=usize::MAX)?.unwrap_or(25);
        self.on_host(HostMethod::Ploc { radius })
    }

    /// Options `delta` and `epsilon`, where they differ from the preset's, and those of every builder on the host.
    pub(super) fn aac(&self, preset: AacOptions) -> Result<BuilderPlan> {
        let delta = self.within(&DELTA, 2..=AacOptions::MAX_DELTA)?.unwrap_or(preset.delta);
        let epsilon = self.within(&EPSILON, 0..=AacOptions::MAX_EPSILON)?.unwrap_or(preset.epsilon);
        self.on_host(HostMethod::Aac(AacOptions { delta, epsilon }))
    }

    /// Options `bins`, `leaf`, `axes` and `termination` of the binned builder, and those of every builder on the host.
    pub(super) fn binned(&self) -> Result<BuilderPlan> {
        let default = BinnedOptions::WALD;
        let bins = match self.option(HOST_BINS.key) {
            Some("adaptive") => Bins::Adaptive,
            Some(_) => self.within(&HOST_BINS, 2..=Bins::MOST)?.map_or(default.bins, Bins::Fixed),
            None => default.bins,
        };
        let axes = [("longest", BinnedAxes::Longest), ("all", BinnedAxes::All)];
        let options = BinnedOptions {
            bins,
            leaf: self.within(&LEAF, 1..=255)?.unwrap_or(default.leaf),
            axes: self.choice(&AXES, &axes)?.unwrap_or(default.axes),
            flat_leaves: self.option(TERMINATION_FLAT.key) == Some("flat"),
        };
        self.on_host(HostMethod::Binned(options))
    }

    /// Options `alpha`, `budget` and `bins`, and those of every builder on the host.
    pub(super) fn sbvh(&self) -> Result<BuilderPlan> {
        let paper = SbvhOptions::PAPER;
        let is_complete = self.option(HEURISTIC.key) == Some("osah-complete");
        let bins = if is_complete { SbvhOptions::MOST_BINS } else { paper.bins };
        self.on_host(HostMethod::Sbvh(SbvhOptions {
            alpha: self.within(&ALPHA, 0.0..=1.0)?.unwrap_or(paper.alpha),
            budget: self.within(&BUDGET, 1.0..=SbvhOptions::MOST_BUDGET)?.unwrap_or(paper.budget),
            bins: self.within(&SBVH_BINS, 2..=SbvhOptions::MOST_BINS)?.unwrap_or(bins),
        }))
    }

    /// Options `mini` and `prune`, where they differ from the preset's, and those of every builder on the host.
    pub(super) fn bonsai(&self, preset: BonsaiOptions) -> Result<BuilderPlan> {
        let mini = self.within(&MINI, 1..=1_000_000)?.unwrap_or(preset.mini);
        let prune = match self.option(PRUNE.key) {
            Some("off") => None,
            Some(_) => self.within(&PRUNE, 0.0..=100.0)?,
            None => preset.prune,
        };
        self.on_host(HostMethod::Bonsai(BonsaiOptions { mini, prune }))
    }

    /// Options `codes`, `termination`, `collapse`, `optimise` and `threads` of a builder of BVHs on the host.
    pub(super) fn on_host(&self, method: HostMethod) -> Result<BuilderPlan> {
        let all = [
            ("off", Termination::Single),
            ("sah", Termination::Sah),
            ("heuristic", Termination::Heuristic),
            ("flat", Termination::Sah),
        ];
        let (option, known) = match method {
            HostMethod::Binned(_) => (&TERMINATION_FLAT, &all[..]),
            HostMethod::Sweep | HostMethod::Sbvh(_) => (&TERMINATION_BY, &all[..3]),
            _ => (&TERMINATION, &all[..2]),
        };
        let termination = self.choice(option, known)?.unwrap_or(Termination::Sah);
        let optimise = self.optimise_on_host()?;
        let look_ahead = self.within(&LOOK_AHEAD, 1..=64)?.unwrap_or(1);
        let (codes, collapse) = (self.codes()?, self.collapse()?);
        let options = HostBvhOptions { codes, collapse, termination, optimise, method, look_ahead };
        options.check()?;
        let threads = self.within(&THREADS, NonZeroU32::MIN..=MOST_THREADS)?;
        Ok(BuilderPlan::Host(HostPlan::Built { options, threads }))
    }

    /// Options `heuristic`, `rays`, `sample` and `weight`.
    pub(super) fn heuristic(&self) -> Result<HeuristicSpec> {
        let given = self.option(TEACHING_RAYS.key).filter(|_| self.builder().takes(HEURISTIC.key));
        let heuristic = self.option(HEURISTIC.key);
        let kinds = match given {
            None if heuristic == Some("srdh") => sample::ANY_HIT.to_vec(),
            None => sample::FRAME.to_vec(),
            Some("all") => RayKind::ALL.to_vec(),
            Some(kinds) => {
                let of_name = |name: &str| name.parse().map_err(|_| self.wrong_value(&TEACHING_RAYS, kinds));
                kinds.split('+').map(of_name).collect::<Result<_>>()?
            }
        };
        let most = self.within(&SAMPLE, 0..=100_000_000)?.unwrap_or(sample::MOST);
        let weight = self.within(&WEIGHT, 0.0..=1.0)?.unwrap_or(0.9);
        let camera = |rays| HeuristicSpec::Camera { rays, weight };
        let seen = |kinds, rules| HeuristicSpec::Occlusion { kinds, weight, rules };
        Ok(match heuristic {
            None | Some("sah") => HeuristicSpec::Sah,
            Some("interior") => HeuristicSpec::Interior(InteriorForm::Exact),
            Some("interior-hq") => HeuristicSpec::Interior(InteriorForm::HighQuality),
            Some("interior-fast") => HeuristicSpec::Interior(InteriorForm::Fast),
            Some("perspective") => camera(CameraRays::Perspective),
            Some("parallel") => camera(CameraRays::Parallel),
            Some("spherical") => camera(CameraRays::Spherical),
            Some("rdh") => HeuristicSpec::Distribution { kinds, most, weight },
            Some("osah") => seen(kinds, OcclusionRules::Plain),
            Some("osah-complete") if self.builder().splits_triangles() => seen(kinds, OcclusionRules::Complete),
            Some("osah-complete") => {
                let what = "osah-complete divides triangles; take sbvh:heuristic=osah-complete, or heuristic=osah";
                return Err(Error::Argument(format!("builder {self}: {what}")));
            }
            Some("srdh") if kinds.iter().all(|kind| kind.query() == Query::AnyHit) => {
                HeuristicSpec::Shadow { kinds, most, weight }
            }
            Some("srdh") => {
                let what = "srdh learns from rays that end at any hit; take rays=shadow, ao or shadow+ao";
                return Err(Error::Argument(format!("builder {self}: {what}")));
            }
            Some(other) => return Err(self.wrong_value(&HEURISTIC, other)),
        })
    }

    /// Options `batch`, `order` and `search`, and those of every builder on the host.
    pub(super) fn incremental(&self) -> Result<BuilderPlan> {
        let paper = IncrementalOptions::PAPER;
        let orders = [("file", IncrementalOrder::File), ("shuffled", IncrementalOrder::Shuffled)];
        self.on_host(HostMethod::Incremental(IncrementalOptions {
            batch: self.within(&BATCH, 1..=100_000_000)?.unwrap_or(paper.batch),
            order: self.choice(&INSERT_ORDER, &orders)?.unwrap_or(paper.order),
            search: self.within(&SEARCH, 1..=IncrementalOptions::MOST_SEARCHES)?.unwrap_or(paper.search),
            ..paper
        }))
    }

    /// A builder on the host with all options chosen but `collapse` and `threads`.
    pub(super) fn preset(&self, options: HostBvhOptions) -> Result<BuilderPlan> {
        let options = HostBvhOptions { collapse: self.collapse()?, ..options };
        let threads = self.within(&THREADS, NonZeroU32::MIN..=MOST_THREADS)?;
        Ok(BuilderPlan::Host(HostPlan::Built { options, threads }))
    }

    /// Option `optimise` of a builder of BVHs on the host that may also insert.
    fn optimise_on_host(&self) -> Result<HostOptimise> {
        let measure = match self.option(HOST_OPTIMISE.key) {
            Some("insertion") => Inefficiency::Combined,
            Some("insertion-sum") => Inefficiency::Sum,
            Some("insertion-min") => Inefficiency::Min,
            Some("insertion-area") => Inefficiency::Area,
            Some(value) if value.starts_with("insertion") => return Err(self.wrong_value(&HOST_OPTIMISE, value)),
            Some("top") => return Ok(HostOptimise::Top(TopOptions { subtrees: TOP_SUBTREES })),
            Some(value) if value.starts_with("top-") => {
                let subtrees = value["top-".len()..].parse().ok().filter(|subtrees| (2..=64).contains(subtrees));
                let subtrees = subtrees.ok_or_else(|| self.wrong_value(&HOST_OPTIMISE, value))?;
                return Ok(HostOptimise::Top(TopOptions { subtrees }));
            }
            _ => return Ok(self.reinsertion_on_host()?.map_or(HostOptimise::Off, HostOptimise::Reinsertion)),
        };
        Ok(HostOptimise::Insertion(InsertionOptions::by(measure)))
    }

    /// Option `optimise` of a builder on the host, which takes no time for it.
    fn reinsertion_on_host(&self) -> Result<Option<ReinsertionOptions>> {
        if self.option(OPTIMISE.key).is_some_and(|value| value.ends_with("ms")) {
            let what = "on the host rounds are not timed; take fast, medium, high or a number of passes";
            return Err(Error::Argument(format!("builder {self}: {}: {what}", OPTIMISE.key)));
        }
        self.reinsertion()
    }
}
