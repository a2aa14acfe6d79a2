//! Same input, same bytes: on every run, with every subgroup size that the driver can be asked for, and nothing outside the
//! memory that the size query told.

use crate::common::{corpus, device};
use crate::conditional::{Needs, needs};
use hedgerow::ash::vk;
use hedgerow::bvh::builder::{BuildOptions, Builder, Input, Schedule};
use std::process::Command;

crate::conditional::tests! {
    twenty_builds_give_the_same_bytes_and_touch_nothing_else: needs::nothing(),
    subgroups_of_4_8_and_16_give_the_same_bytes: needs_widths(),
}

/// Twenty builds into the same memory, with a guard behind structure and scratch.
fn twenty_builds_give_the_same_bytes_and_touch_nothing_else() {
    let device = device();
    const GUARD: [u8; 256] = [0xA5; 256];
    for (name, positions, triangles) in [
        corpus::random("20,000 random", 20_000, [0.0; 3], [1.0; 3]),
        corpus::random("1 random", 1, [0.0; 3], [1.0; 3]),
        corpus::random("in a plane", 3_001, [0.0; 3], [1.0, 0.0, 1.0]),
    ] {
        for schedule in [Schedule::Chain, Schedule::PERSISTENT] {
            let options = BuildOptions { schedule: Some(schedule), ..BuildOptions::DEFAULT };
            let lbvh = Builder::new(device, &options, triangles.len() as u32).unwrap();
            let sizes = lbvh.sizes();
            let vertices = device.upload("positions", &positions).unwrap();
            let indices = device.upload("indices", &triangles).unwrap();
            let input =
                Input::mesh(vertices.address(), positions.len() as u32, indices.address(), triangles.len() as u32);
            let guarded = |bytes: u64| [vec![0u8; bytes as usize], GUARD.to_vec()].concat();
            let structure = device.upload("structure", &guarded(sizes.structure)).unwrap();
            let scratch = device.upload("scratch", &guarded(sizes.scratch)).unwrap();
            let mut first: Option<Vec<u8>> = None;
            for run in 0..20 {
                device.run(None, |r| lbvh.record(r, &input, structure.region(), scratch.region())).unwrap();
                let bytes = structure.read::<u8>(sizes.structure as usize);
                let first = first.get_or_insert_with(|| bytes.clone());
                assert!(bytes == *first, "{name} {schedule}: run {run} gave other bytes");
            }
            for (what, buffer, bytes) in
                [("structure", &structure, sizes.structure), ("scratch", &scratch, sizes.scratch)]
            {
                let behind = buffer.read_at::<u8>(bytes, GUARD.len());
                assert_eq!(behind, GUARD, "{name} {schedule}: wrote behind the {what}");
            }
        }
    }
}

/// A lavapipe that takes vectors of other widths: Mesa 26's hangs or crashes with others than 256.
fn needs_widths() -> Needs {
    let driver = &device().found().driver;
    let fits = device().limits.driver == vk::DriverId::MESA_LLVMPIPE && driver.starts_with("Mesa 25");
    (!fits).then(|| format!("{driver} is not Mesa 25's lavapipe, whose subgroups take other sizes"))
}

/// lavapipe takes the width of its vectors, and so its subgroups, from the environment when a process starts.
fn subgroups_of_4_8_and_16_give_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let size_of = |json: &[u8]| {
        let devices: serde_json::Value = serde_json::from_slice(json).unwrap();
        let picked = devices.as_array().and_then(|d| d.iter().find(|d| d["picked"] == true)).cloned().unwrap();
        picked["subgroup_size"].as_u64().unwrap()
    };
    let run = |width: &str, arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_hedgerow"));
        let out = command.env("LP_NATIVE_VECTOR_WIDTH", width).arg("--quiet").args(arguments).output().unwrap();
        assert!(out.status.success(), "{width}: {}", String::from_utf8_lossy(&out.stderr));
        out.stdout
    };
    for builder in ["lbvh:width=8q", "lbvh:codes=emc64var:schedule=persistent"] {
        let mut trees = Vec::new();
        for (width, subgroup) in [("128", 4), ("256", 8), ("512", 16)] {
            assert_eq!(size_of(&run(width, &["devices", "--json"])), subgroup);
            let tree = folder.path().join(width);
            run(width, &["build", "gen:stadium:4", "-b", builder, "-o", tree.to_str().unwrap()]);
            trees.push(std::fs::read(tree).unwrap());
        }
        assert!(trees[0].len() > 100_000 && trees.iter().all(|t| *t == trees[0]), "{builder}: other bytes");
    }
}
