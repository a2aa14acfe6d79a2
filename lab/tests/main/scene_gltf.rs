//! glTF and GLB: transforms, cameras, lights, primitive modes, and what a broken file is told.

use crate::files::{Folder, load, pack};
use hedgerow_lab::scene::{self, DynamicScene, LoadOptions};
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

/// Key times 0, 1 and 2, then values, in accessors 2 and 3 behind the square; a target of the square in accessor 4.
fn animated(nodes: Value, channels: Value, samplers: Value, values: &[f32], kind: &str) -> (Value, Vec<u8>) {
    let mut bytes = buffer();
    let width = if kind == "VEC4" {
        4
    } else if kind == "VEC3" {
        3
    } else {
        1
    };
    let target = [0.0_f32, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 8.0];
    let numbers = [0.0, 1.0, 2.0].iter().chain(values).chain(&target);
    bytes.extend(numbers.flat_map(|n: &f32| n.to_le_bytes()));
    let mut document = document(nodes);
    document["buffers"][0]["byteLength"] = bytes.len().into();
    let views = document["bufferViews"].as_array_mut().expect("a list");
    views.push(json!({ "buffer": 0, "byteOffset": 60, "byteLength": 12 }));
    views.push(json!({ "buffer": 0, "byteOffset": 72, "byteLength": 4 * values.len() }));
    views.push(json!({ "buffer": 0, "byteOffset": 72 + 4 * values.len(), "byteLength": 48 }));
    let accessors = document["accessors"].as_array_mut().expect("a list");
    accessors
        .push(json!({ "bufferView": 2, "componentType": 5126, "count": 3, "type": "SCALAR", "min": [0], "max": [2] }));
    accessors.push(json!({ "bufferView": 3, "componentType": 5126, "count": values.len() / width, "type": kind }));
    accessors.push(json!({ "bufferView": 4, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [0, 0, 8] }));
    document["animations"] = json!([{ "channels": channels, "samplers": samplers }]);
    (document, bytes)
}

fn load_dynamic((document, bytes): &(Value, Vec<u8>)) -> hedgerow_lab::Result<DynamicScene> {
    let folder = Folder::new();
    scene::load_dynamic(&folder.bytes("mesh.glb", &glb(document, bytes)), &LoadOptions::default())
}

fn channel(node: u32, path: &str) -> Value {
    json!([{ "sampler": 0, "target": { "node": node, "path": path } }])
}

fn sampler(interpolation: &str) -> Value {
    json!([{ "input": 2, "output": 3, "interpolation": interpolation }])
}

/// A static square, one that an animation moves, and one below that, 2 − ½·2 up.
fn three_squares() -> Value {
    json!([
        { "mesh": 0, "children": [1], "translation": [10, 0, 0] },
        { "name": "mover", "mesh": 0, "children": [2], "scale": [2, 2, 2] },
        { "translation": [0, 0, 2], "scale": [1, 1, 0.5], "children": [3] },
        { "mesh": 0, "translation": [0, 0, -2] }
    ])
}

#[test]
fn nodes_that_an_animation_moves_are_objects_and_the_rest_is_static() {
    let values = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 6.0, 0.0];
    let file = animated(three_squares(), channel(1, "translation"), sampler("LINEAR"), &values, "VEC3");
    let scene = load_dynamic(&file).expect("animated");
    assert_eq!(scene.static_mesh.positions[1], [11.0, 0.0, 0.0]);
    assert_eq!(scene.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["mover", "node 3"]);
    assert_eq!((scene.seconds, scene.frames), (2.0, 48));
    // The second corner is (1, 0, 0): doubled, moved by the animation and by the parent; the child's stands 1 up, doubled too.
    for (time, x, y) in [(0.0, 0.0, 0.0), (0.5, 2.0, 0.0), (1.0, 4.0, 0.0), (1.25, 4.0, 1.5), (2.5, 2.0, 0.0)] {
        assert_eq!(scene.objects[0].placed(time)[1], [12.0 + x, y, 0.0], "{time}");
        assert_eq!(scene.objects[1].placed(time)[1], [12.0 + x, y, 2.0], "{time}");
    }
    // At rest it is the scene at time 0, what stands before what moves.
    let folder = Folder::new();
    let still = load(&folder.bytes("mesh.glb", &glb(&file.0, &file.1))).expect("at rest").mesh;
    assert_eq!(still.positions, scene.at(0.0).expect("finite").mesh.positions);
}

