//! Builders by name: what `-b` takes (CONTRACT, "Builder names"), and a [`Subject`] made from it.
//!
//! A builder with its options is a [`Spec`]: `lbvh:codes=emc64var:collapse=off`. [`BUILDERS`] is the list of all there are;
//! to add one, add a row there.

mod host_options;
mod options;
mod plan;
mod table;

use super::Subject;
use super::any_hit::{self, AnyHit, AnyHitSpec, ChildrenBy};
use super::auto;
use super::host::Host;
use super::host_rays::KdRays;
use super::kd_device::KdDevice;
use super::kd_gpu::KdGpu;
use super::kd_host::KdHost;
use super::peers::driver::Driver;
#[cfg(feature = "peer-embree")]
use super::peers::embree::Embree;
#[cfg(feature = "peer-obvhs")]
use super::peers::obvhs::Obvhs;
use super::retraced::{Retraced, TreeTracer};
use super::taught::Taught;
use crate::device::Device;
use crate::rays::kinds::RayKind;
use crate::rays::sample::{self, TeachingRays};
use crate::scene::{Mesh, Scene};
use crate::{Error, Result};
use host_options::{HEURISTIC, SAMPLE, TEACHING_RAYS, WEIGHT};
use options::{ANY_HIT, BY, OPEN, RAYS, TRACE, TRAVERSAL};
pub use plan::KdSpec;
pub(crate) use plan::{BuilderPlan, TaughtTree};
use std::fmt;
use std::rc::Rc;
use std::str::FromStr;
pub use table::{BUILDERS, BuilderEntry, BuilderOption, Needs};

/// A builder with its options, as `-b` takes it. Known to exist and to have sound options once it is made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spec {
    name: String,
    options: Vec<(String, String)>,
}

