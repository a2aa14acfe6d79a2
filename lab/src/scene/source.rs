//! Reading a file: unpacked on the fly, with progress, and with errors that name it.

use super::{LoadOptions, Progress, lookup};
use crate::{Error, Result};
use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use std::fs::File;
use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::path::Path;

const BUFFER_BYTES: usize = 1 << 18;

/// Opens a file; one that ends in `.zst` is unpacked while it is read.
pub(super) fn open<'a>(path: &Path, options: &LoadOptions<'a>) -> Result<Box<dyn BufRead + 'a>> {
    let file = File::open(path).map_err(Error::file(path))?;
    let total = file.metadata().map_err(Error::file(path))?.len();
    let counted = BufReader::with_capacity(BUFFER_BYTES, Counted { file, done: 0, total, progress: options.progress });
    if lookup::is_packed(path) {
        Ok(Box::new(BufReader::with_capacity(BUFFER_BYTES, Unpacked { source: Some(counted), frame: None })))
    } else {
        Ok(Box::new(counted))
    }
}

/// The whole file, unpacked.
pub(super) fn bytes(path: &Path, options: &LoadOptions<'_>) -> Result<Vec<u8>> {
    let mut reader = open(path, options)?;
    let mut bytes = Vec::new();
    // Not `read_to_end`: that begins with reads of a few bytes, each of which would be progress.
    loop {
        let buffered = reader.fill_buf().map_err(|e| read_error(path, e))?;
        if buffered.is_empty() {
            return Ok(bytes);
        }
        bytes.extend_from_slice(buffered);
        let taken = buffered.len();
        reader.consume(taken);
    }
}

/// What a failed read means for the file.
pub(super) fn read_error(path: &Path, error: io::Error) -> Error {
    let name = path.display();
    match error.kind() {
        ErrorKind::UnexpectedEof => Error::Malformed(format!("{name}: ends too early; is it cut off?")),
        ErrorKind::InvalidData | ErrorKind::Other if lookup::is_packed(path) => {
            Error::Malformed(format!("{name}: cannot be unpacked ({error}); is it cut off? fetch or pack it again"))
        }
        _ => Error::file(path)(error),
    }
}

/// Counts the bytes that pass.
struct Counted<'a> {
    file: File,
    done: u64,
    total: u64,
    progress: Option<&'a dyn Fn(Progress)>,
}

impl Read for Counted<'_> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(buffer)?;
        self.done += read as u64;
        if let Some(progress) = self.progress {
            progress(Progress { done: self.done, total: self.total });
        }
        Ok(read)
    }
}

/// The content of a `.zst` file: its frames one after the other, each compared with its checksum.
struct Unpacked<R: BufRead> {
    /// Where the next frame begins; lent to `frame` while that lasts.
    source: Option<R>,
    frame: Option<StreamingDecoder<R, FrameDecoder>>,
}

impl<R: BufRead> Read for Unpacked<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            if let Some(frame) = &mut self.frame {
                let read = frame.read(buffer)?;
                if read > 0 || buffer.is_empty() {
                    return Ok(read);
                }
            }
            if let Some(frame) = self.frame.take() {
                let decoder = &frame.decoder;
                let (told, found) = (decoder.get_checksum_from_data(), decoder.get_calculated_checksum());
                if told.is_some() && told != found {
                    return Err(io::Error::new(ErrorKind::InvalidData, "the checksum is wrong"));
                }
                self.source = Some(frame.into_inner());
            }
            let Some(mut source) = self.source.take() else { return Ok(0) };
            if source.fill_buf()?.is_empty() {
                return Ok(0);
            }
            let frame =
                StreamingDecoder::new(source).map_err(|e| io::Error::new(ErrorKind::InvalidData, e.to_string()))?;
            self.frame = Some(frame);
        }
    }
}
