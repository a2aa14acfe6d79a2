//! The paths of real scenes that come with the program: the camera is in no wall, and has something before it.

use crate::conditional::needs;
use hedgerow::bvh::codes::Code;
use hedgerow::bvh::sah::Collapse;
use hedgerow::bvh::twin::lbvh;
use hedgerow::trace::twin::tracer;
use hedgerow_lab::rays::kinds::{RayKind, RayOptions, generate};
use hedgerow_lab::scene::{FlightSource, LoadOptions, load_flight};

crate::conditional::tests! {
    no_camera_of_a_known_path_is_in_a_wall: needs::scenes(),
}

/// Scenes, and the least share of a picture's rays that hit something.
const SCENES: [(&str, f32); 9] = [
    ("sponza", 0.75),
    ("classroom", 0.75),
    ("country_kitchen", 0.9),
    ("salle_de_bain", 0.9),
    ("san_francisco", 0.4),
    ("samurai_monastery", 0.4),
    // From outside at first, by the camera that comes with the scene.
    ("minecraft_region", 0.25),
    // Objects that stand alone; the dragon is a tenth of the picture from its narrow side.
    ("dragon", 0.05),
    ("bunny", 0.1),
];

fn no_camera_of_a_known_path_is_in_a_wall() {
    let options = LoadOptions { folders: vec![crate::conditional::scenes_folder()], progress: None };
    for (name, share) in SCENES {
        let Ok(mut flight) = load_flight(name, None, &options) else {
            eprintln!("skipped: {name} is not in the folder");
            continue;
        };
        assert_eq!(flight.source, FlightSource::Known, "{name}");
        let mesh = flight.scene.mesh.clone();
        let tree = lbvh::build(&mesh.positions, &mesh.triangles, Code::Mc63.full(), Collapse::SAH);
        let near = 2e-3 * mesh.bounds().diagonal();
        for frame in (0..flight.frames()).step_by(2) {
            flight.scene.camera = flight.camera(frame);
            let options = RayOptions { size: [24, 16], seed: 1 };
            let rays = generate(RayKind::Primary, &flight.scene, &options, &mut |_| Ok(Vec::new())).expect("rays");
            let hits: Vec<f32> =
                rays.iter().map(|ray| tracer::closest_hit(&tree, ray).t).filter(|t| t.is_finite()).collect();
            let seen = hits.len() as f32 / rays.len() as f32;
            let close = hits.iter().filter(|&&t| t < near).count() as f32 / rays.len() as f32;
            println!("{name} {frame}: {seen:.2} hit, {close:.2} of them near, {:?}", flight.scene.camera.eye);
            assert!(seen >= share, "{name}, frame {frame}: {seen} of the picture hits something");
            assert!(close < 0.1, "{name}, frame {frame}: {close} of the picture is at the camera");
        }
    }
}
