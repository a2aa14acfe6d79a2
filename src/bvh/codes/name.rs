//! Names of codes: `NAME[+BOUNDS][/BITS]`, where the name of binning is `binQaA[~N]` with λ = 1/N.

use super::{Binning, Code, CodeBounds, Codes};
use crate::{Error, Result};
use std::fmt;
use std::str::FromStr;

/// The codes that are only a name.
const NAMES: [(Code, &str); 10] = [
    (Code::Mc30, "mc30"),
    (Code::Mc63, "mc63"),
    (Code::Emc64Sort, "emc64sort"),
    (Code::Emc64Var, "emc64var"),
    (Code::Emc64VarSize4, "emc64var-size4"),
    (Code::Emc64VarExtents, "emc64var-extents"),
    (Code::Emc64VarNoSize, "emc64var-nosize"),
    (Code::Mip6, "mip6"),
    (Code::Mip9, "mip9"),
    (Code::Mip12, "mip12"),
];

/// The codes, for people.
const KNOWN: &str = "mc30, mc63, emc64sort, emc64var, emc64var-size4, emc64var-extents, emc64var-nosize, mip6, mip9, mip12 or \
                         binQaA (Q 2, 4 or 6, A 0 to 9; ~N behind for a stretch factor's weight of 1/N, N a power of two to 2048)";

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Code::Bin(binning) => binning.fmt(f),
            _ => f.write_str(NAMES.iter().find(|(code, _)| code == self).expect("every other code has a name").1),
        }
    }
}

impl fmt::Display for Binning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "bin{}a{}", self.depth(), self.count_bits())?;
        if self.stretch() != Binning::STRETCH { write!(f, "~{}", self.stretch()) } else { Ok(()) }
    }
}

impl fmt::Display for Codes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.code.fmt(f)?;
        if self.bounds != CodeBounds::Full {
            write!(f, "+{}", self.bounds.name())?;
        }
        if self.bits != self.code.bits() { write!(f, "/{}", self.bits) } else { Ok(()) }
    }
}

/// `binQaA[~N]`.
fn binning(name: &str) -> Option<Binning> {
    let (name, stretch) = match name.split_once('~') {
        Some((name, stretch)) => (name, stretch.parse().ok()?),
        None => (name, Binning::STRETCH),
    };
    let (depth, count_bits) = name.strip_prefix("bin")?.split_once('a')?;
    Binning::new(depth.parse().ok()?, count_bits.parse().ok()?, stretch)
}

impl FromStr for Codes {
    type Err = Error;

    fn from_str(text: &str) -> Result<Codes> {
        let wrong = |what: String| Error::Argument(format!("codes {text:?}: {what}"));
        let (rest, bits) = match text.split_once('/') {
            Some((rest, bits)) => (rest, Some(bits)),
            None => (text, None),
        };
        let (name, bounds) = match rest.split_once('+') {
            Some((name, bounds)) => (name, Some(bounds)),
            None => (rest, None),
        };
        let named = NAMES.iter().find(|(_, n)| *n == name).map(|(code, _)| *code);
        let code = named
            .or_else(|| binning(name).map(Code::Bin))
            .ok_or_else(|| wrong(format!("{name:?} is unknown; choose one of {KNOWN}")))?;
        let mut codes = code.full();
        if let Some(bounds) = bounds {
            let known = CodeBounds::ALL.iter().find(|b| b.name() == bounds && **b != CodeBounds::Full);
            let known =
                known.ok_or_else(|| wrong(format!("+{bounds} is unknown; choose one of {}", CodeBounds::NAMES)))?;
            codes = codes
                .with_bounds(*known)
                .ok_or_else(|| wrong(format!("{name} has a grid of its own; it takes +concise or +centroid")))?;
        }
        if let Some(bits) = bits {
            let range = codes.least_bits()..=code.bits();
            codes.bits = bits
                .parse()
                .ok()
                .filter(|b| range.contains(b))
                .ok_or_else(|| wrong(format!("the bits after / are {} to {}", range.start(), range.end())))?;
        }
        Ok(codes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_round_trip() {
        for text in [
            "mc30",
            "mc63",
            "emc64sort",
            "emc64var",
            "emc64var-nosize",
            "mip6",
            "mip9/40",
            "mip12+concise",
            "bin2a0",
            "bin4a4",
            "bin6a9~256",
            "bin4a4~2048+concise",
            "bin4a3~1+centroid/32",
            "mc63+concise",
            "emc64var+robust",
            "mc30+robust/12",
            "emc64var+concise/32",
            "emc64var-size4/32",
            "emc64var-extents+robust/40",
        ] {
            assert_eq!(text.parse::<Codes>().expect(text).to_string(), text);
        }
        for code in Code::ALL {
            assert_eq!(code.full().to_string().parse::<Codes>().expect("its own name"), code.full());
        }
        assert_eq!("bin4a3~8".parse::<Codes>().expect("the default").to_string(), "bin4a3");
    }

    #[test]
    fn bad_names_say_what_there_is() {
        for (text, remedy) in [
            ("mc31", "emc64var-nosize"),
            ("mip7", "mip6, mip9, mip12"),
            ("bin3a3", "Q 2, 4 or 6"),
            ("bin4a10", "A 0 to 9"),
            ("bin4", "binQaA"),
            ("bin4a3~3", "a power of two"),
            ("bin4a3~4096", "to 2048"),
            ("bin4a3~0", "to 2048"),
            ("mc30+tight", "+concise"),
            ("mip9+robust", "+centroid"),
            ("mc30/31", "1 to 30"),
            ("mip9/8", "9 to 64"),
            ("emc64var+robust/4", "5 to 64"),
        ] {
            let message = text.parse::<Codes>().expect_err(text).to_string();
            assert!(message.contains(remedy), "{message}");
        }
    }
}
