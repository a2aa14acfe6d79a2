//! What Frantál 2019 has published, as data: the dragon's figures, parallel binning, and means over his scenes. Context that stands
//! beside measured figures, never a result.

pub mod tables;

use serde::Deserialize;
use std::sync::LazyLock;

/// Where the figures are from.
pub const SOURCE: &str = "Frantál 2019, \"Ray Tracing with Bounding Volume Hierarchies on a CPU\"";
/// The machine there.
pub const MACHINE: &str = "Core i7-4500U, one thread, means of five runs";
/// Triangles of the dragon there: where a scene has as many, it is the same mesh.
pub const DRAGON_TRIANGLES: u64 = 871_414;
/// The dragon's name there.
pub const DRAGON: &str = "Dragon";

/// All figures of the dragon, and table 24 of all scenes.
const FIGURES: &str = include_str!("frantal2019.csv");
/// Geometric means over FSW of the objects and of the architectural scenes, with the least and the greatest.
const MEANS: &str = include_str!("frantal2019_means.csv");

/// A published figure.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Figure {
    /// The number of its table.
    pub table: u32,
    /// What it is of.
    pub metric: String,
    /// The scene's name there.
    pub scene: String,
    /// The method's name there.
    pub method: String,
    /// The figure.
    pub value: f64,
}

/// A mean of published figures, as ratios over the full sweep on the same scene.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct Mean {
    /// Over which scenes.
    pub group: Group,
    /// Of what.
    pub metric: String,
    /// The method's name there; `+IBO` where insertion-based optimisation follows, `+EMC` where codes are EMC64VAR.
    pub method: String,
    /// The geometric mean.
    pub mean: f64,
    /// The least ratio.
    pub least: f64,
    /// The greatest.
    pub greatest: f64,
}

/// Scenes that are alike.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Group {
    /// Single objects.
    Objects,
    /// Buildings and rooms.
    Architecture,
    /// What is neither: the thesis has none.
    Others,
}

impl Group {
    /// All.
    pub const ALL: [Group; 3] = [Group::Objects, Group::Architecture, Group::Others];

    /// Of one of our scenes.
    pub fn of(scene: &str) -> Group {
        Group::ALL.into_iter().find(|group| group.scenes().contains(&scene)).unwrap_or(Group::Others)
    }

    /// Our scenes that are such.
    pub fn scenes(self) -> &'static [&'static str] {
        match self {
            Group::Objects => &["bunny", "armadillo", "dragon", "motorbike", "hair"],
            Group::Architecture => &["sponza", "classroom", "samurai_monastery", "salle_de_bain", "country_kitchen"],
            Group::Others => &[],
        }
    }

    /// For a heading.
    pub fn name(self) -> &'static str {
        match self {
            Group::Objects => "Objects",
            Group::Architecture => "Architecture",
            Group::Others => "Other scenes",
        }
    }
}

/// The published figures.
pub static PUBLISHED: LazyLock<Vec<Figure>> = LazyLock::new(|| read(FIGURES));
/// The published means.
pub static PUBLISHED_MEANS: LazyLock<Vec<Mean>> = LazyLock::new(|| read(MEANS));

fn read<T: for<'de> Deserialize<'de>>(text: &str) -> Vec<T> {
    csv::Reader::from_reader(text.as_bytes()).into_deserialize().collect::<Result<_, _>>().expect("a file of our own")
}

/// A published figure.
pub fn figure(table: u32, metric: &str, scene: &str, method: &str) -> Option<f64> {
    let is_it = |f: &&Figure| (f.table, &*f.metric, &*f.scene, &*f.method) == (table, metric, scene, method);
    PUBLISHED.iter().find(is_it).map(|figure| figure.value)
}

/// A published mean.
pub fn mean(group: Group, metric: &str, method: &str) -> Option<&'static Mean> {
    PUBLISHED_MEANS.iter().find(|mean| (mean.group, &*mean.metric, &*mean.method) == (group, metric, method))
}

/// A builder of ours and the method that it stands beside.
pub struct Counterpart {
    /// Ours, as `-b` takes it.
    pub builder: &'static str,
    /// Theirs, with `+IBO` or `+EMC` as means have it, or `+single` for one triangle a leaf.
    pub method: &'static str,
    /// How they differ, if they do.
    pub differs: &'static str,
}

const fn beside(builder: &'static str, method: &'static str, differs: &'static str) -> Counterpart {
    Counterpart { builder, method, differs }
}

