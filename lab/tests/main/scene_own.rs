//! The scenes of the repository: they load, have the size that their README says, and stay small.

use hedgerow_lab::scene::{self, LoadOptions};
use std::path::Path;

const README: &str = include_str!("../../../scenes/README.md");

#[test]
fn every_scene_loads_with_the_triangles_that_its_readme_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let options = LoadOptions { folders: vec![folder.clone()], progress: None };
    let still = README.split("## Dynamic scenes").next().expect("a first part");
    let rows: Vec<(&str, usize)> = still
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
fn every_dynamic_scene_has_the_triangles_that_its_readme_says() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let shared = std::env::var_os("HEDGEROW_SCENES").map(std::path::PathBuf::from);
    let options = LoadOptions { folders: [folder.clone()].into_iter().chain(shared.clone()).collect(), progress: None };
    let dynamic = README.split("## Dynamic scenes").nth(1).expect("a second part");
    let rows = dynamic.lines().filter_map(|line| line.strip_prefix("| `"));
    let mut named = Vec::new();
    for row in rows {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        let numbers = |cell: usize| -> Vec<usize> {
            cells[cell].split(", ").map(|n| n.replace(',', "").parse().expect("a number")).collect()
        };
        let name = cells[0].trim_end_matches('`');
        named.push(format!("{name}.dyn"));
        let scene = match scene::load_dynamic(name, &options) {
            Err(error) if shared.is_none() && named.len() > 2 => {
                assert!(error.to_string().contains("there is no scene"), "{error}");
                continue;
            }
            scene => scene.expect(name),
        };
        let objects: Vec<usize> = scene.objects.iter().map(|object| object.triangles.len()).collect();
        assert_eq!((vec![scene.static_mesh.triangles.len()], objects), (numbers(1), numbers(2)), "{name}");
        assert_eq!(vec![scene.frames as usize], numbers(3), "{name}");
    }
    let files = std::fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let files: Vec<_> = files.filter(|f| f.to_string_lossy().ends_with(".dyn")).collect();
    assert_eq!(files.len(), named.len(), "README names every dynamic scene: {files:?} {named:?}");
}

#[test]
fn every_generator_that_the_readme_names_is_there() {
    let named: Vec<&str> = README.split('`').filter(|words| words.starts_with("gen:") && words.len() > 4).collect();
    let known: Vec<&str> = scene::generators().map(|(name, _)| name).collect();
    assert!(named.len() >= 5 && named.iter().all(|name| known.contains(name)), "{named:?} {known:?}");
}

#[test]
fn the_folder_stays_small() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../scenes");
    let sizes: Vec<u64> = std::fs::read_dir(folder)
        .expect("a folder")
        .map(|entry| entry.expect("an entry").metadata().expect("a file").len())
        .collect();
    assert!(sizes.iter().all(|&s| s < 1 << 20) && sizes.iter().sum::<u64>() < 3 << 20, "{sizes:?}");
}
