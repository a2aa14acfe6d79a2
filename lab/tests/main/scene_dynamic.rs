//! Dynamic scenes: where objects and cameras are at a time, `.dyn` files, and what wrong ones are told.

use crate::files::{Folder, load};
use hedgerow_lab::scene::{self, DynamicScene, LoadOptions};
use proptest::prelude::*;

fn load_dynamic(spec: &str) -> hedgerow_lab::Result<DynamicScene> {
    scene::load_dynamic(spec, &LoadOptions::default())
}

/// One triangle with corners on the axes.
const TRIANGLE: &str = "v 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n";
/// A square.
const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";

/// What a `.dyn` file says beside `triangle.obj`, `square.obj` and `walk.anim`.
fn read(text: &str) -> (Folder, hedgerow_lab::Result<DynamicScene>) {
    let folder = Folder::new();
    folder.file("triangle.obj", TRIANGLE);
    folder.file("square.obj", SQUARE);
    folder.bytes("walk.anim", &walk());
    let scene = load_dynamic(&folder.file("scene.dyn", text));
    (folder, scene)
}

fn scene_of(text: &str) -> DynamicScene {
    read(text).1.expect(text)
}

/// A triangle whose corners are (k, 0, 0), (0, k, 0), (0, 0, k) in frames k = 0, 1, 2, 3.
fn walk() -> Vec<u8> {
    let mut bytes: Vec<u8> = [3_u32, 1, 4, 0, 1, 2].iter().flat_map(|w| w.to_le_bytes()).collect();
    for k in 0..4 {
        for corner in 0..9 {
            bytes.extend((if corner % 4 == 0 { k as f32 } else { 0.0 }).to_le_bytes());
        }
    }
    bytes
}

fn is_near(a: &[[f32; 3]], b: &[[f32; 3]]) -> bool {
    a.len() == b.len() && a.iter().flatten().zip(b.iter().flatten()).all(|(a, b)| (a - b).abs() < 1e-5)
}

