//! How often a tree is built again while a camera flies.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::num::NonZeroU32;
use std::str::FromStr;

/// When a tree is built again. In the first frame it always is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum Cadence {
    /// The first tree is kept.
    Never,
    /// In every so many frames.
    Every(NonZeroU32),
    /// Where a rebuild is expected to win more than it takes ([`super::gain`]).
    Gain,
}

impl FromStr for Cadence {
    type Err = Error;

    fn from_str(text: &str) -> Result<Cadence> {
        match text {
            "never" => Ok(Cadence::Never),
            "gain" => Ok(Cadence::Gain),
            _ => text.parse().map(Cadence::Every).map_err(|_| {
                let what = "use never, gain, or a number of frames from 1 on, as in 3";
                Error::Argument(format!("--cadence {text} is unknown; {what}"))
            }),
        }
    }
}

impl fmt::Display for Cadence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Cadence::Never => f.pad("never"),
            Cadence::Every(frames) => f.pad(&frames.to_string()),
            Cadence::Gain => f.pad("gain"),
        }
    }
}

impl TryFrom<String> for Cadence {
    type Error = Error;

    fn try_from(text: String) -> Result<Cadence> {
        text.parse()
    }
}

impl From<Cadence> for String {
    fn from(cadence: Cadence) -> String {
        cadence.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cadence_is_never_a_number_of_frames_or_gain() {
        for name in ["never", "1", "3", "48", "gain"] {
            assert_eq!(name.parse::<Cadence>().expect(name).to_string(), name);
        }
        for wrong in ["0", "-1", "growth", "", "1.5"] {
            let error = wrong.parse::<Cadence>().expect_err(wrong).to_string();
            assert!(error.contains("use never, gain, or a number of frames from 1 on"), "{error}");
        }
    }
}
