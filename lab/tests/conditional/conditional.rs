//! Tests that need what a machine may lack. One that cannot be run here is listed as ignored, with the reason before its name, and the
//! runner counts it: it does not pass without having asserted anything.
//!
//! A file of such tests has, in place of `#[test]`, one list of all its tests, and stands in the list of main.rs:
//!
//! ```ignore
//! crate::conditional::tests! {
//!     the_bunny_costs_what_an_independent_program_says: needs::scene("bunny"),
//!     other_scenes_cost_the_same: needs::nothing(),
//! }
//! ```

use libtest_mimic::{Arguments, Trial};
use std::path::PathBuf;
use std::process::ExitCode;

/// What a test needs: why it cannot be run here, or nothing.
pub type Needs = Option<String>;

/// The needs there are.
pub mod needs {
    use super::Needs;

    /// Runs anywhere.
    pub fn nothing() -> Needs {
        None
    }

    /// Minutes: `why` says of what.
    pub fn time(why: &str) -> Needs {
        Some(why.to_owned())
    }

    /// A suite that is not run by a tuning in particular: the test takes both, and once is enough.
    pub fn no_tuning() -> Needs {
        let is_asked_for = super::variable("HEDGEROW_TUNING").is_some();
        is_asked_for.then(|| "takes both tunings, and runs where HEDGEROW_TUNING is not set".to_owned())
    }

    /// A folder of scenes that are not in the repository.
    pub fn scenes() -> Needs {
        let missing = "HEDGEROW_SCENES names no folder of scenes";
        super::variable("HEDGEROW_SCENES").is_none().then(|| missing.to_owned())
    }

    /// That folder, and in it a file of this name with any extension.
    pub fn scene(name: &str) -> Needs {
        let files = super::variable("HEDGEROW_SCENES").and_then(|folder| std::fs::read_dir(folder).ok());
        let mut names = files.into_iter().flatten().flatten().map(|file| file.file_name());
        let is_there = names.any(|file| file.to_string_lossy().split('.').next() == Some(name));
        scenes().or_else(|| (!is_there).then(|| format!("{name} is not in the folder of HEDGEROW_SCENES")))
    }

    /// A browser that opens the pages of the report.
    pub fn browser() -> Needs {
        super::browser().is_none().then(|| "no Chromium: install it, or name one with HEDGEROW_CHROMIUM".to_owned())
    }

    /// A variable of the environment that names a path.
    pub fn variable(name: &str) -> Needs {
        super::variable(name).is_none().then(|| format!("{name} is not set"))
    }
}

/// The path that a variable of the environment names; an empty one is as one that is not set.
fn variable(name: &str) -> Option<PathBuf> {
    std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from)
}

/// The folder of scenes that are not in the repository.
///
/// # Panics
/// There is none: whoever takes it needs `needs::scenes()`.
pub fn scenes_folder() -> PathBuf {
    variable("HEDGEROW_SCENES").expect("HEDGEROW_SCENES names no folder of scenes")
}

/// Chromium: the one that HEDGEROW_CHROMIUM names, or that is on the path.
pub fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let found = || std::env::split_paths(&path).flat_map(|d| names.map(|n| d.join(n))).find(|p| p.is_file());
    variable("HEDGEROW_CHROMIUM").or_else(found)
}

/// A test: its name, what tells what it needs, and what it does.
pub type Test = (&'static str, fn() -> Needs, fn());

/// Runs the tests of all files as the arguments ask, in the manner of the standard harness.
///
/// What a test needs is asked only where the test may run: to ask may take opening a device, and nextest runs this program once a test.
pub fn run(files: Vec<(&'static str, Vec<Test>)>) -> ExitCode {
    let arguments = Arguments::from_args();
    // A filter may be a part of a name, or a name behind its reason.
    let may_run =
        |name: &str| arguments.filter.as_ref().is_none_or(|filter| filter.contains(name) || name.contains(&**filter));
    let trial = |file: &str, (name, needs, run): Test| {
        let name = format!("{file}::{name}");
        let needs = if may_run(&name) { needs() } else { None };
        let ignored = needs.is_some();
        let trial = Trial::test(name, move || {
            run();
            Ok(())
        });
        trial.with_ignored_flag(ignored).with_kind(needs.unwrap_or_default())
    };
    let trials = files.into_iter().flat_map(|(file, tests)| tests.into_iter().map(move |test| trial(file, test)));
    libtest_mimic::run(&arguments, trials.collect()).exit_code()
}

/// The tests of a file, each with what it needs.
macro_rules! tests {
    ($($name:ident: $needs:expr),* $(,)?) => {
        pub fn tests() -> Vec<crate::conditional::Test> {
            vec![$((stringify!($name), || $needs, $name as fn())),*]
        }
    };
}
pub(crate) use tests;
