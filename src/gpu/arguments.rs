//! What the passes are given: a struct for each block of push constants, which `build.rs` writes from the shaders' SPIR-V.

include!(concat!(env!("OUT_DIR"), "/arguments.rs"));
