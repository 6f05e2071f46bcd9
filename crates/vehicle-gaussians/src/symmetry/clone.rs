//! The tie between a clone and the Gaussian that it mirrors.

/// A Gaussian that is the mirror image of another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MirrorClone {
    /// Index of its original.
    pub(crate) of: u32,
    /// Factor on the stored colour, per channel ([`relight`](super::relight)).
    pub(crate) gain: [f32; 3],
}
