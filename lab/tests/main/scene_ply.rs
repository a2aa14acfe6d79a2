//! PLY: encodings, number types, and what a broken file is told.

use crate::files::{Folder, load, pack};

const HEAD: &str = "ply\nformat ascii 1.0\ncomment made by hand\nelement vertex 4\nproperty float x\nproperty float y\n\
                    property float z\nproperty uchar red\nelement face 2\nproperty list uchar int vertex_indices\nend_header\n";
const VERTICES: &str = "0 0 0 255\n1 0 0 255\n1 1 0 0\n0 1 0 7\n";

fn refused(content: &[u8]) -> String {
    let folder = Folder::new();
    let path = folder.bytes("mesh.ply", content);
    let message = load(&path).expect_err("a broken file").to_string();
    assert!(!message.contains('\n'), "one line: {message}");
    message.strip_prefix(&path).unwrap_or_else(|| panic!("{message} does not begin with the file")).to_owned()
}

/// The square and a polygon, in binary: doubles, an element and properties that mean nothing to us, `vertex_index`.
fn binary(order: &str) -> Vec<u8> {
    let mut bytes = format!(
        "ply\nformat binary_{order}_endian 1.0\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\n\
         property short quality\nelement edge 1\nproperty int vertex1\nproperty int vertex2\nelement face 2\n\
         property uchar flags\nproperty list uint ushort vertex_index\nend_header\n"
    )
    .into_bytes();
    let little = order == "little";
    let mut put = |big: &[u8]| bytes.extend(if little { big.iter().rev().copied().collect() } else { big.to_vec() });
    for [x, y] in [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [-0.5, 0.5_f64]] {
        for c in [x, y, 0.25] {
            put(&c.to_be_bytes());
        }
        put(&7_i16.to_be_bytes());
    }
    put(&0_i32.to_be_bytes());
    put(&1_i32.to_be_bytes());
    for face in [vec![0_u16, 1, 2], vec![4, 0, 1, 2, 3]] {
        put(&[9]);
        put(&(face.len() as u32).to_be_bytes());
        face.iter().for_each(|v| put(&v.to_be_bytes()));
    }
    bytes
}

#[test]
fn ascii_and_binary_of_both_orders_are_read() {
    let folder = Folder::new();
    let ascii = load(&folder.file("a.ply", &format!("{HEAD}{VERTICES}3 0 1 2\n4 0 1 2 3\n"))).expect("ascii");
    assert_eq!(ascii.mesh.triangles, [[0, 1, 2], [0, 1, 2], [0, 2, 3]]);
    assert_eq!(ascii.mesh.positions[2], [1.0, 1.0, 0.0]);
    for order in ["little", "big"] {
        let scene = load(&folder.bytes("b.ply", &binary(order))).expect(order);
        assert_eq!(scene.mesh.triangles, [[0, 1, 2], [4, 0, 1], [4, 1, 2], [4, 2, 3]]);
        assert_eq!(scene.mesh.positions[4], [-0.5, 0.5, 0.25]);
    }
    let packed = load(&folder.bytes("c.ply.zst", &pack(&binary("little")))).expect("packed");
    assert_eq!((packed.name.as_str(), packed.mesh.triangles.len()), ("c", 4));
}

#[test]
fn faces_with_bad_indices_or_too_few_vertices_are_named() {
    let ascii = |faces: &str| refused(format!("{HEAD}{VERTICES}{faces}").as_bytes());
    assert_eq!(ascii("3 0 1 2\n3 0 1 4\n"), ": triangle 1 names vertex 4 (both from 0), there are 4; is it cut off?");
    assert!(ascii("3 0 1 -1\n3 0 1 2\n").starts_with(": triangle 0 names vertex 4294967295"));
    for (face, has) in [("2 0 1", "2"), ("1 0", "1"), ("0", "0")] {
        let message = ascii(&format!("3 0 1 2\n{face}\n"));
        assert!(
            message.starts_with(&format!(": face 1 (from 0) has {has} vertices, a face needs at least 3")),
            "{message}"
        );
    }
}

#[test]
fn vertices_that_are_not_finite_are_named() {
    for number in ["nan", "inf", "1e39"] {
        let vertices = VERTICES.replacen("1 1 0 0", &format!("1 {number} 0 0"), 1);
        let message = refused(format!("{HEAD}{vertices}3 0 1 2\n3 0 1 3\n").as_bytes());
        let named = message.starts_with(": vertex 2 (from 0) is (1, ") || message.starts_with(":14: a vertex: \"1 ");
        assert!(named && message.contains("finite"), "{number}: {message}");
    }
    let mut bytes = binary("little");
    let vertex = bytes.len() - (5 * 26 + 8 + (1 + 4 + 6) + (1 + 4 + 10)) + 26;
    bytes[vertex..vertex + 8].copy_from_slice(&f64::NAN.to_le_bytes());
    assert!(refused(&bytes).starts_with(": vertex 1 (from 0) is (NaN, 0, 0.25)"));
    let message = refused(HEAD.replace("property float y\n", "").replace("vertex 4", "vertex 0").as_bytes());
    assert_eq!(message, ": vertices have no property \"y\"; export it again");
}

#[test]
fn text_that_cannot_be_read_is_told_with_its_line() {
    let message = refused(format!("{HEAD}{}3 0 1 2\n3 0 1 3\n", VERTICES.replace("1 1 0 0", "1 x 0 0")).as_bytes());
    assert!(message.starts_with(":14: a vertex: ") && message.ends_with("repair or export it again"), "{message}");
    let message = refused(HEAD.replace("element face", "elephant face").as_bytes());
    assert!(message.starts_with(":9: the head: "), "{message}");
    assert!(refused(b"solid stl\n").starts_with(":1: the head: "));
}

#[test]
fn a_file_that_is_cut_off_is_told_where() {
    assert!(refused(b"").contains("ends before the head; is it cut off?"));
    assert!(refused(&HEAD.as_bytes()[..60]).contains("is it cut off?"));
    assert!(refused(format!("{HEAD}{VERTICES}3 0 1 2\n").as_bytes()).contains("ends before a face; is it cut off?"));
    let whole = binary("little");
    let message = refused(&whole[..whole.len() - 3]);
    assert_eq!(message, ": ends before face 1 (from 0) of 2; is it cut off?");
    let head = whole.len() - 5 * 26 - 8 - (1 + 4 + 6) - (1 + 4 + 10);
    assert_eq!(refused(&whole[..head + 30]), ": ends before vertex 1 (from 0) of 5; is it cut off?");
}
