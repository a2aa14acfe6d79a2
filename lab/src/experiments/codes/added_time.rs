//! What codes add to the time of a build (Riemersma 2024, section 4.1 and table 7): a build with each code beside one with the
//! base's, in turn.

use super::points::{AddedTime, CodesEntry};
use super::{BASE, CodesSetup, WARM_UPS, least_of_a_run, percent};
use crate::Result;
use crate::measure::{Failure, Sink, Spread, in_turn, ratios};
use crate::scene::Scene;
use crate::subjects::Subject;
use hedgerow::bvh::codes::{Binning, Code, CodeBounds, Codes};

/// Every code that there is but the base: those without a grid, by all bounds of [`Code::Emc64Var`], and the rows of table 7.
pub fn all_codes() -> Vec<Codes> {
    let plain = Code::ALL.into_iter().filter(|code| !matches!(code, Code::Bin(_))).map(Code::full);
    let narrower = CodeBounds::ALL.into_iter().filter(|bounds| *bounds != CodeBounds::Full);
    let bounded = narrower.filter_map(|bounds| Code::Emc64Var.full().with_bounds(bounds));
    let binnings = [2, 4, 6].into_iter().flat_map(|depth| (0..=9).map(move |count_bits| (depth, count_bits)));
    let binned = binnings.filter_map(|(depth, count_bits)| Binning::new(depth, count_bits, Binning::STRETCH));
    plain.chain(bounded).chain(binned.map(|binning| Code::Bin(binning).full())).filter(|codes| *codes != BASE).collect()
}

/// Measures what each of `codes` adds on a scene. One that fails is told as an entry, and the rest goes on.
///
/// # Errors
/// The base cannot be built; those of `point`.
pub fn measure(stage: &CodesSetup<'_>, scene: &Scene, codes: &[Codes], point: &mut Sink<'_, CodesEntry>) -> Result<()> {
    let base_spec = stage.with(BASE)?;
    let mut base = base_spec.make_for(stage.device, scene)?;
    for &codes in codes {
        let spec = stage.with(codes)?;
        let of = format!("{}, {spec}", scene.name);
        (stage.say)(&of);
        let measured = spec.make_for(stage.device, scene).and_then(|mut subject| {
            // Two at a time: the structures of all would not fit into memory together.
            let mut subjects: [&mut dyn Subject; 2] = [base.as_mut(), subject.as_mut()];
            let times = in_turn(&mut subjects, WARM_UPS, stage.runs, |subject| {
                least_of_a_run(|| Ok(subject.build()?.milliseconds))
            });
            let times: Vec<Vec<f64>> = times.into_iter().collect::<Result<_>>()?;
            let added: Vec<f64> = ratios(&times[1], &times[0]).into_iter().map(percent).collect();
            Ok(AddedTime {
                scene: scene.name.clone(),
                triangles: scene.mesh.triangles.len() as u64,
                codes: codes.to_string(),
                builder: spec.to_string(),
                base: base_spec.to_string(),
                base_ms: Spread::of_some(&times[0])?,
                build_ms: Spread::of_some(&times[1])?,
                added_percent: Spread::of_some(&added)?,
            })
        });
        point(match measured {
            Ok(added) => CodesEntry::AddedTime(added),
            Err(error) => CodesEntry::Failure(Failure::named(of, error)),
        })?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::super::published;
    use super::*;

    #[test]
    fn every_row_of_the_thesis_and_every_code_is_measured_once() {
        let names: Vec<String> = all_codes().iter().map(Codes::to_string).collect();
        let of_the_thesis = names.iter().filter(|name| published::mean_added_percent(name).is_some());
        assert_eq!(of_the_thesis.count(), 33, "{names:?}");
        for code in Code::ALL {
            let name = code.full().to_string();
            assert_eq!(names.iter().filter(|n| **n == name).count(), usize::from(code.full() != BASE), "{name}");
        }
        assert!(names.iter().any(|name| name == "emc64var+robust") && !names.contains(&BASE.to_string()), "{names:?}");
    }
}
