//! What options there are, and what a [`Spec`] says with them.

use super::host_options::{HEURISTIC, HOST_OPTIMISE};
use super::plan::{BuilderPlan, DevicePlan, KdSpec};
use super::table::{BUILDERS, BuilderEntry};
use super::{BuilderOption, Spec};
use crate::subjects::any_hit::AnyHitSpec;
use crate::subjects::auto;
use crate::subjects::queries::Queries;
use crate::subjects::retraced::TreeTracer;
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
use hedgerow_host::kdtree::{HostKdOptions, Planes};
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

pub(super) const fn option(key: &'static str, values: &'static str) -> BuilderOption {
    BuilderOption { key, values }
}

pub(super) const CODES: BuilderOption = option(
    "codes",
    "mc30, mc63, emc64sort, emc64var, emc64var-size4, emc64var-extents, emc64var-nosize, mip6, mip9, mip12 or binQaA (Q 2, 4 or \
             6, A 0 to 9; ~N behind: the stretch factor weighs 1/N, N to 2048), with +concise, +centroid, +robust, +apart or /BITS behind",
);
pub(super) const COLLAPSE: BuilderOption = option("collapse", "sah or off");
pub(super) const RAYS: BuilderOption = option("rays", "rays that are traced between two builds, 1e7 unless given");
pub(super) const WIDTH: BuilderOption = option("width", "2, 4, 8 or 8q (quantised)");
pub(super) const ORDER: BuilderOption = option("order", "distance or octant (of width=8q)");
pub(super) const OPEN: BuilderOption =
    option("open", "area, or rays (of width=4, 8 or 8q): what wide nodes cost least by");
pub(super) const SCHEDULE: BuilderOption = option("schedule", "chain, persistent or workgroup");
pub(super) const KD_SCHEDULE: BuilderOption = option("schedule", "chain, persistent or across-levels");
pub(super) const SPLIT: BuilderOption = option(
    "split",
    "a number from 0 to 1: splits of large triangles at most, as a part of all; with /N behind: of each at most N",
);
pub(super) const PAIRS: BuilderOption = option(
    "pairs",
    "off or on: whether two triangles that share an edge may be one leaf from the start; on unless given, of hploc where leaves are collapsed",
);
pub(super) const OPTIMISE: BuilderOption = option(
    "optimise",
    "off, fast, medium, high, a number of passes of reinsertion such as 0.5, or on the device a time for it as in 20ms",
);
pub(super) const BY: BuilderOption = option(
    "by",
    "area, or rays (with optimise=): reinsertion moves subtrees of the finished tree to where few rays of the scene go",
);
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
     prim-sato, opaque, rays (learned from rays of the scene), auto: the one with the least work for those rays, or built: as a heuristic \
     on the host has them, which is what srdh does unless told otherwise",
);
pub(super) const WALK: BuilderOption = option(
    "walk",
    "tracer, query or turns: rays go through a tree with nodes of two, or quantised ones of eight, by queries, as in an engine's shader, one for \
     each invocation or many in turn",
);
pub(super) const TRACE_TREE: BuilderOption = option(
    "trace",
    "host or device: where our tracer takes rays through the tree; unless given, its own does on the host",
);

/// Of `ploc` where it is not told: what drivers take.
const PLOC_RADIUS: u32 = 16;

impl Spec {
    /// Option `schedule`.
    fn schedule(&self) -> Result<Option<Schedule>> {
        let all =
            [("chain", Schedule::Chain), ("persistent", Schedule::PERSISTENT), ("workgroup", Schedule::Workgroup)];
        self.choice(&SCHEDULE, &all)
    }

