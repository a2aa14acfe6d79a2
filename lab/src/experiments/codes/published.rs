//! Figures that Riemersma 2024, "Improvements for Extended Morton Codes for Bounding Volume Hierarchy Construction on GPUs in
//! Problematicly Large Scenes", has published: its tables 7 to 11. Context, never a result: of a GPU, another LBVH and, but for
//! table 7, of scenes of games.
//!
//! Of table 11 the scan has lost what stands behind the third view of Dying Light.

use std::collections::BTreeMap;
use std::sync::LazyLock;

/// A row of tables 8 to 11: the change of speed in percent by 1/λ.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// The kind of rays, as it is called there.
    pub rays: String,
    /// The game.
    pub game: String,
    /// By 1/λ.
    pub change_percent: BTreeMap<u32, f64>,
}

/// Tables 8 to 11.
pub static VIEWS: LazyLock<Vec<View>> = LazyLock::new(|| {
    let (heads, rows) = read(include_str!("riemersma2024_lambda.csv"));
    let view = |row: &Vec<String>| View {
        rays: row[0].clone(),
        game: row[1].clone(),
        change_percent: (3..heads.len()).map(|i| (number(&heads[i]) as u32, number(&row[i]))).collect(),
    };
    rows.iter().map(view).collect()
});

/// Table 7: the time added in percent, by codes and scene.
static ADDED_TIME: LazyLock<BTreeMap<(String, String), f64>> = LazyLock::new(|| {
    let (heads, rows) = read(include_str!("riemersma2024_added_time.csv"));
    let cells =
        rows.iter().flat_map(|row| (1..heads.len()).map(|i| ((row[0].clone(), heads[i].clone()), number(&row[i]))));
    cells.collect()
});

/// The heading and the rows of a file of our own.
fn read(text: &str) -> (Vec<String>, Vec<Vec<String>>) {
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let heads = reader.headers().expect("a heading").iter().map(str::to_owned).collect();
    let rows =
        reader.records().map(|row| row.expect("a row as long as the heading").iter().map(str::to_owned).collect());
    (heads, rows.collect())
}

fn number(cell: &str) -> f64 {
    cell.parse().expect("a number of a file of our own")
}

/// What the thesis calls a scene of ours that it has, too, or what stands for it there: the same object, perhaps by another mesh.
const SCENES: [(&str, &str); 5] =
    [("teapot", "Teapot"), ("bunny", "Bunny"), ("sponza", "Sponza"), ("dragon", "Dragon"), ("hair", "Hairball")];

/// What the thesis calls a kind of rays of ours.
const KINDS: [(&str, &str); 4] = [("primary", "primary"), ("diffuse1", "gi"), ("ao", "ao"), ("shadow", "soft shadow")];

fn theirs<'t>(names: &[(&str, &'t str)], ours: &str) -> Option<&'t str> {
    names.iter().find(|(known, _)| *known == ours).map(|(_, theirs)| *theirs)
}

/// What codes add to the time of a build there, in percent, on the scene that ours has a counterpart in.
pub fn added_percent(scene: &str, codes: &str) -> Option<f64> {
    ADDED_TIME.get(&(codes.to_owned(), theirs(&SCENES, scene)?.to_owned())).copied()
}

/// The mean over its twelve scenes of what codes add there, in percent.
pub fn mean_added_percent(codes: &str) -> Option<f64> {
    let all: Vec<f64> = ADDED_TIME.iter().filter(|((of, _), _)| of == codes).map(|(_, percent)| *percent).collect();
    (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64)
}

/// The games, and of each the mean over its views of the change of speed of a kind of rays of ours, by 1/λ.
pub fn games(kind: &str) -> Vec<(&'static str, BTreeMap<u32, f64>)> {
    let Some(theirs) = theirs(&KINDS, kind) else { return Vec::new() };
    let mut games: Vec<(&'static str, Vec<&'static View>)> = Vec::new();
    for view in VIEWS.iter().filter(|view| view.rays == theirs) {
        match games.last_mut().filter(|(game, _)| *game == view.game) {
            Some((_, views)) => views.push(view),
            None => games.push((&view.game, vec![view])),
        }
    }
    let mean = |views: &[&View], stretch: &u32| {
        views.iter().map(|view| view.change_percent[stretch]).sum::<f64>() / views.len() as f64
    };
    let means = |(game, views): (&'static str, Vec<&View>)| {
        (game, views[0].change_percent.keys().map(|stretch| (*stretch, mean(&views, stretch))).collect())
    };
    games.into_iter().map(means).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_as_long_as_they_are_printed() {
        let views = |kind| VIEWS.iter().filter(|view| view.rays == kind).count();
        assert_eq!(["primary", "gi", "ao", "soft shadow"].map(views), [38, 38, 38, 21]);
        assert!(VIEWS.iter().all(|view| view.change_percent.keys().copied().eq((0..12).map(|k| 1 << k))));
        assert_eq!(ADDED_TIME.len(), 33 * 12);
    }

    #[test]
    fn figures_are_found_by_our_names() {
        assert_eq!(added_percent("bunny", "bin4a4"), Some(76.79));
        assert_eq!(added_percent("hair", "mip12"), Some(43.67));
        assert_eq!((added_percent("bunny", "mc63"), added_percent("pigman", "mip9")), (None, None));
        // Control's five views of primary rays at λ = 1.
        let mean = (12.46 + 13.82 - 3.24 - 7.05 - 12.71) / 5.0;
        let control = games("primary").into_iter().find(|(game, _)| *game == "Control").expect("a game of the thesis");
        assert!((control.1[&1] - mean).abs() < 1e-9, "{control:?}");
        assert_eq!([games("ao").len(), games("shadow").len(), games("random").len()], [7, 4, 0]);
        let mip6 = mean_added_percent("mip6").expect("a row of table 7");
        assert!((mip6 - 186.68 / 12.0).abs() < 1e-9, "{mip6}");
    }
}
