//! `codes.html`: what codes are worth and what they cost, as people read it. It follows from `codes.jsonl` alone.

mod added_time;
mod sweep;

use super::points::CodesEntry;
use super::tables::{AddedTimes, Sweeps, lambda, signed};
use crate::Result;
use crate::report::{Chart, Document, Section, beside, document, lines};
use maud::{Markup, html};
use std::path::{Path, PathBuf};

/// What an experiment has on the page, and its charts.
type Part = (Section, Vec<Chart>);

/// Writes `codes.html` and its charts into `folder`, from the `codes.jsonl` there; gives the page's path. The page names the others that
/// lie there.
///
/// # Errors
/// The records cannot be read; a file cannot be written.
pub fn write(folder: &Path) -> Result<PathBuf> {
    let entries: Vec<CodesEntry> = lines::entries(folder)?;
    let setting = entries.iter().find_map(|entry| match entry {
        CodesEntry::Setting(setting) => Some(setting),
        _ => None,
    });
    let failures = entries.iter().filter_map(|entry| match entry {
        CodesEntry::Failure(failure) => Some(failure),
        _ => None,
    });
    let (sweeps, added) = (Sweeps::of(&entries), AddedTimes::of(&entries));
    let parts = [sweep::part(&sweeps)?, added_time::part(&added)?];
    let (parts, charts): (Vec<Section>, Vec<Vec<Chart>>) = parts.into_iter().flatten().unzip();
    let mut sections = vec![Section::new("summary", "Summary", summary(&sweeps, &added))];
    sections.extend(parts);
    sections.push(Section::method(Some(beside::CODES.records), terms()));
    let document = Document {
        tab: "codes".into(),
        kicker: "hedgerow codes",
        title: "What codes are worth, and what they cost".into(),
        lead: "The order of primitives along a curve makes a tree. Binning and mipping look at the scene before they choose the curve: \
               what does that win for rays, and what does it add to a build? Beside Riemersma 2024, tables 7 to 11."
            .into(),
        setting,
        failures: document::told(failures),
        sections,
    };
    document.write(folder, &beside::CODES, charts.iter().flatten())
}

fn summary(sweeps: &Sweeps<'_>, added: &AddedTimes<'_>) -> Markup {
    let best = |kind: &str| {
        let mean = |stretch| {
            sweeps.mean(stretch, |scene, stretch| Some(sweeps.rays(scene, stretch, kind)?.change_percent.median))
        };
        let all = sweeps.stretches().into_iter().filter_map(|stretch| Some((stretch, mean(stretch)?)));
        all.max_by(|a, b| a.1.total_cmp(&b.1))
    };
    let means = added.codes().into_iter().filter_map(|codes| Some((codes, added.mean(codes)?)));
    let means: Vec<(&str, f64)> = means.collect();
    let dearest = means.iter().max_by(|a, b| a.1.total_cmp(&b.1));
    let cheapest = means.iter().min_by(|a, b| a.1.total_cmp(&b.1));
    html! {
        @if sweeps.0.is_empty() && added.0.is_empty() { p { "Nothing was measured." } }
        @for kind in sweeps.kinds() {
            @if let Some((stretch, percent)) = best(kind) {
                p { b { (kind) } " rays are fastest with λ = " (lambda(stretch)) ": " (signed(percent)) "% in the mean over the scenes." }
            }
        }
        @if let (Some((most, most_percent)), Some((least, least_percent))) = (dearest, cheapest) {
            p {
                "Codes add from " (signed(*least_percent)) "% (" code { (least) } ") to " (signed(*most_percent)) "% (" code { (most) }
                ") to a build, in the mean over the scenes."
            }
        }
    }
}

fn terms() -> Markup {
    html! {
        dt { "The base" }
        dd {
            "The same builder with extended Morton codes of 64 bits without the size, " code { "emc64var-nosize" } ": what the thesis "
            "holds its codes against."
        }
        dt { "λ" }
        dd {
            "Binning splits a counted grid where the score is least: (1 − λ) · SAH + λ · the stretch factors of both sides (equation 11). "
            "Splits are of depth 4, counts of 4 bits."
        }
        dt { "Speed" }
        dd {
            "Rays of the scene through both trees in turn, after a warm-up that does not count; the change run by run, its median, least "
            "and greatest. " b { "diffuse1" } " stands for global illumination; " b { "shadow" } " for soft shadows: a random point of each "
            "light. Of each run the least of three."
        }
        dt { "Work" }
        dd { "3 · steps + 2 · tests a ray: what the SAH cost expects, counted. It has no noise either." }
        dt { "SAH cost" }
        dd { "(3 · Σ area of inner nodes + 2 · Σ area × triangles of leaves) / area of the root; it has no noise." }
        dt { "Added time" }
        dd {
            "A run is three builds with the base's codes and three with the others', of each the least; its ratio, in the median of the runs, "
            "and the least and greatest."
        }
        dt { "Means" }
        dd { "Over scenes, of ratios: geometric. Those of the thesis are of its percents." }
        dt { "Riemersma 2024" }
        dd {
            "Of a GPU (RX 7800 XT) and a four-wide LBVH; games, or other meshes of the same things. Context: what stands above what compares, "
            "figures do not. Of table 11 the scan has lost a third."
        }
    }
}
