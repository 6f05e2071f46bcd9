//! Checks that the output arrays of a call do not overlap.

use vg::{Error, Result};

/// Memory of the caller that a call writes: rows of equal length at equal distances.
#[derive(Clone, Debug)]
pub(super) struct Written {
    /// Name in errors.
    pub(super) argument: String,
    /// Address of the first byte.
    pub(super) first: usize,
    /// Bytes of a row, at most `stride`.
    pub(super) row: usize,
    /// Bytes from row to row.
    pub(super) stride: usize,
    /// Number of rows; 0 if nothing is written.
    pub(super) rows: usize,
}

impl Written {
    /// An array without gaps; nothing where the pointer is NULL.
    pub(super) fn array<T>(argument: &str, first: *const T, count: usize) -> Self {
        let row = count * size_of::<T>();
        let rows = usize::from(!first.is_null() && row > 0);
        Self { argument: argument.to_owned(), first: first.addr(), row, stride: row, rows }
    }

    /// The address after the last byte.
    fn end(&self) -> usize {
        self.first + (self.rows - 1) * self.stride + self.row
    }

    /// Whether the two have a byte in common. Rows of one may lie in the gaps of the other.
    fn shares_a_byte_with(&self, other: &Self) -> bool {
        let (mut i, mut k) = (0, 0);
        while i < self.rows && k < other.rows {
            let (a, b) = (self.first + i * self.stride, other.first + k * other.stride);
            match (a + self.row <= b, b + other.row <= a) {
                (true, _) => i += 1,
                (_, true) => k += 1,
                _ => return true,
            }
        }
        false
    }
}

/// # Errors
/// [`Error::Argument`] if two overlap, naming the one that comes later in the list.
pub(super) fn refuse(written: &[Written]) -> Result<()> {
    let mut order: Vec<usize> = (0..written.len()).filter(|&i| written[i].rows > 0).collect();
    order.sort_unstable_by_key(|&i| written[i].first);
    for (n, &i) in order.iter().enumerate() {
        let end = written[i].end();
        let near = order[n + 1..].iter().take_while(|&&k| written[k].first < end);
        if let Some(&k) = near.into_iter().find(|&&k| written[i].shares_a_byte_with(&written[k])) {
            let (earlier, later) = (&written[i.min(k)], &written[i.max(k)]);
            let found = format!("shares memory with {}", earlier.argument);
            return Err(Error::argument(later.argument.clone(), found, "memory of its own"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows(argument: &str, first: usize, row: usize, stride: usize, rows: usize) -> Written {
        Written { argument: argument.to_owned(), first, row, stride, rows }
    }

    #[test]
    fn rows_in_the_gaps_of_others_are_accepted_and_one_shared_byte_is_not() {
        let color = rows("color", 1000, 30, 40, 5);
        let message = |other: Written| refuse(&[color.clone(), other]).err().map(|e| e.to_string());
        let words = "depth: shares memory with color; allowed: memory of its own";
        assert_eq!(message(rows("depth", 1030, 10, 40, 5)), None, "in the gaps");
        assert_eq!(message(rows("depth", 1030, 11, 40, 5)).as_deref(), Some(words), "a byte too long");
        assert_eq!(message(rows("depth", 1029, 10, 40, 5)).as_deref(), Some(words), "a byte too early");
        assert_eq!(message(rows("depth", 1190, 8, 8, 1)), None, "behind the last row");
        assert_eq!(message(rows("depth", 1189, 8, 8, 1)).as_deref(), Some(words));
        assert_eq!(message(rows("depth", 992, 8, 8, 1)), None, "before the first");
        assert_eq!(message(rows("depth", 992, 9, 9, 1)).as_deref(), Some(words));
        assert_eq!(
            message(color.clone()).unwrap(),
            "color: shares memory with color; allowed: memory of its own"
        );
        assert_eq!(message(rows("depth", 1000, 30, 40, 0)), None, "nothing is written there");
    }

    #[test]
    fn tiles_of_one_sheet_do_not_overlap() {
        let tile = |i: usize| rows(&format!("targets[{i}]"), 16 * i, 16, 160, 12);
        let mut sheet: Vec<Written> = (0..10).map(tile).collect();
        refuse(&sheet).unwrap();
        sheet[7].first -= 1;
        let error = refuse(&sheet).unwrap_err().to_string();
        assert!(error.starts_with("targets[7]: shares memory with targets[6]"), "{error}");
    }
}
