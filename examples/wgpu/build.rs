//! Makes SPIR-V of the engine's own shader, with the library's `glsl/` as the include folder.

use std::path::Path;
use std::{env, fs};

const SHADER: &str = "src/trace.comp";
const INCLUDES: &str = "../../glsl";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    println!("cargo:rerun-if-changed={SHADER}");
    println!("cargo:rerun-if-changed={INCLUDES}");
    let mut options = shaderc::CompileOptions::new()?;
    options.set_target_env(shaderc::TargetEnv::Vulkan, shaderc::EnvVersion::Vulkan1_2 as u32);
    options.set_optimization_level(shaderc::OptimizationLevel::Performance);
    options.set_include_callback(|name, _, _, _| {
        let resolved_name = format!("{INCLUDES}/{name}");
        let content = fs::read_to_string(&resolved_name).map_err(|error| format!("{resolved_name}: {error}"))?;
        Ok(shaderc::ResolvedInclude { resolved_name, content })
    });
    let text = fs::read_to_string(SHADER)?;
    let kind = shaderc::ShaderKind::Compute;
    let spirv = shaderc::Compiler::new()?.compile_into_spirv(&text, kind, SHADER, "main", Some(&options))?;
    fs::write(Path::new(&env::var("OUT_DIR")?).join("trace.spv"), spirv.as_binary_u8())?;
    Ok(())
}
