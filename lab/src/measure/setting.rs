//! Where and how figures were measured, and what could not be: the same in the records of every experiment.

use super::provenance::{self, DeviceFacts, Machine};
use crate::Result;
use crate::device::Device;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Where and how it was measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Setting {
    /// The machine.
    pub machine: Machine,
    /// The device, if one was used.
    pub device: Option<DeviceFacts>,
    /// Commit of the program; empty if each record has it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub commit: String,
    /// When, RFC 3339 UTC; empty if each record has it.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub when: String,
    /// The command line that measures it again.
    pub command: String,
    /// Options with their values, for people.
    pub options: Vec<(String, String)>,
    /// What a reader must know to judge the figures, such as a peer that is none.
    pub notes: Vec<String>,
}

impl Setting {
    /// Of this process, on this machine and `device`.
    ///
    /// # Errors
    /// The device failed while its facts were measured.
    pub fn of(device: Option<&Device>, options: &[(&str, String)], notes: Vec<String>) -> Result<Setting> {
        Ok(Setting {
            machine: Machine::this(),
            device: device.map(DeviceFacts::of).transpose()?,
            commit: provenance::commit(),
            when: provenance::now(),
            command: provenance::command(),
            options: options.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect(),
            notes,
        })
    }
}

/// What could not be measured, or was wrong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Failure<At = Named> {
    /// Of what.
    #[serde(flatten)]
    pub at: At,
    /// What went wrong.
    pub what: String,
}

/// An experiment or a scene, with the builder and the point where it has them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Named {
    /// Its name.
    pub of: String,
}

impl Failure {
    /// Of something that has a name.
    pub fn named(of: impl Into<String>, what: impl ToString) -> Failure {
        Failure { at: Named { of: of.into() }, what: what.to_string() }
    }
}

impl fmt::Display for Named {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.of)
    }
}

impl<At: fmt::Display> fmt::Display for Failure<At> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.at, self.what)
    }
}
