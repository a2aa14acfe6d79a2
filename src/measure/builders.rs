//! Builders by name: what `-b` takes (CONTRACT, "Builder names"), and a [`Subject`] made from it.
//!
//! A builder with its options is a [`Spec`]: `lbvh:codes=emc64var:collapse=off`. [`BUILDERS`] is the list of all there are;
//! whoever adds one adds a row there.

use super::Subject;
use super::choose::{self, Auto};
use super::device_bvh::DeviceBvh;
use super::host::{self, Hierarchy, Host};
use super::peers::driver::Driver;
#[cfg(feature = "peer-embree")]
use super::peers::embree;
#[cfg(feature = "peer-obvhs")]
use super::peers::obvhs;
use crate::bvh::builder::{self, Method, Schedule, Treelets, Window};
use crate::bvh::codes::Codes;
use crate::bvh::host::sweep::Leaves;
use crate::bvh::reinsertion;
use crate::bvh::sah::Collapse;
use crate::bvh::split;
use crate::bvh::wide::Form;
use crate::gpu::{Device, DriverPreference};
use crate::scene::Mesh;
use crate::trace::wide::{Order, Tracer};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;
use std::time::Duration;

/// A builder that can be asked for.
pub struct Builder {
    /// Its name.
    pub name: &'static str,
    /// What it is, in half a sentence.
    pub what: &'static str,
    /// The options it takes.
    pub options: &'static [BuilderOption],
    /// What `-b all` takes of it: specs that differ in kind, not in degree.
    pub variants: &'static [&'static str],
    /// What it needs of the machine.
    pub needs: Needs,
    make: Make,
    check: fn(&Spec) -> Result<()>,
}

/// Makes the subject of a spec on a device, if it needs one, and a mesh.
type Make = for<'a> fn(&Spec, Option<&'a Device>, &'a Mesh) -> Result<Box<dyn Subject + 'a>>;

/// An option of a builder, `key=value`.
pub struct BuilderOption {
    /// Its name.
    pub key: &'static str,
    /// The values it takes, for people.
    pub values: &'static str,
}

/// What a builder needs of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Needs {
    /// Nothing: it works on the host.
    Nothing,
    /// A device.
    Device,
    /// A device whose driver has ray queries.
    RayQuery,
}

const CODES: BuilderOption = BuilderOption {
    key: "codes",
    values: "mc30, mc63, emc64sort, emc64var, emc64var-nosize, mip6, mip9, mip12 or binQaA (Q 2, 4 or 6, A 0 to 9; ~N behind: the \
             stretch factor weighs 1/N), with +concise, +centroid, +robust or /BITS behind",
};
const COLLAPSE: BuilderOption = BuilderOption { key: "collapse", values: "sah or off" };
const RAYS: BuilderOption =
    BuilderOption { key: "rays", values: "rays that are traced between two builds, 1e7 unless given" };
const WIDTH: BuilderOption = BuilderOption { key: "width", values: "2, 4, 8 or 8q (quantised)" };
const ORDER: BuilderOption = BuilderOption { key: "order", values: "distance or octant (of width=8q)" };
const TERMINATION: BuilderOption =
    BuilderOption { key: "termination", values: "sah, or off: leaves of one triangle, then collapsed" };
const SCHEDULE: BuilderOption = BuilderOption { key: "schedule", values: "chain, persistent or workgroup" };

const SPLIT: BuilderOption = BuilderOption {
    key: "split",
    values: "a number from 0 to 1: splits of large triangles at most, as a part of all; with /N behind: of each at most N",
};

const OPTIMISE: BuilderOption = BuilderOption {
    key: "optimise",
    values: "off, fast, medium, high, a number of passes of reinsertion, or on the device a time for it as in 20ms",
};
const BITS: BuilderOption = BuilderOption { key: "bits", values: "a number of bits that the codes of a treelet share" };
const TREELET: BuilderOption = BuilderOption { key: "treelet", values: "a number of primitives at most, from 1" };
const WINDOW: BuilderOption = BuilderOption { key: "window", values: "an even number of clusters from 4 to 64" };
const RADIUS: BuilderOption = BuilderOption { key: "radius", values: "a number of neighbours on either side, from 1" };

/// Of `ploc` where it is not told: what drivers take.
const PLOC_RADIUS: u32 = 16;