/// Who stands beside whom.
pub const COUNTERPARTS: [Counterpart; 27] = [
    beside("sweep", "FSW", "ours sorts once, the thesis in every node"),
    beside("sweep:collapse=off", "FSW+single", "one triangle a leaf (table 9)"),
    beside("sweep:optimise=insertion", "FSW+IBO", "ours keeps the best tree, the thesis the last"),
    beside("binned:leaf=2:termination=flat", "BIN", ""),
    beside("binned:leaf=2", "BIN", "ours also splits what is flat along one axis"),
    beside("binned", "BIN", "ours also splits pairs, and what is flat along one axis"),
    beside("binned:axes=all", "BIN", "ours looks at all three axes"),
    beside("binned:optimise=insertion", "BIN+IBO", "ours begins with one triangle a leaf"),
    beside("aac-hq:codes=mc63/30", "AHQ", ""),
    beside("aac-fast:codes=mc63/30", "ALQ", ""),
    beside("aac-hq", "AHQ+EMC", "codes of ours have fewer bits"),
    beside("aac-fast", "ALQ+EMC", "codes of ours have fewer bits"),
    beside("aac-hq:codes=emc64var", "AHQ+EMC", ""),
    beside("aac-fast:codes=emc64var", "ALQ+EMC", ""),
    beside("bonsai", "BP0", ""),
    beside("bonsai-p", "BP1", ""),
    beside("bonsai-p2", "BP2", ""),
    beside("incremental", "INC", "the order of the file decides, and may be another"),
    beside("incremental:optimise=insertion", "INC+IBO", "ours keeps the best tree, the thesis the last"),
    beside("ploc-host:radius=10", "PL1+EMC", "codes of ours have fewer bits"),
    beside("ploc-host:radius=25", "PL2+EMC", "codes of ours have fewer bits"),
    beside("ploc-host:radius=100", "PL3+EMC", "codes of ours have fewer bits"),
    beside("ploc-host:radius=10:codes=mc63", "PL1", ""),
    beside("ploc-host:radius=25:codes=mc63", "PL2", ""),
    beside("ploc-host:radius=100:codes=mc63", "PL3", ""),
    beside("ploc-host:codes=mc63:radius=10", "PL1", ""),
    beside("ploc-host:codes=mc63:radius=25", "PL2", ""),
];

/// What the dragon's tree is said to be.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tree {
    /// SAH cost with 3 a step and 2 a test.
    pub sah: Option<f64>,
    /// Σ SA(inner) / SA(root).
    pub inner: Option<f64>,
    /// Σ SA(leaf)·n / SA(root).
    pub leaf: Option<f64>,
    /// Triangles a leaf.
    pub refs: Option<f64>,
}

/// The dragon's tree by a method.
pub fn dragon(method: &str) -> Tree {
    let (name, variant) = method.split_once('+').unwrap_or((method, ""));
    let of = |table, metric| figure(table, metric, DRAGON, name);
    match variant {
        "IBO" => Tree {
            sah: of(38, "sah_cost_after_ibo"),
            inner: of(39, "sum_sa_inner_after_ibo"),
            leaf: of(39, "sum_sa_leaf_after_ibo"),
            refs: of(39, "refs_per_leaf_after_ibo"),
        },
        "EMC" => {
            let (inner, leaf) = (of(45, "emc_sum_sa_inner"), of(45, "emc_sum_sa_leaf"));
            // The cost itself is given as a share of a rounded one: its two sums say more.
            let sah = inner.zip(leaf).map(|(inner, leaf)| 3.0 * inner + 2.0 * leaf);
            Tree { sah, inner, leaf, refs: of(42, "emc_refs_per_leaf") }
        }
        "single" => Tree { sah: of(9, "sah_cost_verification"), inner: None, leaf: None, refs: Some(1.0) },
        _ => Tree {
            sah: of(10, "sah_cost"),
            inner: of(18, "sum_sa_inner"),
            leaf: of(19, "sum_sa_leaf_n"),
            refs: of(17, "refs_per_leaf"),
        },
    }
}

/// Table 24, parallel binning: scene, percent of the serial time, seconds, and seconds of all cores.
pub fn parallel_binning() -> Vec<(&'static str, [f64; 3])> {
    let of = |scene: &str| {
        let metrics = ["parallel_percent", "parallel_real_s", "parallel_user_s"];
        metrics.map(|metric| figure(24, metric, scene, "BIN").expect("all three are there"))
    };
    let scenes = PUBLISHED.iter().filter(|figure| figure.table == 24 && figure.metric == "parallel_percent");
    scenes.map(|figure| (&*figure.scene, of(&figure.scene))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dragon_has_the_figures_of_the_tables() {
        assert_eq!(dragon("FSW"), Tree { sah: Some(138.2), inner: Some(40.3), leaf: Some(8.6), refs: Some(2.4) });
        assert_eq!((dragon("INC+IBO").sah, dragon("FSW+single").sah), (Some(139.7), Some(145.5)));
        // 3 · 47.7 + 2 · 8.3.
        assert!((dragon("AHQ+EMC").sah.expect("both sums") - 159.7).abs() < 1e-9);
        for counterpart in COUNTERPARTS {
            assert!(dragon(counterpart.method).sah.is_some(), "{}", counterpart.method);
        }
    }

    #[test]
    fn means_are_those_of_the_thesis() {
        let binned = mean(Group::Objects, "sah", "BIN").expect("a mean");
        assert!((binned.mean - 1.057).abs() < 1e-3 && binned.least < binned.mean && binned.mean < binned.greatest);
        assert!((mean(Group::Architecture, "sah", "FSW+IBO").expect("a mean").mean - 0.816).abs() < 1e-3);
        assert!((mean(Group::Architecture, "primary_time", "INC").expect("a mean").mean - 0.99).abs() < 1e-2);
        assert_eq!(mean(Group::Others, "sah", "BIN"), None);
    }

    #[test]
    fn parallel_binning_has_twenty_scenes() {
        let rows = parallel_binning();
        assert_eq!(rows.len(), 20);
        assert!(rows.contains(&("Dragon", [48.03, 0.427, 1.533])));
        let percent = || rows.iter().map(|(_, [percent, ..])| *percent);
        assert_eq!((percent().fold(f64::MAX, f64::min), percent().fold(0.0, f64::max)), (45.64, 54.87));
    }

    #[test]
    fn scenes_are_told_apart_by_what_they_are() {
        assert_eq!(["dragon", "sponza", "hall"].map(Group::of), Group::ALL);
    }
}