#[test]
fn steps_splines_and_rotations_are_as_gltf_has_them() {
    let placed = |path: &str, interpolation: &str, values: &[f32], kind: &str, time: f32| {
        let file = animated(json!([{ "mesh": 0 }]), channel(0, path), sampler(interpolation), values, kind);
        load_dynamic(&file).expect(path).objects[0].placed(time)[1]
    };
    let values = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 6.0, 0.0];
    assert_eq!(placed("translation", "STEP", &values, "VEC3", 0.9), [1.0, 0.0, 0.0]);
    assert_eq!(placed("translation", "STEP", &values, "VEC3", 1.0), [5.0, 0.0, 0.0]);
    assert_eq!(placed("scale", "LINEAR", &values, "VEC3", 0.5), [2.0, 0.0, 0.0]);
    // Into each key, the value, out of it: from 0 with slope 8 to 0 with slope 0, at the half (⅛)·8 = 1.
    let mut spline = [0.0; 27];
    spline[6] = 8.0;
    assert_eq!(placed("translation", "CUBICSPLINE", &spline, "VEC3", 0.5), [2.0, 0.0, 0.0]);
    // No rotation, then half a turn about z in two steps: an eighth of a turn at the half of the first.
    let (c, s) = (std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2);
    let rotations = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, s, c, 0.0, 0.0, 1.0, 0.0];
    let at = placed("rotation", "LINEAR", &rotations, "VEC4", 0.5);
    assert!((at[0] - c).abs() < 1e-6 && (at[1] - s).abs() < 1e-6, "{at:?}");
    let at = placed("rotation", "LINEAR", &rotations, "VEC4", 1.0);
    assert!(at[0].abs() < 1e-6 && (at[1] - 1.0).abs() < 1e-6, "{at:?}");
}

/// A square whose fourth corner a target lifts by 8.
fn with_target(mut file: (Value, Vec<u8>)) -> (Value, Vec<u8>) {
    file.0["meshes"][0]["primitives"][0]["targets"] = json!([{ "POSITION": 4 }]);
    file
}

#[test]
fn weights_morph_a_mesh_and_those_of_the_file_hold_where_none_are_animated() {
    let file = with_target(animated(
        json!([{ "mesh": 0 }]),
        channel(0, "weights"),
        sampler("LINEAR"),
        &[0.0, 1.0, 0.5],
        "SCALAR",
    ));
    let scene = load_dynamic(&file).expect("morphing");
    assert!(scene.objects[0].morphs());
    for (time, z) in [(0.0, 0.0), (0.25, 2.0), (1.0, 8.0), (1.5, 6.0)] {
        assert_eq!(scene.objects[0].mesh_at(time)[3], [1.0, 1.0, z], "{time}");
    }
    let values = [0.0; 9];
    let mut file =
        with_target(animated(three_squares(), channel(1, "translation"), sampler("LINEAR"), &values, "VEC3"));
    file.0["meshes"][0]["weights"] = json!([0.25]);
    let scene = load_dynamic(&file).expect("moving");
    assert_eq!((scene.static_mesh.positions[3][2], scene.objects[0].mesh_at(1.0)[3][2]), (2.0, 2.0));
    assert!(!scene.objects[0].morphs());
}

#[test]
fn a_camera_that_a_node_carries_goes_with_it() {
    let nodes = json!([{ "mesh": 0, "children": [1] }, { "children": [2] }, { "camera": 0, "translation": [0, 0, 5] }]);
    let values = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 6.0, 0.0];
    let mut file = animated(nodes, channel(1, "translation"), sampler("LINEAR"), &values, "VEC3");
    file.0["cameras"] = json!([{ "type": "perspective", "perspective": { "yfov": 1.0, "znear": 0.1 } }]);
    let scene = load_dynamic(&file).expect("a moving camera");
    assert_eq!((scene.objects.len(), scene.static_mesh.triangles.len()), (0, 2));
    let camera = scene.camera(0.5);
    assert_eq!((camera.eye, camera.look, camera.up), ([2.0, 0.0, 5.0], [2.0, 0.0, 4.0], [0.0, 1.0, 0.0]));
}

#[test]
fn of_two_animations_of_one_property_the_first_counts() {
    let values = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 6.0, 0.0];
    let mut file = animated(json!([{ "mesh": 0 }]), channel(0, "translation"), sampler("LINEAR"), &values, "VEC3");
    let mut second = file.0["animations"][0].clone();
    second["channels"] = json!([{ "sampler": 0, "target": { "node": 0, "path": "translation" } }, { "sampler": 0, "target": { "node": 0, "path": "scale" } }]);
    second["samplers"][0]["interpolation"] = "STEP".into();
    file.0["animations"].as_array_mut().expect("a list").push(second);
    let scene = load_dynamic(&file).expect("animated twice");
    // Translation by the first, evenly; scale by the second, in steps: (4, 0, 0) from time 1 on.
    assert_eq!(scene.objects[0].placed(1.5)[1], [8.0, 3.0, 0.0]);
}

