//! GLSL to SPIR-V, by shaderc: optimised, with `#include`, and with accesses to memory as `memory_model` says.

use crate::table::{file_by_table, out_dir};
use crate::{by_table, kept, push_constants};
use std::fs;
use std::path::{Path, PathBuf};

/// What else SPIR-V follows from than its sources.
const THIS: &str = concat!(
    include_str!("by_table.rs"),
    include_str!("compile.rs"),
    include_str!("push_constants.rs"),
    include_str!("reflection.rs"),
    include_str!("memory_model.rs")
);

/// Compiles shaders whose includes are named from one of `roots`, so that a line such as `#include "gpu/pass.glsl"` means the same
/// everywhere.
pub struct Compiler<'a> {
    pub roots: &'a [&'a str],
}

impl Compiler<'_> {
    /// Compiles `source` into OUT_DIR, if any of its text has changed. Beside the optimised shader lie what it takes of its push
    /// constants, of one that one workgroup runs the same by a table, and in the folder `named` one with its names.
    pub fn make(&self, source: &Path, file: &str) {
        let out = out_dir();
        let named = out.join("named");
        fs::create_dir_all(&named).expect("OUT_DIR can be written");
        let path = out.join(file);
        // What both were made of lies beside them.
        let stamp = out.join(format!("{file}.source"));
        let made_of = self.made_of(source);
        if path.exists() && named.join(file).exists() && fs::read_to_string(&stamp).is_ok_and(|was| was == made_of) {
            return;
        }
        // What fails half-way is made again.
        let _ = fs::remove_file(&stamp);
        let takes_file = format!("{file}.takes");
        let files: Vec<String> = [file.to_owned(), format!("named/{file}"), takes_file.clone()]
            .into_iter()
            .chain(file_by_table(file))
            .collect();
        if kept::take(file, &made_of, &files, &out) {
            fs::write(stamp, made_of).expect("OUT_DIR can be written");
            return;
        }
        fs::write(named.join(file), self.compile(source, shaderc::OptimizationLevel::Zero))
            .expect("OUT_DIR can be written");
        let whole = self.compile(source, shaderc::OptimizationLevel::Performance);
        // What traces by the driver's pipelines has no passes, and the host pushes the block as it is declared.
        let is_pass = source.extension().is_some_and(|e| e == "comp");
        let (spirv, takes) =
            if is_pass { push_constants::only_what_is_read(file, &whole) } else { (whole, Vec::new()) };
        let takes: String = takes.iter().map(|(offset, bytes)| format!("{offset} {bytes}\n")).collect();
        fs::write(out.join(takes_file), takes).expect("OUT_DIR can be written");
        if let Some(file) = file_by_table(file) {
            fs::write(out.join(&file), by_table::by_table(&file, &spirv)).expect("OUT_DIR can be written");
        }
        fs::write(&path, spirv).expect("OUT_DIR can be written");
        kept::keep(file, &made_of, &files, &out);
        fs::write(stamp, made_of).expect("OUT_DIR can be written");
    }

    /// Compiles a shader that is not in the table into the file `name` of OUT_DIR, if its source is there: packages have no examples
    /// and tests.
    #[allow(dead_code, reason = "the laboratory's shaders are all in its table")]
    pub fn other(&self, source: &str, name: &str) {
        println!("cargo:rerun-if-changed={source}");
        let source = Path::new(source);
        if source.exists() {
            let spirv = self.compile(source, shaderc::OptimizationLevel::Performance);
            fs::write(out_dir().join(name), spirv).expect("OUT_DIR can be written");
        }
    }

    /// The text of a file that is included, and its path.
    fn included(&self, name: &str) -> Option<(PathBuf, String)> {
        let paths = self.roots.iter().map(|root| Path::new(root).join(name));
        paths.filter_map(|path| fs::read_to_string(&path).ok().map(|text| (path, text))).next()
    }

    /// All text that a shader's SPIR-V follows from: its own, that of every file it includes, and this program's.
    fn made_of(&self, source: &Path) -> String {
        let mut text = THIS.to_owned();
        let mut names = Vec::new();
        let mut contents = vec![fs::read_to_string(source).unwrap_or_default()];
        while let Some(content) = contents.pop() {
            for line in content.lines() {
                let name = line.trim().strip_prefix("#include \"").and_then(|rest| rest.strip_suffix('"'));
                if let Some(name) = name.filter(|name| !names.iter().any(|known| known == name)) {
                    names.push(name.to_owned());
                    contents.extend(self.included(name).map(|(_, text)| text));
                }
            }
            text.push_str(&content);
        }
        text
    }

    fn compile(&self, source: &Path, level: shaderc::OptimizationLevel) -> Vec<u8> {
        let text = fs::read_to_string(source).expect("the shader was just listed");
        let compiler = shaderc::Compiler::new().expect("shaderc starts");
        let mut options = shaderc::CompileOptions::new().expect("shaderc gives options");
        options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
        options.set_optimization_level(level);
        options.set_warnings_as_errors();
        options.set_include_callback(|requested, _kind, _from, _depth| {
            let (path, content) = self
                .included(requested)
                .ok_or_else(|| format!("{requested} is in none of {}; check its name", self.roots.join(", ")))?;
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
            Ok(binary) => crate::memory_model::applied(binary.as_binary_u8()),
            Err(error) => {
                // shaderc already writes `glsl/room/pass.comp:LINE: error: …`, which editors follow as they follow rustc.
                eprintln!("{error}");
                panic!("a shader does not compile, see above");
            }
        }
    }
}
