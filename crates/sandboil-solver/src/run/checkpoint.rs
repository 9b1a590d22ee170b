//! A simulation as bytes. Everything that a step reads is stored, the weight tables included, so that a
//! restored simulation continues with the same bits.
//!
//! ```text
//! magic             8 bytes
//! format version    u32
//! build             u32, of the sources that wrote it
//! length of note    u64
//! note              bytes of the caller
//! simulation        postcard
//! checksum          u32, CRC-32 of all bytes before it
//! ```
//!
//! Numbers are little endian. The layout of a simulation is that of its types, which change with the sources:
//! bytes of another build are refused, not misread.

use crate::error::StateError;
use crc32fast::Hasher;
use serde::{Serialize, de::DeserializeOwned};
use std::io::{self, Write};

/// The first bytes of every stored state.
pub const MAGIC: &[u8] = b"SANDBOIL";
/// Increased when the layout around the simulation changes.
const FORMAT_VERSION: u32 = 1;
/// A writer that computes the checksum of its bytes, and keeps an error that postcard would lose.
struct Summed<W> {
    to: W,
    sum: Hasher,
    failure: Option<io::Error>,
}

impl<W> Summed<W> {
    fn keep_error<T>(&mut self, outcome: io::Result<T>) -> io::Result<T> {
        outcome.map_err(|error| {
            let kind = error.kind();
            self.failure = Some(error);
            kind.into()
        })
    }
}

impl<W: Write> Write for Summed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let outcome = self.to.write(bytes);
        let taken = self.keep_error(outcome)?;
        self.sum.update(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        let outcome = self.to.flush();
        self.keep_error(outcome)
    }
}

/// Checksum of the sources from which this program was built.
const BUILD: [u8; 4] = match u32::from_str_radix(env!("SANDBOIL_SOURCES"), 16) {
    Ok(sum) => sum.to_le_bytes(),
    Err(_) => panic!("the build script gives a number in base 16"),
};

/// Writes a state and a note.
///
/// # Errors
/// Errors of the writer `to`.
pub fn write(state: &impl Serialize, note: &[u8], to: impl Write) -> io::Result<()> {
    let mut to = Summed { to, sum: Hasher::new(), failure: None };
    let outcome = write_summed(state, note, &mut to);
    let Summed { mut to, sum, failure } = to;
    failure.map_or(outcome, Err)?;
    to.write_all(&sum.finalize().to_le_bytes())?;
    to.flush()
}

fn write_summed(state: &impl Serialize, note: &[u8], to: &mut impl Write) -> io::Result<()> {
    for part in [MAGIC, &FORMAT_VERSION.to_le_bytes(), &BUILD, &(note.len() as u64).to_le_bytes(), note] {
        to.write_all(part)?;
    }
    postcard::to_io(state, to).map(|_| ()).map_err(io::Error::other)
}

/// The parts of a stored state.
struct Parts<'a> {
    build: [u8; 4],
    note: &'a [u8],
    state: &'a [u8],
}

fn parts(bytes: &[u8]) -> Result<Parts<'_>, StateError> {
    const SHORT: StateError = StateError::Damaged("it ends too early");
    let rest = bytes.strip_prefix(MAGIC).ok_or(StateError::Foreign)?;
    let (version, _) = rest.split_first_chunk().ok_or(SHORT)?;
    match u32::from_le_bytes(*version) {
        FORMAT_VERSION => {}
        found => return Err(StateError::Version { found, needed: FORMAT_VERSION }),
    }
    let (summed, sum) = bytes.split_last_chunk().ok_or(SHORT)?;
    if crc32fast::hash(summed) != u32::from_le_bytes(*sum) {
        return Err(StateError::Damaged("its checksum is not that of its bytes"));
    }
    let rest = summed.get(MAGIC.len() + version.len()..).ok_or(SHORT)?;
    let (build, rest) = rest.split_first_chunk().ok_or(SHORT)?;
    let (length, rest) = rest.split_first_chunk().ok_or(SHORT)?;
    let length = usize::try_from(u64::from_le_bytes(*length)).map_err(|_| SHORT)?;
    let (note, state) = rest.split_at_checked(length).ok_or(SHORT)?;
    Ok(Parts { build: *build, note, state })
}

/// The note that was stored with a state, also by another build.
///
/// # Errors
/// Bytes that are not a state, of another format version or damaged.
pub fn note(bytes: &[u8]) -> Result<&[u8], StateError> {
    Ok(parts(bytes)?.note)
}

/// The state, read from its bytes.
///
/// # Errors
/// Bytes that are not a state, of another format version or build, or damaged.
pub fn read<T: DeserializeOwned>(bytes: &[u8]) -> Result<T, StateError> {
    let Parts { build: found, state, .. } = parts(bytes)?;
    if found != BUILD {
        return Err(StateError::Build);
    }
    match postcard::take_from_bytes(state) {
        Ok((state, [])) => Ok(state),
        _ => Err(StateError::Damaged("its content is not a simulation")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A writer that takes `room` bytes, then fails.
    struct Full {
        room: usize,
        flushes: bool,
    }

    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            if self.room == 0 {
                return Err(io::Error::other("full"));
            }
            let taken = bytes.len().min(self.room);
            self.room -= taken;
            Ok(taken)
        }

        fn flush(&mut self) -> io::Result<()> {
            if self.flushes { Ok(()) } else { Err(io::Error::other("cannot flush")) }
        }
    }

    #[test]
    fn write_errors_are_those_of_the_writer() {
        let state = vec![1.0_f64; 100];
        let mut whole = Vec::new();
        write(&state, b"note", &mut whole).unwrap();
        assert_eq!(read::<Vec<f64>>(&whole), Ok(state.clone()));
        for room in 0..whole.len() {
            let message = write(&state, b"note", Full { room, flushes: true }).unwrap_err().to_string();
            assert_eq!(message, "full", "{room}");
        }
        let message = write(&state, b"note", Full { room: whole.len(), flushes: false }).unwrap_err();
        assert_eq!(message.to_string(), "cannot flush");
    }
}
