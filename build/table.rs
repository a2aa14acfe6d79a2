//! The table of a crate's shaders, `shaders.rs`: a static for each, named after its path.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::{env, fs};

/// How the names of shaders end, by their stage.
const STAGES: [&str; 4] = ["comp", "rgen", "rchit", "rmiss"];

/// Cargo's folder for what is built.
pub fn out_dir() -> PathBuf {
    PathBuf::from(env::var("OUT_DIR").expect("cargo sets OUT_DIR"))
}

/// The file of a shader's SPIR-V: one flat folder, `/` written as `.`.
pub fn file_of(name: &str) -> String {
    format!("{}.spv", name.replace('/', "."))
}

/// The file of the same shader with its arguments in a table, of one that one workgroup runs: those are named `alone`.
pub fn file_by_table(file: &str) -> Option<String> {
    file.strip_suffix(".alone.spv").map(|family| format!("{family}.alone_by_table.spv"))
}

/// The name of a shader's static.
pub fn constant_of(name: &str) -> String {
    name.replace('/', "_").to_uppercase()
}

/// Writes the table of all shaders below `glsl/`. `make` puts the SPIR-V of a source into OUT_DIR, in the file that it is given;
/// several threads call it. Returns the names of all shaders.
pub fn write(make: impl Fn(&Path, &str) + Sync) -> Vec<String> {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=glsl");
    let mut sources = Vec::new();
    collect(Path::new("glsl"), &mut sources);
    sources.sort();
    let shaders: Vec<(PathBuf, String)> =
        sources.into_iter().map(|source| (source.clone(), name_of(&source))).collect();
    forget_others(&shaders);
    side_by_side(&shaders, |(source, name)| make(source, &file_of(name)));

    let mut table = String::new();
    let mut names = Vec::new();
    for (source, name) in &shaders {
        let (constant, file, spirv) = (constant_of(name), source.display(), out_dir().join(file_of(name)));
        let by_table = file_by_table(&file_of(name)).map(|file| format!("include_bytes!({:?})", out_dir().join(file)));
        let by_table = by_table.map_or("None".to_owned(), |bytes| format!("Some({bytes})"));
        writeln!(
            table,
            "/// `{file}`\npub static {constant}: Shader =\n    Shader {{ name: {name:?}, spirv: include_bytes!({spirv:?}), by_table: \
             {by_table}, takes: takes::{constant} }};"
        )
        .expect("writing to a string");
        names.push(constant);
    }
    let names = names.join(", &");
    writeln!(table, "/// Every shader, by name.\npub static ALL: &[&Shader] = &[&{names}];")
        .expect("writing to a string");
    fs::write(out_dir().join("shaders.rs"), table).expect("OUT_DIR can be written");
    shaders.into_iter().map(|(_, name)| name).collect()
}

/// Path below `glsl/`, without extension.
fn name_of(source: &Path) -> String {
    let stem = source.strip_prefix("glsl").expect("found below glsl").with_extension("");
    stem.to_str().expect("shader names are ASCII").replace('\\', "/")
}

/// Removes the SPIR-V that a former build left and this one does not have.
fn forget_others(shaders: &[(PathBuf, String)]) {
    let own = shaders.iter().map(|(_, name)| file_of(name));
    let files: Vec<String> = own.flat_map(|file| [file_by_table(&file), Some(file)]).flatten().collect();
    for folder in [out_dir(), out_dir().join("named")] {
        let Ok(entries) = fs::read_dir(folder) else { continue };
        let paths = entries.map(|entry| entry.expect("OUT_DIR can be listed").path());
        let is_other = |path: &PathBuf| {
            path.extension().is_some_and(|e| e == "spv")
                && !path.file_name().is_some_and(|name| files.iter().any(|file| name == file.as_str()))
        };
        paths.filter(is_other).for_each(|path| fs::remove_file(path).expect("OUT_DIR can be written"));
    }
}

/// Each of `items` once, by as many threads as cargo gives.
fn side_by_side<T: Sync>(items: &[T], of: impl Fn(&T) + Sync) {
    let threads = env::var("NUM_JOBS").ok().and_then(|jobs| jobs.parse().ok()).unwrap_or(1);
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    of(item)
                }
            });
        }
    });
}

fn collect(folder: &Path, sources: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("glsl/ is part of the package") {
        let path = entry.expect("glsl/ can be listed").path();
        if path.is_dir() {
            collect(&path, sources);
        } else if path.extension().is_some_and(|e| STAGES.iter().any(|stage| e == *stage)) {
            sources.push(path);
        }
    }
}
