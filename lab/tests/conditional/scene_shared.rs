//! The scenes of the folder that `HEDGEROW_SCENES` names: each loads, with the triangles that its table
//! says, and the camera is outside of nothing and looks somewhere.

use crate::conditional::needs;
use hedgerow_lab::scene::{self, LoadOptions};
use std::time::Instant;

crate::conditional::tests! {
    every_shared_scene_loads_whole: needs::scenes(),
}

/// Triangles by scene, as the folder's own README counts them.
const TRIANGLES: [(&str, usize); 19] = [
    ("teapot", 6_320),
    ("soldier_run", 11_376),
    ("clocktower_twist", 20_944),
    ("pigman_run", 35_706),
    ("sponza", 66_450),
    ("bunny", 69_451),
    ("armadillo", 86_482),
    ("classroom", 111_162),
    ("samurai_monastery", 124_789),
    ("san_francisco", 268_041),
    ("terrain_jacksboro", 275_772),
    ("motorbike", 331_653),
    ("bunny_in_city", 337_492),
    ("dragon", 871_414),
    ("salle_de_bain", 1_016_615),
    ("minecraft_region", 1_379_204),
    ("country_kitchen", 1_443_517),
    ("hair", 2_700_000),
    ("forest", 6_568_212),
];

fn every_shared_scene_loads_whole() {
    let folder = crate::conditional::scenes_folder();
    let options = LoadOptions { folders: vec![folder.clone()], progress: None };
    let listed = scene::list(&folder).expect("HEDGEROW_SCENES can be read");
    let is_there =
        |file: &str| listed.iter().any(|path| path.file_name().is_some_and(|f| f.to_string_lossy().starts_with(file)));
    for (name, triangles) in TRIANGLES {
        if !is_there(&format!("{name}.")) {
            eprintln!("skipped: {name} is not in the folder");
            continue;
        }
        let start = Instant::now();
        let scene = scene::load(name, &options).expect(name);
        println!("{name}: {triangles} triangles in {:.2} s", start.elapsed().as_secs_f64());
        assert_eq!(scene.name, name);
        assert_eq!(scene.mesh.triangles.len(), triangles, "{name}");
    }
    // The one scene of instances, its parts as the table of files counts them, and the animations' frames.
    if is_there("forest.inst") {
        let forest = scene::load_instances("forest", &options).expect("forest");
        let parts: usize = forest.parts.iter().map(|part| part.triangles.len()).sum();
        assert_eq!((forest.parts.len(), parts, forest.instances.len()), (3, 282_724, 2_221));
        assert_eq!(forest.triangle_count(), 6_568_212);
    }
    for (name, frames) in [("soldier_run", 20), ("clocktower_twist", 24), ("pigman_run", 24)] {
        if is_there(name) {
            assert_eq!(scene::load_animation(name, &options).expect(name).frames.len(), frames, "{name}");
        }
    }
}
