//! Which builders are measured where `-b` does not say: those of a list that this build of the program knows.

use crate::subjects::builders::{BUILDERS, Spec};
use crate::{Error, Result};

/// Against which the others are held: full-sweep SAH, as in the thesis.
pub const BASE: &str = "sweep";

/// The builders of the thesis, ours beside them, and peers.
const LISTED: [&str; 19] = [
    BASE,
    "binned",
    "binned:leaf=2",
    "binned:leaf=2:termination=flat",
    "binned:axes=all",
    "aac-hq",
    "aac-fast",
    "aac-hq:codes=mc63/30",
    "aac-fast:codes=mc63/30",
    "bonsai",
    "bonsai-p",
    "bonsai-p2",
    "incremental",
    "ploc-host:radius=10",
    "host-fast",
    "host-best",
    "obvhs-fastest",
    "obvhs-fast",
    "obvhs-medium",
];

/// Names of peers whose builders are all measured, whatever they are called.
const PEERS: &str = "embree-";

/// Those that `--quick` leaves out: they take longer than all others together.
const SLOW: [&str; 6] = [
    "ploc-host:radius=25",
    "ploc-host:radius=100",
    "sweep:optimise=insertion",
    "binned:optimise=insertion",
    "incremental:optimise=insertion",
    "sweep:optimise=high",
];

/// What is measured, and what is not.
#[derive(Debug, Clone, PartialEq)]
pub struct Choice {
    /// The builders.
    pub builders: Vec<Spec>,
    /// Those of the list that this build does not know.
    pub unknown: Vec<String>,
}

impl Choice {
    /// The listed builders that this build knows.
    pub fn by_default(is_quick: bool) -> Choice {
        let slow = SLOW.into_iter().filter(|_| !is_quick);
        let peers = BUILDERS.iter().map(|builder| builder.name).filter(|name| name.starts_with(PEERS));
        let mut choice = Choice { builders: Vec::new(), unknown: Vec::new() };
        for name in LISTED.into_iter().chain(slow).chain(peers) {
            match name.parse() {
                Ok(spec) => choice.builders.push(spec),
                Err(_) => choice.unknown.push(name.to_owned()),
            }
        }
        choice
    }

    /// Those that were asked for.
    ///
    /// # Errors
    /// One builds no BVH on the host, or says where it is traced, which the command does itself.
    pub fn of(asked: Vec<Spec>) -> Result<Choice> {
        for spec in &asked {
            let wrong = |what: &str| Err(Error::Argument(format!("-b {spec}: {what}")));
            if !spec.builder().builds_bvh_on_host() {
                return wrong("cpu-builders measures builders of BVHs on the CPU; take hedgerow bench for this one");
            }
            if spec.option("trace").is_some() {
                return wrong("every tree is traced on the host and on the device; leave trace= out");
            }
        }
        Ok(Choice { builders: asked, unknown: Vec::new() })
    }

    /// What a reader is told of the builders that are missing.
    pub fn note(&self) -> Option<String> {
        let names = self.unknown.join(", ");
        (!self.unknown.is_empty())
            .then(|| format!("Left out, for this build of the program has no such builder or option: {names}."))
    }
}

/// The same builder on one thread; `None` where it cannot be told, or was.
pub fn on_one_thread(spec: &Spec) -> Option<Spec> {
    if spec.option("threads").is_some() {
        return None;
    }
    format!("{spec}{}", super::measured::ONE_THREAD).parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subjects::builders::parse_list;

    #[test]
    fn every_listed_builder_is_measured_or_named_as_missing() {
        let choice = Choice::by_default(false);
        let names: Vec<String> = choice.builders.iter().map(Spec::to_string).collect();
        for name in LISTED.into_iter().chain(SLOW) {
            let is_measured = names.iter().any(|other| other == name);
            assert_ne!(is_measured, choice.unknown.iter().any(|other| other == name), "{name}");
        }
        assert_eq!(names[0], BASE);
        let quick = Choice::by_default(true);
        assert!(quick.builders.len() < choice.builders.len());
        let unknown = Choice { builders: Vec::new(), unknown: vec!["x".into(), "y:z=1".into()] };
        assert!(unknown.note().expect("two are missing").contains("x, y:z=1"));
    }

    #[test]
    fn what_cannot_be_measured_here_is_refused_with_what_to_do() {
        let error = |list: &str| Choice::of(parse_list(list).expect(list)).expect_err(list).to_string();
        assert!(error("sweep,lbvh").contains("-b lbvh: ") && error("lbvh").contains("hedgerow bench"));
        assert!(error("kd-exact").contains("hedgerow bench"));
        assert!(error("sweep:trace=device").contains("leave trace= out"));
        assert_eq!(
            Choice::of(parse_list("sweep,lbvh-host").expect("known")).expect("both on the host").builders.len(),
            2
        );
    }
}
