//! The scenes of the repository: they load, have the size that their README says, and stay small.
#![cfg(feature = "cli")]

use hedgerow::scene::{self, LoadOptions};
use std::path::Path;

const README: &str = include_str!("../scenes/README.md");

#[test]
fn every_scene_loads_with_the_triangles_that_its_readme_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let options = LoadOptions { folders: vec![folder.clone()], progress: None };
    let rows: Vec<(&str, usize)> = README
        .lines()
        .filter_map(|line| {
            let mut cells = line.strip_prefix("| `")?.split('|');
            let name = cells.next()?.trim().trim_end_matches('`');
            Some((name, cells.nth(1)?.trim().replace(',', "").parse().expect("a count")))
        })
        .collect();
    assert_eq!(scene::list(&folder).expect("a folder").len(), rows.len(), "README names every scene");
    for (name, triangles) in rows {
        let scene = scene::load(name, &options).expect(name);
        assert_eq!((scene.name.as_str(), scene.mesh.triangles.len()), (name, triangles));
        assert!((20_000..150_000).contains(&triangles), "{name}");
    }
    let hall = scene::load("hall", &options).expect("hall");
    assert_eq!((hall.lights.len(), hall.camera.eye), (4, [-18.5, 2.1, 2.6]));
}

#[test]
fn every_generator_that_the_readme_names_is_there() {
    let named: Vec<&str> = README.split('`').filter(|words| words.starts_with("gen:") && words.len() > 4).collect();
    let known: Vec<&str> = scene::generators().map(|(name, _)| name).collect();
    assert!(named.len() >= 5 && named.iter().all(|name| known.contains(name)), "{named:?} {known:?}");
}

#[test]
fn the_folder_stays_small() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
    let sizes: Vec<u64> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").metadata().expect("a file").len())
        .collect();
    assert!(sizes.iter().all(|&s| s < 1 << 20) && sizes.iter().sum::<u64>() < 3 << 20, "{sizes:?}");
}
