//! Push constants: declared once on the host, compared with the shader's by reflection (src/layouts.rs).

/// Declares the struct of a module's push constants, in the order and under the names of its shaders, ready to be pushed;
/// its layout is `push_constants()` to the tests. Words that only fill up to a multiple of 8 bytes are called `padding`.
macro_rules! push_constants {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[$member_meta:meta])* $member_vis:vis $member:ident: $ty:ty),* $(,)?
    }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
        #[repr(C)]
        $vis struct $name { $($(#[$member_meta])* $member_vis $member: $ty),* }

        #[cfg(all(test, feature = "compile-shaders"))]
        pub(crate) fn push_constants() -> crate::layouts::Layout {
            crate::layouts::layout_of!($name { $($member),* })
        }
    };
}
pub(crate) use push_constants;
