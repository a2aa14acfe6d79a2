//! `.inst`: placed copies, flattened in the order of the file.
#![cfg(feature = "cli")]

#[path = "common/files.rs"]
mod files;

use files::{Folder, load, pack};

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
