//! Writes `include/hedgerow.h`: into OUT_DIR, where the tests take it from, and beside the libraries, where
//! `make install-c` does.

use std::path::{Path, PathBuf};
use std::{env, fs};

/// The files with functions and types for C, in the order of the header.
const ROOMS: [&str; 6] = ["status", "requirements", "context", "accel", "copy", "trace"];

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=cbindgen.toml");
    println!("cargo:rerun-if-changed=src");
    let config = cbindgen::Config::from_file("cbindgen.toml").expect("cbindgen.toml can be read");
    let mut builder = cbindgen::Builder::new().with_config(config);
    for room in ROOMS {
        builder = builder.with_src(Path::new("src").join(room).with_extension("rs"));
    }
    let header = builder.generate().expect("the sources can be parsed");

    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets OUT_DIR"));
    // OUT_DIR is PROFILE/build/PACKAGE/out.
    let profile = out.ancestors().nth(3).expect("OUT_DIR lies in a target folder");
    for folder in [&out, profile] {
        let folder = folder.join("include");
        fs::create_dir_all(&folder).expect("the target folder can be written");
        header.write_to_file(folder.join("hedgerow.h"));
    }
}
