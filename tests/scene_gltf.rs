//! glTF and GLB: transforms, cameras, lights, primitive modes, and what a broken file is told.
#![cfg(feature = "cli")]

#[path = "common/files.rs"]
mod files;

use files::{Folder, load, pack};
use proptest::prelude::*;
use serde_json::{Value, json};

/// A square in x and y, then its indices as two triangles.
fn buffer() -> Vec<u8> {
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0];
    let mut bytes: Vec<u8> = corners.iter().flat_map(|c| c.to_le_bytes()).collect();
    bytes.extend([0_u16, 1, 2, 1, 3, 2].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// A document over [`buffer`] with one mesh and these nodes, of which the first is the scene's root.
fn document(nodes: Value) -> Value {
    json!({
        "asset": { "version": "2.0" },
        "buffers": [{ "byteLength": 60 }],
        "bufferViews": [{ "buffer": 0, "byteLength": 48 }, { "buffer": 0, "byteOffset": 48, "byteLength": 12 }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR" }
        ],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "nodes": nodes,
        "scenes": [{ "nodes": [0] }],
        "scene": 0
    })
}

fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let words = [(12 + 8 + text.len() + 8 + binary.len()) as u32, text.len() as u32];
    let mut bytes = b"glTF\x02\0\0\0".to_vec();
    bytes.extend(words[0].to_le_bytes());
    bytes.extend(words[1].to_le_bytes());
    bytes.extend(b"JSON");
    bytes.extend(&text);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(b"BIN\0");
    bytes.extend(binary);
    bytes
}

fn refused(document: &Value) -> String {
    let folder = Folder::new();
    let path = folder.bytes("mesh.glb", &glb(document, &buffer()));
    let message = load(&path).expect_err("a broken file").to_string();
    assert!(!message.contains('\n'), "one line: {message}");
    message.strip_prefix(&path).unwrap_or_else(|| panic!("{message} does not begin with the file")).to_owned()
}

#[test]
fn the_transforms_of_nodes_are_applied_from_the_root_down() {
    let nodes = json!([
        { "children": [1, 2], "translation": [10, 0, 0] },
        { "mesh": 0, "scale": [2, 2, 2] },
        // A quarter turn about z: (x, y) → (−y, x).
        { "mesh": 0, "rotation": [0, 0, std::f64::consts::FRAC_1_SQRT_2, std::f64::consts::FRAC_1_SQRT_2] }
    ]);
    let folder = Folder::new();
    let binary = glb(&document(nodes), &buffer());
    for path in [folder.bytes("a.glb", &binary), folder.bytes("b.glb.zst", &pack(&binary))] {
        let mesh = load(&path).expect(&path).mesh;
        assert_eq!(mesh.triangles, [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]]);
        let expected =
            [[10.0, 0.0], [12.0, 0.0], [10.0, 2.0], [12.0, 2.0], [10.0, 0.0], [10.0, 1.0], [9.0, 0.0], [9.0, 1.0]];
        for (p, e) in mesh.positions.iter().zip(expected) {
            assert!((p[0] - e[0]).abs() < 1e-5 && (p[1] - e[1]).abs() < 1e-5 && p[2] == 0.0, "{p:?} {e:?}");
        }
    }
}

#[test]
fn buffers_may_lie_beside_the_document() {
    let mut document = document(json!([{ "mesh": 0 }]));
    document["buffers"][0]["uri"] = "a%20square.bin".into();
    let folder = Folder::new();
    folder.bytes("a square.bin", &buffer());
    let path = folder.file("mesh.gltf", &document.to_string());
    assert_eq!(load(&path).expect("a square").mesh.triangles.len(), 2);
    std::fs::remove_file(folder.path().join("a square.bin")).expect("just written");
    assert!(load(&path).expect_err("no buffer").to_string().starts_with(&path));
}

#[test]
fn strips_fans_and_unindexed_triangles_are_triangles_and_points_are_not() {
    let triangles = |mode: u32, indexed: bool| {
        let mut document = document(json!([{ "mesh": 0 }]));
        let primitive = &mut document["meshes"][0]["primitives"][0];
        primitive["mode"] = mode.into();
        if !indexed {
            primitive.as_object_mut().expect("an object").remove("indices");
        }
        let folder = Folder::new();
        load(&folder.bytes("mesh.glb", &glb(&document, &buffer()))).map(|scene| scene.mesh.triangles)
    };
    assert_eq!(triangles(5, false).expect("a strip"), [[0, 1, 2], [1, 3, 2]]);
    assert_eq!(triangles(6, false).expect("a fan"), [[0, 1, 2], [0, 2, 3]]);
    assert_eq!(triangles(4, true).expect("triangles"), [[0, 1, 2], [1, 3, 2]]);
    assert!(triangles(4, false).expect_err("four corners").to_string().contains("4 indices make no whole triangles"));
    assert!(triangles(0, true).expect_err("points").to_string().contains("no triangles"));
}

