//! The page's section on `auto`: its choices for every scene and a number of rays per build, beside the best in hindsight.

use super::SceneCost;
use super::hindsight::{self, Choice, GOOD, Pair, RAYS};
use crate::measure::record::Record;
use crate::report::columns::Table;
use crate::report::names::{distinct, short};
use crate::report::numbers::short_count;
use maud::{Markup, html};

/// Empty where nothing was chosen, or nothing that was chosen was measured.
pub(crate) fn section(choices: &[Choice], records: &[&Record]) -> Markup {
    let taken: Vec<SceneCost> = records.iter().filter_map(|record| SceneCost::of(record)).collect();
    let pairs = hindsight::pairs(choices, &taken);
    let Some(part) = hindsight::good_part(&pairs) else { return html! {} };
    let scenes = distinct(pairs.iter().map(|pair| pair.choice.scene.as_str()));
    let of = |scene: &str, rays: f64| pairs.iter().find(|p| p.choice.scene == scene && p.choice.rays == rays);
    let table = Table::new("Choices beside the best", scenes)
        .id("choices-table")
        .caption("Choices of auto beside the best in hindsight")
        .name("scene", |scene| *scene);
    let table = RAYS.into_iter().fold(table, |table, rays| {
        table.figure(&short_count(rays), "rays a build", move |scene| cell(of(scene, rays)))
    });
    html! {
        section #choosing {
            h2 { "What auto chooses" }
            p {
                "For each scene and number of rays a build: the builder that " code { "auto" } " takes, by what candidates cost on generated "
                "scenes on this device, and how many times the best candidate's total time that takes. "
                b { (format!("{:.0}%", 100.0 * part)) } " of the " (pairs.len()) " choices are within "
                (format!("{:.0}%", 100.0 * GOOD)) " of the best."
            }
            (table.html())
            p { "If one candidate were always taken, this many choices would be within the same:" }
            ul {
                @for (builder, part) in hindsight::good_parts_of_each(&pairs, &taken) {
                    li { code { (short(&builder)) } ": " (format!("{:.0}%", 100.0 * part)) }
                }
            }
        }
    }
}

fn cell(pair: Option<&Pair>) -> Markup {
    let Some(pair) = pair else { return html! { td.number data-value="" { "–" } } };
    let is_best = pair.best == pair.choice.builder;
    html! {
        td.number .wrong[pair.ratio() > 1.0 + GOOD] data-value=(pair.ratio()) {
            (format!("{:.2}×", pair.ratio()))
            small { (short(&pair.choice.builder)) @if !is_best { br; "best: " (short(&pair.best)) } }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::record::{BuildRecord, QualityRecord, SCHEMA, TraceRecord};

    fn record(builder: &str, median_ms: f64, mrays_s: f64) -> Record {
        let build = BuildRecord {
            runs: 1,
            median_ms,
            min_ms: median_ms,
            max_ms: median_ms,
            timer: "device".into(),
            ..BuildRecord::default()
        };
        let trace = TraceRecord {
            rays: "primary".into(),
            count: 100,
            hits: 50,
            mrays_s,
            steps: None,
            tests: None,
            runs: 1,
            checksum: "1".into(),
        };
        Record {
            schema: SCHEMA,
            scene: "a".into(),
            triangles: 10,
            builder: builder.into(),
            kind: "bvh2".into(),
            device: "d".into(),
            driver: "d".into(),
            subgroup: 8,
            commit: "c".into(),
            when: "w".into(),
            build,
            memory: Default::default(),
            quality: QualityRecord::default(),
            trace: vec![trace],
            valid: Some(true),
        }
    }

    #[test]
    fn choices_stand_beside_the_best_that_was_measured() {
        // Two candidates, and one that is none and is better than both.
        let records =
            [record("lbvh", 1.0, 1.0), record("lbvh:width=8q", 2.0, 2.0), record("driver-fast-build", 0.1, 9.0)];
        let records: Vec<&Record> = records.iter().collect();
        let choice = |rays, builder: &str| Choice { scene: "a".into(), rays, builder: builder.into() };
        // 1 ms + 1 µs a ray against 2 ms + 0.5 µs: they meet at 2,000 rays.
        let choices = [choice(1e4, "lbvh:width=8q"), choice(1e5, "lbvh"), choice(1e6, "hploc:width=8q")];
        let taken: Vec<SceneCost> = records.iter().filter_map(|record| SceneCost::of(record)).collect();
        let pairs = hindsight::pairs(&choices, &taken);
        assert_eq!(pairs.len(), 2, "what was not measured has no time");
        assert_eq!((pairs[0].ratio(), pairs[0].best.as_str()), (1.0, "lbvh:width=8q"));
        assert!((pairs[1].ratio() - 101.0 / 52.0).abs() < 1e-12 && pairs[1].best == "lbvh:width=8q", "{:?}", pairs[1]);
        assert_eq!(hindsight::good_part(&pairs), Some(0.5));
        let each = hindsight::good_parts_of_each(&pairs, &taken);
        assert_eq!(each, [("lbvh".to_owned(), 0.0), ("lbvh:width=8q".to_owned(), 1.0)]);
        let page = section(&choices, &records).into_string();
        assert!(page.contains("1.94×") && page.contains("best: lbvh width 8q") && page.contains("50%"), "{page}");
        assert_eq!(section(&choices[2..], &records).into_string(), "");
        assert_eq!(hindsight::good_part(&[]), None);
    }
}
