//! What was measured as tables: for the terminal, and what the page's tables are made of.

use super::points::{AddedTime, CodesEntry, Swept, SweptRays};
use super::published;
use crate::measure::geometric_mean;
use crate::report::distinct;
use crate::report::table::{or_dash, with_header};
use std::fmt::Write;

/// A change in percent, with its sign.
pub(super) fn signed(percent: f64) -> String {
    // No minus before what is rounded to nothing.
    let text = format!("{percent:+.1}");
    if text == "-0.0" { "+0.0".into() } else { text }
}

/// λ by 1/λ.
pub(super) fn lambda(stretch: u32) -> String {
    if stretch == 1 { "1".into() } else { format!("1/{stretch}") }
}

/// The mean of changes in percent, as ratios have it.
pub(super) fn mean_percent(changes: impl Iterator<Item = f64>) -> Option<f64> {
    geometric_mean(changes.map(|percent| 1.0 + percent / 100.0)).map(super::percent)
}

/// All sweeps of a run.
pub(super) struct Sweeps<'p>(pub Vec<&'p Swept>);

impl<'p> Sweeps<'p> {
    pub fn of(entries: &'p [CodesEntry]) -> Sweeps<'p> {
        let swept = |entry: &'p CodesEntry| if let CodesEntry::Sweep(swept) = entry { Some(swept) } else { None };
        Sweeps(entries.iter().filter_map(swept).collect())
    }

    pub fn scenes(&self) -> Vec<&'p str> {
        distinct(self.0.iter().map(|swept| swept.scene.as_str()))
    }

    pub fn kinds(&self) -> Vec<&'p str> {
        distinct(self.0.iter().flat_map(|swept| &swept.rays).map(|rays| rays.rays.as_str()))
    }

    /// Every 1/λ, from 1 on.
    pub fn stretches(&self) -> Vec<u32> {
        let mut all = distinct(self.0.iter().map(|swept| swept.stretch));
        all.sort_unstable();
        all
    }

    pub fn at(&self, scene: &str, stretch: u32) -> Option<&'p Swept> {
        self.0.iter().copied().find(|swept| swept.scene == scene && swept.stretch == stretch)
    }

    pub fn rays(&self, scene: &str, stretch: u32, kind: &str) -> Option<&'p SweptRays> {
        self.at(scene, stretch)?.rays.iter().find(|rays| rays.rays == kind)
    }

    /// SAH cost over the base's, in percent more.
    pub fn sah_percent(&self, scene: &str, stretch: u32) -> Option<f64> {
        self.at(scene, stretch)?.relative_sah.map(super::percent)
    }

    /// Work of rays over that through the base's tree, in percent more.
    pub fn work_percent(&self, scene: &str, stretch: u32, kind: &str) -> Option<f64> {
        self.rays(scene, stretch, kind)?.relative_work.map(super::percent)
    }

    /// The mean over the scenes of a figure at a weight.
    pub fn mean(&self, stretch: u32, figure: impl Fn(&str, u32) -> Option<f64>) -> Option<f64> {
        mean_percent(self.scenes().into_iter().filter_map(|scene| figure(scene, stretch)))
    }
}

/// All added times of a run.
pub(super) struct AddedTimes<'p>(pub Vec<&'p AddedTime>);

impl<'p> AddedTimes<'p> {
    pub fn of(entries: &'p [CodesEntry]) -> AddedTimes<'p> {
        let added = |entry: &'p CodesEntry| if let CodesEntry::AddedTime(added) = entry { Some(added) } else { None };
        AddedTimes(entries.iter().filter_map(added).collect())
    }

    pub fn scenes(&self) -> Vec<&'p str> {
        distinct(self.0.iter().map(|added| added.scene.as_str()))
    }

    pub fn codes(&self) -> Vec<&'p str> {
        distinct(self.0.iter().map(|added| added.codes.as_str()))
    }

    pub fn at(&self, scene: &str, codes: &str) -> Option<&'p AddedTime> {
        self.0.iter().copied().find(|added| added.scene == scene && added.codes == codes)
    }

    /// What codes add in the mean over the scenes, in percent.
    pub fn mean(&self, codes: &str) -> Option<f64> {
        let of_codes = self.0.iter().filter(|added| added.codes == codes);
        mean_percent(of_codes.map(|added| added.added_percent.median))
    }
}

/// All tables for the terminal.
pub(super) fn text(entries: &[CodesEntry]) -> String {
    let mut text = String::new();
    let sweeps = Sweeps::of(entries);
    if !sweeps.0.is_empty() {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{}", sweep_text(&sweeps));
    }
    let added = AddedTimes::of(entries);
    if !added.0.is_empty() {
        let _ = writeln!(text, "{}", added_text(&added));
    }
    text.trim_end().to_owned()
}

