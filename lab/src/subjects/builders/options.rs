//! What options there are, and what a [`Spec`] says with them.

use super::Spec;
use super::table::{BuilderOption, Kind};
use crate::subjects::auto;
use crate::subjects::host::{self, HostMethod};
use crate::{Error, Result};
use hedgerow::bvh::builder::{self, Method, Schedule, Treelets, Window};
use hedgerow::bvh::codes::Codes;
use hedgerow::bvh::reinsertion;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::split;
use hedgerow::bvh::wide::Form;
use hedgerow::kdtree;
use hedgerow::kdtree::builder::KdSchedule;
use hedgerow::kdtree::termination::Costs;
use hedgerow::trace::kd::Traversal;
use hedgerow::trace::wide::Order;
use hedgerow_host::kdtree::Planes;
use hedgerow_host::sweep::Leaves;
use std::time::Duration;

pub(super) const CODES: BuilderOption = BuilderOption::new(
    "codes",
    "mc30, mc63, emc64sort, emc64var, emc64var-nosize, mip6, mip9, mip12 or binQaA (Q 2, 4 or 6, A 0 to 9; ~N behind: the \
             stretch factor weighs 1/N), with +concise, +centroid, +robust or /BITS behind",
);
pub(super) const COLLAPSE: BuilderOption = BuilderOption::new("collapse", "sah or off");
pub(super) const RAYS: BuilderOption =
    BuilderOption::new("rays", "rays that are traced between two builds, 1e7 unless given");
pub(super) const WIDTH: BuilderOption = BuilderOption::new("width", "2, 4, 8 or 8q (quantised)");
pub(super) const ORDER: BuilderOption = BuilderOption::new("order", "distance or octant (of width=8q)");
pub(super) const TERMINATION: BuilderOption =
    BuilderOption::new("termination", "sah, or off: leaves of one triangle, then collapsed");
pub(super) const SCHEDULE: BuilderOption = BuilderOption::new("schedule", "chain, persistent or workgroup");
pub(super) const KD_SCHEDULE: BuilderOption = BuilderOption::new("schedule", "chain or persistent");
pub(super) const SPLIT: BuilderOption = BuilderOption::new(
    "split",
    "a number from 0 to 1: splits of large triangles at most, as a part of all; with /N behind: of each at most N",
);
pub(super) const OPTIMISE: BuilderOption = BuilderOption::new(
    "optimise",
    "off, fast, medium, high, a number of passes of reinsertion, or on the device a time for it as in 20ms",
);
pub(super) const BITS: BuilderOption = BuilderOption::new("bits", "a number of bits that the codes of a treelet share");
pub(super) const TREELET: BuilderOption = BuilderOption::new("treelet", "a number of primitives at most, from 1");
pub(super) const WINDOW: BuilderOption = BuilderOption::new("window", "an even number of clusters from 4 to 64");
pub(super) const RADIUS: BuilderOption = BuilderOption::new("radius", "a number of neighbours on either side, from 1");
pub(super) const BINS: BuilderOption = BuilderOption::new("bins", "a number of bins along each axis, from 2 to 1024");
pub(super) const EXACT: BuilderOption = BuilderOption::new(
    "exact",
    "references of a cell that is split exactly, at most 64 of them, 0 for none; 32 unless given",
);
pub(super) const WORKGROUPS: BuilderOption =
    BuilderOption::new("workgroups", "a number of workgroups of the persistent schedule, from 1");
pub(super) const KT: BuilderOption =
    BuilderOption::new("kt", "a cost of a traversal step, from 0.001 to 1000; 3 unless given");
pub(super) const KI: BuilderOption =
    BuilderOption::new("ki", "a cost of a triangle test, from 0.001 to 1000; 2 unless given");

pub(super) const TRAVERSAL: BuilderOption = BuilderOption::new(
    "traversal",
    "stack, restart, push-down, short-N or short-N-push-down, N being how much a short stack holds; unless given stack on the host and short-4 on the device",
);

pub(super) const TRACE: BuilderOption =
    BuilderOption::new("trace", "host or device: where rays are traced; host unless given");

/// Of `ploc` where it is not told: what drivers take.
const PLOC_RADIUS: u32 = 16;

impl Spec {
    /// Whether every option has a value that the builder takes.
    pub(super) fn check(&self) -> Result<()> {
        match self.builder().kind {
            Kind::Device(options) => options(self).and(self.form_and_order()).map(drop),
            Kind::Host(hierarchy) => self.host_options(hierarchy(self)?).map(drop),
            Kind::KdHost(options) => options(self).and(self.traversal()).and(self.traces_on_device()).map(drop),
            Kind::KdGpu => self.kd_gpu_options().map(drop).and(self.traversal().map(drop)),
            Kind::Auto => self.rays().map(drop),
            // They take none.
            Kind::Driver(_) => Ok(()),
            #[cfg(feature = "peer-obvhs")]
            Kind::Obvhs(_) => Ok(()),
            #[cfg(feature = "peer-embree")]
            Kind::Embree(_) => Ok(()),
        }
    }

