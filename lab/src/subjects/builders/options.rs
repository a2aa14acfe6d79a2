//! What options there are, and what a [`Spec`] says with them.

use super::plan::{BuilderPlan, DevicePlan, KdSpec};
use super::table::{BUILDERS, BuilderEntry};
use super::{BuilderOption, Spec};
use crate::rays::kinds::RayKind;
use crate::rays::sample;
use crate::subjects::auto;
use crate::subjects::host::{HostPlan, TwinPlan};
use crate::subjects::retraced::TreeTracer;
use crate::subjects::taught::{CameraRays, HeuristicSpec};
use crate::{Error, Result};
use hedgerow::bvh::builder::{BuildOptions, Method, Schedule, Treelets, Window};
use hedgerow::bvh::child_order::ChildOrder;
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::reinsertion::ReinsertionOptions;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::split::SplitOptions;
use hedgerow::bvh::wide::Form;
use hedgerow::kdtree::builder::{KdOptions, KdSchedule};
use hedgerow::kdtree::termination::Costs;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::wide::Order;
use hedgerow_host::bvh::binned::{BinnedAxes, BinnedOptions, Bins};
use hedgerow_host::bvh::heuristic::InteriorForm;
use hedgerow_host::bvh::{
    AacOptions, BonsaiOptions, HostBvhOptions, HostMethod, HostOptimise, IncrementalOptions, IncrementalOrder,
    Inefficiency, InsertionOptions, SbvhOptions, Termination, TopOptions,
};
use hedgerow_host::kdtree::{HostKdOptions, Planes};
use std::num::NonZeroU32;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

const fn option(key: &'static str, values: &'static str) -> BuilderOption {
    BuilderOption { key, values }
}

pub(super) const CODES: BuilderOption = option(
    "codes",
    "mc30, mc63, emc64sort, emc64var, emc64var-nosize, mip6, mip9, mip12 or binQaA (Q 2, 4 or 6, A 0 to 9; ~N behind: the \
             stretch factor weighs 1/N), with +concise, +centroid, +robust or /BITS behind",
);
pub(super) const COLLAPSE: BuilderOption = option("collapse", "sah or off");
pub(super) const RAYS: BuilderOption = option("rays", "rays that are traced between two builds, 1e7 unless given");
pub(super) const WIDTH: BuilderOption = option("width", "2, 4, 8 or 8q (quantised)");
pub(super) const ORDER: BuilderOption = option("order", "distance or octant (of width=8q)");
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
    "sah, interior, interior-hq, interior-fast, perspective, parallel, spherical, rdh or osah: what splits cost; leaves are made by sah",
);
pub(super) const TEACHING_RAYS: BuilderOption = option(
    "rays",
    "all, or kinds of rays with + between: those that rdh and osah learn from; primary+shadow+ao+diffuse1+diffuse2 unless given",
);
pub(super) const SAMPLE: BuilderOption =
    option("sample", "a number of rays from 0 to 100000000 that rdh learns from, at most; 262144 unless given");
pub(super) const WEIGHT: BuilderOption =
    option("weight", "a number from 0 to 1: what cameras and rays weigh beside the area; 0.9 unless given");
pub(super) const LEAF: BuilderOption = option("leaf", "a number of triangles from 1 to 255 that always are a leaf");
pub(super) const AXES: BuilderOption = option("axes", "longest or all");
pub(super) const HOST_BINS: BuilderOption =
    option("bins", "a number of bins from 2 to 256, or adaptive: 4 + 2 √n of n triangles");
