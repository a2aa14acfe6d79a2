//! The words of a SPIR-V module (SPIR-V specification, 2.3): a header, and instructions that each begin with their length and opcode.

pub(super) const HEADER_WORDS: usize = 5;
/// The word of the header that is more than every id.
pub(super) const BOUND: usize = 3;

/// The instructions of a module behind its header, each with its first word.
pub(super) struct Instructions<'a>(pub &'a [u32]);

impl<'a> Iterator for Instructions<'a> {
    type Item = &'a [u32];

    fn next(&mut self) -> Option<&'a [u32]> {
        let length = (self.0.first()? >> 16) as usize;
        let (instruction, rest) = self.0.split_at_checked(length.max(1))?;
        self.0 = rest;
        Some(instruction)
    }
}

/// What an instruction does.
pub(super) fn opcode(instruction: &[u32]) -> u32 {
    instruction[0] & 0xffff
}

/// Writes an instruction.
pub(super) fn push(words: &mut Vec<u32>, opcode: u32, operands: impl IntoIterator<Item = u32>) {
    let at = words.len();
    words.push(0);
    words.extend(operands);
    words[at] = ((words.len() - at) as u32) << 16 | opcode;
}
