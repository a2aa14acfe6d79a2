//! The laboratory's shaders, from the table that `build.rs` writes.

use crate::arguments::takes;
use hedgerow::gpu::shaders::Shader;

include!(concat!(env!("OUT_DIR"), "/shaders.rs"));
