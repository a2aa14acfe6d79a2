//! Groups that fail, for tests of the check itself: `HEDGEROW_CHECK_FAULTS=crash,hang,differ,panic`.

use super::{Group, group};
use crate::experiments::check::cases::{Cases, same};

/// The variable of the environment that asks for them.
const VARIABLE: &str = "HEDGEROW_CHECK_FAULTS";

const FAULTS: &[Group] = &[
    group("fault-crash", "a process that ends by a signal", |cases| cases.case("it aborts", |_| std::process::abort())),
    group("fault-hang", "a case that never ends", hang),
    group("fault-differ", "a case that differs", |cases| cases.case("two words", |_| same("word 1", &7, &2))),
    group("fault-panic", "a case that panics", |cases| cases.case("it panics", |_| panic!("no device is like this"))),
];

fn hang(cases: &mut Cases<'_>) {
    cases.case("it ends", |_| Ok(()));
    cases.case("it waits", |_| {
        loop {
            std::thread::park();
        }
    });
}

/// Those that the environment names.
pub fn asked_for() -> impl Iterator<Item = &'static Group> {
    let asked = std::env::var(VARIABLE).unwrap_or_default();
    FAULTS.iter().filter(move |fault| asked.split(',').any(|name| fault.name.strip_prefix("fault-") == Some(name)))
}
