//! SAH costs of the builders on the CPU, against those that Frantál published (2019): of the dragon, which is his mesh, and over full
//! sweep, in bands around his means, of scenes of the same kinds. The scenes are not in the repository: HEDGEROW_SCENES names their
//! folder.

use crate::bvh_reference_costs::{compare, cost, load};
use crate::conditional::needs;
use hedgerow_lab::experiments::cpu_builders::frantal::Group;
use std::ops::RangeInclusive;

crate::conditional::tests! {
    dragon_has_the_published_costs_as_one_of_ten_real_scenes: needs::time("871,414 triangles, one builder with a window of 200: minutes"),
    dragon_optimised_by_insertion_has_the_published_costs_as_one_of_ten_real_scenes: needs::time("871,414 triangles, optimised three times: minutes"),
    builders_over_ten_real_scenes_are_in_the_published_bands: needs::time("ten builders over scenes of up to 2.9M triangles: minutes"),
    insertion_over_ten_real_scenes_is_in_the_published_bands: needs::time("scenes of up to 2.9M triangles, optimised twice: many minutes"),
    insertion_costs_at_most_0_86_of_full_sweep_in_the_mean_of_architecture: needs::scenes(),
    codes_that_halve_the_longest_axis_save_an_eighth_of_a_flat_scene: needs::scenes(),
}

/// Tables 10, 38 and 44: builder, cost, and how far from it ours may be.
const DRAGON: [(&str, f64, f64); 12] = [
    ("sweep", 138.2, 0.01),
    ("binned:leaf=2", 144.8, 0.02),
    ("aac-hq:codes=mc63/30", 160.0, 0.03),
    ("aac-fast:codes=mc63/30", 158.4, 0.03),
    ("aac-hq:codes=emc64var", 159.7, 0.03),
    ("aac-fast:codes=emc64var", 157.0, 0.03),
    ("bonsai", 143.7, 0.02),
    ("bonsai-p", 142.1, 0.02),
    ("bonsai-p2", 141.4, 0.02),
    ("ploc-host:codes=mc63:radius=10", 154.0, 0.02),
    ("ploc-host:codes=mc63:radius=25", 155.8, 0.02),
    ("ploc-host:codes=mc63:radius=100", 156.1, 0.02),
];

/// A builder, and the bands that its geometric means over full sweep are in: of objects, and of architecture.
type Bands = (&'static str, RangeInclusive<f64>, RangeInclusive<f64>);

/// Around the means of table 11: 1.057 and 1.222 for binned, whose termination is another there (see `termination=flat`), and so on.
fn bands() -> Vec<Bands> {
    vec![
        ("binned", 1.0..=1.08, 1.0..=1.12),
        ("binned:axes=all", 1.0..=1.04, 1.0..=1.04),
        ("aac-hq", 1.08..=1.20, 0.82..=0.97),
        ("aac-fast", 1.08..=1.20, 0.85..=1.02),
        ("bonsai", 1.02..=1.06, 1.03..=1.18),
        ("bonsai-p", 1.0..=1.04, 0.96..=1.06),
        ("bonsai-p2", 1.0..=1.04, 0.96..=1.06),
        ("ploc-host:radius=25", 1.08..=1.20, 0.82..=0.97),
        ("incremental", 1.03..=1.5, 0.78..=0.97),
    ]
}

/// The geometric mean over `scenes` of what `builder` costs over what `base` does.
fn mean(scenes: &[&str], builder: &str, base: &str) -> f64 {
    let ratio = |&name: &&str| {
        let scene = load(name);
        let ratio = cost(&scene, builder) / cost(&scene, base);
        println!("{name} {builder}: {ratio:.4} of {base}");
        ratio
    };
    let sum: f64 = scenes.iter().map(|name| ratio(name).ln()).sum();
    (sum / scenes.len() as f64).exp()
}

fn dragon_has_the_published_costs_as_one_of_ten_real_scenes() {
    let scene = load("dragon.tri");
    assert_eq!(scene.mesh.triangles.len(), 871_414);
    for (builder, expected, tolerance) in DRAGON {
        compare(&scene, builder, expected, tolerance);
    }
}

fn dragon_optimised_by_insertion_has_the_published_costs_as_one_of_ten_real_scenes() {
    let scene = load("dragon.tri");
    // By the order of the file, which may be another.
    compare(&scene, "incremental", 197.5, 0.1);
    compare(&scene, "incremental:optimise=insertion", 139.7, 0.02);
    compare(&scene, "sweep:optimise=insertion", 136.7, 0.02);
    assert!(cost(&scene, "sweep:optimise=insertion") <= cost(&scene, "sweep"));
    // The published one has leaves of two that it cannot part.
    assert!(cost(&scene, "binned:optimise=insertion") <= 140.4);
}

fn builders_over_ten_real_scenes_are_in_the_published_bands() {
    for (builder, objects, architecture) in bands() {
        for (group, band) in [(Group::Objects, objects), (Group::Architecture, architecture)] {
            let mean = mean(group.scenes(), builder, "sweep");
            assert!(band.contains(&mean), "{builder}: {mean:.4} over {group:?}, not in {band:?}");
        }
    }
}

fn insertion_over_ten_real_scenes_is_in_the_published_bands() {
    // The published means behind insertion, of incremental construction over sweep: 1.012 / 0.991 and 0.817 / 0.816.
    let groups = [(Group::Objects, 0.96..=1.0, 1.012 / 0.991), (Group::Architecture, 0.7..=0.85, 0.817 / 0.816)];
    for (group, band, published) in groups {
        let of_sweep = mean(group.scenes(), "sweep:optimise=insertion", "sweep");
        assert!(band.contains(&of_sweep), "{of_sweep:.4} over {group:?}, not in {band:?}");
        let of_incremental = mean(group.scenes(), "incremental:optimise=insertion", "sweep:optimise=insertion");
        assert!(
            (of_incremental / published - 1.0).abs() < 0.01,
            "{of_incremental:.4} over {group:?}, not {published:.4}"
        );
    }
}

fn insertion_costs_at_most_0_86_of_full_sweep_in_the_mean_of_architecture() {
    let mean = mean(&Group::Architecture.scenes()[..3], "sweep:optimise=insertion", "sweep");
    assert!(mean <= 0.86, "{mean:.4} of full sweep");
}

fn codes_that_halve_the_longest_axis_save_an_eighth_of_a_flat_scene() {
    // Other codes halve the thin axis of the terrain as often as the long ones. On the thesis' Pompeii the ratio is 1 / 0.745.
    let ratio = mean(&["terrain_jacksboro"], "aac-fast:codes=emc64var", "aac-fast:codes=mc63");
    assert!(ratio <= 1.0 / 1.15, "{ratio:.4}");
}
