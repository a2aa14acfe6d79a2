//! `.inst`: placed copies, kept apart or flattened in the order of the file.

use crate::files::{Folder, load, pack};
use hedgerow_lab::scene::{self, Instances, LoadOptions, Mesh, SceneInstance};

/// Two objects whose vertices come first, as exporters write them.
const PARTS: &str =
    "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 5\nv 1 0 5\nv 0 1 5\no leaf\nf 1 2 3\no trunk\nf 4 5 6\nf 4 6 5\n";

fn refused(inst: &str, parts: &str) -> String {
    let folder = Folder::new();
    folder.file("wood_parts.obj", parts);
    let path = folder.file("wood.inst", inst);
    load(&path).expect_err(inst).to_string().replace(&folder.path().display().to_string(), "")
}

#[test]
fn instances_are_written_out_in_the_order_of_the_file() {
    let inst = "# NAME then a row-major 3x4 matrix\n\nleaf 1 0 0 10 0 1 0 20 0 0 1 30\ntrunk 0 -1 0 0 1 0 0 0 0 0 2 0 # turned\n\
                leaf 2 0 0 0 0 2 0 0 0 0 2 0\n";
    let folder = Folder::new();
    for (parts, content) in
        [("wood_parts.obj", PARTS.as_bytes().to_vec()), ("wood_parts.obj.zst", pack(PARTS.as_bytes()))]
    {
        folder.bytes(parts, &content);
        let scene = load(&folder.file("wood.inst", inst)).expect(parts);
        let corners: Vec<_> = (0..scene.mesh.triangles.len()).map(|t| scene.mesh.corners(t)).collect();
        assert_eq!(
            corners,
            [
                [[10.0, 20.0, 30.0], [11.0, 20.0, 30.0], [10.0, 21.0, 30.0]],
                // A quarter turn about z, and z doubled: (x, y, z) → (−y, x, 2z).
                [[0.0, 0.0, 10.0], [0.0, 1.0, 10.0], [-1.0, 0.0, 10.0]],
                [[0.0, 0.0, 10.0], [-1.0, 0.0, 10.0], [0.0, 1.0, 10.0]],
                [[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]],
            ]
        );
        std::fs::remove_file(folder.path().join(parts)).expect("just written");
    }
}

#[test]
fn what_is_wrong_is_told_with_file_and_line() {
    let good = "leaf 1 0 0 0 0 1 0 0 0 0 1 0\n";
    assert_eq!(
        refused(&format!("{good}fern 1 0 0 0 0 1 0 0 0 0 1 0\n"), PARTS),
        "/wood.inst:2: /wood_parts.obj has no object \"fern\", it has leaf, trunk; correct the name"
    );
    for line in ["leaf", "leaf 1 0 0 0 0 1 0 0 0 0 1", "leaf 1 0 0 0 0 1 0 0 0 0 1 x", "leaf 1 0 0 nan 0 1 0 0 0 0 1 0"]
    {
        let message = refused(&format!("{good}{line}\n"), PARTS);
        assert!(message.starts_with("/wood.inst:2: an instance is a name and 12 finite numbers"), "{message}");
    }
    let message = refused("leaf 3e38 0 0 3e38 0 1 0 0 0 0 1 0\n", PARTS);
    assert!(message.starts_with("/wood.inst:1: vertex 1 (from 0) is (inf, 0, 0)"), "{message}");
    let message = refused(good, "v 0 0 0\no leaf\nf 1 2 3\n");
    assert!(message.starts_with("/wood_parts.obj:3: face names vertex 2, the file has 1"), "{message}");
    let folder = Folder::new();
    let message = load(&folder.file("wood.inst", good)).expect_err("no parts").to_string();
    assert!(message.ends_with("put wood_parts.obj or wood_parts.obj.zst beside it"), "{message}");
}

fn load_instances(spec: &str) -> Instances {
    scene::load_instances(spec, &LoadOptions { folders: scene::own_folders(), progress: None }).expect(spec)
}

/// FNV-1a of all bytes of a mesh.
fn fingerprint(mesh: &Mesh) -> u64 {
    let positions = mesh.positions.iter().flatten().map(|c| c.to_bits());
    let words = positions.chain(mesh.triangles.iter().flatten().copied());
    words
        .flat_map(u32::to_le_bytes)
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3))
}

#[test]
fn pine_hill_is_flattened_into_the_same_bytes_as_ever() {
    let instances = load_instances("pine_hill");
    let flat = instances.flatten().expect("small");
    // Of the reader that knew no instances and wrote each line's copy out at once.
    assert_eq!(fingerprint(&flat), 0xe0eb_25ee_4ea2_b985);
    let scene =
        scene::load("pine_hill", &LoadOptions { folders: scene::own_folders(), progress: None }).expect("pine_hill");
    assert_eq!(
        (fingerprint(&scene.mesh), &scene.name, scene.camera),
        (fingerprint(&flat), &instances.name, instances.camera)
    );
    assert_eq!(instances.triangle_count(), 138_368);
    assert_eq!(instances.bounds(), flat.bounds());
}

