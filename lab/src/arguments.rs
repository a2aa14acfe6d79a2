//! What the laboratory's shaders are given: a struct for each block of push constants, which `build.rs` writes from their SPIR-V.

#![allow(missing_docs, reason = "GLSL says what they are")]

use hedgerow::gpu::shaders::{Block, Takes};

include!(concat!(env!("OUT_DIR"), "/arguments.rs"));
