//! OBJ: what becomes a triangle, and what a broken file is told.

use crate::files::{Folder, load};

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn triangles(text: &str) -> Vec<[[f32; 3]; 3]> {
    let folder = Folder::new();
    let scene = load(&folder.file("mesh.obj", text)).expect(text);
    (0..scene.mesh.triangles.len()).map(|t| scene.mesh.corners(t)).collect()
}

/// The message for a broken file, which is `…/mesh.obj` + `at` + the rest.
fn refused(text: &str) -> String {
    let folder = Folder::new();
    let path = folder.file("mesh.obj", text);
    let message = load(&path).expect_err(text).to_string();
    message.strip_prefix(&path).unwrap_or_else(|| panic!("{message} does not begin with the file")).to_owned()
}

const A: [f32; 3] = [0.0, 0.0, 0.0];
const B: [f32; 3] = [1.0, 0.0, 0.0];
const C: [f32; 3] = [1.0, 1.0, 0.0];
const D: [f32; 3] = [0.0, 1.0, 0.0];

#[test]
fn polygons_are_fanned_from_their_first_vertex_in_the_order_of_the_file() {
    let mixed = format!("{CORNERS}v 0 0.5 0\nf 2 3 4\nf 1 2 3 4\nf 5 1 2 3 4\nf 4 3 2\n");
    let e = [0.0, 0.5, 0.0];
    assert_eq!(triangles(&mixed), [[B, C, D], [A, B, C], [A, C, D], [e, A, B], [e, B, C], [e, C, D], [D, C, B]]);
}

#[test]
fn indices_may_count_backwards_and_name_vertices_that_follow() {
    assert_eq!(triangles(&format!("{CORNERS}f -4 -3 -2\nf 1 2 3\n")), [[A, B, C]; 2]);
    assert_eq!(triangles(&format!("f 1 2 3\n{CORNERS}")), [[A, B, C]]);
    // -1 is the last vertex above the line, not of the file.
    assert_eq!(triangles("v 0 0 0\nv 1 0 0\nv 1 1 0\nf -3 -2 -1\nv 9 9 9\n"), [[A, B, C]]);
}

#[test]
fn objects_groups_and_materials_do_not_change_the_order() {
    let text =
        format!("mtllib none.mtl\n{CORNERS}o b\nf 1 2 3\nusemtl x\nf 2 3 4\no a\ng q\nf 3 4 1\nusemtl y\nf 1 2 4\n");
    assert_eq!(triangles(&text), [[A, B, C], [B, C, D], [C, D, A], [A, B, D]]);
}

#[test]
fn what_is_no_face_makes_no_triangle() {
    let text = format!("{CORNERS}p 1\nl 1 2 3\nl 1 2\nf 1 2 3\ncurv 0 1 1 2 3\n\n#f 2 3 4\n");
    assert_eq!(triangles(&text), [[A, B, C]]);
}

#[test]
fn attributes_comments_and_line_endings_are_read_over() {
    // Normals and coordinates out of range, colours on some vertices, a weight, a joined line, a comment behind a face.
    let text = "v 0 0 0 0.5 0.5 0.5\r\nv 1 0 0\r\nv 2 2 0 2\r\nvt 0 0\r\nf 1/7/9 2//9 \\\r\n 3/1 # last\r\n";
    assert_eq!(triangles(text), [[A, B, C]]);
    let folder = Folder::new();
    let latin_1 = folder.bytes("latin.obj", b"# caf\xe9\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3");
    assert_eq!(load(&latin_1).expect("Latin-1 in a comment").mesh.triangles.len(), 1);
}

#[test]
fn degenerate_duplicate_and_huge_triangles_are_legal() {
    let text = format!("{CORNERS}v 3e38 -3e38 3e38\nf 1 1 1\nf 1 2 2\nf 1 2 3\nf 1 2 3\nf 1 2 5\n");
    assert_eq!(triangles(&text).len(), 5);
}

#[test]
fn an_index_out_of_range_is_told_with_its_line() {
    let message = refused(&format!("{CORNERS}f 1 2 3\nf 1 2 70112\n"));
    assert_eq!(message, ":6: face names vertex 70112, the file has 4; is it cut off?");
    let message = refused(&format!("{CORNERS}f 1 2 0\n"));
    assert_eq!(message, ":5: face names vertex 0, vertices count from 1; add 1 to every index");
    let message = refused(&format!("{CORNERS}\nf 1 2 -5\n"));
    assert_eq!(message, ":6: face names vertex -5, above it are 4; is the head of the file missing?");
}

#[test]
fn a_face_of_fewer_than_three_vertices_is_told_with_its_line() {
    for (face, has) in [("f 1 2", "2"), ("f 1", "1"), ("f", "0")] {
        let message = refused(&format!("{CORNERS}f 1 2 3\n{face}\nf 1 2 3 4\n"));
        assert!(message.starts_with(&format!(":6: face has {has} vertices, a face needs at least 3")), "{message}");
    }
}

#[test]
fn vertices_that_are_not_finite_are_told_with_their_line() {
    for number in ["nan", "inf", "-inf", "1e39", "NaN"] {
        let message = refused(&format!("v 0 0 {number}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
        assert!(message.starts_with(":1: vertex (0, 0, ") && message.contains("finite"), "{message}");
    }
    assert!(refused("v 0 0 0\nv 1 1 1 0\nv 2 2 1\nf 1 2 3\n").starts_with(":2: "));
}

#[test]
fn a_file_that_is_cut_off_is_told_where() {
    assert_eq!(refused("v 0 0 0\nv 1 0"), ":2: vertex has 2 coordinates, it needs 3; is the file cut off?");
    assert!(refused(&format!("{CORNERS}f 1 2 3\nf 1 2/")).starts_with(":6: face has 2 vertices"));
    assert!(refused(&format!("{CORNERS}f 1 2 3/x\n")).starts_with(":5: \"3/x\" is not a vertex of a face"));
    assert!(refused("v 0 0 zero\n").starts_with(":1: \"zero\" is not a number"));
}

#[test]
fn a_file_without_triangles_is_refused() {
    for text in ["", "# nothing\n", CORNERS] {
        assert_eq!(refused(text), ": no triangles; a scene needs at least one");
    }
}
