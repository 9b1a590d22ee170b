//! Loops whose result does not depend on the number of threads: fixed chunks, each row written by one thread,
//! and one result for each chunk, read back in order.

use rayon::prelude::*;

/// Rows per chunk. Small enough to balance liquefied against elastic soil between threads, large enough that
/// handing a chunk over (about a microsecond) stays below a tenth of its work.
pub const CHUNK: usize = 32;

/// Domains below this many rows run on the calling thread: a barrier would cost more than it shares out.
pub const FEWEST_THREADED_ROWS: usize = 256;

/// Number of chunks of `rows` rows: the length of the results of [`for_each_chunk`].
pub fn chunks(rows: usize) -> usize {
    rows.div_ceil(CHUNK)
}

/// Up to three row-wise arrays that a loop writes together; unit slices stand for the ones it does not need.
pub struct Rows<'a, A, B = (), C = ()> {
    /// First array.
    pub a: &'a mut [A],
    /// Second array, of the same length.
    pub b: &'a mut [B],
    /// Third array, of the same length.
    pub c: &'a mut [C],
}

/// Calls `work(first_row, rows, result)` on every chunk.
pub fn for_each_chunk<A: Send, B: Send, C: Send, R: Send>(
    threaded: bool,
    rows: Rows<'_, A, B, C>,
    results: &mut [R],
    work: impl Fn(usize, Rows<'_, A, B, C>, &mut R) + Sync + Send,
) {
    let Rows { a, b, c } = rows;
    if threaded && a.len() >= FEWEST_THREADED_ROWS {
        a.par_chunks_mut(CHUNK)
            .zip(b.par_chunks_mut(CHUNK))
            .zip(c.par_chunks_mut(CHUNK))
            .zip(results.par_iter_mut())
            .enumerate()
            .for_each(|(chunk, (((a, b), c), result))| work(chunk * CHUNK, Rows { a, b, c }, result));
    } else {
        let chunks = a.chunks_mut(CHUNK).zip(b.chunks_mut(CHUNK)).zip(c.chunks_mut(CHUNK));
        for (chunk, (((a, b), c), result)) in chunks.zip(results.iter_mut()).enumerate() {
            work(chunk * CHUNK, Rows { a, b, c }, result);
        }
    }
}