#[test]
fn objects_are_moved_turned_and_scaled_between_their_keys() {
    let scene = scene_of(
        "frames 4\nseconds 4\nobject t triangle.obj\n at 0 move 0 0 0 turn 0 0 1 0 scale 1\n at 2 move 4 0 0 turn 0 0 1 180 \
         scale 3 # all at once\n at 3 turn 0 0 1 180\n",
    );
    let placed = |time: f32| scene.objects[0].placed(time);
    assert_eq!(placed(0.0), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
    // Half-way: scaled by 2, then a quarter turn (x to y, y to −x), then moved by 2.
    assert!(is_near(&placed(1.0), &[[2.0, 2.0, 0.0], [0.0, 0.0, 0.0], [2.0, 0.0, 2.0]]), "{:?}", placed(1.0));
    let end = [[1.0, 0.0, 0.0], [4.0, -3.0, 0.0], [4.0, 0.0, 3.0]];
    for time in [2.0, 2.5, 3.9] {
        assert!(is_near(&placed(time), &end), "it stays: {:?}", placed(time));
    }
    for (time, same) in [(4.0, 0.0), (5.0, 1.0), (-3.0, 1.0), (4000.0, 0.0)] {
        assert_eq!(placed(time), placed(same), "it begins again at {time}");
    }
    assert_eq!((0..4).map(|k| scene.time_of(k)).collect::<Vec<_>>(), [0.0, 1.0, 2.0, 3.0]);
}

#[test]
fn a_smooth_camera_goes_along_curves_and_is_as_long_up() {
    let text = |camera: &str| {
        let camera = format!(
            "{camera}\n at 0 eye 0 0 5 look 0 0 0 up 0 2 0 fov 40\n at 1 eye 2 0 5 look 1 0 0\n at 2 eye 2 0 9 look 2 0 0 fov 60\n"
        );
        scene_of(&format!("frames 4\nseconds 2\nstatic triangle.obj\n{camera}"))
    };
    let (smooth, straight) = (text("camera smooth"), text("camera"));
    for time in [0.0, 1.0, 1.999_999_9] {
        assert!(is_near(&[smooth.camera(time).eye], &[straight.camera(time).eye]), "both meet the keys");
    }
    // Tangents (2, 0, 0) and (1, 0, 2); half-way (1, 0, 5) + ((2, 0, 0) − (1, 0, 2)) / 8.
    assert!(is_near(&[smooth.camera(0.5).eye], &[[1.125, 0.0, 4.75]]), "{:?}", smooth.camera(0.5));
    assert_eq!(straight.camera(0.5).eye, [1.0, 0.0, 5.0]);
    // The look goes in equal steps, the angle evenly all the time, and up has the length of 1.
    assert!(is_near(&[smooth.camera(0.5).look], &[[0.5, 0.0, 0.0]]));
    assert_eq!((smooth.camera(0.5).fov, smooth.camera(0.5).up), (45.0, [0.0, 1.0, 0.0]));
}

#[test]
fn a_part_of_a_key_goes_from_the_last_that_names_it_to_the_next() {
    let scene = scene_of(
        "frames 1\nseconds 4\nobject t triangle.obj\n at 0 move 0 0 0\n at 1 scale 1\n at 2 scale 3 2 1\n at 4 move 8 0 0\n",
    );
    assert!(is_near(&scene.objects[0].placed(1.5), &[[5.0, 0.0, 0.0], [3.0, 1.5, 0.0], [3.0, 0.0, 1.0]]));
}

#[test]
fn turns_go_through_all_their_degrees_and_quaternions_the_shorter_way() {
    let at = |keys: &str, time: f32| {
        scene_of(&format!("frames 1\nseconds 4\nobject t triangle.obj\n{keys}")).objects[0].placed(time)
    };
    let quarters = [
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
        [[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]],
        [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]],
    ];
    for (quarter, expected) in quarters.iter().enumerate() {
        let round = at("at 0 turn 0 0 1 0\nat 4 turn 0 0 1 360\n", quarter as f32);
        assert!(is_near(&round, expected), "{quarter}: {round:?}");
        let back = at("at 0 turn 0 0 1 720\nat 4 turn 0 0 1 360\n", quarter as f32);
        assert!(is_near(&back, &quarters[(4 - quarter) % 4]), "{quarter}: {back:?}");
    }
    // A quarter back is shorter than three quarters on.
    let short = at("at 0 quaternion 0 0 0 1\nat 2 quaternion 0 0 -1 1\n", 2.0);
    assert!(is_near(&short, &quarters[3]));
    let half = at("at 0 quaternion 0 0 0 1\nat 2 quaternion 0 0 1 -1\n", 1.0);
    let c = std::f32::consts::FRAC_1_SQRT_2;
    assert!(is_near(&half, &[[c, -c, 0.0], [c, c, 0.0], [0.0, 0.0, 1.0]]), "{half:?}");
}