/// Every builder, in the order in which they are listed and measured.
pub static BUILDERS: &[Builder] = &[
    Builder {
        name: "lbvh",
        what: "linear BVH on the device: codes, radix sort, hierarchy bottom-up in one pass",
        options: &[CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER],
        variants: &[
            "lbvh",
            "lbvh:codes=mc30",
            "lbvh:codes=emc64var-nosize",
            "lbvh:collapse=off",
            "lbvh:schedule=persistent",
            "lbvh:width=4",
            "lbvh:width=8q",
        ],
        needs: Needs::Device,
        make: |spec, device, mesh| spec.on_device(device, mesh, &spec.lbvh_options()?),
        check: |spec| spec.lbvh_options().and(spec.form_and_order()).map(drop),
    },
    Builder {
        name: "hlbvh",
        what: "hierarchical LBVH on the device: small subtrees of the LBVH under a top split by the surface area heuristic",
        options: &[BITS, TREELET, CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER],
        variants: &["hlbvh"],
        needs: Needs::Device,
        make: |spec, device, mesh| spec.on_device(device, mesh, &spec.hlbvh_options()?),
        check: |spec| spec.hlbvh_options().and(spec.form_and_order()).map(drop),
    },
    Builder {
        name: "ploc",
        what: "parallel locally-ordered clustering on the device: nearest neighbours in the order of codes merged in rounds",
        options: &[RADIUS, CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER],
        variants: &["ploc", "ploc:radius=25"],
        needs: Needs::Device,
        make: |spec, device, mesh| spec.on_device(device, mesh, &spec.ploc_options()?),
        check: |spec| spec.ploc_options().and(spec.form_and_order()).map(drop),
    },
    Builder {
        name: "hploc",
        what: "hierarchical PLOC on the device: neighbours merged in windows of the order of codes",
        options: &[WINDOW, RADIUS, CODES, SPLIT, OPTIMISE, COLLAPSE, SCHEDULE, WIDTH, ORDER],
        variants: &["hploc"],
        needs: Needs::Device,
        make: |spec, device, mesh| spec.on_device(device, mesh, &spec.hploc_options()?),
        check: |spec| spec.hploc_options().and(spec.form_and_order()).map(drop),
    },
    Builder {
        name: "auto",
        what: "the device's builder that takes least for a build and its rays, by its measured costs",
        options: &[RAYS],
        variants: &["auto"],
        needs: Needs::Device,
        make: |spec, device, mesh| {
            Ok(Box::new(Auto::new(given(device)?, &spec.to_string(), mesh, choose::rays_of(spec.option(RAYS.key))?)?))
        },
        check: |spec| choose::rays_of(spec.option(RAYS.key)).map(drop),
    },
    Builder {
        name: "lbvh-host",
        what: "the same LBVH by one thread of the host: what `lbvh` must equal, byte for byte",
        options: &[CODES, COLLAPSE, OPTIMISE],
        variants: &["lbvh-host"],
        needs: Needs::Nothing,
        make: |spec, _, mesh| spec.on_host(mesh, Hierarchy::Lbvh),
        check: |spec| spec.host_options(Hierarchy::Lbvh).map(drop),
    },
    Builder {
        name: "ploc-host",
        what: "locally-ordered clustering by one thread of the host: what `ploc` must equal, byte for byte",
        options: &[RADIUS, CODES, COLLAPSE, OPTIMISE],
        variants: &["ploc-host"],
        needs: Needs::Nothing,
        make: |spec, _, mesh| spec.on_host(mesh, Hierarchy::Ploc(spec.ploc_radius()?)),
        check: |spec| spec.host_options(Hierarchy::Ploc(spec.ploc_radius()?)).map(drop),
    },
    Builder {
        name: "sweep",
        what: "full-sweep SAH on the host: what the quality of the others is told against",
        options: &[COLLAPSE, OPTIMISE, TERMINATION],
        variants: &["sweep"],
        needs: Needs::Nothing,
        make: |spec, _, mesh| spec.on_host(mesh, Hierarchy::Sweep(spec.sweep_leaves()?)),
        check: |spec| spec.host_options(Hierarchy::Sweep(spec.sweep_leaves()?)).map(drop),
    },
    Builder {
        name: "driver-fast-build",
        what: "the Vulkan driver's own, asked to build fast",
        options: &[],
        variants: &["driver-fast-build"],
        needs: Needs::RayQuery,
        make: |_, device, mesh| Ok(Box::new(Driver::new(given(device)?, mesh, DriverPreference::FastBuild)?)),
        check: |_| Ok(()),
    },
    Builder {
        name: "driver-fast-trace",
        what: "the Vulkan driver's own, asked to trace fast",
        options: &[],
        variants: &["driver-fast-trace"],
        needs: Needs::RayQuery,
        make: |_, device, mesh| Ok(Box::new(Driver::new(given(device)?, mesh, DriverPreference::FastTrace)?)),
        check: |_| Ok(()),
    },
    #[cfg(feature = "peer-obvhs")]
    Builder {
        name: "obvhs-fastest",
        what: "obvhs on the CPU: PLOC alone",
        options: &[],
        variants: &["obvhs-fastest"],
        needs: Needs::Nothing,
        make: |_, _, mesh| Ok(Box::new(obvhs::Obvhs::new(mesh, obvhs::Preset::Fastest)?)),
        check: |_| Ok(()),
    },
    #[cfg(feature = "peer-obvhs")]
    Builder {
        name: "obvhs-fast",
        what: "obvhs on the CPU: PLOC and a little reinsertion",
        options: &[],
        variants: &["obvhs-fast"],
        needs: Needs::Nothing,
        make: |_, _, mesh| Ok(Box::new(obvhs::Obvhs::new(mesh, obvhs::Preset::Fast)?)),
        check: |_| Ok(()),
    },
    #[cfg(feature = "peer-obvhs")]
    Builder {
        name: "obvhs-medium",
        what: "obvhs on the CPU: PLOC and more reinsertion",
        options: &[],
        variants: &["obvhs-medium"],
        needs: Needs::Nothing,
        make: |_, _, mesh| Ok(Box::new(obvhs::Obvhs::new(mesh, obvhs::Preset::Medium)?)),
        check: |_| Ok(()),
    },
    #[cfg(feature = "peer-embree")]
    Builder {
        name: "embree-low",
        what: "Embree on the CPU: Morton codes",
        options: &[],
        variants: &["embree-low"],
        needs: Needs::Nothing,
        make: |_, _, mesh| Ok(Box::new(embree::Embree::new(mesh, embree::Preset::Low)?)),
        check: |_| Ok(()),
    },
    #[cfg(feature = "peer-embree")]
    Builder {
        name: "embree-medium",
        what: "Embree on the CPU: binned SAH",
        options: &[],
        variants: &["embree-medium"],
        needs: Needs::Nothing,
        make: |_, _, mesh| Ok(Box::new(embree::Embree::new(mesh, embree::Preset::Medium)?)),
        check: |_| Ok(()),
    },
    #[cfg(feature = "peer-embree")]
    Builder {
        name: "embree-high",
        what: "Embree on the CPU: SAH with spatial splits",
        options: &[],
        variants: &["embree-high"],
        needs: Needs::Nothing,
        make: |_, _, mesh| Ok(Box::new(embree::Embree::new(mesh, embree::Preset::High)?)),
        check: |_| Ok(()),
    },
];