    /// Options `codes`, `split`, `pairs`, `optimise`, `by`, `collapse`, `schedule`, `width`, `order`, `any-hit` and `walk` of a builder
    /// on the device.
    pub(super) fn on_device(&self, method: Method) -> Result<BuilderPlan> {
        method.check()?;
        let schedule = self.schedule()?;
        let (codes, split) = (self.codes()?, self.split()?);
        let (form, order) = self.form_and_order()?;
        let is_of_eight = matches!(form, Some(Form::Eight | Form::EightQuantised));
        let (optimise, collapse) = (self.reinsertion()?, self.collapse()?);
        let collapse = if is_of_eight && collapse.enabled { Collapse::WIDE } else { collapse };
        let unpaired = BuildOptions { method, codes, split, optimise, collapse, schedule, ..BuildOptions::DEFAULT };
        let pairs_unless_told = matches!(method, Method::Hploc(_)) && collapse.enabled && unpaired.can_pair();
        let pairs = self.choice(&PAIRS, &[("off", false), ("on", true)])?.unwrap_or(pairs_unless_told);
        let options = BuildOptions { pairs, ..unpaired };
        let time_to_optimise = self.time_to_optimise()?;
        let is_opened_by_rays = self.is_opened_by_rays()?;
        if form.is_none() && is_opened_by_rays {
            return Err(self.wrong_value(&OPEN, "rays"));
        }
        let any_hit = self.any_hit()?;
        if self.is_optimised_by_rays()? {
            if optimise.is_none() || time_to_optimise.is_some() {
                let what = "by=rays is for a number of passes; take optimise=fast, medium, high or a number with it";
                return Err(Error::Argument(format!("builder {self}: {what}")));
            }
            if any_hit.is_some_and(|order| order != AnyHitSpec::Rays) {
                let what =
                    "rounds by rays take an order of children away; take any-hit=near or any-hit=rays with by=rays";
                return Err(Error::Argument(format!("builder {self}: {what}")));
            }
        }
        if any_hit == Some(AnyHitSpec::Built) {
            let what = "builders on the device have no order of children of their own; take any-hit=opaque";
            return Err(Error::Argument(format!("builder {self}: {what}")));
        }
        let walks = [("tracer", None), ("query", Some(Queries::OneEach)), ("turns", Some(Queries::InTurn))];
        let by_query = self.choice(&WALK, &walks)?.flatten();
        if by_query.is_some() && !matches!(form, None | Some(Form::EightQuantised)) {
            let what = "queries are for nodes of two and quantised ones of eight; take width=2 or 8q, or walk=tracer";
            return Err(Error::Argument(format!("builder {self}: {what}")));
        }
        Ok(BuilderPlan::Device(DevicePlan { options, form, by_query, order, time_to_optimise }))
    }

    /// Option `open`: whether wide nodes are opened by visits of rays.
    pub(super) fn is_opened_by_rays(&self) -> Result<bool> {
        Ok(self.choice(&OPEN, &[("area", false), ("rays", true)])?.unwrap_or(false))
    }

    /// Option `by`: whether reinsertion learns from rays.
    pub(super) fn is_optimised_by_rays(&self) -> Result<bool> {
        Ok(self.choice(&BY, &[("area", false), ("rays", true)])?.unwrap_or(false))
    }

    /// Option `any-hit`: the order of children, if there is one.
    pub(super) fn any_hit(&self) -> Result<Option<AnyHitSpec>> {
        let rule = |order| Some(AnyHitSpec::Rule(order));
        let all = [
            ("near", None),
            ("rtsah", rule(ChildOrder::Cheaper)),
            ("sato", rule(ChildOrder::LargerBox)),
            ("prim-sato", rule(ChildOrder::LargerPrimitives)),
            ("opaque", rule(ChildOrder::MoreHitsForItsCost)),
            ("built", Some(AnyHitSpec::Built)),
            ("rays", Some(AnyHitSpec::Rays)),
            ("auto", Some(AnyHitSpec::Auto)),
        ];
        let of_srdh = (self.option(HEURISTIC.key) == Some("srdh")).then_some(AnyHitSpec::Built);
        Ok(self.choice(&ANY_HIT, &all)?.unwrap_or(of_srdh))
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
        let known = [KdSchedule::Chain, KdSchedule::Persistent, KdSchedule::AcrossLevels];
        let schedules = [("chain", known[0]), ("persistent", known[1]), ("across-levels", known[2])];
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
    pub(super) fn reinsertion(&self) -> Result<Option<ReinsertionOptions>> {
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
            Some(_) => self.within(&OPTIMISE, 0.0..=f64::MAX)?.map(|passes: f64| {
                let rounds = passes * f64::from(ReinsertionOptions::FAST.rounds);
                ReinsertionOptions { rounds: rounds.round() as u32, ..ReinsertionOptions::FAST }
            }),
        })
    }

    /// What an option chooses by name, if it was given.
    pub(super) fn choice<T: Copy>(&self, option: &BuilderOption, all: &[(&str, T)]) -> Result<Option<T>> {
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
    pub(super) fn within<T: FromStr + PartialOrd>(
        &self,
        option: &BuilderOption,
        bounds: RangeInclusive<T>,
    ) -> Result<Option<T>> {
        let number = self.parsed(option)?;
        let is_within = number.as_ref().is_none_or(|number| bounds.contains(number));
        if is_within { Ok(number) } else { Err(self.wrong_value(option, self.option(option.key).unwrap_or_default())) }
    }

    pub(super) fn wrong_value(&self, option: &BuilderOption, value: &str) -> Error {
        Error::Argument(format!("builder {self}: {}={value} is unknown; use {}", option.key, option.values))
    }
}
