//! What is chosen among.

use crate::device::Device;
use crate::measure::builders::Spec;

/// Builders with their options, as `-b` takes them. A row more is a candidate more: it is measured with the others the next time,
/// as figures of another list are not taken from the cache.
///
/// Those that are worse than another at both ends of the scale (few rays a build, and many) cost time at calibration and nothing
/// else. What is not here costs no more than 2%: of 23 builders on 18 generated scenes and of 16 on 13 real ones, for 1e4 to 1e9
/// rays a build, none was better than the best of these by more, with the work of their rays at lavapipe's prices. Left out are
/// trees of width 2 but for the LBVH, width 4, and reinsertion behind other builders.
pub const CANDIDATES: &[&str] = &[
    // The fastest build.
    "lbvh",
    // By codes that far and huge primitives cost nothing: where short codes run out.
    "lbvh:codes=emc64var+robust",
    // A little more time for a tree that is traced a quarter faster.
    "lbvh:width=8q",
    "lbvh:codes=emc64var+robust:width=8q",
    "hlbvh:width=8q",
    "hploc:width=8q",
    "ploc:width=8q",
    "ploc:codes=emc64var+robust:width=8q",
    // For many rays: reinsertion, by how much there is to be had. By robust codes, as it takes long where the tree it begins with is
    // very poor.
    "lbvh:codes=emc64var+robust:optimise=fast:width=8q",
    "lbvh:codes=emc64var+robust:optimise=medium:width=8q",
    "lbvh:codes=emc64var+robust:optimise=high:width=8q",
    "ploc:codes=emc64var+robust:optimise=fast:width=8q",
    "ploc:codes=emc64var+robust:optimise=high:width=8q",
];

/// Of each layout the one that is built fastest.
pub const FASTEST: [&str; 2] = ["lbvh", "lbvh:width=8q"];

/// The candidates that this device can build.
pub fn possible(device: &Device) -> Vec<Spec> {
    let specs = CANDIDATES.iter().map(|name| name.parse::<Spec>().expect("a unit test parses every candidate"));
    specs.filter(|spec| spec.is_possible(Some(device))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_candidate_is_a_builder_once() {
        for (i, name) in CANDIDATES.iter().enumerate() {
            let spec: Spec = name.parse().unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(spec.to_string(), *name);
            assert!(!CANDIDATES[..i].contains(name), "{name} is there twice");
            assert_ne!(spec.builder().name, "auto", "a choice is none of its own candidates");
        }
        assert!(FASTEST.iter().all(|name| CANDIDATES.contains(name)));
    }
}