    /// Option `schedule`.
    fn schedule(&self) -> Result<Option<Schedule>> {
        let all =
            [("chain", Schedule::Chain), ("persistent", Schedule::PERSISTENT), ("workgroup", Schedule::Workgroup)];
        self.choice(&SCHEDULE, &all)
    }

    /// Options `codes`, `split`, `optimise`, `collapse` and `schedule`.
    pub(super) fn lbvh_options(&self) -> Result<builder::BuildOptions> {
        let schedule = self.schedule()?;
        let (codes, split) = (self.codes()?, self.split()?);
        let (optimise, collapse) = (self.reinsertion()?, self.collapse()?);
        Ok(builder::BuildOptions { codes, split, optimise, collapse, schedule, ..builder::BuildOptions::DEFAULT })
    }

    /// Those of `lbvh`, with another method.
    fn options_with(&self, method: Method) -> Result<builder::BuildOptions> {
        method.check()?;
        Ok(builder::BuildOptions { method, ..self.lbvh_options()? })
    }

    /// Those of `lbvh`, and `bits` and `treelet`.
    pub(super) fn hlbvh_options(&self) -> Result<builder::BuildOptions> {
        let bits = self.option(BITS.key).map(|_| self.number(&BITS, 0)).transpose()?;
        let primitives = self.number(&TREELET, Treelets::DEFAULT.primitives)?;
        self.options_with(Method::Hlbvh(Treelets { bits, primitives }))
    }

    /// Those of `lbvh`, and `radius`.
    pub(super) fn ploc_options(&self) -> Result<builder::BuildOptions> {
        self.options_with(Method::Ploc { radius: self.number(&RADIUS, PLOC_RADIUS)? })
    }

    /// Those of `lbvh`, and `window` and `radius`.
    pub(super) fn hploc_options(&self) -> Result<builder::BuildOptions> {
        let size = self.number(&WINDOW, Window::DEFAULT.size)?;
        let radius = self.number(&RADIUS, Window::DEFAULT.radius)?;
        self.options_with(Method::Hploc(Window { size, radius }))
    }

