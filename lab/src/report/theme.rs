//! Colours, once for charts, page and pictures: the same builder has the same colour wherever it appears.
//!
//! Charts are drawn in the light colours; on the page each becomes a CSS variable that the dark scheme overrides.

use super::names::distinct;
use crate::measure::record::Record;
use plotters::style::RGBColor;

/// A colour with its name as a CSS variable and its value in either scheme.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Tone {
    /// CSS variable, without the dashes.
    pub variable: &'static str,
    /// On white.
    pub light: RGBColor,
    /// On near-black.
    pub dark: RGBColor,
}

const fn tone(variable: &'static str, light: u32, dark: u32) -> Tone {
    const fn rgb(hex: u32) -> RGBColor {
        RGBColor((hex >> 16) as u8, (hex >> 8) as u8, hex as u8)
    }
    Tone { variable, light: rgb(light), dark: rgb(dark) }
}

/// Behind everything.
pub const PAPER: Tone = tone("paper", 0xFFFFFF, 0x14181D);
/// Text.
pub const INK: Tone = tone("ink", 0x1B2128, 0xE8EDF2);
/// Axis labels and what is said in passing.
pub const MUTED: Tone = tone("muted", 0x58616B, 0xA3AEBA);
/// Grid lines.
pub const GRID: Tone = tone("grid", 0xE3E7EC, 0x2A313A);
/// Frontiers and envelopes.
pub const BEST: Tone = tone("best", 0xC9A227, 0xE3C04F);

/// One a builder, in order of appearance; told apart with any of the usual colour blindnesses, and by label besides.
pub const SERIES: [Tone; 10] = [
    tone("series-0", 0x0B63C4, 0x6CB2FF),
    tone("series-1", 0xC84A08, 0xFF9C55),
    tone("series-2", 0x17803F, 0x5FCF8C),
    tone("series-3", 0xA62A78, 0xF28DC9),
    tone("series-4", 0x6E4FC0, 0xB9A4FF),
    tone("series-5", 0x7E6300, 0xDCC04A),
    tone("series-6", 0x0A7783, 0x52D0DD),
    tone("series-7", 0xB3261E, 0xFF8A82),
    tone("series-8", 0x515B66, 0xB4BEC9),
    tone("series-9", 0x6A4524, 0xD4A87F),
];

/// One a phase, in order of appearance: dark to light as a build proceeds (viridis).
pub const PHASES: [Tone; 8] = [
    tone("phase-0", 0x46327E, 0x6A55A8),
    tone("phase-1", 0x365C8D, 0x4B7DB8),
    tone("phase-2", 0x277F8E, 0x35A0B2),
    tone("phase-3", 0x1FA187, 0x2BBE9F),
    tone("phase-4", 0x4AC16D, 0x5BD07D),
    tone("phase-5", 0xA0DA39, 0xABE04B),
    tone("phase-6", 0xFDE725, 0xFDE74C),
    tone("phase-7", 0xB8B4A8, 0x8B8880),
];

/// Every tone.
pub fn all() -> impl Iterator<Item = Tone> {
    [PAPER, INK, MUTED, GRID, BEST].into_iter().chain(SERIES).chain(PHASES)
}

/// `#RRGGBB`, as plotters writes it.
pub fn hex(colour: RGBColor) -> String {
    format!("#{:02X}{:02X}{:02X}", colour.0, colour.1, colour.2)
}

/// What stands for what on the whole page.
#[derive(Debug, Clone, Default)]
pub struct Legend {
    /// All builders, in order.
    pub builders: Vec<String>,
    /// All phases, in order.
    pub phases: Vec<String>,
}

impl Legend {
    /// Colours for everything in `records`, in order of appearance.
    pub fn of<'a>(records: impl IntoIterator<Item = &'a Record, IntoIter: Clone>) -> Legend {
        let records = records.into_iter();
        let phases = records.clone().flat_map(|record| &record.build.phases);
        Legend {
            builders: distinct(records.map(|record| record.builder.clone())),
            phases: distinct(phases.map(|phase| phase.name.clone())),
        }
    }

    /// The colour of a builder.
    pub fn builder(&self, name: &str) -> Tone {
        pick(&SERIES, &self.builders, name)
    }

    /// The colour of a phase.
    pub fn phase(&self, name: &str) -> Tone {
        pick(&PHASES, &self.phases, name)
    }
}

fn pick(tones: &[Tone], names: &[String], name: &str) -> Tone {
    let position = names.iter().position(|n| n == name).unwrap_or(0);
    tones[position % tones.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_two_tones_share_a_light_colour_or_a_name() {
        // Charts are recoloured by replacing the light colour: two tones of one colour would become one.
        let tones: Vec<_> = all().collect();
        for (i, a) in tones.iter().enumerate() {
            for b in &tones[i + 1..] {
                assert!(a.light != b.light && a.variable != b.variable, "{a:?} and {b:?}");
            }
        }
    }

    #[test]
    fn text_stands_out_from_the_paper_in_both_schemes() {
        // WCAG 2: contrast of at least 4.5 for text, 3 for the marks of a chart.
        let luminance = |c: RGBColor| {
            let linear = |v: u8| {
                let v = f64::from(v) / 255.0;
                if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
            };
            0.2126 * linear(c.0) + 0.7152 * linear(c.1) + 0.0722 * linear(c.2)
        };
        let contrast = |a, b| {
            let (a, b): (f64, f64) = (luminance(a), luminance(b));
            (a.max(b) + 0.05) / (a.min(b) + 0.05)
        };
        for tone in [INK, MUTED].into_iter().chain(SERIES) {
            assert!(contrast(tone.light, PAPER.light) >= 4.5, "{tone:?} on white");
            assert!(contrast(tone.dark, PAPER.dark) >= 4.5, "{tone:?} on black");
        }
    }
}
