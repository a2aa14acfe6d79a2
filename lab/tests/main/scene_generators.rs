//! Generators: counts, shapes, and the same bytes every time.

use hedgerow_lab::Error;
use hedgerow_lab::scene::{self, LoadOptions, Scene};
use proptest::prelude::*;
use std::collections::HashMap;

fn generate(spec: &str) -> Scene {
    scene::load(spec, &LoadOptions::default()).expect(spec)
}

/// How often each directed edge is used.
fn edges(scene: &Scene) -> HashMap<[u32; 2], u32> {
    let mut edges = HashMap::new();
    for &[a, b, c] in &scene.mesh.triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *edges.entry(edge).or_insert(0) += 1;
        }
    }
    edges
}

/// Six times the volume that the triangles enclose; positive if they face outwards.
fn six_volumes(scene: &Scene) -> f64 {
    (0..scene.mesh.triangles.len())
        .map(|t| {
            let [a, b, c] = scene.mesh.corners(t).map(|p| p.map(f64::from));
            a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
        })
        .sum()
}

#[test]
fn icospheres_are_closed_and_face_outwards() {
    for levels in 0..6 {
        let scene = generate(&format!("gen:icosphere:{levels}"));
        assert_eq!(scene.mesh.triangles.len(), 20 * 4_usize.pow(levels));
        // Euler: V − E + F = 2 with E = 3F/2.
        assert_eq!(scene.mesh.positions.len(), scene.mesh.triangles.len() / 2 + 2);
        let edges = edges(&scene);
        assert!(edges.iter().all(|(&[a, b], &n)| n == 1 && edges.get(&[b, a]) == Some(&1)), "level {levels}");
        let sphere = 6.0 * 4.0 / 3.0 * std::f64::consts::PI;
        assert!((0.6 * sphere..sphere).contains(&six_volumes(&scene)), "level {levels}");
        for p in &scene.mesh.positions {
            assert!((p.iter().map(|c| c * c).sum::<f32>() - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_stadium_is_a_fine_object_in_a_huge_coarse_one() {
    let scene = generate("gen:stadium:4");
    let fine = 20 * 4_usize.pow(4);
    assert_eq!(scene.mesh.triangles.len(), fine + 800);
    let longest = |t: usize| {
        let c = scene.mesh.corners(t);
        let edge = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt();
        edge(c[0], c[1]).max(edge(c[1], c[2])).max(edge(c[2], c[0]))
    };
    let finest = (0..fine).map(longest).fold(0.0, f32::max);
    let coarsest = (fine..fine + 800).map(longest).fold(f32::INFINITY, f32::min);
    assert!(coarsest > 100.0 * finest, "{coarsest} {finest}");
    assert!(scene.mesh.bounds().diagonal() > 2000.0);
}

#[test]
fn a_twisted_column_is_closed_and_has_about_as_many_triangles_as_asked() {
    for asked in [12_usize, 13, 50, 100, 1_000, 20_000] {
        let scene = generate(&format!("gen:twist:{asked}:2"));
        let count = scene.mesh.triangles.len();
        assert!(count.abs_diff(asked) as f64 <= (asked as f64).sqrt(), "{asked}: {count}");
        let edges = edges(&scene);
        assert!(edges.iter().all(|(&[a, b], &n)| n == 1 && edges.get(&[b, a]) == Some(&1)), "{asked}");
        // A square of side 1, 4 high.
        assert!((six_volumes(&scene) - 24.0).abs() < 1e-3, "{asked}: {}", six_volumes(&scene));
        let bounds = scene.mesh.bounds();
        assert_eq!((bounds.lo, bounds.hi), ([-0.5, 0.0, -0.5], [0.5, 4.0, 0.5]));
    }
}

#[test]
fn the_column_is_turned_by_height_and_frame_up_to_once_round() {
    const FRAMES: usize = 9;
    let options = LoadOptions::default();
    let twist = scene::load_animation("gen:twist:2000:9", &options).expect("a generator");
    assert_eq!((twist.name.as_str(), twist.frames.len()), ("gen:twist:2000:9", FRAMES));
    let still = generate("gen:twist:2000:9").mesh;
    assert_eq!((&twist.mesh(0).positions, &twist.triangles), (&still.positions, &still.triangles));
    for (number, frame) in twist.frames.iter().enumerate() {
        assert_eq!(frame.len(), still.positions.len());
        for (&[x, y, z], &[tx, ty, tz]) in still.positions.iter().zip(frame) {
            let angle = std::f32::consts::TAU * number as f32 / (FRAMES - 1) as f32 * y / 4.0;
            let (s, c) = angle.sin_cos();
            assert_eq!(y, ty);
            assert!((tx - (c * x - s * z)).abs() < 1e-6 && (tz - (s * x + c * z)).abs() < 1e-6, "{number} {x} {y} {z}");
        }
    }
    let alone = scene::load_animation("gen:twist:2000:1", &options).expect("one frame");
    assert_eq!(alone.frames, [still.positions]);
}

#[test]
fn too_many_triangles_and_wrong_arguments_are_refused_with_the_usage() {
    for spec in [
        "gen:",
        "gen:cube:3",
        "gen:icosphere",
        "gen:icosphere:x",
        "gen:icosphere:3:4",
        "gen:icosphere:12",
        "gen:icosphere:99",
        "gen:soup:10",
        "gen:soup:-1:2",
        "gen:soup:999999999:1",
        "gen:grid:99999",
        "gen:grid:99999999999999",
        "gen:stadium:4294967299",
        "gen:needles:5:x",
        "gen:forest",
        "gen:forest:-1",
        "gen:cells:8:1",
        "gen:city:16777216",
        "gen:cables:99999999999",
        "gen:twist:100",
        "gen:twist:11:5",
        "gen:twist:100:0",
        "gen:twist:1000000:1000",
    ] {
        let options = LoadOptions::default();
        for error in [
            scene::load(spec, &options).expect_err(spec),
            scene::load_instances(spec, &options).expect_err(spec),
            scene::load_animation(spec, &options).expect_err(spec),
        ] {
            assert!(matches!(error, Error::Argument(_)), "{spec}: {error:?}");
            let message = error.to_string();
            assert!(message.starts_with(spec) && message[spec.len()..].contains("gen:"), "{message}");
        }
    }
}

#[test]
fn nothing_is_no_scene() {
    for spec in
        ["gen:soup:0:1", "gen:grid:0", "gen:needles:0:1", "gen:forest:0", "gen:city:0", "gen:cables:0", "gen:cells:0"]
    {
        let error = scene::load(spec, &LoadOptions::default()).expect_err(spec);
        assert!(error.to_string().contains("no triangles"), "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn the_same_name_gives_the_same_bytes_and_another_seed_others(n in 1_u32..500, seed: u64) {
        for generator in ["soup", "needles"] {
            let [a, b, c] = [seed, seed, seed.wrapping_add(1)].map(|s| generate(&format!("gen:{generator}:{n}:{s}")).mesh);
            prop_assert_eq!(&a.positions, &b.positions);
            prop_assert_eq!(a.triangles.len(), n as usize);
            prop_assert_ne!(&a.positions, &c.positions);
            prop_assert!(a.positions.iter().flatten().all(|c| c.is_finite()));
        }
    }

    #[test]
    fn a_grid_covers_its_square_once(side in 1_u32..60) {
        let scene = generate(&format!("gen:grid:{side}"));
        prop_assert_eq!(scene.mesh.triangles.len(), 2 * (side * side) as usize);
        // Every triangle is half a unit cell and faces up, so that together they cover the square.
        for t in 0..scene.mesh.triangles.len() {
            let [a, b, c] = scene.mesh.corners(t);
            let up = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2]);
            prop_assert_eq!(up, 1.0);
        }
        let bounds = scene.mesh.bounds();
        prop_assert_eq!((bounds.lo, bounds.hi), ([0.0; 3], [side as f32, 0.0, side as f32]));
    }

    #[test]
    fn needles_are_long_and_thin(n in 1_u32..200, seed: u64) {
        let scene = generate(&format!("gen:needles:{n}:{seed}"));
        for t in 0..scene.mesh.triangles.len() {
            let [tail, side, head] = scene.mesh.corners(t);
            let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt();
            let length = distance(tail, head);
            prop_assert!((0.19..1.01).contains(&length));
            prop_assert!(distance(tail, side) < 0.0011 * length + 1e-6);
        }
    }
}