fn given(device: Option<&Device>) -> Result<&Device> {
    device.ok_or_else(|| Error::NoVulkan("this builder works on a device, and none was opened".into()))
}

/// What a pass of reinsertion takes on this scene, by the second of two builds: the first warms up.
fn pass_of_reinsertion(device: &Device, mesh: &Mesh, options: &builder::Options) -> Result<Duration> {
    let mut subject = DeviceBvh::new(device, "", mesh, options, None)?;
    subject.build()?;
    let run = subject.build()?;
    let milliseconds: f64 = run.phases.iter().filter(|p| p.name == OPTIMISE.key).map(|p| p.milliseconds).sum();
    Ok(Duration::from_secs_f64(1e-3 * milliseconds))
}

/// A builder with its options, as `-b` takes it. Known to exist and to have sound options once it is made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Spec {
    name: String,
    options: Vec<(String, String)>,
}

impl Spec {
    /// The builder.
    pub fn builder(&self) -> &'static Builder {
        BUILDERS.iter().find(|b| b.name == self.name).expect("checked when the spec was parsed")
    }

    /// The value of an option, if it was given.
    pub fn option(&self, key: &str) -> Option<&str> {
        self.options.iter().find(|(k, _)| k == key).map(|(_, value)| value.as_str())
    }

    /// The same for so many rays a build, where it is one that chooses by them and has no number of its own.
    pub fn for_rays(mut self, rays: f64) -> Spec {
        let chooses = self.builder().options.iter().any(|option| option.key == RAYS.key);
        if chooses && self.option(RAYS.key).is_none() {
            self.options.push((RAYS.key.to_owned(), rays.to_string()));
        }
        self
    }

    /// Option `codes`.
    fn codes(&self) -> Result<Option<Codes>> {
        self.option(CODES.key).map(str::parse).transpose()
    }

    /// Option `collapse`; `sah` where it was not given.
    fn collapse(&self) -> Result<Collapse> {
        match self.option(COLLAPSE.key) {
            None | Some("sah") => Ok(Collapse::SAH),
            Some("off") => Ok(Collapse::OFF),
            Some(other) => Err(self.wrong_value(&COLLAPSE, other)),
        }
    }

    /// The value of an option that is a number, or what it is where it was not given.
    fn number(&self, option: &BuilderOption, default: u32) -> Result<u32> {
        let Some(value) = self.option(option.key) else { return Ok(default) };
        value.parse().map_err(|_| self.wrong_value(option, value))
    }

    /// Those of `lbvh`, and `bits` and `treelet`.
    fn hlbvh_options(&self) -> Result<builder::Options> {
        let bits = self.option(BITS.key).map(|_| self.number(&BITS, 0)).transpose()?;
        let method = Method::Hlbvh(Treelets { bits, primitives: self.number(&TREELET, Treelets::DEFAULT.primitives)? });
        method.check()?;
        Ok(builder::Options { method, ..self.lbvh_options()? })
    }

    /// Those of `lbvh`, and `radius`.
    fn ploc_options(&self) -> Result<builder::Options> {
        let method = Method::Ploc { radius: self.number(&RADIUS, PLOC_RADIUS)? };
        method.check()?;
        Ok(builder::Options { method, ..self.lbvh_options()? })
    }

    /// Those of `lbvh`, and `window` and `radius`.
    fn hploc_options(&self) -> Result<builder::Options> {
        let size = self.number(&WINDOW, Window::DEFAULT.size)?;
        let radius = self.number(&RADIUS, Window::DEFAULT.radius)?;
        let method = Method::Hploc(Window { size, radius });
        method.check()?;
        Ok(builder::Options { method, ..self.lbvh_options()? })
    }

    /// Option `radius` of PLOC; 25 where it was not given.
    fn ploc_radius(&self) -> Result<usize> {
        let radius = self.number(&RADIUS, 25)?;
        if radius > 0 { Ok(radius as usize) } else { Err(self.wrong_value(&RADIUS, "0")) }
    }

    /// Option `termination`, if `optimise` and `collapse` leave it a choice: both need leaves of one triangle.
    fn sweep_leaves(&self) -> Result<Leaves> {
        let single = !self.collapse()?.enabled || self.reinsertion()?.is_some();
        match self.option(TERMINATION.key) {
            Some("off") => Ok(Leaves::Single),
            None | Some("sah") if single => Ok(Leaves::Single),
            None | Some("sah") => Ok(Leaves::Terminated),
            Some(other) => Err(self.wrong_value(&TERMINATION, other)),
        }
    }

    /// Option `optimise` where it is a time.
    fn time_to_optimise(&self) -> Option<Result<Duration>> {
        let value = self.option(OPTIMISE.key)?;
        let milliseconds = value.strip_suffix("ms")?.parse().ok();
        let time = milliseconds.and_then(|ms: f64| Duration::try_from_secs_f64(1e-3 * ms).ok());
        Some(time.ok_or_else(|| self.wrong_value(&OPTIMISE, value)))
    }

    /// Option `optimise`; off where it was not given. For a time, the pass that tells how many there is time for.
    fn reinsertion(&self) -> Result<Option<reinsertion::Options>> {
        use reinsertion::Options;
        if let Some(time) = self.time_to_optimise() {
            return time.map(|_| Some(Options::FAST));
        }
        Ok(match self.option(OPTIMISE.key) {
            None | Some("off") => None,
            Some("fast") => Some(Options::FAST),
            Some("medium") => Some(Options::MEDIUM),
            Some("high") => Some(Options::HIGH),
            Some(_) => Some(Options::of_passes(self.number(&OPTIMISE, 0)?)),
        })
    }

    fn host_options(&self, hierarchy: Hierarchy) -> Result<host::Options> {
        if self.time_to_optimise().is_some() {
            let what = "on the host rounds are not timed; take fast, medium, high or a number of passes";
            return Err(Error::Argument(format!("builder {self}: {}: {what}", OPTIMISE.key)));
        }
        let (codes, collapse) = (self.codes()?, self.collapse()?);
        Ok(host::Options { hierarchy, codes, reinsertion: self.reinsertion()?, collapse })
    }

    /// The subject of a builder on the host.
    fn on_host<'a>(&self, mesh: &'a Mesh, hierarchy: Hierarchy) -> Result<Box<dyn Subject + 'a>> {
        Ok(Box::new(Host::new(&self.to_string(), mesh, self.host_options(hierarchy)?)))
    }

    /// Option `split`; `None` where it was not given or is 0.
    fn split(&self) -> Result<Option<split::Options>> {
        let Some(value) = self.option(SPLIT.key) else { return Ok(None) };
        let (fraction, most) = value.split_once('/').unwrap_or((value, ""));
        let most = if most.is_empty() { Ok(split::Options::DEFAULT.most) } else { most.parse() };
        let (Ok(fraction), Ok(most)) = (fraction.parse(), most) else { return Err(self.wrong_value(&SPLIT, value)) };
        let options = split::Options { fraction, most };
        options.check().map_err(|_| self.wrong_value(&SPLIT, value))?;
        Ok((fraction > 0.0).then_some(options))
    }

    /// Options `codes`, `split`, `optimise`, `collapse` and `schedule`.
    fn lbvh_options(&self) -> Result<builder::Options> {
        let schedule = match self.option(SCHEDULE.key) {
            None => None,
            Some("chain") => Some(Schedule::Chain),
            Some("persistent") => Some(Schedule::Persistent),
            Some("workgroup") => Some(Schedule::Workgroup),
            Some(other) => return Err(self.wrong_value(&SCHEDULE, other)),
        };
        let (codes, split) = (self.codes()?, self.split()?);
        let (optimise, collapse) = (self.reinsertion()?, self.collapse()?);
        Ok(builder::Options { codes, split, optimise, collapse, schedule, ..builder::Options::DEFAULT })
    }

    /// Options `width`, of a wide tree, and `order`; no width where it is 2 or was not given.
    fn form_and_order(&self) -> Result<(Option<Form>, Option<Order>)> {
        let form = match self.option(WIDTH.key) {
            None | Some("2") => None,
            Some("4") => Some(Form::Four),
            Some("8") => Some(Form::Eight),
            Some("8q") => Some(Form::EightQuantised),
            Some(other) => return Err(self.wrong_value(&WIDTH, other)),
        };
        let order = match self.option(ORDER.key) {
            None => None,
            Some("distance") if form.is_some() => Some(Order::Distance),
            Some("octant") if form == Some(Form::EightQuantised) => Some(Order::Octant),
            Some(other) => return Err(self.wrong_value(&ORDER, other)),
        };
        Ok((form, order))
    }

    /// A builder of ours on the device, with these options and those of [`Spec::form_and_order`].
    fn on_device<'a>(
        &self,
        device: Option<&'a Device>,
        mesh: &'a Mesh,
        options: &builder::Options,
    ) -> Result<Box<dyn Subject + 'a>> {
        let device = given(device)?;
        let limits = &device.limits;
        let (form, order) = self.form_and_order()?;
        let wide = form.map(|form| match order {
            None => Tracer::of(limits, form),
            Some(order) => Tracer::in_order(limits, form, order),
        });
        let mut options = *options;
        if let Some(budget) = self.time_to_optimise() {
            let pass = pass_of_reinsertion(device, mesh, &options)?;
            options.optimise = Some(reinsertion::Options::within(budget?, pass));
        }
        Ok(Box::new(DeviceBvh::new(device, &self.to_string(), mesh, &options, wide)?))
    }

    fn wrong_value(&self, option: &BuilderOption, value: &str) -> Error {
        Error::Argument(format!("builder {self}: {}={value} is not known; take {}", option.key, option.values))
    }

    /// Whether it can be measured with this device.
    pub fn is_possible(&self, device: Option<&Device>) -> bool {
        match self.builder().needs {
            Needs::Nothing => true,
            Needs::Device => device.is_some(),
            Needs::RayQuery => device.is_some_and(Device::has_ray_query),
        }
    }

    /// The subject: the builder on a scene, with everything uploaded that is uploaded once.
    ///
    /// # Errors
    /// The device is missing or lacks something, or there is too little memory.
    pub fn make<'a>(&self, device: Option<&'a Device>, mesh: &'a Mesh) -> Result<Box<dyn Subject + 'a>> {
        (self.builder().make)(self, device, mesh)
    }
}

