//! The tests of the library for C.

#[cfg(unix)]
mod c_program;
mod device;
mod header;
mod null;
