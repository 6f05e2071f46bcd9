//! Depth order by a stable radix sort of the bits of z.
//!
//! Positive floats sort like their bits. Ties keep the order of storage, which makes the picture independent of threads
//! and of how the sort is divided.

/// Bits per pass: 2048 counters stay in L1, and 32 bits take at most three passes.
const DIGIT_BITS: u32 = 11;

/// Packs a depth key into the high half and a Gaussian's index into the low half.
pub(super) fn entry(key: u32, index: u32) -> u64 {
    u64::from(key) << 32 | u64::from(index)
}

/// The index of an [`entry`].
pub(super) fn index(entry: u64) -> u32 {
    entry as u32
}

/// Sorts `entries` by key, stably; `scratch` is resized as needed.
///
/// Only the bits in which the keys' differences from the smallest vary are sorted: a vehicle between 6 and 10 m needs
/// 24 of the 32.
pub(super) fn sort(entries: &mut Vec<u64>, scratch: &mut Vec<u64>) {
    let key = |e: u64| (e >> 32) as u32;
    let Some(smallest) = entries.iter().map(|&e| key(e)).min() else { return };
    let largest = entries.iter().map(|&e| key(e)).max().unwrap_or(smallest);
    let bits = u32::BITS - (largest - smallest).leading_zeros();
    let passes = bits.div_ceil(DIGIT_BITS);
    if passes == 0 {
        return;
    }
    // Equal parts: 24 bits are three passes of 8 rather than 11 + 11 + 2.
    let digit_bits = bits.div_ceil(passes);
    let mask = (1u32 << digit_bits) - 1;
    scratch.resize(entries.len(), 0);

    let mut counts = vec![[0u32; 1 << DIGIT_BITS]; passes as usize];
    for &e in entries.iter() {
        let distance = key(e) - smallest;
        for (pass, counts) in counts.iter_mut().enumerate() {
            counts[(distance >> (digit_bits * pass as u32) & mask) as usize] += 1;
        }
    }
    for (pass, counts) in counts.iter_mut().enumerate() {
        let mut offset = 0;
        for count in counts.iter_mut() {
            offset += std::mem::replace(count, offset);
        }
        for &e in entries.iter() {
            let digit = (key(e) - smallest) >> (digit_bits * pass as u32) & mask;
            let slot = &mut counts[digit as usize];
            scratch[*slot as usize] = e;
            *slot += 1;
        }
        std::mem::swap(entries, scratch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_is_that_of_a_stable_sort_for_every_width_of_keys() {
        let mut state = 1u64;
        let mut random = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            (state >> 33) as u32
        };
        for bits in [0, 1, 8, 11, 12, 22, 23, 31] {
            for n in [0u32, 1, 2, 1000, 5000] {
                let mut entries: Vec<u64> =
                    (0..n).map(|i| entry(0x3f80_0000 + (random() & ((1 << bits) - 1)), i)).collect();
                let mut expected = entries.clone();
                expected.sort_by_key(|e| e >> 32);
                sort(&mut entries, &mut Vec::new());
                assert_eq!(entries, expected, "{bits} bits, {n} entries");
            }
        }
    }
}