impl FromStr for Spec {
    type Err = Error;

    fn from_str(text: &str) -> Result<Spec> {
        let mut parts = text.split(':');
        let name = parts.next().unwrap_or_default();
        let builder = BUILDERS.iter().find(|b| b.name == name).ok_or_else(|| {
            let names: Vec<_> = BUILDERS.iter().map(|b| b.name).collect();
            Error::Argument(format!("no builder is called {name:?}; there are {}, or all", names.join(", ")))
        })?;
        let mut spec = Spec { name: name.to_owned(), options: Vec::new() };
        for part in parts {
            let (key, value) = part.split_once('=').ok_or_else(|| {
                Error::Argument(format!("builder {text}: option {part:?} has no value; write {part}=VALUE"))
            })?;
            if !builder.options.iter().any(|option| option.key == key) {
                let keys: Vec<_> = builder.options.iter().map(|option| option.key).collect();
                let there_are =
                    if keys.is_empty() { "it takes none".into() } else { format!("it takes {}", keys.join(", ")) };
                return Err(Error::Argument(format!("builder {text}: {name} has no option {key:?}; {there_are}")));
            }
            if spec.option(key).is_some() {
                return Err(Error::Argument(format!("builder {text}: {key} is given twice; give it once")));
            }
            spec.options.push((key.to_owned(), value.to_owned()));
        }
        (builder.check)(&spec)?;
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
        for option in builder.options {
            text += &format!("  {:18}   :{}=  {}\n", "", option.key, option.values);
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn rays_a_build_reach_the_builder_that_chooses_by_them() {
        let for_rays = |text: &str| text.parse::<Spec>().expect("known").for_rays(2e6).to_string();
        assert_eq!(for_rays("auto"), "auto:rays=2000000");
        assert_eq!(for_rays("auto:rays=5"), "auto:rays=5");
        assert_eq!(for_rays("lbvh"), "lbvh");
    }

    #[test]
    fn what_is_wrong_is_named_with_what_there_is() {
        assert!(error_of("lvbh").contains("no builder is called \"lvbh\"; there are"));
        assert!(error_of("lbvh-host:codes=mc31").contains("emc64var-nosize"));
        assert!(error_of("lbvh-host:collapse=maybe").contains("take sah or off"));
        assert!(error_of("lbvh:width=3").contains("width=3 is not known; take 2, 4, 8 or 8q"));
        assert!(
            error_of("lbvh:width=4:order=octant").contains("order=octant is not known; take distance or octant (of")
        );
        for wrong in ["lots", "-0.1", "1.5", "nan", "0.3/0", "0.3/x"] {
            let says = format!("split={wrong} is not known; take a number from 0 to 1");
            assert!(error_of(&format!("hploc:split={wrong}")).contains(&says), "{wrong}");
        }
        for wrong in ["ms", "-1ms", "infms", "20s"] {
            assert!(error_of(&format!("lbvh:optimise={wrong}")).contains("a time for it as in 20ms"), "{wrong}");
        }
        assert!(error_of("lbvh-host:optimise=20ms").contains("on the host rounds are not timed"));
        assert!(error_of("lbvh-host:codes").contains("write codes=VALUE"));
        assert!(error_of("lbvh-host:codes=mc30:codes=mc63").contains("given twice"));
        assert!(error_of("lbvh-host:radius=25").contains("no option \"radius\"; it takes codes, collapse, optimise"));
        assert!(error_of("driver-fast-build:codes=mc30").contains("it takes none"));
        assert!(error_of("auto:rays=many").contains("no number of rays"));
        assert!(error_of("").contains("-b all"));
        assert!(error_of(",").contains("-b all"));
    }
}