impl Spec {
    /// The builder.
    pub fn builder(&self) -> &'static BuilderEntry {
        BUILDERS.iter().find(|b| b.name == self.name).expect("checked when the spec was parsed")
    }

    /// The value of an option, if it was given.
    pub fn option(&self, key: &str) -> Option<&str> {
        self.options.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_str())
    }

    /// The same for a number of rays per build, where it is one that chooses by them and has no number of its own.
    pub fn for_rays(mut self, rays: f64) -> Spec {
        if self.builder().takes(RAYS.key) && self.option(RAYS.key).is_none() {
            self.options.push((RAYS.key.to_owned(), rays.to_string()));
        }
        self
    }

    /// What it needs of the machine: what its builder does, and a device if rays are traced there.
    pub fn needs(&self) -> Needs {
        match self.builder().needs {
            Needs::Nothing if self.option(TRACE.key) == Some("device") => Needs::Device,
            needs => needs,
        }
    }

    /// Whether it can be measured with this device.
    pub fn is_possible(&self, device: Option<&Device>) -> bool {
        match self.needs() {
            Needs::Nothing => true,
            Needs::Device => device.is_some(),
            Needs::RayQuery => device.is_some_and(|device| device.driver_tracing().is_some()),
        }
    }

    /// What it asks for.
    ///
    /// # Errors
    /// [`Error::Argument`] if an option has a value that the builder does not take.
    pub(crate) fn plan(&self) -> Result<BuilderPlan> {
        (self.builder().plan)(self)
    }

    /// The subject: the builder on a mesh, with everything uploaded that is uploaded once.
    ///
    /// # Errors
    /// The device is missing or lacks something, or there is too little memory; the builder learns from a camera or from rays
    /// ([`Spec::make_for`]).
    pub fn make<'a>(&self, device: Option<&'a Device>, mesh: &'a Mesh) -> Result<Box<dyn Subject + 'a>> {
        self.make_taught(device, mesh, self.lessons(device, mesh, None)?)
    }

    /// The same on the mesh of a scene, of whose camera and rays it may learn.
    ///
    /// # Errors
    /// Those of [`Spec::make`].
    pub fn make_for<'a>(&self, device: Option<&'a Device>, scene: &'a Scene) -> Result<Box<dyn Subject + 'a>> {
        self.make_taught(device, &scene.mesh, self.taught_by(device, scene)?)
    }

    /// Whether it learns from what a camera sees, so that another view gives another structure.
    ///
    /// # Errors
    /// [`Error::Argument`] if an option has a value that the builder does not take.
    pub fn learns_from_a_view(&self) -> Result<bool> {
        let has_taught_order = matches!(self.any_hit()?, Some(AnyHitSpec::Rays | AnyHitSpec::Auto));
        Ok(self.heuristic()?.learns_from_a_view()
            || has_taught_order
            || self.is_opened_by_rays()?
            || self.is_optimised_by_rays()?)
    }

    /// The same builder by areas alone.
    pub fn untaught(&self) -> Spec {
        // Where no heuristic can be chosen, `rays` is another option.
        let of_heuristics = match self.builder().takes(HEURISTIC.key) {
            true => &[HEURISTIC.key, TEACHING_RAYS.key, SAMPLE.key, WEIGHT.key][..],
            false => &[],
        };
        let teaches = |key: &str, value: &str| {
            of_heuristics.contains(&key)
                || [ANY_HIT.key, OPEN.key, BY.key].contains(&key) && ["rays", "auto"].contains(&value)
        };
        let options = self.options.iter().filter(|(key, value)| !teaches(key, value)).cloned().collect();
        Spec { name: self.name.clone(), options }
    }

    /// What the camera and the rays of a scene teach it.
    ///
    /// # Errors
    /// The scene has no triangles; the device lacks something.
    pub fn taught_by(&self, device: Option<&Device>, scene: &Scene) -> Result<Lessons> {
        self.lessons(device, &scene.mesh, Some(scene))
    }

    fn lessons(&self, device: Option<&Device>, mesh: &Mesh, scene: Option<&Scene>) -> Result<Lessons> {
        let heuristic = self.heuristic()?.taught(scene)?;
        let rays = |kinds: &[RayKind]| {
            let what = "it learns from rays, and there is only a mesh here; take bench, build, trace or render, or any-hit=opaque, \
                        open=area and by=area";
            let scene = scene.ok_or_else(|| Error::Argument(format!("builder {self}: {what}")))?;
            TeachingRays::of(scene, kinds, sample::MOST_OF_KIND)
        };
        let mut tree = TaughtTree::default();
        if self.is_opened_by_rays()? {
            tree.opened_by = Some(Rc::new(rays(&sample::FRAME)?));
        }
        if self.is_optimised_by_rays()? {
            tree.reinserted_by = Some(Rc::new(rays(&sample::FRAME)?));
        }
        let ordered = |order| AnyHit { order: Some(order), choice: None };
        tree.any_hit = match self.any_hit()? {
            None => AnyHit::NEAR,
            Some(AnyHitSpec::Rule(order)) => ordered(ChildrenBy::Rule(order)),
            Some(AnyHitSpec::Built) => ordered(ChildrenBy::Built),
            Some(AnyHitSpec::Rays) => ordered(ChildrenBy::Rays(rays(&sample::ANY_HIT)?.all())),
            Some(AnyHitSpec::Auto) => any_hit::chosen(&rays(&sample::ANY_HIT)?, |any_hit| {
                let lessons = Lessons { heuristic: heuristic.clone(), tree: TaughtTree { any_hit, ..tree.clone() } };
                self.make_taught(device, mesh, lessons)
            })?,
        };
        Ok(Lessons { heuristic, tree })
    }

    /// The subject on a mesh by what it was taught before, be it by another view of the mesh.
    ///
    /// # Errors
    /// Those of [`Spec::make`].
    pub fn make_taught<'a>(
        &self,
        device: Option<&'a Device>,
        mesh: &'a Mesh,
        Lessons { heuristic, tree }: Lessons,
    ) -> Result<Box<dyn Subject + 'a>> {
        let given =
            || device.ok_or_else(|| Error::NoVulkan("this builder works on a device, and none was opened".into()));
        let name = self.to_string();
        let subject: Box<dyn Subject + 'a> = match self.plan()? {
            BuilderPlan::Device(plan) => Box::new(plan.make(given()?, &name, mesh, &tree)?),
            BuilderPlan::Host(plan) => Box::new(Host::new(&name, mesh, plan, heuristic)?),
            BuilderPlan::Kd(KdSpec::Host { options, traversal, traces_on_device }) => {
                let rays = match traces_on_device {
                    false => KdRays::on_host(traversal),
                    true => KdRays::on_device(KdDevice::new(given()?, traversal)?),
                };
                Box::new(KdHost::new(&name, mesh, options, rays))
            }
            BuilderPlan::Kd(KdSpec::Device { options, traversal }) => {
                Box::new(KdGpu::new(given()?, &name, mesh, &options, traversal)?)
            }
            BuilderPlan::Auto(rays) => Box::new(auto::chosen(given()?, &name, mesh, rays)?),
            BuilderPlan::Driver(preference) => Box::new(Driver::new(given()?, mesh, preference)?),
            #[cfg(feature = "peer-obvhs")]
            BuilderPlan::Obvhs(preset) => Box::new(Obvhs::new(mesh, preset)?),
            #[cfg(feature = "peer-embree")]
            BuilderPlan::Embree(preset) => Box::new(Embree::new(mesh, preset)?),
        };
        Ok(match self.tracer()? {
            None => subject,
            Some(TreeTracer::Host) => Box::new(Retraced::by_builder(&name, subject, None, tree.any_hit)?),
            Some(TreeTracer::Device) => Box::new(Retraced::by_builder(&name, subject, Some(given()?), tree.any_hit)?),
        })
    }

    /// How it builds and traces kd-trees, if it does.
    ///
    /// # Errors
    /// [`Error::Argument`] if it is not a builder of kd-trees.
    pub fn kd(&self) -> Result<KdSpec> {
        if let BuilderPlan::Kd(kd) = self.plan()? {
            return Ok(kd);
        }
        let names: Vec<&str> = BUILDERS.iter().filter(|b| b.takes(TRAVERSAL.key)).map(|b| b.name).collect();
        Err(Error::Argument(format!("{self} builds no kd-trees; take {}", names.join(", "))))
    }
}

