//! What is chosen among.

use crate::gpu::Device;
use crate::measure::builders::Spec;

/// Builders with their options, as `-b` takes them. A row more is a candidate more: it is measured with the others the next time,
/// as figures of another list are not taken from the cache.
///
/// Those that are worse than another at both ends of the scale (few rays a build, and many) cost time at calibration and nothing
/// else.
pub const CANDIDATES: &[&str] = &[
    // The shortest codes: the fewest passes of the sort.
    "lbvh:codes=mc30",
    // Codes by the number of triangles.
    "lbvh",
    // Long codes that look at sizes.
    "lbvh:codes=emc64var",
    "hploc",
    "hploc:codes=emc64var",
    "ploc",
    "ploc:radius=25",
];

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
    }
}
