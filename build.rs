//! Compiles every shader below `glsl/` to SPIR-V and writes `shaders.rs`, the table that `src/gpu/shaders.rs` includes.
//!
//! With the feature `compile-shaders` the sources are compiled by shaderc; without it, `glsl/prebuilt/` is taken, so that
//! whoever links the library needs neither cmake nor a shader compiler.

#[cfg(feature = "compile-shaders")]
#[path = "build/shared_memory.rs"]
mod shared_memory;

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    println!("cargo:rerun-if-changed=build");
    println!("cargo:rerun-if-changed=glsl");
    let out = PathBuf::from(env::var("OUT_DIR").expect("cargo sets OUT_DIR"));
    let mut sources = Vec::new();
    collect(Path::new("glsl"), &mut sources);
    sources.sort();

    let mut table = String::new();
    let (mut names, mut of_rays) = (Vec::new(), Vec::new());
    for source in &sources {
        let stem = source.strip_prefix("glsl").expect("found below glsl").with_extension("");
        let name = stem.to_str().expect("shader names are ASCII").replace('\\', "/");
        let constant = name.replace('/', "_").to_uppercase();
        let spirv = spirv_of(source, &name, &out);
        writeln!(
            table,
            "/// `{}`\npub static {constant}: Shader = Shader {{ name: {name:?}, spirv: include_bytes!({spirv:?}) }};",
            source.display()
        )
        .expect("writing to a string");
        let is_compute = source.extension().is_some_and(|e| e == "comp");
        if is_compute { &mut names } else { &mut of_rays }.push(constant);
    }
    writeln!(
        table,
        "/// Every compute shader, by name.\npub static ALL: &[&Shader] = &[&{}];\n\
         /// The shaders of ray-tracing pipelines, by name.\npub static OF_RAYS: &[&Shader] = &[&{}];",
        names.join(", &"),
        of_rays.join(", &")
    )
    .expect("writing to a string");
    fs::write(out.join("shaders.rs"), table).expect("OUT_DIR can be written");
    compile_others(&out);
}

/// The shaders of the example engine and of the tests, which take the library's header as anybody's would. They need the
/// compiler, and are not there in a package without its examples and tests.
#[cfg(feature = "compile-shaders")]
fn compile_others(out: &Path) {
    for (source, define, name) in [
        ("examples/engine.comp", None, "example_engine.spv"),
        ("tests/shaders/probe.comp", None, "probe_of_the_driver.spv"),
        ("tests/shaders/kd_probe.comp", None, "kd_probe.spv"),
    ] {
        println!("cargo:rerun-if-changed={source}");
        let source = Path::new(source);
        if source.exists() {
            let spirv = compile(source, define, shaderc::OptimizationLevel::Performance);
            fs::write(out.join(name), spirv).expect("OUT_DIR can be written");
        }
    }
}

#[cfg(not(feature = "compile-shaders"))]
fn compile_others(_out: &Path) {}

/// How the names of shaders end, by their stage.
const STAGES: [&str; 4] = ["comp", "rgen", "rchit", "rmiss"];

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

/// The file of the prebuilt SPIR-V of a shader: one flat folder, `/` written as `.`.
#[cfg_attr(feature = "compile-shaders", allow(dead_code, reason = "only the build without a compiler reads it"))]
fn prebuilt(name: &str) -> PathBuf {
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR").expect("cargo sets CARGO_MANIFEST_DIR"));
    root.join("glsl/prebuilt").join(format!("{}.spv", name.replace('/', ".")))
}

#[cfg(not(feature = "compile-shaders"))]
fn spirv_of(_source: &Path, name: &str, out: &Path) -> PathBuf {
    // A copy: the target folder may outlive the sources, or meet them again in another place.
    let (from, to) = (prebuilt(name), out.join(format!("{}.spv", name.replace('/', "."))));
    fs::copy(&from, &to).unwrap_or_else(|error| {
        panic!("{}: {error}: build with the feature `compile-shaders`, or run `make prebuilt`", from.display())
    });
    to
}

#[cfg(feature = "compile-shaders")]
fn spirv_of(source: &Path, name: &str, out: &Path) -> PathBuf {
    let file = format!("{}.spv", name.replace('/', "."));
    // Beside the optimised shader one with its names, for the test that compares layouts (src/layouts.rs).
    let named = out.join("named");
    fs::create_dir_all(&named).expect("OUT_DIR can be written");
    println!("cargo:rustc-env=HEDGEROW_NAMED_SPIRV={}", named.display());
    let path = out.join(&file);
    // What both were made of lies beside them: a shader none of whose text has changed is not compiled again.
    let stamp = out.join(format!("{file}.source"));
    let made_of = made_of(source);
    if path.exists() && named.join(&file).exists() && fs::read_to_string(&stamp).is_ok_and(|was| was == made_of) {
        return path;
    }
    fs::write(named.join(&file), compile(source, None, shaderc::OptimizationLevel::Zero))
        .expect("OUT_DIR can be written");
    fs::write(&path, compile(source, None, shaderc::OptimizationLevel::Performance)).expect("OUT_DIR can be written");
    fs::write(stamp, made_of).expect("OUT_DIR can be written");
    path
}

/// All text that a shader's SPIR-V follows from: its own, that of every file it includes, and this program's.
#[cfg(feature = "compile-shaders")]
fn made_of(source: &Path) -> String {
    let mut files = vec![source.to_path_buf()];
    let mut text = concat!(include_str!("build.rs"), include_str!("build/shared_memory.rs")).to_owned();
    let mut next = 0;
    while next < files.len() {
        let content = fs::read_to_string(&files[next]).unwrap_or_default();
        let included = content.lines().filter_map(|line| line.trim().strip_prefix("#include \"")?.strip_suffix('"'));
        for path in included.map(|name| Path::new("glsl").join(name)) {
            if !files.contains(&path) {
                files.push(path);
            }
        }
        text.push_str(&content);
        next += 1;
    }
    text
}

#[cfg(feature = "compile-shaders")]
fn compile(source: &Path, define: Option<&str>, level: shaderc::OptimizationLevel) -> Vec<u8> {
    let text = fs::read_to_string(source).expect("the shader was just listed");
    let compiler = shaderc::Compiler::new().expect("shaderc starts");
    let mut options = shaderc::CompileOptions::new().expect("shaderc gives options");
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_optimization_level(level);
    options.set_warnings_as_errors();
    if let Some(define) = define {
        options.add_macro_definition(define, None);
    }
    // Every include is named from glsl/, so that a line such as `#include "gpu/pass.glsl"` means the same everywhere.
    options.set_include_callback(|requested, _kind, _from, _depth| {
        let path = Path::new("glsl").join(requested);
        let content = fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
        Ok(shaderc::ResolvedInclude { resolved_name: path.display().to_string(), content })
    });
    let file = source.display().to_string();
    let kind = match source.extension().and_then(|e| e.to_str()) {
        Some("rgen") => shaderc::ShaderKind::RayGeneration,
        Some("rchit") => shaderc::ShaderKind::ClosestHit,
        Some("rmiss") => shaderc::ShaderKind::Miss,
        _ => shaderc::ShaderKind::Compute,
    };
    match compiler.compile_into_spirv(&text, kind, &file, "main", Some(&options)) {
        Ok(binary) => shared_memory::handed_over_at_barriers(binary.as_binary_u8()),
        Err(error) => {
            // shaderc already writes `glsl/room/pass.comp:LINE: error: …`, which editors follow as they follow rustc.
            eprintln!("{error}");
            panic!("a shader does not compile, see above");
        }
    }
}