pub(super) const SBVH_BINS: BuilderOption = option("bins", "a number of bins from 2 to 128, for splits of either kind");
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
pub(super) const SCHEDULE: BuilderOption = option("schedule", "chain, persistent or workgroup");
pub(super) const KD_SCHEDULE: BuilderOption = option("schedule", "chain or persistent");
pub(super) const SPLIT: BuilderOption = option(
    "split",
    "a number from 0 to 1: splits of large triangles at most, as a part of all; with /N behind: of each at most N",
);
pub(super) const OPTIMISE: BuilderOption = option(
    "optimise",
    "off, fast, medium, high, a number of passes of reinsertion, or on the device a time for it as in 20ms",
);
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
pub(super) const BITS: BuilderOption = option("bits", "a number of bits that the codes of a treelet share");
pub(super) const TREELET: BuilderOption = option("treelet", "a number of primitives at most, from 1");
pub(super) const WINDOW: BuilderOption = option("window", "an even number of clusters from 4 to 64");
pub(super) const RADIUS: BuilderOption = option("radius", "a number of neighbours on either side, from 1");
pub(super) const BINS: BuilderOption = option("bins", "a number of bins along each axis, from 2 to 1024");
pub(super) const EXACT: BuilderOption =
    option("exact", "references of a cell that is split exactly, at most 64 of them, 0 for none; 32 unless given");
pub(super) const WORKGROUPS: BuilderOption =
    option("workgroups", "a number of workgroups of the persistent schedule, from 1");
pub(super) const KT: BuilderOption = option("kt", "a cost of a traversal step, from 0.001 to 1000; 3 unless given");
pub(super) const KI: BuilderOption = option("ki", "a cost of a triangle test, from 0.001 to 1000; 2 unless given");

pub(super) const TRAVERSAL: BuilderOption = option(
    "traversal",
    "stack, restart, push-down, short-N or short-N-push-down, N being how much a short stack holds; unless given stack on the host and short-4 on the device",
);

pub(super) const TRACE: BuilderOption = option("trace", "host or device: where rays are traced; host unless given");
pub(super) const ANY_HIT: BuilderOption = option(
    "any-hit",
    "near, or an order of children, the first of which our tracer looks into first for rays that end at any hit: rtsah, sato, \
     prim-sato or opaque",
);
pub(super) const TRACE_TREE: BuilderOption = option(
    "trace",
    "host or device: where our tracer takes rays through the tree; unless given, its own does on the host",
);

/// Threads that a builder may have of its own.
const MOST_THREADS: NonZeroU32 = NonZeroU32::new(1024).expect("not 0");

/// Subtrees that the best top is sought over where it is not told: 64 may take a minute.
const TOP_SUBTREES: u32 = 32;

/// Of `ploc` where it is not told: what drivers take.
const PLOC_RADIUS: u32 = 16;

impl Spec {
    /// Option `schedule`.
    fn schedule(&self) -> Result<Option<Schedule>> {
        let all =
            [("chain", Schedule::Chain), ("persistent", Schedule::PERSISTENT), ("workgroup", Schedule::Workgroup)];
        self.choice(&SCHEDULE, &all)
    }

    /// Options `codes`, `split`, `optimise`, `collapse`, `schedule`, `width` and `order` of a builder on the device.
    pub(super) fn on_device(&self, method: Method) -> Result<BuilderPlan> {
        method.check()?;
        let schedule = self.schedule()?;
        let (codes, split) = (self.codes()?, self.split()?);
        let (optimise, collapse) = (self.reinsertion()?, self.collapse()?);
        let options = BuildOptions { method, codes, split, optimise, collapse, schedule, ..BuildOptions::DEFAULT };
        let (form, order) = self.form_and_order()?;
        let (any_hit, time_to_optimise) = (self.any_hit()?, self.time_to_optimise()?);
        if form.is_some() && any_hit.is_some() {
            let what = "orders of children are for nodes of two; take width=2, or any-hit=near";
            return Err(Error::Argument(format!("builder {self}: {what}")));
        }
        Ok(BuilderPlan::Device(DevicePlan { options, form, order, any_hit, time_to_optimise }))
    }

    /// Option `any-hit`: the order of children, if there is one.
    pub(super) fn any_hit(&self) -> Result<Option<ChildOrder>> {
        let all = [
            ("near", None),
            ("rtsah", Some(ChildOrder::Cheaper)),
            ("sato", Some(ChildOrder::LargerBox)),
            ("prim-sato", Some(ChildOrder::LargerPrimitives)),
            ("opaque", Some(ChildOrder::MoreHitsForItsCost)),
        ];
        Ok(self.choice(&ANY_HIT, &all)?.flatten())
    }

