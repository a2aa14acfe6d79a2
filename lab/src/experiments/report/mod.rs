//! `hedgerow report`: the records of many folders, as one page ([`joined`]) or as Markdown ([`markdown`]).

pub(crate) mod command;
pub mod joined;
pub mod markdown;
