//! Which trees are compared, and with which.

use crate::subjects::builders::Spec;
use crate::{Error, Result};

/// Against which the others are held where `-b` does not say: the tree by surface area, over the planes that the trees by other
/// heuristics are over. Those go down to single triangles, so this one does.
pub const REFERENCE: &str = "binned:axes=all:bins=10:termination=off";

/// Trees by area, by codes, by clustering and by splits; and one by each heuristic.
const LISTED: [&str; 13] = [
    REFERENCE,
    "sweep",
    "lbvh",
    "ploc",
    "hploc",
    "hploc:optimise=high",
    "sbvh",
    "binned:axes=all:bins=10:heuristic=interior",
    "binned:axes=all:bins=10:heuristic=interior-hq",
    "binned:axes=all:bins=10:heuristic=interior-fast",
    "binned:axes=all:bins=10:heuristic=perspective",
    "binned:axes=all:bins=10:heuristic=osah",
    "binned:axes=all:bins=10:heuristic=rdh",
];

/// Options that say how a tree is traced, or that it is not traced as it is.
const OF_TRACING: [&str; 3] = ["trace", "any-hit", "width"];

/// The trees that are compared where `-b` does not say.
///
/// # Panics
/// One of the list is not known.
pub fn by_default() -> Vec<Spec> {
    LISTED.iter().map(|name| name.parse().expect("a builder of this program")).collect()
}

/// Those that were asked for; the first is the reference.
///
/// # Errors
/// There are fewer than two; one builds no BVH, or says how it is traced, which the command does itself.
pub fn checked(asked: Vec<Spec>) -> Result<Vec<Spec>> {
    for spec in &asked {
        let wrong = |what: String| Err(Error::Argument(format!("-b {spec}: {what}")));
        if spec.kd().is_ok() {
            return wrong("a kd-tree is not compared with BVHs; take builders of BVHs".into());
        }
        if let Some(option) = OF_TRACING.into_iter().find(|option| spec.option(option).is_some()) {
            return wrong(format!(
                "every tree is traced in the same way, on the host and on the device; leave {option}= out"
            ));
        }
    }
    match &asked[..] {
        [] => Err(Error::Argument(
            "every builder of -b needs a device, and there is none; name two that build on the host".into(),
        )),
        [alone] => {
            Err(Error::Argument(format!("-b {alone}: one tree has nothing to be compared with; name a second one")))
        }
        _ => Ok(asked),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::subjects::builders::{Needs, parse_list};

    #[test]
    fn at_least_eight_trees_are_compared_even_without_a_device() {
        let all = by_default();
        assert_eq!(all[0].to_string(), REFERENCE);
        assert!(all.iter().filter(|spec| spec.needs() == Needs::Nothing).count() >= 8);
        assert_eq!(checked(all.clone()).expect("all of them can be compared"), all);
    }

    #[test]
    fn what_cannot_be_compared_is_refused_with_what_to_do() {
        let error = |list: &str| checked(parse_list(list).expect(list)).expect_err(list).to_string();
        assert!(error("sweep").contains("-b sweep: one tree has nothing to be compared with"));
        assert!(error("sweep,kd-exact").contains("-b kd-exact: a kd-tree"));
        assert!(error("sweep,binned:trace=device").contains("leave trace= out"));
        assert!(error("sweep,lbvh:width=8q").contains("leave width= out"));
        assert!(error("sweep,binned:any-hit=sato").contains("leave any-hit= out"));
    }
}
