//! `examples/trace.c` compiles without a warning, links both libraries, and traces the hits that it knows.
//!
//! Needs a C compiler and `<vulkan/vulkan.h>` (`scripts/setup.sh` installs both); says so and does nothing without them.

use std::ffi::OsString;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const WARNINGS: [&str; 4] = ["-Wall", "-Wextra", "-pedantic", "-Werror"];
const HITS: &str = "\
ray 0: triangle 2 at 3.000, u 0.500, v 0.250
ray 1: triangle 0 at 5.000, u 0.625, v 0.250
ray 2: triangle 1 at 5.000, u 0.250, v 0.500
ray 3: nothing
";

/// The compiler that `variable` names, or the system's, with the folders of the header and of Vulkan where it has its own.
fn compiler(variable: &str, usual: &str) -> Command {
    let named = std::env::var(variable).unwrap_or_else(|_| usual.into());
    let mut words = named.split_whitespace();
    let mut command = Command::new(words.next().unwrap_or(usual));
    command.args(words).arg("-I").arg(Path::new(env!("OUT_DIR")).join("include"));
    let sdk = std::env::var_os("VULKAN_SDK").map(PathBuf::from);
    for vulkan in sdk.into_iter().chain([PathBuf::from("/opt/homebrew")]).filter(|folder| folder.exists()) {
        command.arg("-I").arg(vulkan.join("include")).arg("-L").arg(vulkan.join("lib"));
    }
    command
}

/// Lets `compiler` look at `text` alone.
fn accepts(mut compiler: Command, text: &str) -> std::io::Result<Output> {
    let piped = compiler.arg("-").stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = piped.spawn()?;
    // A compiler that does not read to the end has said why.
    let _ = child.stdin.take().expect("piped").write_all(text.as_bytes());
    child.wait_with_output()
}

/// Whether C can be compiled here, with Vulkan's header: what `scripts/setup.sh` asks, too.
fn can_compile() -> bool {
    let mut preprocessor = compiler("CC", "cc");
    preprocessor.args(["-E", "-x", "c"]);
    let can = accepts(preprocessor, "#include <vulkan/vulkan.h>\n").is_ok_and(|output| output.status.success());
    if !can {
        eprintln!("SKIPPED: no C compiler, or no <vulkan/vulkan.h>; scripts/setup.sh installs both");
    }
    can
}

/// Where cargo has put the libraries: beside this test, or above.
fn library(name: &str) -> PathBuf {
    let test = std::env::current_exe().expect("the test knows where it is");
    let found = test.ancestors().skip(1).take(2).map(|folder| folder.join(name)).find(|path| path.exists());
    found.unwrap_or_else(|| panic!("{name} is neither beside {} nor above", test.display()))
}

#[track_caller]
fn assert_succeeds(what: &str, output: &Output) {
    assert!(
        output.status.success(),
        "{what}: {}\n{}{}",
        output.status,
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
}

/// Compiles the example, links it with `libraries`, runs it and compares what it says.
#[track_caller]
fn assert_traces(libraries: &[OsString]) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let program = folder.path().join("trace");
    let mut build = compiler("CC", "cc");
    build.arg("-std=c99").args(WARNINGS).arg("examples/trace.c").arg("-o").arg(&program);
    build.args(libraries).args(["-lvulkan", "-lm", "-lpthread"]);
    assert_succeeds("compiling examples/trace.c", &build.output().expect("the compiler was there before"));

    let run = Command::new(&program)
        // Where the layers are installed, what they say is among the output, and wrong.
        .env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation")
        .env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT")
        .output()
        .expect("the program was just made");
    assert_succeeds("examples/trace.c", &run);
    assert_eq!(String::from_utf8_lossy(&run.stdout), HITS, "{}", String::from_utf8_lossy(&run.stderr));
}

#[test]
fn a_program_in_c_traces_by_the_static_library() {
    if can_compile() {
        let mut libraries = vec![library("libhedgerow_capi.a").into_os_string()];
        if cfg!(target_os = "linux") {
            libraries.push("-ldl".into());
        }
        assert_traces(&libraries);
    }
}

#[test]
fn a_program_in_c_traces_by_the_shared_library() {
    if can_compile() {
        let shared = library(&format!("libhedgerow_capi{}", std::env::consts::DLL_SUFFIX));
        let mut search = OsString::from("-Wl,-rpath,");
        search.push(shared.parent().expect("a file lies in a folder"));
        assert_traces(&[shared.into_os_string(), search]);
    }
}

#[test]
fn the_header_is_plain_c_and_cpp() {
    if can_compile() {
        for (variable, usual, language) in [("CC", "cc", "-std=c99"), ("CXX", "c++", "-std=c++11")] {
            let mut look = compiler(variable, usual);
            look.arg(language).args(WARNINGS).arg("-fsyntax-only").arg("-x");
            look.arg(if usual == "cc" { "c" } else { "c++" });
            let output = accepts(look, "#include <hedgerow.h>\n").expect("a compiler");
            assert_succeeds(usual, &output);
        }
    }
}