fn sweep_text(sweeps: &Sweeps<'_>) -> String {
    let stretches = sweeps.stretches();
    let header = ["figure", "scene"].into_iter().map(str::to_owned);
    let mut table = with_header(header.chain(stretches.iter().map(|&stretch| lambda(stretch))), 2);
    let mut rows = |figure: &str, of: &dyn Fn(&str, u32) -> Option<f64>| {
        let scenes = sweeps.scenes();
        for scene in &scenes {
            let cells = stretches.iter().map(|&stretch| or_dash(of(scene, stretch), signed));
            table.add_row([figure.to_owned(), (*scene).to_owned()].into_iter().chain(cells));
        }
        if scenes.len() > 1 {
            let cells = stretches.iter().map(|&stretch| or_dash(sweeps.mean(stretch, of), signed));
            table.add_row([figure.to_owned(), "mean".to_owned()].into_iter().chain(cells));
        }
    };
    rows("SAH", &|scene, stretch| sweeps.sah_percent(scene, stretch));
    for kind in sweeps.kinds() {
        rows(&format!("{kind} work"), &|scene, stretch| sweeps.work_percent(scene, stretch, kind));
    }
    for kind in sweeps.kinds() {
        rows(kind, &|scene, stretch| Some(sweeps.rays(scene, stretch, kind)?.change_percent.median));
    }
    for kind in sweeps.kinds() {
        for (game, by_stretch) in published::games(kind) {
            let cells = stretches.iter().map(|stretch| or_dash(by_stretch.get(stretch).copied(), signed));
            table.add_row([kind.to_owned(), format!("({game})")].into_iter().chain(cells));
        }
    }
    format!(
        "Binning over λ: SAH cost, work of rays (3 · steps + 2 · tests) and speed over the base's, in percent; in brackets games of Riemersma 2024, tables 8 to 11\n\
         {table}"
    )
}

fn added_text(added: &AddedTimes<'_>) -> String {
    let scenes = added.scenes();
    let header = ["codes", "mean"].into_iter().chain(scenes.iter().copied());
    let mut table = with_header(header, 1);
    let with_theirs = |ours: Option<f64>, theirs: Option<f64>| {
        let theirs = theirs.map_or_else(String::new, |percent| format!(" ({percent:.0})"));
        or_dash(ours, signed) + &theirs
    };
    for codes in added.codes() {
        let mean = with_theirs(added.mean(codes), published::mean_added_percent(codes));
        let cells = scenes.iter().map(|scene| {
            let ours = added.at(scene, codes).map(|added| added.added_percent.median);
            with_theirs(ours, published::added_percent(scene, codes))
        });
        table.add_row([codes.to_owned(), mean].into_iter().chain(cells));
    }
    format!("Time that codes add to a build, in percent; in brackets Riemersma 2024, table 7\n{table}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Spread;

    fn added(scene: &str, codes: &str, percent: f64) -> CodesEntry {
        CodesEntry::AddedTime(AddedTime {
            scene: scene.into(),
            triangles: 12,
            codes: codes.into(),
            builder: format!("lbvh:codes={codes}"),
            base: "lbvh".into(),
            base_ms: Spread::once(1.0),
            build_ms: Spread::once(1.0 + percent / 100.0),
            added_percent: Spread::once(percent),
        })
    }

    #[test]
    fn added_times_stand_beside_those_of_the_thesis() {
        let entries = [added("bunny", "mip9", 100.0), added("own", "mip9", -50.0), added("bunny", "mc63", 3.0)];
        let times = AddedTimes::of(&entries);
        assert_eq!((times.scenes(), times.codes()), (vec!["bunny", "own"], vec!["mip9", "mc63"]));
        assert!(times.mean("mip9").is_some_and(|mean| mean.abs() < 1e-9), "a doubling and a halving");
        let text = text(&entries);
        let row =
            |codes: &str| text.lines().find(|line| line.trim_start().starts_with(codes)).expect("a row").to_owned();
        assert!(row("mip9").contains("+100.0 (29)") && row("mip9").contains("-50.0"), "{text}");
        assert!(row("mc63").contains("+3.0") && row("mc63").contains('–') && !row("mc63").contains('('), "{text}");
    }

    #[test]
    fn weights_are_columns_and_games_stand_in_brackets() {
        let entry = |stretch, sah| {
            CodesEntry::Sweep(Swept {
                scene: "s".into(),
                triangles: 12,
                builder: "b".into(),
                base: "lbvh".into(),
                stretch,
                relative_sah: Some(sah),
                rays: vec![SweptRays {
                    rays: "primary".into(),
                    count: 9,
                    base_ms: Spread::once(1.0),
                    ms: Spread::once(1.0),
                    change_percent: Spread::once(7.5),
                    relative_work: Some(0.875),
                }],
            })
        };
        let entries = [entry(2, 1.25), entry(1, 1.0)];
        let sweeps = Sweeps::of(&entries);
        assert_eq!((sweeps.stretches(), sweeps.kinds()), (vec![1, 2], vec!["primary"]));
        assert_eq!((sweeps.sah_percent("s", 2), sweeps.sah_percent("s", 4)), (Some(25.0), None));
        let text = text(&entries);
        assert!(
            text.contains("+25.0")
                && text.contains("-12.5")
                && text.contains("+7.5")
                && text.contains("1/2")
                && text.contains("(Control)"),
            "{text}"
        );
        assert!(!text.contains("codes add"), "nothing of it was measured: {text}");
    }

    #[test]
    fn nothing_has_no_sign_but_a_plus() {
        assert_eq!([-0.01, 0.0, 2.26, -7.0].map(signed), ["+0.0", "+0.0", "+2.3", "-7.0"]);
        assert_eq!([1, 8].map(lambda), ["1", "1/8"]);
    }
}