    /// Those of every builder on the device, and `bits` and `treelet`.
    pub(super) fn hlbvh(&self) -> Result<BuilderPlan> {
        let bits = self.parsed(&BITS)?;
        let primitives = self.parsed(&TREELET)?.unwrap_or(Treelets::DEFAULT.primitives);
        self.on_device(Method::Hlbvh(Treelets { bits, primitives }))
    }

    /// Those of every builder on the device, and `radius`.
    pub(super) fn ploc(&self) -> Result<BuilderPlan> {
        self.on_device(Method::Ploc { radius: self.parsed(&RADIUS)?.unwrap_or(PLOC_RADIUS) })
    }

    /// Those of every builder on the device, and `window` and `radius`.
    pub(super) fn hploc(&self) -> Result<BuilderPlan> {
        let size = self.parsed(&WINDOW)?.unwrap_or(Window::DEFAULT.size);
        let radius = self.parsed(&RADIUS)?.unwrap_or(Window::DEFAULT.radius);
        self.on_device(Method::Hploc(Window { size, radius }))
    }

    /// Options `width`, of a wide tree, and `order`; no width where it is 2 or was not given.
    fn form_and_order(&self) -> Result<(Option<Form>, Option<Order>)> {
        let all = [("2", None), ("4", Some(Form::Four)), ("8", Some(Form::Eight)), ("8q", Some(Form::EightQuantised))];
        let form = self.choice(&WIDTH, &all)?.flatten();
        let order = match self.option(ORDER.key) {
            None => None,
            Some("distance") if form.is_some() => Some(Order::Distance),
            Some("octant") if form == Some(Form::EightQuantised) => Some(Order::Octant),
            Some(other) => return Err(self.wrong_value(&ORDER, other)),
        };
        Ok((form, order))
    }