#[test]
fn broken_animations_are_told_what_is_broken() {
    let values = [0.0, 0.0, 0.0, 4.0, 0.0, 0.0, 4.0, 6.0, 0.0];
    let good = || animated(json!([{ "mesh": 0 }]), channel(0, "translation"), sampler("LINEAR"), &values, "VEC3");
    let with = |change: &dyn Fn(&mut Value, &mut Vec<u8>)| {
        let (mut document, mut bytes) = good();
        change(&mut document, &mut bytes);
        load_dynamic(&(document, bytes)).expect_err("a broken file").to_string()
    };
    let place = "mesh.glb: animation 0, channel 0: ";
    for (change, says) in [
        (
            &(|d: &mut Value, _: &mut Vec<u8>| d["animations"][0]["channels"][0]["target"]["node"] = 7.into())
                as &dyn Fn(&mut Value, &mut Vec<u8>),
            "moves node 7, the file has 1; is it cut off?",
        ),
        (
            &|d, _| d["animations"][0]["channels"][0]["target"]["path"] = "colour".into(),
            "moves neither translation, rotation, scale nor weights",
        ),
        (
            &|d, _| d["animations"][0]["channels"][0]["target"]["path"] = "weights".into(),
            "moves weights of node 0, which has no morph targets",
        ),
        (
            &|d, _| d["animations"][0]["channels"][0]["target"]["path"] = "rotation".into(),
            "key values are not of the type",
        ),
        (
            &|d, _| d["animations"][0]["samplers"][0]["interpolation"] = "CUBICSPLINE".into(),
            "has 9 numbers for 3 keys, 9 values of 3 are needed",
        ),
        (&|d, _| d["accessors"][2]["componentType"] = 5125.into(), "key times are not 32-bit floats"),
        (&|d, _| d["accessors"][3]["count"] = 300.into(), "reaches beyond the end of its buffer"),
        (&|_, b| b[64..68].copy_from_slice(&2_f32.to_le_bytes()), "key times do not ascend"),
        (&|_, b| b[72..76].copy_from_slice(&f32::NAN.to_le_bytes()), "a key value is not finite"),
    ] {
        let message = with(change);
        assert!(message.contains(&format!("{place}{says}")), "{says}: {message}");
    }
    let message = with(&|_, b| b[68..72].copy_from_slice(&1e9_f32.to_le_bytes()));
    assert!(message.contains("its animations last 1000000000 s, there may be"), "{message}");
    let rotation = animated(json!([{ "mesh": 0 }]), channel(0, "rotation"), sampler("LINEAR"), &[0.0; 12], "VEC4");
    let message = load_dynamic(&rotation).expect_err("no rotation").to_string();
    assert!(message.ends_with("has a rotation of no length; export it again"), "{message}");
    let (mut document, bytes) = good();
    document["animations"] = json!([]);
    let message = load_dynamic(&(document, bytes)).expect_err("nothing moves").to_string();
    assert!(message.contains("nothing in it moves"), "{message}");
    let mut file = with_target(good());
    file.0["accessors"][4]["count"] = 3.into();
    let message = load_dynamic(&file).expect_err("a short target").to_string();
    assert!(message.contains("mesh 0, primitive 0, target 0: not three 32-bit floats for each vertex"), "{message}");
    let mut file = good();
    file.0["nodes"][0]["skin"] = 0.into();
    file.0["skins"] = json!([{ "joints": [0] }]);
    let message = load_dynamic(&file).expect_err("a skin").to_string();
    assert!(message.contains("node 0 has a skin, which stands still here; bake it to morph targets"), "{message}");
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

    /// The same of files with animations and morph targets.
    #[test]
    fn damaged_animations_never_panic(changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4)) {
        let (document, binary) = with_target(animated(json!([{ "mesh": 0 }]), channel(0, "weights"), sampler("LINEAR"), &[0.0, 1.0, 0.5], "SCALAR"));
        let mut bytes = glb(&document, &binary);
        for (at, byte) in changes {
            let at = at.index(bytes.len());
            bytes[at] = byte;
        }
        let folder = Folder::new();
        let path = folder.bytes("mesh.glb", &bytes);
        let _ = load(&path);
        let _ = scene::load_dynamic(&path, &LoadOptions::default());
    }
}