    /// Options `width`, of a wide tree, and `order`; no width where it is 2 or was not given.
    pub(super) fn form_and_order(&self) -> Result<(Option<Form>, Option<Order>)> {
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

    /// Options `codes`, `collapse` and `optimise` of a builder on the host.
    pub(super) fn host_options(&self, hierarchy: HostMethod) -> Result<host::HostBvhOptions> {
        if self.time_to_optimise().is_some() {
            let what = "on the host rounds are not timed; take fast, medium, high or a number of passes";
            return Err(Error::Argument(format!("builder {self}: {}: {what}", OPTIMISE.key)));
        }
        let (codes, collapse) = (self.codes()?, self.collapse()?);
        Ok(host::HostBvhOptions { hierarchy, codes, reinsertion: self.reinsertion()?, collapse })
    }

    /// Option `radius` of PLOC; 25 where it was not given.
    pub(super) fn ploc_radius(&self) -> Result<usize> {
        let radius = self.number(&RADIUS, 25)?;
        if radius > 0 { Ok(radius as usize) } else { Err(self.wrong_value(&RADIUS, "0")) }
    }

    /// Option `traversal`; where it was not given, what is fastest where rays are traced (docs/notes/kdtree.md).
    pub(super) fn traversal(&self) -> Result<Traversal> {
        match self.option(TRAVERSAL.key) {
            Some(value) => value.parse().map_err(|()| self.wrong_value(&TRAVERSAL, value)),
            None if matches!(self.builder().kind, Kind::KdGpu) || self.traces_on_device()? => {
                Ok(Traversal::short_stack(4))
            }
            None => Ok(Traversal::STACK),
        }
    }

    /// Option `trace`.
    pub(super) fn traces_on_device(&self) -> Result<bool> {
        Ok(self.choice(&TRACE, &[("host", false), ("device", true)])?.unwrap_or(false))
    }

    /// Options `kt` and `ki`.
    pub(super) fn kd_exact_options(&self) -> Result<hedgerow_host::kdtree::HostKdOptions> {
        self.kd_options(Planes::Exact)
    }

    /// Options `bins`, `kt` and `ki`.
    pub(super) fn kd_binned_options(&self) -> Result<hedgerow_host::kdtree::HostKdOptions> {
        self.kd_options(Planes::Binned(self.number(&BINS, Planes::BINS)?))
    }

    /// Options `bins`, `exact`, `kt` and `ki`.
    pub(super) fn kd_mixed_options(&self) -> Result<hedgerow_host::kdtree::HostKdOptions> {
        let default = kdtree::builder::KdOptions::DEFAULT;
        let (bins, exact) = (self.number(&BINS, default.bins)?, self.number(&EXACT, default.exact)?);
        if exact > Planes::MAX_EXACT {
            return Err(self.wrong_value(&EXACT, self.option(EXACT.key).unwrap_or_default()));
        }
        self.kd_options(Planes::Mixed { bins, exact })
    }

    /// Options `bins`, `exact`, `kt`, `ki`, `schedule` and `workgroups`.
    pub(super) fn kd_gpu_options(&self) -> Result<kdtree::builder::KdOptions> {
        let default = kdtree::builder::KdOptions::DEFAULT;
        let costs = self.kd_options(Planes::Exact)?.costs;
        let workgroups = self.option(WORKGROUPS.key).map(|_| self.number(&WORKGROUPS, 1)).transpose()?;
        let schedules = [("chain", KdSchedule::Chain), ("persistent", KdSchedule::Persistent)];
        let options = kdtree::builder::KdOptions {
            bins: self.number(&BINS, default.bins)?,
            exact: self.number(&EXACT, default.exact)?,
            costs,
            schedule: self.choice(&KD_SCHEDULE, &schedules)?,
            workgroups,
            ..default
        };
        options.check()?;
        Ok(options)
    }

    fn kd_options(&self, planes: Planes) -> Result<hedgerow_host::kdtree::HostKdOptions> {
        let cost = |option: &BuilderOption, default: f32| {
            let Some(value) = self.option(option.key) else { return Ok(default) };
            value.parse().map_err(|_| self.wrong_value(option, value))
        };
        let costs = Costs { c_t: cost(&KT, Costs::DEFAULT.c_t)?, c_i: cost(&KI, Costs::DEFAULT.c_i)? };
        let options = hedgerow_host::kdtree::HostKdOptions { planes, costs };
        let wrong = [(BINS, options.check_planes()), (KT, Costs::check(costs.c_t)), (KI, Costs::check(costs.c_i))];
        match wrong.iter().find(|(_, is_right)| !is_right) {
            Some((option, _)) => Err(self.wrong_value(option, self.option(option.key).unwrap_or_default())),
            None => Ok(options),
        }
    }

    /// Option `termination`, if `optimise` and `collapse` leave it a choice: both need leaves of one triangle.
    pub(super) fn sweep_leaves(&self) -> Result<Leaves> {
        let single = !self.collapse()?.enabled || self.reinsertion()?.is_some();
        let wanted = self.choice(&TERMINATION, &[("off", Leaves::Single), ("sah", Leaves::Terminated)])?;
        Ok(if single { Leaves::Single } else { wanted.unwrap_or(Leaves::Terminated) })
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
    fn split(&self) -> Result<Option<split::SplitOptions>> {
        let Some(value) = self.option(SPLIT.key) else { return Ok(None) };
        let (fraction, most) = value.split_once('/').unwrap_or((value, ""));
        let most = if most.is_empty() { Ok(split::SplitOptions::DEFAULT.most) } else { most.parse() };
        let (Ok(fraction), Ok(most)) = (fraction.parse(), most) else { return Err(self.wrong_value(&SPLIT, value)) };
        let options = split::SplitOptions { fraction, most };
        options.check().map_err(|_| self.wrong_value(&SPLIT, value))?;
        Ok((fraction > 0.0).then_some(options))
    }

    /// Option `optimise` where it is a time.
    pub(super) fn time_to_optimise(&self) -> Option<Result<Duration>> {
        let value = self.option(OPTIMISE.key)?;
        let milliseconds = value.strip_suffix("ms")?.parse().ok();
        let time = milliseconds.and_then(|ms: f64| Duration::try_from_secs_f64(1e-3 * ms).ok());
        Some(time.ok_or_else(|| self.wrong_value(&OPTIMISE, value)))
    }

    /// Option `optimise`; off where it was not given. For a time, the pass that tells how many there is time for.
    fn reinsertion(&self) -> Result<Option<reinsertion::ReinsertionOptions>> {
        use reinsertion::ReinsertionOptions;
        if let Some(time) = self.time_to_optimise() {
            return time.map(|_| Some(ReinsertionOptions::FAST));
        }
        Ok(match self.option(OPTIMISE.key) {
            None | Some("off") => None,
            Some("fast") => Some(ReinsertionOptions::FAST),
            Some("medium") => Some(ReinsertionOptions::MEDIUM),
            Some("high") => Some(ReinsertionOptions::HIGH),
            Some(_) => Some(ReinsertionOptions::of_passes(self.number(&OPTIMISE, 0)?)),
        })
    }

    /// What an option chooses by name, if it was given.
    fn choice<T: Copy>(&self, option: &BuilderOption, all: &[(&str, T)]) -> Result<Option<T>> {
        let Some(value) = self.option(option.key) else { return Ok(None) };
        let chosen = all.iter().find(|(name, _)| *name == value).map(|(_, chosen)| *chosen);
        chosen.map(Some).ok_or_else(|| self.wrong_value(option, value))
    }

    /// The value of an option that is a number, or what it is where it was not given.
    fn number(&self, option: &BuilderOption, default: u32) -> Result<u32> {
        let Some(value) = self.option(option.key) else { return Ok(default) };
        value.parse().map_err(|_| self.wrong_value(option, value))
    }

    fn wrong_value(&self, option: &BuilderOption, value: &str) -> Error {
        Error::Argument(format!("builder {self}: {}={value} is unknown; use {}", option.key, option.values))
    }
}