#[test]
fn what_turns_keeps_its_edges_and_its_triangles() {
    let scene = scene_of(
        "frames 60\nseconds 3\nobject ball gen:icosphere:2\n at 0 move 5 0 0 turn 1 2 3 0\n at 1 turn 1 2 3 500\n at 2 turn 0 1 0 \
         40\n at 3 quaternion 1 2 3 4\n",
    );
    let ball = &scene.objects[0];
    let lengths = |positions: &[[f32; 3]]| -> Vec<f32> {
        let edge = |a: [f32; 3], b: [f32; 3]| (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f32>().sqrt();
        ball.triangles.iter().map(|t| edge(positions[t[0] as usize], positions[t[1] as usize])).collect()
    };
    let mesh = load("gen:icosphere:2").expect("a generator").mesh;
    assert_eq!(ball.triangles, mesh.triangles);
    let still = lengths(&mesh.positions);
    for frame in 0..60 {
        let time = scene.time_of(frame);
        assert!(!ball.morphs() && *ball.mesh_at(time) == mesh.positions[..]);
        let moved = lengths(&ball.placed(time));
        assert!(still.iter().zip(&moved).all(|(a, b)| (a - b).abs() < 4e-6 * a.max(1.0)), "frame {frame}");
    }
}

#[test]
fn an_animation_morphs_between_its_frames_and_moves_besides() {
    let scene = scene_of("frames 2\nseconds 8\nobject w walk.anim\n cycle 4\n at 0 move 0 0 0\n at 8 move 8 0 0\n");
    let walk = &scene.objects[0];
    assert!(walk.morphs());
    for (time, k) in [(0.0, 0.0), (1.0, 1.0), (1.5, 1.5), (3.0, 3.0), (3.5, 1.5), (4.0, 0.0), (6.25, 2.25)] {
        assert_eq!(*walk.mesh_at(time), [[k, 0.0, 0.0], [0.0, k, 0.0], [0.0, 0.0, k]], "{time}");
        assert_eq!(walk.transform(time)[0], [1.0, 0.0, 0.0, time], "{time}");
        assert_eq!(walk.placed(time), [[k + time, 0.0, 0.0], [time, k, 0.0], [time, 0.0, k]], "{time}");
    }
    // Without a cycle of its own, once in the seconds of the scene.
    let once = scene_of("frames 2\nseconds 8\nobject w walk.anim\n");
    assert_eq!(once.objects[0].placed(2.0), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
}

#[test]
fn static_triangles_come_first_then_each_object_in_order() {
    let (folder, scene) = read(
        "frames 3\nseconds 3\nobject b triangle.obj\nat 0 move 0 0 0\nat 3 move 3 0 0\nstatic square.obj\nobject a walk.anim\n",
    );
    let scene = scene.expect("a scene");
    assert_eq!(scene.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["b", "a"]);
    assert_eq!(scene.primitives().collect::<Vec<_>>(), [2..3, 3..4]);
    assert_eq!(scene.triangle_count(), 4);
    for time in [0.0, 1.0, 2.9] {
        let flat = scene.at(time).expect("finite").mesh;
        assert_eq!(
            flat.triangles,
            [[0, 1, 2], [0, 2, 3], [4, 5, 6], [7, 8, 9]],
            "the topology is the same at any time"
        );
        assert_eq!(flat.positions[4..7], scene.objects[0].placed(time));
        assert_eq!(flat.positions[7..], scene.objects[1].placed(time));
        let instances = scene.instances(time);
        assert_eq!((instances.parts.len(), instances.instances[1].transform), (3, scene.objects[0].transform(time)));
        assert_eq!(instances.flatten().expect("small").positions, flat.positions);
    }
    // Other commands take it as it is at time 0.
    let path = folder.path().join("scene.dyn").display().to_string();
    let still = load(&path).expect("a scene");
    assert_eq!((still.name.as_str(), still.mesh.positions), ("scene", scene.at(0.0).expect("finite").mesh.positions));
    assert_eq!(scene::load_instances(&path, &LoadOptions::default()).expect("a scene").parts.len(), 3);
}

#[test]
fn bounds_hold_every_frame() {
    let scene =
        scene_of("frames 4\nseconds 4\nstatic square.obj\nobject t triangle.obj\nat 0 move 0 0 0\nat 4 move 0 0 -8\n");
    let bounds = scene.bounds();
    assert_eq!((bounds.lo, bounds.hi), ([0.0, 0.0, -6.0], [1.0, 1.0, 1.0]));
    for frame in 0..4 {
        let here = scene.at(scene.time_of(frame)).expect("finite").mesh.bounds();
        assert_eq!(bounds.union(&here), bounds, "frame {frame}");
    }
    assert_eq!(scene.at(3.0).expect("finite").mesh.bounds().lo[2], -6.0);
}

#[test]
fn the_camera_goes_its_way_or_is_that_of_the_static_scene() {
    let scene = scene_of(
        "frames 1\nseconds 4\nstatic square.obj\ncamera\nat 0 eye 0 0 9 look 0 0 0 fov 40\nat 2 eye 4 0 9 up 0 0 1 fov 60\n",
    );
    let camera = scene.camera(1.0);
    assert_eq!((camera.eye, camera.look, camera.up, camera.fov), ([2.0, 0.0, 9.0], [0.0; 3], [0.0, 0.0, 1.0], 50.0));
    assert_eq!(scene.at(1.0).expect("finite").camera, camera);
    let (folder, scene) = read("frames 1\nseconds 1\nstatic square.obj\nobject t triangle.obj\n");
    let square = load(&folder.path().join("square.obj").display().to_string()).expect("a square");
    assert_eq!(scene.expect("a scene").camera(0.5), square.camera);
    // With nothing static, it sees all of every frame.
    let alone = scene_of("frames 2\nseconds 2\nobject t triangle.obj\nat 0 move 0 0 0\nat 1 move 10 0 0\n");
    assert_eq!(alone.camera(0.0).look, [5.5, 0.5, 0.5]);
}

#[test]
fn an_animation_is_a_scene_of_one_object_and_a_mesh_is_none() {
    let folder = Folder::new();
    let path = folder.bytes("walk.anim", &walk());
    let scene = load_dynamic(&path).expect("an animation");
    assert_eq!((scene.name.as_str(), scene.frames, scene.static_mesh.triangles.len()), ("walk", 4, 0));
    let animation = scene::load_animation(&path, &LoadOptions::default()).expect("an animation");
    for frame in 0..4 {
        assert_eq!(scene.objects[0].placed(scene.time_of(frame)), animation.frames[frame as usize]);
    }
    assert_eq!(scene.camera(0.0), animation.camera);
    assert_eq!(load_dynamic("gen:twist:100:7").expect("a generator").frames, 7);
    let mesh = folder.file("square.obj", SQUARE);
    for spec in [mesh.as_str(), "gen:icosphere:1", "gen:forest:3"] {
        let message = load_dynamic(spec).expect_err(spec).to_string();
        assert_eq!(message.strip_prefix(spec).map(|m| m.starts_with(": nothing in it moves; take a .dyn")), Some(true));
    }
}

/// What a file is told, from its line on.
fn refused(text: &str) -> String {
    let (folder, scene) = read(text);
    let message = scene.expect_err(text).to_string();
    let file = folder.path().join("scene.dyn").display().to_string();
    let told =
        message.strip_prefix(&file).unwrap_or_else(|| panic!("{message} does not begin with the file")).to_owned();
    assert!(!told.contains('\n'), "one line: {told}");
    told
}

#[test]
fn wrong_lines_are_told_with_their_number() {
    let object = "frames 4\nseconds 2\nobject t triangle.obj\n";
    for (lines, says) in [
        ("walk 3", ":4: \"walk\" begins no line of a dynamic scene"),
        ("frames 5", ":4: frames stands in line 1 already"),
        ("seconds 5", ":4: seconds stands in line 2 already"),
        ("static square.obj\nstatic square.obj", ":5: static stands in line 4 already"),
        ("static", ":4: static names no scene"),
        ("object ball", ":4: an object is a name and a scene"),
        ("object t square.obj", ":4: the object of line 3 is called \"t\", too"),
        ("camera now", ":4: \"now\" behind camera; its keys are lines of their own; smooth alone may stand there"),
        ("camera", ":4: a camera without keys"),
        ("camera\nat 0 eye 0 0 1 look 0 0 0\ncamera", ":6: camera stands in line 4 already"),
        ("camera\nat 0 look 0 0 0", ":5: no key of the camera says its eye"),
        ("camera\nat 0 eye 0 0 0", ":5: no key of the camera says its look"),
        ("camera\ncycle 2", ":5: a cycle without an object"),
        ("cycle 2", ":4: triangle.obj does not morph"),
        ("cycle 0", ":4: \"0\" is not a time to last"),
        ("cycle 1\ncycle 2", ":5: cycle stands in line 4 already"),
        ("at", ":4: a key begins with its time"),
        ("at -1 scale 2", ":4: a key begins with its time"),
        ("at nan scale 2", ":4: a key begins with its time"),
        ("at 1", ":4: a key that says nothing"),
        ("at 1 eye 0 0 0", ":4: \"eye\" is not part of this key; use move X Y Z, turn"),
        ("at 1 scale 2 scale 2", ":4: scale stands twice in one key"),
        ("at 1 scale 2 2", ":4: scale has 2 finite numbers; write scale S or scale X Y Z"),
        ("at 1 move 1 2 inf", ":4: move has 2 finite numbers before \"inf\"; write move X Y Z"),
        ("at 1 turn 0 1 0", ":4: turn has 3 finite numbers; write turn X Y Z DEGREES"),
        ("at 1 turn 0 1 0 9 quaternion 0 0 0 1", ":4: turn and quaternion are both the rotation"),
        ("at 1 turn 0 0 0 9", ":4: a turn about (0, 0, 0)"),
        ("at 1 turn 0 1 0 1e9", ":4: a turn of 1000000000 degrees, there may be 36000"),
        ("at 1 quaternion 0 0 0 0", ":4: the quaternion (0, 0, 0, 0) is not a rotation"),
        ("at 1 scale 0", ":4: a scale of 0 leaves nothing"),
        ("at 1 scale 2\n\nat 1 scale 3", ":6: 1 s is not behind the 1 s of line 4"),
        ("at 3 scale 2", ":4: a key at 3 s, the scene begins again after 2"),
        ("camera\nat 0 eye 0 0 1 look 0 0 0 fov 180", ":5: a field of view of 180 degrees"),
        ("camera\nat 0 eye 0 0 1 look 0 0 1", ": in frame 0 (from 0), at 0 s, the camera looks nowhere"),
        ("at 0 move 3e38 0 0 scale 1\nat 1 scale 3e38", ": in frame 1 (from 0), at 0.5 s, t is not at a finite place"),
    ] {
        let message = refused(&format!("{object}{lines}\n"));
        assert!(message.starts_with(says), "{lines:?}: {message}");
    }
    for (text, says) in [
        ("", ": does not say its frames"),
        ("frames 4\n", ": does not say its seconds"),
        ("frames 0\n", ":1: \"0\" is not a number of frames; write one from 1 to 10000"),
        ("frames 10001\n", ":1: \"10001\" is not a number of frames"),
        ("seconds -2\n", ":1: \"-2\" is not a time to last"),
        ("at 0 scale 2\n", ":1: a key of nothing"),
        ("frames 1\nseconds 1\n", ": no triangles; a scene needs at least one"),
    ] {
        let message = refused(text);
        assert!(message.starts_with(says), "{text:?}: {message}");
    }
}

#[test]
fn a_scene_that_cannot_be_loaded_is_told_with_the_line_that_names_it() {
    let with = |line: &str| refused(&format!("frames 1\nseconds 1\n{line}\n"));
    let message = with("static sponza");
    assert!(message.starts_with(":3: there is no scene \"sponza\", neither as a file nor in "), "{message}");
    assert!(message.ends_with("name a file, or a folder with --scenes-dir"), "{message}");
    assert!(with("object t gen:cube:3").starts_with(":3: gen:cube:3: unknown generator"));
    assert!(with("object t ./none.obj").starts_with(":3: ./none.obj: no such file"));
    assert!(with("object t scene.dyn").contains("scene.dyn is a .dyn file itself, these are not nested"));
    let folder = Folder::new();
    folder.file("broken.obj", "v 0 0 0\nf 1 2 3\n");
    let path = folder.file("scene.dyn", "frames 1\nseconds 1\nstatic broken.obj\n");
    let message = load_dynamic(&path).expect_err("broken").to_string();
    assert!(
        message.starts_with(&format!("{path}:3: ")) && message.contains("broken.obj:2: face names vertex"),
        "{message}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Whatever words stand in the lines, there is a scene or an error, never a panic, and a scene can be had at any time.
    #[test]
    fn any_lines_are_a_scene_or_an_error(
        lines in prop::collection::vec(
            prop::collection::vec(
                prop::sample::select(vec![
                    "frames", "seconds", "static", "object", "camera", "at", "cycle", "move", "turn", "quaternion", "scale",
                    "eye", "look", "up", "fov", "triangle.obj", "walk.anim", "gen:icosphere:0", "a", "0", "1", "2", "-1", "0.5",
                    "3e38", "1e-45", "36000", "nan", "#", "",
                ]),
                0..12,
            ),
            0..12,
        ),
        time: f32,
    ) {
        let lines: Vec<String> = lines.iter().map(|words| words.join(" ")).collect();
        if let (_, Ok(scene)) = read(&format!("frames 3\nseconds 2\nobject t walk.anim\n{}", lines.join("\n"))) {
            let _ = scene.at(time);
        }
    }

    /// The same of keys that are nearly right, and of bytes that are no text at all.
    #[test]
    fn damaged_files_never_panic(
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..5),
        length: prop::sample::Index,
    ) {
        let good = "frames 3\nseconds 2\nstatic square.obj\nobject t triangle.obj\n at 0 move 1 2 3 turn 0 1 0 90\n at 1 scale 2\n\
                    object w walk.anim\n cycle 0.5\ncamera\n at 0 eye 0 0 9 look 0 0 0 fov 40\n";
        let mut bytes = good.as_bytes().to_vec();
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(length.index(bytes.len()) + 1);
        let folder = Folder::new();
        folder.file("triangle.obj", TRIANGLE);
        folder.file("square.obj", SQUARE);
        folder.bytes("walk.anim", &walk());
        let _ = load_dynamic(&folder.bytes("scene.dyn", &bytes));
    }
}
