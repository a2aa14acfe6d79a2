//! What is chosen among.

use super::SceneClass;
use crate::device::Device;
use crate::subjects::builders::Spec;

/// For scenes whose codes tell triangles apart: builders with their options, as `-b` takes them, from the fastest build to the best
/// tree.
///
/// A row more is a candidate more: it is measured with the others the next time, for the cache takes no table of other
/// candidates. The list is short on purpose. Trees that are traced within 10% of each other cannot be told apart by a
/// calibration, and a builder that never wins by 10% only adds a chance to be taken by mistake. docs/notes/auto.md has the
/// figures.
const PLAIN: [&str; 5] = [
    "lbvh",
    "lbvh:width=8q",
    "hploc:width=8q",
    // Reinsertion takes long where the tree it begins with is very poor: robust codes see to it that it is not.
    "ploc:codes=emc64var+robust:optimise=fast:width=8q",
    "lbvh:codes=emc64var+robust:optimise=high:width=8q",
];

/// The same for crowded scenes: by codes that far and huge primitives cost nothing.
const CROWDED: [&str; 4] = [
    "lbvh:codes=emc64var+robust",
    "lbvh:codes=emc64var+robust:width=8q",
    "ploc:codes=emc64var+robust:optimise=fast:width=8q",
    "lbvh:codes=emc64var+robust:optimise=high:width=8q",
];

/// All candidates, each once.
pub fn names() -> impl Iterator<Item = &'static str> {
    PLAIN.into_iter().chain(CROWDED.into_iter().filter(|name| !PLAIN.contains(name)))
}

/// All candidates that this device can build.
pub fn possible(device: &Device) -> Vec<Spec> {
    specs(device, names())
}

/// The candidates for scenes of a class that this device can build.
pub fn possible_for(device: &Device, class: &SceneClass) -> Vec<Spec> {
    specs(device, if class.is_crowded { CROWDED.to_vec() } else { PLAIN.to_vec() })
}

fn specs(device: &Device, names: impl IntoIterator<Item = &'static str>) -> Vec<Spec> {
    let specs = names.into_iter().map(|name| name.parse::<Spec>().expect("a unit test parses every candidate"));
    specs.filter(|spec| spec.is_possible(Some(device))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_candidate_is_a_builder_once() {
        let all: Vec<&str> = names().collect();
        for (i, name) in all.iter().enumerate() {
            let spec: Spec = name.parse().unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(spec.to_string(), *name);
            assert!(!all[..i].contains(name), "{name} is there twice");
            assert_ne!(spec.builder().name, "auto", "a choice is none of its own candidates");
        }
        assert!(PLAIN.iter().chain(&CROWDED).all(|name| all.contains(name)));
    }
}
