//! The header has every function.

use std::fs;
use std::path::Path;

#[test]
fn every_function_for_c_is_in_the_header() {
    let header = fs::read_to_string(Path::new(env!("OUT_DIR")).join("include/hedgerow.h")).expect("build.rs wrote it");
    let mut functions = 0;
    for entry in fs::read_dir("src").expect("tests run in the package's folder") {
        let source = fs::read_to_string(entry.expect("src/ can be listed").path()).expect("a source file");
        for name in source.split("extern \"C\" fn ").skip(1).filter_map(|rest| rest.split('(').next()) {
            assert!(header.contains(&format!("{name}(")), "{name} is missing: does ROOMS in build.rs name its file?");
            functions += 1;
        }
    }
    assert!(functions >= 17, "{functions} functions found in src/");
}