    /// Option `rays`.
    pub(super) fn rays(&self) -> Result<f64> {
        auto::rays_of(self.option(RAYS.key))
    }

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
        self.on_host(HostMethod::Sbvh(SbvhOptions {
            alpha: self.within(&ALPHA, 0.0..=1.0)?.unwrap_or(paper.alpha),
            budget: self.within(&BUDGET, 1.0..=SbvhOptions::MOST_BUDGET)?.unwrap_or(paper.budget),
            bins: self.within(&SBVH_BINS, 2..=SbvhOptions::MOST_BINS)?.unwrap_or(paper.bins),
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
            HostMethod::Sweep => (&TERMINATION_BY, &all[..3]),
            _ => (&TERMINATION, &all[..2]),
        };
        let termination = self.choice(option, known)?.unwrap_or(Termination::Sah);
        let optimise = self.optimise_on_host()?;
        let options =
            HostBvhOptions { codes: self.codes()?, collapse: self.collapse()?, termination, optimise, method };
        options.check()?;
        let threads = self.within(&THREADS, NonZeroU32::MIN..=MOST_THREADS)?;
        Ok(BuilderPlan::Host(HostPlan::Built { options, threads }))
    }

    /// Options `heuristic`, `rays`, `sample` and `weight`.
    pub(super) fn heuristic(&self) -> Result<HeuristicSpec> {
        let kinds = match self.option(TEACHING_RAYS.key).filter(|_| self.builder().takes(HEURISTIC.key)) {
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
        Ok(match self.option(HEURISTIC.key) {
            None | Some("sah") => HeuristicSpec::Sah,
            Some("interior") => HeuristicSpec::Interior(InteriorForm::Exact),
            Some("interior-hq") => HeuristicSpec::Interior(InteriorForm::HighQuality),
            Some("interior-fast") => HeuristicSpec::Interior(InteriorForm::Fast),
            Some("perspective") => camera(CameraRays::Perspective),
            Some("parallel") => camera(CameraRays::Parallel),
            Some("spherical") => camera(CameraRays::Spherical),
            Some("rdh") => HeuristicSpec::Distribution { kinds, most, weight },
            Some("osah") => HeuristicSpec::Occlusion { kinds, weight },
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

    /// Options `kt`, `ki`, `traversal` and `trace` of a builder of kd-trees on the host.
    pub(super) fn kd_on_host(&self, planes: Planes) -> Result<BuilderPlan> {
        let options = self.kd_options(planes)?;
        let traces_on_device = self.choice(&TRACE, &[("host", false), ("device", true)])?.unwrap_or(false);
        Ok(BuilderPlan::Kd(KdSpec::Host { options, traversal: self.traversal(traces_on_device)?, traces_on_device }))
    }

    /// Where our tracer takes rays through a BVH of the host, if that was given or children have an order.
    pub(super) fn tracer(&self) -> Result<Option<TreeTracer>> {
        if !self.builder().builds_bvh_on_host() {
            return Ok(None);
        }
        let tracer = self.choice(&TRACE_TREE, &[("host", TreeTracer::Host), ("device", TreeTracer::Device)])?;
        // An order of children is for our tracer.
        Ok(tracer.or(self.any_hit()?.map(|_| TreeTracer::Host)))
    }

    /// Those of every builder of kd-trees on the host, and `bins` and `exact`.
    pub(super) fn kd_mixed_on_host(&self) -> Result<BuilderPlan> {
        let bins = self.parsed(&BINS)?.unwrap_or(KdOptions::DEFAULT.bins);
        let exact = self.parsed(&EXACT)?.unwrap_or(KdOptions::DEFAULT.exact);
        if exact > Planes::MAX_EXACT {
            return Err(self.wrong_value(&EXACT, self.option(EXACT.key).unwrap_or_default()));
        }
        self.kd_on_host(Planes::Mixed { bins, exact })
    }

    /// Options `bins`, `exact`, `kt`, `ki`, `schedule`, `workgroups` and `traversal`.
    pub(super) fn kd_on_device(&self) -> Result<BuilderPlan> {
        let default = KdOptions::DEFAULT;
        let costs = self.kd_options(Planes::Exact)?.costs;
        let workgroups = self.parsed(&WORKGROUPS)?;
        let bins = self.parsed(&BINS)?.unwrap_or(default.bins);
        let exact = self.parsed(&EXACT)?.unwrap_or(default.exact);
        let schedules = [("chain", KdSchedule::Chain), ("persistent", KdSchedule::Persistent)];
        let schedule = self.choice(&KD_SCHEDULE, &schedules)?;
        let options = KdOptions { bins, exact, costs, schedule, workgroups, ..default };
        options.check()?;
        Ok(BuilderPlan::Kd(KdSpec::Device { options, traversal: self.traversal(true)? }))
    }

    /// Option `traversal`; where it was not given, what is fastest where rays are traced (docs/notes/kdtree.md).
    fn traversal(&self, on_device: bool) -> Result<Traversal> {
        let fastest = if on_device { Traversal::short_stack(4) } else { Traversal::STACK };
        Ok(self.parsed(&TRAVERSAL)?.unwrap_or(fastest))
    }

    fn kd_options(&self, planes: Planes) -> Result<HostKdOptions> {
        let c_t = self.parsed(&KT)?.unwrap_or(Costs::DEFAULT.c_t);
        let c_i = self.parsed(&KI)?.unwrap_or(Costs::DEFAULT.c_i);
        let costs = Costs { c_t, c_i };
        let options = HostKdOptions { planes, costs };
        let wrong = [(BINS, options.check_planes()), (KT, Costs::check(costs.c_t)), (KI, Costs::check(costs.c_i))];
        match wrong.iter().find(|(_, is_right)| !is_right) {
            Some((option, _)) => Err(self.wrong_value(option, self.option(option.key).unwrap_or_default())),
            None => Ok(options),
        }
    }

    /// Option `codes`.
    pub(super) fn codes(&self) -> Result<Option<Codes>> {
        Ok(self.option(CODES.key).map(str::parse).transpose()?)
    }

    /// Option `collapse`; `sah` where it was not given.
    pub(super) fn collapse(&self) -> Result<Collapse> {
        let wanted = self.choice(&COLLAPSE, &[("sah", Collapse::SAH), ("off", Collapse::OFF)])?;
        Ok(wanted.unwrap_or(Collapse::SAH))
    }

    /// Option `split`; `None` where it was not given or is 0.
    fn split(&self) -> Result<Option<SplitOptions>> {
        let Some(value) = self.option(SPLIT.key) else { return Ok(None) };
        let (fraction, most) = value.split_once('/').unwrap_or((value, ""));
        let most = if most.is_empty() { Ok(SplitOptions::DEFAULT.most) } else { most.parse() };
        let (Ok(fraction), Ok(most)) = (fraction.parse(), most) else { return Err(self.wrong_value(&SPLIT, value)) };
        let options = SplitOptions { fraction, most };
        options.check().map_err(|_| self.wrong_value(&SPLIT, value))?;
        Ok((fraction > 0.0).then_some(options))
    }

    /// Option `optimise` where it is a time.
    fn time_to_optimise(&self) -> Result<Option<Duration>> {
        let value = self.option(OPTIMISE.key).unwrap_or_default();
        let Some(milliseconds) = value.strip_suffix("ms") else { return Ok(None) };
        let time = milliseconds.parse().ok().and_then(|ms: f64| Duration::try_from_secs_f64(1e-3 * ms).ok());
        time.map(Some).ok_or_else(|| self.wrong_value(&OPTIMISE, value))
    }

    /// Option `optimise`; off where it was not given. For a time, the pass that tells how many there is time for.
    fn reinsertion(&self) -> Result<Option<ReinsertionOptions>> {
        Ok(match self.option(OPTIMISE.key) {
            None | Some("off") => None,
            Some("fast") => Some(ReinsertionOptions::FAST),
            Some("medium") => Some(ReinsertionOptions::MEDIUM),
            Some("high") => Some(ReinsertionOptions::HIGH),
            Some(value) if value.starts_with("insertion") => {
                let inserts = |entry: &&BuilderEntry| entry.options.iter().any(|o| o.values == HOST_OPTIMISE.values);
                let names: Vec<&str> = BUILDERS.iter().filter(inserts).map(|entry| entry.name).collect();
                let what = format!("{}={value} is for builders on the CPU: {}", OPTIMISE.key, names.join(", "));
                return Err(Error::Argument(format!("builder {self}: {what}; use {} here", OPTIMISE.values)));
            }
            Some(_) if self.time_to_optimise()?.is_some() => Some(ReinsertionOptions::FAST),
            Some(_) => self.parsed(&OPTIMISE)?.map(ReinsertionOptions::of_passes),
        })
    }

    /// What an option chooses by name, if it was given.
    fn choice<T: Copy>(&self, option: &BuilderOption, all: &[(&str, T)]) -> Result<Option<T>> {
        let Some(value) = self.option(option.key) else { return Ok(None) };
        let chosen = all.iter().find(|(name, _)| *name == value).map(|(_, chosen)| *chosen);
        chosen.map(Some).ok_or_else(|| self.wrong_value(option, value))
    }

    /// The value of an option that is parsed as it is, such as a number, if it was given.
    pub(super) fn parsed<T: FromStr>(&self, option: &BuilderOption) -> Result<Option<T>> {
        let Some(value) = self.option(option.key) else { return Ok(None) };
        value.parse().map(Some).map_err(|_| self.wrong_value(option, value))
    }

    /// The same of a number within these bounds.
    fn within<T: FromStr + PartialOrd>(&self, option: &BuilderOption, bounds: RangeInclusive<T>) -> Result<Option<T>> {
        let number = self.parsed(option)?;
        let is_within = number.as_ref().is_none_or(|number| bounds.contains(number));
        if is_within { Ok(number) } else { Err(self.wrong_value(option, self.option(option.key).unwrap_or_default())) }
    }

    fn wrong_value(&self, option: &BuilderOption, value: &str) -> Error {
        Error::Argument(format!("builder {self}: {}={value} is unknown; use {}", option.key, option.values))
    }
}