#[test]
fn instances_are_the_lines_of_the_file_and_share_their_parts() {
    let instances = load_instances("pine_hill");
    let text = include_str!("../../../scenes/pine_hill.inst");
    let lines: Vec<Vec<&str>> =
        text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split_whitespace().collect()).collect();
    // One hill and 64 pines, says the folder's README.
    assert_eq!((instances.parts.len(), instances.instances.len(), lines.len()), (2, 65, 65));
    let hill = instances.instances[0].part;
    for (instance, line) in instances.instances.iter().zip(&lines) {
        let numbers: Vec<f32> = line[1..].iter().map(|word| word.parse().expect("a number")).collect();
        assert_eq!(instance.transform.as_flattened(), numbers);
        assert_eq!(instance.part == hill, line[0] == "hill");
    }
}

#[test]
fn a_name_that_two_objects_bear_places_both_and_an_object_may_stand_nowhere() {
    let parts = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 5\no leaf\nf 1 2 3\no trunk\nf 1 2 4\no leaf\nf 1 4 3\n";
    let folder = Folder::new();
    folder.file("wood_parts.obj", parts);
    let wood =
        load_instances(&folder.file("wood.inst", "leaf 1 0 0 0 0 1 0 0 0 0 1 0\nleaf 1 0 0 9 0 1 0 0 0 0 1 0\n"));
    assert_eq!(wood.instances.iter().map(|i| i.part).collect::<Vec<_>>(), [0, 2, 0, 2]);
    assert_eq!((wood.parts.len(), wood.triangle_count()), (3, 4));
    // The trunk, of height 5 as well as the second leaf, is not there; 9 moves the leaf's 0..1.
    assert_eq!((wood.bounds().lo, wood.bounds().hi), ([0.0; 3], [10.0, 1.0, 5.0]));
}

#[test]
fn a_mesh_is_one_part_that_stands_where_it_is() {
    for spec in ["grass", "gen:soup:100:1", "hall"] {
        let options = LoadOptions { folders: scene::own_folders(), progress: None };
        let (scene, instances) = (scene::load(spec, &options).expect(spec), load_instances(spec));
        assert_eq!(instances.instances, [SceneInstance { part: 0, transform: SceneInstance::IDENTITY }]);
        assert_eq!(instances.parts.len(), 1);
        assert_eq!(fingerprint(&instances.parts[0]), fingerprint(&scene.mesh));
        assert_eq!((&instances.name, instances.camera, &instances.lights), (&scene.name, scene.camera, &scene.lights));
        assert_eq!(instances.flatten().expect("small").bounds(), scene.mesh.bounds());
    }
}

#[test]
fn instances_that_cannot_be_loaded_tell_what_the_mesh_would() {
    let folder = Folder::new();
    folder.file("wood_parts.obj", PARTS);
    let broken = folder.file("wood.inst", "leaf 1 0 0\n");
    let empty = folder.file("wood.inst.zst", "");
    for spec in [broken.as_str(), empty.as_str(), "no_such_scene", "gen:cube:3", "gen:soup:0:1"] {
        let options = LoadOptions::default();
        let message = scene::load_instances(spec, &options).expect_err(spec).to_string();
        assert_eq!(message, load(spec).expect_err(spec).to_string());
    }
    assert!(
        load(&folder.file("wood.inst", "# nothing\n"))
            .expect_err("empty")
            .to_string()
            .ends_with("wood.inst: no triangles; a scene needs at least one")
    );
}

#[test]
fn more_triangles_than_can_be_flattened_are_refused_and_kept_as_instances() {
    let mut scene = load_instances("gen:soup:1:1");
    scene.parts[0].triangles = vec![[0, 1, 2]; 1 << 20];
    scene.instances = vec![scene.instances[0]; (Instances::MOST_FLATTENED >> 20) as usize + 1];
    assert_eq!(scene.triangle_count(), Instances::MOST_FLATTENED + (1 << 20));
    let message = scene.flatten().expect_err("too many").to_string();
    assert!(
        message.starts_with("gen:soup:1:1: 135266304 triangles when flattened, there may be 134217728"),
        "{message}"
    );
}

proptest::proptest! {
    /// A box of placed corners holds every placed point of the box, rounding and all.
    #[test]
    fn placed_points_lie_in_the_placed_box(
        transform: [[f32; 4]; 3],
        corners: [[f32; 3]; 2],
        inside in proptest::array::uniform3(0.0_f32..=1.0),
    ) {
        // What is drawn spans all exponents; the domain is what stays finite.
        let transform = transform.map(|row| row.map(|c| c.clamp(-1e15, 1e15)));
        let corners = corners.map(|p| p.map(|c| c.clamp(-1e15, 1e15)));
        let bounds = hedgerow::geometry::Aabb::around(&corners);
        let point = std::array::from_fn(|i| {
            (bounds.lo[i] + inside[i] * (bounds.hi[i] - bounds.lo[i])).clamp(bounds.lo[i], bounds.hi[i])
        });
        let instance = SceneInstance { part: 0, transform };
        let (placed, at) = (instance.place_box(&bounds), instance.place(point));
        proptest::prop_assert!((0..3).all(|i| placed.lo[i] <= at[i] && at[i] <= placed.hi[i]), "{placed:?} {at:?}");
    }
}