/// What a scene has taught a builder.
#[derive(Debug, Clone)]
pub struct Lessons {
    heuristic: Taught,
    tree: TaughtTree,
}

impl Lessons {
    /// How many rays taught it, where they do one by one.
    pub fn rays(&self) -> Option<u64> {
        let TaughtTree { any_hit, opened_by, reinserted_by } = &self.tree;
        let of_order = match &any_hit.order {
            Some(ChildrenBy::Rays(rays)) => Some(rays.len() as u64),
            _ => None,
        };
        let of_sample = |teaching: &Rc<TeachingRays>| teaching.by_kind.iter().map(|(_, rays)| rays.len() as u64).sum();
        let [of_nodes, of_rounds] = [opened_by, reinserted_by].map(|sample| sample.as_ref().map(of_sample));
        [self.heuristic.rays(), of_order, of_nodes, of_rounds].into_iter().flatten().reduce(|a, b| a + b)
    }

    /// How many triangles were seen, where that is what it learns.
    pub fn seen(&self) -> Option<u64> {
        self.heuristic.seen()
    }
}

/// Behind what a builder takes: which take an option.
fn takers_of(key: &str) -> String {
    let names: Vec<&str> = BUILDERS.iter().filter(|builder| builder.takes(key)).map(|builder| builder.name).collect();
    format!("; builders with {key}= are {}", names.join(", "))
}

impl FromStr for Spec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Spec> {
        let mut parts = text.split(':');
        let name = parts.next().unwrap_or_default();
        let builder = BUILDERS.iter().find(|b| b.name == name).ok_or_else(|| {
            let names: Vec<_> = BUILDERS.iter().map(|b| b.name).collect();
            Error::Argument(format!("unknown builder {name:?}; use one of {}, or all", names.join(", ")))
        })?;
        let mut spec = Spec { name: name.to_owned(), options: Vec::new() };
        for part in parts {
            let (key, value) = part.split_once('=').ok_or_else(|| {
                Error::Argument(format!("builder {text}: option {part:?} has no value; write {part}=VALUE"))
            })?;
            if !builder.takes(key) {
                let of_others = if key == HEURISTIC.key { takers_of(key) } else { String::new() };
                let keys: Vec<_> = builder.all_options().map(|option| option.key).collect();
                let there_are =
                    if keys.is_empty() { "it takes none".into() } else { format!("it takes {}", keys.join(", ")) };
                return Err(Error::Argument(format!(
                    "builder {text}: {name} has no option {key:?}; {there_are}{of_others}"
                )));
            }
            if spec.option(key).is_some() {
                return Err(Error::Argument(format!("builder {text}: {key} is given twice; give it once")));
            }
            spec.options.push((key.to_owned(), value.to_owned()));
        }
        spec.plan()?;
        spec.tracer()?;
        spec.any_hit()?;
        spec.heuristic()?;
        Ok(spec)
    }
}

