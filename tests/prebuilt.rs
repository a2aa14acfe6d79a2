//! `glsl/prebuilt/` holds the SPIR-V of the sources: what a build without the feature `compile-shaders` links.
//!
//! `make prebuilt` runs this test with `HEDGEROW_UPDATE_PREBUILT=1`, which writes instead of comparing.
#![cfg(feature = "compile-shaders")]

use hedgerow::gpu::shaders;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

/// File name to SPIR-V, of what this build compiled.
fn compiled() -> BTreeMap<String, Vec<u8>> {
    shaders::ALL
        .iter()
        .chain(shaders::OF_RAYS)
        .map(|s| (format!("{}.spv", s.name.replace('/', ".")), s.spirv.to_vec()))
        .collect()
}

/// File name to SPIR-V, of what is committed.
fn committed(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let Ok(entries) = fs::read_dir(folder) else { return BTreeMap::new() };
    let read = |entry: fs::DirEntry| {
        (entry.file_name().into_string().expect("ASCII"), fs::read(entry.path()).expect("a file that can be read"))
    };
    entries.map(|entry| read(entry.expect("glsl/prebuilt/ can be listed"))).collect()
}

#[test]
fn prebuilt_spirv_is_that_of_the_sources() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl/prebuilt");
    let (compiled, before) = (compiled(), committed(&folder));
    if std::env::var_os("HEDGEROW_UPDATE_PREBUILT").is_some() {
        fs::create_dir_all(&folder).expect("glsl/prebuilt/ can be made");
        for name in before.keys().filter(|name| !compiled.contains_key(*name)) {
            fs::remove_file(folder.join(name)).expect("the old file can be removed");
        }
        for (name, spirv) in &compiled {
            if before.get(name) != Some(spirv) {
                fs::write(folder.join(name), spirv).expect("glsl/prebuilt/ can be written");
            }
        }
    }
    let committed = committed(&folder);
    let names = compiled.keys().chain(committed.keys().filter(|name| !compiled.contains_key(*name)));
    let stale: Vec<_> = names.filter(|name| compiled.get(*name) != committed.get(*name)).collect();
    assert!(
        stale.is_empty(),
        "glsl/prebuilt/ is not what glsl/ compiles to: {stale:?}; run `make prebuilt` and commit what it writes (the \
         bytes are those of the shaderc that Cargo.lock names: another copy on this machine may give others)"
    );
}
