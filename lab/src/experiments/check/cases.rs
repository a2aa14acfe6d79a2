//! Cases of a group: each is tried, and the rest go on where one fails.

use crate::device::Device;
use anyhow::{anyhow, bail, ensure};
use serde::{Deserialize, Serialize};
use std::fmt::Debug;
use std::panic::{self, AssertUnwindSafe};
use std::sync::Mutex;

/// What a case found: nothing, or what is wrong, and where.
pub type Found = anyhow::Result<()>;

/// Wrong, unless both are the same; `what` names them.
///
/// # Errors
/// They differ.
pub fn same<T: PartialEq + Debug>(what: &str, got: &T, expected: &T) -> Found {
    ensure!(got == expected, "{what}: {got:?}, expected {expected:?}");
    Ok(())
}

/// Wrong at the first place where the slices differ.
///
/// # Errors
/// They differ.
pub fn same_all<T: PartialEq + Debug>(what: &str, got: &[T], expected: &[T]) -> Found {
    same(&format!("number of {what}s"), &got.len(), &expected.len())?;
    match got.iter().zip(expected).position(|(a, b)| a != b) {
        None => Ok(()),
        Some(i) => bail!("{what} {i}: {:?}, expected {:?}", got[i], expected[i]),
    }
}

/// A case that differs.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Difference {
    /// The case.
    pub case: String,
    /// What differs, and where.
    pub what: String,
}

/// What a group says while it runs, to the program that started its process.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Message {
    /// What it runs on.
    Ground(super::Ground),
    /// A case begins.
    Case(String),
    /// The case differs.
    Wrong(Difference),
    /// A case was left out, and why.
    LeftOut(String),
    /// All cases are done, or as many as should be.
    Done,
}

/// Cases that differ before a group gives up: the others would hardly say more.
const MOST_WRONG: u32 = 4;

/// Where the last panic was, and what it said.
static LAST_PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Keeps what panics say for the reports, instead of printing it. Of the process: for one that runs nothing but a group.
pub fn keep_panics() {
    panic::set_hook(Box::new(|info| {
        let what = info.payload_as_str().unwrap_or("a panic without words");
        let place = info.location().map(|at| format!(" ({}:{})", at.file(), at.line())).unwrap_or_default();
        let mut last = LAST_PANIC.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
        *last = Some(format!("{what}{place}"));
    }));
}

/// The cases of a group under way.
pub struct Cases<'a> {
    /// The device, for as long as the process lives.
    pub device: &'static Device,
    /// Whether there is time for a part of the cases only.
    pub quick: bool,
    tell: &'a mut dyn FnMut(Message),
    wrong: u32,
}

impl<'a> Cases<'a> {
    /// None yet.
    pub fn new(device: &'static Device, quick: bool, tell: &'a mut dyn FnMut(Message)) -> Cases<'a> {
        Cases { device, quick, tell, wrong: 0 }
    }

    /// Tries a case. One that panics is wrong, too: what tests share asserts.
    pub fn case(&mut self, name: impl Into<String>, run: impl FnOnce(&'static Device) -> Found) {
        if self.wrong == MOST_WRONG {
            return;
        }
        let name = name.into();
        (self.tell)(Message::Case(name.clone()));
        let device = self.device;
        let found = panic::catch_unwind(AssertUnwindSafe(|| {
            run(device)?;
            Ok(device.validation_messages()?)
        }));
        let found = found.unwrap_or_else(|_| {
            let last = LAST_PANIC.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).take();
            Err(anyhow!(last.unwrap_or_else(|| "a panic".into())))
        });
        if let Err(wrong) = found {
            self.wrong += 1;
            (self.tell)(Message::Wrong(Difference { case: name, what: wrong.to_string() }));
        }
    }

    /// Says that something is not tried here.
    pub fn left_out(&mut self, what: impl Into<String>) {
        (self.tell)(Message::LeftOut(what.into()));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_difference_names_its_place() {
        assert_eq!(same_all("word", &[1, 2, 3], &[1, 2, 3]).ok(), Some(()));
        let says = |found: Found| found.expect_err("they differ").to_string();
        assert_eq!(says(same_all("word", &[1, 7, 3], &[1, 2, 3])), "word 1: 7, expected 2");
        assert_eq!(says(same_all("word", &[1], &[1, 2, 3])), "number of words: 1, expected 3");
    }
}
