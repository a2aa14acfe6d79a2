//! What the passes take: a struct for each block of push constants that shaders declare, which `build.rs` writes from their SPIR-V.
//! Passes of one family share a block; each takes only the members that its shader reads.

use super::shaders::{Block, Takes};

include!(concat!(env!("OUT_DIR"), "/arguments.rs"));
