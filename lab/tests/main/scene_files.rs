//! Finding and unpacking files, `.tri` and `.anim`, cameras, and the shared scenes where they are.

use crate::files::{Folder, load, pack};
use hedgerow_lab::scene::{self, Animation, LoadOptions, Progress};
use proptest::prelude::*;
use std::cell::Cell;

/// A square of two triangles, as `.tri`.
fn square_tri() -> Vec<u8> {
    let mut bytes = Vec::new();
    for word in [4_u32, 2] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(square_vertices());
    bytes.extend(SQUARE_INDICES.iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

const SQUARE_INDICES: [u32; 6] = [0, 1, 2, 0, 2, 3];

fn square_vertices() -> Vec<u8> {
    [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0].iter().flat_map(|c| c.to_le_bytes()).collect()
}

fn square_anim(frames: u32) -> Vec<u8> {
    let mut bytes: Vec<u8> = [4_u32, 2, frames].iter().chain(&SQUARE_INDICES).flat_map(|w| w.to_le_bytes()).collect();
    for frame in 0..frames {
        bytes.extend(
            square_vertices()
                .chunks(4)
                .flat_map(|c| (f32::from_le_bytes(c.try_into().expect("four bytes")) + frame as f32).to_le_bytes()),
        );
    }
    bytes
}

fn refused(name: &str, bytes: &[u8]) -> String {
    refused_by(load, name, bytes)
}

fn refused_by<T: std::fmt::Debug>(load: impl Fn(&str) -> hedgerow_lab::Result<T>, name: &str, bytes: &[u8]) -> String {
    let folder = Folder::new();
    let path = folder.bytes(name, bytes);
    let message = load(&path).expect_err(name).to_string();
    message.strip_prefix(&path).unwrap_or_else(|| panic!("{message} does not begin with the file")).to_owned()
}

fn load_animation(spec: &str) -> hedgerow_lab::Result<Animation> {
    scene::load_animation(spec, &LoadOptions::default())
}

#[test]
fn tri_and_the_first_frame_of_anim_are_read() {
    let folder = Folder::new();
    for path in [folder.bytes("square.tri", &square_tri()), folder.bytes("walk.anim", &square_anim(3))] {
        let scene = load(&path).expect(&path);
        assert_eq!(scene.mesh.triangles, [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(scene.mesh.positions[2], [1.0, 1.0, 0.0]);
    }
}

#[test]
fn packed_files_are_the_same_scene_with_the_same_name() {
    let folder = Folder::new();
    let plain = load(&folder.bytes("square.tri", &square_tri())).expect("plain");
    let packed = load(&folder.bytes("square.tri.zst", &pack(&square_tri()))).expect("packed");
    assert_eq!(plain.name, "square");
    assert_eq!(packed.name, "square");
    assert_eq!(plain.mesh.positions, packed.mesh.positions);
    // Frames behind one another are one file, as `zstd -d` has it.
    let tri = square_tri();
    let frames = [pack(&tri[..17]), pack(&tri[17..])].concat();
    assert_eq!(
        load(&folder.bytes("frames.tri.zst", &frames)).expect("two frames").mesh.triangles,
        plain.mesh.triangles
    );
}

#[test]
fn a_packed_file_that_is_cut_off_or_damaged_is_told_so() {
    let packed = pack(&square_tri());
    for length in 1..packed.len() {
        let message = refused("square.tri.zst", &packed[..length]);
        assert!(message.contains("is it cut off?"), "{length}: {message}");
    }
    let mut damaged = packed.clone();
    *damaged.last_mut().expect("not empty") ^= 1;
    assert!(refused("square.tri.zst", &damaged).contains("checksum"));
    assert!(refused("square.tri.zst", b"no zstd at all").contains("cannot be unpacked"));
}

#[test]
fn binary_files_that_are_cut_off_say_what_is_missing() {
    let tri = square_tri();
    for length in 0..tri.len() {
        let message = refused("square.tri", &tri[..length]);
        assert!(message.starts_with(": ends before ") && message.ends_with("is it cut off?"), "{length}: {message}");
    }
    let anim = square_anim(1);
    for length in 0..anim.len() {
        assert!(refused("walk.anim", &anim[..length]).ends_with("is it cut off?"), "{length}");
    }
    assert!(refused("square.tri", &[tri, vec![0]].concat()).contains("goes on behind its last triangle"));
    assert!(refused("walk.anim", &square_anim(0)).contains("no frames"));
    // A head that promises 4 billion vertices must not take the memory for them.
    assert!(refused("huge.tri", &[0xff; 64]).contains("is it cut off?"));
}

#[test]
fn every_frame_of_an_animation_is_read() {
    let folder = Folder::new();
    for path in [folder.bytes("walk.anim", &square_anim(3)), folder.bytes("walk.anim.zst", &pack(&square_anim(3)))] {
        let walk = load_animation(&path).expect(&path);
        assert_eq!((walk.name.as_str(), walk.frames.len()), ("walk", 3));
        assert_eq!(walk.triangles, [[0, 1, 2], [0, 2, 3]]);
        for frame in 0..3 {
            // Each frame is the square, moved by its number along all axes.
            let by = frame as f32;
            let corners = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| [x + by, y + by, by]);
            assert_eq!(walk.mesh(frame).positions, corners);
        }
        assert_eq!((walk.bounds().lo, walk.bounds().hi), ([0.0; 3], [3.0, 3.0, 2.0]));
        assert_eq!(walk.mesh(0).positions, load(&path).expect(&path).mesh.positions);
    }
    let known = load_animation(&folder.bytes("pigman_run.anim", &square_anim(1))).expect("one frame");
    assert_eq!((known.camera.eye, known.camera.fov), ([2.0, 2.0, 3.0], 40.0));
}

#[test]
fn animations_that_are_broken_in_any_frame_are_told_so() {
    let refused = |bytes: &[u8]| refused_by(load_animation, "walk.anim", bytes);
    let anim = square_anim(3);
    for length in 0..anim.len() {
        let message = refused(&anim[..length]);
        assert!(message.starts_with(": ends before ") && message.ends_with("is it cut off?"), "{length}: {message}");
    }
    assert!(refused(&anim[..anim.len() - 1]).contains("frame 2 (from 0) of 3"));
    assert!(refused(&[anim.clone(), vec![0]].concat()).starts_with(": goes on behind its last frame"));
    assert!(refused(&square_anim(0)).starts_with(": no frames; an animation needs at least one"));
    let mut wrong = anim.clone();
    wrong[12..16].copy_from_slice(&4_u32.to_le_bytes());
    assert_eq!(refused(&wrong), ": triangle 0 names vertex 4 (both from 0), there are 4; is it cut off?");
    let mut wrong = anim.clone();
    let second_vertex_of_the_last_frame = anim.len() - 3 * 12;
    wrong[second_vertex_of_the_last_frame..][..4].copy_from_slice(&f32::INFINITY.to_le_bytes());
    let message = refused(&wrong);
    assert!(message.starts_with(": frame 2 (from 0) of 3: vertex 1 (from 0) is (inf, 2, 2)"), "{message}");
    // The first frame alone is in order, and all that a still picture reads.
    assert!(load(&Folder::new().bytes("walk.anim", &wrong)).is_ok());
    // Four billion frames of no vertices are no reason to take memory for them.
    let nothing: Vec<u8> = [0, 0, u32::MAX].iter().flat_map(|w: &u32| w.to_le_bytes()).collect();
    assert_eq!(refused(&nothing), ": no triangles; a scene needs at least one");
}

#[test]
fn what_is_no_animation_is_told_so() {
    let folder = Folder::new();
    let square = folder.bytes("square.tri", &square_tri());
    for spec in [square.as_str(), "gen:icosphere:1", "gen:forest:3"] {
        let message = load_animation(spec).expect_err(spec).to_string();
        let expected = ": not an animation; take an .anim file or gen:twist:N:FRAMES";
        assert_eq!(message.strip_prefix(spec), Some(expected));
    }
    assert!(load_animation("none.anim").expect_err("missing").to_string().contains("there is no scene \"none.anim\""));
}

#[test]
fn binary_files_with_bad_indices_or_vertices_name_the_item() {
    let mut tri = square_tri();
    let last = tri.len() - 4;
    tri[last..].copy_from_slice(&70_112_u32.to_le_bytes());
    assert_eq!(
        refused("square.tri", &tri),
        ": triangle 1 names vertex 70112 (both from 0), there are 4; is it cut off?"
    );
    for wrong in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        let mut tri = square_tri();
        tri[8 + 12..8 + 16].copy_from_slice(&wrong.to_le_bytes());
        let message = refused("square.tri", &tri);
        assert!(message.starts_with(": vertex 1 (from 0) is (") && message.contains("finite"), "{message}");
    }
}

#[test]
fn missing_files_unknown_formats_and_folders_are_told_apart() {
    let folder = Folder::new();
    let here = folder.path().display().to_string();
    let message = |spec: &str| load(spec).expect_err(spec).to_string();
    assert!(message(&format!("{here}/none.obj")).ends_with("none.obj: no such file; check the path"));
    assert!(message("no_such_scene").contains("there is no scene \"no_such_scene\""));
    assert!(message(&here).contains("is a folder"));
    let blend = folder.bytes("scene.blend", b"BLENDER");
    assert!(message(&blend).contains("not a format we read; take one of .obj, .ply,"));
}

#[test]
fn bare_names_are_looked_up_in_the_folders_in_order_packed_or_not() {
    let (first, second) = (Folder::new(), Folder::new());
    first.bytes("square.tri.zst", &pack(&square_tri()));
    second.bytes("square.tri", &square_tri()[..20]);
    second.bytes("walk.anim", &square_anim(1));
    let options = LoadOptions { folders: vec![first.path().into(), second.path().into()], progress: None };
    for spec in ["square", "square.tri", "square.tri.zst", "walk", "walk.anim"] {
        assert_eq!(scene::load(spec, &options).expect(spec).mesh.triangles.len(), 2);
    }
    assert!(scene::load("square.obj", &options).is_err());
}

#[test]
fn a_folder_lists_its_scenes_by_name_without_the_parts_of_instances() {
    let folder = Folder::new();
    for name in ["b.tri", "a.obj.zst", "forest.inst", "forest_parts.obj", "README.md", "c_parts.obj"] {
        folder.bytes(name, b"");
    }
    let listed = scene::list(folder.path()).expect("a folder");
    let names: Vec<_> = listed.iter().map(|p| p.file_name().expect("a file").to_string_lossy().into_owned()).collect();
    assert_eq!(names, ["a.obj.zst", "b.tri", "c_parts.obj", "forest.inst"]);
    assert!(scene::list(&folder.path().join("none")).is_err());
}

#[test]
fn progress_grows_to_the_length_of_the_file() {
    let folder = Folder::new();
    let path = folder.bytes("square.tri", &square_tri());
    let last = Cell::new(Progress { done: 0, total: 0 });
    let progress = |p: Progress| {
        assert!(p.done >= last.get().done);
        last.set(p);
    };
    scene::load(&path, &LoadOptions { folders: vec![], progress: Some(&progress) }).expect("a square");
    let length = square_tri().len() as u64;
    assert_eq!(last.get(), Progress { done: length, total: length });
}

#[test]
fn known_scenes_have_their_camera_and_others_see_all_of_it() {
    let folder = Folder::new();
    let known = load(&folder.bytes("sponza.tri", &square_tri())).expect("sponza");
    assert_eq!((known.camera.eye, known.camera.fov), ([-11.0, 4.0, 0.3], 65.0));
    let other = load(&folder.bytes("square.tri", &square_tri())).expect("square");
    assert_eq!(other.camera.look, [0.5, 0.5, 0.0]);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever bytes are changed, lost or added, there is a scene or an error, never a panic.
    #[test]
    fn damaged_files_never_panic(
        kind in 0_usize..5,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..5),
        length: prop::sample::Index,
    ) {
        let ply = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
                   element face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
        let (name, mut bytes) = match kind {
            0 => ("a.tri", square_tri()),
            1 => ("a.anim", square_anim(2)),
            2 => ("a.tri.zst", pack(&square_tri())),
            3 => ("a.obj", b"v 0 0 0\nv 1 0 0 1\nv 1 1 0 0 0 1\nvn 0 0 1\no a\nf 1/2/3 -2//1 3\nl 1 2\n".to_vec()),
            _ => ("a.ply", ply.into()),
        };
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        bytes.truncate(length.index(bytes.len()) + 1);
        let folder = Folder::new();
        let path = folder.bytes(name, &bytes);
        let _ = load(&path);
        let _ = load_animation(&path);
    }
}