impl fmt::Display for Spec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        self.options.iter().try_for_each(|(key, value)| write!(f, ":{key}={value}"))
    }
}

/// The builders that `-b` asks for: a comma-separated list, in which `all` stands for every variant of every builder.
/// Each is there once.
///
/// # Errors
/// [`Error::Argument`] says which builder or option is wrong, and what there is.
pub fn parse_list(text: &str) -> Result<Vec<Spec>> {
    let mut specs: Vec<Spec> = Vec::new();
    let all = || BUILDERS.iter().flat_map(|b| b.variants.iter().copied());
    for part in text.split(',').map(str::trim).filter(|part| !part.is_empty()) {
        let named: Vec<&str> = if part == "all" { all().collect() } else { vec![part] };
        for name in named {
            let spec = name.parse()?;
            if !specs.contains(&spec) {
                specs.push(spec);
            }
        }
    }
    if specs.is_empty() {
        return Err(Error::Argument("no builder is named; take -b NAME,NAME… or -b all".into()));
    }
    Ok(specs)
}

/// Every builder with what it is and its options, for `--help`.
pub fn help() -> String {
    let mut text = String::from("Builders, each option behind a colon as in NAME:KEY=VALUE:\n");
    for builder in BUILDERS {
        text += &format!("  {:18} {}\n", builder.name, builder.what);
        for option in builder.all_options() {
            text += &format!("  {:18}   :{}=  {}\n", "", option.key, option.values);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subjects::host::HostPlan;
    use hedgerow::bvh::reinsertion::ReinsertionOptions;
    use hedgerow::bvh::sah::Collapse;
    use hedgerow::trace::kd::Traversal;

    fn error_of(text: &str) -> String {
        parse_list(text).expect_err(text).to_string()
    }

    #[test]
    fn every_variant_of_every_builder_parses_and_prints_as_it_was() {
        for variant in BUILDERS.iter().flat_map(|b| b.variants) {
            assert_eq!(variant.parse::<Spec>().expect(variant).to_string(), *variant);
        }
    }

    #[test]
    fn a_builder_that_learns_has_one_by_areas_beside_it() {
        let spec = |text: &str| text.parse::<Spec>().expect("known");
        let taught = spec("binned:axes=all:heuristic=rdh:rays=primary+ao:sample=1000:weight=0.5:bins=10");
        assert!(taught.learns_from_a_view().expect("checked"));
        assert_eq!(taught.untaught().to_string(), "binned:axes=all:bins=10");
        for none in ["binned:axes=all", "sweep:heuristic=interior", "hploc:radius=8", "auto:rays=1e6"] {
            assert!(!spec(none).learns_from_a_view().expect("checked"), "{none}");
        }
        assert_eq!(spec("auto:rays=1e6").untaught(), spec("auto:rays=1e6"));
    }

    #[test]
    fn a_list_holds_each_builder_once() {
        let specs = parse_list("driver-fast-trace, all,driver-fast-build").expect("known");
        assert_eq!(specs[0].to_string(), "driver-fast-trace");
        let variants: usize = BUILDERS.iter().map(|b| b.variants.len()).sum();
        assert_eq!(specs.len(), variants);
    }

    #[test]
    fn options_reach_the_builder() {
        let spec: Spec = "lbvh-host:codes=mc63+concise:collapse=off".parse().expect("known");
        assert_eq!(spec.codes().expect("checked").map(|c| c.to_string()).as_deref(), Some("mc63+concise"));
        assert_eq!(spec.collapse().expect("checked"), Collapse::OFF);
        assert_eq!("lbvh-host".parse::<Spec>().expect("known").collapse().expect("checked"), Collapse::SAH);
    }

    #[test]
    fn passes_of_reinsertion_may_be_parts() {
        let rounds =
            |text: &str| text.parse::<Spec>().expect("known").reinsertion().expect("checked").map(|o| o.rounds);
        assert_eq!(rounds("hploc:optimise=0.5"), Some(ReinsertionOptions::FAST.rounds / 2));
        assert_eq!(rounds("hploc:optimise=3"), Some(ReinsertionOptions::of_passes(3).rounds));
        assert_eq!(rounds("hploc:optimise=1e30"), Some(u32::MAX));
    }

    #[test]
    fn a_builder_on_the_host_has_the_threads_that_it_is_given() {
        let threads = |text: &str| match text.parse::<Spec>().expect("known").plan().expect("checked") {
            BuilderPlan::Host(HostPlan::Built { threads, .. }) => threads.map(|threads| threads.get()),
            _ => panic!("{text} is built on the host"),
        };
        let given = ["sweep:threads=1", "binned:axes=all:threads=2", "bonsai-p2:threads=1024", "binned"].map(threads);
        assert_eq!(given, [Some(1), Some(2), Some(1024), None]);
    }

    #[test]
    fn rays_a_build_reach_the_builder_that_chooses_by_them() {
        let for_rays = |text: &str| text.parse::<Spec>().expect("known").for_rays(2e6).to_string();
        assert_eq!(for_rays("auto"), "auto:rays=2000000");
        assert_eq!(for_rays("auto:rays=5"), "auto:rays=5");
        assert_eq!(for_rays("lbvh"), "lbvh");
    }

    #[test]
    fn a_device_is_needed_where_rays_are_traced_on_it() {
        let needs = |text: &str| text.parse::<Spec>().expect("known").needs();
        assert_eq!(needs("kd-binned:trace=device"), Needs::Device);
        assert_eq!([needs("kd-binned"), needs("kd-exact:trace=host")], [Needs::Nothing; 2]);
        assert_eq!([needs("sweep:trace=device"), needs("sweep:trace=host")], [Needs::Device, Needs::Nothing]);
        assert_eq!([needs("lbvh"), needs("driver-fast-build")], [Needs::Device, Needs::RayQuery]);
    }

    #[test]
    fn kd_trees_are_traced_with_a_short_stack_on_the_device() {
        let traversal = |text: &str| match text.parse::<Spec>().expect("known").kd().expect("one") {
            KdSpec::Host { traversal, .. } | KdSpec::Device { traversal, .. } => traversal,
        };
        assert_eq!(["kd-gpu", "kd-binned:trace=device"].map(traversal), [Traversal::short_stack(4); 2]);
        assert_eq!(["kd-binned", "kd-gpu:traversal=stack"].map(traversal), [Traversal::STACK; 2]);
    }

    #[test]
    fn what_is_wrong_is_named_with_what_there_is() {
        assert!(error_of("lvbh").contains("unknown builder \"lvbh\"; use one of"));
        assert!(error_of("lbvh-host:codes=mc31").contains("emc64var-nosize"));
        assert!(error_of("lbvh-host:collapse=maybe").contains("use sah or off"));
        assert!(error_of("lbvh:width=3").contains("width=3 is unknown; use 2, 4, 8 or 8q"));
        assert!(error_of("lbvh:width=4:order=octant").contains("order=octant is unknown; use distance or octant (of"));
        for wrong in ["lots", "-0.1", "1.5", "nan", "0.3/0", "0.3/x"] {
            let says = format!("split={wrong} is unknown; use a number from 0 to 1");
            assert!(error_of(&format!("hploc:split={wrong}")).contains(&says), "{wrong}");
        }
        for wrong in ["ms", "-1ms", "infms", "20s", "-0.5", "nan", "inf"] {
            assert!(error_of(&format!("lbvh:optimise={wrong}")).contains("a time for it as in 20ms"), "{wrong}");
        }
        assert!(error_of("lbvh-host:optimise=20ms").contains("on the host rounds are not timed"));
        assert!(error_of("lbvh-host:codes").contains("write codes=VALUE"));
        assert!(error_of("lbvh-host:codes=mc30:codes=mc63").contains("given twice"));
        assert!(error_of("lbvh-host:radius=25").contains("no option \"radius\"; it takes codes, collapse, optimise"));
        assert!(error_of("driver-fast-build:codes=mc30").contains("it takes none"));
        for wrong in ["many", "1", "1025"] {
            let says = format!("bins={wrong} is unknown; use a number of bins along each axis, from 2 to 1024");
            assert!(error_of(&format!("kd-binned:bins={wrong}")).contains(&says), "{wrong}");
        }
        for wrong in ["much", "0", "-1", "nan", "1e9"] {
            let says = format!("kt={wrong} is unknown; use a cost of a traversal step, from 0.001 to 1000");
            assert!(error_of(&format!("kd-exact:kt={wrong}")).contains(&says), "{wrong}");
        }
        for wrong in ["queue", "short", "short-0", "short-42", "short-2-up", "stack-push-down"] {
            let says = format!("traversal={wrong} is unknown; use stack, restart, push-down, short-N");
            assert!(error_of(&format!("kd-exact:traversal={wrong}")).contains(&says), "{wrong}");
        }
        assert!(error_of("sweep:trace=there").contains("trace=there is unknown; use host or device"));
        assert!(error_of("kd-exact:trace=there").contains("trace=there is unknown; use host or device"));
        assert!(error_of("kd-exact:bins=8").contains("no option \"bins\"; it takes kt, ki, traversal, trace"));
        for wrong in ["some", "0", "-1", "1025"] {
            let says = format!("threads={wrong} is unknown; use a number of threads that build, from 1 to 1024");
            assert!(error_of(&format!("sweep:threads={wrong}")).contains(&says), "{wrong}");
        }
        assert!(error_of("lbvh-host:threads=2").contains("no option \"threads\""));
        assert!(error_of("sweep:any-hit=far").contains("any-hit=far is unknown; use near, or an order of children"));
        for width in ["4", "8", "8q"] {
            parse_list(&format!("lbvh:width={width}:any-hit=sato")).expect("nodes of any width have orders");
        }
        assert!(error_of("lbvh:open=rays").contains("open=rays is unknown; use area, or rays (of width=4, 8 or 8q)"));
        assert!(error_of("lbvh:width=8:open=visits").contains("open=visits is unknown; use area, or rays"));
        assert!(error_of("kd-exact:any-hit=sato").contains("no option \"any-hit\""));
        assert!(error_of("lbvh:walk=there").contains("walk=there is unknown; use tracer, query or turns"));
        assert!(error_of("lbvh:width=4:walk=query").contains("take width=2 or 8q, or walk=tracer"));
        assert!(error_of("sweep:heuristic=best").contains("heuristic=best is unknown; use sah, interior"));
        assert!(error_of("bonsai:heuristic=rdh").contains("bonsai has no option \"heuristic\""));
        assert!(error_of("lbvh:heuristic=rdh").contains("builders with heuristic= are sweep, binned, sbvh"));
        assert!(error_of("sweep:heuristic=osah-complete").contains("take sbvh:heuristic=osah-complete"));
        assert!(error_of("binned:heuristic=srdh:rays=primary").contains("take rays=shadow, ao or shadow+ao"));
        assert!(error_of("hploc:any-hit=built").contains("no order of children of their own; take any-hit=opaque"));
        assert!(error_of("binned:heuristic=rdh:rays=primary+light").contains("rays=primary+light is unknown; use all"));
        assert!(error_of("binned:heuristic=osah:weight=2").contains("weight=2 is unknown; use a number from 0 to 1"));
        assert!(error_of("sweep:optimise=top-65").contains("optimise=top-65 is unknown; use off"));
        assert!(error_of("sbvh:budget=0.5").contains("budget=0.5 is unknown; use a number from 1 to 16"));
        let mesh = Mesh::default();
        let error =
            "sweep:heuristic=perspective".parse::<Spec>().expect("known").make(None, &mesh).err().expect("no camera");
        assert!(error.to_string().contains("there is only a mesh here"), "{error}");
        assert!(error_of("auto:rays=many").contains("is not a number of rays per build"));
        assert!(error_of("").contains("-b all"));
        assert!(error_of(",").contains("-b all"));
    }
}