#[test]
fn the_camera_of_the_file_is_taken() {
    let mut document = document(json!([
        { "mesh": 0, "children": [1] },
        { "camera": 0, "translation": [3, 4, 5] }
    ]));
    document["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    let folder = Folder::new();
    let camera = load(&folder.bytes("mesh.glb", &glb(&document, &buffer()))).expect("a square").camera;
    // A glTF camera looks down its own −z.
    assert_eq!((camera.eye, camera.look, camera.up), ([3.0, 4.0, 5.0], [3.0, 4.0, 4.0], [0.0, 1.0, 0.0]));
    assert!((camera.fov - 57.295_78).abs() < 1e-4);
}

#[test]
fn punctual_lights_are_points_and_directional_ones_far_away() {
    let light = |i: u32| json!({ "KHR_lights_punctual": { "light": i } });
    let mut document = document(json!([
        { "mesh": 0, "children": [1, 2] },
        { "translation": [1, 2, 3], "extensions": light(0) },
        { "extensions": light(1) }
    ]));
    document["extensionsUsed"] = json!(["KHR_lights_punctual"]);
    document["extensions"] =
        json!({ "KHR_lights_punctual": { "lights": [{ "type": "point" }, { "type": "directional" }] } });
    let folder = Folder::new();
    let lights = load(&folder.bytes("mesh.glb", &glb(&document, &buffer()))).expect("a square").lights;
    assert_eq!(lights.len(), 2);
    assert_eq!((lights[0].corner, lights[0].edges), ([1.0, 2.0, 3.0], [[0.0; 3]; 2]));
    // It shines down −z, so that it stands on the side of +z, ten diagonals (√2) from the middle.
    assert!((lights[1].corner[2] - 10.0 * 2_f32.sqrt()).abs() < 1e-4, "{lights:?}");
}

#[test]
fn broken_documents_are_told_what_is_broken() {
    let good = || document(json!([{ "mesh": 0 }]));
    let with = |change: &dyn Fn(&mut Value)| {
        let mut document = good();
        change(&mut document);
        refused(&document)
    };
    let message = with(&|d| d["accessors"][0]["count"] = 3.into());
    assert!(message.contains("mesh 0, primitive 0: triangle 1 names vertex 3"), "{message}");
    let message = with(&|d| d["accessors"][0]["count"] = 400.into());
    assert!(message.contains("reaches beyond the end of its buffer; is it cut off?"), "{message}");
    let message = with(&|d| d["accessors"][0]["componentType"] = 5122.into());
    assert!(message.contains("positions are not three 32-bit floats"), "{message}");
    let message = with(&|d| d["nodes"][0]["children"] = json!([0]));
    assert!(message.contains("node 0 has two parents, or is its own"), "{message}");
    let message = with(&|d| d["nodes"][0] = json!({ "mesh": 0, "translation": [3e38, 0, 0], "scale": [3e38, 1, 1] }));
    assert!(message.contains("mesh 0, primitive 0, placed by its node: vertex 1 (from 0) is (inf, 0, 0)"), "{message}");
    let message = with(&|d| d["buffers"][0]["uri"] = "%ff.bin".into());
    assert!(message.contains("not UTF-8"), "{message}");
    let message = with(&|d| d["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    assert!(message.contains("export it again"), "{message}");
    let folder = Folder::new();
    let whole = glb(&good(), &buffer());
    for length in [0, 11, 12, 30, whole.len() - 61, whole.len() - 1] {
        let path = folder.bytes("mesh.glb", &whole[..length]);
        assert!(load(&path).expect_err("cut off").to_string().contains("is it cut off"), "{length}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    /// Whatever a byte is changed to, there is a scene or an error, never a panic.
    #[test]
    fn damaged_files_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)) {
        let mut document = document(json!([{ "mesh": 0, "children": [1] }, { "camera": 0, "translation": [3, 4, 5] }]));
        document["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
        let mut bytes = glb(&document, &buffer());
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let folder = Folder::new();
        let _ = load(&folder.bytes("mesh.glb", &bytes));
    }

    /// As above, digits for digits, so that the document stays one.
    #[test]
    fn wrong_numbers_never_panic(at: prop::sample::Index, number in prop::sample::select(vec!["0", "1", "-1", "7", "5121", "99999999", "4294967296", "18446744073709551615", "1e400"])) {
        let text = document(json!([{ "mesh": 0 }])).to_string();
        let numbers: Vec<_> = text.match_indices(|c: char| c.is_ascii_digit()).map(|(i, _)| i).collect();
        let start = numbers[at.index(numbers.len())];
        let end = start + text[start..].find(|c: char| !c.is_ascii_digit()).unwrap_or(0);
        let changed = format!("{}{number}{}", &text[..start], &text[end..]);
        let folder = Folder::new();
        folder.bytes("buffer.bin", &buffer());
        let _ = load(&folder.file("mesh.gltf", &changed.replace("\"byteLength\":60", "\"byteLength\":60,\"uri\":\"buffer.bin\"")));
    }
}
